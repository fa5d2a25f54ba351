"""Figures of the paper that are computations, redrawn from a run."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import shapely
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from scipy.spatial import Voronoi

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.tensor import in_plane, strongest_in_plane
from ccfem.cases.designed import DesignPlate
from ccfem.comparison.plot.colours import INK, OUTLINE, palette
from ccfem.geometry.medial_axis import medial_axis
from ccfem.judging.evaluation.indices.matching import THRESHOLDS
from ccfem.papers.contents import drawn_of
from ccfem.papers.panels import bar, curves, lines_of, panels, section, title
from ccfem.papers.wang_2021.study import BASELINES, LIMIT, PartStudy, PatternStudy, PlateStudy
from ccfem.paths.linking.print_order import step_speeds
from ccfem.strategies.stress_tracing.frame import frame
from ccfem.strategies.stress_tracing.main_paths import main_paths
from ccfem.strategies.stress_tracing.stress_lines import Criterion
from ccfem.strategies.svt import Svt

_MOST = 4.0
"""End of the colour scale of curvature, 1/mm."""
_FAINT = "#b5bac1"
_OTHERS = ("streamline", "offset", "eqs")


def figures(study: Mapping[str, PlateStudy], number: int | None = None) -> dict[str, Figure]:
    """Every figure that the plates and patterns run allow, or those of a number, by name."""
    made: dict[str, Callable[[], Figure | None]] = {}

    def add(name: str, draw: Callable[[PlateStudy], Figure], plate: str, lpp: bool = False) -> None:
        def drawn() -> Figure | None:
            there = not lpp or "lpp" in study[plate].optimised.patterns
            return draw(study[plate]) if there else None

        if plate in study:
            made[name] = drawn

    add("figure_03_voronoi_and_medial_axis", _voronoi, "bridge")
    add("figure_05_bridge_stress", _stresses, "bridge")
    for name, prefix in (("bridge", "06"), ("suspension", "06b")):
        add(f"figure_{prefix}_{name}_speeds", _speeds, name, lpp=True)
    add("figure_07_suspension", _process, "suspension", lpp=True)
    for name, maps, rates in (("bridge", "08", "10"), ("suspension", "09", "11")):
        add(f"figure_{maps}_{name}_curvature", _curvature_maps, name)
        add(f"figure_{maps}_{name}_curvature_shares", _curvature_shares, name)
        add(f"figure_{rates}_{name}_matching", _matching, name)
    for name, others, lpp_number in (
        ("cantilever", 12, 13),
        ("m_shape", 14, 15),
        ("l_shape", 16, 17),
    ):
        add(f"figure_{others}_{name}_other_methods", _other_methods, name)
        add(f"figure_{lpp_number}_{name}_lpp", _lpp, name, lpp=True)
    return drawn_of(made, number)


def _voronoi(plate: PlateStudy) -> Figure:
    """Voronoi diagram of points on the border of a piece of the bridge, and its medial axis."""
    part = plate.optimised
    polygon = part.layer.plane.polygon
    width, height = plate.plate.border.bounds[2:]
    window = shapely.box(0.0, 0.0, 0.38 * width, 0.84 * height)
    figure, axes = panels([window, window], 2)
    rings = shapely.get_rings(polygon)
    sites = [shapely.line_interpolate_point(r, np.arange(0.0, r.length, 2.0)) for r in rings]
    points = np.unique(shapely.get_coordinates(np.concatenate(sites)), axis=0)
    diagram = Voronoi(points)
    ridges = [diagram.vertices[ridge] for ridge in diagram.ridge_vertices if min(ridge) >= 0]
    section(axes[0], polygon, "(a) points of the border every 2 mm, and their Voronoi diagram")
    lines_of(axes[0], ridges, OUTLINE, 0.4)
    axes[0].plot(*points.T, "o", color="#e69f00", ms=2.0, zorder=3.0)
    axis = medial_axis(polygon, 0.5 * part.machine.fibre_width, object_angle=None, arc_chord=1.6)
    section(axes[1], polygon, "(b) medial axis")
    lines_of(axes[1], [segment.points for segment in axis.segments], INK, 1.2)
    return figure


def _stresses(plate: PlateStudy) -> Figure:
    """Load, stress of the full plate, and stress of the optimised part."""
    domain = plate.plate.domain
    figure, axes = panels([domain] * 3, 1, 7.0)
    section(axes[0], domain, "(a) load and supports")
    show_load(axes[0], plate.plate)
    for panel, part, text in (
        (axes[1], plate.original, "(b) stress of the full plate: blue pulled, green pressed"),
        (axes[2], plate.optimised, "(c) stress of the optimised part"),
    ):
        section(panel, part.layer.plane.polygon, text)
        strokes(panel, part)
    return figure


def _speeds(plate: PlateStudy) -> Figure:
    """Path in the speeds of table 2, one colour each."""
    part = plate.optimised
    lpp = part.patterns["lpp"]
    figure, (axes,) = panels([shapely.MultiPoint(lpp.paths.points)], 1, 7.0)
    section(axes, part.layer.plane.polygon)
    speed = step_speeds(lpp.toolpaths, part.machine)
    by_level(axes, lpp, speed, "mm/s")
    total = lpp.total
    title(
        axes,
        f"{lpp.paths.lengths.sum() / 1000.0:.1f} m in {total['print_time']:.0f} s, "
        f"{total['mean_speed']:.1f} mm/s",
    )
    return figure


def _process(plate: PlateStudy) -> Figure:
    """From the stress of the full plate to the path: four panels."""
    lpp = plate.optimised.patterns["lpp"]
    box = shapely.union(plate.plate.domain, shapely.MultiPoint(lpp.paths.points)).bounds
    figure, axes = panels([plate.plate.domain] * 4, 2, box=box)
    for panel, part, text in (
        (axes[0], plate.original, "(a) load and stress of the full plate"),
        (axes[1], plate.optimised, "(b) stress of the optimised part"),
    ):
        section(panel, part.layer.plane.polygon, text)
        strokes(panel, part)
    show_load(axes[0], plate.plate)
    section(axes[2], plate.optimised.layer.plane.polygon, "(c) main load paths")
    _main_paths(axes[2], plate)
    section(axes[3], plate.optimised.layer.plane.polygon, "(d) one path; links blue")
    path(axes[3], lpp)
    return figure


def _main_paths(axes: Any, plate: PlateStudy) -> None:
    """Draw main load paths as `svt` joins them, one colour each."""
    part, svt = plate.optimised, Svt()
    members = frame(part.layer.plane.polygon, 0.5 * part.machine.fibre_width)
    joined = main_paths(members, part.stress, Criterion(turn=svt.turn), svt.width_ratio)
    names = [str(k) for k in range(len(joined))]
    for main_path, colour in zip(joined, palette(names).values(), strict=True):
        lines_of(axes, [np.concatenate([m.points for m in main_path.members])], colour, 2.0)


def _compared(plate: PlateStudy) -> dict[str, tuple[Any, PatternStudy]]:
    """Section and pattern of lpp on the optimised part and of the slicer's on the full plate."""
    shown = {}
    if "lpp" in plate.optimised.patterns:
        shown["lpp"] = (plate.optimised.layer.plane.polygon, plate.optimised.patterns["lpp"])
    for name in BASELINES:
        if name in plate.original.patterns:
            shown[name] = (plate.original.layer.plane.polygon, plate.original.patterns[name])
    return shown


