"""A line field on a layer, its stripe pattern, and strands packed side by side: for `stripes`."""
