"""Topology optimisation: density filter, optimality criteria, SIMP."""

from ccfem.topopt.compliance import compliance_of
from ccfem.topopt.criteria import optimality_criteria
from ccfem.topopt.design import Design
from ccfem.topopt.filters import ConeFilter
from ccfem.topopt.outline import outline
from ccfem.topopt.simp import FILTERS, simp, simp_factor
from ccfem.topopt.three_point_bending import BendingBeam, three_point_bending

__all__ = [
    "FILTERS",
    "BendingBeam",
    "ConeFilter",
    "Design",
    "compliance_of",
    "optimality_criteria",
    "outline",
    "simp",
    "simp_factor",
    "three_point_bending",
]
