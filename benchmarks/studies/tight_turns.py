"""How much fibre turns more tightly than the machine allows, and what it costs to cut it there.

    python -m benchmarks.studies.tight_turns [PART ...] [--pictures DIR]

Five parts of six layers are planned by every strategy at its natural amount of fibre, by those that
have `turns` with each of its values. A row says the share above the limit as the evaluator finds
it, the metres laid, and how many times as stiff the part is. A second table sums up the parts: the
largest share above the limit, and the least and the most that `printable` and `cut` keep of the
metres and of the stiffness, percent.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias, get_args, get_type_hints

from benchmarks.studies.confirmed_gain import LAYERS, PARTS, posed
from benchmarks.studies.table import print_table
from ccfem.base.errors import InputError
from ccfem.cases import create_case
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.judging.evaluation import evaluate
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.machine.machine import Machine
from ccfem.paths.planning import plan
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create, named

__all__ = ["NAMES", "VALUES", "Plan", "measured", "rows", "summary"]

NAMES = ("loop", "open_hole", "l_shape", "bracket", "lever")
VALUES = ("tight", "printable", "cut")
KEPT = ("metres", "ratio")


def _stress(name: str) -> StressField:
    """Stress in a part of `confirmed_gain`, or in a case."""
    problem = posed(name) if name in PARTS else create_case(name).problem
    return next(iter(solve(problem).values()))


class Plan(NamedTuple):
    """Share of its fibre above the limit, its metres, and the stiffness ratio of the part."""

    tight: float
    metres: float
    ratio: float


Plans: TypeAlias = dict[str, dict[str, Plan]]
"""Plans of one part, by strategy and value of `turns`."""


def measured(name: str, pictures: Path | None = None) -> Plans:
    """Plan one part by every strategy that can."""
    stress, machine = _stress(name), Machine()
    layers = Planar(count=LAYERS).cut(stress.mesh)
    plans: Plans = {}
    for strategy, kind in sorted(named().items()):
        known = get_args(get_type_hints(kind).get("turns")) or VALUES[:1]
        for turns in [value for value in VALUES if value in known]:
            planner = create(strategy, {} if turns == VALUES[0] else {"turns": turns})
            try:
                paths = plan(planner, layers, stress, machine)
            except InputError:  # no joints to wind round
                break
            tight = 1.0 - evaluate(paths, layers, stress, machine).total["curvature_ok"]
            ratio = virtual_test(paths, stress, span=(), machine=machine).ratio
            metres = 1e-3 * float(paths.lengths.sum())
            plans.setdefault(strategy, {})[turns] = Plan(tight, metres, ratio)
            if pictures is not None:
                picture = pictures / f"{name}-{strategy}-{turns}.png"
                paths.plot(layer=0).savefig(picture, dpi=100)
    return plans


def rows(name: str, plans: Plans) -> list[str]:
    """Rows of the table for one part."""

    def cell(plan: Plan | None) -> str:
        return f"{plan.tight:.1%}, {plan.metres:.1f} m, {plan.ratio:.2f}" if plan else ""

    return [
        f"| {name} | {strategy} | {' | '.join(cell(by.get(turns)) for turns in VALUES)} |"
        for strategy, by in plans.items()
    ]


def summary(parts: Sequence[Plans]) -> list[str]:
    """Table over all parts: the largest shares above the limit, and what is kept, percent."""
    kept = [f"{what} that `{turns}` keeps" for turns in VALUES[1:] for what in KEPT]
    heads = ["strategy", *(f"`{turns}`" for turns in VALUES), *kept]
    table = [f"| {' | '.join(heads)} |", "|" + len(heads) * "---|"]
    for strategy in sorted({strategy for plans in parts for strategy in plans}):
        of_parts = [plans[strategy] for plans in parts if strategy in plans]
        cells = []
        for turns in VALUES:
            shares = [by[turns].tight for by in of_parts if turns in by]
            cells.append(f"{max(shares):.1%}" if shares else "")
        for turns in VALUES[1:]:
            pairs = [(by[turns], by[VALUES[0]]) for by in of_parts if turns in by]
            for what in KEPT:
                shares = [getattr(some, what) / getattr(whole, what) for some, whole in pairs]
                ends = f"{100 * min(shares):.0f} to {100 * max(shares):.0f}" if shares else ""
                cells.append(ends)
        table.append(f"| `{strategy}` | {' | '.join(cells)} |")
    return table


def main(arguments: list[str]) -> None:
    """Print the tables."""
    parts: list[Plans] = []

    def of_part(name: str, pictures: Path | None) -> list[str]:
        parts.append(measured(name, pictures))
        return rows(name, parts[-1])

    print_table(arguments, f"part | strategy | {' | '.join(VALUES)}", NAMES, of_part)
    print("\n".join(["", *summary(parts)]))


if __name__ == "__main__":
    main(sys.argv[1:])
