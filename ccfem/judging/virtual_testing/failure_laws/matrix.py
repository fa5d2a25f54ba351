"""Failure of the matrix: its von Mises stress, averaged over a ball, reaches its strength."""

from collections.abc import Sequence

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.fem.elasticity import StressField
from ccfem.fem.elasticity.zone import ZONE, averaged_mises
from ccfem.judging.virtual_testing.stiffness_test import VirtualTest
from ccfem.judging.virtual_testing.strand import Failure, Limits
from ccfem.slicing.layers import Layer


def fails(test: VirtualTest, limits: Limits, _: Sequence[Layer] | None) -> Failure:
    """Load at which the matrix fails."""
    index, where = matrix_peak(test.solution)
    load = test.force * limits.matrix / index
    return Failure(load, where, values={"matrix_load": load, "matrix_index": index})


def matrix_peak(stress: StressField) -> tuple[float, FloatArray]:
    """Largest averaged von Mises stress of the matrix, MPa, and its place (3,).

    The von Mises stress of the cells is averaged by volume over a ball of 2 mm radius. Cells whose
    centroid is closer than 3 mm to a patch with a load or a support are left out, though they count
    in the averages of others. A whole flat face that slides in its plane, as a plane of symmetry
    does, is no such patch: no stress peaks there.

    Raises
    ------
    InputError
        When all cells are left out.
    """
    judged, average, centroid = averaged_mises(stress.problem, stress.case, stress.stress)
    if not len(judged):
        raise InputError(
            f"no cell lies farther than {ZONE:g} mm from the patches of loads and supports, so "
            "no matrix stress can be judged: the part is too small for this index"
        )
    peak = average.argmax()
    return float(average[peak]), centroid[judged[peak]]
