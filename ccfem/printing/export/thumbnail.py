"""Small pictures of a print at the head of its file, which displays of printers show.

The format is that of PrusaSlicer, which Klipper's and Marlin's displays read: PNG in base64 between
two comments. Nothing but numpy draws: lines are points on a grid, the nearest to the eye on top.
"""

import base64
import struct
import zlib
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import extent, sample_midpoints
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, SUPPORT, Toolpaths
from ccfem.printing.print_plan import PrintPlan

LINE_COLOURS = ("#6b7686", "#a9b4c2", "#0d2f5c", "#b08968")
"""Colours of contours, of the matrix within, of fibre and of support."""

_AROUND, _DOWN = np.radians((-60.0, 35.0))
"""Where the eye is: about the vertical from the right, and above the bed."""
_RIGHT = np.array([-np.sin(_AROUND), np.cos(_AROUND), 0.0])
_EYE = np.array([np.cos(_AROUND) * np.cos(_DOWN), np.sin(_AROUND) * np.cos(_DOWN), np.sin(_DOWN)])
_UP = np.cross(_EYE, _RIGHT)
_MARGIN = 0.04
"""Share of a picture that stays free on each side."""
_FINER = 2
"""Cells of the grid on a pixel, along each of its sides."""
_MOST = 60_000
"""Samples above which some layers are left out."""
_DARKER = 0.3
"""Share by which the lowest layer is darker than the highest."""
_WIDE = 78
"""Characters of base64 in a line."""


def thumbnail_lines(plan: PrintPlan, machine: Machine) -> Iterator[str]:
    """Yield the comments that hold the pictures which a machine asks for."""
    for size in machine.gcode.thumbnails:
        width, height = map(int, size.split("x"))
        text = base64.b64encode(thumbnail(plan, machine, width, height)).decode("ascii")
        yield f"; thumbnail begin {width}x{height} {len(text)}"
        yield from (f"; {text[k : k + _WIDE]}" for k in range(0, len(text), _WIDE))
        yield "; thumbnail end"


def thumbnail(plan: PrintPlan, machine: Machine, width: int, height: int) -> bytes:
    """Draw what is printed, seen from the front and above, as a PNG of so many pixels."""
    low, high = extent(plan.paths.points, np.column_stack([_RIGHT, -_UP]))
    grid = np.array([width, height]) * _FINER
    cell = max(float(((high - low) / ((1.0 - 2.0 * _MARGIN) * grid)).max()), 1e-6)
    step = max(cell, 0.5 * machine.matrix_width)
    paths, gap = _some_layers(plan, step)
    points, _, _, line = sample_midpoints(paths.points, paths.offsets, step)
    place = (points @ np.column_stack([_RIGHT, -_UP]) - 0.5 * (low + high)) / cell + 0.5 * grid
    # A sample is as wide as its line, and as high as the side that it stands for.
    wide = int(np.ceil(step / cell))
    tall = int(np.ceil(max(step * np.sin(_DOWN), gap * np.cos(_DOWN)) / cell))
    order = np.argsort(points @ _EYE, kind="stable")
    corner = np.floor(place[order] - 0.5 * np.array([wide, 0])).astype(np.int32)
    corner = np.clip(corner, 0, grid - [wide, tall])
    off = np.add.outer(np.arange(tall) * grid[0], np.arange(wide)).ravel().astype(np.int32)
    cells = (corner[:, 1] * grid[0] + corner[:, 0])[:, None] + off
    # Of several samples in a cell the last one stays: the one nearest to the eye.
    nearest = np.full(int(grid.prod()), -1, dtype=np.int32)
    nearest[cells] = np.arange(len(order), dtype=np.int32)[:, None]
    drawn = nearest >= 0
    shown = order[nearest[drawn]]
    light = 1.0 - _DARKER * (1.0 - points[shown, 2] / max(float(plan.top.max()), 1e-6))
    picture = np.zeros((len(nearest), 4))
    picture[drawn, :3] = _colours(paths)[line[shown]] * light[:, None]
    picture[drawn, 3] = 1.0
    pixels = picture.reshape(height, _FINER, width, _FINER, 4).mean(axis=(1, 3))
    pixels[..., :3] /= np.maximum(pixels[..., 3:], 1e-9)
    return _png(np.round(255.0 * pixels).astype(np.uint8))


def _some_layers(plan: PrintPlan, step: float) -> tuple[Toolpaths, float]:
    """Paths on as many layers as are drawn at once, the highest among them, and their distance."""
    paths = plan.paths
    every = int(np.ceil(paths.lengths.sum() / step / _MOST))
    numbers = np.unique(paths.layer)[::-1][:: max(every, 1)]
    gap = float(np.ptp(plan.top[numbers]) / max(len(numbers) - 1, 1))
    return paths.select(np.isin(paths.layer, numbers)), max(gap, float(plan.thickness.max()))


def _colours(paths: Toolpaths) -> FloatArray:
    """Colour (K, 3) of each path, 0 to 1."""
    kind = np.where(paths.closed, 0, 1)
    kind[paths.kind == FIBRE], kind[paths.kind == SUPPORT] = 2, 3
    table = [[int(text[k : k + 2], 16) / 255.0 for k in (1, 3, 5)] for text in LINE_COLOURS]
    return np.array(table)[kind]


def _png(pixels: NDArray[np.uint8]) -> bytes:
    """PNG of an (h, w, 4) array of colours and opacities (W3C, third edition)."""
    height, width, _ = pixels.shape

    def chunk(name: bytes, data: bytes) -> bytes:
        check = struct.pack(">I", zlib.crc32(name + data))
        return struct.pack(">I", len(data)) + name + data + check

    head = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    rows = np.column_stack([np.zeros(height, np.uint8), pixels.reshape(height, -1)])
    data = zlib.compress(rows.tobytes(), 6)
    start = b"\x89PNG\r\n\x1a\n"
    return start + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")
