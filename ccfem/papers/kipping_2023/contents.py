"""What of Kipping and Schueppstuhl 2023 can be made again."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh import box_mesh
from ccfem.comparison.plot.canvas import canvas, png
from ccfem.geometry.polylines import resample
from ccfem.slicing.guidance.height_field import height_field
from ccfem.slicing.guidance.normal_field import normal_field
from ccfem.slicing.guidance.stress_regions import StressRegions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ccfem.papers.kipping_2023.chain import Chain
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import shapely

from ccfem.base.progress import Progress, silent
from ccfem.body.meshing import extrude
from ccfem.cases.bodies import ARM_BRACKET_HOLES
from ccfem.fem.elasticity import PressingSupport, StressField, solve
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.failure_laws.interlayer import interlayer, layer_traction
from ccfem.machine import Machine
from ccfem.papers.contents import Contents, WhenAsked, table, write_claims
from ccfem.papers.kipping_2023.chain import (
    PAPER_SECONDS,
    PARTS,
    Chain,
    chain,
    distances_below,
    table_1,
    table_2,
)
from ccfem.paths.fields.chart import chart_of
from ccfem.printing.support import support_columns
from ccfem.slicing.layers.layer import Layer, LayerStress
from ccfem.slicing.slicers.load_oriented import LoadOriented
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fiso import Fiso

# The paper's figures 1 to 6 and 8, with our parts; figure 7 is in `fiso_shapes`.


_MOST = 4000
"""Points or arrows that are drawn."""


def _space_axes(figure: "Figure", place: int, title: str, points: FloatArray) -> Any:
    axes = figure.add_subplot(1, 3, place, projection="3d")
    axes.set_title(title, y=0.9)
    axes.set_box_aspect(np.ptp(points, axis=0), zoom=1.3)
    axes.view_init(20.0, -60.0)
    axes.set_axis_off()
    return axes


def _thinned(chosen: IntArray) -> IntArray:
    return chosen[:: max(len(chosen) // _MOST, 1)]


def part_figures(name: str, run: "Chain") -> dict[str, bytes]:
    """Figures of a part by file: 1 and 2 regions, 4 field, 5 layers, 6 support, 8 paths."""
    mesh, sliced = run.stress.mesh, run.sliced
    centre = mesh.centres
    inside = _thinned(np.flatnonzero(sliced.regions.region >= 0))
    least = np.linalg.eigh(run.stress.stress[inside])[1][:, :, 0]
    pictures = {}
    figure = canvas(18.0, 6.0, layout="tight")
    axes = _space_axes(figure, 1, "critical regions", mesh.points)
    axes.scatter(*centre[inside].T, c=sliced.regions.region[inside], s=3, cmap="tab10")
    for place, title, arrows in (
        (2, "least principal direction", least),
        (3, "smoothed, of one sense", sliced.normals.direction[inside]),
    ):
        axes = _space_axes(figure, place, title, mesh.points)
        axes.quiver(*centre[inside].T, *arrows.T, length=2.0, lw=0.5)
    pictures[f"figure_2_{name}.png"] = png(figure)
    figure = canvas(18.0, 6.0, layout="tight")
    every = _thinned(np.arange(len(centre)))
    axes = _space_axes(figure, 1, "vectors in the whole part", mesh.points)
    axes.quiver(*centre[every].T, *sliced.normals.direction[every].T, length=2.0, lw=0.5)
    axes = _space_axes(figure, 2, "field", mesh.points)
    nodes = _thinned(np.unique(mesh.boundary))
    axes.scatter(*mesh.points[nodes].T, c=sliced.field.values[nodes], s=4, cmap="viridis")
    axes = _space_axes(figure, 3, "every tenth layer", mesh.points)
    for layer in sliced.layers[::10]:
        axes.plot_trisurf(*layer.points.T, triangles=layer.triangles, lw=0.0, alpha=0.8)
    pictures[f"figure_4_5_{name}.png"] = png(figure)
    figure = canvas(18.0, 6.0, layout="tight")
    both = np.concatenate([mesh.points, run.support.columns.mesh.points])
    axes = _space_axes(figure, 1, "every sixth layer, and every third of the support", both)
    for layer in run.support.layers[::3]:
        axes.plot_trisurf(*layer.points.T, triangles=layer.triangles, lw=0.0, color="C1")
    for layer in sliced.layers[::6]:
        axes.plot_trisurf(*layer.points.T, triangles=layer.triangles, lw=0.0, color="C0")
    for place, share in ((2, 0.35), (3, 0.7)):
        with_paths = np.unique(run.paths.layer)
        layer = sliced.layers[int(with_paths[int(share * len(with_paths))])]
        paths = run.paths.on_layer(layer.index)
        axes = _space_axes(figure, place, f"layer {layer.index}", layer.points)
        if len(paths):
            points, offsets = resample(paths.points, paths.offsets, 0.3)
            for line in np.split(points, offsets[1:-1]):
                axes.plot(*line.T, lw=0.6)
    pictures[f"figure_6_8_{name}.png"] = png(figure)
    return pictures


def senses_figure() -> tuple[bytes, float, float]:
    """Figures 1 and 3 on a cube: the same field, and energy, whatever the sense of a region."""
    mesh = box_mesh((10.0, 10.0, 10.0), (8, 8, 8))
    centre = mesh.centres
    tilt = np.radians(20.0)
    region = np.full(len(centre), -1)
    region[centre[:, 0] < 3.0], region[centre[:, 0] > 7.0] = 0, 1
    direction = np.zeros((len(centre), 3))
    direction[region == 0] = (np.sin(tilt), 0.0, np.cos(tilt))
    direction[region == 1] = (-np.sin(tilt), 0.0, np.cos(tilt))
    up = np.array([0.0, 0.0, 1.0])
    figure, energies = canvas(18.0, 6.0, layout="tight"), []
    middle = np.abs(centre[:, 1] - 5.0) < 0.7
    for place, sense in ((1, 1.0), (2, -1.0)):
        turned = direction * np.where(region == 1, sense, 1.0)[:, None]
        regions = StressRegions(region >= 0, region, turned, np.ones(len(centre)))
        normals = normal_field(mesh, regions, up)
        energies.append(normals.energy)
        axes = _space_axes(figure, place, f"field, one region given with {sense:+.0f}", mesh.points)
        axes.quiver(*centre[middle].T, *normals.direction[middle].T, length=0.8, lw=0.6)
        if sense > 0.0:
            values = height_field(mesh, normals.direction).values
            axes = _space_axes(figure, 3, "field", mesh.points)
            axes.scatter(*mesh.points.T, c=values, s=12)
    return png(figure), energies[0], energies[1]


EXPECTED = Path(__file__).with_name("expected.toml")
"""Claims of the paper, with the ranges that count as reproduced."""

# First in, spiral out on eight shapes, flat and bent to a radius of 25 mm.


WIDTH, BEND = 0.9, 25.0
_REACH = 0.525
"""Distance from the strand, in widths, that counts as covered, as the addendum has it."""


def _disc(x: float, y: float, radius: float) -> shapely.Polygon:
    return shapely.Point(x, y).buffer(radius, quad_segs=24)


def _plate(length: float, width: float, holes: list[shapely.Polygon]) -> shapely.Polygon:
    return shapely.box(0.0, 0.0, length, width).difference(shapely.union_all(holes))


_POINTS = np.pi * np.arange(14) / 7.0
_STAR = np.where(np.arange(14) % 2, 14.0, 30.0)[:, None] * np.stack(
    [np.cos(_POINTS), np.sin(_POINTS)], axis=1
)

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
    "star": shapely.Polygon(_STAR),
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
        layer = replace(layer, points=curved, flat=None, walls=())
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
    strands = {(name, bent): measured(name, bent) for name in SHAPES for bent in (False, True)}
    rows = [
        (
            *(name, "bent" if bent else "flat", str(strand.paths), f"{strand.coverage:.3f}"),
            *(f"{strand.coverage_opened:.3f}", str(strand.crossings)),
            f"{strand.longest_step:.2f}",
        )
        for (name, bent), strand in strands.items()
    ]
    head = ("shape", "", "paths", "coverage", "of the opened area", "crossings", "longest step")
    return table(head, rows), strands


def options_table() -> str:
    """Table of what the options cost in coverage, on the flat shapes."""
    rows = []
    for title, options in OPTIONS.items():
        strands = [measured(name, False, **options) for name in SHAPES]
        coverage = [strand.coverage for strand in strands]
        rows.append(
            (
                *(title, str(sum(strand.paths for strand in strands))),
                *(f"{np.mean(coverage):.3f}", f"{min(coverage):.3f}"),
                str(sum(strand.crossings for strand in strands)),
                f"{max(strand.longest_step for strand in strands):.2f}",
            )
        )
    head = ("options", "paths", "mean coverage", "least", "crossings", "longest step")
    return table(head, rows)


def shapes_picture(strands: dict[tuple[str, bool], Strand]) -> bytes:
    """Draw the flat ones."""
    figure = canvas(20.0, 10.0, layout="tight")
    for axes, name in zip(figure.subplots(2, 4).flat, SHAPES, strict=True):
        for line in strands[name, False].lines:
            axes.plot(*line.T, lw=0.8)
            axes.plot(*line[0], "go", ms=4)
            axes.plot(*line[-1], "rs", ms=4)
        axes.set_aspect("equal")
        axes.set_title(name)
        axes.axis("off")
    return png(figure)


# The whole of the paper: its study, figures, tables and claims beside ours.


def write_all(folder: Path, progress: Progress = silent) -> None:
    """Run the study, and write figures, tables and claims into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    chains = dict(_run(progress))
    tables = [table_1(chains), table_2(chains), support_table(chains)]
    print("\n".join(tables), flush=True)
    trades = {part: trade(run) for part, run in chains.items()}
    pressed = on_pressing_supports(chains["B"])
    loads = _loads(chains, pressed)
    shapes, strands = shapes_table()
    tables += [trade_table(trades), strength_table(loads), shapes, options_table()]
    print("\n".join(tables[3:]), flush=True)
    models = {"holes held": chains["B"].stress, "supports press": pressed}
    pictures = {
        "figure_7.png": shapes_picture(strands),
        "trade.png": trade_picture(trades),
        "sliding_B.png": sliding_picture(chains["B"], models),
        "figure_1_3.png": senses_figure()[0],
    }
    for part, run in chains.items():
        pictures |= part_figures(part, run)
    for name, picture in pictures.items():
        (folder / name).write_bytes(picture)
    (folder / "tables.md").write_text("\n".join(tables), encoding="utf-8")
    print(write_claims(folder, quantities(chains, trades, loads, strands), EXPECTED))


