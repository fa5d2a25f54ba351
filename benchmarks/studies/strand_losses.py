"""Where stiffness is lost between the upper bound and the paths of `stream_function`.

    python -m benchmarks.studies.strand_losses [PART ...]

PART is a case, a part file, or, with `study:` in front, a part of `confirmed_gain`,
as in `study:lever`; `authors_loop`, the default, needs `CCFEM_CHEN2021`. Every row has the same
length of fibre: a stage that lays more is cut to it by virtual tests. Levels are those whose paths
are worth most; before links, pieces from five widths on count.
"""

import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import shapely

import ccfem
from benchmarks.studies import confirmed_gain
from ccfem.base.arrays import FloatArray
from ccfem.base.tensor import largest_in_plane
from ccfem.fem.elasticity.stress_field import StressField, solved
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.machine.machine import Machine
from ccfem.papers.chen_2021.loop import authors_loop
from ccfem.paths.fields.tensile import Tension
from ccfem.paths.linking.finishing import keep_off_border, trim_to_clearance
from ccfem.paths.planning.strategy import full_length
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fibre_aware.cut_and_move import Cutting, prune_and_move
from ccfem.strategies.fibre_aware.heights import nearest_layer, room_for_fibre
from ccfem.strategies.fibre_aware.prune import prune
from ccfem.strategies.fibre_aware.smeared import SmearedPart
from ccfem.strategies.fibre_aware.stream_design import SLACK, StreamProblem, design
from ccfem.strategies.fibre_aware.stream_paths import CLEARANCE, SHORTEST
from ccfem.strategies.fibre_aware.stream_start import field_along, start_fields
from ccfem.strategies.fibre_aware.upper_bound import UpperBound, upper_bound
from ccfem.strategies.stream_function import StreamFunction

__all__ = ["along_one_direction", "losses", "posed", "share_inside", "tension_of"]

COVERAGE = 0.45
MOVES = 6
AUTHORS = 34.66e3
"""Length of the authors' fibre in twelve layers, mm."""

_PLACES = np.random.default_rng(0).dirichlet(np.ones(4), 64)
"""Barycentric coordinates at which a cell is looked at, evenly spread over it."""

_NONE = 0.02
"""Share of its room that a cell keeps for fibre where none may lie: a field needs a slope."""


def share_inside(part: SmearedPart, layers: tuple[Layer, ...], inset: float) -> FloatArray:
    """Share (m,) of each cell that is farther than `inset`, mm, from the border of its layer."""
    mesh = part.mesh
    corners = mesh.points[mesh.corners] @ part.frame[:2].T
    nearest, share = nearest_layer(part, layers), np.zeros(len(corners))
    for k, layer in enumerate(layers):
        room, own = shapely.buffer(layer.plane.polygon, -inset), np.flatnonzero(nearest == k)
        shapely.prepare(room)
        x, y = np.einsum("pq,cqd->dcp", _PLACES, corners[own])
        share[own] = shapely.contains_xy(room, x, y).mean(axis=1)
    return share


def along_one_direction(part: SmearedPart, bound: UpperBound, axial_stiffness: float) -> float:
    """Stiffness ratio with the density of a bound laid along its largest direction alone."""
    _, _, angle = largest_in_plane(bound.tensor)
    cosine, sine = np.cos(angle), np.sin(angle)
    along = np.stack([cosine**2, sine**2, cosine * sine], axis=1)
    density = axial_stiffness * bound.density.sum(axis=1)
    outer = density[:, None, None] * along[:, :, None] * along[:, None, :]

    def fibre(strain: FloatArray) -> FloatArray:
        stretched = np.einsum("ci,ci->c", along, strain) > 0.0
        return np.where(stretched, 1.0, SLACK)[:, None, None] * outer

    return part.ratio(part.solve(fibre, tolerance=1e-4).work)


def tension_of(bound: UpperBound, room: FloatArray, layer: Layer) -> Tension:
    """Strands a width of a bound's density, and their direction, on the triangles of a layer."""
    size, _, angle = largest_in_plane(bound.tensor[layer.cell] / room[layer.cell, None])
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Tension(direction, size, size > _NONE)


