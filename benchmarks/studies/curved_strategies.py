"""Every strategy that plans on curved layers, at equal length of fibre.

    python -m benchmarks.studies.curved_strategies [PART ...] [--strategies A,B,..]
        [--pictures FOLDER]

PART is a case with `spatial` layers. Layers are thicker than those that are printed, so that a part
takes minutes. A row has the fibre that a strategy lays of the wanted length, 0.4 times the area of
the layers over the width of a strand; its coverage; the mean angle to the largest tension in the
layer and the share of the fibre within 10 degrees of it; the share on other fibre; the stiffness of
the virtual test over that of the part without fibre, of what carries of the strands; the share of
the gain that the upper bound of that length allows; and the CPU seconds of planning. Strategies
that cannot lay the wanted length stand behind the others.
"""

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from time import process_time
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from benchmarks.studies.table import with_strategies
from ccfem.base.errors import InputError
from ccfem.cases import create_case
from ccfem.fem.elasticity import StressField, solve
from ccfem.judging.evaluation import evaluate
from ccfem.judging.virtual_testing import Specimen, virtual_test
from ccfem.judging.virtual_testing.strands import carrying_strands
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import chart_of, in_charts
from ccfem.paths.planning.equal_fibre import plan_to_length
from ccfem.paths.planning.strategy import Planned, full_length
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers import Spatial
from ccfem.strategies import create, named
from ccfem.strategies.fibre_aware.upper_bound import upper_bound

__all__ = ["COVERAGE", "PARTS", "rows"]

PARTS = {"t_bracket": 2.0, "lifting_eye": 2.0, "twist_bar": 12.0}
"""Parts, and the thickness of their layers, mm."""
COVERAGE = 0.4
_COLUMNS = "strategy | m | coverage | angle | within 10 | on fibre | stiffness | share | CPU s"
_MOST_DRAWN = 6


def rows(name: str, pictures: Path | None, strategies: Iterable[str] = ()) -> list[str]:
    """Rows of the table for one part, the stiffest first; by default of all strategies."""
    case = create_case(name)
    stress = solve(case.problem)[next(iter(case.problem.loads))]
    layers = Spatial(thickness=PARTS[name])(stress, case.build, case.machine)
    wanted = COVERAGE * full_length(layers, case.machine)
    chosen = list(strategies) or [
        key for key, kind in sorted(named().items()) if not getattr(kind, "flat_layers_only", False)
    ]
    found = list(_judged(chosen, stress, layers, case.machine, wanted, pictures, name))
    found.sort(key=lambda row: (not row[0], -row[1]))
    return [f"| **{name}**, {len(layers)} layers |" + 8 * " |", *(text for *_, text in found)]


def _judged(
    strategies: Iterable[str],
    stress: StressField,
    layers: tuple[Layer, ...],
    machine: Machine,
    wanted: float,
    pictures: Path | None,
    part: str,
) -> Iterator[tuple[bool, float, str]]:
    """Whether each strategy lays the length, its stiffness, and its row."""
    specimen = Specimen.of(stress)
    for name in strategies:
        strategy, before = create(name), process_time()
        try:
            planned = plan_to_length(strategy, layers, stress, machine, wanted)
        except InputError as refused:
            yield False, 0.0, f"| `{name}` | {refused} |" + 7 * " |"
            continue
        seconds, paths = process_time() - before, planned.toolpaths
        strands = carrying_strands(paths, strategy, layers, stress.mesh, machine)
        ratio = virtual_test(strands, specimen, span=()).ratio
        length = float(paths.lengths.sum())
        share = upper_bound(stress, layers, length, machine).share(ratio)
        indices = evaluate(paths, layers, stress, machine).total
        yield planned.reached, ratio, _row(name, length, indices, ratio, share, seconds)
        if pictures is not None:
            _draw(pictures / f"{part}_{name}.png", planned, layers)


def _row(name: str, length: float, indices: Any, ratio: float, share: float, seconds: float) -> str:
    cells = [
        f"`{name}`",
        f"{1e-3 * length:.1f}",
        f"{indices['coverage']:.2f}",
        f"{indices['angle_mean']:.1f}",
        f"{100.0 * indices['aligned_10']:.0f} %",
        f"{100.0 * indices['on_fibre']:.1f} %",
        f"{ratio:.3f}",
        f"{share:.2f}",
        f"{seconds:.0f}",
    ]
    return f"| {' | '.join(cells)} |"


def _draw(file: Path, planned: Planned, layers: tuple[Layer, ...]) -> None:
    """Draw some layers of a plan, laid flat."""
    full = [layer for layer in layers if len(planned.toolpaths.on_layer(layer.index))]
    chosen = np.unique(np.linspace(0, max(len(full) - 1, 0), _MOST_DRAWN).astype(int))
    figure, axes = plt.subplots(2, _MOST_DRAWN // 2, figsize=(24, 13))
    for axis in axes.flat:
        axis.set_aspect("equal")
        axis.set_axis_off()
    for layer, axis in zip((full[k] for k in chosen if full), axes.flat, strict=False):
        for ring in chart_of(layer).flat.plane.rings:
            axis.plot(*np.concatenate([ring, ring[:1]]).T, "k", lw=1.0)
        for line in in_charts(planned.toolpaths.on_layer(layer.index), [layer]):
            axis.plot(*line[:, :2].T, lw=1.2)
    figure.tight_layout()
    figure.savefig(file, dpi=60)
    plt.close(figure)


def main(arguments: list[str]) -> None:
    """Print the table."""
    with_strategies(arguments, _COLUMNS, PARTS, rows)


if __name__ == "__main__":
    main(sys.argv[1:])
