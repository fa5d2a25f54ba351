"""Layers, and slicing."""

from ccfem.layers.layer import Layer
from ccfem.layers.slicing.planar import Planar, plane_frame, slice_heights

__all__ = ["Layer", "Planar", "plane_frame", "slice_heights"]
