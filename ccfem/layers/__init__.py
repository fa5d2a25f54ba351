"""Layers, flat or curved, the stress on them, and the slicers that make them."""

from ccfem.layers import slicing
from ccfem.layers.layer import Layer
from ccfem.layers.layer_stress import LayerStress, stress_on
from ccfem.layers.plane import Plane, plane_frame
from ccfem.layers.slicer import Slicer

__all__ = ["Layer", "LayerStress", "Plane", "Slicer", "plane_frame", "slicing", "stress_on"]
