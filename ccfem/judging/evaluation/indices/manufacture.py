"""How much fibre there is, in how many pieces, and how long it takes to print."""

from dataclasses import dataclass, replace

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import arc_lengths
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, PlanePaths
from ccfem.machine.machine import Machine
from ccfem.paths.linking.print_order import nearest_end_order, step_speeds
from ccfem.paths.toolpaths import FIBRE, TRAVEL, Toolpaths

PLACE = 10
"""Of these columns in tables: the smaller, the farther to the left."""

BY_PATHS = True
"""Equal paths in equal sections have the same samples."""


_LENGTH = ">= 0; NaN without fibre"
_SHARE = "0 to 1, 1 is best; NaN without fibre"

COLUMNS = (
    Column("fibre_length", "mm", "Sum of the lengths of the fibre paths.", ">= 0"),
    Column("paths", "1", "Number of fibre paths that have a length.", ">= 0"),
    Column("cuts", "1", "Number of cuts of the fibre: one at the end of every path.", ">= 0"),
    Column("length_min", "mm", "Length of the shortest fibre path.", _LENGTH),
    Column("length_median", "mm", "Median length of the fibre paths.", _LENGTH),
    Column("length_max", "mm", "Length of the longest fibre path.", _LENGTH),
    Column(
        "long_enough_count",
        "1",
        "Share of the number of fibre paths that are at least as long as the machine's minimum.",
        _SHARE,
    ),
    Column(
        "long_enough_length",
        "1",
        "Share of the fibre's length that lies in paths at least as long as the machine's minimum.",
        _SHARE,
    ),
    Column(
        "print_time",
        "s",
        "Length of each step of the paths over its speed (by the machine's speed table for fibre, "
        "else the speed of its kind), plus the straight way from the end of each path to the "
        "start of the next one of its layer over the travel speed. Slow starts, corners and ends "
        "of strands, fibre fed before them, cuts, lifts, acceleration, tool changes with their "
        "heating, and paths not given (such as matrix) are not counted: the head of a G-code file "
        "(--gcode) states the time of the whole print.",
        ">= 0",
    ),
    Column(
        "print_time_nearest",
        "s",
        "As print_time, with the paths of a layer in another order and walked from either end: "
        "from the end of each on to the nearest end of another one. Where a print is planned: the "
        "time of the fibre's tool in its file, waits for heat left out.",
        ">= 0",
    ),
    Column(
        "fibre_mass",
        "g",
        "Length of the fibre times the filament's mass per length (fibre_tex of the machine, else "
        "area and density). Where a print is planned: what its file states, fibre fed beside the "
        "part included.",
        ">= 0",
    ),
    Column(
        "matrix_length",
        "mm",
        "Length of a line of matrix, matrix width times matrix height, that fills what fibre and "
        "sparse infill leave of the part.",
        ">= 0; infinite where the machine gives the line no area",
    ),
    Column(
        "matrix_mass",
        "g",
        "Volume that fibre and sparse infill leave of the part times the density of the matrix. "
        "Where a print is planned: what its file states.",
        ">= 0",
    ),
    Column(
        "mean_speed",
        "mm/s",
        "Length of the fibre paths over the time that they take, ways between them left out.",
        ">= 0; NaN without fibre",
    ),
)

_ROUNDING = 1e-6
"""A path short of the minimum length by no more than this share of it is long enough."""


@dataclass(frozen=True)
class ManufactureSamples:
    """Lengths (k,), mm, of fibre paths; times (1,), s, and volume (1,), mm^3, of a layer."""

    length: FloatArray
    seconds: FloatArray
    fibre_seconds: FloatArray
    nearest_seconds: FloatArray
    volume: FloatArray


