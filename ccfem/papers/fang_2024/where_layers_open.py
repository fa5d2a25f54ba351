"""Why the paper's order of failure loads comes out or not: the load that opens layers, by place.

Flat z layers of the paper came apart in the head at 0.87 kN, flat x layers at a lower corner of the
base at 3.16 kN. Here: the load at which the bond fails in head, leg and base of each slicing, with
its fibre, and the strength of the bond with which the head would come apart at 0.87 kN.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.comparison.result import Comparison
from ccfem.fem.elasticity.ball import BALL, ball_averages
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.fem.elasticity.zone import ZONE, distance_from_patches
from ccfem.judging.virtual_testing.interlayer import layer_normals
from ccfem.papers.fang_2024.planar_against_curved import ROWS
from ccfem.slicing.layers.layer import Layer

PLACES = {"base": (-np.inf, 20.0), "leg": (20.0, 35.0), "head": (35.0, np.inf)}
"""Parts of the T-bracket by height along y, mm."""
PAPER_LOADS = {"planar z": ("head", 0.87), "planar y": ("head", 0.87), "planar x": ("base", 3.16)}
"""Where the paper's flat prints came apart, and at what load, kN; its z may be our y."""


class Opening(NamedTuple):
    """Load, kN, at which the bond fails in each judged cell of one slicing.

    Attributes
    ----------
    middle : (m, 3) array, mm
    load : (m,) array
        Infinite where nothing opens or slides.
    """

    middle: FloatArray
    load: FloatArray

    def at(self, place: str) -> float:
        """Load that opens a place first, kN."""
        low, high = PLACES[place]
        height = self.middle[:, 1]
        return float(self.load[(height > low) & (height <= high)].min())


def openings(found: Comparison, pressing: bool = False) -> dict[str, Opening]:
    """Find the loads for the paper's slicings with its strategies on them.

    Parameters
    ----------
    found : Comparison
        With virtual tests.
    pressing : bool
        Under bolts that only press, not fixed walls.
    """
    result = {}
    for slicing, strategy in ROWS.items():
        one = found.slicings[slicing]
        tested = next(run.tested for run in one.runs if run.name == strategy)
        tested = tested.alternative if pressing and tested is not None else tested
        if tested is not None:
            test = tested.bracket.tension
            result[slicing] = _opening(test.solution, one.layers, test.force)
    return result


def _opening(stress: StressField, layers: tuple[Layer, ...], force: float) -> Opening:
    """Load of each cell outside the zones of loads and supports, as `interlayer` judges it."""
    mesh, material = stress.mesh, stress.problem.material
    middle = mesh.points[mesh.corners].mean(axis=1)
    judged = np.flatnonzero(distance_from_patches(stress.problem, stress.case, middle, ZONE) > ZONE)
    values = stress.stress.reshape(-1, 9)
    tensor = ball_averages(middle, values, mesh.volumes, judged, BALL).reshape(-1, 3, 3)
    normal = layer_normals(layers, middle[judged])
    traction = np.einsum("mij,mj->mi", tensor, normal)
    across = np.einsum("mi,mi->m", traction, normal)
    along = np.linalg.norm(traction - across[:, None] * normal, axis=1)
    tensile = material.interlayer_tensile
    assert tensile is not None
    shear = tensile if material.interlayer_shear is None else material.interlayer_shear
    index = np.hypot(np.maximum(across, 0.0) / tensile, along / shear)
    return Opening(middle[judged], 1e-3 * force / np.maximum(index, 1e-9))


def openings_table(found: dict[str, dict[str, Opening]], tensile: float) -> str:
    """Markdown table over supports and slicings.

    Parameters
    ----------
    found : dict of supports to dict of slicing to Opening
    tensile : float, MPa
        Strength of the bond that the loads are for; that of shear goes with it.
    """
    heads = [f"{place} opens at, kN" for place in PLACES]
    lines = [f"| supports | slicing | {' | '.join(heads)} | paper | bond that explains it, MPa |"]
    lines.append("|---" * (len(heads) + 4) + "|")
    for supports, slicings in found.items():
        for slicing, opening in slicings.items():
            loads = [f"{opening.at(place):.2f}" for place in PLACES]
            said, bond = "", ""
            if slicing in PAPER_LOADS:
                place, load = PAPER_LOADS[slicing]
                said, bond = f"{place} {load}", f"{_bond(slicing, opening, tensile):.1f}"
            lines.append(f"| {supports} | {slicing} | {' | '.join(loads)} | {said} | {bond} |")
    return "\n".join(lines)


def bonds_needed(found: dict[str, dict[str, Opening]], tensile: float) -> dict[str, float]:
    """Strength of the bond, MPa, at which the paper's loads come out where it saw the failure."""
    return {
        f"{supports}, {slicing}: bond that explains the paper": _bond(slicing, opening, tensile)
        for supports, slicings in found.items()
        for slicing, opening in slicings.items()
        if slicing in PAPER_LOADS
    }


def _bond(slicing: str, opening: Opening, tensile: float) -> float:
    place, load = PAPER_LOADS[slicing]
    return tensile * load / opening.at(place)


def openings_picture(found: dict[str, dict[str, Opening]], title: str, file: Path) -> None:
    """Draw, seen along z, the least load that opens layers along each line of sight."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    columns = max(len(slicings) for slicings in found.values())
    figure = Figure(figsize=(4.0 * columns, 2.6 * len(found) + 0.4), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(found), columns, squeeze=False)
    shades = None
    for row, (supports, slicings) in zip(grid, found.items(), strict=True):
        for axes, (slicing, opening) in zip(row, slicings.items(), strict=True):
            order = np.argsort(-opening.load, kind="stable")
            x, y, _ = opening.middle[order].T
            load = opening.load[order]
            shades = axes.scatter(x, y, c=load, s=6, cmap="viridis_r", norm=LogNorm(1.0, 50.0))
            axes.plot(x[-1], y[-1], "rx", ms=11, mew=2.5)
            said = f"{slicing}, {supports}: opens at {load[-1]:.2f} kN"
            if slicing in PAPER_LOADS:
                place, told = PAPER_LOADS[slicing]
                said += f"\npaper: {place} at {told} kN, here {opening.at(place):.2f}"
            axes.set_title(said, fontsize=9)
            axes.set_aspect("equal")
            axes.set_axis_off()
    if shades is not None:
        figure.colorbar(shades, ax=grid, shrink=0.7, label="load that opens the layers, kN")
    figure.suptitle(title)
    figure.savefig(file, dpi=110)
