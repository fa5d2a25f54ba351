"""Planning: what a strategy is, the paths of a whole part, and equal length of fibre."""
