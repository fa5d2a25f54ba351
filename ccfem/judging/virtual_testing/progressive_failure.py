"""The load that breaks a part: matrix that softens, strands that break, layers that part.

Sequentially linear analysis (Rots, Belletti and Invernizzi, Engineering Fracture Mechanics 75,
2008, 590-614): the part is linear elastic between events. An event is a cell that cracks, or cracks
further, a strand that breaks, or layers that part. Each lowers a stiffness; the part is solved
again, and the load at which the next event comes follows by scaling.

Matrix: isotropic damage in steps, by the largest principal stress. A cell falls to a share of 0.4,
0.4^2 ... of its stiffness at stresses on a line that softens with strain. The line is made so that
all steps together take the energy of fracture per area of a crack band as wide as the cell, ``h = 2
/ sum |grad N . n|`` along the normal n of its crack (Bazant and Oh, Materiaux et Constructions 16,
1983, 155-177; Oliver, Int. J. Numerical Methods in Engineering 28, 1989, 461-474), whatever its
size.

Strands carry tension only. One breaks where its force, averaged over a length, reaches its
strength. It then carries nothing over that length. Where the bond of a strand to the matrix is
given as a force, strands come loose from their ends on (`virtual_testing.anchorage`).

Layers part where the traction of the averaged stress on them reaches the strength of their bond
(`failure_laws.interlayer`), if the layers and that strength are known.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, in_brief
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError, SolveError
from ccfem.base.parallel import one_blas_thread
from ccfem.base.tensor import from_voigt, principal
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity import Solver, StressField, cell_gradients
from ccfem.fem.elasticity.recovery import cell_strain, times
from ccfem.fem.elasticity.solvers import LARGEST_DIRECT, direct_backend
from ccfem.fem.elasticity.zone import ZONE, distance_from_patches
from ccfem.judging.virtual_testing.anchorage import Ends, StrandEnds
from ccfem.judging.virtual_testing.equilibrium import Equilibrium, bar_stiffness, equilibrium
from ccfem.judging.virtual_testing.failure_laws.interlayer import (
    layer_normals,
    parted_stiffness,
    parting_factors,
)
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strand import Limits, Strand
from ccfem.judging.virtual_testing.strands import Strands, Windows, cut_strands
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers import Layer

SOFTENING = 13.4
"""Length G_f E / f_t^2, mm, of the matrix: its energy of fracture per area over its strength."""

# The matrix: a saw-tooth law of softening, with the energy of fracture exact in every cell.


_LEFT = np.append(0.4 ** np.arange(6.0), 1e-3)
"""Share of its stiffness that a cell has after so many events."""


def tooth_strains(ductility: FloatArray) -> FloatArray:
    """Strains (6, ...) of the events of a cell, over the strain at its strength.

    They are where lines of the stiffness left meet the line on which the stress falls from the
    strength to zero, at a strain `ductility` times that at the strength.
    """
    left = _LEFT[:-1].reshape(-1, *(1,) * np.ndim(ductility))
    return np.asarray(ductility / (left * (ductility - 1.0) + 1.0))


def _spent(ductility: FloatArray) -> FloatArray:
    """Energy of all events of a cell, over the elastic energy at its strength."""
    return np.asarray(-np.diff(_LEFT) @ tooth_strains(ductility) ** 2)


_DUCTILITIES = 1.0 + np.logspace(-6.0, 6.0, 4001)


def ductility(band: FloatArray, softening: float) -> FloatArray:
    """Ductility (k,) with which cells spend the energy of fracture over a band.

    The events then take ``G_f / h = f_t^2 / (2 E) * 2 l / h`` a volume, l the softening length.

    Parameters
    ----------
    band : (k,) array, mm
        Width h of the crack band in each cell, below twice the softening length.
    softening : float, mm
    """
    spent = np.log(_spent(_DUCTILITIES))
    return np.asarray(np.interp(np.log(2.0 * softening / band), spent, _DUCTILITIES))


def band_width(gradients: FloatArray, normal: FloatArray) -> FloatArray:
    """Width (k,), mm, of the band that a crack of unit normal (k, 3) takes of each linear cell."""
    return np.asarray(2.0 / np.abs(np.einsum("kai,ki->ka", gradients, normal)).sum(axis=1))


def _largest_principal(stress: FloatArray) -> FloatArray:
    """Largest eigenvalue (k,) of symmetric tensors (k, 6) in Voigt order (Smith, 1961)."""
    x, y, z, yz, xz, xy = stress.T
    mean = (x + y + z) / 3.0
    x, y, z = x - mean, y - mean, z - mean
    off = yz**2 + xz**2 + xy**2
    size = np.sqrt((x**2 + y**2 + z**2 + 2.0 * off) / 6.0)
    third = x * y * z + 2.0 * yz * xz * xy - x * yz**2 - y * xz**2 - z * xy**2
    cube = np.maximum(size**3, 1e-300)
    angle = np.arccos(np.clip(0.5 * third / cube, -1.0, 1.0)) / 3.0
    return np.asarray(mean + 2.0 * size * np.cos(angle))


# The part with its damage, under a load of one.


@dataclass(frozen=True)
class Damage:
    """What is left of a part."""

    events: IntArray  # (m,): of each cell
    ductility: FloatArray  # (m,): of cells that have cracked; 1 in others
    # (s,) in [0, 1]: share of each piece of fibre that has not broken or come loose
    intact: FloatArray
    parted: BoolArray  # (m,): cells whose layers have parted

    def __post_init__(self) -> None:
        freeze(self, events=int, ductility=float, intact=float, parted=bool)

    @classmethod
    def none(cls, model: "_Model") -> "Damage":
        """Return a part with no damage."""
        cells, pieces = len(model.specimen.unreinforced.mesh.cells), len(model.windows.strands)
        none = np.zeros(cells, dtype=np.int64)
        return cls(none, np.ones(cells), np.ones(pieces), none.astype(bool))


class _Response(NamedTuple):
    """A damaged part under the load of its case, and how much more takes it to the next events.

    `cells` (m,), `layers` (m,), `windows` (w,) and `loose` (e,), of the ends of strands, are the
    factors on the load at which each fails.
    """

    balanced: Equilibrium
    stress: FloatArray
    force: float
    displacement: float
    cells: FloatArray
    layers: FloatArray
    windows: FloatArray
    ends: Ends
    loose: FloatArray

    @property
    def factor(self) -> float:
        """Factor on the load at the next event."""
        return min(self.factors.values())

    @property
    def factors(self) -> dict[str, float]:
        """Factor on the load at which each kind of event comes next."""
        kinds = {"matrix": self.cells, "fibre": self.windows, "layers": self.layers}
        kinds["bond"] = self.loose
        return {kind: float(values.min(initial=np.inf)) for kind, values in kinds.items()}


@dataclass(frozen=True)
class _Model:
    """What does not change while a part breaks."""

    specimen: Specimen
    windows: Windows
    strand: Strand
    limits: Limits
    softening: float
    layers: Sequence[Layer] = ()
    bond: float | None = None

    def at(self, strength: float, softening: float) -> "_Model":
        """Return the same with strength of strands and softening length by these factors."""
        limits = replace(self.limits, fibre=strength * self.limits.fibre)
        return replace(self, limits=limits, softening=softening * self.softening)

    @property
    def axial(self) -> float:
        """EA of a strand, N."""
        return self.strand.stiffness(self.specimen.modulus)

    @cached_property
    def judged(self) -> BoolArray:
        """Cells (m,) that may crack: not those near patches of loads and supports."""
        part = self.specimen.unreinforced
        distance = distance_from_patches(part.problem, part.case, part.mesh.centres, ZONE)
        return np.asarray(np.isinf(distance))

    @cached_property
    def stiffness(self) -> FloatArray:
        """Stiffness of the undamaged cells, (6, 6) or (m, 6, 6), MPa."""
        problem = self.specimen.system.problem
        stiffness = problem.cell_stiffness
        return stiffness if problem.density is None else problem.density[:, None, None] * stiffness

    @cached_property
    def normal(self) -> FloatArray:
        """Unit normals (m, 3) of the layers in the cells."""
        return layer_normals(self.layers, self.specimen.unreinforced.mesh.centres)

    def left(self, damage: Damage) -> FloatArray:
        """Stiffness (m, 6, 6) or (6, 6) of cells without cracks: within layers once parted."""
        parted = np.flatnonzero(damage.parted)
        if not len(parted):
            return self.stiffness
        cells = len(damage.parted)
        stiffness = np.array(np.broadcast_to(self.stiffness, (cells, 6, 6)))
        stiffness[parted] = parted_stiffness(stiffness[parted], self.normal[parted])
        return stiffness

    @cached_property
    def gradients(self) -> FloatArray:
        """Gradients (m, 4, 3) of the shape functions of the cells, 1/mm."""
        return cell_gradients(self.specimen.unreinforced.mesh)

    def strength(self, damage: Damage) -> FloatArray:
        """Largest principal stress (m,), MPa, at the next event of each cell; infinite if none."""
        left, last = _LEFT[damage.events], len(_LEFT) - 1
        strain = damage.ductility / (left * (damage.ductility - 1.0) + 1.0)
        open_ = self.judged & (damage.events < last)
        return np.where(open_, self.limits.matrix * left * strain, np.inf)

    def response(self, damage: Damage, solver: Solver, near: FloatArray) -> _Response:
        """Solve the damaged part under the load of its case."""
        specimen, left = self.specimen, _LEFT[damage.events]
        problem, whole = specimen.system.problem, self.left(damage)
        weak = specimen.weakened(specimen.system.assemble(whole, left), solver)
        strands = replace(self.windows.strands, share=self.windows.strands.share * damage.intact)
        balanced = equilibrium(weak, strands, self.axial, known=(near,), tolerance=_TOLERANCE)
        internal = (balanced.matrix @ balanced.displacement.reshape(-1)).reshape(-1, 3)
        force = specimen.force(internal - specimen.forces)
        moved = force / specimen.stiffness(balanced.displacement, 0.5 * balanced.work)
        strain = cell_strain(problem.mesh, balanced.displacement)
        stress = problem.in_material(left[:, None] * times(whole, strain))
        pull = self.axial * balanced.carried * balanced.strain * damage.intact
        largest, means = _largest_principal(stress), self.windows.means(pull)
        largest[largest <= _ROUNDING * np.abs(stress).max()] = 0.0
        with np.errstate(divide="ignore"):
            cells = self.strength(damage) / np.maximum(largest, 0.0)
            windows = self.limits.fibre / np.maximum(means, 0.0)
        most = _CASCADE * min(cells.min(), windows.min(initial=np.inf))
        layers = self.parting(damage, stress, most)
        ends, loose = Ends.none(), np.zeros(0)
        if self.bond is not None:
            ends = StrandEnds(self.windows.strands).at(pull, damage.intact)
            with np.errstate(divide="ignore"):
                loose = self.bond / np.maximum(ends.force, 0.0)
        return _Response(balanced, stress, force, moved, cells, layers, windows, ends, loose)

    def parting(self, damage: Damage, stress: FloatArray, most: float = np.inf) -> FloatArray:
        """Factors (m,) on the load at which layers part, up to the largest that is asked for."""
        if not self.layers or self.limits.bond is None:
            return np.full(len(stress), np.inf)
        judged = np.flatnonzero(self.judged & ~damage.parted)
        mesh = self.specimen.unreinforced.mesh
        return parting_factors(mesh, stress, self.limits, self.normal, judged, most)

    def solver(self, damage: Damage, response: _Response) -> Solver:
        """Factorise the damaged part with the fibre that carries."""
        specimen, strands = self.specimen, self.windows.strands
        share = response.balanced.carried * damage.intact * strands.share
        added = bar_stiffness(strands, specimen.system.problem.mesh.volumes, share)
        whole = _LEFT[damage.events, None, None] * self.left(damage) + self.axial * added
        matrix = specimen.system.assemble(whole, np.ones(len(whole)))
        backend, known = direct_backend(), specimen.backend
        if specimen.held.unknowns > LARGEST_DIRECT:
            backend = known
        return specimen.system.factorise(matrix, backend, _SOLVES, held=specimen.held)

    def lost(self, damage: Damage) -> tuple[int, float, int]:
        """Count cells that have cracked, mm of strand that are broken, and parted cells."""
        broken = (1.0 - damage.intact) @ self.windows.strands.length
        counts = np.count_nonzero(damage.events), np.count_nonzero(damage.parted)
        return int(counts[0]), float(broken), int(counts[1])

    def first(self, response: _Response) -> tuple[str, FloatArray]:
        """Say what fails first, and its place (3,)."""
        what = min(response.factors, key=response.factors.__getitem__)
        if what == "fibre":
            return what, self.windows.middle(int(response.windows.argmin()))
        if what == "bond":
            end = int(response.loose.argmin())
            return what, self.windows.strands.middle[response.ends.first[end]]
        factors = response.cells if what == "matrix" else response.layers
        return what, self.specimen.unreinforced.mesh.centres[int(factors.argmin())]

    def damaged(self, damage: Damage, response: _Response, most: float) -> Damage:
        """Damage after the events up to a factor on the load."""
        events, ductile = np.array(damage.events), np.array(damage.ductility)
        cells = np.flatnonzero(response.cells <= most)
        new = cells[events[cells] == 0]
        if len(new):
            normal = principal(from_voigt(response.stress[new]))[1][..., 0]
            band = band_width(self.gradients[new], normal)
            ductile[new] = ductility(band, self.softening)
        events[cells] += 1
        intact = np.array(damage.intact)
        for window in self._weakest(response.windows, most):
            pieces, share = self.windows.overlap(window)
            intact[pieces] *= 1.0 - share
        for end in np.flatnonzero(response.loose <= most):
            intact[response.ends.first[end] : response.ends.stop[end]] = 0.0
        return Damage(events, ductile, intact, damage.parted | (response.layers <= most))

    def _weakest(self, factors: FloatArray, most: float) -> list[int]:
        """Weakest window of each strand that breaks up to a factor: its others are relieved."""
        weak = np.flatnonzero(factors <= most)
        order = weak[np.argsort(factors[weak], kind="stable")]
        path = self.windows.strands.path[order % len(self.windows.strands)] if len(order) else order
        return [int(window) for window in order[np.sort(np.unique(path, return_index=True)[1])]]


_TOLERANCE = 1e-4
"""Relative residual of the solves."""

_ROUNDING = 1e-6
"""Share of the largest stress that counts as rounding error of a solve."""

# Step by step to the breaking load and beyond.


_TOGETHER = 1.1
"""Events come together up to this factor on the load of the first of them: with 1.02 the Loop of
Chen et al. 2021 without fibre breaks at 0.3 % less, after twice the steps."""

_CASCADE = 1.25
"""The same where the part cannot hold the displacement that it has reached."""

STOP, _STOP_OF_BAND = 0.65, 0.85
"""Share of the highest load at which a curve ends, and one of the band."""

_NEXT = 3.0
"""Factor on the displacement within which the next event counts for the end of a curve."""

_NONE = 1e-300
"""Factor in place of zero."""

_REFACTORISE = 12
"""Iterations a solve above which its preconditioner is made anew."""

_SOLVES = 60
"""Right-hand sides that a preconditioner has to serve."""

_MOST = 3000
"""Steps after which to give up."""


@dataclass(frozen=True)
class BreakingCurve:
    """Load over displacement of a part that breaks.

    The first row is the part at rest. Each further one is a balance at which something fails, and
    the last what the part still carries when all has failed that does at that displacement. The
    displacement is work over load, and never falls.

    Attributes
    ----------
    force : (k,) array, N
    displacement : (k,) array, mm
    cracks : (k,) int array
        Cells that have cracked before.
    broken : (k,) array, mm
        Length of strand that has broken or come loose, and carries nothing any more.
    parted : (k,) int array
        Cells whose layers have parted before.
    cracked_at : (m,) int array
        Row at which each cell first cracked; -1 where it did not.
    broken_at : (s,) int array
        Row at which each piece of fibre broke or came loose; -1 where it did not.
    parted_at : (m,) int array
        Row at which the layers of each cell parted; -1 where they did not.
    first : str
        What failed first: "matrix", "fibre", "layers" or the "bond" of a strand.
    where : (3,) array, mm
        Place of that.
    utilisation : float
        How near layers are to parting at the highest load, 1 where they do; 0 if not judged.
    steps : int
        Solves of the damaged part.
    """

    force: FloatArray
    displacement: FloatArray
    cracks: IntArray
    broken: FloatArray
    parted: IntArray
    cracked_at: IntArray
    broken_at: IntArray
    parted_at: IntArray
    first: str
    where: FloatArray
    utilisation: float
    steps: int

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, force=float, displacement=float, cracks=int, broken=float, where=float)
        freeze(self, parted=int, cracked_at=int, broken_at=int, parted_at=int)

    @property
    def load(self) -> float:
        """Breaking load: the highest, N."""
        return float(self.force.max())

    @property
    def story(self) -> str:
        """What broke first and how it went on, in one sentence."""
        peak, fibre = int(self.force.argmax()), np.flatnonzero(self.broken > 0.0)
        story = (
            f"{self.first} first at {self.force[1]:.4g} N; at the highest load, {self.load:.4g} N "
            f"at {self.displacement[peak]:.3g} mm, {self.cracks[peak]} cells had cracked"
        )
        if self.parted[peak]:
            story += f" and layers had parted in {self.parted[peak]} cells"
        elif self.utilisation:
            story += f", with the bond between layers at {self.utilisation:.0%} of its strength"
        if not len(fibre):
            return f"{story}; no strand gave way"
        if self.broken[peak] > 0.0:
            return f"{story}; strands carried nothing any more over {self.broken[peak]:.3g} mm"
        return f"{story}; strands gave way after it"


def _curve(model: _Model, stop: float) -> BreakingCurve:
    """Load a part until the load has fallen to a share of the highest."""
    specimen, strands = model.specimen, model.windows.strands
    damage = Damage.none(model)
    solver, near = specimen.solver, specimen.unreinforced.displacement
    rows = [(0.0, 0.0, 0, 0.0, 0)]
    cracked, broken = np.full(len(damage.events), -1), np.full(len(strands), -1)
    parted = np.array(cracked)
    what, where = "", np.full(3, np.nan)
    highest = (damage, np.zeros((len(cracked), 6)), 0.0)
    for step in range(_MOST):
        response = model.response(damage, solver, near)
        near = response.balanced.displacement
        if response.balanced.iterations > _REFACTORISE * max(response.balanced.updates, 1):
            solver = model.solver(damage, response)
        # The load of the next event, and the one with which the displacement reached is held.
        factor, held = response.factor, rows[-1][1] / response.displacement
        # Between two teeth of its law a cell carries less for a while; cracked through, for long.
        holds = held if factor > _NEXT * max(held, _NONE) and len(rows) > 1 else max(factor, held)
        if holds * response.force < stop * max(row[0] for row in rows) or np.isinf(factor):
            rows.append((held * response.force, rows[-1][1], *model.lost(damage)))
            before, stress, at = highest
            utilisation = min(at / float(model.parting(before, stress).min()), 1.0)
            events = cracked, broken, parted
            return BreakingCurve(*_columns(rows), *events, what, where, utilisation, step)
        if step == 0:
            what, where = model.first(response)
        most = _TOGETHER * factor
        if factor > held:
            balance = (factor * response.force, factor * response.displacement)
            if balance[0] > max(row[0] for row in rows):
                highest = damage, response.stress, factor
            rows.append((*balance, *model.lost(damage)))
        else:
            most = max(most, min(held, _CASCADE * factor))
        after = model.damaged(damage, response, most)
        cracked[(after.events > 0) & (damage.events == 0)] = len(rows) - 1
        broken[(after.intact < 1.0) & (damage.intact == 1.0)] = len(rows) - 1
        parted[after.parted & ~damage.parted] = len(rows) - 1
        damage = after
    raise SolveError(
        f"breaking load: the load has not fallen to {stop:g} of the highest after {_MOST} steps"
    )


def _columns(
    rows: Sequence[tuple[float, float, int, float, int]],
) -> tuple[FloatArray, FloatArray, IntArray, FloatArray, IntArray]:
    """Columns of the rows of a curve; an error where nothing failed."""
    if len(rows) == 2:
        raise InputError(
            "nothing breaks under this load: no cell away from loads and supports, and no strand, "
            "is stretched; turn the load round"
        )
    force, displacement, cracks, broken, parted = np.array(rows).T
    return force, displacement, cracks.astype(np.int64), broken, parted.astype(np.int64)


# The breaking load with its band.


SPREAD = 0.15
"""Strengths of strands in the band are less and more by this share."""

SOFTENINGS = (0.5, 2.0)
"""Softening lengths in the band, over the one given."""


@dataclass(frozen=True)
class BreakingLoad:
    """An experiment: the load that breaks a part, within a band.

    Attributes
    ----------
    low, high : BreakingCurve, optional
        With weaker strands in a matrix that softens faster, and the other way round. They end
        sooner after their highest load.
    strands : Strands
        Pieces of fibre of the curves.
    limits : Limits
        Strengths of the first curve.
    softening : float, mm
        Softening length of it.
    """

    curve: BreakingCurve
    low: BreakingCurve | None
    high: BreakingCurve | None
    strands: Strands
    limits: Limits
    softening: float

    __repr__ = in_brief

    @property
    def load(self) -> float:
        """Breaking load, N."""
        return self.curve.load

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest breaking load, N; both the load itself without a band."""
        loads = [curve.load for curve in (self.low, self.curve, self.high) if curve is not None]
        return min(loads), max(loads)

    @property
    def said(self) -> str:
        """The load, its band and how it broke, in words."""
        low, high = self.band
        load = f"breaks at {self.load:.4g} N"
        if high > low:
            load += f" ({low:.4g} to {high:.4g} with other strands and softening)"
        return f"{EXPERIMENT}: {load}, {self.curve.story}"


