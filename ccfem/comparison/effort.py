"""Time and memory of whole commands on a part, told before it is solved.

Each stage takes some seconds for a run, and some for each of what it grows with (`TERMS`). How many
is measured by `python -m benchmarks.speed.effort` and stands in ``effort.toml``, with how long the
machine that it ran on took for `pace`.
"""

import time
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.case import Case
from ccfem.comparison.request import LONGEST_TEST, MOST_LAYERS, STRATEGIES
from ccfem.fem.elasticity.solve_cost import solve_costs
from ccfem.machine.machine import Machine
from ccfem.paths.planning.alike import BORDERS, equal_sections
from ccfem.slicing.layers.layer import Layer, curved_layers
from ccfem.strategies.fibre_aware.heights import LARGE_CELLS
from ccfem.strategies.fibre_aware.smeared import DIRECT_UNKNOWNS

COEFFICIENTS = Path(__file__).with_suffix(".toml")
"""What each term of each stage takes: CPU seconds, or gigabytes of memory."""

FILLED = 0.45
"""Share of the room that plans fill by default."""

TERMS: dict[str, tuple[str, ...]] = {
    "start": ("run", "unknowns", "triangles"),
    "solve": ("solved", "triangles"),
    "plan stream_function": ("factorised", "iterated", "room"),
    "plan stream_function to a length": ("factorised", "iterated", "room"),
    "plan zigzag": ("triangles", "room"),
    "plan": ("triangles", "some_room"),
    "judge": ("solved", "triangles", "room"),
    "print": ("run", "plastic", "volume"),
    "judge untested": ("triangles", "volume", "some_room"),
    "bound": ("bulk", "triangles"),
    "write": ("run", "room"),
    "write a print": ("run", "volume", "room"),
    "report": ("run", "near", "triangles", "room"),
    "memory of compare": ("run", "solved", "triangles", "room"),
    "memory of plan": ("run", "solved", "triangles", "room"),
    "memory of untested": ("run", "solved", "streamed"),
}
"""What each stage grows with: attributes of `Counts`."""

MOST = ("unknowns", "solved", "triangles", "room", "volume")
"""Counts whose largest measured values the benchmark writes, for each command: beyond these what is
told is extrapolated."""

_PLANNED = {
    "stream_function": "plan stream_function",
    "contour_zigzag": "plan zigzag",
    "zigzag": "plan zigzag",
}
"""Stages of planning by strategies."""


_FEWER = 0.45
"""Share of the time for each unknown that is left above `LARGE_CELLS` (measured)."""


@dataclass(frozen=True)
class Counts:
    """What the work on a part grows with."""

    # Before supports, on linear cells and on those that the part is solved on.
    unknowns: float
    solved: float
    triangles: float  # in which its layers with fibre cut the cells
    room: float  # mm: length of strands that would cover these layers once
    volume: float  # mm^3
    # mm: `room` of the layers that are planned: of more than 60, about four of those that cut the
    # same cells in equal sections, since their stress is alike (`alike_layers`)
    some_room: float
    cells: float
    plastic: float  # layers of matrix in which the layers with fibre are printed, one each at least
    run: float = 1.0

    @property
    def bulk(self) -> float:
        """Cells times those at each unknown: a few in thin walls, many within thick ones."""
        return self.cells**2 / self.unknowns

    @property
    def factorised(self) -> float:
        """Unknowns of designs that solve with a factor."""
        return self.unknowns if self.unknowns <= DIRECT_UNKNOWNS else 0.0

    @property
    def iterated(self) -> float:
        """Unknowns of designs that iterate; large parts are planned in fewer ways."""
        share = _FEWER if self.cells > LARGE_CELLS else 1.0
        return share * (self.unknowns - self.factorised)

    @property
    def near(self) -> float:
        """Cells times those in a row through a ball of one size, over which stress is averaged."""
        return float(self.cells * np.cbrt(self.cells / self.volume))

    @property
    def streamed(self) -> float:
        """Root of the room: layers are written one after the other, and few are held at once."""
        return float(np.sqrt(self.room))

    @classmethod
    def of(cls, mesh: TetMesh, layers: Sequence[Layer], machine: Machine) -> "Counts":
        """Count a mesh, solved as it is, with the layers that get fibre."""
        unknowns = 3.0 * len(np.unique(mesh.corners))
        triangles = float(sum(len(layer.triangles) for layer in layers))
        room = float(sum(layer.areas.sum() for layer in layers)) / machine.fibre_width
        solved = 3.0 * len(mesh.points)
        some = room * _planned_layers(mesh, layers) / max(len(layers), 1)
        volume, cells = float(mesh.volumes.sum()), float(len(mesh.cells))
        high = machine.highest_matrix(0.0)
        plastic = float(sum(max(layer.thickness / high, 1.0) for layer in layers))
        return cls(unknowns, solved, triangles, room, volume, some, cells, plastic)


