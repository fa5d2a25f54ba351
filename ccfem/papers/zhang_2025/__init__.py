"""Zhang et al. 2025: dense strands along the principal stress on curved layers."""
