"""Layers, flat or curved, the stress on them, and the slicers that make them."""

from ccfem.slicing import slicers as slicing
from ccfem.slicing.layers.layer import Layer, LayerStress, Plane, plane_frame, stress_on
from ccfem.slicing.layers.slicer import Slicer

__all__ = ["Layer", "LayerStress", "Plane", "Slicer", "plane_frame", "slicing", "stress_on"]
