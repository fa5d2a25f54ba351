"""Time of `stripes` on the layers of Zhang et al. 2025.

    CCFEM_ZHANG2025=folder python -m benchmarks.speed.stripes

Field, pattern and isocurves of the largest layer on finer and finer triangles, in seconds of the
processor; then the whole plan of all layers, on all processors (`CCFEM_THREADS`), in seconds of
clock: second run, with the charts of the layers at hand.
"""

import time

import numpy as np

from ccfem.base.tensor import in_plane
from ccfem.papers.zhang_2025.contents import MACHINE, Study
from ccfem.paths.fields.chart import flat_view
from ccfem.paths.planning import plan
from ccfem.slicing.layers.layer import stress_on
from ccfem.strategies.stripe_pattern.pattern import (
    Cells,
    isocurves,
    line_field,
    refined,
    stripe_pattern,
)
from ccfem.strategies.stripes import Stripes

EDGES = (0.9, 0.6, 0.45)
"""Longest edges of triangles, in fibre widths; the first is that of the strategy."""


def main() -> None:
    """Print two tables."""
    study, width, strategy = Study(), MACHINE.fibre_width, Stripes()
    layers = [flat_view(layer) for layer in study.layers]
    layer = max(layers, key=lambda each: float(each.areas.sum()))
    plane = in_plane(stress_on(layer, study.stress).nodal, layer.plane.frame)
    layer_of = layer.plane.points, layer.triangles
    print("triangles | field, s | pattern, s | isocurves, s | all, s")
    for edge in EDGES:
        seconds = [time.process_time()]
        points, triangles, values = refined(*layer_of, plane, edge * width)
        cells = Cells(points, triangles)
        how = (strategy.smooth * width, strategy.border * width)
        angle = line_field(cells, values, cells.border, *how)
        seconds.append(time.process_time())
        pattern = stripe_pattern(cells, angle, strategy.pitch * width)
        seconds.append(time.process_time())
        isocurves(pattern)
        seconds.append(time.process_time())
        spent = [*np.diff(seconds), seconds[-1] - seconds[0]]
        print(" | ".join([str(len(triangles)), *(f"{each:.2f}" for each in spent)]), flush=True)
    for folds in (False, True):
        for _ in range(2):
            vars(study.stress).pop("stripes", None)
            start = time.perf_counter()
            plan(Stripes(folds=folds), study.layers, study.stress, MACHINE)
            whole = time.perf_counter() - start
        print(f"{len(layers)} layers, folds {folds}: {whole:.1f} s, {whole / len(layers):.2f} each")


if __name__ == "__main__":
    main()
