"""A picture of two layers of a file: fibre that leaves the part most, and the matrix under it."""

from pathlib import Path

import numpy as np
import shapely

from benchmarks.print_checks.job import Job, Lines

__all__ = ["draw"]

_COLOURS = {
    "External perimeter": "#3b6ea5",
    "Solid infill": "#9dbfe0",
    "Support material": "#d98c3f",
    "Wipe tower": "#7a7a7a",
    "Skirt/Brim": "#b5b5b5",
    "Internal infill": "#5a9a5a",
}


def draw(job: Job, title: str, file: Path) -> None:
    """Draw the fibre layer with the longest strands outside the part, and the matrix below it."""
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    lines = Lines(job.done.steps)
    height = lines.end[:, 2].round(3)
    fibre = lines.lays & (lines.tool == 1) & ~lines.beside_part
    strokes = np.stack([lines.start, lines.end], axis=1)[:, :, :2]

    def outside(z: float) -> float:
        mine = shapely.linestrings(strokes[fibre & (height == z)])
        return float(shapely.length(shapely.difference(mine, job.section(z))).sum())

    top = max(np.unique(height[fibre]).tolist(), key=lambda z: (outside(z), z))
    matrix = lines.lays & (lines.tool == 0)
    below = float(height[matrix & (height < top)].max())
    figure = Figure(figsize=(18, 9), layout="constrained")
    for axis, z, shown in zip(
        figure.subplots(1, 2),
        (below, top),
        (matrix & (height == below), lines.lays & (height == top)),
        strict=True,
    ):
        for region in shapely.get_parts(job.section(z)):
            for ring in (region.exterior, *region.interiors):
                axis.plot(*np.array(ring.coords).T, color="black", linewidth=0.8)
        for kind, colour in _COLOURS.items():
            mine = shown & (lines.kind == kind) & (lines.tool == 0)
            axis.add_collection(LineCollection(strokes[mine], colors=colour, linewidths=1.0))
        mine = shown & (lines.tool == 1)
        tail = lines.fed[mine] == 0.0
        colours = np.where(tail, "#c01020", "#101010")
        axis.add_collection(LineCollection(strokes[mine], colors=colours.tolist(), linewidths=1.4))
        trims = job.plan.trims[job.plan.top[job.plan.trims[:, 0].astype(int)].round(3) == z]
        axis.plot(*trims[:, 1:].T, "x", color="#c000c0", markersize=7)
        axis.set_aspect("equal")
        axis.autoscale_view()
        axis.set_title(f"{title}: {z:g} mm")
    figure.savefig(file, dpi=90)
