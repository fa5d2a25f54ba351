"""A pattern of pixels as paths in the plane of a layer."""

from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze, seen_only
from ccfem.base.compiled import compiled
from ccfem.geometry.polylines import pack
from ccfem.paths.raster.bitmap import NEIGHBOURS, Bitmap
from ccfem.paths.raster.patterns import Regions
from ccfem.paths.raster.skeleton import thin
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer

# Ordered paths through the pixels of regions.


_STUB = 4
"""Branches and paths of fewer pixels beside another path of their region do not count: it absorbs
them."""
_ROUNDS = 20


@dataclass(frozen=True)
class PixelPaths:
    """Paths as chains of neighbouring pixels, and the path that each solid pixel belongs to.

    Attributes
    ----------
    pixels : (P, 2) int array
        Row and column of the pixels, each once.
    offsets : (K + 1,) int array
        Path k holds ``pixels[offsets[k]:offsets[k + 1]]``.
    closed : (K,) bool array
        Whether the path goes on from its last pixel to its first.
    label : (H, W) int array
        Path of each pixel; -1 where there is none.
    isolated : (H, W) bool array
        Pixels that no path passes through, with the label of a path beside them, which has to be
        wider there (more extrusion); -1 where there is none beside them.
    """

    pixels: IntArray
    offsets: IntArray
    closed: BoolArray
    label: IntArray
    isolated: BoolArray

    def __post_init__(self) -> None:
        freeze(self, pixels=int, offsets=int, label=int, closed=bool, isolated=bool)

    def __len__(self) -> int:
        return len(self.closed)


def trace(regions: IntArray, linked: BoolArray, seed: int = 0) -> PixelPaths:
    """Trace paths through regions of pixels.

    Each region is thinned, and its lines are followed, without spurs and straight on where they
    fork. Pixels left over come back as corners of diagonal steps, then as paths of their own;
    single ones stay isolated. Paths of one region whose ends meet are joined. No two paths cross.

    Parameters
    ----------
    regions : (H, W) int array
        Region of each solid pixel, about a pixel wide; negative elsewhere. The outermost rows and
        columns are empty.
    linked : (H, W, 8) bool array
        `Bitmap.linked`.
    seed : int
        Of the random pixel that each closed path starts at, so that starts make no seam.
    """
    regions = seen_only(np.asarray(regions, dtype=np.int64))
    linked = seen_only(linked)
    following = np.full(regions.size, -1, dtype=np.int64)
    before = np.full(regions.size, -1, dtype=np.int64)
    used = np.zeros(regions.shape, dtype=bool)
    for _ in range(_ROUNDS):
        left = np.where(used, -1, regions)
        line = thin(left)
        if not line.any():
            break
        cut_spurs(line, regions, linked, _STUB)
        if not walk(line, regions, linked, used, following, before, _STUB):
            break
        join_ends(regions, linked, used, following, before)
        fill_corners(regions, linked, used, following, before)
        extend_ends(regions, linked, used, following, before)
    join_ends(regions, linked, used, following, before)
    fill_corners(regions, linked, used, following, before)
    pixels, offsets, closed = chains(regions, used, following, before)
    random = np.random.default_rng(seed)
    for k in np.flatnonzero(closed):
        span = slice(offsets[k], offsets[k + 1])
        pixels[span] = np.roll(pixels[span], random.integers(offsets[k + 1] - offsets[k]), axis=0)
    label = np.full(regions.shape, -1, dtype=np.int64)
    label[tuple(pixels.T)] = np.repeat(np.arange(len(closed)), np.diff(offsets))
    isolated = (regions >= 0) & ~used
    absorb(regions, linked, isolated, label)
    return PixelPaths(pixels, offsets, closed, label, isolated)


# Lines of pixels as linked lists: followed, filled, extended, joined.
#
# Pixels are numbered row by row; `following` and `before` hold the next and the last pixel of the
# path, -1 at its ends, and `used` which pixels are on one. A step goes to a neighbour of the same
# region that `linked` allows.


_STEPS = NEIGHBOURS.copy()


