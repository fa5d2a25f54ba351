"""How much fibre turns more tightly than the machine allows, and what it costs to cut it there.

    python -m benchmarks.studies.tight_turns [PART ...] [--pictures DIR]

Five parts of six layers are planned by every strategy at its natural amount of fibre, by those that
have `turns` with each of its values. A row says the share above the limit as the evaluator finds
it, the metres laid, and how many times as stiff the part is.
"""

import sys
from pathlib import Path
from typing import get_args, get_type_hints

from benchmarks.studies.confirmed_gain import LAYERS, PARTS, posed
from benchmarks.studies.table import print_table
from ccfem.base.errors import InputError
from ccfem.cases import create_case
from ccfem.fem.elasticity.solve import solve
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.judging.evaluation import evaluate
from ccfem.judging.virtual_testing.virtual_test import virtual_test
from ccfem.machine.machine import Machine
from ccfem.paths.planning import plan
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create, named

__all__ = ["NAMES", "VALUES", "measured"]

NAMES = ("loop", "open_hole", "l_shape", "bracket", "lever")
VALUES = ("tight", "printable", "cut")


def _stress(name: str) -> StressField:
    """Stress in a part of `confirmed_gain`, or in a case."""
    problem = posed(name) if name in PARTS else create_case(name).problem
    return next(iter(solve(problem).values()))


def measured(name: str, pictures: Path | None = None) -> list[str]:
    """Rows of the table for one part."""
    stress, machine = _stress(name), Machine()
    layers = Planar(count=LAYERS).cut(stress.mesh)
    rows = []
    for strategy, kind in sorted(named().items()):
        known = get_args(get_type_hints(kind).get("turns")) or VALUES[:1]
        cells = []
        for turns in VALUES:
            if turns not in known:
                cells.append("")
                continue
            planner = create(strategy, {} if turns == VALUES[0] else {"turns": turns})
            try:
                paths = plan(planner, layers, stress, machine)
            except InputError:  # no joints to wind round
                break
            tight = 1.0 - evaluate(paths, layers, stress, machine).total["curvature_ok"]
            ratio = virtual_test(paths, stress, span=(), machine=machine).ratio
            metres = 1e-3 * float(paths.lengths.sum())
            cells.append(f"{tight:.1%}, {metres:.1f} m, {ratio:.2f}")
            if pictures is not None:
                picture = pictures / f"{name}-{strategy}-{turns}.png"
                paths.plot(layer=0).savefig(picture, dpi=100)
        if len(cells) == len(VALUES):
            rows.append(f"| {name} | {strategy} | {' | '.join(cells)} |")
    return rows


def main(arguments: list[str]) -> None:
    """Print the table."""
    print_table(arguments, f"part | strategy | {' | '.join(VALUES)}", NAMES, measured)


if __name__ == "__main__":
    main(sys.argv[1:])
