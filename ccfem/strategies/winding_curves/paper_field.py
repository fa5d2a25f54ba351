"""The field of the paper: Fang et al. 2024, eq. 5 and 6.

The printed equations are incomplete. Here the gradient on triangles with a side on the cut or on a
hole points away from it, and the field is softly zero there: its level is otherwise undefined.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import check_fields
from ccfem.paths.fields.layer_elements import Surface, positive_definite
from ccfem.strategies.winding_curves.annulus import gradient_jumps

_EDGES = 3.0
"""Length over which gradients are compatible, in mean edges."""


@dataclass(frozen=True)
class PaperWeights:
    """Weights of eq. 5; the paper does not give them.

    Attributes
    ----------
    stress : float, default 1
        Of level lines along the stress.
    curves : float, default 1
        Of gradients of size 1 away from the cut and the holes.
    compatible : float, default 0.1
        Of equal gradients in neighbouring triangles.
    zero : float, default 1
        Of zero on the cut and the holes, by square mm round their points.
    """

    stress: float = 1.0
    curves: float = 1.0
    compatible: float = 0.1
    zero: float = 1.0

    def __post_init__(self) -> None:
        check_fields(self, "stress", at_least=0.0)
        check_fields(self, "curves", "compatible", "zero", above=0.0)


def paper_field(
    surface: Surface, tension: FloatArray, inner: IntArray, weights: PaperWeights
) -> FloatArray:
    """Solve for the field of the paper on a piece of a layer.

    Minimises ``stress sum_f A w (grad s . t)^2 + curves sum_c A |grad s - d|^2 +
    compatible l^2 sum_e (l_e / h_e) |jump of grad s|^2 + zero sum_v s^2 A_v / l^2`` over all
    triangles f, those c with a side on the curves, inner edges e and points v of the curves; d is
    the unit vector away from the curves, l three mean edges.

    Parameters
    ----------
    surface : Surface
        In space.
    tension : (t, 3, 3) array
        ``w t t^T`` with the direction t of the stress and its weight w.
    inner : (k,) int array
        Points on the holes and on the curves that join them.
    weights : PaperWeights

    Returns
    -------
    (n,) array
        In mm where its gradient has size 1.
    """
    on = np.zeros(len(surface.points), dtype=bool)
    on[inner] = True
    corners = on[surface.triangles]
    touching = corners.sum(axis=1) == 2
    frames, areas, t = surface.frames, surface.areas, surface.triangles
    # Of a function that is 0 on the curves and 1 at the other corners.
    away = np.einsum("ti,tid->td", np.where(corners, 0.0, 1.0), surface.gradients)
    away = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-300)
    sides = surface.points[t[:, [1, 2, 0]]] - surface.points[t]
    length = _EDGES * float(np.linalg.norm(sides, axis=2).mean())
    metric = weights.stress * np.einsum("tki,tij,tlj->tkl", frames, tension, frames)
    metric = metric + weights.curves * touching[:, None, None] * np.eye(2)
    matrix = surface.energy(areas[:, None, None] * metric).tocsr()
    matrix = matrix + weights.compatible * length**2 * gradient_jumps(surface)
    around = surface.lumped(np.ones(len(t)))
    matrix = matrix + sp.diags_array(np.where(on, weights.zero * around / length**2, 0.0))
    rhs = surface.source((weights.curves * areas * touching)[:, None] * away)
    free = np.flatnonzero(matrix.diagonal() > 0.0)
    field = np.zeros(len(on))
    if len(free):
        rows = sp.csr_array(sp.csr_array(matrix)[free, :])
        field[free] = positive_definite(rows[:, free]).solve(rhs[free])
    return field
