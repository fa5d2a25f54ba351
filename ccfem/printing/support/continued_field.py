"""The field of a part continued into the space below it, down to a flat bed.

Kipping and Schueppstuhl 2023 (Materials 16, 998), section 2.5, fill part and support at once, with
vectors that point up near the bed. Here the field of the part is held where it touches the support,
so that the support cannot bend the part's layers, and the bed has one value: layers end flat there
exactly, and no weights have to be chosen.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, freeze
from ccfem.fem.elasticity.assembly import cell_gradients
from ccfem.fem.elasticity.direct import superlu
from ccfem.printing.support.meshed_columns import ColumnMesh
from ccfem.slicing.guidance.bounded_gradient import Bounds, bounded
from ccfem.slicing.guidance.energies import gradient_energy

_RANGE = (0.2, 6.0)
"""Length of the gradient, in the part's, within which cells are turned up again."""


@dataclass(frozen=True)
class SupportField:
    """A field whose level surfaces are layers of the support.

    Attributes
    ----------
    values : (n,) array
        At the nodes of the columns; those of the part where they touch it.
    gradient : (m, 3) array, 1/mm
        In the cells.
    bed : float
        Value on the bed.
    inverted : float
        Share of the volume where layers lie upside down.
    """

    values: FloatArray
    gradient: FloatArray
    bed: float
    inverted: float

    def __post_init__(self) -> None:
        freeze(self, values=float, gradient=float)


def support_field(
    columns: ColumnMesh,
    part: FloatArray,
    slope: float,
    step: float,
    origin: float,
    most_inverted: float = 0.0,
) -> SupportField:
    """Continue the field of a part.

    Parameters
    ----------
    part : (p,) array
        Field at the nodes of the part.
    slope : float, 1/mm
        Mean length of its gradient: that of the support is as near to it as can be, upwards.
    step : float
        Of the value from layer to layer.
    origin : float
        Value of the lower side of a layer. The bed has this value, or one whole steps from it.
    most_inverted : float, default 0
        Where layers lie upside down in a larger share of the volume, the field is changed, as
        little as it takes, until they do not, or as far as that can be done.
    """
    mesh = columns.mesh
    cells, n, m = mesh.corners, len(mesh.points), len(mesh.cells)
    gradients = cell_gradients(mesh)
    matrix = gradient_energy(gradients, cells, mesh.volumes, n)
    rows = np.repeat(np.arange(3 * m).reshape(m, 1, 3), 4, axis=1)
    difference = sp.csr_array(
        (gradients.ravel(), (rows.ravel(), np.repeat(cells.ravel(), 3))), shape=(3 * m, n)
    )
    fall = sp.csr_array(difference.T * np.repeat(mesh.volumes, 3))
    held = np.zeros(n)
    above, stands = columns.node >= 0, columns.below[:, 0] >= 0
    held[stands] = np.einsum("kc,kc->k", columns.share[stands], part[columns.below[stands]])
    held[above] = part[columns.node[above]]
    fixed = above | stands | columns.on_bed
    on_bed = columns.on_bed & ~above & ~stands
    used = np.zeros(n, dtype=bool)
    used[cells] = True
    free = np.flatnonzero(used & ~fixed)
    solve_free = superlu(matrix[free][:, free]) if len(free) else None

    def solved(target: FloatArray, boundary: FloatArray) -> FloatArray:
        values = boundary.copy()
        if solve_free is not None:
            source = fall @ target.ravel() - matrix @ boundary
            values[free] = solve_free(source[free])
        return values

    target = np.broadcast_to(slope * columns.up, (m, 3))
    # The solution is linear in the value on the bed, whose best is that of a parabola.
    without = solved(target, held)
    lift = solved(np.zeros((m, 3)), on_bed.astype(np.float64))
    bed = origin
    if on_bed[used].any():
        stiff = float(lift @ (matrix @ lift))
        best = float(lift @ (fall @ target.ravel() - matrix @ without)) / max(stiff, 1e-300)
        bed = origin + step * round((best - origin) / step)
    boundary = held + bed * on_bed

    def field_of(aim: FloatArray) -> SupportField:
        values = solved(aim, boundary)
        gradient = (difference @ values).reshape(m, 3)
        down = gradient @ columns.up < 0.0
        inverted = float(mesh.volumes[down].sum() / mesh.volumes.sum())
        return SupportField(values, gradient, bed, inverted)

    bounds = Bounds(_RANGE[0] * slope, _RANGE[1] * slope, columns.up)
    return bounded(target, bounds, field_of, lambda field: field.inverted <= most_inverted)
