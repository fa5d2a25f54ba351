"""Room: how much of the fibre lies on other fibre, over it, outside the part, or on nothing."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.geometry.beads import beads
from ccfem.geometry.polylines import sample_midpoints
from ccfem.geometry.shapes import INSIDE, VOID, Region, section_places
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, PlanePaths
from ccfem.judging.virtual_testing.strand_room import width_inside
from ccfem.machine.machine import Machine

PLACE = 80
"""Of these columns in tables: the smaller, the farther to the left."""

BY_PATHS = True
"""Equal paths in equal sections have the same samples."""


_BANDS = (
    "a strand is a band one fibre width wide; links outside the section or over a void are left out"
)
_NONE = "NaN without fibre"

_DECIMALS = 9
"""Decimals of numbers of strands and fractions: values that differ less are the same."""

COLUMNS = (
    Column(
        "on_fibre",
        "1",
        "Share of the fibre that lies on other fibre of its layer and about its direction, within "
        "30 degrees: where m such bands overlap, (m - 1)/m of them. It adds no stiffness in the "
        f"virtual test ({_BANDS}).",
        f"0 to 1, 0 is best; {_NONE}",
    ),
    Column(
        "across_fibre",
        "1",
        "Share of the fibre that lies on other fibre of its layer and crosses it at more than 30 "
        "degrees: the layer is higher there.",
        f"0 to 1, 0 is best; {_NONE}",
    ),
    Column(
        "overlap_area",
        "mm^2",
        f"Area of the bands of all strands less that of their union ({_BANDS}).",
        ">= 0, 0 is best",
    ),
    Column(
        "stack_99",
        "1",
        "Number of strands above each other that 99 % of the fibre's length stays at or below.",
        f">= 1, 1 is best; {_NONE}",
    ),
    Column(
        "fibre_fraction",
        "1",
        "Volume of the fibre whose band lies in the section over the volume of the part's layers.",
        "0 to 1",
    ),
    Column(
        "fibre_fraction_99",
        "1",
        "Fibre volume fraction that 99 % of the fibre's length stays at or below: strands above "
        "each other times filament area, over fibre width times height of the layer.",
        f">= 0, above 1 it does not fit; {_NONE}",
    ),
    Column(
        "outside_width",
        "1",
        f"Share of the bands' area that lies outside the section of their layer ({_BANDS}).",
        f"0 to 1, 0 is best; {_NONE}",
    ),
    Column(
        "free_span",
        "mm",
        "Longest run of fibre axis with nothing to lie on: outside the section of its layer, or "
        "more than half a width outside that of the layer below. Links beyond the outer border are "
        "left out, since they are laid beside the part and cut off.",
        ">= 0, 0 is best",
    ),
    Column("free_length", "mm", "Length of all such runs (see free_span).", ">= 0, 0 is best"),
    Column(
        "out_of_order",
        "1",
        "Number of fibre paths that come after one of a higher layer.",
        ">= 0, 0 is best",
    ),
)


@dataclass(frozen=True)
class RoomSamples:
    """What the strands of a layer have of room, part by part, and unsupported runs."""

    length: FloatArray  # (1,), mm: of the fibre
    # (1,), mm: length that lies on other fibre of its direction, across other fibre, and, by the
    # width of the strand, outside the section
    on: FloatArray
    across: FloatArray
    outside: FloatArray
    # (a,), 1 and mm: numbers of strands above each other, and the length with each
    stack: FloatArray
    stack_length: FloatArray
    # (b,), 1 and mm: fibre volume fractions, and the length with each
    fraction: FloatArray
    fraction_length: FloatArray
    free: FloatArray  # (f,), mm: lengths of the runs that lie on nothing
    overlap: FloatArray  # (1,), mm^2: area of all bands less that of their union
    # (1,), mm^3: of the fibre in the section, and of the part that the layer stands for
    fibre: FloatArray
    volume: FloatArray
    late: FloatArray  # (1,): number of paths printed after one of a higher layer

    with_length: ClassVar[dict[str, str]] = {"stack": "stack_length", "fraction": "fraction_length"}


def sample_room(
    paths: PlanePaths, machine: Machine, below: Region | None = None, late: int = 0
) -> RoomSamples:
    """Find the room of the strands of a layer.

    Parameters
    ----------
    below : shapely (Multi)Polygon, optional
        What is under it; by default all of it lies on something.
    late : int
        Number of paths printed after one of a higher layer.
    """
    layer, width = paths.layer, machine.fibre_width
    lines = paths.in_part
    flat = np.column_stack([lines.points, np.zeros(len(lines.points))])
    up = np.broadcast_to([0.0, 0.0, 1.0], flat.shape)
    same = np.zeros(len(lines), dtype=np.int64)
    room = beads(flat, up, lines.offsets, lines.closed, same, width, machine.strand_height)
    inside = width_inside(room.middle[:, :2], room.direction[:, :2], width, layer.plane.polygon)
    height = max(layer.thickness, 1e-300)
    fraction = room.fill * machine.filament_area / (width * height)

    def with_it(share: FloatArray) -> FloatArray:
        return np.array([float(room.length @ share)])

    return RoomSamples(
        np.array([float(room.length.sum())]),
        with_it(1.0 - room.alone),
        with_it(room.alone - room.every),
        with_it(1.0 - inside),
        *_lengths_of(room.stack, room.length),
        *_lengths_of(fraction, room.length),
        _free_runs(paths, 0.5 * width, below),
        width * with_it(1.0 - room.every),
        machine.filament_area * with_it(inside),
        np.array([float(layer.areas.sum()) * layer.thickness]),
        np.array([float(late)]),
    )


def _lengths_of(values: FloatArray, length: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the different values, to rounding, and the length with each."""
    different, number = np.unique(values.round(_DECIMALS), return_inverse=True)
    return different, np.bincount(number, length, len(different)).astype(np.float64)


