"""Curves of several strategies on one pair of axes."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.comparison.plot.colours import INK, OUTLINE, palette

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEAST, _MOST = 0.01, 10.0
"""Ends, 1/mm, of the scale of curvature; what is straighter counts at its left end."""


def matching_curves(
    rates: Mapping[str, FloatArray],
    thresholds: FloatArray,
    heading: str = "",
    colours: Mapping[str, str] | None = None,
) -> "Figure":
    """Draw matching rates over the angle, with the one that chance gives.

    Parameters
    ----------
    rates : mapping of name to (k,) array
        As from `evaluation.matching.matching_curve`; NaN is left out.
    thresholds : (k,) array, degrees
    colours : mapping of name to colour, optional
        Default `palette`.
    """
    for name, rate in rates.items():
        if len(rate) != len(thresholds):
            raise InputError(
                f"curve '{name}' has {len(rate)} values for {len(thresholds)} angles: give one each"
            )
    figure, axes = axes_below(heading, "angle, degrees", "share within that angle, %")
    axes.plot([0.0, 90.0], [0.0, 100.0], color=OUTLINE, lw=0.8, ls=(0, (4, 3)), zorder=1.0)
    axes.text(67.0, 66.0, "chance", size=7, color=OUTLINE)
    chosen = palette(rates) if colours is None else colours
    for name, rate in rates.items():
        axes.plot(thresholds, 100.0 * rate, color=chosen[name], lw=1.6, marker="o", ms=2.5)
    axes.set_xlim(0.0, 90.0)
    axes.set_xticks(np.arange(0, 91, 15))
    legend_below(axes, chosen, list(rates))
    return figure


def curvature_curves(
    curvatures: Mapping[str, FloatArray],
    radius: float,
    heading: str = "",
    colours: Mapping[str, str] | None = None,
) -> "Figure":
    """Draw the share of samples below each curvature.

    Parameters
    ----------
    curvatures : mapping of name to (s,) array, 1/mm
        Samples that count equally, as `evaluation.curvature.sample_curvature` takes them.
    radius : float, mm
        Tightest that the machine allows (`Machine.minimum_radius`): its curvature is marked, unless
        it is 0.
    heading, colours
        As in `matching_curves`.
    """
    check_number("the tightest radius", radius, at_least=0.0, unit="mm")
    figure, axes = axes_below(heading, "curvature, 1/mm", "share below it, %")
    if radius > 0.0:
        axes.axvline(1.0 / radius, color=OUTLINE, lw=0.8, ls=(0, (4, 3)), zorder=1.0)
        axes.text(
            1.06 / radius, 2.0, f"radius {radius:.3g} mm", size=7, color=OUTLINE, clip_on=True
        )
    chosen = palette(curvatures) if colours is None else colours
    for name, samples in curvatures.items():
        if not len(samples):
            continue
        order = np.clip(np.sort(samples), _LEAST, _MOST)
        share = 100.0 * np.arange(1, len(order) + 1) / len(order)
        axes.step(
            np.concatenate([[_LEAST], order, [_MOST]]),
            np.concatenate([[0.0], share, [100.0]]),
            where="post",
            color=chosen[name],
            lw=1.6,
        )
    axes.set_xscale("log")
    axes.set_xlim(_LEAST, _MOST)
    axes.set_xticks([0.01, 0.1, 1.0, 10.0], ["≤ 0.01", "0.1", "1", "10"])
    legend_below(axes, chosen, list(curvatures))
    return figure


def axes_below(heading: str, across: str, up: str) -> tuple["Figure", Any]:
    """Figure with one pair of axes from 0 to 100 %, and room for a legend below."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6, 3.6), dpi=150.0, facecolor="white")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.13, 0.24, 0.82, 0.65))
    figure.text(0.03, 0.94, heading, size=10, weight="bold", color=INK)
    style_axes(axes, across, up)
    axes.set_ylim(0.0, 101.0)
    return figure, axes


def style_axes(axes: Any, across: str, up: str) -> None:
    """Give axes their labels, a faint grid, and lines at the left and below only."""
    axes.set_xlabel(across, size=8, color=INK)
    axes.set_ylabel(up, size=8, color=INK)
    axes.grid(color=OUTLINE, alpha=0.2, lw=0.5)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=7.5, colors=INK, length=2.5)
    for side, spine in axes.spines.items():
        spine.set(visible=side in ("left", "bottom"), color=OUTLINE, linewidth=0.6)


def legend_below(axes: Any, colours: Mapping[str, str], names: Sequence[str]) -> None:
    """Names with a mark each below the axes."""
    from matplotlib.lines import Line2D

    marks = [Line2D([], [], color=colours[name], lw=1.6, label=name) for name in names]
    axes.legend(
        handles=marks,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.17),
        ncols=min(len(marks), 4) or 1,
        frameon=False,
        fontsize=7.5,
        labelcolor=INK,
    )