def sample_manufacture(
    paths: PlanePaths, toolpaths: Toolpaths, machine: Machine
) -> ManufactureSamples:
    """Lengths of the fibre paths of a layer, and the time that all its paths take.

    Parameters
    ----------
    toolpaths : Toolpaths
        Every path of the same layer, of all kinds, in the order of printing.
    """
    drawn = toolpaths.select(toolpaths.kind != TRAVEL)
    starts, ends = drawn.points[drawn.offsets[:-1]], drawn.points[drawn.offsets[1:] - 1]
    ways = float(np.linalg.norm(starts[1:] - ends[:-1], axis=1).sum())
    # Explicit travel paths replace straight travel moves.
    travel = toolpaths.of_kind(TRAVEL)
    ways = float(travel.lengths.sum()) if len(travel) else ways
    fibre, others = (drawn.select(wanted) for wanted in (drawn.kind == FIBRE, drawn.kind != FIBRE))
    along = _duration(*_steps(fibre, machine))
    seconds = along + _duration(*_steps(others, machine)) + _duration(ways, machine.travel_speed)
    _, _, jumps = nearest_end_order(starts, ends)
    nearest = along + _duration(*_steps(others, machine)) + _duration(jumps, machine.travel_speed)
    layer = paths.layer
    return ManufactureSamples(
        paths.lengths,
        np.array([seconds]),
        np.array([along]),
        np.array([nearest]),
        np.array([float(layer.areas.sum()) * layer.thickness]),
    )


def _steps(toolpaths: Toolpaths, machine: Machine) -> tuple[FloatArray, FloatArray]:
    """Length, mm, and speed, mm/s, of the step that ends at each point."""
    speed = step_speeds(toolpaths, machine)
    length = np.diff(arc_lengths(toolpaths.points, toolpaths.offsets), prepend=0.0)
    length[toolpaths.offsets[:-1]] = 0.0
    return length, np.roll(speed, 1)


def _duration(length: FloatArray | float, speed: FloatArray | float) -> float:
    """Time, s; a speed of 0 takes forever unless there is nothing to draw."""
    length, speed = np.broadcast_arrays(np.atleast_1d(length), np.atleast_1d(speed))
    needed = length > 0.0
    if (speed[needed] == 0.0).any():
        return float("inf")
    return float((length[needed] / speed[needed]).sum())


def manufacture_indices(
    samples: ManufactureSamples, machine: Machine, filled: float = 1.0
) -> dict[str, float]:
    """Values of `COLUMNS`, of a part of which a share is filled."""
    length = samples.length
    total = float(length.sum())
    quantiles = np.quantile(length, [0.0, 0.5, 1.0]) if len(length) else np.full(3, np.nan)
    enough = length >= machine.shortest_strand * (1.0 - _ROUNDING)
    matrix = max(filled * float(samples.volume.sum()) - machine.filament_area * total, 0.0)
    line = machine.matrix_width * machine.matrix_height
    return {
        "fibre_length": total,
        "paths": float(len(length)),
        "cuts": float(len(length)),
        "length_min": float(quantiles[0]),
        "length_median": float(quantiles[1]),
        "length_max": float(quantiles[2]),
        "long_enough_count": float(enough.mean()) if len(length) else np.nan,
        "long_enough_length": float(length[enough].sum()) / total if len(length) else np.nan,
        "print_time": float(samples.seconds.sum()),
        "print_time_nearest": float(samples.nearest_seconds.sum()),
        "fibre_mass": machine.fibre_mass_per_length * total,
        "matrix_length": matrix / line if line > 0.0 else float("inf"),
        "matrix_mass": 1e-3 * machine.matrix_density * matrix,
        "mean_speed": total / float(samples.fibre_seconds.sum()) if total else np.nan,
    }


def sample(paths: LayerPaths) -> ManufactureSamples:
    """Take the samples of one layer; on a curved one the lengths are those in space."""
    samples = sample_manufacture(paths.plane, paths.toolpaths, paths.machine)
    if paths.layer.flat is not None:
        return samples
    return replace(samples, length=paths.fibre.lengths[paths.fibre.lengths > 0.0])


def indices(samples: ManufactureSamples, basis: Basis) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    return manufacture_indices(samples, basis.machine, basis.filled)
