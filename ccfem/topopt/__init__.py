"""Topology optimisation: density filter, optimality criteria, SIMP."""

from ccfem.topopt.compliance import compliance_of
from ccfem.topopt.criteria import optimality_criteria
from ccfem.topopt.design import Design
from ccfem.topopt.filters import ConeFilter
from ccfem.topopt.simp import FILTERS, simp, simp_factor

__all__ = [
    "FILTERS",
    "ConeFilter",
    "Design",
    "compliance_of",
    "optimality_criteria",
    "simp",
    "simp_factor",
]
