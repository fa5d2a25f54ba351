"""Equal values of a field within groups of nodes: the paper's term for the joints."""

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray


def slabs(
    points: FloatArray, nodes: IntArray, direction: FloatArray, height: float
) -> tuple[IntArray, int]:
    """Group nodes by slabs normal to a direction; return each node's group and their number.

    Parameters
    ----------
    points : (n, 3) array, mm
    nodes : (k,) int array
    direction : (3,) array
    height : float, mm
        Of a slab; infinite for one group of all.
    """
    along = points[nodes] @ direction
    slab = np.zeros(len(nodes), dtype=np.int64)
    if np.isfinite(height):
        slab = np.floor((along - along.min()) / height).astype(np.int64)
    _, group = np.unique(slab, return_inverse=True)
    return group, int(group.max()) + 1


def equal_value_energy(
    nodes: IntArray, group: IntArray, weight: float, first: int, n: int
) -> sp.csr_array:
    """Matrix of ``weight / N sum_groups sum_v (G_v - M_group)^2`` (Fang et al. 2024, eq. 3).

    The values M of the groups are unknowns after those of the nodes. At the minimum they are the
    means of their groups; the matrix stays sparse.

    Parameters
    ----------
    nodes : (k,) int array
    group : (k,) int array
        Of each node.
    weight : float
        Of all N nodes together, mm.
    first : int
        Index of the first group among the unknowns.
    n : int
        Number of unknowns.
    """
    rows = np.repeat(np.arange(len(nodes)), 2)
    columns = np.stack([nodes, first + group], axis=1).ravel()
    values = np.tile([1.0, -1.0], len(nodes))
    away = sp.coo_array((values, (rows, columns)), shape=(len(nodes), n)).tocsr()
    return sp.csr_array(weight / len(nodes) * (away.T @ away))
