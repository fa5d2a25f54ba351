"""The virtual test: the part re-solved with its fibres, before anything is printed."""
