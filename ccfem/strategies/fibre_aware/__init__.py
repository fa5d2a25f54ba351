"""Planning with the fibre's effect on the part: stiffness bounds, pruning and field design."""
