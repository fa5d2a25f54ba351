"""Fibre for several load cases at once: three parts, each planned alone and together.

    python -m benchmarks.studies.several_loads [PART ...] [--strategies A,B,..] [--pictures DIR]

Each part is planned by `stream_function` for every load case alone and for all at once, at equal
length, and tested under every case. The share of the best single plan, worst case, is held against
that of isocurves with layers by case and the same cut, and against the bound that no paths exceed.
First failure is the least multiple of any case's load; plans for strength make it larger.
"""

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.studies.table import with_strategies
from ccfem.cases import create_case
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.judging.virtual_testing.several_cases import cases_failure, virtual_tests
from ccfem.paths.planning.equal_fibre import plan_to_length
from ccfem.paths.planning.strategy import Strategy, full_length
from ccfem.strategies.fibre_aware.plan_cases import plan_cases
from ccfem.strategies.fibre_aware.upper_bound import upper_bound
from ccfem.strategies.isocurve import Isocurve
from ccfem.strategies.stream_function import StreamFunction

__all__ = ["PARTS", "compared"]

COVERAGE, MOVES, STRENGTHS = 0.45, 6, (0.25, 0.5)
PARTS = {
    "two_load_plate": ("two_load_plate", {}),
    "two_load_plate, 3 cases": ("two_load_plate", {"both_ways": True}),
    "two_pull_loop": ("two_pull_loop", {}),
    "two_angle_bracket": ("two_angle_bracket", {}),
}
"""Cases with their parameters."""


def compared(
    name: str, parameters: Mapping[str, object], pictures: Path | None, chosen: Sequence[str] = ()
) -> list[str]:
    """Rows of the table for one part; of plans for all cases those chosen, by default all."""
    case = create_case(name, **parameters)
    cases = WeightedCases.of(solve(case.problem))
    if len(cases) > 2:
        name = f"{name}, {len(cases)} cases"
    layers, machine = case.slicing(cases.fields[0], case.build, case.machine), case.machine
    wanted = COVERAGE * full_length(layers, machine)
    strategy = StreamFunction()
    tested, spent = {}, {}
    for field in cases.fields:
        started = time.process_time()
        planned = plan_to_length(strategy, layers, field, machine, wanted)
        spent[f"for {field.case}"] = time.process_time() - started
        tested[f"for {field.case}"] = virtual_tests(planned.toolpaths, cases, machine=machine)
    best = np.array([found.ratios[k] for k, found in enumerate(tested.values())])
    together: dict[str, Strategy] = {
        "isocurve": Isocurve(),
        "stream_function": strategy,
        "stream_function, moved": replace(strategy, moves=MOVES),
    }
    for strength in STRENGTHS:
        together[f"stream_function, strength {strength:g}"] = replace(strategy, strength=strength)
    for what in chosen or together:
        one = together[what]
        started = time.process_time()
        planned = plan_cases(one, layers, cases, machine, wanted)
        spent[f"for all, {what}"] = time.process_time() - started
        tested[f"for all, {what}"] = virtual_tests(planned.toolpaths, cases, machine=machine)
        if pictures is not None:
            for layer in range(2):
                figure = planned.toolpaths.plot(layer=layer)
                figure.savefig(pictures / f"{name}-{what}-{layer}.png", dpi=100)
    bound = upper_bound(cases, layers, wanted * len(layers), machine)
    alone = np.mean([spent[f"for {field.case}"] for field in cases.fields])
    rows = []
    for what, found in tested.items():
        ratios, failure = found.ratios, cases_failure(found, layers=layers)
        rows.append(
            f"| {name} | {what} | {' / '.join(f'{r:.3f}' for r in ratios)} | "
            f"{(ratios / best).min():.3f} | {bound.shares(ratios).min():.3f} | "
            f"{bound.gap(ratios):.1%} | {failure.factor:.2f} | {spent[what] / alone:.1f} |"
        )
    singles = " / ".join(f"{r:.3f}" for r in bound.singles)
    most = (bound.singles / best).min() / bound.least
    rows.append(
        f"| {name} | bound | {singles} | {most:.3f} at most | {1.0 / bound.least:.3f} at most "
        f"| {bound.duality_gap:.1%} of the density found | | |"
    )
    return rows


def main(arguments: list[str]) -> None:
    """Print the table."""
    heads = (
        "stiffness ratio by case | worst of best single | worst of bound | gap | first failure "
        "| time"
    )

    def rows(name: str, pictures: Path | None, chosen: Sequence[str]) -> list[str]:
        return compared(*PARTS[name], pictures, chosen)

    with_strategies(arguments, f"part | planned | {heads}", PARTS, rows)


if __name__ == "__main__":
    main(sys.argv[1:])
