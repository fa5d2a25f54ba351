"""Random lengths of fibre for every strategy on four parts: what is reached, and what it takes.

    python -m benchmarks.studies.equal_fibre [TARGETS]

Of each part and strategy the least and the most are found first; what cannot plan a part at all, as
a strategy that needs tension on a part that is pressed, says so and gets no target. The targets are
then drawn evenly from half of the least to a fifth above the most, in a fixed order of strategies
and parts, and planned to. A target inside the reach must be met within 1 %, whatever the steps of
the strategy; one outside must give the least or the most, and say so. The table says how many
targets lay inside, the largest deviation of these, and layers that were left empty though another
amount fills them.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from time import process_time
from typing import Any

import numpy as np

from ccfem.base.arrays import BoolArray
from ccfem.base.errors import InputError
from ccfem.cases import create_case
from ccfem.cases.case import Case
from ccfem.fem.elasticity import solve
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.paths.planning.equal_fibre import TOLERANCE, extremes, layer_lengths, plan_to_length
from ccfem.paths.planning.strategy import LengthStrategy, Planned
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create, named

__all__ = ["PARTS", "Reach", "Reached", "reach", "reached", "targets"]

PARTS = {"bar": 4.0, "loop": 4.0, "open_hole": 4.0, "m_shape": 5.0}
"""Parts with their element size, mm."""
LAYERS = 4
SEED = 10


@dataclass(frozen=True)
class Reached:
    """One target and what was laid for it.

    Attributes
    ----------
    part, strategy : str
    wanted, laid, least, most : float, mm per layer
    empty : int
        Layers without fibre that the most fills.
    note : str
        What the plan says of itself, or the error that it ended in.
    seconds : float
        Of the processor.
    """

    part: str
    strategy: str
    wanted: float
    laid: float
    least: float
    most: float
    empty: int
    note: str
    seconds: float

    @property
    def inside(self) -> bool:
        """Whether the strategy can lay that much."""
        return self.least <= self.wanted <= self.most

    @property
    def off(self) -> float:
        """Deviation from the target; where it lies outside, from the end of the reach if nearer."""
        end = float(np.clip(self.wanted, self.least, self.most))
        return min(self.laid / self.wanted - 1.0, self.laid / end - 1.0, key=abs)


@dataclass(frozen=True)
class Reach:
    """A strategy on a sliced part, and what it lays at least and at most, mm per layer.

    Attributes
    ----------
    part, name : str
    strategy : Any
    case : Case
    field : StressField
    layers : sequence of Layer
    least, most : float
    filled : (n,) bool array
        Layers on which the most lays fibre.
    """

    part: str
    name: str
    strategy: Any
    case: Case
    field: StressField
    layers: Sequence[Layer]
    least: float
    most: float
    filled: BoolArray


def reach(case: Case, field: StressField, layers: Sequence[Layer], name: str) -> Reach | None:
    """Find the least and the most that a strategy lays; None where it cannot plan the part."""
    strategy: Any = create(name)
    try:
        high: Planned
        if isinstance(strategy, LengthStrategy):
            ends: list[Any] = [
                replace(strategy, **{strategy.amount.parameter: value})  # type: ignore[type-var]
                for value in (strategy.amount.least, strategy.amount.most)
            ]
            least, most = (one.natural_length(layers, case.machine) for one in ends)
            high = plan_to_length(strategy, layers, field, case.machine, most)
            most = high.length_per_layer
        else:
            low, high = extremes(strategy, layers, field, case.machine)
            least, most = low.length_per_layer, high.length_per_layer
    except InputError as error:
        print(f"{case.name:10} {name:16} cannot plan the part: {error}", flush=True)
        return None
    filled = layer_lengths(high.toolpaths, layers) > 0.0
    return Reach(case.name, name, strategy, case, field, layers, least, most, filled)


def reached(known: Reach, shares: Sequence[float]) -> Iterator[Reached]:
    """Plan one strategy to targets at shares of its reach: 0 half its least, 1 1.2 its most."""
    least, most, machine = known.least, known.most, known.case.machine
    for share in shares:
        wanted = 0.5 * least + share * (1.2 * most - 0.5 * least)
        started = process_time()
        found = plan_to_length(known.strategy, known.layers, known.field, machine, wanted)
        seconds = process_time() - started
        laid = layer_lengths(found.toolpaths, known.layers) > 0.0
        yield Reached(
            known.part,
            known.name,
            wanted,
            found.length_per_layer,
            least,
            most,
            int((known.filled & ~laid).sum()),
            found.note,
            seconds,
        )


def targets(
    pairs: Sequence[tuple[str, str]], count: int, seed: int = SEED
) -> dict[tuple[str, str], list[float]]:
    """Shares of the reach for pairs of part and strategy, `count` in all, evenly dealt out."""
    random = np.random.default_rng(seed)
    found: dict[tuple[str, str], list[float]] = {pair: [] for pair in pairs}
    for k in range(count):
        found[pairs[k % len(pairs)]].append(float(random.random()))
    return found


def main() -> None:
    """Print the table; what cannot plan a part at all is said first."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    known: dict[tuple[str, str], Reach] = {}
    for part, size in PARTS.items():
        case = create_case(part, element_size=size)
        field = next(iter(solve(case.problem).values()))
        layers = Planar(count=LAYERS).cut(field.mesh, case.build)
        for name in sorted(named()):
            found = reach(case, field, layers, name)
            if found is not None:
                known[part, name] = found
    pairs = [(part, name) for name in sorted(named()) for part in PARTS if (part, name) in known]
    shares = targets(pairs, count)
    print(f"{count} targets, {LAYERS} layers, lengths in mm per layer, CPU seconds a plan")
    print(f"{'part':10} {'strategy':16}{'least':>8}{'most':>8}{'inside':>9}{'off':>8}", end="")
    print(f"{'outside':>9}{'off':>8}{'empty':>7}{'s':>8}")
    worst: list[Reached] = []
    for pair in sorted(pairs, key=lambda one: (list(PARTS).index(one[0]), one[1])):
        runs = list(reached(known[pair], shares[pair]))
        inside, outside = ([r for r in runs if r.inside is side] for side in (True, False))
        off = [max((abs(r.off) for r in some), default=0.0) for some in (inside, outside)]
        empty = sum(r.empty for r in runs)
        print(
            f"{pair[0]:10} {pair[1]:16}{known[pair].least:8.0f}{known[pair].most:8.0f}"
            f"{len(inside):9d}{off[0]:8.2%}{len(outside):9d}{off[1]:8.2%}{empty:7d}"
            f"{np.mean([r.seconds for r in runs]) if runs else 0.0:8.1f}",
            flush=True,
        )
        worst += [r for r in runs if abs(r.off) > TOLERANCE or r.empty]
    for r in worst:
        print(f"{r.part}, {r.strategy}: {r.laid:.0f} of {r.wanted:.0f}, {r.empty} empty: {r.note}")
    print(f"{len(worst)} of {count} targets missed by more than {TOLERANCE:.0%}")


if __name__ == "__main__":
    main()
