"""The virtual test: the part re-solved with its fibres, before anything is printed."""

from ccfem.judging.virtual_testing.strand import Strand
from ccfem.judging.virtual_testing.virtual_test import (
    Bracket,
    VirtualTest,
    virtual_bracket,
    virtual_test,
)

__all__ = ["Bracket", "Strand", "VirtualTest", "virtual_bracket", "virtual_test"]
