"""Curves of several strategies: over the length of fibre, fronts, load over displacement."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ccfem.comparison.plot.canvas import canvas
from ccfem.comparison.plot.colours import INK, OUTLINE, palette
from ccfem.judging.virtual_testing.progressive_failure import EXPERIMENT, BreakingLoad

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class StiffnessPoint(NamedTuple):
    """One point of a curve."""

    length: float  # mm per layer: of fibre
    ratio: float  # stiffness over that of the part without fibre
    printable: bool  # whether the paths can be printed as planned: others are drawn hollow


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


def _legend_at_foot(figure: "Figure", marks: Sequence[Any], columns: int, size: float) -> None:
    """Legend of all panels of a figure, at its foot, in so many columns at most."""
    figure.legend(handles=marks, loc="lower center", ncols=min(len(marks), columns),
                  frameon=False, fontsize=size, labelcolor=INK)  # fmt: skip


# Fronts: one index over another, a point a run, and what nothing dominates.


class FrontPoint(NamedTuple):
    """One run."""

    name: str  # that of its strategy: it has a colour
    x: float
    y: float
    on_front: bool  # whether no other run dominates it: such points are joined
    printable: bool = True  # others are drawn hollow
    label: str = ""  # written beside the point, where it is on the front


def front_figure(panels: Mapping[str, Sequence[FrontPoint]], across: str, up: str) -> "Figure":
    """Draw fronts, a panel each with its heading, three side by side; axes are what is named."""
    from matplotlib.lines import Line2D

    wide = max(min(3, len(panels)), 1)
    tall = -(-max(len(panels), 1) // wide)
    width, height = 4.4 * wide, 3.4 * tall + 0.5
    figure = canvas(width, height, dpi=100.0)
    figure.subplots_adjust(  # in inches: room for labels and the legend
        left=0.62 / width, right=1.0 - 0.12 / width, bottom=0.95 / height, top=1.0 - 0.3 / height,
        wspace=0.7 / 3.6, hspace=0.8 / 2.6,
    )  # fmt: skip
    names = list(dict.fromkeys(point.name for points in panels.values() for point in points))
    colours = palette(names)
    for number, (heading, points) in enumerate(panels.items()):
        axes = figure.add_subplot(tall, wide, number + 1)
        best = sorted((p.x, p.y) for p in points if p.on_front)
        axes.plot([x for x, _ in best], [y for _, y in best], color=OUTLINE, lw=1.0, zorder=1.0)
        axes.scatter(
            [p.x for p in points],
            [p.y for p in points],
            [36.0 if p.on_front else 16.0 for p in points],
            facecolors=[colours[p.name] if p.printable else "white" for p in points],
            edgecolors=[colours[p.name] for p in points],
            zorder=2.0,
        )
        for p in points:
            if p.on_front and p.label:
                axes.annotate(
                    p.label, (p.x, p.y), (4, -9), textcoords="offset points", size=6.5, color=INK
                )
        axes.margins(0.12)
        axes.set_title(heading, size=9, loc="left", color=INK, weight="bold")
        style_axes(axes, across, up)
    marks = [Line2D([], [], color=colours[k], marker="o", ls="", label=k) for k in names]
    if marks:
        _legend_at_foot(figure, marks, 2 * wide + 1, 8)
    return figure


# Load over displacement of parts that break, each with the band of its breaking load.


def breaking_picture(broken: Mapping[str, BreakingLoad], colours: Mapping[str, str]) -> "Figure":
    """Draw load over displacement; a bar at the highest load spans the band, a dot the first crack.

    Parameters
    ----------
    colours : mapping of name to colour
        Of all names but the part without fibre, which is drawn in ink.
    """
    figure, axes = axes_below(f"breaking load ({EXPERIMENT})", "displacement, mm", "load, kN")
    chosen = {name: colours.get(name, INK) for name in broken}
    for name, load in broken.items():
        curve, colour = load.curve, chosen[name]
        axes.plot(curve.displacement, 1e-3 * curve.force, color=colour, lw=1.6)
        axes.plot(curve.displacement[1], 1e-3 * curve.force[1], "o", ms=3.5, color=colour)
        low, high = (1e-3 * end for end in load.band)
        at = curve.displacement[curve.force.argmax()]
        axes.plot([at, at], [low, high], color=colour, lw=4.0, alpha=0.3, solid_capstyle="butt")
    axes.set_ylim(0.0, 1.05e-3 * max(load.band[1] for load in broken.values()))
    axes.set_xlim(left=0.0)
    legend_below(axes, chosen, list(broken))
    return figure


# What a part gains over the length of its fibre: a curve a number of layers, the bound above.


_ABREAST = 3
"""Panels side by side at most."""

_PANEL, _BETWEEN, _MARGINS = 2.368, 0.55, 1.332
"""Height of a panel, of what is between two, and of what is above and below all, inches."""

_ALONE, _TOGETHER = (0, (4, 3)), (0, (1, 2))
"""Dashes of bounds, of one panel and of several at once."""

_APART = 0.04
"""Least distance, in sizes of the axes, of points whose strengths are written beside them."""


class AmountPoint(NamedTuple):
    """One plan."""

    length: float  # m: of fibre in all
    value: float  # NaN where it is not known
    on_front: bool  # whether no other one with as little fibre is better: drawn large
    printable: bool  # others are drawn hollow


class TradePoint(NamedTuple):
    """One of several plans with as much fibre."""

    # NaN where it is not known
    stiffness: float
    failure: float
    strength: float  # how much strength counted: written beside it
    printable: bool  # others are drawn hollow


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
    _legend_at_foot(figure, marks, 5, 8)
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
    _legend_at_foot(figure, marks, columns, 7.5)
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
