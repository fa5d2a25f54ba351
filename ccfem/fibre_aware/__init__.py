"""Planning by what fibre does to the part: the best possible, pruning, and field design."""
