"""Which layers and regions of a part get fibre, settled before any strategy plans."""

from ccfem.paths.placement.fibre_places import (
    FibrePlaces,
    FibreRegion,
    InBody,
    InBox,
    InCylinder,
    NearPatch,
)

__all__ = ["FibrePlaces", "FibreRegion", "InBody", "InBox", "InCylinder", "NearPatch"]
