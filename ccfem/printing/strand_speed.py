"""Speed along a strand: slow at its start, in tight turns and corners, and behind its cut."""

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.geometry.polylines import along_line, points_along, turning_angles
from ccfem.machine.machine import Machine
from ccfem.machine.speeds import step_curvatures, table_speeds

_REACH = 2.0
"""Least length over which curvature is taken, in fibre widths; that of `ccfem.paths.linking`."""
_PIECES = 5
"""Pieces of the ramp from the start speed to the normal one."""
_SAME = 1e-3
_NEAR = 0.02
"""Places where the speed changes are moved to points of the strand that are nearer than this, mm:
rounded to 0.001 mm, a shorter step would turn anywhere."""


def strand_speeds(line: FloatArray, machine: Machine) -> tuple[FloatArray, FloatArray, float]:
    """Points of a strand, the speed of each of its steps, and where it is cut.

    Parameters
    ----------
    line : (n, 2) or (n, 3) array, mm
        At least as long as `Machine.tail`.
    machine : Machine

    Returns
    -------
    positions : (m,) array, mm
        Arc lengths, from 0 to the length of the line: its points and those where the speed changes.
    speeds : (m - 1,) array, mm/s
    cut : float, mm
        One of the positions, `Machine.tail` before the end.
    """
    process, along = machine.process, along_line(line)
    total = float(along[-1])
    cut = max(total - machine.tail, 0.0)
    normal, corners = _normal_speeds(line, machine)
    ramp = process.start_length + np.linspace(0.0, process.ramp_length, _PIECES + 1)
    breaks = [cut, *ramp.tolist()]
    for corner in along[corners].tolist():
        breaks += [corner - process.corner_length, corner + process.corner_length]
    positions = _joined(along, np.array(breaks))
    middle = 0.5 * (positions[1:] + positions[:-1])
    step = np.clip(np.searchsorted(along, middle) - 1, 0, len(normal) - 1)
    speeds = np.minimum(normal[step], machine.process.speed_limit or np.inf)
    if machine.speeds is None:
        bend = _bend_at(line, along, middle, _REACH * machine.fibre_width)
        speeds = np.minimum(speeds, _speed_of(bend, machine))
    slow = np.minimum(process.start_speed, speeds)
    if process.start_length > 0.0:
        behind = positions[:-1] - process.start_length
        share = np.clip(behind / max(process.ramp_length, _SAME), 0.0, 1.0)
        speeds = slow + np.where(behind < -_SAME, 0.0, share) * (speeds - slow)
    for corner in along[corners].tolist():
        reach = process.corner_length - _SAME
        near = (positions[:-1] < corner + reach) & (positions[1:] > corner - reach)
        speeds[near] = slow[near]
    tail = middle > cut
    speeds[tail] = np.minimum(speeds[tail], process.finish_speed)
    return positions, speeds, cut


def _normal_speeds(line: FloatArray, machine: Machine) -> tuple[FloatArray, BoolArray]:
    """Speed of each step by the table, or by the radius of turns; points that are corners."""
    process, ends = machine.process, np.array([0, len(line)])
    turn = np.degrees(turning_angles(line, ends, np.zeros(1, dtype=bool)))
    corner = turn > process.corner_angle
    reach = _REACH * machine.fibre_width
    if machine.speeds is not None:
        return table_speeds(line, ends, machine.speeds, reach)[:-1], corner
    return _speed_of(step_curvatures(line, ends, corner, reach), machine), corner


def _speed_of(bend: FloatArray, machine: Machine) -> FloatArray:
    """Speed by curvature, 1/mm, where there is no table."""
    process = machine.process
    slow, fast = min(process.start_speed, machine.fibre_speed), machine.fibre_speed
    with np.errstate(divide="ignore"):
        radius = 1.0 / bend
    least, most = machine.minimum_radius, process.bend_radius
    if most <= least:
        share = (radius >= least).astype(np.float64)
    else:
        share = np.clip((np.minimum(radius, most) - least) / (most - least), 0.0, 1.0)
    return np.asarray(slow + share * (fast - slow))


def _bend_at(line: FloatArray, along: FloatArray, at: FloatArray, reach: float) -> FloatArray:
    """Curvature of the circle through places on a line and those a reach before and behind."""
    a, b, c = (
        points_along(line, along, np.clip(at + off, 0.0, along[-1])) for off in (-reach, 0.0, reach)
    )
    u, v = b - a, c - b
    sizes = [np.linalg.norm(one, axis=1) for one in (u, v, c - a)]
    dot = np.einsum("ij,ij->i", u, v)
    across = np.sqrt(np.maximum((sizes[0] * sizes[1]) ** 2 - dot**2, 0.0))
    return np.asarray(2.0 * across / np.maximum(sizes[0] * sizes[1] * sizes[2], 1e-12))


def _joined(along: FloatArray, breaks: FloatArray) -> FloatArray:
    """Positions of points and breaks, none nearer to another than 0.02 mm."""
    total = along[-1]
    inner = breaks[(breaks > _SAME) & (breaks < total - _SAME)]
    near = np.searchsorted(along, inner)
    gap = np.minimum(inner - along[near - 1], along[np.minimum(near, len(along) - 1)] - inner)
    inner = np.sort(inner[gap > _NEAR])
    if len(inner):
        inner = inner[np.append(True, np.diff(inner) > _NEAR)]
    return np.sort(np.concatenate([along, inner]))
