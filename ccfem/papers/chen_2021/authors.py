"""Evaluate the published toolpaths of Chen et al. 2021 beside the figures stated for them.

Run with the environment variable ``CCFEM_CHEN2021`` set::

    python -m ccfem.papers.chen_2021.authors
"""

import tomllib
from functools import cache
from pathlib import Path

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.fem.elasticity import StressField, solve
from ccfem.geometry.polylines import turning_angles
from ccfem.judging.evaluation import Evaluation, evaluate
from ccfem.machine import Machine
from ccfem.papers.chen_2021.loop import LAYERS_PUBLISHED, authors_folder, authors_loop
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.waypoints import read_waypoints
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.planar import Planar

PATHS = {"ours": "GcodeGenerater_Ours_raw.txt", "zigzag": "GcodeGenerater_Zigzag_Contour_raw.txt"}
"""File of each set of published paths: the authors' own and their zigzag with contours."""

STATED: dict[str, dict[str, float]] = tomllib.loads(
    Path(__file__).with_name("stated.toml").read_text(encoding="utf-8")
)
"""Figures of the published Loop paths, as an independent evaluation gave them."""

TABLE_2 = {"ours": 34.658, "zigzag": 35.895}
"""Length of fibre, m, in the paper's Table 2: the first 12 layers."""


@cache
def solved_loop() -> tuple[StressField, tuple[Layer, ...], Machine]:
    """Stress of the authors' Loop, its 20 published layers, and the machine."""
    case = authors_loop()
    stress = solve(case.problem)["pull"]
    layers = Planar(count=LAYERS_PUBLISHED).cut(case.problem.mesh, case.build)
    return stress, layers, case.machine


@cache
def published_paths(name: str) -> Toolpaths:
    """Read the published paths of the Loop, "ours" or "zigzag", all 20 layers."""
    _, layers, _ = solved_loop()
    return read_waypoints(authors_folder() / "Loop" / PATHS[name], layers[0].plane.frame)


def evaluate_published(name: str, count: int = LAYERS_PUBLISHED) -> Evaluation:
    """Evaluate the first `count` layers of the published paths."""
    stress, layers, machine = solved_loop()
    paths = published_paths(name)
    return evaluate(paths.select(paths.layer < count), layers[:count], stress, machine)


def waypoint_curvature(name: str) -> FloatArray:
    """Curvature at the published waypoints, 1/mm: turning angle over the mean adjoining step."""
    paths = published_paths(name)
    angle = turning_angles(paths.points, paths.offsets, paths.closed)
    step = np.linalg.norm(np.diff(paths.points, axis=0), axis=1)
    inner = np.ones(len(paths.points), dtype=bool)
    inner[paths.offsets[:-1]] = inner[paths.offsets[1:] - 1] = False
    index = np.flatnonzero(inner)
    return angle[index] / (0.5 * (step[index - 1] + step[index]))


def main() -> None:
    """Print every index of both sets of paths, 12 and 20 layers, beside what is stated."""
    for name, stated in STATED.items():
        part, whole = evaluate_published(name, 12).total, evaluate_published(name).total
        print(f"\n{name}: Table 2 has {TABLE_2[name]} m in the first 12 layers")
        print(f"{'':22}{'12 layers':>12}{'20 layers':>12}{'stated':>12}")
        for index, value in whole.items():
            known = f"{stated[index]:12.4g}" if index in stated else ""
            print(f"{index:22}{part[index]:12.5g}{value:12.5g}{known}")
        curvature = waypoint_curvature(name)
        print(f"{'at the waypoints, 20 layers':46}")
        for share in (50, 80, 95, 100):
            index = f"curvature_{share if share < 100 else 'max'}"
            value = np.percentile(curvature, share)
            print(f"{index:34}{value:12.5g}{stated[index]:12.4g}")
        ok = float((curvature < 0.26).mean())
        print(f"{'curvature_ok':34}{ok:12.5g}{stated['curvature_ok']:12.4g}")


if __name__ == "__main__":
    main()
