"""Pictures of fronts: one index over another, a point a run, and what nothing dominates."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from ccfem.comparison.plot.canvas import canvas
from ccfem.comparison.plot.colours import INK, OUTLINE, palette
from ccfem.comparison.plot.curves import style_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class FrontPoint(NamedTuple):
    """One run.

    Attributes
    ----------
    name : str
        That of its strategy: it has a colour.
    on_front : bool
        Whether no other run dominates it: such points are joined.
    printable : bool
        Others are drawn hollow.
    label : str
        Written beside the point, where it is on the front.
    """

    name: str
    x: float
    y: float
    on_front: bool
    printable: bool = True
    label: str = ""


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
        figure.legend(
            handles=marks,
            loc="lower center",
            ncols=min(len(marks), 2 * wide + 1),
            frameon=False,
            fontsize=8,
            labelcolor=INK,
        )
    return figure