# What flatter layers cost: tension across layers over the blend, and the paper's own choices.


VARIANTS: dict[str, dict[str, Any]] = {
    "default": {},
    "blend 0.25": {"blend": 0.25},
    "blend 0.5": {"blend": 0.5},
    "blend 1": {"blend": 1.0},
    "blend 2": {"blend": 2.0},
    "no gap filter": {"gap": 0.0},
    "blend alone": {"even": False},
    "as published": {"quantile": 1.0, "gap": 0.0, "blend": 0.0, "even": False},
}
"""Parameters of `LoadOriented`."""

Trades = Mapping[str, Mapping[str, Mapping[str, float]]]
"""By part, variant and column."""

COLUMNS = ("tension", "below z", "below the best plane", "angle", "tilt", "inverted", "in range")


def trade(run: Chain) -> dict[str, dict[str, float]]:
    """Figures of the variants by name: `COLUMNS`."""
    slicer = run.case.slicing
    assert isinstance(slicer, LoadOriented)
    figures = {}
    for name, given in VARIANTS.items():
        sliced = run.sliced if name == "default" else replace(slicer, **given).slice(run.stress)
        across = sliced.across.tension
        gradient = sliced.field.gradient
        cosine = gradient @ sliced.field.up / np.linalg.norm(gradient, axis=1)
        tilt = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        figures[name] = {
            "tension": across,
            "below z": 1.0 - across / sliced.across_build.tension,
            "below the best plane": 1.0 - across / sliced.across_best.tension,
            "angle": sliced.across.angle,
            "tilt": float(np.average(tilt, weights=run.stress.mesh.volumes)),
            "inverted": sliced.inverted,
            "in range": distances_below(sliced.layers).within(slicer.thinnest, slicer.thickest),
            "blend": sliced.field.blend,
        }
    return figures


