"""Layers, flat or curved, the stress on them, and the slicers that make them."""

from ccfem.slicing import slicers as slicing
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import LayerStress, stress_on
from ccfem.slicing.layers.plane import Plane, plane_frame
from ccfem.slicing.layers.slicer import Slicer

__all__ = ["Layer", "LayerStress", "Plane", "Slicer", "plane_frame", "slicing", "stress_on"]
