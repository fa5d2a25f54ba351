"""What a part gains over the length of its fibre: a curve a number of layers, the bound above."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from ccfem.plot.colours import INK, OUTLINE, palette
from ccfem.plot.curves import style_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["AmountPoint", "amount_curves"]


class AmountPoint(NamedTuple):
    """One plan.

    Attributes
    ----------
    length : float, m
        Of fibre in all.
    value : float
        NaN where it is not known.
    on_front : bool
        Whether no other one with as little fibre is better: drawn large.
    printable : bool
        Others are drawn hollow.
    """

    length: float
    value: float
    on_front: bool
    printable: bool


def amount_curves(
    panels: Mapping[str, Mapping[str, Sequence[AmountPoint]]],
    bound: Sequence[tuple[float, float]],
    heading: str = "",
) -> "Figure":
    """Draw values over the length of fibre, a panel each.

    Parameters
    ----------
    panels : mapping of label of the upright axis to mapping of name to points
        Points by length.
    bound : sequence of (float, float)
        Lengths, m, and what no paths exceed, drawn into the first panel.
    heading : str
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(4.4 * len(panels), 3.7), dpi=150.0, facecolor="white")
    FigureCanvasAgg(figure)
    figure.subplots_adjust(
        left=0.55 / (4.4 * len(panels)), right=0.985, bottom=0.24, top=0.88, wspace=0.2
    )
    figure.text(0.012, 0.94, heading, size=10, weight="bold", color=INK)
    names = list(dict.fromkeys(name for curves in panels.values() for name in curves))
    colours = palette(names)
    all_axes = [figure.add_subplot(1, len(panels), k + 1) for k in range(len(panels))]
    for axes, (label, curves) in zip(all_axes, panels.items(), strict=True):
        style_axes(axes, "fibre, m", label)
        for name, points in curves.items():
            _draw(axes, points, colours[name])
        axes.set_xlim(left=0.0)
    above = sorted(bound)
    all_axes[0].plot(*zip(*above, strict=True), color=OUTLINE, lw=1.0, ls=(0, (4, 3)), zorder=1.0)
    marks = [
        Line2D([], [], color=colours[name], lw=1.6, marker="o", ms=4, label=name) for name in names
    ]
    marks.append(Line2D([], [], color=OUTLINE, lw=1.0, ls=(0, (4, 3)), label="no paths exceed"))
    figure.legend(
        handles=marks,
        loc="lower center",
        ncols=min(len(marks), 5),
        frameon=False,
        fontsize=8,
        labelcolor=INK,
    )
    return figure


def _draw(axes: Any, points: Sequence[AmountPoint], colour: str) -> None:
    """One curve: plans on the front large, those that cannot be printed hollow."""
    axes.plot([p.length for p in points], [p.value for p in points], color=colour, lw=1.2)
    for p in points:
        face = colour if p.printable else "white"
        axes.plot([p.length], [p.value], "o", ms=6.0 if p.on_front else 3.5, color=colour, mfc=face)