def losses(
    stress: StressField, layers: tuple[Layer, ...], machine: Machine, length: float
) -> dict[str, float]:
    """Stiffness ratio of each stage at a length of fibre, mm in all layers."""
    width = machine.fibre_width
    coverage = length / len(layers) / full_length(layers, machine)
    strategy = StreamFunction(coverage=coverage)
    problem, group, found = strategy.designed(stress, layers, machine)
    model = problem.model
    bound = upper_bound(stress, layers, length, machine)
    rows = {"bound": bound.ratio}
    rows["its density, in one direction"] = along_one_direction(
        model.part, bound, model.axial_stiffness
    )
    inside = np.maximum(share_inside(model.part, layers, 0.5 * width), _NONE)
    exact = replace(problem, model=replace(model, budget=model.budget / strategy.overfill))
    middle = [layers[len(layers) // 2]] * model.groups
    for what, share in (("designed field", 1.0), ("designed field, border left free", inside)):
        scaled = replace(exact.model, capacity=model.capacity * share)
        posed = StreamProblem.alone(scaled)
        start = start_fields(posed, (stress,), middle, strategy.cap)
        rows[what] = float(design(posed, start, strategy.evaluations).objective.ratio[0])
    room = room_for_fibre(model.part, layers, machine)
    begun = [tension_of(bound, room, layer) for layer in middle]
    start = field_along(exact.model, middle, begun, 100.0)
    begun_there = design(exact, start, strategy.evaluations)
    rows["designed field, begun there"] = float(begun_there.objective.ratio[0])
    strained = ((1.0, found.objective.solution[0].displacement),)
    extraction = strategy.extraction(model, list(found.fields), strained, machine)
    one = len(layers) // 2
    shifts = np.arange(strategy.phases) / strategy.phases
    tried = [extraction.layer_paths(layers[one], extraction.fields[group[one]], x) for x in shifts]
    values = [extraction.profiles(paths, layers[one]) for paths in tried]
    ((best,), *_) = extraction.best_phases([values], [len(layers)], length)
    shift = float(shifts[best])

    def tested(paths: Toolpaths, cutter: Machine) -> float:
        cut = prune(paths, model.part.specimen, length, cutter, rounds=3)
        return virtual_test(cut, model.part.specimen, machine=machine, span=()).ratio

    def stage(change: Callable[[list[FloatArray], Layer], list[FloatArray]]) -> float:
        laid = []
        for k, layer in enumerate(layers):
            lines = extraction.levels(layer, extraction.fields[group[k]], shift)
            laid.append(Toolpaths.from_plane(change(lines, layer), layer))
        shortest = replace(machine, minimum_length=SHORTEST * width)
        return tested(Toolpaths.concatenate(laid), shortest)

    def inset(lines: list[FloatArray], layer: Layer) -> list[FloatArray]:
        return keep_off_border(lines, layer.plane.polygon, strategy.inset * width)

    def apart(lines: list[FloatArray], layer: Layer) -> list[FloatArray]:
        return trim_to_clearance(inset(lines, layer), CLEARANCE * width, SHORTEST * width)

    rows["its levels"] = stage(lambda lines, _: lines)
    rows["kept off the border"] = stage(inset)
    rows["kept apart"] = stage(apart)
    whole = [
        extraction.layer_paths(x, extraction.fields[group[k]], shift) for k, x in enumerate(layers)
    ]
    paths = Toolpaths.concatenate(whole)
    rows["linked and slid in: the paths"] = tested(paths, machine)
    part, how = model.part.specimen, Cutting(3, moves=MOVES)
    moved = prune_and_move((paths,), layers, part, length, machine, Strand(), how)
    rows[f"moved in {MOVES} steps"] = tested(moved, machine)
    return rows


def posed(name: str) -> tuple[StressField, tuple[Layer, ...], Machine, float]:
    """Stress of a part, its layers, the machine, and the length of fibre, mm."""
    if name.startswith("study:"):
        problem = confirmed_gain.posed(name.removeprefix("study:"))
        stress, machine = ccfem.solve(problem)["planned"], Machine()
        layers = Planar(count=confirmed_gain.LAYERS).cut(problem.mesh)
    else:
        case = authors_loop() if name == "authors_loop" else ccfem.read(name)
        stress, machine = next(iter(ccfem.solve(case.problem).values())), case.machine
        count = 12 if name == "authors_loop" else 8
        layers = Planar(count=count)(stress, case.build, machine)
    every = len(layers) * full_length(layers, machine)
    length = AUTHORS if name == "authors_loop" else COVERAGE * every
    return solved(stress, "strand_losses"), layers, machine, length


def main() -> None:
    """Print a table for each part."""
    for name in sys.argv[1:] or ["authors_loop"]:
        stress, layers, machine, length = posed(name)
        rows = losses(stress, layers, machine, length)
        most = rows["bound"] - 1.0
        print(f"\n{name}: {length / 1e3:.2f} m of fibre in {len(layers)} layers")
        for what, ratio in rows.items():
            print(f"{what:36}{ratio:7.3f}{(ratio - 1.0) / most:7.1%}", flush=True)


if __name__ == "__main__":
    main()
