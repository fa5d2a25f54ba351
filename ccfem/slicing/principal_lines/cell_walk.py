"""Walking along a direction field that is constant in each tetrahedron."""

import numpy as np
from numba import njit

ENDS = ("boundary", "loop", "too long", "too many cells", "no direction")
BOUNDARY, LOOP, TOO_LONG, TOO_MANY, NO_DIRECTION = range(5)
"""Why a line ends."""

_TURNED = 0.2
"""Cosine below which a field that points back out of a cell is taken the other way round; above
it the line slides along the face."""


@njit(cache=True, nogil=True)
def _walk(  # type: ignore[no-untyped-def]
    seed, sense, direction, across, centre, gradient, longest, most, stamp, mark, cells, points
):
    """Walk from the centre of a cell in one sense.

    Writes the cells entered, the seed first, and the points at which they are entered, the centre
    first and the last point after them; marks the cells in `stamp`. Returns the number of cells,
    the length and the reason of the end.
    """
    cell = seed
    x, y, z = centre[seed, 0], centre[seed, 1], centre[seed, 2]
    bx = sense * direction[seed, 0]
    by = sense * direction[seed, 1]
    bz = sense * direction[seed, 2]
    entry = -1
    length = 0.0
    number = 0
    while True:
        stamp[cell] = mark
        cells[number] = cell
        points[number, 0], points[number, 1], points[number, 2] = x, y, z
        number += 1
        dx, dy, dz = direction[cell, 0], direction[cell, 1], direction[cell, 2]
        if dx == 0.0 and dy == 0.0 and dz == 0.0:
            points[number, 0], points[number, 1], points[number, 2] = x, y, z
            return number, length, NO_DIRECTION
        along = dx * bx + dy * by + dz * bz
        if along < 0.0:
            dx, dy, dz, along = -dx, -dy, -dz, -along
        if entry >= 0:
            gx, gy, gz = (
                gradient[cell, entry, 0],
                gradient[cell, entry, 1],
                gradient[cell, entry, 2],
            )
            inward = gx * dx + gy * dy + gz * dz
            if inward <= 0.0:
                if along < _TURNED:
                    dx, dy, dz = -dx, -dy, -dz
                else:
                    square = gx * gx + gy * gy + gz * gz
                    dx -= inward / square * gx
                    dy -= inward / square * gy
                    dz -= inward / square * gz
                    size = np.sqrt(dx * dx + dy * dy + dz * dz)
                    if size < 1e-6:
                        points[number, 0], points[number, 1], points[number, 2] = x, y, z
                        return number, length, NO_DIRECTION
                    dx, dy, dz = dx / size, dy / size, dz / size
        leaving = -1
        step = np.inf
        for i in range(4):
            if i == entry:
                continue
            gx, gy, gz = gradient[cell, i, 0], gradient[cell, i, 1], gradient[cell, i, 2]
            fall = -(gx * dx + gy * dy + gz * dz)
            if fall <= 0.0:
                continue
            value = 0.25 + (
                gx * (x - centre[cell, 0]) + gy * (y - centre[cell, 1]) + gz * (z - centre[cell, 2])
            )
            t = max(value, 0.0) / fall
            if t < step:
                step, leaving = t, i
        x, y, z = x + step * dx, y + step * dy, z + step * dz
        length += step
        points[number, 0], points[number, 1], points[number, 2] = x, y, z
        if length > longest:
            return number, length, TOO_LONG
        following = across[cell, leaving]
        if following < 0:
            return number, length, BOUNDARY
        if stamp[following] == mark:
            return number, length, LOOP
        if number >= most:
            return number, length, TOO_MANY
        entry = 0
        while across[following, entry] != cell:
            entry += 1
        cell = following
        bx, by, bz = dx, dy, dz


@njit(cache=True, nogil=True)
def survey(  # type: ignore[no-untyped-def]
    seeds, direction, across, centre, gradient, longest, most, touching, mask, length, ends
):
    """Trace from the seeds; write which joints each line touches, its length and its two ends."""
    stamp = np.full(len(direction), -1, np.int64)
    cells = np.empty(most + 1, np.int64)
    points = np.empty((most + 2, 3))
    for s in range(len(seeds)):
        for side in range(2):
            number, size, end = _walk(
                seeds[s], 1.0 - 2.0 * side, direction, across, centre, gradient, longest, most,
                stamp, s, cells, points,
            )  # fmt: skip
            length[s] += size
            ends[s, side] = end
            for k in range(number):
                mask[s] |= touching[cells[k]]


@njit(cache=True, nogil=True)
def count_crossings(  # type: ignore[no-untyped-def]
    seeds, direction, across, centre, gradient, longest, most, count
):
    """Add one to each cell that a line from one of the seeds crosses."""
    stamp = np.full(len(direction), -1, np.int64)
    cells = np.empty(most + 1, np.int64)
    points = np.empty((most + 2, 3))
    for s in range(len(seeds)):
        for side in range(2):
            number, _, _ = _walk(
                seeds[s], 1.0 - 2.0 * side, direction, across, centre, gradient, longest, most,
                stamp, s, cells, points,
            )  # fmt: skip
            # The second half begins in the cell of the first.
            for k in range(side, number):
                count[cells[k]] += 1


@njit(cache=True, nogil=True)
def collect(  # type: ignore[no-untyped-def]
    seed, direction, across, centre, gradient, longest, most, stamp
):
    """Trace one line; return its points from end to end."""
    cells = np.empty(most + 1, np.int64)
    back = np.empty((most + 2, 3))
    forth = np.empty((most + 2, 3))
    n, _, _ = _walk(
        seed, 1.0, direction, across, centre, gradient, longest, most, stamp, seed, cells, forth
    )
    m, _, _ = _walk(
        seed, -1.0, direction, across, centre, gradient, longest, most, stamp, seed, cells, back
    )
    line = np.empty((m + n + 1, 3))
    for k in range(m + 1):
        line[k] = back[m - k]
    for k in range(1, n + 1):
        line[m + k] = forth[k]
    return line