def _free_runs(paths: PlanePaths, reach: float, below: Region | None) -> FloatArray:
    """Lengths of the runs of fibre that lie on nothing."""
    strands = _runs(paths.strands, reach, below, False)
    if not paths.link.any():
        return strands
    links = replace(paths, link=~paths.link).strands
    return np.concatenate([strands, _runs(links, reach, below, True)])


def _runs(paths: PlanePaths, reach: float, below: Region | None, link: bool) -> FloatArray:
    points, _, length, line = sample_midpoints(paths.points, paths.offsets, reach)
    if not len(points):
        return np.zeros(0)
    place = section_places(points, paths.layer.plane.polygon)
    free: BoolArray = place == VOID if link else place != INSIDE
    if below is not None:
        wider = below.buffer(reach)
        shapely.prepare(wider)
        hangs = ~shapely.intersects_xy(wider, *np.ascontiguousarray(points.T))
        free |= hangs & (place == INSIDE)
    begins = free & ~np.concatenate([[False], free[:-1] & (line[1:] == line[:-1])])
    run = np.cumsum(begins)[free] - 1
    return np.asarray(np.bincount(run, length[free], int(begins.sum())), dtype=np.float64)


def room_indices(samples: RoomSamples, _: Basis | None = None) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    total = float(samples.length.sum())

    def share(length: FloatArray) -> float:
        return float(length.sum()) / total if total > 0.0 else float("nan")

    def most(values: FloatArray, length: FloatArray) -> float:
        if not total > 0.0:
            return float("nan")
        return float(np.quantile(values, 0.99, weights=length, method="inverted_cdf"))

    volume = float(samples.volume.sum())
    return {
        "on_fibre": share(samples.on),
        "across_fibre": share(samples.across),
        "overlap_area": float(samples.overlap.sum()),
        "stack_99": most(samples.stack, samples.stack_length),
        "fibre_fraction": float(samples.fibre.sum()) / volume if volume > 0.0 else float("nan"),
        "fibre_fraction_99": most(samples.fraction, samples.fraction_length),
        "outside_width": share(samples.outside),
        "free_span": float(samples.free.max(initial=0.0)),
        "free_length": float(samples.free.sum()),
        "out_of_order": float(samples.late.sum()),
    }


def sample(paths: LayerPaths) -> RoomSamples:
    """Take the samples of one layer."""
    return sample_room(paths.plane, paths.machine, paths.below, paths.late)


indices = room_indices
