"""Cases: ready problems, and parts from part files."""

from ccfem.base.lazy_modules import submodules
from ccfem.cases.case import Case
from ccfem.cases.optimised import Optimised, optimise
from ccfem.cases.reading import create_case, named_cases, read

__all__ = ["Case", "Optimised", "create_case", "named_cases", "optimise", "read"]

__getattr__ = submodules(__name__)
