"""Checks of how nozzles move: speeds, travel, what lies below fibre, the bed."""

from collections.abc import Callable, Iterator

import numpy as np
import shapely
import shapely.ops

from benchmarks.print_checks.height_map import HeightMap, sampled
from benchmarks.print_checks.job import PART, Job, Lines
from benchmarks.print_checks.printer import Run, Step
from ccfem.machine import Machine

__all__ = ["air", "arc", "bed", "beneath", "free_fibre", "in_air", "speeds", "support", "travel"]

STRAIGHT, CURVED = 8.0, 3.0
"""Longest span over nothing, mm, of a strand that turns by less than 10 degrees, and of others."""
_TURN = 10.0
Spanned = Callable[[float, np.ndarray], np.ndarray]


def arc(steps: list[Step]) -> np.ndarray:
    """Length of a strand at the ends of its steps."""
    return np.cumsum([0.0, *(step.length for step in steps)])


def _radii(points: np.ndarray, along: np.ndarray, reach: float) -> np.ndarray:
    """Radius of the circle through the places a reach before and behind the middle of each step."""

    def at(where: np.ndarray) -> np.ndarray:
        return np.stack([np.interp(where, along, column) for column in points.T], axis=1)

    middle = 0.5 * (along[1:] + along[:-1])
    a, b, c = at(middle - reach), at(middle), at(middle + reach)
    sides = [np.linalg.norm(x - y, axis=1) for x, y in ((a, b), (b, c), (c, a))]
    twice = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return sides[0] * sides[1] * sides[2] / np.maximum(2.0 * twice, 1e-12)


def speeds(job: Job, run: Run) -> list[str]:
    """Slow at the start, at corners, in turns and behind the cut."""
    wrong, machine, process = [], job.machine, job.machine.process
    top = min(process.speed_limit or np.inf, machine.fibre_speed)
    if machine.speeds is not None:
        top = min(process.speed_limit or np.inf, max(machine.speeds.speed))
    for name, steps in run.strands().items():
        steps = [step for step in steps if step.length]
        along = arc(steps)
        points = np.array([steps[0].start, *(step.end for step in steps)])
        speed = np.array([step.speed for step in steps])
        start, end = along[:-1], along[1:]
        ways = np.diff(points, axis=0) / np.diff(along)[:, None]
        turn = np.einsum("ij,ij->i", ways[1:], ways[:-1]) < np.cos(np.radians(process.corner_angle))
        near = process.corner_length - 0.01
        slow = start < process.start_length - 0.01
        for at in along[1:-1][turn]:
            slow |= (start < at + near) & (end > at - near)
        limit = np.where(slow, min(process.start_speed, top), top)
        reach = 2.0 * machine.fibre_width
        inside = (start > reach) & (end < along[-1] - reach) & (end - start < 0.5 * reach)
        for at in along[1:-1][turn]:
            inside &= (start > at + reach) | (end < at - reach)
        if machine.speeds is None and process.bend_radius > machine.minimum_radius:
            radius = np.minimum(_radii(points, along, reach), process.bend_radius)
            share = (radius - machine.minimum_radius) / (
                process.bend_radius - machine.minimum_radius
            )
            slowest = min(process.start_speed, machine.fibre_speed)
            bent = slowest + np.clip(share, 0.0, 1.0) * (machine.fibre_speed - slowest)
            limit = np.where(inside, np.minimum(limit, job.bent * bent), limit)
        cut = along[-1] - machine.tail
        behind = 0.5 * (start + end) > cut
        limit = np.where(behind, np.minimum(limit, process.finish_speed), limit)
        for k in np.flatnonzero(speed > limit + 1e-6)[:3].tolist():
            wrong.append(f"strand {name} at {end[k]:.1f} mm: {speed[k]:g} > {limit[k]:g} mm/s")
    return wrong


