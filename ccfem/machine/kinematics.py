"""Axis values for a position and direction of the head on five axes, and back."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_choices
from ccfem.machine.ranges import check_ranges

_UPRIGHT = 1e-6
"""Sine of the tilt below which the second rotation is undefined, and is kept."""


@dataclass(frozen=True)
class Kinematics:
    """How a machine rotates head and part, in a part file ``[machine.kinematics]``.

    Attributes
    ----------
    kind : {"three_axes", "table_table", "head_head"}
        An upright head; a table that rotates about Z by C, on one that tilts about X by A
        (trunnion), under an upright head; or a head that tilts about Y by B, on one that rotates
        about Z by C.
    centre : tuple of 3 floats, mm
        On a table-table machine: where both axes meet.
    pivot : float, mm
        On a head-head machine: distance from where both axes meet to the tip of the nozzle.
    tilt_limit : float, degrees
        Largest tilt between head and part.
    """

    kind: Literal["three_axes", "table_table", "head_head"] = "three_axes"
    centre: tuple[float, float, float] = (150.0, 150.0, 0.0)
    pivot: float = 100.0
    tilt_limit: float = 60.0

    def __post_init__(self) -> None:
        check_choices(self)
        check_ranges(self)

    @property
    def letters(self) -> tuple[str, ...]:
        """Letters of the rotary axes."""
        return {"table_table": ("A", "C"), "head_head": ("B", "C")}.get(self.kind, ())


def axis_values(
    kinematics: Kinematics, place: FloatArray, normal: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Values of the axes for tips and directions, one after the other (inverse kinematics).

    Parameters
    ----------
    place : (n, 3) array, mm
        Tip of the nozzle, in the frame of the part as it lies on the bed.
    normal : (n, 3) array
        Unit vector from the tip along the head, in that frame.

    Returns
    -------
    linear : (n, 3) array, mm
        X, Y, Z; those of the tip where the head is upright and the table is at zero.
    turning : (n, 2) array, degrees
        A and C, or B and C: tilts from -180 to 180, C without jumps of more than a quarter of a
        turn, and kept where the head is upright. Both 0 with three axes.
    """
    if kinematics.kind == "three_axes":
        return place, np.zeros((len(place), 2))
    x, y, z = normal.T
    tilt = np.arctan2(np.hypot(x, y), z)
    spin = np.arctan2(x, y) if kinematics.kind == "table_table" else np.arctan2(y, x)
    turned = np.hypot(x, y) > _UPRIGHT
    index = np.maximum.accumulate(np.where(turned, np.arange(len(spin)), 0))
    first = int(np.argmax(turned)) if turned.any() else 0
    spin = np.where(turned.any(), spin[np.maximum(index, first)], 0.0)
    # C plus half a turn with the opposite tilt is the same pose: this avoids a turn at the pole.
    even = np.unwrap(spin, period=np.pi)
    tilt = np.where(np.round((even - spin) / np.pi) % 2.0 == 1.0, -tilt, tilt)
    spin = even
    if kinematics.kind == "table_table":
        centre = np.array(kinematics.centre)
        linear = _about_x(_about_z(place - centre, spin), tilt) + centre
    else:
        linear = place + kinematics.pivot * (normal - [0.0, 0.0, 1.0])
    return linear, np.degrees(np.column_stack([tilt, spin]))


def _about_x(points: FloatArray, angle: FloatArray) -> FloatArray:
    x, y, z = points.T
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.column_stack([x, cosine * y - sine * z, sine * y + cosine * z])


def _about_z(points: FloatArray, angle: FloatArray) -> FloatArray:
    x, y, z = points.T
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.column_stack([cosine * x - sine * y, sine * x + cosine * y, z])