def _curvature_maps(plate: PlateStudy) -> Figure:
    """Places of four patterns that curve by more than 0.26 / mm, every half millimetre."""
    shown = _compared(plate)
    box = shapely.union_all([shapely.MultiPoint(panel.paths.points) for _, panel in shown.values()])
    figure, axes = panels([box] * len(shown), 2, 5.0)
    for letter, panel, (name, (polygon, pattern)) in zip("abcd", axes, shown.items(), strict=False):
        section(panel, polygon)
        path(panel, pattern, _FAINT, _FAINT)
        order = np.argsort(pattern.curvature, kind="stable")
        order = order[pattern.curvature[order] > LIMIT]
        drawn = panel.scatter(
            *pattern.places[order].T,
            c=pattern.curvature[order],
            s=3.0,
            lw=0.0,
            cmap="plasma_r",
            vmin=0.0,
            vmax=_MOST,
            zorder=3.0,
        )
        share, vertices = (100.0 * (c < LIMIT).mean() for c in (pattern.curvature, pattern.native))
        text = f"below {LIMIT} / mm: {share:.0f} % of the length, {vertices:.0f} % of the vertices"
        title(panel, f"({letter}) {name}, {text}")
    bar(figure, axes, drawn, "curvature, 1/mm")
    return figure


def _curvature_shares(plate: PlateStudy) -> Figure:
    """Share below each curvature: by length, and by vertices."""
    texts = ("every 0.5 mm of the path, links too", "at the vertices as planned, links too")
    figure, axes = curves([("curvature, 1/mm", "share below it, %")] * 2)
    for panel, reading, text in zip(axes, ("curvature", "native"), texts, strict=True):
        for name, (_, pattern) in _compared(plate).items():
            values = np.sort(getattr(pattern, reading))
            share = 100.0 * np.arange(1, len(values) + 1) / max(len(values), 1)
            panel.step(
                np.maximum(values, 0.005), share, where="post", color=COLOURS[name], label=name
            )
        panel.axvline(LIMIT, color=OUTLINE, lw=0.8, ls="--")
        panel.set_xscale("log")
        panel.set_xlim(0.005, 6.0)
        panel.set_ylim(0.0, 101.0)
        panel.set_title(text, size=8, loc="left", color=INK)
    axes[0].legend(fontsize=7, frameon=False, loc="lower right")
    return figure