def trade_table(trades: Trades) -> str:
    """Table in Markdown, by part and variant."""
    rows = [
        (part, name, *(f"{figures[column]:.4g}" for column in COLUMNS))
        for part, variants in trades.items()
        for name, figures in variants.items()
    ]
    return table(("part", "variant", *COLUMNS), rows)


def trade_picture(trades: Trades) -> bytes:
    """Draw the tension across layers over the blend."""
    figure = canvas(6.0, 4.0, layout="tight")
    axes = figure.subplots()
    for part, variants in trades.items():
        rows = [v for name, v in variants.items() if set(VARIANTS[name]) <= {"blend"}]
        rows = sorted((v for v in rows if v["inverted"] == 0.0), key=lambda v: v["blend"])
        axes.plot([v["blend"] for v in rows], [v["tension"] for v in rows], "o-", label=part)
    axes.set_xlabel("blend")
    axes.set_ylabel("share of the tension across layers")
    axes.set_ylim(bottom=0.0)
    axes.legend()
    return png(figure)


def _run(progress: Progress) -> Mapping[str, Chain]:
    """Both parts, from stress to paths."""
    return WhenAsked(tuple(PARTS), lambda part: chain(PARTS[part]), progress, "planning part")


def _loads(
    chains: Mapping[str, Chain], pressed: StressField
) -> dict[str, dict[str, tuple[float, ...]]]:
    """Failure loads by part, the arm bracket's a second time by the stress of pressing supports."""
    loads = {part: failure_loads(run) for part, run in chains.items()}
    return {**loads, "B, pressed": failure_loads(chains["B"], pressed)}


