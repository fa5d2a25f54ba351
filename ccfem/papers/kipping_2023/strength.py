"""What the layers are worth: load at which they come apart, flat beside load-oriented."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.cases.arm_bracket import HOLES
from ccfem.comparison.plot.canvas import png
from ccfem.fem.elasticity.ball import BALL, ball_averages
from ccfem.fem.elasticity.solve import solve
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.fem.elasticity.support_kinds import PressingSupport
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.interlayer import interlayer, layer_normals
from ccfem.papers.kipping_2023.chain import Chain
from ccfem.papers.kipping_2023.figures import blank
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.planar import Planar

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
    found: dict[str, tuple[float, ...]] = {}
    for name, layers in _slicings(run).items():
        told: list[float] = []
        for shear in SHEAR:
            bond = isotropic(3500.0, 0.35, interlayer_tensile=TENSILE, interlayer_shear=shear)
            judged = interlayer(run.stress if stress is None else stress, layers, bond)
            told += [_LOAD / max(index, 1e-12) for index in judged.zone_indices]
        found[name] = tuple(told)
    return found


def on_pressing_supports(run: Chain) -> StressField:
    """Stress of the arm bracket where its bolts, their heads and the ground only press."""
    problem = run.case.problem
    mesh = problem.mesh
    middle = mesh.points[mesh.boundary].mean(axis=1)
    up = mesh.facet_areas(mesh.boundary)[1][:, 2]
    feet = [HOLES[name].point for name in ("foot_near", "foot_far")]
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
    centre = mesh.points[mesh.corners].mean(axis=1)
    middle = 0.5 * (mesh.points[:, 1].min() + mesh.points[:, 1].max())
    shown = np.flatnonzero(np.abs(centre[:, 1] - middle) < 3.0)
    slicings = {name: each for name, each in _slicings(run).items() if "best" not in name}
    figure, row = blank(14.0, 3.2 * len(slicings) * len(models)), 0
    for model, stress in models.items():
        for name, layers in slicings.items():
            opening, sliding = _tractions(stress, layers, centre, shown)
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


def _tractions(
    stress: StressField, layers: Sequence[Layer], centre: FloatArray, shown: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Traction across layers, positive where it opens them, and along them, at some cells."""
    every = stress.stress.reshape(-1, 9)
    tensor = ball_averages(centre, every, stress.mesh.volumes, shown, BALL).reshape(-1, 3, 3)
    normal = layer_normals(layers, centre[shown])
    traction = np.einsum("mij,mj->mi", tensor, normal)
    opening = np.einsum("mi,mi->m", traction, normal)
    return opening, np.linalg.norm(traction - opening[:, None] * normal, axis=1)


def strength_table(loads: dict[str, dict[str, tuple[float, ...]]]) -> str:
    """Table in Markdown, by part and slicing; a load for each zone, 3, 1.5 and 0 mm."""
    heads = ("S 18 MPa", "S 35 MPa", "opening alone")
    lines = [f"| part | layers | {' | '.join(heads)} | over flat |", "|---" * 6 + "|"]
    for part, found in loads.items():
        flat = np.array(found["flat, z"])
        for name, values in found.items():
            told = [f"{a:.0f}, {b:.0f}, {c:.0f} N" for a, b, c in np.reshape(values, (-1, 3))]
            gain = ", ".join(f"{values[k] / flat[k]:.2f}" for k in (0, 3, 6))
            lines.append(f"| {part} | {name} | {' | '.join(told)} | {gain} |")
    return "\n".join(lines) + "\n"
