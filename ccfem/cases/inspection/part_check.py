"""Everything that is known about a part before it is solved."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, freeze
from ccfem.base.display import Shown
from ccfem.base.errors import Mistakes
from ccfem.body.mesh.check import about_slivers
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.case import Case
from ccfem.cases.reading import read
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.load_kinds import (
    Displacement,
    Load,
    SurfaceLoad,
    Temperature,
    VolumeLoad,
    in_words,
    kind_of,
    patches_of,
)
from ccfem.fem.elasticity.loads import load_case, nodal_forces, volume_forces
from ccfem.fem.elasticity.plausibility import about_problem, held_share
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.solve_cost import solve_costs
from ccfem.fem.elasticity.statics import support_sets
from ccfem.fem.elasticity.supports import held
from ccfem.fem.elasticity.system import prepare
from ccfem.geometry.facets import connected, facet_keys
from ccfem.paths.plastic.plastic import SOLID
from ccfem.printing.before_solving import in_air, refusal
from ccfem.slicing.layers.layer import Layer

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class PatchRow:
    """A patch.

    Attributes
    ----------
    area : float, mm^2
    centre : (3,) array, mm
        Of the area.
    normal : (3,) array
        Mean outward normal by area: of length 1 for a plane, 0 for a whole round wall.
    pieces : int
        That hang together through edges.
    carries : str
        Support and load cases on it, in words; empty for none.
    """

    name: str
    area: float
    centre: FloatArray
    normal: FloatArray
    facets: int
    pieces: int
    carries: str = ""

    def __post_init__(self) -> None:
        freeze(self, centre=float, normal=float)


def patch_rows(mesh: TetMesh, carries: dict[str, list[str]]) -> tuple[PatchRow, ...]:
    """Describe all patches of a mesh, those that carry something first."""
    rows = []
    for name in sorted(mesh.patches, key=lambda name: (name not in carries, name)):
        facets = mesh.patches[name]
        if not len(facets):
            continue
        area, normal = mesh.facet_areas(facets)
        total = float(area.sum())
        middle = mesh.points[facets[:, :3]].mean(axis=1)
        rows.append(
            PatchRow(
                name,
                total,
                area @ middle / total,
                area @ normal / total,
                len(facets),
                _count_pieces(facets[:, :3]),
                "; ".join(dict.fromkeys(carries.get(name, []))),
            )
        )
    return tuple(rows)


def _count_pieces(facets: IntArray) -> int:
    """Count the pieces of facets that share edges."""
    (key,) = facet_keys(facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2))
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(np.diff(key[order]) == 0)
    pairs = np.stack([order[same], order[same + 1]], axis=1) // 3
    return len(np.unique(connected(pairs, len(facets))))


_NONE = 1e-9
"""Resultant over the sum of the sizes of the nodal forces that counts as none."""


@dataclass(frozen=True)
class LoadRow:
    """A load.

    Attributes
    ----------
    what : str
        Kind and patch.
    resultant : (3,) array, N
        NaN for a temperature or a displacement.
    moment : (3,) array, N mm
        About the point of attack.
    point : (3,) array, mm
        Of attack: on the line of the resultant, nearest to the middle of the forces; their middle
        where they have no resultant.
    held : float
        Share of the nodal forces of a load on a patch that supports take at once; 0 for a force of
        the volume, whose share on held nodes is meant.
    """

    case: str
    what: str
    resultant: FloatArray
    moment: FloatArray
    point: FloatArray
    held: float

    def __post_init__(self) -> None:
        freeze(self, resultant=float, moment=float, point=float)

    @property
    def size(self) -> float:
        """Size of the resultant, N."""
        return float(np.linalg.norm(self.resultant))


def load_row(problem: Problem, case: str, load: Load, held: Held | None) -> LoadRow:
    """Describe a load."""
    what = in_words(load)
    if isinstance(load, Displacement | Temperature):
        nothing = np.full(3, np.nan)
        return LoadRow(case, what, nothing, nothing, nothing, 0.0)
    if isinstance(load, SurfaceLoad):
        forces = nodal_forces(problem.mesh, load)
    else:
        assert isinstance(load, VolumeLoad)
        forces = volume_forces(problem, load)
    sizes = np.linalg.norm(forces, axis=1)
    middle = sizes @ problem.mesh.points / sizes.sum()
    total = forces.sum(axis=0)
    turning = np.cross(problem.mesh.points - middle, forces).sum(axis=0)
    point = middle
    if np.linalg.norm(total) > _NONE * sizes.sum():
        point = middle + np.cross(total, turning) / (total @ total)
    else:
        total = np.zeros(3)
    moment = turning - np.cross(point - middle, total)
    lost = 0.0 if held is None else held_share(problem, load, held)
    return LoadRow(case, what, total, moment, point, lost)


@dataclass(frozen=True)
class Check(Shown):
    """A part before it is solved.

    Attributes
    ----------
    facts : tuple of str
        Size, cells, quality, pieces, and the cost of a solve.
    warnings : tuple of str
        Things that may be unintended, each with its cure.
    fibre : tuple of Layer
        Layers that get fibre, if the part selects them (`Case.fibre`) and they do not depend on the
        stress.
    mistakes : tuple of str
        What prevents the part from being solved.
    not_planned : tuple of str
        What prevents it from being planned, as layers that cannot be cut.
    not_printable : tuple of str
        What keeps it from being printed, whatever is planned: `Run.why_not` holds it.
    """

    case: Case
    facts: tuple[str, ...]
    patches: tuple[PatchRow, ...]
    loads: tuple[LoadRow, ...]
    warnings: tuple[str, ...]
    mistakes: tuple[str, ...]
    fibre: tuple[Layer, ...] = ()
    not_planned: tuple[str, ...] = ()
    not_printable: tuple[str, ...] = ()

    @property
    def known(self) -> str:
        """All but the mistakes, as text: size, patches, loads, warnings."""
        lines = [self.case.title, *(f"  {fact}" for fact in self.facts), ""]
        for frame in (self.to_frame(), self.load_frame()):
            lines += [] if frame.empty else [*frame.to_string(index=False).splitlines(), ""]
        lines += [f"warning: {line}" for line in self.warnings]
        if not self.mistakes:
            lines.append("nothing keeps this part from being solved")
        return "\n".join(line.rstrip() for line in lines)

    @property
    def faults(self) -> dict[str, tuple[str, ...]]:
        """What keeps the part from being solved, planned or printed, by kind, the worst first."""
        return {
            "mistake": self.mistakes,
            "cannot be planned": self.not_planned,
            "not printable": self.not_printable,
        }

    def __str__(self) -> str:
        worst_last = reversed(self.faults.items())
        sentences = (f"{kind}: {line}" for kind, lines in worst_last for line in lines)
        return "\n".join([self.known, *sentences])

    def __repr__(self) -> str:
        return (
            f"Check of {self.case.name!r}: {len(self.patches)} patches, {len(self.loads)} loads, "
            f"{len(self.warnings)} warnings, {len(self.mistakes)} mistakes"
            + (", cannot be planned" if self.not_planned else "")
            + (", not printable" if self.not_printable else "")
        )

    def _repr_html_(self) -> str:
        from html import escape

        lines = (
            *self.facts,
            *self.warnings,
            *self.not_printable,
            *self.not_planned,
            *self.mistakes,
        )
        rest = "".join(f"<p>{escape(x)}</p>" for x in lines)
        return self.to_frame().to_html(index=False) + self.load_frame().to_html(index=False) + rest

    def to_frame(self) -> "pd.DataFrame":
        """Table of the patches: a row a patch."""
        import pandas as pd

        return pd.DataFrame(
            {
                "patch": [row.name for row in self.patches],
                "area, mm^2": [float(f"{row.area:.4g}") for row in self.patches],
                "centre, mm": [_numbers(row.centre) for row in self.patches],
                "mean normal": [_numbers(row.normal, 2, 5e-3) for row in self.patches],
                "facets": [row.facets for row in self.patches],
                "pieces": [row.pieces for row in self.patches],
                "carries": [row.carries for row in self.patches],
            }
        )

    def load_frame(self) -> "pd.DataFrame":
        """Table of the loads: a row a load."""
        import pandas as pd

        return pd.DataFrame(
            {
                "load case": [row.case for row in self.loads],
                "load": [row.what for row in self.loads],
                "resultant, N": [_numbers(row.resultant) for row in self.loads],
                "acts at, mm": [_numbers(row.point) for row in self.loads],
                "moment, N mm": [_numbers(row.moment, 4, 1e-3 * row.size) for row in self.loads],
            }
        )


def check(part: str | os.PathLike[str] | Case, **parameters: Any) -> Check:
    """Inspect a part without solving it.

    Parameters
    ----------
    part : str, path or Case
        As `ccfem.read` takes it.
    **parameters
        Parameters of a case by name.

    Returns
    -------
    Check
        ``print(check(...))`` shows all of it; `Check.to_frame` is the table of the patches.

    Raises
    ------
    InputError
        For a part that cannot be read; `InputError.mistakes` lists all that is wrong with it.
    """
    case = read(part, **parameters)
    problem, mistakes = case.problem, Mistakes()
    rows: list[LoadRow] = []
    doubts: list[str] = []
    sets = support_sets(problem)
    for held_alike in sets:
        rows += _load_rows(held_alike, mistakes, doubts, len(sets) > 1)
    order = list(problem.loads)
    rows.sort(key=lambda row: order.index(row.case))
    if not problem.loads:
        mistakes.lines.append("the part has no load case: give at least one load")
    known: tuple[Layer, ...] = ()
    not_printable: tuple[str, ...] = ()
    layers = Mistakes()
    with layers.noted():
        case.check_layers()
        known = case.known_layers()
        mesh, machine = problem.mesh, case.machine
        refused = refusal(mesh, case.build, machine, known, case.bed)
        not_printable = tuple(filter(None, (refused, in_air(mesh, machine, known))))
    fibre = () if case.fibre is None else known
    plastic: tuple[str, ...] = ()
    if known or case.plastic.solid:
        with layers.noted():
            plastic = _about_plastic(case)
    return Check(
        case,
        (*_facts(case), *_about_fibre(case, fibre), *plastic),
        patch_rows(problem.mesh, _carried(case)),
        tuple(rows),
        tuple(dict.fromkeys(_warnings(case, rows, doubts))),
        tuple(dict.fromkeys(mistakes.lines)),
        fibre,
        tuple(layers.lines),
        not_printable,
    )


def _load_rows(
    problem: Problem, mistakes: Mistakes, doubts: list[str], named: bool
) -> list[LoadRow]:
    """Rows of the loads on one set of supports; mistakes are recorded, with the case if named.

    What is doubtful is added to `doubts`.
    """
    at_rest: Held | None = None
    rows, sound = [], []
    with mistakes.noted(f"load case '{next(iter(problem.loads))}': " if named else ""):
        at_rest = held(problem)
    for name, loads in problem.loads.items():
        before = len(mistakes.lines)
        for load in loads:
            with mistakes.noted(f"load case '{name}': "):
                rows.append(load_row(problem, name, load, at_rest))
        if len(mistakes.lines) == before:
            with mistakes.noted():
                if at_rest is None:
                    load_case(problem, name)
                else:
                    prepare(replace(problem, loads={name: loads}, combinations={}))
        if len(mistakes.lines) == before:
            sound.append(name)
    if at_rest is not None and len(sound) == len(problem.loads) and problem.combinations:
        with mistakes.noted():
            prepare(problem)
    doubts += about_problem(problem, at_rest, sound)
    return rows


def _facts(case: Case) -> tuple[str, ...]:
    """Size, cells, quality, pieces and cost."""
    mesh = case.problem.mesh
    size = " x ".join(f"{side:.4g}" for side in np.ptp(mesh.bounds, axis=0))
    pieces = len(np.unique(connected(mesh.neighbours, len(mesh.cells))))
    kind = "linear" if mesh.order == 1 else "quadratic"
    costs = " or, if their error is too large, ".join(
        cost.about for cost in solve_costs(case.problem)
    )
    information = tuple(line for line in case.findings if _is_information(line))
    return (
        f"{size} mm, {mesh.volumes.sum() / 1e3:.4g} cm^3, {case.problem.material.name}",
        f"{len(mesh.cells):,} {kind} cells, {len(mesh.points):,} nodes, {pieces} "
        f"piece{'s' if pieces > 1 else ''}",
        f"longest edge of a cell over its least height: {np.median(mesh.aspects):.3g} in the "
        f"middle, {mesh.aspects.max():.3g} at most",
        *information,
        f"solve of a load case, {costs}",
    )


def _about_fibre(case: Case, layers: Sequence[Layer]) -> tuple[str, ...]:
    """Say which layers get fibre, where the part says so."""
    if case.fibre is None:
        return ()
    if not layers:
        return (f"fibre: {case.fibre.about()}",)
    numbers = ", ".join(str(layer.index) for layer in layers)
    shortened = numbers if len(numbers) <= 60 else f"{numbers[:40].rpartition(',')[0]}, ..."
    area = np.mean([layer.areas.sum() for layer in layers])
    return (
        f"fibre on {len(layers)} layer{'s' * (len(layers) > 1)} ({shortened}), {area:.4g} mm^2 "
        f"each on average: {case.fibre.about()}",
    )


def _about_plastic(case: Case) -> tuple[str, ...]:
    """Say how much of the part is plastic, and its mass; nothing of one solid by default."""
    if case.plastic == SOLID:
        return ()
    plastic, printed = case.plastic, case.printed_problem()
    if plastic.solid:
        return (f"plastic: {plastic.about()}",)
    filled, mesh = printed.filled, printed.mesh
    sparse = (1.0 - filled) / (1.0 - plastic.density)
    grams = 1e-3 * case.machine.matrix_density * filled * float(mesh.volumes.sum())
    return (
        f"plastic: {plastic.about()} in {sparse:.0%} of the volume; {filled:.0%} of the volume is "
        f"filled, {grams:.4g} g before fibre takes its place",
    )


def _is_information(finding: str) -> bool:
    """Whether a finding only tells how the mesh was made, and needs no action."""
    return finding.startswith("meshed by") and ": shorten" not in finding


def _carried(case: Case) -> dict[str, list[str]]:
    """Say what each patch carries."""
    carried: dict[str, list[str]] = {}
    problem = case.problem
    for support in problem.all_supports:
        held_along = getattr(support, "components", "")
        within = [c for c, supports in problem.case_supports.items() if support in supports]
        only = f" in {', '.join(within)}" if within and support not in problem.supports else ""
        for name in patches_of(support):
            word = kind_of(support)
            carried.setdefault(name, []).append(f"{f'{word} {held_along}'.strip()}{only}")
    for label, loads in problem.loads.items():
        for load in loads:
            for name in patches_of(load):
                carried.setdefault(name, []).append(f"{kind_of(load)} of {label}")
    return carried


def _warnings(case: Case, rows: Sequence[LoadRow], doubts: Sequence[str]) -> list[str]:
    """List what may be unintended."""
    problem = case.problem
    lines = [line for line in case.findings if not _is_information(line)] + [*doubts]
    sliver = about_slivers(problem.mesh)
    if sliver:
        lines.append(sliver)
    for row in rows:
        if row.size == 0.0 and not row.what.startswith("moment on "):
            lines.append(
                f"load case '{row.case}': {row.what} has no resultant because its parts cancel: "
                "check that the patch faces one way"
            )
    unused = sorted(set(problem.mesh.patches) - set(problem.held_or_loaded))
    if unused and len(unused) <= 6:
        lines.append(f"patches without load or support: {', '.join(unused)}")
    return lines + _no_room(case)


def _no_room(case: Case) -> list[str]:
    """Say which measures of the machine leave no room for fibre on any layer of the part."""
    machine = case.machine
    _, side, longest = np.sort(np.ptp(case.problem.mesh.bounds, axis=0)).tolist()
    width, least = machine.fibre_width, machine.shortest_strand
    if width > side:
        return [
            f"machine.fibre_width = {width:g} mm is wider than the part, {side:.4g} mm: no fibre "
            "fits: check that all lengths are in mm"
        ]
    most = side * longest / width
    if least > most:
        return [
            f"{machine.shortest_strand_by}: strands must be {least:g} mm long, but no layer has "
            f"room for more than {most:.4g} mm of {width:g} mm width; are all lengths in mm?"
        ]
    return []


def _numbers(values: Any, digits: int = 4, least: float = 0.0) -> str:
    """Components as words; those below the least, or very small beside the largest, are zero."""
    if np.isnan(values).any():
        return "-"
    least = max(least, 1e-4 * float(np.abs(values).max()))
    return ", ".join(f"{0.0 if abs(x) <= least else x:.{digits}g}" for x in values)
