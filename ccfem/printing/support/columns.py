"""The space below a part, as columns: between what hangs over and the part below it, or the bed.

H. Kipping, T. Schueppstuhl, Load-oriented nonplanar additive manufacturing method for optimized
continuous carbon fiber parts, Materials 16 (2023) 998, section 2.5, shift the cells that look down
to the bed and fill what they pass. Columns are that, and are exact on parts that stand on parts.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.printing.support.overhang import hanging_facets
from ccfem.slicing.layers.layer import plane_frame

_OFF = 0.381966
"""Where columns stand between lines of the grid: off the corners and edges of parts."""
_MOST = 5e7
"""Crossings above which a pitch is taken for a mistake of units."""


@dataclass(frozen=True)
class SupportColumns:
    """Support as upright columns on a square grid.

    Attributes
    ----------
    place : (k, 2) array, mm
        Axes of the columns, across the build direction.
    low, high : (k,) arrays, mm
        Ends along the build direction.
    on_part : (k,) bool array
        Columns that stand on the part, not on the bed.
    pitch : float, mm
        Distance of the columns.
    contact : float, mm^2
        Area of the part that rests on them.
    """

    place: FloatArray
    low: FloatArray
    high: FloatArray
    on_part: BoolArray
    pitch: float
    contact: float

    def __post_init__(self) -> None:
        freeze(self, place=float, low=float, high=float, on_part=bool)

    def __repr__(self) -> str:
        return f"SupportColumns: {self.volume:.4g} mm^3, {self.contact:.4g} mm^2 of the part on it"

    @property
    def volume(self) -> float:
        """Volume of all columns, mm^3."""
        return float((self.high - self.low).sum()) * self.pitch**2

    @property
    def standing(self) -> float:
        """Area on which columns stand on the part, mm^2, seen along the build direction."""
        return float(self.on_part.sum()) * self.pitch**2


def support_columns(
    mesh: TetMesh,
    build: Sequence[float] = (0.0, 0.0, 1.0),
    angle: float = 0.0,
    lift: float = 0.0,
    pitch: float = 0.25,
) -> SupportColumns:
    """Find the space below a part that has to be filled while it is printed.

    Parameters
    ----------
    build : sequence of 3 floats, default z
        Build direction.
    angle : float, degrees, default 0
        Faces that lean over by more than this, from upright, need support: with 0 all that look
        down, as for layers that continue below the part; flat layers carry about 45 themselves.
    lift : float, mm, default 0
        Height of the lowest point of the part above the bed.
    pitch : float, mm, default 0.25
        Distance of the columns.

    Raises
    ------
    InputError
        For an angle outside 0 to 90 degrees, a lift below 0, or a pitch that is not above 0.
    """
    check_number("angle", angle, at_least=0.0, below=90.0, unit="degrees")
    check_number("lift", lift, at_least=0.0, unit="mm")
    check_number("pitch", pitch, above=0.0, unit="mm")
    frame = plane_frame(tuple(build))
    turned = mesh.points @ frame.T
    bed = float(turned[np.unique(mesh.corners), 2].min()) - lift
    area, _, hanging = hanging_facets(mesh, frame, bed, angle, 1e-3 * pitch, 1e-9)
    grid = np.floor(turned[:, :2].min(axis=0) / pitch)
    facet, column, height = _crossings(turned[mesh.boundary], grid, pitch)
    order = np.lexsort((height, column[:, 1], column[:, 0]))
    facet, column, height = facet[order], column[order], height[order]
    above_part = np.zeros(len(facet), dtype=bool)
    above_part[1:] = (column[1:] == column[:-1]).all(axis=1)
    low = np.where(above_part, np.roll(height, 1), bed)
    filled = hanging[facet] & (height > low)
    place = (grid + column[filled] + _OFF) * pitch
    return SupportColumns(
        place, low[filled], height[filled], above_part[filled], pitch, float(area[hanging].sum())
    )


def _crossings(
    corners: FloatArray, grid: FloatArray, pitch: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Facet, column (c, 2) and height where columns pass through facets (f, 3, 3)."""
    flat = corners[:, :, :2] / pitch - grid - _OFF
    first = np.ceil(flat.min(axis=1)).astype(np.int64)
    count = np.maximum(np.floor(flat.max(axis=1)).astype(np.int64) - first + 1, 0)
    total = count.prod(axis=1)
    if total.sum() > _MOST:
        raise InputError(
            f"a pitch of {pitch:g} mm would make {float(total.sum()):.1g} columns on this part: "
            "give a larger pitch"
        )
    facet = np.repeat(np.arange(len(corners)), total)
    number = np.arange(len(facet)) - np.repeat(np.cumsum(total) - total, total)
    column = first[facet] + np.stack(np.divmod(number, np.maximum(count[facet, 1], 1)), axis=1)
    a, b, c = (flat[facet, k] for k in range(3))
    u, v, w = b - a, c - a, column - a
    twice = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    safe = np.where(twice == 0.0, 1.0, twice)
    second = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / safe
    third = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / safe
    inside = (twice != 0.0) & (second >= 0.0) & (third >= 0.0) & (second + third <= 1.0)
    facet, second, third = facet[inside], second[inside], third[inside]
    z = corners[facet, :, 2]
    height = z[:, 0] + second * (z[:, 1] - z[:, 0]) + third * (z[:, 2] - z[:, 0])
    return facet, column[inside], height
