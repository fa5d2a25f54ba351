"""Topology optimisation: density filter, optimality criteria, SIMP and SOMP."""

from ccfem.topopt.compliance import compliance_of
from ccfem.topopt.design import Design
from ccfem.topopt.filters import ConeFilter
from ccfem.topopt.optimality_criteria import optimality_criteria
from ccfem.topopt.outline import outline
from ccfem.topopt.parametrisation import FILTERS, simp_factor
from ccfem.topopt.part import as_problem, solid
from ccfem.topopt.simp import simp
from ccfem.topopt.somp import ORIENTATIONS, somp

__all__ = [
    "FILTERS",
    "ORIENTATIONS",
    "ConeFilter",
    "Design",
    "as_problem",
    "compliance_of",
    "optimality_criteria",
    "outline",
    "simp",
    "simp_factor",
    "solid",
    "somp",
]
