"""Smooth, differentiable indices of how near a part is to its first failure.

First failure (`ccfem.judging.virtual_testing.strength`) depends on peaks: of the force in the
fibre, of the stress in the matrix, of the traction between layers. Each peak is paired with a
p-norm over the part, and the relative change of the norm stands for that of the peak. The peaks
themselves say how much each of them counts (Le, Norato, Bruns, Ha and Tortorelli, Structural and
Multidisciplinary Optimization 41, 2010, 605-620: the p-norm, and its factor that follows the true
peak). Laws of failure give the index of their averaged stress, which is derived by differences.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, TypeAlias, TypeVar

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, in_brief
from ccfem.base.errors import InputError
from ccfem.base.tensor import from_voigt, to_voigt, von_mises
from ccfem.fem.elasticity import StressField
from ccfem.fem.elasticity.loads import strain_forces
from ccfem.fem.elasticity.recovery import cell_strain, times
from ccfem.fem.elasticity.zone import BALL, ZONE, ball_averages, ball_shares, distance_from_patches
from ccfem.judging.virtual_testing import failure_laws
from ccfem.judging.virtual_testing.strand import Limits

Key = TypeVar("Key", bound=Hashable)

POWER = 16.0
"""Power p of the norm over cells or pieces of fibre."""

_BETWEEN = 8.0
"""Power of the norm over the indices, which approximates the largest of them."""

_HOT = 1e-9
"""Share of the largest weight below which a cell does not count in a derivative."""

_STEP = 1e-6
"""Step of the differences of an index, over the size of the stress."""

Index: TypeAlias = Callable[[FloatArray], FloatArray | None]
"""Index (k,) of a law of failure at stresses (k, 3, 3), MPa; None where it cannot judge them."""

_ENGINEERING = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])


@dataclass(frozen=True)
class Peak:
    """One index."""

    index: float  # its peak: 1 at failure
    norm: float  # its p-norm, in a scale of its own
    by_displacement: FloatArray  # (n, 3), 1/mm: derivative of the logarithm of the norm

    __repr__ = in_brief

    def over(self, ratio: float) -> "Peak":
        """Peak under the load divided by a ratio."""
        return replace(self, index=self.index / ratio, norm=self.norm / ratio)


def nearness(
    peaks: Mapping[Key, Peak], factors: Mapping[Key, float]
) -> tuple[float, dict[Key, float]]:
    """Logarithm of a smooth maximum of the indices, and the weight of each; the weights add to 1.

    Parameters
    ----------
    peaks : mapping of key to Peak
    factors : mapping of key to float
        Index over norm when last computed. Peaks without a factor, or with 0, do not count.
    """
    known = {key: factors.get(key, 0.0) * peak.norm for key, peak in peaks.items()}
    logs = {key: float(np.log(index)) for key, index in known.items() if index > 0.0}
    largest = max(logs.values())
    terms = {key: float(np.exp(_BETWEEN * (log - largest))) for key, log in logs.items()}
    whole = sum(terms.values())
    counts = {key: terms.get(key, 0.0) / whole for key in peaks}
    return largest + float(np.log(whole)) / _BETWEEN, counts


def check_stretched(strains: Sequence[FloatArray]) -> None:
    """Check that fibre is stretched somewhere, in one load case at least.

    Parameters
    ----------
    strains : sequence of (s,) array
        Along the fibre, of each load case.
    """
    if not any(strain.max(initial=0.0) > 0.0 for strain in strains):
        raise InputError(
            "strength is planned for where fibre is stretched; it is so nowhere: turn the load "
            "round, or plan with strength = 0"
        )


def stretched_index(
    strain: FloatArray, length: FloatArray, peak: float, limit: float
) -> tuple[float, float, FloatArray]:
    """Index of the fibre, its norm, and how much each piece counts in that; the sum is 1.

    Parameters
    ----------
    strain : (s,) array
        Along pieces of fibre, of which at least one is stretched; the others do not count.
    length : (s,) array, mm
        Length of fibre that each piece stands for.
    peak : float
        Highest strain, averaged over a length of strand.
    limit : float
        Strain at which a strand breaks.
    """
    most = float(strain.max())
    power = length * (np.maximum(strain, 0.0) / most) ** POWER
    whole = float(power.sum())
    norm = most * whole ** (1.0 / POWER) / limit
    return max(peak, 0.0) / limit, norm, power / whole


def _of_law(
    law: Any, limits: Limits, normal: FloatArray | None, stress: FloatArray
) -> FloatArray | None:
    """Index (k,) of a law at stresses (k, 3, 3) on layers of one normal."""
    normals = None if normal is None else np.broadcast_to(normal, (len(stress), 3))
    index: FloatArray | None = law.index(stress, limits, normals)
    return index


def _slopes(index: Callable[[FloatArray], Any], stress: FloatArray) -> FloatArray:
    """Derive an index by the components of stresses (k, 6), by differences: (k, 6), 1/MPa."""
    step = _STEP * np.linalg.norm(stress, axis=1)
    slopes = np.empty_like(stress)
    for k, unit in enumerate(np.eye(6)):
        ends = [index(from_voigt(stress + sign * step[:, None] * unit)) for sign in (1.0, -1.0)]
        slopes[:, k] = (ends[0] - ends[1]) / (2.0 * step)
    return slopes


@dataclass(frozen=True)
class MatrixPeaks:
    """The cells of a part in which the matrix is judged, for any number of displacements."""

    # Without fibre: its problem says what holds and loads the part, and the material.
    part: StressField

    __repr__ = in_brief

    @cached_property
    def judged(self) -> IntArray:
        """Cells outside the zone round loads and supports, as in `matrix_peak`."""
        part = self.part
        distance = distance_from_patches(part.problem, part.case, self.part.mesh.centres, ZONE)
        return np.flatnonzero(np.isinf(distance))

    @cached_property
    def _stiffness(self) -> FloatArray:
        problem = self.part.problem
        stiffness = problem.cell_stiffness
        return stiffness if problem.density is None else problem.density[:, None, None] * stiffness

    def _averages(self, values: FloatArray) -> FloatArray:
        """Averages (k, c) of the values (m, c) of all cells over a ball round each judged cell."""
        volumes = self.part.mesh.volumes
        return ball_averages(self.part.mesh.centres, values, volumes, self.judged, BALL)

    def _back(self, slopes: FloatArray) -> FloatArray:
        """Transpose of `_averages`: (m, c) of derivatives (k, c) by the averages."""
        size = np.abs(slopes).max(axis=1)
        hot = np.flatnonzero(size > _HOT * size.max())
        volumes = self.part.mesh.volumes
        return ball_shares(self.part.mesh.centres, slopes[hot], volumes, self.judged[hot], BALL)

    def _norm(self, index: FloatArray) -> tuple[float, float, FloatArray]:
        """Peak and norm of an index (k,), and the derivative of the norm's logarithm by it."""
        peak = float(index.max())
        weight = self.part.mesh.volumes[self.judged] * (index / peak) ** POWER
        whole = float(weight.sum())
        slope = np.where(index > 0.0, weight / (whole * np.where(index > 0.0, index, 1.0)), 0.0)
        return peak, peak * whole ** (1.0 / POWER), slope

    def _by_displacement(self, by_stress: FloatArray) -> FloatArray:
        """Turn a derivative by the stress (m, 6) of each cell into one by the displacement."""
        mesh, stiffness = self.part.mesh, self._stiffness
        turned = np.swapaxes(stiffness, -1, -2)
        return strain_forces(mesh, times(turned, by_stress) / mesh.volumes[:, None])

    def matrix(self, displacement: FloatArray, strength: float) -> Peak:
        """Von Mises stress of the matrix, averaged over a ball, over its strength, MPa.

        `displacement` (n, 3), mm, is that of the part with its fibre.
        """
        stress, problem = self._stress(displacement), self.part.problem
        mises = von_mises(stress)
        average = self._averages(problem.in_material(mises)[:, None])[:, 0]
        peak, norm, slope = self._norm(average / strength)
        by_mises = problem.in_material(self._back(slope[:, None] / strength))
        deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
        size = np.where(mises > 0.0, mises, 1.0)
        by_stress = to_voigt(1.5 * deviator) * _ENGINEERING * (by_mises / size[:, None])
        return Peak(peak, norm, self._by_displacement(by_stress))

    def averaged(self, displacement: FloatArray, index: Index) -> Peak | None:
        """Index (k,) of averaged stresses (k, 3, 3); None where there is none, or none above 0."""
        in_material = self.part.problem.in_material
        stress = self._averages(to_voigt(in_material(self._stress(displacement))))
        values = index(from_voigt(stress))
        if values is None or not values.max() > 0.0:
            return None
        peak, norm, slope = self._norm(np.maximum(values, 0.0))
        hot = np.flatnonzero(slope > _HOT * slope.max())
        by_stress = np.zeros_like(stress)
        by_stress[hot] = slope[hot, None] * _slopes(index, stress[hot])
        return Peak(peak, norm, self._by_displacement(in_material(self._back(by_stress))))

    def peaks(
        self,
        displacement: FloatArray,
        fibre: Peak | None,
        limits: Limits,
        normal: FloatArray | None,
    ) -> dict[str, Peak]:
        """All indices: of the fibre, of the matrix, and of the laws of failure that have one.

        Parameters
        ----------
        displacement : (n, 3) array, mm
        fibre : Peak, optional
            None where no fibre is stretched.
        normal : (3,) array, optional
            Of all layers.
        """
        peaks = {} if fibre is None else {"fibre": fibre}
        peaks["matrix"] = self.matrix(displacement, limits.matrix)
        for name, law in failure_laws.named().items():
            if hasattr(law, "index"):
                peak = self.averaged(displacement, partial(_of_law, law, limits, normal))
                peaks |= {} if peak is None else {name: peak}
        return peaks

    def _stress(self, displacement: FloatArray) -> FloatArray:
        strain = cell_strain(self.part.mesh, displacement)
        return from_voigt(times(self._stiffness, strain))