EXPERIMENT = "experiment"
"""Stands beside every number of this module, until two meshes agree within 5 %."""

WORTH = (
    "An experiment: a sequentially linear analysis in which the matrix softens, strands break and "
    "layers part. It depends on the mesh. Nothing fails in compression, so that pressed parts come "
    "out too strong, and strands come loose from the matrix only if a force is given at which they "
    "do."
)
"""What its numbers are worth; to be shown wherever they are."""


@one_blas_thread
def breaking_load(
    fibres: Toolpaths | Strands | None,
    part: StressField | Specimen,
    strand: Strand | None = None,
    matrix_strength: float | None = None,
    softening: float = SOFTENING,
    machine: Machine | None = None,
    band: bool = True,
    stop: float = STOP,
    layers: Sequence[Layer] = (),
    bond: float | None = None,
) -> BreakingLoad:
    """Break a part with its fibres under its load case: an experiment.

    The whole curve of load over displacement is followed, through cracks of the matrix and breaks
    of strands, until the load has fallen to 65 % of its highest.

    Parameters
    ----------
    fibres : Toolpaths, Strands or None
        In the frame of the mesh; None for the part without fibre.
    part : StressField or Specimen
        The part without fibres, on linear cells.
    strand : Strand, optional
        Stiffness and strength of a strand; default EA/E = 4 mm^2 and 105 N.
    matrix_strength : float, MPa, optional
        Largest principal stress at which the matrix cracks; default the tensile strength of the
        material of the part.
    softening : float, mm, default 13.4
        Length ``G_f E / f_t^2`` of the matrix, with its energy of fracture G_f a area. Above half
        the size of the largest cells.
    machine : Machine, optional
        As in `ccfem.virtual_test`.
    band : bool, default True
        Also with strands 15 % weaker and half the softening length, and with both more.
    stop : float in [0, 1), default 0.65
        Share of the highest load at which the curve ends.
    layers : sequence of Layer, optional
        As they are printed. They part where the material of the part has a strength between layers
        (`interlayer_tensile`, `interlayer_shear`); default: they never do.
    bond : float, N, optional
        Axial force, averaged over the 5 mm before an end of a strand, at which that comes loose
        from the matrix; default: strands never do.

    Raises
    ------
    InputError
        For quadratic cells, a missing strength, cells too large for the softening length, and
        where nothing is stretched.
    SolveError
        When a solve misses its tolerance.
    """
    specimen = Specimen.of(part) if isinstance(part, StressField) else part
    mesh = specimen.unreinforced.mesh
    if mesh.order != 1:
        raise InputError(
            "the breaking load is computed on linear cells; got quadratic ones: solve the part "
            "with order = 1"
        )
    if isinstance(fibres, Toolpaths):
        fibres = cut_strands(fibres, mesh, machine=machine)
    strands = Strands.none() if fibres is None else fibres
    strand = Strand() if strand is None else strand
    limits = Limits.of(specimen.system.problem.material, strand, matrix_strength)
    _check_softening(softening * (SOFTENINGS[0] if band else 1.0), mesh)
    if bond is not None:
        check_number("bond of a strand", bond, above=0.0, unit="N")
    middle = _Model(specimen, Windows(strands), strand, limits, softening, layers, bond)
    low, high = (
        _curve(middle.at(*factors), _STOP_OF_BAND) if band else None
        for factors in zip((1.0 - SPREAD, 1.0 + SPREAD), SOFTENINGS, strict=True)
    )
    return BreakingLoad(_curve(middle, stop), low, high, strands, limits, softening)


def _check_softening(softening: float, mesh: TetMesh) -> None:
    """Refuse cells that release more energy than a crack through them takes."""
    check_number("softening length", softening, above=0.0, unit="mm")
    size = float(np.cbrt(6.0 * np.sqrt(2.0) * mesh.volumes.max()))
    if size >= 2.0 * softening:
        raise InputError(
            f"the softening length must be above half the size of the largest cells, {size:.3g} "
            f"mm; got {softening:g} mm: use smaller cells, or a tougher matrix"
        )
