"""Checks of what is laid: volume of layers, feeds, lengths and places of strands."""

import numpy as np
import shapely

from benchmarks.print_checks.job import FILAMENT, Job, Lines, own
from benchmarks.print_checks.printer import Run

__all__ = ["amount", "feeding", "fullness", "places", "shapes", "volume"]


def fullness(job: Job, run: Run) -> tuple[float, list[tuple[float, float]]]:
    """Share of the part that is filled; height and share of each layer of matrix.

    A layer of matrix has to fill its height, and what the fibre below it leaves.
    """
    lines, machine = Lines.of(run), job.machine
    laid = lines.lays & lines.in_part & ~lines.beside_part
    matrix = FILAMENT * np.where(lines.tool == 1, lines.beside, lines.fed)
    height = lines.end[:, 2].round(3)
    is_fibre = lines.of_fibre
    fibre = {}
    for z in np.unique(height[laid & is_fibre]).tolist():
        mine = laid & is_fibre & (height == z)
        strands = shapely.linestrings(np.stack([lines.start[mine], lines.end[mine]], 1)[:, :, :2])
        section = job.section(z)
        shapely.prepare(section)
        inside = shapely.length(shapely.intersection(strands, section)) / lines.length[mine]
        volume = matrix[mine] + machine.filament_area * lines.length[mine] * (lines.tool[mine] == 1)
        fibre[z] = float(volume @ inside)
    found, lower, strands_below, total = [], 0.0, 0.0, 0.0
    filled = dict.fromkeys(np.unique(height[laid & ~is_fibre]).tolist(), 0.0)
    for z in filled:
        filled[z] = float(matrix[laid & ~is_fibre & (height == z)].sum())
    for z in sorted({*filled, *fibre}):
        strands_below += fibre.get(z, 0.0)
        if z not in filled:
            continue
        # Gauss: exact where the section changes with the third power of the height, or less.
        places = (0.5 + side * 0.5 / np.sqrt(3.0) for side in (-1.0, 1.0))
        room = 0.5 * (z - lower) * sum(job.area(lower + at * (z - lower)) for at in places)
        found.append((z, (filled[z] + strands_below) / room))
        total += filled[z] + strands_below
        lower, strands_below = z, 0.0
    return (total + strands_below) / job.volume, found


def volume(job: Job, run: Run) -> list[str]:
    """Each layer and the part are as full as they should be, and strands have room in theirs."""
    whole, layers = fullness(job, run)
    wrong = [
        f"layer at {z:g} is {share:.3f} full" for z, share in layers if not 0.96 < share < 1.04
    ]
    machine = job.machine
    k = machine.strand_area / (machine.fibre_width * machine.strand_height)
    if not machine.pressed and not 0.85 <= k <= 1.05:
        wrong.append(f"strands fill {k:.2f} of their cells")
    return wrong + ([] if 0.98 < whole < 1.02 else [f"the part is {whole:.3f} full"])


def feeding(job: Job, run: Run) -> list[str]:
    """Feed a strand its tail, a bit more, and its way to the cut; matrix what was planned.

    A tail is fed ahead for its straight moves; the arcs of it are up to 0.1 % longer.
    """
    wrong, machine, process = [], job.machine, job.machine.process
    longer = 1e-3 * machine.tail if machine.gcode.arcs else 0.0
    for name, steps in run.strands().items():
        total, fed = sum(s.length for s in steps), sum(s.fed for s in steps)
        wanted = machine.tail + process.restart_extra
        wanted += process.feed_ratio * (total - machine.tail)
        if abs(fed - wanted) > 0.01 + longer:
            wrong.append(f"strand {name} of {total:.2f} mm gets {fed:.3f} mm, not {wanted:.3f}")
    paths, area = job.plan.paths, machine.matrix_width / FILAMENT
    lengths = np.append(np.linalg.norm(np.diff(paths.points, axis=0), axis=1), 0.0)
    lengths[paths.offsets[1:] - 1] = 0.0
    layer = np.repeat(paths.layer, np.diff(paths.offsets))
    matrix = np.repeat(paths.kind == 1, np.diff(paths.offsets))
    lines = Lines.of(run)
    mine = lines.lays & (lines.tool == 0) & lines.in_part
    for number, top in enumerate(job.plan.top.tolist()):
        here = matrix & (layer == number)
        wanted = float((lengths * job.plan.laid)[here].sum()) * area
        fed = float(lines.fed[mine & (np.abs(lines.end[:, 2] - top) < 1e-6)].sum())
        if abs(fed - wanted) > 1e-3 * wanted + 1e-9:
            wrong.append(f"matrix at {top:g} gets {fed:.3f} mm, not {wanted:.3f}")
    return wrong


