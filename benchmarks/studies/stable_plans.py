"""Whether the stiffness of a plan is a smooth function of the length wanted.

    python -m benchmarks.studies.stable_plans [cantilever bracket loop ...] [--lengths 67]

Plans parts to many lengths close to each other, and tests each plan. A plan stands out where its
stiffness ratio differs from the straight line between its neighbours by more than half a percent.
The number of those is the exit code.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.studies.cheats import BRACKET, CANTILEVER
from ccfem.base.arrays import FloatArray
from ccfem.cases import create_case
from ccfem.cases.case import Case
from ccfem.cases.reading import read
from ccfem.comparison.engine import solved
from ccfem.comparison.ranking import stiffness_ratio
from ccfem.comparison.request import Request
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import evaluated, planned_to_lengths, with_test
from ccfem.paths.toolpaths import Toolpaths
from ccfem.strategies import create

__all__ = ["outstanding"]

SPANS = {"cantilever": (120.0, 320.0), "bracket": (150.0, 650.0), "loop": (600.0, 3000.0)}
"""Lengths that are tried, mm a layer."""
ALLOWED = 0.005
"""Relative difference from the line between the neighbours that is not yet remarkable."""


def outstanding(lengths: FloatArray, ratios: FloatArray) -> FloatArray:
    """Relative difference (n - 2,) of each inner ratio from the line between its neighbours."""
    share = (lengths[1:-1] - lengths[:-2]) / (lengths[2:] - lengths[:-2])
    between = (1.0 - share) * ratios[:-2] + share * ratios[2:]
    return np.abs(ratios[1:-1] / between - 1.0)


def _case(name: str) -> Case:
    posed = {part.name: part for part in (CANTILEVER, BRACKET)}.get(name)
    if posed is None:
        return create_case(name)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.toml"
        file.write_text(posed.text(), encoding="utf-8")
        return read(file)


def planned(name: str, lengths: FloatArray, strategy: str) -> Iterator[tuple[float, float]]:
    """Length laid, mm a layer, and stiffness ratio of the plan to each length wanted."""
    request = Request.of(_case(name), [strategy], curve=False, natural=True)
    basis = solved(request)
    part = basis.cut()
    assert basis.tests is not None
    for length in lengths:
        run = Run(name, create(strategy), Toolpaths.empty(), None)
        run = planned_to_lengths(run, part, [float(length)])[0]
        run = with_test(evaluated(run, part), part, basis.tests)
        yield run.length_per_layer, stiffness_ratio(run)


def main() -> int:
    """Try parts, and print what stands out; the number of those."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", default=list(SPANS))
    parser.add_argument("--lengths", type=int, default=67)
    parser.add_argument("--strategy", default="stream_function")
    asked = parser.parse_args()
    count = 0
    for name in asked.parts:
        wanted = np.linspace(*SPANS[name], asked.lengths)
        ratios = np.empty(len(wanted))
        for k, (laid, ratio) in enumerate(planned(name, wanted, asked.strategy)):
            ratios[k] = ratio
            short = "" if laid > 0.99 * wanted[k] else "  lays less"
            print(f"{name} {wanted[k]:.2f} mm: {laid:.2f} mm, {ratio:.4f}{short}", flush=True)
        away = outstanding(wanted, ratios)
        worst = int(np.argmax(away))
        count += int((away > ALLOWED).sum())
        print(
            f"{name}: {len(wanted)} lengths, {(away > ALLOWED).sum()} stand out; at most "
            f"{away[worst]:.2%} from the line, at {wanted[worst + 1]:.2f} mm",
            flush=True,
        )
    return count


if __name__ == "__main__":
    raise SystemExit(main())