CONTENTS = Contents(
    title="Kipping and Schueppstuhl 2023, layers square to the least stress",
    seconds=600.0,
    run=_run,
    whole=write_all,
    tables={
        "table1": lambda study: table_1(study()),
        "table2": lambda study: table_2(study()),
        "support": lambda study: support_table(study()),
        "strength": lambda study: strength_table(
            _loads(study(), on_pressing_supports(study()["B"]))
        ),
        "fiso": lambda study: shapes_table()[0],
    },
)


# The claims of the paper beside ours: every quantity is computed from a run.


def quantities(
    chains: Mapping[str, Chain],
    trades: Trades,
    loads: Mapping[str, Mapping[str, tuple[float, ...]]],
    strands: Mapping[tuple[str, bool], Strand],
) -> dict[str, float]:
    """Every quantity that `expected.toml` may name."""
    values: dict[str, float] = {}
    for part, run in chains.items():
        values |= {f"{part}: seconds, {name}": value for name, value in run.seconds.items()}
        values[f"{part}: time over the paper's"] = run.seconds["all"] / PAPER_SECONDS[part]
        values[f"{part}: inverted"] = run.sliced.inverted
        values[f"{part}: thickness"] = run.distances.mean
        values[f"{part}: with a layer below"] = run.distances.covered
        values[f"{part}: paths"] = float(len(run.paths))
        layers = len(np.unique(run.paths.layer))
        values[f"{part}: layers with paths"] = float(layers)
        values |= {f"{part}: support, {name}": v for name, v in _support(run).items()}
        for name, figures in trades[part].items():
            values |= {f"{part}, {name}: {key}": value for key, value in figures.items()}
    for part, slicings in loads.items():
        flat, ours = slicings["flat, z"], slicings["load-oriented"]
        values[f"{part}: failure load over flat"] = ours[0] / flat[0]
        values[f"{part}: failure load over flat, bond strong in shear"] = ours[3] / flat[3]
        values[f"{part}: failure load over flat, by opening"] = ours[6] / flat[6]
    values["strands: most paths"] = float(max(s.paths for s in strands.values()))
    values["strands: least coverage"] = min(s.coverage for s in strands.values())
    values["strands: least coverage, opened"] = min(s.coverage_opened for s in strands.values())
    values["strands: crossings"] = float(sum(s.crossings for s in strands.values()))
    values["strands: longest step"] = max(s.longest_step for s in strands.values())
    return values


