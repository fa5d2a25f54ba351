"""Figures of the paper that are computations, redrawn from a run."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import strongest_in_plane
from ccfem.comparison.plot.canvas import canvas
from ccfem.comparison.plot.colours import INK, OUTLINE, scale
from ccfem.fem.materials import named_material
from ccfem.fem.plates import rotate_plane, stack_plane
from ccfem.judging.evaluation.indices.sinuosity import LONG
from ccfem.judging.evaluation.indices.stiffness_alignment import agreement
from ccfem.judging.evaluation.layer_paths import PlanePaths
from ccfem.judging.evaluation.sensitivity import OffAxis
from ccfem.papers import panels
from ccfem.papers.contents import drawn_of
from ccfem.papers.panels import bar, title
from ccfem.papers.plocher_2022.plane_study import (
    ANGLES,
    laid_plate,
    reduced_stiffness,
    turned_energies,
)
from ccfem.papers.plocher_2022.plates import Plate
from ccfem.papers.plocher_2022.study import MATERIALS, CaseStudy, PatternStudy
from ccfem.paths.raster.patterns import inside_shells
from ccfem.paths.raster.skeleton import skeleton

# What the figures of the paper share: plates side by side, sections, strokes, maps.


COLOURS = {
    "grid 45": "#d55e00",
    "grid 0": "#56b4e9",
    "concentric": "#e69f00",
    "mat": "#009e73",
    "mps": "#0072b2",
    "benchmark": "#4d4d4d",
}


def plates_grid(
    rows: int, columns: int, plates: Sequence[Plate], width: float = 4.2
) -> tuple[Figure, Any]:
    """Figure with one picture of a plate a place; the plates of a column have one shape."""
    shares = [plate.mask.shape[0] / plate.mask.shape[1] for plate in plates]
    height = width * max(shares) + 0.28
    figure = canvas(columns * width, rows * height, dpi=130.0)
    axes = figure.subplots(rows, columns, squeeze=False)
    figure.subplots_adjust(0.01, 0.01, 0.99, 1.0 - 0.25 / (rows * height), 0.03, 0.18)
    for panel in axes.flat:
        panel.set_axis_off()
        panel.set_aspect("equal")
    return figure, axes


def section(axes: Any, plate: Plate, text: str = "", filled: bool = True) -> None:
    """Outline of a plate, filled or not, with the limits of its picture and a heading if any."""
    panels.section(axes, plate.polygon, text, filled, width=0.4)
    axes.set_xlim(-1.0, plate.mask.shape[1] * plate.bead + 1.0)
    axes.set_ylim(-1.0, plate.mask.shape[0] * plate.bead + 1.0)


def strokes(axes: Any, case: CaseStudy, every: int = 3) -> None:
    """Strokes along the largest stress: red for tension, blue for compression."""
    centres, direction = case.plate.mesh.centres, case.benchmarks["C"].direction
    place = np.floor(centres / case.plate.bead).astype(int)
    chosen = (place % every == every // 2).all(axis=1)
    tension = strongest_in_plane(case.plate.isotropic_field.stress)[0] > 0.0
    half = 0.45 * every * case.plate.bead
    along = half * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    for kind, colour in ((tension, "#a51f2d"), (~tension, "#1f4e9c")):
        pick = chosen & kind
        strokes = np.stack([centres[pick] - along[pick], centres[pick] + along[pick]], axis=1)
        axes.add_collection(LineCollection(list(strokes), colors=colour, linewidths=0.5))


def image(axes: Any, plate: Plate, values: FloatArray, colours: Any, limits: Any) -> Any:
    """Values of the cells of a plate (m,) as a map; what a colour bar needs."""
    pixels = np.full(plate.mask.shape, np.nan)
    pixels[plate.mask] = values
    height, width = (plate.bead * n for n in plate.mask.shape)
    drawn = axes.imshow(
        pixels, cmap=colours, vmin=limits[0], vmax=limits[1], extent=(0.0, width, 0.0, height)
    )
    section(axes, plate, filled=False)
    return drawn


def plain(columns: int, width: float = 4.4, height: float = 3.2) -> tuple[Figure, Any]:
    """Figure with diagrams side by side."""
    figure = canvas(columns * width, height, dpi=130.0)
    axes = figure.subplots(1, columns, squeeze=False)[0]
    figure.subplots_adjust(0.14 / columns, 0.2, 0.98, 0.88, 0.28)
    for panel in axes:
        panel.spines[["top", "right"]].set_visible(False)
        panel.tick_params(labelsize=7, colors=INK)
    return figure, axes


def polar(columns: int) -> tuple[Figure, Any]:
    """Figure with polar diagrams side by side."""
    figure = canvas(3.6 * columns, 4.0, dpi=130.0)
    axes = [figure.add_subplot(1, columns, k + 1, projection="polar") for k in range(columns)]
    for panel in axes:
        panel.tick_params(labelsize=6)
    figure.subplots_adjust(0.08, 0.1, 0.92, 0.82, 0.35)
    return figure, axes


SPOKES = {
    "strain energy": ("energy_{}", "low"),
    "max stress": ("stress_{}", "low"),
    "PI": ("pi_weighted_{}", "high"),
    "SI": ("si", "low"),
    "paths > 40 mm": ("over_40", "high"),
    "CPU time": ("cpu_with_fe", "low"),
    "print time": ("print", "low"),
}


def figures(
    study: Mapping[str, CaseStudy], raster: Mapping[str, CaseStudy], number: int | None = None
) -> dict[str, Figure]:
    """Every figure that the cases run allow, or those of a number, by name.

    Polylines, but for what the paper shows of pixels: figures 2 to 4, and those named raster.
    """

    def tension() -> dict[str, CaseStudy]:
        return {name: study[name] for name in study if name != "III"}

    def pixels() -> dict[str, CaseStudy]:
        return {name: raster[name] for name in raster if name != "III"}

    def beam() -> dict[str, CaseStudy]:
        return {"III": study["III"]}

    drawn: dict[str, Callable[[], Figure | None]] = {}
    if set(study) - {"III"}:
        drawn |= {
            "figure_02_medial_axis": lambda: _medial_axis(next(iter(pixels().values()))),
            "figure_03_simplification": lambda: _simplification(list(pixels().values())[-1]),
            "figure_04_long_and_short": lambda: _long_and_short(raster),
            "figure_06_patterns": lambda: _patterns(tension()),
            "figure_06_patterns_raster": lambda: _patterns(pixels()),
            "figure_06_benchmark": lambda: benchmark_fields(tension()),
            "figure_06_bars": lambda: _bars(tension(), ("C",)),
            "figure_07_agreement": lambda: _cell_maps(
                tension(), _agreement_of, (0.0, 100.0), "agreement, %"
            ),
            "figure_07_moduli": layups,
            "figure_08_sensitivity": lambda: _sensitivity(tension()),
            "figure_08_turned_fibre": lambda: turned_fibre(next(iter(tension().values()))),
            "figure_09_energy": lambda: _energies(tension()),
            "figure_10_radar": lambda: _radars(tension(), "C"),
            "figure_10_radar_raster": lambda: _radars(
                pixels(), "C", {"SI": ("si_raw_mean", "low")}
            ),
        }
    if "III" in study:
        drawn |= {
            "figure_11_patterns": lambda: _patterns(beam()),
            "figure_11_patterns_raster": lambda: _patterns({"III": raster["III"]}),
            "figure_11_shear": lambda: shear(study["III"]),
            "figure_12_radar_C": lambda: _radars(beam(), "C"),
            "figure_12_radar_S": lambda: _radars(beam(), "S"),
            "figure_13_energy_C": lambda: _energies(beam()),
            "figure_13_energy_S": lambda: _energies(beam(), "S"),
            "figure_13_sensitivity": lambda: _sensitivity(beam()),
        }
    drawn["figure_14_both_materials"] = lambda: _mixed_bars(study)
    return drawn_of(drawn, number)


def _path_lines(paths: PlanePaths) -> list[FloatArray]:
    return np.split(paths.points, paths.offsets[1:-1]) if len(paths) else []


def _patterns(study: Mapping[str, CaseStudy]) -> Figure:
    """Paths of every pattern, and the directions of the benchmark."""
    cases = list(study.values())
    names = list(cases[0].patterns)
    figure, axes = plates_grid(len(names) + 1, len(cases), [c.plate for c in cases])
    for column, case in enumerate(cases):
        top = axes[0, column]
        section(
            top, case.plate, f"case {case.plate.name}: direction of the largest stress (benchmark)"
        )
        strokes(top, case)
        for row, name in enumerate(names, start=1):
            panel, pattern = axes[row, column], case.patterns[name]
            section(
                panel,
                case.plate,
                f"{name}: agreement {pattern.values['agreement']:.1f} %, "
                f"energy {pattern.values['ratio_C']:.2f} x benchmark (C-FRAM)",
            )
            for paths, colour in zip(pattern.paths, (COLOURS[name], INK), strict=False):
                panel.add_collection(
                    LineCollection(_path_lines(paths), colors=colour, linewidths=0.45)
                )
    return figure


def _medial_axis(case: CaseStudy) -> Figure:
    """Pixels of the shells and of what they leave: its medial axis, rings round it, the rest."""
    figure, axes = plates_grid(3, 1, [case.plate])
    (made,) = case.patterns["mat"].raster
    inside = inside_shells(made.raster.mask, 3)
    axis = skeleton(inside)
    first = np.where(made.raster.mask, np.where(inside, 1.0, 0.0), np.nan)
    domain = np.where(made.raster.mask, made.regions.domain, np.nan)
    shown = (
        ("three shells, and the medial axis of the rest", np.where(axis, 2.0, first)),
        ("shells, rings round the medial axis, concentric rest", domain),
    )
    for panel, (heading, pixels) in zip(axes[:, 0], shown, strict=False):
        height, width = (made.raster.pixel * n for n in pixels.shape)
        x, y = made.raster.origin
        panel.imshow(pixels, cmap=scale("field"), extent=(x, x + width, y, y + height))
        section(panel, case.plate, f"case {case.plate.name}: {heading}", filled=False)
    section(axes[2, 0], case.plate, f"case {case.plate.name}: paths of mat")
    axes[2, 0].add_collection(
        LineCollection(_path_lines(case.patterns["mat"].paths[0]), colors=COLOURS["mat"], lw=0.6)
    )
    return figure


def _simplification(case: CaseStudy) -> Figure:
    """One corner of the concentric paths: chains of pixels, what is printed, where they start."""
    figure, axes = plain(1, 5.0, 4.2)
    (made,) = case.patterns["concentric"].raster
    bead = made.raster.pixel
    panel = axes[0]
    lines = made.lines()
    panel.add_collection(LineCollection(made.chains, colors=OUTLINE, linewidths=1.0, alpha=0.7))
    panel.add_collection(LineCollection(lines, colors=COLOURS["concentric"], linewidths=1.2))
    panel.plot(*np.array([line[0] for line in lines]).T, "o", color=INK, ms=3.5)
    panel.plot(*made.raster.centres(np.argwhere(made.paths.isolated)).T, "x", color=INK, ms=3.5)
    panel.set_xlim(0.0, 40.0 * bead)
    panel.set_ylim(0.0, 0.5 * bead * case.plate.mask.shape[0] + 4.0 * bead)
    panel.set_aspect("equal")
    panel.set_title(
        "concentric: pixels (grey), made straight, starts (dots), isolated (x)",
        size=8,
        loc="left",
        color=INK,
    )
    return figure


def _agreement_of(case: CaseStudy, pattern: PatternStudy) -> FloatArray:
    direction = case.benchmarks["C"].direction
    return 100.0 * np.mean([agreement(m.angle - direction) for m in pattern.maps], axis=0)


def _cell_maps(study: Mapping[str, CaseStudy], values_of: Any, limits: Any, label: str) -> Figure:
    cases = list(study.values())
    names = list(cases[0].patterns)
    figure, axes = plates_grid(len(names), len(cases), [c.plate for c in cases])
    for column, case in enumerate(cases):
        for row, name in enumerate(names):
            pattern = case.patterns[name]
            values = values_of(case, pattern)
            drawn = image(axes[row, column], case.plate, values, scale("field"), limits)
            title(axes[row, column], f"case {case.plate.name}, {name}: mean {values.mean():.1f} %")
    bar(figure, axes[:, -1], drawn, label, shrink=0.4, aspect=20)
    return figure


def _energies(study: Mapping[str, CaseStudy], key: str = "C") -> Figure:
    """Strain energy density over its mean in the benchmark, logarithmic."""
    cases = list(study.values())
    names = ["benchmark", *cases[0].patterns]
    figure, axes = plates_grid(len(names), len(cases), [c.plate for c in cases])
    for column, case in enumerate(cases):
        best = case.benchmarks[key].laid
        for row, name in enumerate(names):
            solved = best if name == "benchmark" else case.patterns[name].laid[key]
            density = solved.field.energy_density / best.field.energy_density.mean()
            drawn = image(
                axes[row, column],
                case.plate,
                np.log10(np.maximum(density, 1e-6)),
                scale("stress"),
                (-1.0, 1.3),
            )
            ratio = solved.strain_energy / best.strain_energy
            title(
                axes[row, column],
                f"case {case.plate.name}, {key}-FRAM, {name}: sum {ratio:.2f} x benchmark",
            )
    label = "log10 of density over mean of benchmark"
    bar(figure, axes[:, -1], drawn, label, shrink=0.4, aspect=20)
    return figure


def _long_and_short(study: Mapping[str, CaseStudy]) -> Figure:
    cases = list(study.values())
    names = list(cases[0].patterns)
    figure, axes = plates_grid(len(names), len(cases), [c.plate for c in cases], 3.6)
    for column, case in enumerate(cases):
        for row, name in enumerate(names):
            panel, pattern = axes[row, column], case.patterns[name]
            section(panel, case.plate)
            for paths in pattern.paths:
                colours = np.where(paths.lengths > LONG, INK, COLOURS["concentric"])
                panel.add_collection(
                    LineCollection(_path_lines(paths), colors=list(colours), linewidths=0.4)
                )
            share = pattern.values["over_40"]
            title(panel, f"case {case.plate.name}, {name}: {share:.0f} % over 40 mm (dark)")
    return figure


def _bar_group(axes: Any, values: Mapping[str, float], heading: str, unit: str) -> None:
    axes.bar(list(values), list(values.values()), color=[COLOURS[n] for n in values], width=0.65)
    for k, value in enumerate(values.values()):
        axes.text(k, value, f"{value:.3g}", ha="center", va="bottom", size=6.5, color=INK)
    axes.set_ylabel(unit, size=7.5)
    axes.set_title(heading, size=8, loc="left", color=INK)
    axes.tick_params(axis="x", labelrotation=30)


def _bars(study: Mapping[str, CaseStudy], materials: Sequence[str]) -> Figure:
    pairs = [(name, key) for name in study for key in materials]
    figure, axes = plain(2 * len(pairs))
    for k, (name, key) in enumerate(pairs):
        case = study[name]
        best = case.benchmarks[key].laid
        energy = {"benchmark": 1e6 * best.strain_energy}
        stress = {"benchmark": best.stress}
        for pattern in case.patterns:
            energy[pattern] = 1e6 * case.value(pattern, f"energy_{key}")
            stress[pattern] = case.value(pattern, f"stress_{key}")
        _bar_group(axes[2 * k], energy, f"case {name}, {key}-FRAM: strain energy", "1e-6 N mm")
        _bar_group(axes[2 * k + 1], stress, f"case {name}, {key}-FRAM: stress (p99.9)", "MPa")
    return figure


def _mixed_bars(study: Mapping[str, CaseStudy]) -> Figure:
    shown = [name for name in ("I", "III") if name in study]
    figure, axes = plain(2 * max(len(shown), 1))
    for k, name in enumerate(shown):
        case = study[name]
        energy = {p: 1e6 * case.value(p, "energy_mixed") for p in case.patterns}
        stress = {p: case.value(p, "stress_mixed") for p in case.patterns}
        _bar_group(axes[2 * k], energy, f"case {name}, C and S: strain energy", "1e-6 N mm")
        _bar_group(axes[2 * k + 1], stress, f"case {name}, C and S: stress (p99.9)", "MPa")
    return figure


def _sensitivity(study: Mapping[str, CaseStudy]) -> Figure:
    figure, axes = plain(2)
    angle = np.radians(np.linspace(0.0, 90.0, 181))
    for panel, (key, name) in zip(axes, MATERIALS.items(), strict=True):
        panel.plot(
            np.degrees(angle),
            OffAxis(named_material(name))(angle),
            color=OUTLINE,
            lw=2.5,
            alpha=0.4,
        )
        for case, colour in zip(study.values(), (COLOURS["mps"], COLOURS["grid 45"]), strict=False):
            curve = case.benchmarks[key].curve
            label = f"case {case.plate.name}"
            panel.plot(np.degrees(angle), curve(angle), color=colour, lw=1.1, label=label)
            panel.plot(curve.angles, curve.values, "o", color=colour, ms=3.0)
        panel.set_title(f"{key}-FRAM: f; grey: uniform tension", size=8, loc="left", color=INK)
        panel.set_xlabel("fibre turned from the principal direction, degrees", size=7.5)
        panel.set_ylim(0.0, 1.05)
        panel.legend(fontsize=7, frameon=False)
    return figure


def _radars(
    study: Mapping[str, CaseStudy], key: str, instead: Mapping[str, tuple[str, str]] | None = None
) -> Figure:
    """Radar of all indices; `instead` names other values for some."""
    chosen = SPOKES | dict(instead or {})
    figure = canvas(5.0 * len(study), 4.4, dpi=130.0)
    spokes = {title: better for title, (_, better) in chosen.items()}
    for k, (name, case) in enumerate(study.items()):
        axes = figure.add_axes(((k + 0.16) / len(study), 0.13, 0.68 / len(study), 0.74))
        series = {
            pattern: [case.value(pattern, index.format(key)) for index, _ in chosen.values()]
            for pattern in case.patterns
        }
        draw_radar(axes, series, spokes, COLOURS)
        axes.set_title(f"case {name}, {key}-FRAM: best = 1", size=9, color=INK, pad=16.0)
        axes.legend(
            loc="upper center", bbox_to_anchor=(0.5, -0.04), ncols=3, frameon=False, fontsize=7.5
        )
    return figure


# Figures of the benchmark: its stress, what turned fibre costs it, and layers at angles.


LAYUPS = {
    "fibre at 0": ((0.0,), COLOURS["mps"]),
    "0/90": ((0.0, 90.0), COLOURS["grid 0"]),
    "+-45": ((45.0, -45.0), COLOURS["grid 45"]),
}
"""Angles of the layers, degrees, and colour."""


def benchmark_fields(study: Mapping[str, CaseStudy]) -> Figure:
    """Figure 6 g to j: stress, its direction at a hole, energy with the fibre along it."""
    cases = list(study.values())
    figure, axes = plates_grid(3, len(cases), [c.plate for c in cases])
    for column, case in enumerate(cases):
        plate, name = case.plate, case.plate.name
        stress = case.plate.isotropic_field.stress
        largest = np.abs(strongest_in_plane(stress)[0])
        limit = float(np.percentile(largest, 99.5))
        image(axes[0, column], plate, largest, scale("stress"), (0.0, limit))
        title(axes[0, column], f"case {name}: largest stress, 0 to {limit:.3g} MPa")
        near = axes[1, column]
        section(near, plate, f"case {name}: its direction at a hole (blue: compression)")
        strokes(near, case, every=1)
        hole = min(plate.polygon.interiors, key=lambda ring: ring.centroid.x)
        x, y, reach = hole.centroid.x, hole.centroid.y, 1.3 * np.ptp(np.asarray(hole.coords)[:, 0])
        near.set_xlim(x - 2.0 * reach, x + 2.0 * reach)
        near.set_ylim(y - reach, y + reach)
        density = case.benchmarks["C"].laid.field.energy_density
        limit = float(np.percentile(density, 99.5))
        image(axes[2, column], plate, density, scale("stress"), (0.0, limit))
        title(axes[2, column], f"case {name}: energy density, benchmark, 0 to {limit:.2g} MPa")
    return figure


def layup_moduli(angle: FloatArray, layup: tuple[float, ...], material: str) -> FloatArray:
    """Modulus (n,), MPa, of layers that share their strain, pulled at angles (n,), radians."""
    sheet = reduced_stiffness(named_material(material))
    stack = stack_plane(rotate_plane(sheet, np.radians(np.array(layup))))
    pulled = np.linalg.inv(rotate_plane(stack, -angle))
    return np.asarray(1.0 / pulled[:, 0, 0])


def layups() -> Figure:
    """Figure 7 f and g: modulus over the direction of the load, of layers and of materials."""
    figure, axes = polar(len(MATERIALS))
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    for panel, (key, material) in zip(axes, MATERIALS.items(), strict=True):
        for name, (layup, colour) in LAYUPS.items():
            modulus = 1e-3 * layup_moduli(angle, layup, material)
            panel.plot(angle, modulus, color=colour, lw=1.2, label=name)
        panel.set_title(f"{key}-FRAM: modulus, GPa", size=8, pad=12.0)
        panel.legend(loc="lower center", bbox_to_anchor=(0.5, -0.22), ncols=3, fontsize=6.5,
                   frameon=False)  # fmt: skip
    return figure


def turned_fibre(case: CaseStudy) -> Figure:
    """Figure 8 a, b, d and e: fibre turned in mirrored senses, its price, and the index.

    The paper turns the quarters of a symmetric plate in mirrored senses; the study turns all fibre
    in one sense. Both are drawn.
    """
    figure, axes = plain(4)
    plate, best = case.plate, case.benchmarks["C"]
    stiffness = reduced_stiffness(named_material(MATERIALS["C"]))
    centre = 0.5 * plate.bead * np.array(plate.mask.shape[::-1])
    away = plate.mesh.centres - centre
    quarter = np.where(away[:, 0] * away[:, 1] > 0.0, 1.0, -1.0)
    image(axes[0], plate, quarter, "coolwarm", (-2.0, 2.0))
    axes[0].set_aspect("equal")
    title(axes[0], "a: senses of the turn")
    problem = plate.isotropic_field.problem
    for side, label, colour in ((quarter, "mirrored", INK), (1.0, "one sense", COLOURS["mps"])):
        curve = turned_energies(problem, best.direction, stiffness, side)
        stress = [
            laid_plate(problem, best.direction + np.radians(angle) * side, stiffness).stress
            for angle in ANGLES
        ]
        energy = curve.energies / curve.energies[0]
        axes[1].plot(ANGLES, energy, "o-", color=colour, ms=3, lw=1, label=f"energy, {label}")
        axes[1].plot(
            ANGLES, np.array(stress) / stress[0], "s--", color=colour, ms=3, lw=1,
            label=f"stress, {label}",
        )  # fmt: skip
    axes[1].set_xlabel("fibre turned, degrees", size=7.5)
    axes[1].legend(fontsize=6.5, frameon=False)
    title(axes[1], "b: energy and stress (p99.9) over the benchmark's")
    share = np.sort(best.laid.field.cell_energy)[::-1]
    share = np.minimum(share / np.quantile(share, 0.995), 1.0)
    cells = np.linspace(0.0, 100.0, len(share))
    for power, colour in ((1, COLOURS["concentric"]), (3, INK)):
        axes[2].plot(cells, share**power, color=colour, lw=1.2, label=f"p = {power}")
    axes[2].set_xlabel("cells by their energy, %", size=7.5)
    axes[2].legend(fontsize=7, frameon=False)
    title(axes[2], "d: weight of a cell, its energy to the power p")
    index = {name: case.value(name, "pi_weighted_C") for name in case.patterns}
    axes[3].bar(list(index), list(index.values()), color=[COLOURS[n] for n in index], width=0.65)
    axes[3].tick_params(axis="x", labelrotation=30)
    title(axes[3], "e: index PI of the patterns")
    return figure


def shear(case: CaseStudy) -> Figure:
    """Figure 11 d: shear stress, and the principal directions that guide the paths."""
    figure, axes = plates_grid(1, 1, [case.plate], 8.4)
    stress = case.plate.isotropic_field.stress
    limit = float(np.percentile(np.abs(stress[:, 2]), 99.0))
    image(axes[0, 0], case.plate, stress[:, 2], "PuOr", (-limit, limit))
    strokes(axes[0, 0], case)
    title(
        axes[0, 0],
        f"case {case.plate.name}: shear stress from {-limit:.3g} to {limit:.3g} MPa, and the "
        "direction of the largest stress (red: tension, blue: compression)",
    )
    return figure


# Radar ("spider") plots: several indices of several strategies on one scale.


_RINGS = (0.25, 0.5, 0.75, 1.0)


def normalised(values: FloatArray, better: str) -> FloatArray:
    """Scores (k,) in [0, 1] of the values (k,) > 0 of one index: the best has 1, NaN stays.

    ``min / x`` where `better` is "low", ``x / max`` where it is "high": Plocher et al. 2022 do not
    say how they scale.
    """
    known = values[np.isfinite(values)]
    least = 0.0 if better == "high" else np.nextafter(0.0, 1.0)
    if len(known) and not known.min() >= least:
        raise InputError(
            f"an index to scale must be {'at least' if better == 'high' else 'above'} 0; got "
            f"{known.min():g}"
        )
    if not len(known):
        return np.array(values)
    if better == "low":
        return np.asarray(known.min() / values)
    return np.asarray(values / known.max()) if known.max() > 0.0 else np.ones_like(values)


def draw_radar(
    axes: Any,
    series: Mapping[str, Sequence[float]],
    indices: Mapping[str, str],
    colours: Mapping[str, str],
) -> None:
    """Draw several series, a value an index each; "low" or "high" values are better by spoke."""
    columns = np.array(list(series.values()), dtype=np.float64).T
    scores = np.transpose([normalised(*two) for two in zip(columns, indices.values(), strict=True)])
    spokes = 0.5 * np.pi - 2.0 * np.pi * np.arange(len(indices)) / len(indices)
    ends = np.stack([np.cos(spokes), np.sin(spokes)], axis=1)
    closed = np.concatenate([ends, ends[:1]])
    for ring in _RINGS:
        axes.plot(*(ring * closed).T, color=OUTLINE, lw=0.4, alpha=0.6)
        axes.text(0.02, ring, f"{ring:g}", size=5.5, color=OUTLINE, va="center")
    for end, name in zip(ends, indices, strict=True):
        axes.plot([0.0, end[0]], [0.0, end[1]], color=OUTLINE, lw=0.4, alpha=0.6)
        side = "center" if abs(end[0]) < 0.1 else ("left" if end[0] > 0.0 else "right")
        axes.text(*(1.08 * end), name, size=7.5, ha=side, va="center", color=INK)
    for name, score in zip(series, scores, strict=True):
        line = np.nan_to_num(score)[:, None] * ends
        axes.plot(*np.concatenate([line, line[:1]]).T, color=colours[name], lw=1.6, label=name)
        axes.fill(*line.T, color=colours[name], alpha=0.06)
    axes.set_xlim(-1.15, 1.15)
    axes.set_ylim(-1.15, 1.15)
    axes.set_aspect("equal")
    axes.set_axis_off()
