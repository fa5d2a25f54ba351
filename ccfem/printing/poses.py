"""Direction of a head on curved layers: along their normal, as far as the machine can tilt.

Where it would touch printed material it leans, by the least angle that clears it.
"""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.errors import InputError
from ccfem.geometry.cones import earlier_in_cones
from ccfem.geometry.polylines import along_line
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import Toolpaths

_UP = np.array([0.0, 0.0, 1.0])


def poses(normals: FloatArray, build: FloatArray, machine: Machine) -> FloatArray:
    """Axes (n, 3) of the head above points with these normals: upright with three axes."""
    if machine.kinematics.kind == "three_axes":
        return np.tile(build, (len(normals), 1))
    return limited_tilt(normals, machine.kinematics.tilt_limit, build)


def limited_tilt(normals: FloatArray, limit: float, build: FloatArray = _UP) -> FloatArray:
    """Rotate directions (n, 3) that tilt from the build direction by more than a limit, degrees."""
    along = normals @ build
    aside = normals - along[:, None] * build
    size = np.linalg.norm(aside, axis=1)
    most = np.minimum(np.arctan2(size, along), np.radians(limit))
    aside /= np.maximum(size, 1e-300)[:, None]
    return np.asarray(aside * np.sin(most)[:, None] + np.cos(most)[:, None] * build)


def under_bed(tips: FloatArray, axes: FloatArray, machine: Machine) -> BoolArray:
    """Mask (n,) of tilted heads whose side reaches below the bed, the plane z = 0."""
    half = np.radians(machine.head_angle)
    lean = np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2])
    side = machine.head_length / np.cos(half) * np.cos(np.minimum(lean + half, np.pi))
    return np.asarray(tips[:, 2] + side < 0.0)


# Leaning where the head would touch printed material.


_LEANS = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0)
"""Angles, degrees, by which a head may lean from the normal of its layer. Our choice: about half
the angle at which its own side touches the layer (90 degrees less `Machine.head_angle`)."""
_TURNS = (0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0, 135.0, -135.0, 180.0)
"""Directions in which it leans, degrees from the direction away from the contact."""
_RAMP = 8.0
"""Length, mm, over which it leans and returns upright."""
_EVERY = 2.0
"""Distance, mm, between the places along a path at which contact is checked."""


@dataclass(frozen=True)
class Matter:
    """Points (n, 3), mm, that represent printed material, and their steps (n,), ascending."""

    points: FloatArray
    step: IntArray

    def __post_init__(self) -> None:
        freeze(self, points=float, step=int)

    @classmethod
    def of(cls, points: FloatArray, step: IntArray) -> "Matter":
        """Points in any order; those of step -1 are not printed."""
        order = np.argsort(step, kind="stable")
        order = order[step[order] >= 0]
        return cls(points[order], step[order])


@dataclass(frozen=True)
class Obstacles:
    """Printed material on the bed, in the order of layers and in the order of printing.

    Each of the s steps of the print has a layer.
    """

    by_layer: Matter
    by_step: Matter
    layer: IntArray

    def __post_init__(self) -> None:
        freeze(self, layer=int)


@dataclass(frozen=True)
class Cleared:
    """Axes of a head after leaning, and its remaining contact.

    Attributes
    ----------
    axes : (n, 3) array
        At every point of the paths.
    before, after : float, mm
        Length of the paths along which the head touches printed material, or the bed: with the
        given axes, and with these.
    place : (3,) array, mm, or None
        First place of remaining contact.
    """

    axes: FloatArray
    before: float
    after: float
    place: FloatArray | None = None


def cleared(paths: Toolpaths, axes: FloatArray, matter: Matter, machine: Machine) -> Cleared:
    """Let the head lean where it would touch material printed in earlier steps.

    Parameters
    ----------
    paths : Toolpaths
        In the coordinates of the printer; their `layer` is the step in which they are printed.
    axes : (n, 3) array
        Unit vectors along the head at every point of the paths.
    machine : Machine
        A head on three axes cannot lean.
    """
    sample, length, step = _samples(paths)
    tips = paths.points[sample]
    hits, point = _touched(tips, axes[sample], step, matter, machine)
    before = float(length[hits].sum())
    if machine.kinematics.kind == "three_axes" or not hits.any():
        return Cleared(axes, before, before, _first(tips, hits))
    off = _way_off(tips[hits], axes[sample][hits], point[hits], matter.points)
    turned = _turned(tips[hits], axes[sample][hits], off, step[hits], matter, machine)
    axes, old = _spread(paths, axes, sample[hits], turned), axes
    new = np.abs(axes - old).max(axis=1)[sample] > 0.0
    hits[new], _ = _touched(tips[new], axes[sample][new], step[new], matter, machine)
    return Cleared(axes, before, float(length[hits].sum()), _first(tips, hits))


def touched_length(paths: Toolpaths, axes: FloatArray, matter: Matter, machine: Machine) -> float:
    """Length of paths, mm, along which the head touches earlier steps or the bed, as `cleared`."""
    sample, length, step = _samples(paths)
    hits, _ = _touched(paths.points[sample], axes[sample], step, matter, machine)
    return float(length[hits].sum())


def _first(tips: FloatArray, hits: BoolArray) -> FloatArray | None:
    return tips[int(hits.argmax())] if hits.any() else None


