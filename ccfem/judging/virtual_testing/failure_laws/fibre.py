"""Failure of the fibre: the highest force in a strand, averaged over a length, is its strength."""

from collections.abc import Sequence

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.judging.virtual_testing.stiffness_test import VirtualTest
from ccfem.judging.virtual_testing.strand import Failure, Limits
from ccfem.judging.virtual_testing.strands import AVERAGING_LENGTH, Windows
from ccfem.slicing.layers import Layer


def fails(test: VirtualTest, limits: Limits, _: Sequence[Layer] | None) -> Failure:
    """Load at which the fibre fails; infinite where none is stretched."""
    index, where = fibre_peak(test)
    load = test.force * limits.fibre / index if index > 0.0 else np.inf
    return Failure(load, where, values={"fibre_load": load, "fibre_index": index})


def fibre_peak(test: VirtualTest, length: float = AVERAGING_LENGTH) -> tuple[float, FloatArray]:
    """Highest mean of the axial force over a length of strand, mm, in N, and its place (3,)."""
    return Windows(test.strands, length).highest(test.axial_force)
