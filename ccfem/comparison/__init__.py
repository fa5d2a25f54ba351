"""Comparison of strategies on one part: runs, ranking, pictures, report and files."""

from ccfem.comparison.compare import compare
from ccfem.comparison.remarks import verdict
from ccfem.comparison.result import Comparison, Run

__all__ = ["Comparison", "Run", "compare", "verdict"]
