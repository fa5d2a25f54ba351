"""Comparison of strategies on one part: runs, ranking, pictures, report and files."""

from ccfem.comparison.citations import bibtex, cited
from ccfem.comparison.compare import compare
from ccfem.comparison.fibre_front import fibre_front
from ccfem.comparison.front_points import FibreFront
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.saving import save

__all__ = [
    "Comparison",
    "FibreFront",
    "Run",
    "bibtex",
    "cited",
    "compare",
    "fibre_front",
    "save",
]
