"""Geometry of polylines, isocontours, offsets and hatches in the plane."""