def _matching(plate: PlateStudy) -> Figure:
    """Draw matching rates over the angle, the slicer's on the full plate and on the part."""
    name = plate.plate.name
    figure, axes = curves([("angle, degrees", "strands within it of the stress, %")] * 2)
    sides = (
        (axes[0], plate.original, f"{name}: the slicer's patterns on the full plate"),
        (axes[1], plate.optimised, f"{name}: all patterns on the optimised part"),
    )
    for panel, part, text in sides:
        lpp_names = [p for p in ("lpp", "lpp uncrossed") if p in plate.optimised.patterns]
        shown = {p: plate.optimised.patterns[p] for p in lpp_names}
        shown |= {p: part.patterns[p] for p in BASELINES if p in part.patterns}
        for label, pattern in shown.items():
            style = "--" if label == "lpp uncrossed" else "-"
            rate = 100.0 * pattern.rates["strands"]
            panel.plot(
                THRESHOLDS, rate, style, color=COLOURS[label], marker="o", ms=2.5, label=label
            )
        panel.plot([0.0, 90.0], [0.0, 100.0], color=OUTLINE, lw=0.8, ls=":")
        panel.set_xlim(0.0, 90.0)
        panel.set_ylim(0.0, 101.0)
        panel.set_title(text, size=8, loc="left", color=INK)
    axes[1].legend(fontsize=7, frameon=False, loc="lower right")
    return figure


def _other_methods(plate: PlateStudy) -> Figure:
    """Load, and the paths of streamlines, offset and EQS."""
    part = plate.optimised
    have = [name for name in _OTHERS if name in part.patterns]
    figure, axes = panels([plate.plate.domain] * (1 + len(have)), 2)
    section(axes[0], plate.plate.domain, filled=False)
    section(axes[0], part.layer.plane.polygon, "(a) load and supports; outline ours")
    show_load(axes[0], plate.plate)
    for letter, panel, name in zip("bcd", axes[1:], have, strict=False):
        section(panel, part.layer.plane.polygon)
        path(panel, part.patterns[name], COLOURS[name])
        total = part.patterns[name].total
        text = f"{total['paths']:.0f} pieces, {100.0 * total['coverage']:.0f} % covered"
        reading = ", our reading" if name == "eqs" else ""
        title(panel, f"({letter}) {name}{reading}: {text}")
    return figure


def _lpp(plate: PlateStudy) -> Figure:
    """Draw the main directions of tension and compression, and the path."""
    part = plate.optimised
    lpp = part.patterns["lpp"]
    box = shapely.union(part.layer.plane.polygon, shapely.MultiPoint(lpp.paths.points)).bounds
    figure, axes = panels([part.layer.plane.polygon] * 2, 2, box=box)
    for panel in axes[:2]:
        section(panel, part.layer.plane.polygon)
    strokes(axes[0], part, 45)
    axis = frame(part.layer.plane.polygon, 0.5 * part.machine.fibre_width)
    lines_of(axes[0], [member.points for member in axis.members], INK, 1.2)
    title(axes[0], "(a) pulled (blue), pressed (green), medial axis")
    path(axes[1], lpp)
    total = lpp.total
    text = f"{total['paths']:.0f} path, {100.0 * total['coverage']:.0f} % covered"
    title(axes[1], f"(b) lpp: {text}")
    return figure


# What the figures are made of: sections, stress vectors, loads, paths, in panels of one scale.


COLOURS = {
    "lpp": "#0072b2",
    "lpp uncrossed": "#56b4e9",
    "concentric": "#e69f00",
    "zigzag 45": "#009e73",
    "zigzag 90": "#cc79a7",
    "offset": "#d55e00",
    "streamline": "#8c7a00",
    "eqs": "#4d4d4d",
}
PULLED, PRESSED = "#1f4e9c", "#2c8a4b"
"""Tension and compression: blue and green, as in the paper."""
STRAND, LINK = "#a51f2d", "#1f4e9c"
"""The path inside, and its links: red and blue, as in the paper."""