_OF_EQUAL = 4
"""Layers that are planned of those that cut the same cells: 22 of 238 on five layers of cells."""


def _planned_layers(mesh: TetMesh, layers: Sequence[Layer]) -> int:
    """Count about how many layers are planned, where those that are alike are not."""
    count = len(layers)
    if count <= MOST_LAYERS or curved_layers(layers):
        return count
    # Layers cut the same cells where no node lies between them: regions a part of these.
    nodes = mesh.points[np.unique(mesh.corners)] @ layers[0].plane.frame[2]
    between = np.searchsorted(np.unique(nodes), [layer.plane.height for layer in layers])
    runs = 1 + sum(
        low != high or not equal_sections(*pair, BORDERS)
        for pair, (low, high) in zip(pairwise(layers), pairwise(between), strict=True)
    )
    return min(_OF_EQUAL * runs, count)


def counts(case: Case, layers: Sequence[Layer]) -> tuple[Counts, ...]:
    """Count a part with the layers that get fibre, on each order of cells that it may come to."""
    known = Counts.of(case.problem.mesh, layers, case.machine)
    return tuple(replace(known, solved=cost.unknowns) for cost in solve_costs(case.problem))


Coefficients = Mapping[str, Sequence[float]]
"""Of the terms of each stage."""


@cache
def measured() -> dict[str, Any]:
    """Coefficients, and what else the benchmark wrote: the pace there, and how well it tells."""
    return tomllib.loads(COEFFICIENTS.read_text(encoding="utf-8"))


def stage_effort(stage: str, known: Counts, coefficients: Coefficients | None = None) -> float:
    """CPU seconds of a stage on a part, or gigabytes of memory."""
    given = measured() if coefficients is None else coefficients
    return float(np.dot([getattr(known, term) for term in TERMS[stage]], given[stage]))


def planning_stage(strategy: str, natural: bool) -> str:
    """Stage of planning by a strategy; those that are not measured take about as `isocurve`.

    Parameters
    ----------
    natural : bool
        To the amount of its own; `stream_function` may design again for another.
    """
    stage = _PLANNED.get(strategy, "plan")
    again = strategy == "stream_function" and not natural
    return f"{stage} to a length" if again else stage


def judging_stages(prints: bool, tested: bool) -> list[str]:
    """Stages of judging a plan: with its print; untested, they are measured together."""
    return ["judge", *["print"] * prints] if tested else ["judge untested"]


def stages(strategies: Sequence[str], prints: bool, tested: bool = True) -> list[str]:
    """Stages of `ccfem compare`, or of `ccfem plan --gcode` where it prints."""
    planned = [planning_stage(strategy, natural=prints) for strategy in strategies]
    judged = judging_stages(prints, tested) * len(strategies)
    written = "write a print" if prints else "write"
    return ["start", "solve", *planned, *judged, *["bound"] * tested, written, "report"]


_POINTS = 5
"""Lengths on a curve, at most."""

_DESIGNED = 0.5
"""Share of the time of each plan that is left where `stream_function` plans to several lengths,
which share the first steps of their designs. Measured on `bar`: five take as long as 2.2."""

