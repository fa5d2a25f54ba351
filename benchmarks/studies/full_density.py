"""How much of a flat layer each strategy covers with as much fibre as it lays, and what that gives.

    python -m benchmarks.studies.full_density [PART ...] [--strategies A,B,..] [--pictures FOLDER]

Two layers of each part; every strategy at the amount at which it lays most. A row has the metres a
layer, the coverage, the share of the fibre on other fibre, the mean angle to the largest tension,
the shortest strand, the stiffness of the virtual test over that of the part without fibre, and the
CPU seconds of planning. `stripes folds` may join strands by links in which they fold.
"""

import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

from benchmarks.studies import confirmed_gain, stripes_among_plans
from benchmarks.studies.table import with_strategies
from ccfem.cases import create_case
from ccfem.fem.elasticity import Problem, StressField, solve
from ccfem.judging.evaluation import evaluate
from ccfem.judging.virtual_testing import Specimen, virtual_test
from ccfem.judging.virtual_testing.strands import carrying_strands
from ccfem.machine.machine import Machine
from ccfem.paths.planning import plan
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create

__all__ = ["PARTS", "rows"]

PARTS = ("loop", "bracket", "open_hole", "star", "gear", "ring")
LAYERS = 2
STRATEGIES: dict[str, tuple[str, dict[str, Any]]] = {
    "stripes": ("stripes", {}),
    "stripes folds": ("stripes", {"folds": True}),
    "stream_function": ("stream_function", {}),
    "pruned": ("pruned", {}),
    "isocurve": ("isocurve", {}),
    "concentric": ("concentric", {}),
    "fiso": ("fiso", {}),
    "zigzag": ("zigzag", {}),
    "contour_zigzag": ("contour_zigzag", {}),
}
"""Names and parameters of what is compared."""
_COLUMNS = "strategy | m a layer | coverage | on fibre | angle | shortest, mm | stiffness | CPU s"


def _problem(name: str) -> tuple[Problem, Machine]:
    """Part, held and loaded, on linear cells, and its machine."""
    if name in stripes_among_plans.PARTS:
        case = stripes_among_plans.part_of(name)
        return replace(case.problem, order=1), case.machine
    if name in confirmed_gain.PARTS:
        return confirmed_gain.posed(name), Machine()
    case = create_case(name, order=1)
    return case.problem, case.machine


def rows(name: str, pictures: Path | None, strategies: Iterable[str] = ()) -> list[str]:
    """Rows of the table for one part."""
    problem, machine = _problem(name)
    stress: StressField = solve(problem)[next(iter(problem.loads))]
    layers, specimen = Planar(count=LAYERS).cut(problem.mesh), Specimen.of(stress)
    found = [f"| **{name}** |" + 7 * " |"]
    for title in strategies or STRATEGIES:
        kind, parameters = STRATEGIES[title]
        amount, before = create(kind).amount, process_time()
        most = {amount.parameter: amount.most, **dict(amount.beyond)}
        strategy = create(kind, {**parameters, **most})
        paths = plan(strategy, layers, stress, machine)
        seconds = process_time() - before
        total = evaluate(paths, layers, stress, machine).total
        strands = carrying_strands(paths, strategy, layers, stress.mesh, machine)
        ratio = virtual_test(strands, specimen, span=()).ratio
        cells = (
            *(f"`{title}`", f"{1e-3 * paths.lengths.sum() / LAYERS:.2f}"),
            *(f"{total['coverage']:.3f}", f"{total['on_fibre']:.1%}", f"{total['angle_mean']:.1f}"),
            *(f"{paths.lengths.min():.1f}", f"{ratio:.3f}", f"{seconds:.0f}"),
        )
        found.append(f"| {' | '.join(cells)} |")
        if pictures is not None:
            paths.plot(layer=0).savefig(pictures / f"{name}-{title}.png", dpi=100)
    return found


def main(arguments: list[str]) -> None:
    """Print the table."""
    with_strategies(arguments, _COLUMNS, PARTS, rows)


if __name__ == "__main__":
    main(sys.argv[1:])
