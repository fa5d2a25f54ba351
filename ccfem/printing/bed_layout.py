"""Where a part stands on the bed, how it is turned, and how many copies of it there are."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ccfem.base.arrays import FloatArray, freeze
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError, shown
from ccfem.base.plain import plain_dataclass
from ccfem.base.toml import from_table
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import plane_frame
from ccfem.slicing.layers.slicer import Vector

_MOST = 1000
"""Copies beyond which a number is a slip."""
_DIGITS = 12
"""Decimals of directions: a quarter of a turn leads exactly to another axis."""


@plain_dataclass
class BedLayout:
    """How a part is placed on the bed, in a part file the table ``[bed]``.

    Attributes
    ----------
    spin : float, degrees
        Turn about the vertical, counter-clockwise from above, from how the part stands by its
        build direction alone.
    centre : tuple of 2 floats, mm, optional
        Middle of the part on the bed, of all copies together where there are several; by default
        that of the bed, as far as there is room for what is printed beside them.
    copies : tuple of 1 or 2 ints
        How many, or how many along X and along Y: 1 to 1000 in all.
    """

    spin: float = 0.0
    centre: tuple[float, float] | None = None
    copies: tuple[int, ...] = (1,)

    def __post_init__(self) -> None:
        check_number("bed.turn", self.spin, unit="degrees")
        for value in self.centre or ():
            check_number("each number of bed.centre", value, unit="mm")
        for number in self.copies:
            check_number("bed.copies", number, at_least=1, at_most=_MOST)
        check_number("bed.copies", self.count, at_least=1, at_most=_MOST)

    @property
    def count(self) -> int:
        """Number of copies in all."""
        return int(np.prod(self.copies))

    def frame(self, upright: FloatArray) -> FloatArray:
        """Axes of the bed, as rows, of the `plane_frame` that the part stands in unturned."""
        return upright if not self.spin else _about("z", self.spin) @ upright


def spun(machine: Machine, spin: float) -> Machine:
    """Machine whose lines of matrix keep their direction on the bed below a part that is turned."""
    if not spin:
        return machine
    angle = (machine.gcode.matrix_angle - spin) % 360.0
    return replace(machine, gcode=replace(machine.gcode, matrix_angle=angle))


@dataclass(frozen=True)
class Place:
    """Where a part stands on the bed.

    Attributes
    ----------
    axes : (3, 3) array
        Rows are the axes of the bed in the frame of the mesh.
    origin : (3,) array, mm
        Corner of the bed, along these axes.
    spin : float, degrees
        As of `BedLayout`.
    """

    axes: FloatArray
    origin: FloatArray
    spin: float = 0.0

    def __post_init__(self) -> None:
        freeze(self, axes=float, origin=float)

    def on_bed(self, points: FloatArray) -> FloatArray:
        """Points (n, 3) of the mesh's frame on the bed."""
        return np.asarray(points @ self.axes.T - self.origin)

    def from_above(self, points: FloatArray) -> FloatArray:
        """X and Y on the bed, (n, 2), of points of the mesh's frame."""
        return np.asarray(points @ self.axes[:2].T - self.origin[:2])


AS_IT_STANDS = BedLayout()
"""One part in the middle of the bed, upright along its build direction."""


def turned(build: Sequence[float], turns: Sequence[str], spin: float = 0.0) -> tuple[Vector, float]:
    """Turn a part that stands on the bed about axes of the bed, one after the other.

    Parameters
    ----------
    build : 3 floats
        Build direction of the part before.
    turns : sequence of str
        Each ``AXIS=DEGREES``, as ``x=90``; by the right hand.
    spin : float, degrees
        Of the part before (`BedLayout.spin`).

    Returns
    -------
    build : tuple of 3 floats
        Build direction after, in the frame of the part.
    spin : float, degrees
        Above -180 and up to 180.

    Examples
    --------
    >>> turned((0.0, 0.0, 1.0), ["x=90"])
    ((0.0, 1.0, 0.0), 0.0)
    >>> turned((0.0, 0.0, 1.0), ["x=90", "z=37"])
    ((0.0, 1.0, 0.0), 37.0)
    """
    if not turns:
        x, y, z = build
        return (x, y, z), spin
    frame = BedLayout(spin).frame(plane_frame(build))
    for text in turns:
        frame = (_about(*axis_and_angle(text)) @ frame).round(_DIGITS) + 0.0
    upright = plane_frame(frame[2].tolist())
    cosine, sine = upright[0] @ frame[0], upright[0] @ frame[1]
    angle = round(float(np.degrees(np.arctan2(sine, cosine))), 9) + 0.0
    x, y, z = (upright[2] + 0.0).tolist()
    return (x, y, z), 180.0 if angle == -180.0 else angle


def _about(axis: str, angle: float) -> FloatArray:
    """Rotation about an axis by an angle in degrees, (3, 3)."""
    return np.asarray(Rotation.from_euler(axis, angle, degrees=True).as_matrix())


def axis_and_angle(text: str) -> tuple[str, float]:
    """Read a turn, ``x=90``, as an axis and its angle in degrees."""
    axis, equals, angle = text.replace(" ", "").lower().partition("=")
    try:
        degrees = float(angle)
    except ValueError:
        degrees = float("nan")
    if axis not in ("x", "y", "z") or not equals or not abs(degrees) <= 3600.0:
        raise InputError(f"a turn must be AXIS=DEGREES, as x=90; got {shown(text)}: write that")
    return axis, degrees


_COPIES = re.compile(r"\s*(\d{1,9})\s*(?:[xX*]\s*(\d{1,9})\s*)?")


def copies_of(given: int | str) -> tuple[int, ...]:
    """Read a number of copies, ``4``, or how many along X and Y, ``2x3``."""
    match = _COPIES.fullmatch(str(given))
    if match is None:
        raise InputError(
            f"copies must be their number, as 4, or how many along X and Y, as 2x3; got "
            f"{shown(given)}: write one of these"
        )
    return tuple(int(number) for number in match.groups() if number is not None)


@dataclass(frozen=True)
class BedTable:
    """The keys of a table ``[bed]``.

    Attributes
    ----------
    turn : str or tuple of str
        Turns about axes of the bed in degrees, as ``"z=37"``, one after the other. Those about X
        and Y change the build direction.
    centre : tuple of 2 floats, mm
        Middle of the part on the bed, of all copies together where there are several; by default
        that of the bed.
    copies : int or str
        How many are printed in one file, or how many along X and along Y, as ``"2x3"``.
    """

    turn: str | tuple[str, ...] = ()
    centre: tuple[float, float] | None = None
    copies: int | str | None = None


def bed_of(
    build: Sequence[float], table: object, base: BedLayout = AS_IT_STANDS
) -> tuple[Vector, BedLayout]:
    """Build direction and layout by a table ``[bed]``, which changes a base.

    Turns come after those that there are.
    """
    given = from_table(BedTable, table, "bed")
    turns = [given.turn] if isinstance(given.turn, str) else given.turn
    upward, spin = turned(build, turns, base.spin)
    copies = base.copies if given.copies is None else copies_of(given.copies)
    return upward, BedLayout(spin, given.centre or base.centre, copies)


def bed_table(layout: BedLayout) -> dict[str, object]:
    """Table ``[bed]`` that reads as a layout, beside its build direction; empty for the default."""
    table: dict[str, object] = {}
    if layout.spin:
        table["turn"] = f"z={layout.spin:.12g}"
    if layout.centre is not None:
        table["centre"] = list(layout.centre)
    if layout.copies != (1,):
        table["copies"] = "x".join(str(number) for number in layout.copies)
    return table
