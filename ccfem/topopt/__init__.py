"""Topology optimisation: density filter, optimality criteria, SIMP and SOMP."""

from ccfem.topopt.compliance import Compliance
from ccfem.topopt.design import Design
from ccfem.topopt.outline import outline
from ccfem.topopt.part import as_problem, part_shape
from ccfem.topopt.simp import Simp
from ccfem.topopt.somp import Somp

__all__ = ["Compliance", "Design", "Simp", "Somp", "as_problem", "outline", "part_shape"]
