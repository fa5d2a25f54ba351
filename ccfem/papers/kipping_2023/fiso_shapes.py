"""First in, spiral out on eight shapes, flat and bent to a radius of 25 mm.

    python -m ccfem.papers.kipping_2023.fiso_shapes [FOLDER]

prints the table; into a folder it draws the strands.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray
from ccfem.body.meshing import extrude
from ccfem.comparison.plot.canvas import png
from ccfem.machine import Machine
from ccfem.papers.kipping_2023.figures import blank
from ccfem.paths.fields.chart import chart_of
from ccfem.slicing.layers.layer_stress import LayerStress
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fiso import Fiso

WIDTH, BEND = 0.9, 25.0
_REACH = 0.525
"""Distance from the strand, in widths, that counts as covered, as the addendum has it."""


def _disc(x: float, y: float, radius: float) -> shapely.Polygon:
    return shapely.Point(x, y).buffer(radius, quad_segs=24)


def _plate(length: float, width: float, holes: list[shapely.Polygon]) -> shapely.Polygon:
    return shapely.box(0.0, 0.0, length, width).difference(shapely.union_all(holes))


def _star() -> shapely.Polygon:
    angle = np.pi * np.arange(14) / 7.0
    radius = np.where(np.arange(14) % 2, 14.0, 30.0)
    return shapely.Polygon(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))


SHAPES = {
    "disc": _disc(0.0, 0.0, 15.0),
    "rectangle": _plate(50.0, 20.0, []),
    "dumbbell": shapely.union_all(
        [_disc(-20.0, 0.0, 10.0), _disc(20.0, 0.0, 12.0), shapely.box(-20.0, -2.0, 20.0, 2.0)]
    ),
    "annulus": _disc(0.0, 0.0, 20.0).difference(_disc(0.0, 0.0, 8.0)),
    "eccentric annulus": _disc(0.0, 0.0, 20.0).difference(_disc(6.0, 2.0, 8.0)),
    "three holes": _plate(60.0, 30.0, [_disc(12, 15, 5), _disc(30, 11, 4), _disc(47, 17, 6)]),
    "twelve holes": _plate(
        80.0,
        60.0,
        [_disc(10.0 + 20.0 * i, 10.0 + 20.0 * j, 4.0) for i in range(4) for j in range(3)],
    ),
    "star": _star(),
}


OPTIONS: dict[str, dict[str, float | bool]] = {
    "as published": {},
    "entry": {"entry": True},
    "necks opened at 3/4 of a width": {"closest": 0.5},
    "nothing nearer than a width": {"closest": 1.0},
    "least radius 1.5 mm": {"least_radius": 1.5},
    "least radius 3.85 mm": {"least_radius": 3.85},
}
"""Options of `Fiso`."""


@dataclass(frozen=True)
class Strand:
    """Figures of the strands on a shape: shares of its area, steps in widths."""

    paths: int
    coverage: float
    coverage_opened: float
    crossings: int
    longest_step: float
    off_surface: float
    lines: tuple[FloatArray, ...]


def measured(name: str, bent: bool, **options: Any) -> Strand:
    """Lay strands on a shape, and measure them where it lies flat."""
    section, machine = SHAPES[name], Machine(fibre_width=WIDTH)
    lay, no_stress = Fiso(**options, turns="tight"), cast(LayerStress, None)
    layer = Planar(count=1).cut(extrude(section, 1.0, 1.5))[0]
    if bent:
        x, y, _ = layer.points.T
        curved = np.stack([BEND * np.sin(x / BEND), y, BEND * np.cos(x / BEND)], axis=1)
        layer = replace(layer, points=curved, flat=None)
        chart = chart_of(layer)
        flat = lay(chart.flat, no_stress, machine)
        region = chart.flat.plane.polygon
        lifted = chart.lifted(flat)
        off = float(np.abs(np.hypot(lifted.points[:, 0], lifted.points[:, 2]) - BEND).max())
        lines = [chart.flat.plane.project(path) for path in flat]
    else:
        flat = lay(layer, no_stress, machine)
        region, off = layer.plane.polygon, 0.0
        lines = [layer.plane.project(path) for path in flat]
    strings = np.array([shapely.linestrings(line) for line in lines])
    bands = shapely.union_all(shapely.buffer(strings, _REACH * WIDTH, cap_style="flat"))
    opened = region.buffer(-0.5 * WIDTH).buffer(0.5 * WIDTH)
    crossings = int((~shapely.is_simple(strings)).sum())
    crossings += int(np.triu(shapely.crosses(strings[:, None], strings), 1).sum())
    return Strand(
        len(strings),
        bands.intersection(region).area / region.area,
        bands.intersection(opened).area / opened.area,
        crossings,
        max(_longest_step(line, region) for line in strings),
        off,
        tuple(lines),
    )


def _longest_step(line: shapely.LineString, section: shapely.Polygon) -> float:
    """Longest way, in widths, that lies off all distances from the border at which contours lie."""
    margin = 0.15 * WIDTH
    border = shapely.segmentize(section.boundary, 1.0)
    points = shapely.get_coordinates(shapely.segmentize(line, 0.05))
    off = shapely.distance(shapely.points(points), border) - 0.5 * WIDTH
    away = np.abs(off - WIDTH * np.round(off / WIDTH)) > margin
    size = np.append(np.linalg.norm(np.diff(points, axis=0), axis=1), 0.0)
    turns = np.concatenate([[0], np.cumsum(np.diff(away.astype(int)) != 0)])
    return float(np.bincount(turns[away], size[away], minlength=1).max() + 2.0 * margin) / WIDTH


def shapes_table() -> tuple[str, dict[tuple[str, bool], Strand]]:
    """Table in Markdown, and the strands by shape, flat and bent."""
    head = ["shape", "", "paths", "coverage", "of the opened area", "crossings", "longest step"]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    found = {}
    for name in SHAPES:
        for bent in (False, True):
            one = found[name, bent] = measured(name, bent)
            lines.append(
                f"| {name} | {'bent' if bent else 'flat'} | {one.paths} | {one.coverage:.3f} | "
                f"{one.coverage_opened:.3f} | {one.crossings} | {one.longest_step:.2f} |"
            )
    return "\n".join(lines) + "\n", found


def options_table() -> str:
    """Table of what the options cost in coverage, on the flat shapes."""
    lines = ["| options | paths | mean coverage | least | crossings | longest step |"]
    lines.append("|---" * 6 + "|")
    for title, options in OPTIONS.items():
        each = [measured(name, False, **options) for name in SHAPES]
        coverage = [one.coverage for one in each]
        lines.append(
            f"| {title} | {sum(one.paths for one in each)} | {np.mean(coverage):.3f} | "
            f"{min(coverage):.3f} | {sum(one.crossings for one in each)} | "
            f"{max(one.longest_step for one in each):.2f} |"
        )
    return "\n".join(lines) + "\n"


def shapes_picture(strands: dict[tuple[str, bool], Strand]) -> bytes:
    """Draw the flat ones."""
    figure = blank(20.0, 10.0)
    for axes, name in zip(figure.subplots(2, 4).flat, SHAPES, strict=True):
        for line in strands[name, False].lines:
            axes.plot(*line.T, lw=0.8)
            axes.plot(*line[0], "go", ms=4)
            axes.plot(*line[-1], "rs", ms=4)
        axes.set_aspect("equal")
        axes.set_title(name)
        axes.axis("off")
    return png(figure)


if __name__ == "__main__":
    table, laid = shapes_table()
    print(table)
    print(options_table())
    if len(sys.argv) > 1:
        folder = Path(sys.argv[1])
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "figure_7.png").write_bytes(shapes_picture(laid))
