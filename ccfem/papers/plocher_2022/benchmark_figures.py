"""Figures of the benchmark: its stress, what turned fibre costs it, and layers at angles."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ccfem.base.arrays import FloatArray
from ccfem.base.tensor import strongest_in_plane
from ccfem.comparison.plot.colours import INK, scale
from ccfem.fem.materials import named_material
from ccfem.fem.plates import rotate_plane, stack_plane
from ccfem.papers.plocher_2022.drawing import (
    COLOURS,
    image,
    plain,
    plates_grid,
    polar,
    section,
    strokes,
    title,
)
from ccfem.papers.plocher_2022.plane_study import laid_plate, reduced_stiffness, turned_energies
from ccfem.papers.plocher_2022.sensitivity import ANGLES
from ccfem.papers.plocher_2022.study import MATERIALS, CaseStudy

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
        section(near, plate)
        strokes(near, case, every=1)
        hole = min(plate.polygon.interiors, key=lambda ring: ring.centroid.x)
        x, y, reach = hole.centroid.x, hole.centroid.y, 1.3 * np.ptp(np.asarray(hole.coords)[:, 0])
        near.set_xlim(x - 2.0 * reach, x + 2.0 * reach)
        near.set_ylim(y - reach, y + reach)
        title(near, f"case {name}: its direction at a hole (blue: compression)")
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
    for one, (key, material) in zip(axes, MATERIALS.items(), strict=True):
        for name, (layup, colour) in LAYUPS.items():
            modulus = 1e-3 * layup_moduli(angle, layup, material)
            one.plot(angle, modulus, color=colour, lw=1.2, label=name)
        one.set_title(f"{key}-FRAM: modulus, GPa", size=8, pad=12.0)
        one.legend(loc="lower center", bbox_to_anchor=(0.5, -0.22), ncols=3, fontsize=6.5,
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
    _heading(axes[0], "a: senses of the turn")
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
    _heading(axes[1], "b: energy and stress (p99.9) over the benchmark's")
    share = np.sort(best.laid.field.cell_energy)[::-1]
    share = np.minimum(share / np.quantile(share, 0.995), 1.0)
    cells = np.linspace(0.0, 100.0, len(share))
    for power, colour in ((1, COLOURS["concentric"]), (3, INK)):
        axes[2].plot(cells, share**power, color=colour, lw=1.2, label=f"p = {power}")
    axes[2].set_xlabel("cells by their energy, %", size=7.5)
    axes[2].legend(fontsize=7, frameon=False)
    _heading(axes[2], "d: weight of a cell, its energy to the power p")
    index = {name: case.value(name, "pi_weighted_C") for name in case.patterns}
    axes[3].bar(list(index), list(index.values()), color=[COLOURS[n] for n in index], width=0.65)
    axes[3].tick_params(axis="x", labelrotation=30)
    _heading(axes[3], "e: index PI of the patterns")
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


def _heading(axes: Any, text: str) -> None:
    axes.set_title(text, size=8, loc="left", color=INK)