def show_load(axes: Any, plate: DesignPlate) -> None:
    """Mark the supports of a plate by triangles and its load by an arrow."""
    size = 0.05 * max(plate.border.bounds[2:])
    for stretch, _ in plate.supports.values():
        start, end = np.array(stretch.start), np.array(stretch.end)
        count = max(1, round(float(np.linalg.norm(end - start)) / (2.0 * size)))
        at = start + (np.arange(count)[:, None] + 0.5) / count * (end - start)
        axes.plot(*at.T, "^", color=INK, ms=5.0, zorder=4.0, clip_on=False)
    x, y = np.mean([plate.load.start, plate.load.end], axis=0)
    style = {"arrowstyle": "-|>", "color": STRAND, "lw": 1.6}
    above = y > 0.9 * plate.border.bounds[3]
    head, tail = ((x, y), (x, y + 2.2 * size)) if above else ((x, y - 2.2 * size), (x, y))
    axes.annotate("", xy=head, xytext=tail, arrowprops=style, zorder=4.0, annotation_clip=False)


def strokes(axes: Any, part: PartStudy, count: int = 70) -> None:
    """Stress vectors: strokes along the principal stress of the larger size, as long as it is."""
    layer = part.layer
    plane = in_plane(part.stress.nodal, layer.plane.frame)[layer.triangles].mean(axis=1)
    value, angle, _ = strongest_in_plane(plane)
    pulled, size = value >= 0.0, np.abs(value)
    middle = layer.plane.points[layer.triangles].mean(axis=1)
    chosen = _one_a_field(middle, float(np.ptp(layer.plane.points, axis=0).max()) / count)
    most = np.quantile(size, 0.97)
    chosen = chosen[size[chosen] > 0.01 * most]
    half = 0.5 * np.ptp(layer.plane.points, axis=0).max() / count
    half = half * np.clip(size[chosen] / most, 0.35, 1.3)
    along = half[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)[chosen]
    for kind, colour in ((pulled[chosen], PULLED), (~pulled[chosen], PRESSED)):
        ends = np.stack([middle[chosen] - along, middle[chosen] + along], axis=1)[kind]
        axes.add_collection(LineCollection(list(ends), colors=colour, linewidths=0.7, zorder=2.0))


def _one_a_field(points: FloatArray, size: float) -> Any:
    """One point for each field of a grid: the one nearest to its middle."""
    field = np.floor(points / size)
    off = np.linalg.norm(points - (field + 0.5) * size, axis=1)
    order = np.lexsort((off, field[:, 1], field[:, 0]))
    _, first = np.unique(field[order], axis=0, return_index=True)
    return order[first]


def path(axes: Any, pattern: PatternStudy, colour: str = STRAND, link: str = LINK) -> None:
    """Draw the paths of a pattern, its links in their own colour, start and end marked if one."""
    paths = pattern.paths
    steps, mask = _path_steps(pattern)
    for kind, stroke in ((~mask, colour), (mask, link)):
        axes.add_collection(LineCollection(list(steps[kind]), colors=stroke, lw=0.45, zorder=2.0))
    if len(paths) == 1:
        axes.plot(*paths.points[0], "o", color=INK, ms=4.0, zorder=3.0)
        axes.plot(*paths.points[-1], "s", color=INK, ms=4.0, zorder=3.0)


def by_level(axes: Any, pattern: PatternStudy, values: FloatArray, unit: str) -> None:
    """Draw the steps of the paths of a pattern, one colour a value (P,), with its share."""
    steps, _ = _path_steps(pattern)
    kept = values[_step_starts(pattern)]
    length = np.linalg.norm(steps[:, 1] - steps[:, 0], axis=1)
    levels = np.unique(kept)
    colours = palette(map(str, levels)).values()
    for level, colour in zip(levels, colours, strict=True):
        at_level = kept == level
        share = 100.0 * length[at_level].sum() / length.sum()
        label = f"{level:g} {unit}: {share:.0f} % of the length"
        lines = LineCollection(
            list(steps[at_level]), colors=colour, lw=0.8, zorder=2.0, label=label, capstyle="round"
        )
        axes.add_collection(lines)
    axes.legend(fontsize=6, frameon=False, loc="upper right")


def _step_starts(pattern: PatternStudy) -> BoolArray:
    kept = np.ones(len(pattern.paths.points), dtype=bool)
    kept[pattern.paths.offsets[1:] - 1] = False
    return kept


def _path_steps(pattern: PatternStudy) -> tuple[FloatArray, BoolArray]:
    """Return the steps (s, 2, 2) of the paths of a pattern, and whether each is a link."""
    paths, first = pattern.paths, _step_starts(pattern)
    start = np.flatnonzero(first)
    return np.stack([paths.points[start], paths.points[start + 1]], axis=1), paths.link[start]
