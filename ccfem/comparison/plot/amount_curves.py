"""What a part gains over the length of its fibre: a curve a number of layers, the bound above."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ccfem.comparison.plot.canvas import canvas
from ccfem.comparison.plot.colours import INK, OUTLINE, palette
from ccfem.comparison.plot.curves import style_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ABREAST = 3
"""Panels side by side at most."""

_PANEL, _BETWEEN, _MARGINS = 2.368, 0.55, 1.332
"""Height of a panel, of what is between two, and of what is above and below all, inches."""

_ALONE, _TOGETHER = (0, (4, 3)), (0, (1, 2))
"""Dashes of bounds, of one panel and of several at once."""

_APART = 0.04
"""Least distance, in sizes of the axes, of points whose strengths are written beside them."""


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


class TradePoint(NamedTuple):
    """One of several plans with as much fibre.

    Attributes
    ----------
    stiffness, failure : float
        NaN where it is not known.
    strength : float
        How much strength counted: written beside it.
    printable : bool
        Others are drawn hollow.
    """

    stiffness: float
    failure: float
    strength: float
    printable: bool


def amount_curves(
    panels: Mapping[str, Mapping[str, Sequence[AmountPoint]]],
    bounds: Mapping[str, Sequence[tuple[float, float]]],
    bare: Sequence[float] = (),
    heading: str = "",
    together: Mapping[str, Sequence[tuple[float, float]]] | None = None,
) -> "Figure":
    """Draw values over the length of fibre, a panel each, three at most side by side.

    Parameters
    ----------
    panels : mapping of label of the upright axis to mapping of name to points
        Points by length.
    bounds : mapping of label to sequence of (float, float)
        Lengths, m, and what no paths exceed, of the panels that have a bound.
    bare : sequence of float, optional
        Value without fibre, for each panel: where its curves begin; NaN where it is not known.
    together : mapping of label to sequence of (float, float), optional
        Lengths, m, and what no paths exceed in all panels of this mapping at once.
    """
    from matplotlib.lines import Line2D

    rows = -(-len(panels) // _ABREAST)
    columns = -(-len(panels) // rows)
    tall = _MARGINS + _PANEL * rows + _BETWEEN * (rows - 1)
    figure = canvas(4.4 * columns, tall, dpi=150.0)
    figure.subplots_adjust(
        left=0.55 / (4.4 * columns),
        right=0.985,
        bottom=0.888 / tall,
        top=1.0 - 0.444 / tall,
        wspace=0.2,
        hspace=_BETWEEN / _PANEL,
    )
    figure.text(0.012, 1.0 - 0.222 / tall, heading, size=10, weight="bold", color=INK)
    names = list(dict.fromkeys(name for curves in panels.values() for name in curves))
    colours = palette(names)
    all_axes = [figure.add_subplot(rows, columns, k + 1) for k in range(len(panels))]
    for k, (axes, (label, curves)) in enumerate(zip(all_axes, panels.items(), strict=True)):
        style_axes(axes, "fibre, m", label)
        begin = bare[k] if bare else float("nan")
        for name, points in curves.items():
            _draw(axes, points, colours[name], begin)
        axes.plot([0.0], [begin], "x", ms=5.0, color=OUTLINE, clip_on=False, zorder=3.0)
        axes.set_xlim(left=0.0)
        for curve, dashes in ((bounds, _ALONE), (together or {}, _TOGETHER)):
            if label in curve:
                above = zip(*sorted(curve[label]), strict=True)
                axes.plot(*above, color=OUTLINE, lw=1.0, ls=dashes, zorder=1.0)
    marks = [
        Line2D([], [], color=colours[name], lw=1.6, marker="o", ms=4, label=name) for name in names
    ]
    marks.append(Line2D([], [], color=OUTLINE, lw=1.0, ls=_ALONE, label="no paths exceed"))
    if together:
        caption = "none exceed in all cases at once"
        marks.append(Line2D([], [], color=OUTLINE, lw=1.0, ls=_TOGETHER, label=caption))
    marks += _hollow(p for curves in panels.values() for points in curves.values() for p in points)
    figure.legend(
        handles=marks,
        loc="lower center",
        ncols=min(len(marks), 5),
        frameon=False,
        fontsize=8,
        labelcolor=INK,
    )
    return figure


def trade_curves(
    curves: Mapping[str, Sequence[TradePoint]],
    heading: str = "",
    across: str = "stiffness ratio",
    up: str = "first failure, kN",
) -> "Figure":
    """Draw first failure over stiffness: what one costs in the other.

    Parameters
    ----------
    curves : mapping of name to sequence of TradePoint
        Plans with as much fibre, by how much strength counts.
    across, up : str
        What the axes are.
    """
    from matplotlib.lines import Line2D

    figure = canvas(5.6, 4.0, dpi=150.0)
    axes = figure.add_axes((0.09, 0.23, 0.88, 0.68))
    figure.text(0.02, 0.945, heading, size=10, weight="bold", color=INK)
    style_axes(axes, across, up)
    colours = palette(curves)
    for name, points in curves.items():
        where = [p.stiffness for p in points], [p.failure for p in points]
        axes.plot(*where, color=colours[name], lw=1.2)
        for p in points:
            face = colours[name] if p.printable else "white"
            axes.plot([p.stiffness], [p.failure], "o", ms=5.0, color=colours[name], mfc=face)
    axes.margins(0.08)
    _name_points(axes, [p for points in curves.values() for p in points])
    marks = [Line2D([], [], color=colours[name], lw=1.6, label=name) for name in curves]
    marks += _hollow(p for points in curves.values() for p in points)
    columns = 4 if max(len(name) for name in curves) <= 10 else 2
    figure.legend(
        handles=marks,
        loc="lower center",
        ncols=min(len(marks), columns),
        frameon=False,
        fontsize=7.5,
        labelcolor=INK,
    )
    return figure


def _hollow(points: Iterable[AmountPoint | TradePoint]) -> list[Any]:
    """Entry of the legend for what is drawn hollow, where anything is."""
    from matplotlib.lines import Line2D

    if all(p.printable for p in points):
        return []
    style: dict[str, Any] = {"marker": "o", "ms": 5.0, "mfc": "white", "ls": "none"}
    return [Line2D([], [], color=OUTLINE, label="not printable", **style)]


def _name_points(axes: Any, points: Sequence[TradePoint]) -> None:
    """Write how much strength counts beside each point that is not too near to a named one."""
    across, up = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    named: list[TradePoint] = []
    for p in points:
        near = (
            np.hypot((p.stiffness - q.stiffness) / across, (p.failure - q.failure) / up)
            for q in named
        )
        if not min(near, default=1.0) > _APART:
            continue
        named.append(p)
        axes.annotate(
            f"{p.strength:g}",
            (p.stiffness, p.failure),
            (4.0, 4.0),
            textcoords="offset points",
            size=7,
            color=INK,
        )


def _draw(axes: Any, points: Sequence[AmountPoint], colour: str, begin: float) -> None:
    """One curve: plans on the front large, those that cannot be printed hollow."""
    first = points[0]
    axes.plot([0.0, first.length], [begin, first.value], color=colour, lw=0.8, alpha=0.5)
    axes.plot([p.length for p in points], [p.value for p in points], color=colour, lw=1.2)
    for p in points:
        face = colour if p.printable else "white"
        axes.plot([p.length], [p.value], "o", ms=6.0 if p.on_front else 3.5, color=colour, mfc=face)