def _support(run: Chain) -> dict[str, float]:
    """Figures of the layers below a part."""
    support, slicer = run.support, run.case.slicing
    assert isinstance(slicer, LoadOriented)
    node = support.columns.node
    shared = node >= 0
    jump = np.abs(support.field.values[shared] - run.sliced.field.values[node[shared]])
    lowest = support.layers[0]
    tilt = np.degrees(np.arccos(np.clip(lowest.normals @ run.sliced.field.up, -1.0, 1.0)))
    distances = distances_below(support.layers)
    both: list[Layer] = []
    judged: list[bool] = []
    for k, layer in enumerate(run.sliced.layers):
        before = support.layers_before(k)
        both += [*before, layer]
        judged += [False] * len(before) + [True]
    return {
        "layers": float(len(support.layers)),
        "mm^3": support.columns.volume,
        "contact mm^2": support.columns.contact,
        "jump in layers": float(jump.max()) / run.sliced.step,
        "tilt of the lowest": float(np.average(tilt, weights=lowest.areas)),
        "inverted": support.field.inverted,
        "in range": distances.within(slicer.thinnest, slicer.thickest),
        "thickness": distances.mean,
        "part with a layer below": distances_below(both, judged).covered,
    }


def support_table(chains: Mapping[str, Chain]) -> str:
    """Table of the support of each part: layers along the stress, and flat ones that carry 45."""
    rows = []
    for part, run in chains.items():
        mesh, support = run.stress.mesh, _support(run)
        flat, volume = support_columns(mesh, angle=45.0), f"{mesh.volumes.sum():.0f}"
        rows += [
            (
                *(part, "load-oriented", f"{support['mm^3']:.0f}"),
                *(f"{support['contact mm^2']:.0f}", volume, f"{support['layers']:.0f}"),
                *(f"{support['in range']:.1%}", f"{support['inverted']:.2%}"),
            ),
            (
                *(part, "flat, over 45 degrees", f"{flat.volume:.0f}", f"{flat.contact:.0f}"),
                *(volume, "", "", ""),
            ),
        ]
    head = ("part", "layers", "mm^3", "contact mm^2", "part mm^3", "number", "0.2 to 0.5 mm")
    return table((*head, "inverted"), rows)


# What the layers are worth: load at which they come apart, flat beside load-oriented.


TENSILE = 18.0
SHEAR = (18.0, 35.0, 1e6)
"""Strength of the bond of printed PLA, MPa, across layers, and along them: as low, as published,
and without end, so that layers come apart by opening alone."""
_HEAD = 6.0
"""Radius of the heads of the bolts, twice that of the bolts, mm. Our choice."""
_LOAD = 100.0


def _slicings(run: Chain) -> dict[str, Sequence[Layer]]:
    mesh = run.stress.mesh
    x, y, z = (float(part) for part in run.sliced.best)
    return {
        "flat, z": Planar(thickness=0.35).cut(mesh, (0.0, 0.0, 1.0)),
        "flat, best plane": Planar(thickness=0.35).cut(mesh, (x, y, z)),
        "load-oriented": run.sliced.layers,
    }


