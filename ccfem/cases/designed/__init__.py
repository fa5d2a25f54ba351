"""Plates that topology optimisation designs: the parts of Wang et al. 2021.

A plate is given by its border, holes, supports and load. From these come the problem that is
optimised, the part that the optimum stands for, and the case of either part.
"""

from ccfem.cases.designed.border import Hole, Stretch
from ccfem.cases.designed.plate import LAMINATE, DesignPlate
from ccfem.cases.designed.plate_case import ELEMENT_SIZE, THICKNESS, case_of, designed_case

__all__ = [
    "ELEMENT_SIZE",
    "LAMINATE",
    "THICKNESS",
    "DesignPlate",
    "Hole",
    "Stretch",
    "case_of",
    "designed_case",
]