LONGEST_CURVE = 300.0
"""Processor seconds, on the machine of `effort.toml`, above which a curve has to be asked for. Our
choice."""


def plans_to_lengths(strategy: str, lengths: int) -> float:
    """Plans of one length that take as long as those of several."""
    designed = strategy == "stream_function" and lengths > 1
    return lengths * (_DESIGNED if designed else 1.0)


def curve_steps(steps: Mapping[str, float], strategies: Iterable[str]) -> dict[str, float]:
    """First words and seconds of the steps of a curve, by those of the comparison itself."""
    curve: dict[str, float] = {}
    for name in strategies:
        planning, judging = steps[f"planning {name}"], steps[f"judging {name}"]
        if name != "stream_function":  # of which these are known without a plan
            curve[f"planning the least and the most of {name}"] = 2.0 * planning
        plans = plans_to_lengths(name, _POINTS)
        curve[f"planning {name} along the curve"] = plans * planning + _POINTS * judging
    return curve


# What is said of a part.


def pace() -> float:
    """CPU seconds of a fixed piece of work, by which machines differ: the least of three."""
    size = 60_000
    matrix = sp.diags_array([np.ones(size)] * 27, offsets=range(-13, 14), shape=(size, size))
    matrix, vector = matrix.tocsr(), np.ones(size)
    taken = []
    for _ in range(3):
        start = time.process_time()
        for _ in range(20):
            matrix @ vector
        total = 0
        for k in range(600_000):
            total += k & 3
        taken.append(time.process_time() - start)
    return min(taken)


_BEYOND = 1.05
"""Times the largest part that was measured, in any count, from which it is said. Our choice."""


def about_effort(case: Case, layers: Sequence[Layer]) -> tuple[str, ...]:
    """Say what commands will take on a part, a line for each order of cells that it may come to.

    Nothing of a part whose layers depend on the stress.
    """
    if not layers:
        return ()
    lines, slower, far = [], pace() / measured()["pace"], dict[str, float]()
    for known in counts(case, layers):
        tested = FILLED * known.room <= LONGEST_TEST
        planned = "plan" if tested else "untested"
        expected = []
        for command, steps, used in (
            ("compare", stages(STRATEGIES, prints=False), "compare"),
            ("plan --gcode", stages(STRATEGIES[:1], True, tested), planned),
        ):
            seconds = slower * sum(stage_effort(stage, known) for stage in steps)
            memory = stage_effort(f"memory of {used}", known)
            size = np.array([getattr(known, name) for name in MOST])
            by = float((size / measured()["most"][used]).max())
            if by > _BEYOND:
                far[command] = by
            expected.append(f"{command} about {_in_words(seconds)} and {memory:.1f} GB")
        curve = _curve_effort(known)
        if curve <= LONGEST_CURVE:
            expected[0] += f" (a curve over the length {_in_words(slower * curve)} more)"
        kind = "linear" if known.solved <= known.unknowns else "quadratic"
        lines.append(f"on {kind} cells and one processor: {', '.join(expected)}")
    compared, planned = (measured()["within"][command] for command in ("compare", "plan"))
    beyond = " and ".join(f"{command}, {by:.3g} times" for command, by in far.items())
    if beyond:
        lines.append(f"extrapolated beyond the largest part that was measured: {beyond}")
    return (
        *lines,
        f"these times, without a curve, were within a factor of 1.5 for {compared[0]} of "
        f"{compared[1]} comparisons and {planned[0]} of {planned[1]} plans, and of "
        f"{max(compared[2], planned[2])} for all",
    )


def _curve_effort(known: Counts) -> float:
    """CPU seconds of a curve of the default strategies, where one length does not suit all."""
    steps = {
        f"planning {name}": stage_effort(planning_stage(name, natural=False), known)
        for name in STRATEGIES
    }
    judging = {f"judging {name}": stage_effort("judge", known) for name in STRATEGIES}
    return sum(curve_steps(steps | judging, STRATEGIES).values())


def _in_words(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds < 100.0 else f"{seconds / 60.0:.2g} min"
