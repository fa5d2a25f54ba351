"""How stiff the authors' Loop can get with their 34.66 m of fibre, and what each way reaches.

    CCFEM_CHEN2021=folder python -m ccfem.papers.chen_2021.fibre_aware

Prints the authors' paths, `isocurve`, pruned `isocurve` and `stream_function` at no more fibre than
theirs (Chen et al. 2021, table 2), tested under the pull that they are planned for and under a
bearing load on the same hole, beside the bound that no paths exceed. Then the same length in fewer
and in more layers. Nothing of this is in the paper.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from time import perf_counter, process_time
from typing import Any

from ccfem.cases.case import Case
from ccfem.fem.elasticity import StressField, solve
from ccfem.fem.elasticity.problem import Bearing
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import (
    HONEST_PROMISE,
    virtual_bracket,
    virtual_test,
)
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.judging.virtual_testing.strength import first_failure
from ccfem.papers.chen_2021.authors import TABLE_2
from ccfem.papers.chen_2021.loop import LAYERS_TABLE_2, authors_loop
from ccfem.papers.chen_2021.virtual_test import MATRIX_STRENGTH, authors_paths
from ccfem.paths.planning import plan, plan_to_length
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fibre_aware.prune import prune
from ccfem.strategies.fibre_aware.upper_bound import upper_bound
from ccfem.strategies.isocurve import Isocurve
from ccfem.strategies.stream_function import StreamFunction

LENGTH = 1000.0 * TABLE_2["ours"]
"""Fibre of the authors' own paths in table 2, mm."""

LAYER_COUNTS = (8, 12, 16, 24)


@cache
def loop() -> tuple[Case, dict[str, StressField], dict[str, Specimen]]:
    """Return the Loop with its pull and a bearing load, solved, and its specimens."""
    case = authors_loop()
    bearing = (Bearing("load", (0.0, 0.0, 1000.0)),)
    problem = replace(case.problem, loads={**case.problem.loads, "bearing": bearing})
    fields = solve(problem)
    return case, fields, {name: Specimen.of(field) for name, field in fields.items()}


@cache
def sliced(count: int = LAYERS_TABLE_2) -> tuple[Layer, ...]:
    """Layers spread evenly over the height."""
    case, _, _ = loop()
    return Planar(count=count).cut(case.problem.mesh, case.build)


def _coverage(layers: Sequence[Layer]) -> float:
    """Share of the layers that the authors' length covers at the strand width."""
    case, _, _ = loop()
    return LENGTH * case.machine.fibre_width / sum(float(layer.areas.sum()) for layer in layers)


def isocurve(count: int = LAYERS_TABLE_2) -> Toolpaths:
    """Isocurves of at most the authors' length."""
    case, fields, _ = loop()
    wanted = LENGTH / count
    return plan_to_length(Isocurve(), sliced(count), fields["pull"], case.machine, wanted).toolpaths


def pruned(count: int = LAYERS_TABLE_2) -> Toolpaths:
    """Isocurves planned with a low cap, pruned to the authors' length."""
    case, fields, specimens = loop()
    paths = plan(Isocurve(cap=60.0), sliced(count), fields["pull"], case.machine)
    return prune(paths, specimens["pull"], LENGTH, case.machine)


def stream_function(load: str = "pull", count: int = LAYERS_TABLE_2, **options: Any) -> Toolpaths:
    """Isocurves of the field designed under a load."""
    case, fields, _ = loop()
    layers = sliced(count)
    strategy = StreamFunction(coverage=_coverage(layers), **options)
    return plan(strategy, layers, fields[load], case.machine)


def bound(load: str = "pull", count: int = LAYERS_TABLE_2, mode: str = "tension") -> float:
    """Stiffness ratio that no paths of the authors' length exceed."""
    case, fields, _ = loop()
    return upper_bound(fields[load], sliced(count), LENGTH, case.machine, mode=mode).ratio


@dataclass(frozen=True)
class Tested:
    """Virtual tests of one design."""

    length: float  # mm
    paths: int
    # Stiffness ratio under the pull.
    tension: float
    bonded: float
    bearing: float  # stiffness ratio under the bearing load, fibres in tension only
    failure: float  # kN: load at first failure under the pull


def tested(paths: Toolpaths) -> Tested:
    """Test paths under both loads."""
    _, fields, specimens = loop()
    strands = cut_strands(paths, fields["pull"].mesh)
    both = virtual_bracket(strands, specimens["pull"], span=())
    failure = first_failure(both.tension, matrix_strength=MATRIX_STRENGTH)
    return Tested(
        length=float(paths.lengths.sum()),
        paths=len(paths),
        tension=both.tension.ratio,
        bonded=both.bonded.ratio,
        bearing=virtual_test(strands, specimens["bearing"], span=()).ratio,
        failure=1e-3 * failure.load,
    )


def designs() -> dict[str, Callable[[], Toolpaths]]:
    """Return what the first table compares."""
    return {
        "authors' paths": partial(authors_paths, "ours"),
        "isocurve": isocurve,
        "isocurve, pruned": pruned,
        "stream_function": stream_function,
        "stream_function, planned for bearing": partial(stream_function, "bearing"),
        "stream_function, off the boundary": partial(stream_function, inset=0.45),
    }


def main() -> None:
    """Print both tables."""
    case, _, _ = loop()
    most = bound()
    print(f"{case.title}; {LAYERS_TABLE_2} layers, rho 4 mm^2, stiffness over the part without")
    print(
        f"{'':38}{'m':>7}{'paths':>7}{'tension':>9}{'bonded':>8}{'bearing':>9}{'gain':>7}", end=""
    )
    print(f"{'kN':>7}{'s':>7}{'CPU s':>7}")
    for name, make in designs().items():
        wall, cpu = perf_counter(), process_time()
        paths = make()
        wall, cpu = perf_counter() - wall, process_time() - cpu
        t = tested(paths)
        share = (t.tension - 1.0) / (most - 1.0)
        print(
            f"{name:38}{1e-3 * t.length:7.2f}{t.paths:7d}{t.tension:9.3f}{t.bonded:8.3f}"
            f"{t.bearing:9.3f}{share:7.1%}{t.failure:7.2f}{wall:7.1f}{cpu:7.1f}",
            flush=True,
        )
    bonded, bearing = bound(mode="bonded"), bound("bearing")
    print(f"{'no paths exceed':38}{1e-3 * LENGTH:7.2f}{'':7}{most:9.3f}{bonded:8.3f}{bearing:9.3f}")
    print("gain: share of the largest gain in stiffness; kN: predicted load at first failure\n")

    print(f"the same {1e-3 * LENGTH:.2f} m in other numbers of layers: tension, pull (metres laid)")
    print(f"{'layers':>8}{'isocurve, pruned':>22}{'stream_function':>22}{'no paths exceed':>18}")
    for count in LAYER_COUNTS:
        print(f"{count:8d}", end="")
        for make in (pruned, partial(stream_function, "pull")):
            paths = make(count=count)
            ratio = virtual_test(paths, loop()[2]["pull"], span=()).ratio
            print(f"{ratio:13.3f} ({1e-3 * paths.lengths.sum():5.2f})", end=" ", flush=True)
        print(f"{bound(count=count):17.3f}")
    print(f"\n{HONEST_PROMISE}")


if __name__ == "__main__":
    main()
