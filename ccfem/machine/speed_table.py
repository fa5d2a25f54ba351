"""Fibre speed by curvature, length and angle of a path: table 2 of Wang et al. 2021."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.machine.ranges import check_ranges


@dataclass(frozen=True)
class SpeedTable:
    """Three speeds of the fibre, and the pieces of a path that each is for.

    The defaults are table 2 of Wang et al. 2021. A piece gets the lowest of the three speeds that
    its curvature, its length and its angle allow.

    Attributes
    ----------
    speed : tuple of 3 floats, mm/s
        Slow, middle and fast.
    curvature : tuple of 2 floats, 1/mm
        Slow above the first, fast below the second, middle in between.
    length : tuple of 2 floats, mm
        Slow below the first, fast above the second.
    angle : tuple of 2 floats, degrees
        Between a piece and its neighbour, 180 where the path goes straight on: slow below the
        first, fast from the second on. Paths are cut into pieces at angles below the second.
    """

    speed: tuple[float, float, float] = (7.0, 15.0, 35.0)
    curvature: tuple[float, float] = (0.2, 0.05)
    length: tuple[float, float] = (15.0, 25.0)
    angle: tuple[float, float] = (90.0, 135.0)

    def __post_init__(self) -> None:
        for name, size, order in (
            ("speed", 3, "rising numbers above 0"),
            ("curvature", 2, "falling numbers >= 0"),
            ("length", 2, "rising numbers >= 0"),
            ("angle", 2, "rising numbers from 0 to 180"),
        ):
            given = getattr(self, name)
            rising = np.asarray(given[::-1] if name == "curvature" else given, dtype=np.float64)
            good = rising.shape == (size,) and np.isfinite(rising).all()
            if good:
                good = (np.diff(rising) >= 0.0).all() and rising[0] >= 0.0
                good &= name != "speed" or rising[0] > 0.0
                good &= name != "angle" or rising[-1] <= 180.0
            if not good:
                raise InputError(
                    f"the speed table needs {size} {order} as {name}; got {list(given)}: "
                    "sort them, one a row of the table"
                )
        check_ranges(self)

    def at(self, curvature: ArrayLike, length: ArrayLike, angle: ArrayLike) -> FloatArray:
        """Speed, mm/s, of pieces of a path.

        Parameters
        ----------
        curvature : array_like, 1/mm
        length : array_like, mm
        angle : array_like, degrees
            Smallest angle to a neighbour.
        """
        length, angle = np.asarray(length), np.asarray(angle)
        by_length = 1 - (length < self.length[0]) + (length > self.length[1])
        by_angle = 1 - (angle < self.angle[0]) + (angle >= self.angle[1])
        row = np.minimum(np.minimum(by_length, by_angle), self.row_of(curvature))
        return np.asarray(self.speed)[row]

    def row_of(self, curvature: ArrayLike) -> IntArray:
        """Row of the table, 0 (slow) to 2 (fast), that each curvature, 1/mm, stands in."""
        given = np.asarray(curvature)
        row: IntArray = 1 - (given > self.curvature[0]) + (given < self.curvature[1])
        return row
