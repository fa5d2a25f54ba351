"""Cases: ready problems, one file a case. The module's name is the case's name."""

from ccfem.cases.case import Case
from ccfem.cases.named import create_case, named_cases

__all__ = ["Case", "create_case", "named_cases"]
