"""Comparison of strategies on one part: runs, ranking, pictures, report and files."""

from ccfem.base.lazy_modules import submodules
from ccfem.comparison.citations import bibtex, cited
from ccfem.comparison.engine import answer, compare
from ccfem.comparison.files import save
from ccfem.comparison.front_plans import fibre_front
from ccfem.comparison.front_points import FibreFront
from ccfem.comparison.request import Request
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run

__all__ = [
    "Comparison",
    "FibreFront",
    "Request",
    "Run",
    "answer",
    "bibtex",
    "cited",
    "compare",
    "fibre_front",
    "save",
]

__getattr__ = submodules(__name__)
