"""Every published test of a printed part, beside what the virtual test predicts for it."""