def shapes(job: Job, run: Run) -> list[str]:
    """Matrix has the section that its comments say, no higher than its shape, nor too thin."""
    lines, machine = Lines.of(run), job.machine
    mine = lines.lays & (lines.tool == 0)
    width, height, length = lines.width[mine], lines.height[mine], lines.length[mine]
    wrong = [
        f"a line {w:g} mm wide is {h:g} mm high"
        for w, h in np.unique(np.stack([width, height], axis=1), axis=0).tolist()
        if h > machine.line_shape * w + 1.5e-3 or h < machine.least_line - 1e-3
    ]
    for z in np.unique(lines.end[mine][:, 2].round(3)).tolist():
        here = lines.end[mine][:, 2].round(3) == z
        said = float((width * height * length)[here].sum())
        laid = FILAMENT * float(lines.fed[mine][here].sum())
        if abs(laid - said) > 3e-3 * said:
            wrong.append(f"lines at {z:g} are said to hold {said:.2f} mm^3, and hold {laid:.2f}")
    return wrong


def amount(job: Job, run: Run) -> list[str]:
    """Fibre, matrix in its place and what is left out are what was planned."""
    fibre = sum(sum(s.length for s in steps) for steps in own(run).values())
    lines = Lines.of(run)
    short = float(lines.length[lines.lays & lines.of_fibre & (lines.tool == 0)].sum())
    found = fibre + short + job.plan.dropped + job.plan.ended
    return [] if abs(found / job.planned - 1.0) < 1e-3 else [f"{found:g} of {job.planned:g} mm"]


def places(job: Job, run: Run) -> list[str]:
    """Strands lie where they were planned, or on a piece of one that was cut at the border.

    The file says places to 0.001 mm, and leaves out points that are within 1.5 times that of a
    straight line (ten times that in a compact file). Arcs leave the lines by their tolerance, and
    are up to 0.1 % longer.
    """
    if not job.strands:
        return ["no strand was planned"]
    lines = [shapely.LineString(line[:, :2]) for line in job.strands]
    middles = np.array([line[0, 2] for line in job.strands])
    half = 0.5 * job.machine.strand_height
    apart, longer = (
        (job.machine.gcode.arc_tolerance, 1e-3) if job.machine.gcode.arcs else (0.0, 0.0)
    )
    apart += np.sqrt(0.5) * 1e-3 + (1e-2 if job.machine.gcode.compact else 1.5e-3)
    wrong: list[str] = []
    whole = job.machine.process.turns != "cut" and not job.plan.ended
    for name, steps in own(run).items():
        points = np.array([steps[0].start, *(step.end for step in steps)])
        drawn = shapely.LineString(points[:, :2])
        same = [
            line
            for line, z in zip(lines, middles, strict=True)
            if abs(z + half - points[0, 2]) < 2e-3
        ]
        if not same or np.ptp(points[:, 2]) > 1e-9:
            wrong.append(f"strand {name} lies at {points[0, 2]:g} mm, where none was planned")
            continue
        near = [one for one in same if abs(one.length - drawn.length) < longer * one.length + 0.01]
        near = near if whole else same
        off = min((_off(drawn, one, whole) for one in near), default=np.inf)
        if off > apart + 1e-6:
            wrong.append(f"strand {name} lies {off:.3f} mm off")
    return wrong


def _off(drawn: shapely.LineString, line: shapely.LineString, whole: bool) -> float:
    """Farthest that a drawn line is off a planned one; where it is whole, either way."""
    points = shapely.points(shapely.get_coordinates(drawn))
    off = float(shapely.distance(points, line).max())
    if not whole:
        return off
    points = shapely.points(shapely.get_coordinates(line))
    return max(off, float(shapely.distance(points, drawn).max()))
