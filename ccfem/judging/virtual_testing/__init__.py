"""The virtual test: the part re-solved with its fibres, before anything is printed."""

from ccfem.judging.virtual_testing.several_cases import specimens
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import (
    Bracket,
    VirtualTest,
    virtual_bracket,
    virtual_test,
)
from ccfem.judging.virtual_testing.strand import RHO, Strand
from ccfem.judging.virtual_testing.strands import Strands, cut_strands
from ccfem.judging.virtual_testing.strength import first_failure

__all__ = [
    "RHO",
    "Bracket",
    "Specimen",
    "Strand",
    "Strands",
    "VirtualTest",
    "cut_strands",
    "first_failure",
    "specimens",
    "virtual_bracket",
    "virtual_test",
]
