"""The load at first failure of a part: the least of all laws of failure.

All limits scale with the load, since the solution does: also with fibres that carry tension only
and supports that only press. Debonding of strands and damage after the first failure are not
predicted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray, freeze, in_brief
from ccfem.fem.elasticity.zone import BALL, ZONE, ball_averages, distance_from_patches
from ccfem.judging.virtual_testing import failure_laws
from ccfem.judging.virtual_testing.failure_laws.fibre import fibre_peak as fibre_peak
from ccfem.judging.virtual_testing.failure_laws.interlayer import layer_normals
from ccfem.judging.virtual_testing.failure_laws.matrix import matrix_peak as matrix_peak
from ccfem.judging.virtual_testing.stiffness_test import VirtualTest
from ccfem.judging.virtual_testing.strand import Failure, Limits, Strand
from ccfem.slicing.layers import Layer


@dataclass(frozen=True)
class FirstFailure:
    """When, how and where a part first fails.

    Attributes
    ----------
    load : float, N
        Size of the load at first failure.
    what : str
        Name of the law: "matrix", "fibre", "interlayer" or another
        (`ccfem.judging.virtual_testing.failure_laws`).
    where : (3,) array, mm
        Middle of the cell, or of the piece of fibre, that decides.
    matrix_load, fibre_load : float, N
        Loads at which matrix and fibre would fail; infinite where no fibre is stretched.
    matrix_index : float, MPa
        Peak of the averaged von Mises stress under the load of the test.
    fibre_index : float, N
        Highest axial force in a strand, averaged over 5 mm, under the load of the test.
    interlayer_load : float, N
        Load at which layers would come apart; infinite where nothing opens or slides, and where
        that was not judged.
    interlayer_index : float
        f of `failure_laws.interlayer` under the load of the test: 1 at failure; NaN where not
        judged.
    interlayer_where : (3,) array, mm
        Middle of the cell that has it; NaN where not judged.
    opening, sliding : float, MPa
        Traction there across the layer and in it; NaN where not judged.
    interlayer_zones : tuple of floats, N
        `interlayer_load` with cells judged from 3, from 1.5 and from 0 mm on from loads and
        supports; empty where not judged.
    loads : mapping of str to float, N
        Load of each law that judged the part.
    note : str
        Why a law did not judge the part, or what is doubtful about it; else empty.
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
    loads: Mapping[str, float] = field(default_factory=dict)
    note: str = ""

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, where=float, interlayer_where=float, loads=dict)


def first_failure(
    test: VirtualTest,
    strand: Strand | None = None,
    matrix_strength: float | None = None,
    layers: Sequence[Layer] | None = None,
) -> FirstFailure:
    """Load at which the matrix, the fibre or the bond between layers first fails, or any other law.

    Parameters
    ----------
    strand : Strand, optional
        Its strength is the fibre's; default 105 N.
    matrix_strength : float, MPa, optional
        Von Mises stress at failure, calibrated (`ccfem.judging.virtual_testing.calibration`);
        default the tensile strength of the material of the part.
    layers : sequence of Layer, optional
        Of the matrix. Without them, and where the material has no strength between layers, that
        bond is not judged.

    Returns
    -------
    FirstFailure
        Its note names every law that did not judge the part.

    Raises
    ------
    InputError
        When the strength of matrix or fibre is missing.
    """
    limits = Limits.of(test.solution.problem.material, strand, matrix_strength)
    failures = {
        name: law.fails(test, limits, layers)
        if hasattr(law, "fails")
        else _by_index(law, test, limits, layers)
        for name, law in failure_laws.named().items()
    }
    judged = {name: failure for name, failure in failures.items() if not np.isnan(failure.load)}
    what = min(judged, key=lambda name: judged[name].load)
    values = {k: value for failure in failures.values() for k, value in failure.values.items()}
    return FirstFailure(
        load=judged[what].load,
        what=what,
        where=judged[what].where,
        loads={name: failure.load for name, failure in judged.items()},
        note="; ".join(filter(None, (_note(*law) for law in failures.items()))),
        **values,
    )


def _by_index(
    law: Any, test: VirtualTest, limits: Limits, layers: Sequence[Layer] | None
) -> Failure:
    """Find the load at which the index of a law is 1 somewhere away from loads and supports."""
    stress, mesh = test.solution, test.solution.mesh
    distance = distance_from_patches(stress.problem, stress.case, mesh.centres, ZONE)
    judged = np.flatnonzero(distance > ZONE)
    if not len(judged):
        return Failure()
    values = stress.problem.in_material(stress.stress).reshape(-1, 9)
    tensor = ball_averages(mesh.centres, values, mesh.volumes, judged, BALL).reshape(-1, 3, 3)
    normal = None if layers is None else layer_normals(layers, mesh.centres[judged])
    index = law.index(tensor, limits, normal)
    if index is None or np.isnan(index).any():
        return Failure()
    peak = int(index.argmax())
    load = test.force / float(index[peak]) if index[peak] > 0.0 else np.inf
    return Failure(load, mesh.centres[judged[peak]])


def _note(name: str, failure: Failure) -> str:
    """Return the note of a law, or that it gave neither a load nor a note."""
    if failure.note or not np.isnan(failure.load):
        return failure.note
    return f"law of failure '{name}' did not judge the part, and gave no reason"
