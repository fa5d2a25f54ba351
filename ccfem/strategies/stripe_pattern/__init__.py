"""What `stripes` stands on: a line field on a layer, its stripe pattern, strands packed side by side."""
