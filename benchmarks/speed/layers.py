"""What takes time on one layer of the case `loop`, done in two ways each, in processor seconds.

    python -m benchmarks.speed.layers

Equations of `stripes` on the middle layer of 12 and of 24, ordered by minimum degree and by nested
dissection: seconds of both factorisations, of the whole layer, and how far the lines differ. Then
the triangles of 1,500 points of the middle layer of 12, a hundred times: all made ready each time,
and once for all.
"""

import time
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.cases import create_case
from ccfem.fem.elasticity import solve
from ccfem.geometry.locate import locate
from ccfem.paths.fields.layer_elements import dissected, positive_definite
from ccfem.slicing.layers import Layer
from ccfem.slicing.layers.layer import stress_on
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.stripe_pattern import pattern
from ccfem.strategies.stripes import Stripes

Solve = Callable[[FloatArray], FloatArray]

_WAYS: dict[str, Callable[[Any, FloatArray], Solve]] = {
    "minimum degree": lambda matrix, _: positive_definite(matrix).solve,
    "nested dissection": dissected,
}
_QUERIES, _TIMES = 1500, 100


def main() -> None:
    """Print two tables."""
    case = create_case("loop")
    field = next(iter(solve(case.problem).values()))
    print("layers | order | factorisations, s | layer, s | lines, mm apart")
    for count in (12, 24):
        layers = Planar(count=count).cut(field.mesh, case.build)
        layer = layers[count // 2]
        known: list[FloatArray] = []
        for name, way in _WAYS.items():
            factorising = [0.0]

            def timed(
                matrix: Any,
                points: FloatArray,
                way: Callable[[Any, FloatArray], Solve] = way,
                factorising: list[float] = factorising,
            ) -> Solve:
                start = time.process_time()
                solution = way(matrix, points)
                factorising[0] += time.process_time() - start
                return solution

            start = time.process_time()
            with patch.object(pattern, "dissected", timed):
                strands = Stripes().strands(layer, stress_on(layer, field), case.machine)
            whole, lines = time.process_time() - start, [strand.line for strand in strands]
            known = known or lines
            apart = max(np.abs(a - b).max() for a, b in zip(lines, known, strict=True))
            print(f"{count} | {name} | {factorising[0]:.2f} | {whole:.2f} | {apart:.0e}")
    _search(Planar(count=12).cut(field.mesh, case.build)[6])


def _search(layer: Layer) -> None:
    """Print the seconds of searches."""
    low, high = layer.plane.points.min(axis=0), layer.plane.points.max(axis=0)
    places = low + np.random.default_rng(0).random((_QUERIES, 2)) * (high - low)
    seconds = [time.process_time()]
    for _ in range(_TIMES):
        locate(layer.plane.points, layer.triangles, places)
    seconds.append(time.process_time())
    for _ in range(_TIMES):
        layer.plane_triangles.locate(places)
    seconds.append(time.process_time())
    anew, once = np.diff(seconds)
    print(f"\n{_TIMES} searches: made ready each time {anew:.2f} s, once {once:.2f} s")


if __name__ == "__main__":
    main()
