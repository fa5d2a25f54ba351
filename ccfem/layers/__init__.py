"""Layers, and slicing."""

from ccfem.layers.layer import Layer
from ccfem.layers.slicing.planar import plane_frame, slice_heights, slice_planar

__all__ = ["Layer", "plane_frame", "slice_heights", "slice_planar"]
