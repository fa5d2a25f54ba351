"""Failure of the fibre: the force that 99 % of its length stays below reaches its strength."""

from collections.abc import Sequence

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.judging.virtual_testing.strand import Failure, Limits
from ccfem.judging.virtual_testing.virtual_test import VirtualTest
from ccfem.slicing.layers import Layer

FIBRE_SHARE = 0.99
"""Share of the fibre length whose axial force stays below the fibre's index."""


def fails(test: VirtualTest, limits: Limits, _: Sequence[Layer] | None) -> Failure:
    """Load at which the fibre fails; infinite where none is stretched."""
    index, where = fibre_peak(test)
    load = test.force * limits.fibre / index if index > 0.0 else np.inf
    return Failure(load, where, values={"fibre_load": load, "fibre_index": index})


def fibre_peak(test: VirtualTest, share: float = FIBRE_SHARE) -> tuple[float, FloatArray]:
    """Axial force, N, that `share` of the fibre length stays below, and a place (3,) of it."""
    order = np.argsort(test.axial_force, kind="stable")
    reached = np.cumsum((test.strands.length * test.strands.share)[order])
    at = order[min(np.searchsorted(reached, share * reached[-1]), len(order) - 1)]
    return float(test.axial_force[at]), test.strands.middle[at]
