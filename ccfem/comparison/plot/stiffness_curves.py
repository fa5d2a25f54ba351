"""Stiffness over the length of fibre, one curve a strategy."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from ccfem.comparison.plot.colours import OUTLINE, palette
from ccfem.comparison.plot.curves import axes_below, legend_below

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