def _samples(paths: Toolpaths) -> tuple[IntArray, FloatArray, IntArray]:
    """Points of the paths at about this distance, the length each stands for, and its step."""
    index, length = [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
    for start, end in zip(paths.offsets[:-1].tolist(), paths.offsets[1:].tolist(), strict=True):
        along = along_line(paths.points[start:end])
        cell = np.floor(along / _EVERY)
        first = np.flatnonzero(np.append(True, np.diff(cell) > 0.0))
        index.append(start + first)
        length.append(np.diff(np.append(along[first], along[-1])))
    chosen = np.concatenate(index)
    step = np.repeat(paths.layer, np.diff(paths.offsets))[chosen]
    return chosen, np.concatenate(length), step


def _touched(
    tips: FloatArray, axes: FloatArray, step: IntArray, matter: Matter, machine: Machine
) -> tuple[BoolArray, IntArray]:
    """Whether the head touches earlier steps, or the bed, and a point of the former, or -1."""
    size = (machine.head_angle, machine.head_length)
    point = earlier_in_cones(tips, axes, step, matter.points, matter.step, *size)
    return (point >= 0) | under_bed(tips, axes, machine), point


def _turned(
    tips: FloatArray,
    axes: FloatArray,
    off: FloatArray,
    step: IntArray,
    matter: Matter,
    machine: Machine,
) -> FloatArray:
    """Axes that clear by the least lean; axes without any are not changed."""
    across = np.cross(axes, off)
    left = np.ones(len(tips), dtype=bool)
    turned = axes.copy()
    limit = np.cos(np.radians(machine.kinematics.tilt_limit)) - 1e-9
    room = 90.0 - machine.head_angle
    for lean in np.radians([lean for lean in _LEANS if lean < room]):
        for turn in np.radians(_TURNS):
            way = np.cos(turn) * off[left] + np.sin(turn) * across[left]
            tried = np.cos(lean) * axes[left] + np.sin(lean) * way
            hits, _ = _touched(tips[left], tried, step[left], matter, machine)
            clear = (tried[:, 2] >= limit) & ~hits
            done = np.flatnonzero(left)[clear]
            turned[done] = tried[clear]
            left[done] = False
            if not left.any():
                return turned
    return turned


def _way_off(tips: FloatArray, axes: FloatArray, at: IntArray, points: FloatArray) -> FloatArray:
    """Direction normal to each axis, away from a point that the head touches; else upright."""
    way = np.where(at[:, None] >= 0, tips - points[np.maximum(at, 0)], [0.0, 0.0, 1.0])
    way -= np.einsum("kd,kd->k", way, axes)[:, None] * axes
    alike = np.linalg.norm(way, axis=1) < 1e-6
    way[alike] = np.cross(axes[alike], np.eye(3)[np.abs(axes[alike]).argmin(axis=1)])
    return np.asarray(way / np.linalg.norm(way, axis=1, keepdims=True))


def _spread(paths: Toolpaths, axes: FloatArray, at: IntArray, turned: FloatArray) -> FloatArray:
    """Axes at all points, which turn to those at some points and back along the paths."""
    spread = axes.copy()
    path = np.searchsorted(paths.offsets, at, side="right") - 1
    lean = turned - axes[at]
    for number in np.unique(path).tolist():
        start, end = int(paths.offsets[number]), int(paths.offsets[number + 1])
        along, on_path = along_line(paths.points[start:end]), path == number
        away = np.abs(along[:, None] - along[at[on_path] - start])
        if paths.closed[number]:
            away = np.minimum(away, along[-1] - away)
        # Full over the stretch that a sample stands for, then decreasing.
        share = np.clip(1.0 - np.maximum(away - _EVERY, 0.0) / _RAMP, 0.0, 1.0)
        total = np.maximum(share.max(axis=1), 1e-300)
        weight = share**4 / np.maximum((share**4).sum(axis=1), 1e-300)[:, None]
        spread[start:end] += total[:, None] * (weight @ lean[on_path])
    return np.asarray(spread / np.linalg.norm(spread, axis=1, keepdims=True))


def contact_words(touched: tuple[float, float, float], place: FloatArray | None) -> list[str]:
    """Say where the head touches what is printed, and what was done about it.

    Lengths, mm, are those layer by layer, in the order chosen, and as it leans.
    """
    level, ordered, after = touched
    if not level > 0.0 and not after > 0.0:
        return []
    done = f"{level:.0f} mm layer by layer, {ordered:.0f} mm in the order chosen"
    if place is None:
        return [f"the head would touch printed material along {done}, and nowhere when leaning"]
    x, y, z = place.tolist()
    return [
        f"the head touches printed material along {after:.0f} mm, first at X {x:.1f} Y {y:.1f} Z "
        f"{z:.1f} (without leaning {done}): choose other layers, a smaller "
        "machine.kinematics.tilt_limit, or watch it there"
    ]


def check_tilt(normals: FloatArray, machine: Machine) -> None:
    """Refuse layers that an upright head would touch with its side."""
    if machine.kinematics.kind != "three_axes" or not len(normals):
        return
    tilt = float(np.degrees(np.arccos(np.clip(normals[:, 2].min(), -1.0, 1.0))))
    room = 90.0 - machine.head_angle
    if tilt > room:
        raise InputError(
            f"layers tilt by up to {tilt:.0f} degrees, but an upright head with a half angle of "
            f"{machine.head_angle:g} degrees touches those above {room:g}: choose "
            "machine.kinematics.kind = 'table_table' or 'head_head', or flatter layers"
        )
