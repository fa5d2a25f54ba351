"""Slicers: each turns a part into layers. One module a slicer."""
