"""Topology optimisation: density filter, optimality criteria, SIMP and SOMP."""

from ccfem.fem.topopt.compliance import Compliance
from ccfem.fem.topopt.design import Design
from ccfem.fem.topopt.design_outline import outline
from ccfem.fem.topopt.part import as_problem, part_shape
from ccfem.fem.topopt.simp import Simp
from ccfem.fem.topopt.somp import Somp

__all__ = ["Compliance", "Design", "Simp", "Somp", "as_problem", "outline", "part_shape"]
