"""Cases: ready problems, one file a case, and parts from part files."""

from ccfem.base.submodules import submodules
from ccfem.cases.case import Case
from ccfem.cases.named import create_case, named_cases
from ccfem.cases.optimised import Optimised, optimise
from ccfem.cases.reading import read

__all__ = ["Case", "Optimised", "create_case", "named_cases", "optimise", "read"]

__getattr__ = submodules(__name__)