@compiled
def _crosses(following: IntArray, width: int, i: int, j: int, k: int) -> bool:
    """Whether a step from a pixel would cross a diagonal step of a path."""
    if k % 2 == 0:
        return False
    a, b = (i + _STEPS[k, 0]) * width + j, i * width + j + _STEPS[k, 1]
    return following[a] == b or following[b] == a


@compiled
def _next_sense(
    line: BoolArray,
    regions: IntArray,
    linked: BoolArray,
    used: BoolArray,
    following: IntArray,
    i: int,
    j: int,
    way: int,
) -> int:
    """Sense (0 to 7) of the way on from a pixel, as straight as can be; -1 where there is none."""
    best, least = -1, 99
    for k in range(8):
        if not linked[i, j, k]:
            continue
        a, b = i + _STEPS[k, 0], j + _STEPS[k, 1]
        if not line[a, b] or used[a, b] or regions[a, b] != regions[i, j]:
            continue
        if _crosses(following, regions.shape[1], i, j, k):
            continue
        turn = 0 if way < 0 else min((k - way) % 8, (way - k) % 8)
        # Straight on first; of equal turns, over a side rather than a corner.
        cost = 2 * turn + k % 2
        if cost < least:
            best, least = k, cost
    return best


@compiled
def _follow_pixels(
    line: BoolArray,
    regions: IntArray,
    linked: BoolArray,
    used: BoolArray,
    following: IntArray,
    start: int,
    chain: IntArray,
) -> int:
    """Follow a line both ways from a pixel into `chain`; the number of its pixels."""
    width = regions.shape[1]
    used[start // width, start % width] = True
    size, ahead = 0, -1
    for half in range(2):
        at, way = start, -1
        if half == 1:
            # The first half backwards, its start, and on the other way.
            for k in range(size // 2):
                chain[k], chain[size - 1 - k] = chain[size - 1 - k], chain[k]
            chain[size] = start
            size += 1
            way = (ahead + 4) % 8 if ahead >= 0 else -1
        while True:
            i, j = at // width, at % width
            way = _next_sense(line, regions, linked, used, following, i, j, way)
            if way < 0:
                break
            if at == start and half == 0:
                ahead = way
            i, j = i + _STEPS[way, 0], j + _STEPS[way, 1]
            used[i, j] = True
            at = i * width + j
            chain[size] = at
            size += 1
    return size


@compiled
def _beside_on(
    line: BoolArray, regions: IntArray, linked: BoolArray, i: int, j: int
) -> tuple[int, int]:
    """Count the neighbours of a pixel on its line, and give the sense of the last of them."""
    count, way = 0, -1
    for k in range(8):
        a, b = i + _STEPS[k, 0], j + _STEPS[k, 1]
        if linked[i, j, k] and line[a, b] and regions[a, b] == regions[i, j]:
            count, way = count + 1, k
    return count, way


@compiled
def cut_spurs(line: BoolArray, regions: IntArray, linked: BoolArray, least: int) -> None:
    """Remove branches of fewer pixels than `least`, from a free end to a fork, from the lines."""
    width = regions.shape[1]
    chain = np.empty(least, dtype=np.int64)
    for start in range(regions.size):
        i, j = start // width, start % width
        if not line[i, j]:
            continue
        count, way = _beside_on(line, regions, linked, i, j)
        if count != 1:
            continue
        size = 0
        while size < least and count < 3 and way >= 0:
            chain[size] = i * width + j
            size += 1
            line[i, j] = False  # so that the way back does not count
            i, j = i + _STEPS[way, 0], j + _STEPS[way, 1]
            count, way = _beside_on(line, regions, linked, i, j)
            count += 1
        # No fork within the length: a line by itself, or a long branch, is put back.
        if count < 3 or size == least:
            for k in range(size):
                line[chain[k] // width, chain[k] % width] = True


@compiled
def walk(
    line: BoolArray,
    regions: IntArray,
    linked: BoolArray,
    used: BoolArray,
    following: IntArray,
    before: IntArray,
    stub: int,
) -> int:
    """Follow all lines, from their ends first; the number of paths found.

    Chains of fewer pixels than `stub` beside an earlier path are dropped.
    """
    chain = np.empty(regions.size, dtype=np.int64)
    width = regions.shape[1]
    already = used.copy()
    count = 0
    for from_ends in (True, False):
        for start in range(regions.size):
            i, j = start // width, start % width
            if not line[i, j] or used[i, j]:
                continue
            if from_ends and _beside_on(line, regions, linked, i, j)[0] > 1:
                continue
            size = _follow_pixels(line, regions, linked, used, following, start, chain)
            # Beside an earlier path a stub adds nothing but a turn.
            short = size < stub and _beside(chain, size, regions, linked, already)
            if size == 1 or short:
                for k in range(size):
                    line[chain[k] // width, chain[k] % width] = False
                    used[chain[k] // width, chain[k] % width] = False
                continue
            count += 1
            for k in range(size - 1):
                following[chain[k]] = chain[k + 1]
                before[chain[k + 1]] = chain[k]
    return count


@compiled
def _beside(
    chain: IntArray, size: int, regions: IntArray, linked: BoolArray, used: BoolArray
) -> bool:
    """Whether some pixel of a chain has a neighbour of its region that is on a path."""
    width = regions.shape[1]
    for m in range(size):
        i, j = chain[m] // width, chain[m] % width
        for k in range(8):
            a, b = i + _STEPS[k, 0], j + _STEPS[k, 1]
            if linked[i, j, k] and used[a, b] and regions[a, b] == regions[i, j]:
                return True
    return False


@compiled
def fill_corners(
    regions: IntArray, linked: BoolArray, used: BoolArray, following: IntArray, before: IntArray
) -> None:
    """Replace diagonal steps of paths by two over an unused pixel beside both their ends."""
    height, width = regions.shape
    for i in range(1, height - 1):
        for j in range(1, width - 1):
            if regions[i, j] < 0 or used[i, j]:
                continue
            here = i * width + j
            for k in range(0, 8, 2):
                m = (k + 2) % 8
                if not (linked[i, j, k] and linked[i, j, m]):
                    continue
                a = (i + _STEPS[k, 0]) * width + j + _STEPS[k, 1]
                b = (i + _STEPS[m, 0]) * width + j + _STEPS[m, 1]
                # Paths have a sense: a comes before b.
                if following[b] == a:
                    a, b = b, a
                same = regions[a // width, a % width] == regions[i, j]
                if same and following[a] == b:
                    following[a] = before[b] = here
                    before[here], following[here] = a, b
                    used[i, j] = True
                    break


@compiled
def extend_ends(
    regions: IntArray, linked: BoolArray, used: BoolArray, following: IntArray, before: IntArray
) -> None:
    """Extend open paths over the unused pixels ahead of their ends."""
    width = regions.shape[1]
    for start in range(regions.size):
        if not used[start // width, start % width]:
            continue
        if following[start] >= 0 and before[start] >= 0:
            continue
        at, ahead = start, following[start] < 0
        while True:
            i, j = at // width, at % width
            # Not back beside the last pixel, and over a side rather than a corner.
            last = before[at] if ahead else following[at]
            best = -1
            for k in range(8):
                a, b = i + _STEPS[k, 0], j + _STEPS[k, 1]
                if not linked[i, j, k] or used[a, b] or regions[a, b] != regions[i, j]:
                    continue
                if max(abs(a - last // width), abs(b - last % width)) < 2:
                    continue
                if _crosses(following, width, i, j, k):
                    continue
                if best < 0 or k % 2 < best % 2:
                    best = k
            if best < 0:
                break
            there = (i + _STEPS[best, 0]) * width + j + _STEPS[best, 1]
            used[there // width, there % width] = True
            if ahead:
                following[at], before[there] = there, at
            else:
                before[at], following[there] = there, at
            at = there


@compiled
def join_ends(
    regions: IntArray, linked: BoolArray, used: BoolArray, following: IntArray, before: IntArray
) -> None:
    """Join paths of one region whose ends are neighbours; close those that end at their start."""
    height, width = regions.shape
    for i in range(1, height - 1):
        for j in range(1, width - 1):
            here = i * width + j
            if not used[i, j] or (following[here] >= 0 and before[here] >= 0):
                continue
            for k in range(8):
                if not linked[i, j, k]:
                    continue
                a, b = i + _STEPS[k, 0], j + _STEPS[k, 1]
                there = a * width + b
                if not used[a, b] or regions[a, b] != regions[i, j]:
                    continue
                if following[there] >= 0 and before[there] >= 0:
                    continue
                if _crosses(following, width, i, j, k):
                    continue
                if following[here] >= 0 and before[here] >= 0:
                    break
                _join(following, before, here, there)


@compiled
def _join(following: IntArray, before: IntArray, here: int, there: int) -> None:
    """Join the paths that end at two pixels, or close the one path of more than three pixels."""
    size, at, back = 1, here, following[here] < 0
    while True:
        onward = before[at] if back else following[at]
        if onward < 0:
            break
        at = onward
        size += 1
    if at == there:
        if size > 3:
            if back:
                following[here], before[there] = there, here
            else:
                before[here], following[there] = there, here
        return
    if (back and before[there] >= 0) or (not back and following[there] >= 0):
        # Both end, or both begin, here: turn the one at `there` round.
        at = there
        turned = before[there] >= 0
        while True:
            step = before[at] if turned else following[at]
            following[at], before[at] = before[at], following[at]
            if step < 0:
                break
            at = step
    if back:
        following[here], before[there] = there, here
    else:
        before[here], following[there] = there, here


@compiled
def chains(
    regions: IntArray, used: BoolArray, following: IntArray, before: IntArray
) -> tuple[IntArray, IntArray, BoolArray]:
    """Pixels path by path, with offsets and which are closed."""
    width = regions.shape[1]
    pixels = np.empty((used.size, 2), dtype=np.int64)
    offsets = np.empty(len(pixels) + 1, dtype=np.int64)
    closed = np.empty(len(pixels), dtype=np.bool_)
    done = np.zeros(used.size, dtype=np.bool_)
    offsets[0] = count = paths = 0
    for ring in (False, True):
        for start in range(used.size):
            if not used[start // width, start % width] or done[start]:
                continue
            if not ring and before[start] >= 0:
                continue
            at = start
            while at >= 0 and not done[at]:
                done[at] = True
                pixels[count, 0], pixels[count, 1] = at // width, at % width
                count += 1
                at = following[at]
            closed[paths] = ring
            paths += 1
            offsets[paths] = count
    return pixels[:count].copy(), offsets[: paths + 1].copy(), closed[:paths].copy()


@compiled
def absorb(regions: IntArray, linked: BoolArray, isolated: BoolArray, label: IntArray) -> None:
    """Label isolated pixels by a path beside them, best of their region and sharing a side."""
    height, width = regions.shape
    changed = True
    while changed:
        changed = False
        for i in range(1, height - 1):
            for j in range(1, width - 1):
                if not isolated[i, j] or label[i, j] >= 0:
                    continue
                least = 99
                for k in range(8):
                    a, b = i + _STEPS[k, 0], j + _STEPS[k, 1]
                    if not linked[i, j, k] or label[a, b] < 0:
                        continue
                    cost = 2 * (regions[a, b] != regions[i, j]) + k % 2
                    if cost < least:
                        least, label[i, j] = cost, label[a, b]
                        changed = True


@dataclass(frozen=True)
class RasterPlan:
    """Paths planned on a bitmap, and the pattern of regions."""

    raster: Bitmap
    regions: Regions
    paths: PixelPaths

    @property
    def chains(self) -> list[FloatArray]:
        """Centres (n_i, 2), mm, of the pixels of each path; closed ones repeat their first."""
        points = self.raster.centres(self.paths.pixels)
        chains = np.split(points, self.paths.offsets[1:-1]) if len(self.paths) else []
        return [
            np.concatenate([chain, chain[:1]]) if closed else chain
            for chain, closed in zip(chains, self.paths.closed, strict=True)
        ]

    def lines(self) -> list[FloatArray]:
        """Polylines (n_i, 2), mm: straight runs by their ends, staircases made straight.

        A path that would leave the section by a straight step keeps all its staircases.
        """
        chains = self.chains
        if not chains:
            return []
        points, offsets = pack(chains)
        pixels = self.raster.pixels(points)
        lines = self._kept(chains, corners(pixels, offsets))
        shapely.prepare(self.raster.section)
        inside = shapely.covers(self.raster.section, [shapely.LineString(x) for x in lines])
        if not inside.all():
            plain = self._kept(chains, corners(pixels, offsets, stairs=False))
            lines = [a if k else b for a, b, k in zip(lines, plain, inside, strict=True)]
        return lines

    def _kept(self, chains: list[FloatArray], keep: BoolArray) -> list[FloatArray]:
        ends = np.cumsum([len(chain) for chain in chains])[:-1]
        return [chain[k] for chain, k in zip(chains, np.split(keep, ends), strict=True)]

    def toolpaths(self, layer: Layer) -> Toolpaths:
        """Paths on a layer, however short."""
        return Toolpaths.from_plane(self.lines(), layer, self.paths.closed.tolist())


def raster_plan(raster: Bitmap, regions: Regions) -> RasterPlan:
    """Trace the paths of a pattern."""
    return RasterPlan(raster, regions, trace(regions.number, raster.linked))


# Paths of pixels with fewer points: staircases to diagonals, straight runs to their ends.


_STAIRS = 3
"""Minimum number of steps, alternating between two directions, that make a staircase."""


def corners(pixels: IntArray, offsets: IntArray, stairs: bool = True) -> BoolArray:
    """Mask (P,) of the points of pixel paths that stay: those where the path turns.

    Parameters
    ----------
    pixels : (P, 2) int array
        Neighbouring pixels a path; a closed path repeats its first.
    offsets : (K + 1,) int array
    stairs : bool, default True
        Whether three or more steps along sides of pixels, alternating between two directions, are
        one straight step from the first pixel to the last. Two staircases share no step, and a
        single corner stays.
    """
    return np.asarray(
        _pixel_corners(np.ascontiguousarray(pixels), offsets, _STAIRS if stairs else 0)
    )


@compiled
def _pixel_corners(pixels: IntArray, offsets: IntArray, stairs: int) -> BoolArray:
    keep = np.ones(len(pixels), dtype=np.bool_)
    for path in range(len(offsets) - 1):
        first, last = offsets[path], offsets[path + 1] - 1
        if stairs:
            k = first
            while k < last:
                m = k
                while m + 1 < last and _stair(pixels, m):
                    if m > k and not _parallel(pixels, m):
                        break
                    m += 1
                if m + 1 - k >= stairs:
                    for p in range(k + 1, m + 1):
                        keep[p] = False
                k = m + 1
        # Straight runs of what is left.
        before, here = first, -1
        for k in range(first + 1, last + 1):
            if not keep[k]:
                continue
            if here >= 0:
                ax, ay = pixels[here, 0] - pixels[before, 0], pixels[here, 1] - pixels[before, 1]
                bx, by = pixels[k, 0] - pixels[here, 0], pixels[k, 1] - pixels[here, 1]
                if ax * by == ay * bx and ax * bx + ay * by > 0:
                    keep[here] = False
                else:
                    before = here
            here = k
    return keep


@compiled
def _stair(pixels: IntArray, m: int) -> bool:
    """Whether the steps from point m and m + 1 go along sides, at a right angle."""
    ax, ay = pixels[m + 1, 0] - pixels[m, 0], pixels[m + 1, 1] - pixels[m, 1]
    bx, by = pixels[m + 2, 0] - pixels[m + 1, 0], pixels[m + 2, 1] - pixels[m + 1, 1]
    along_sides = abs(ax) + abs(ay) == 1 and abs(bx) + abs(by) == 1
    return along_sides and ax * bx + ay * by == 0


@compiled
def _parallel(pixels: IntArray, m: int) -> bool:
    """Whether the step to point m and that from point m + 1 are the same."""
    for i in range(2):
        if pixels[m + 2, i] - pixels[m + 1, i] != pixels[m, i] - pixels[m - 1, i]:
            return False
    return True