def failure_loads(run: Chain, stress: StressField | None = None) -> dict[str, tuple[float, ...]]:
    """Load, N, at which layers come apart outside 3, 1.5 and 0 mm from the bolts, by slicing.

    Three loads for each of `SHEAR`. The part is without fibre: what the layers alone are worth.
    All are judged by one stress, by default that which the layers were made for.
    """
    loads: dict[str, tuple[float, ...]] = {}
    for name, layers in _slicings(run).items():
        of_slicing: list[float] = []
        for shear in SHEAR:
            bond = isotropic(3500.0, 0.35, interlayer_tensile=TENSILE, interlayer_shear=shear)
            judged = interlayer(run.stress if stress is None else stress, layers, bond)
            of_slicing += [_LOAD / max(index, 1e-12) for index in judged.zone_indices]
        loads[name] = tuple(of_slicing)
    return loads


def on_pressing_supports(run: Chain) -> StressField:
    """Stress of the arm bracket where its bolts, their heads and the ground only press."""
    problem = run.case.problem
    mesh = problem.mesh
    middle = mesh.points[mesh.boundary].mean(axis=1)
    up = mesh.facet_areas(mesh.boundary)[1][:, 2]
    feet = [ARM_BRACKET_HOLES[name].point for name in ("foot_near", "foot_far")]
    near = [np.hypot(middle[:, 0] - x, middle[:, 1] - y) < _HEAD for x, y, _ in feet]
    thick = float(middle[(up > 0.99) & near[1], 2].max())
    heads = (up > 0.99) & (near[0] | near[1]) & (np.abs(middle[:, 2] - thick) < 1e-3)
    ground = (up < -0.99) & (middle[:, 2] < 1e-3)
    patches = {"heads": mesh.boundary[heads], "ground": mesh.boundary[ground]}
    names = ("foot_near", "foot_far", "heads", "ground")
    supports = tuple(PressingSupport(name) for name in names)
    pressed = replace(problem, mesh=mesh.with_patches(patches), supports=supports)
    return solve(pressed)["lift"]


def sliding_picture(run: Chain, models: dict[str, StressField]) -> bytes:
    """Where layers open and where they slide, near the middle of the arm bracket, at 100 N."""
    mesh = run.stress.mesh
    centre = mesh.centres
    middle = 0.5 * (mesh.points[:, 1].min() + mesh.points[:, 1].max())
    shown = np.flatnonzero(np.abs(centre[:, 1] - middle) < 3.0)
    slicings = {name: layers for name, layers in _slicings(run).items() if "best" not in name}
    figure, row = canvas(14.0, 3.2 * len(slicings) * len(models), layout="tight"), 0
    for model, stress in models.items():
        for name, layers in slicings.items():
            opening, sliding, _ = layer_traction(stress, layers, shown)
            for column, (what, values) in enumerate(
                {"across the layers": opening, "along the layers": sliding}.items()
            ):
                axes = figure.add_subplot(len(slicings) * len(models), 2, 2 * row + column + 1)
                x, _, z = centre[shown].T
                dots = axes.scatter(x, z, c=values, s=9, cmap="coolwarm", vmin=-8.0, vmax=8.0)
                axes.set_aspect("equal")
                axes.set_title(f"{name}, {model}: {what}, MPa", fontsize=9)
                figure.colorbar(dots, ax=axes, shrink=0.7)
            row += 1
    return png(figure)


def strength_table(loads: Mapping[str, Mapping[str, tuple[float, ...]]]) -> str:
    """Table in Markdown, by part and slicing; a load for each zone, 3, 1.5 and 0 mm."""
    rows = []
    for part, slicings in loads.items():
        flat = slicings["flat, z"]
        for name, values in slicings.items():
            zones = [f"{a:.0f}, {b:.0f}, {c:.0f} N" for a, b, c in np.reshape(values, (-1, 3))]
            gain = ", ".join(f"{values[k] / flat[k]:.2f}" for k in (0, 3, 6))
            rows.append((part, name, *zones, gain))
    head = ("part", "layers", "S 18 MPa", "S 35 MPa", "opening alone", "over flat")
    return table(head, rows)
