"""Every strategy on the authors' Loop, beside the authors' published paths, at equal fibre.

    CCFEM_CHEN2021=folder python -m ccfem.papers.chen_2021.strategies

At most the fibre of the authors' own paths (Table 2: 34.658 m in 12 layers). ``literal`` is the
algorithm as the paper prints it, with all of its steps; it lays what its search for the number of
isocurves allows. The stress and the virtual test are those of ``authors_loop``. PrusaSlicer's rows
are left out where the program is not installed.
"""

import time
from collections.abc import Callable

from ccfem.fem.elasticity import solve
from ccfem.judging.evaluation import evaluate
from ccfem.judging.virtual_testing import Specimen, first_failure, virtual_test
from ccfem.papers.chen_2021.loop import authors_loop
from ccfem.papers.chen_2021.slicers import PATTERNS, slicer_found, slicer_paths_to_length
from ccfem.papers.chen_2021.virtual_test import MATRIX_STRENGTH, authors_paths
from ccfem.paths.planning import Strategy, plan, plan_to_length
from ccfem.paths.toolpaths import Toolpaths
from ccfem.strategies import create
from ccfem.strategies.isocurve import Isocurve

COLUMNS = {
    "fibre_length": ("fibre m", 1e-3),
    "paths": ("paths/layer", 1.0 / 12.0),
    "aligned_10": ("< 10 deg", 1.0),
    "aligned_stress_10": ("by stress", 1.0),
    "efficiency": ("effic.", 1.0),
    "coverage_top_20": ("top 20 %", 1.0),
    "curvature_95": ("curv. 95", 1.0),
    "spacing_below": ("< W", 1.0),
    "outside_depth": ("outside", 1.0),
    "crossings": ("cross.", 1.0),
    "self_crossings": ("self", 1.0),
}
"""Columns of the evaluator, their headings and factors."""


def main() -> None:
    """Print the table."""
    case = authors_loop()
    field = solve(case.problem)["pull"]
    layers = case.slicing(field, case.build, case.machine)
    specimen = Specimen.of(field)
    authors = authors_paths("ours")
    wanted = float(authors.lengths.sum()) / len(layers)

    def at_length(strategy: Strategy) -> Callable[[], Toolpaths]:
        return lambda: plan_to_length(strategy, layers, field, case.machine, wanted).toolpaths

    def as_is(strategy: Strategy) -> Callable[[], Toolpaths]:
        return lambda: plan(strategy, layers, field, case.machine)

    def sliced(pattern: str, angle: float, turn: float) -> Callable[[], Toolpaths]:
        return lambda: slicer_paths_to_length(layers, pattern, angle, wanted, turn)

    rows: dict[str, Callable[[], Toolpaths]] = {
        "authors, ours": lambda: authors,
        "authors, zigzag-contour": lambda: authors_paths("zigzag"),
        "isocurve": as_is(Isocurve()),
        "isocurve, search": as_is(Isocurve(spacing="search")),
        "isocurve, cone": as_is(Isocurve(spacing="cone")),
        "isocurve, loaded holes": at_length(Isocurve(conformal="loaded")),
        "isocurve, literal": as_is(Isocurve.literal()),
        **{
            name: at_length(create(name, {"turns": "tight"}))
            for name in ("concentric", "zigzag", "contour_zigzag")
        },
    }
    if slicer_found():
        rows |= {name: sliced(*settings) for name, settings in PATTERNS.items()}
    else:
        print("PrusaSlicer not found: rows left out")
    heads = [head for head, _ in COLUMNS.values()]
    print(f"{'':28}" + "".join(f"{h:>12}" for h in [*heads, "T", "B", "failure N", "seconds"]))
    for name, paths_of in rows.items():
        started = time.perf_counter()
        paths = paths_of()
        seconds = time.perf_counter() - started
        total = evaluate(paths, layers, field, case.machine).total
        tension = virtual_test(paths, specimen, span=())
        bonded = virtual_test(paths, specimen, mode="bonded", span=())
        failure = first_failure(tension, matrix_strength=MATRIX_STRENGTH)
        values = [total[key] * factor for key, (_, factor) in COLUMNS.items()]
        values += [tension.ratio, bonded.ratio, failure.load, seconds]
        print(f"{name:28}" + "".join(f"{value:12.4g}" for value in values), flush=True)


if __name__ == "__main__":
    main()
