"""Curves of several strategies on one pair of axes: stiffness over the length of fibre."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from ccfem.comparison.plot.canvas import canvas
from ccfem.comparison.plot.colours import INK, OUTLINE, palette

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class StiffnessPoint(NamedTuple):
    """One point of a curve.

    Attributes
    ----------
    length : float, mm per layer
        Of fibre.
    ratio : float
        Stiffness over that of the part without fibre.
    printable : bool
        Whether the paths can be printed as planned: others are drawn hollow.
    """

    length: float
    ratio: float
    printable: bool


def stiffness_curves(
    curves: Mapping[str, Sequence[StiffnessPoint]],
    marked: Sequence[float] = (),
    heading: str = "",
    colours: Mapping[str, str] | None = None,
) -> "Figure":
    """Draw stiffness over the length of fibre.

    Parameters
    ----------
    curves : mapping of name to sequence of StiffnessPoint
        From the least fibre to the most.
    marked : sequence of float, mm per layer
        Lengths to mark: those that all curves have.
    colours : mapping of name to colour, optional
        Default `palette`.
    """
    figure, axes = axes_below(heading, "fibre, mm a layer", "stiffness ratio")
    chosen = palette(curves) if colours is None else colours
    for length in marked:
        axes.axvline(length, color=OUTLINE, lw=0.8, ls=(0, (4, 3)), zorder=1.0)
    for name, points in curves.items():
        colour = chosen[name]
        axes.plot([p.length for p in points], [p.ratio for p in points], color=colour, lw=1.6)
        for p in points:
            face = colour if p.printable else "white"
            axes.plot([p.length], [p.ratio], "o", ms=4.0, color=colour, mfc=face)
    most = max((p.ratio for points in curves.values() for p in points), default=1.0)
    axes.set_ylim(1.0, 1.0 + 1.08 * max(most - 1.0, 0.01))
    axes.set_xlim(left=0.0)
    legend_below(axes, chosen, list(curves))
    return figure


def axes_below(heading: str, across: str, up: str) -> tuple["Figure", Any]:
    """Figure with one pair of axes from 0 to 100 %, and room for a legend below."""
    figure = canvas(4.6, 3.6, dpi=150.0)
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
