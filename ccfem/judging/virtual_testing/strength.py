"""The load at first failure of a part: of its matrix, its fibre or the bond between its layers.

All limits scale with the load, since the solution does: also with fibres that carry tension only
and supports that only press. Debonding of strands and damage after the first failure are not
predicted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ccfem.base.arrays import FloatArray, freeze, in_brief
from ccfem.base.errors import InputError
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.fem.elasticity.zone import ZONE, averaged_mises
from ccfem.judging.virtual_testing.interlayer import Interlayer, interlayer
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.judging.virtual_testing.strengths import Limits
from ccfem.judging.virtual_testing.virtual_test import VirtualTest
from ccfem.slicing.layers import Layer

FIBRE_SHARE = 0.99
"""Share of the fibre length whose axial force stays below the fibre's index."""


@dataclass(frozen=True)
class FirstFailure:
    """When, how and where a part first fails.

    Attributes
    ----------
    load : float, N
        Size of the load at first failure.
    what : str
        "matrix", "fibre" or "interlayer".
    where : (3,) array, mm
        Middle of the cell, or of the piece of fibre, that decides.
    matrix_load, fibre_load : float, N
        Loads at which matrix and fibre would fail; infinite where no fibre is stretched.
    matrix_index : float, MPa
        Peak of the averaged von Mises stress under the load of the test.
    fibre_index : float, N
        Axial force that 99 % of the fibre length stays below under the load of the test.
    interlayer_load : float, N
        Load at which layers would come apart; infinite where nothing opens or slides, and where
        that was not judged.
    interlayer_index : float
        f of `ccfem.judging.virtual_testing.interlayer` under the load of the test: 1 at failure;
        NaN where not judged.
    interlayer_where : (3,) array, mm
        Middle of the cell that has it; NaN where not judged.
    opening, sliding : float, MPa
        Traction there across the layer and in it; NaN where not judged.
    interlayer_zones : tuple of floats, N
        `interlayer_load` with cells judged from 3, from 1.5 and from 0 mm on from loads and
        supports; empty where not judged.
    note : str
        Why the bond between layers was not judged, or what is doubtful about it; else empty.
    """

    load: float
    what: str
    where: FloatArray
    matrix_load: float
    fibre_load: float
    matrix_index: float
    fibre_index: float
    interlayer_load: float = np.inf
    interlayer_index: float = np.nan
    interlayer_where: FloatArray = field(default_factory=lambda: np.full(3, np.nan))
    opening: float = np.nan
    sliding: float = np.nan
    interlayer_zones: tuple[float, ...] = ()
    note: str = ""

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, where=float, interlayer_where=float)


def first_failure(
    test: VirtualTest,
    strand: Strand | None = None,
    matrix_strength: float | None = None,
    layers: Sequence[Layer] | None = None,
) -> FirstFailure:
    """Load at which the matrix, the fibre or the bond between layers first fails.

    Parameters
    ----------
    strand : Strand, optional
        Its strength is the fibre's; default 86 N.
    matrix_strength : float, MPa, optional
        Von Mises stress at failure, calibrated (`ccfem.judging.virtual_testing.calibration`);
        default the tensile strength of the material of the part.
    layers : sequence of Layer, optional
        Of the matrix. Without them, and where the material has no strength between layers, that
        bond is not judged; `FirstFailure.note` says so where layers are given.

    Raises
    ------
    InputError
        When the strength of matrix or fibre is missing.
    """
    limits = Limits.of(test.solution.problem.material, strand, matrix_strength)
    matrix_index, matrix_at = matrix_peak(test.solution)
    fibre_index, fibre_at = fibre_peak(test)
    matrix_load = test.force * limits.matrix / matrix_index
    fibre_load = test.force * limits.fibre / fibre_index if fibre_index > 0.0 else np.inf
    bond = _interlayer_result(test.solution, layers)
    zones: tuple[float, ...] = ()
    if isinstance(bond, Interlayer):
        zones = tuple(test.force / f if f > 0.0 else np.inf for f in bond.zone_indices)
    failures = [("matrix", matrix_load, matrix_at), ("fibre", fibre_load, fibre_at)]
    failures += [("interlayer", zones[0], bond.where)] if isinstance(bond, Interlayer) else []
    what, load, where = min(failures, key=lambda failure: failure[1])
    first = FirstFailure(load, what, where, matrix_load, fibre_load, matrix_index, fibre_index)
    if not isinstance(bond, Interlayer):
        return replace(first, note=bond)
    return replace(
        first,
        interlayer_load=zones[0],
        interlayer_index=bond.index,
        interlayer_where=bond.where,
        opening=bond.opening,
        sliding=bond.sliding,
        interlayer_zones=zones,
        note=bond.note,
    )


def _interlayer_result(stress: StressField, layers: Sequence[Layer] | None) -> Interlayer | str:
    """Return what `interlayer` finds, or why it finds nothing; empty without layers."""
    if layers is None:
        return ""
    try:
        return interlayer(stress, layers)
    except InputError as error:
        return f"bond between layers not judged: {error}"


def fibre_peak(test: VirtualTest, share: float = FIBRE_SHARE) -> tuple[float, FloatArray]:
    """Axial force, N, that `share` of the fibre length stays below, and a place (3,) of it."""
    order = np.argsort(test.axial_force, kind="stable")
    reached = np.cumsum((test.strands.length * test.strands.share)[order])
    at = order[min(np.searchsorted(reached, share * reached[-1]), len(order) - 1)]
    return float(test.axial_force[at]), test.strands.middle[at]


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