def travel(job: Job, run: Run) -> list[str]:
    """Above all that is laid, this layer's lines included, and never with fibre that is not cut.

    From one line of sparse infill to the next the nozzle may stay down, if it crosses no line of
    the layer and does not leave the part.
    """
    wrong, lift = [], job.machine.gcode.lift
    lines, area = Lines.of(run), HeightMap(job.machine.gcode.bed)
    across = np.abs(lines.end - lines.start)[:, :2].max(axis=1) > 0.0
    moved = lines.rapid & across
    moved[:2] = False
    down = np.zeros(len(moved), dtype=bool)
    down[1:] = moved[1:] & (np.abs(lines.end[1:, 2] - lines.end[:-1, 2]) < 1e-9)
    down &= (lines.tool == 0) & (lines.kind == PART[2]) & _follows_laying(down, lines.lays)
    wrong += _crossings(job, lines, down)
    moved &= ~down
    # Batches: each ends where a line lies higher than those of the batch.
    tops = np.maximum.accumulate(np.where(lines.lays, lines.end[:, 2], 0.0))
    edges = np.flatnonzero(np.diff(tops, prepend=-1.0) > 1e-9).tolist()
    for first, last in zip(edges, [*edges[1:], len(tops)], strict=True):
        here = np.arange(first, last)
        laid = here[lines.lays[here]]
        if len(laid):
            area.lay(lines.start[laid], lines.end[laid], job.machine.matrix_width)
        going = here[moved[here]]
        if len(going):
            place, move = sampled(lines.start[going], lines.end[going])
            over = np.zeros(len(going))
            np.maximum.at(over, move, area.highest(place))
            low = np.minimum(lines.start[going, 2], lines.end[going, 2])
            for k in np.flatnonzero(low < over + 0.95 * lift).tolist():
                wrong.append(f"travel at {low[k]:g} over {over[k]:g}: step {going[k]}")
    hanging = False
    for step in run.steps:
        hanging = (hanging or (step.tool == 1 and step.fed > 0.0)) and step.number not in run.cuts
        if step.tool == 1 and step.cut:
            hanging = False
        if step.rapid and hanging:
            wrong.append(f"fibre is dragged by step {step.number}")
            hanging = False
    return wrong


def _follows_laying(moved: np.ndarray, lays: np.ndarray) -> np.ndarray:
    """Which moves are the first ones behind a line, or follow such a move."""
    begins = moved & np.append(False, lays[:-1])
    number = np.maximum.accumulate(np.where(moved, 0, np.arange(len(moved))))
    return moved & np.append(begins, False)[np.minimum(number + 1, len(moved))]


def _crossings(job: Job, lines: Lines, down: np.ndarray) -> list[str]:
    """Ways of a nozzle that stays down, and crosses a line of its layer or leaves the part."""
    wrong, height = [], lines.end[:, 2].round(3)
    first = np.flatnonzero(down & ~np.append(False, down[:-1]))
    last = np.flatnonzero(down & ~np.append(down[1:], False))
    for z in np.unique(height[down]).tolist():
        laid = np.flatnonzero(lines.lays & (height == z))
        ends = np.stack([lines.start[laid], lines.end[laid]], axis=1)[:, :, :2]
        tree, section = shapely.STRtree(shapely.linestrings(ends)), job.section(z)
        shapely.prepare(section)
        for a, b in zip(first.tolist(), last.tolist(), strict=True):
            if height[a] != z:
                continue
            way = shapely.LineString(np.concatenate([lines.start[a : a + 1], lines.end[a : b + 1]]))
            # Without its ends, where it leaves one line and comes to the next.
            middle = shapely.ops.substring(way, 2e-3, way.length - 2e-3)
            met = laid[tree.query(middle, predicate="intersects")]
            if (met < a).any() or not section.contains(middle):
                wrong.append(f"down at {z:g} over a line, or out of the part: step {a}")
    return wrong


def beneath(job: Job, run: Run) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
    """Find steps of each strand, places along them, the way on from each, and which have support.

    Lines that lie lower are support; those of the same layer carry nothing.
    """
    lines = Lines.of(run)
    layer, area = job.machine.strand_height, HeightMap(job.machine.gcode.bed)
    fibre = lines.lays & (lines.tool == 1)
    height = lines.end[:, 2].round(3)
    done = 0
    order = np.argsort(np.where(lines.lays, height, np.inf), kind="stable")
    order = order[: int(lines.lays.sum())]
    for z in np.unique(height[fibre]).tolist():
        count = int(np.searchsorted(height[order], z))
        new = order[done:count]
        if len(new):
            area.lay(lines.start[new], lines.end[new], job.machine.matrix_width)
        done = max(done, count)
        mine = np.flatnonzero(fibre & (height == z))
        strand = np.cumsum(np.diff(mine, prepend=-2) > 1)
        for number in np.unique(strand).tolist():
            steps = mine[strand == number]
            place, _ = sampled(lines.start[steps], lines.end[steps], 0.5)
            held = area.highest(place, 0.2) >= z - 1.6 * layer - 1e-6
            way = np.append(np.linalg.norm(np.diff(place, axis=0), axis=1), 0.0)
            yield steps, place, way, held


def free_fibre(job: Job, run: Run) -> tuple[float, list[tuple[float, float]]]:
    """Share of the fibre with nothing below it; length and turn, degrees, of each run of it."""
    free, total, spans = 0.0, 0.0, []
    for _, place, way, held in beneath(job, run):
        free += float(way[~held].sum())
        total += float(way.sum())
        spans += _runs(place, way, held)
    return free / max(total, 1e-9), spans


def _runs(place: np.ndarray, way: np.ndarray, held: np.ndarray) -> list[tuple[float, float]]:
    """Length and turn of each run of places that nothing holds."""
    found = []
    edges = np.flatnonzero(np.diff(np.concatenate([[True], held, [True]]).astype(int)))
    for first, last in edges.reshape(-1, 2).tolist():
        steps = np.diff(place[first : last + 1, :2], axis=0)
        steps = steps[np.linalg.norm(steps, axis=1) > 1e-6]
        angle = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        turn = float(np.degrees(np.ptp(angle))) if len(angle) else 0.0
        found.append((float(way[first:last].sum()), turn))
    return found


def support(job: Job, run: Run) -> list[str]:
    """Fibre has something below it, but for .5 % and short spans."""
    share, spans = free_fibre(job, run)
    wrong = [f"{share:.3%} of the fibre has nothing below"] if share > 0.005 else []
    for length, turn in spans:
        if length > (STRAIGHT if turn < _TURN else CURVED):
            wrong.append(f"a span of {length:.1f} mm that turns by {turn:.0f} degrees")
    return wrong


def bed(job: Job, run: Run) -> list[str]:
    """Both nozzles over the bed wherever either of them works."""
    lines, profile = Lines.of(run), job.machine.gcode
    low, high = lines.end[2:].min(axis=0), lines.end[2:].max(axis=0)
    fibre = lines.end[lines.tool == 1] - [*profile.offset[:2], 0.0]
    if len(fibre):
        low, high = np.minimum(low, fibre.min(axis=0)), np.maximum(high, fibre.max(axis=0))
    inside = (low >= 0.0).all() and (high <= profile.bed).all()
    return [] if inside else [f"nozzles reach {low} to {high}"]


def in_air(machine: Machine, run: Run, spanned: Spanned | None = None) -> float:
    """Share of the part's matrix, by volume, that is laid with nothing near below it.

    A line is held by what is as high as the layer of matrix below its own, within the height of its
    layer to its sides.

    Parameters
    ----------
    spanned : callable, optional
        Of the top of a line and places (k, 3) on it: which of them are bridged, and not in air.
    """
    lines, area = Lines.of(run), HeightMap(machine.gcode.bed)
    matrix = lines.lays & (lines.tool == 0) & np.isin(lines.kind, PART[:2])
    height = lines.end[:, 2].round(3)
    free, level = 0.0, 0.0
    for z in np.unique(height[lines.lays]).tolist():
        mine = np.flatnonzero(matrix & (height == z))
        if len(mine):
            place, move = sampled(lines.start[mine], lines.end[mine])
            held = area.highest(place, z - level) >= level - 0.05
            if spanned is not None:
                held |= spanned(z, place)
            level = z
            share = np.bincount(move, ~held) / np.bincount(move)
            free += float(share @ lines.fed[mine])
        here = np.flatnonzero(lines.lays & (height == z))
        area.lay(lines.start[here], lines.end[here], machine.matrix_width)
    return free / float(lines.fed[matrix].sum())


def air(job: Job, run: Run) -> list[str]:
    """Matrix is laid on something, except for at most half a percent of it."""
    share = in_air(job.machine, run)
    return [f"{share:.1%} of the matrix is laid in air"] if share > 0.005 else []
