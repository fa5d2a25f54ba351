"""Nodes with axes of their own, and nodes that move together as a rigid body.

The displacement u of all nodes depends on that of the remaining nodes, q: ``u = T q``. A node with
axes F has ``u = F q``. A node of a rigid body has ``u = t + w x r``, with the translation t of its
centre and the rotation w. Each rigid body adds two nodes after those of the mesh: its translation,
and its rotation times the size of the body, which makes it a length. The nodes of the body itself
stay, but nothing depends on them.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Body:
    """A rigid body.

    Attributes
    ----------
    nodes : (k,) int array
        Nodes that move with it.
    centre : (3,) array, mm
    axes : (3, 3) array
        Axes of its translation and its rotation as columns.
    size : float, mm
        Factor on its rotation.
    """

    nodes: IntArray
    centre: FloatArray
    axes: FloatArray
    size: float


@dataclass(frozen=True)
class Ties:
    """Dependence of the displacement of all nodes on that of the remaining ones.

    Attributes
    ----------
    points : (n, 3) array, mm
    turned : (k,) int array
        Nodes with axes of their own.
    frames : (k, 3, 3) array
        Their axes as columns.
    bodies : tuple of Body
    """

    points: FloatArray
    turned: IntArray
    frames: FloatArray
    bodies: tuple[Body, ...] = ()

    @cached_property
    def count(self) -> int:
        """Number n' of remaining nodes, including those of rigid bodies."""
        return len(self.points) + 2 * len(self.bodies)

    @cached_property
    def slaves(self) -> BoolArray:
        """Which nodes (n,) move with a rigid body."""
        result = np.zeros(len(self.points), dtype=bool)
        for body in self.bodies:
            result[body.nodes] = True
        return result

    @cached_property
    def axes(self) -> FloatArray:
        """Axes (n, 3, 3) of every node, those of the space by default."""
        result = np.tile(np.eye(3), (len(self.points), 1, 1))
        result[self.turned] = self.frames
        return result

    @cached_property
    def matrix(self) -> sp.bsr_array:
        """T, (3 n, 3 n') with 3x3 blocks."""
        n = len(self.points)
        masters = np.flatnonzero(~self.slaves)
        rows, columns, blocks = [masters], [masters], [self.axes[masters]]
        for k, body in enumerate(self.bodies):
            arm = (self.points[body.nodes] - body.centre) / body.size
            count = len(body.nodes)
            rows += [body.nodes, body.nodes]
            columns += [np.full(count, n + 2 * k), np.full(count, n + 2 * k + 1)]
            # w x r = -r x w
            blocks += [np.tile(body.axes, (count, 1, 1)), -_cross(arm) @ body.axes]
        return _block_matrix(np.concatenate(rows), np.concatenate(columns), np.concatenate(blocks),
                       (n, self.count))  # fmt: skip

    def reduce(self, matrix: sp.bsr_array) -> sp.bsr_array:
        """Stiffness (3 n', 3 n') of the remaining nodes: ``T^T K T``."""
        reduced = (self.matrix.T.tobsr((3, 3)) @ (matrix @ self.matrix)).tobsr((3, 3))
        reduced.sort_indices()
        return reduced

    def gather(self, forces: FloatArray) -> FloatArray:
        """Gather forces (n, 3) to those (n', 3) on the remaining nodes."""
        return np.asarray(self.matrix.T @ forces.reshape(-1)).reshape(-1, 3)

    def expand(self, left: FloatArray) -> FloatArray:
        """Displacement (n, 3) of all nodes from that (n', 3) of the remaining ones."""
        return np.asarray(self.matrix @ left.reshape(-1)).reshape(-1, 3)

    def restrict(self, displacement: FloatArray) -> FloatArray:
        """Displacement (n', 3) of the remaining nodes from that (n, 3) of all nodes.

        A rigid body takes the motion nearest to that of its nodes.
        """
        local = np.einsum("nji,nj->ni", self.axes, displacement)
        local[self.slaves] = 0.0
        result = np.zeros((self.count, 3))
        result[: len(local)] = local
        dense = self.matrix.tocsr()
        for k, body in enumerate(self.bodies):
            first = len(local) + 2 * k
            rows = (3 * body.nodes[:, None] + np.arange(3)).reshape(-1)
            part = dense[rows][:, 3 * first : 3 * first + 6].toarray()
            motion = np.linalg.lstsq(part, displacement[body.nodes].reshape(-1), rcond=None)[0]
            result[first : first + 2] = motion.reshape(2, 3)
        return result

    def touched(self, held: BoolArray) -> BoolArray:
        """Mask (n,) of nodes on which held components (n', 3), or a rigid body, act."""
        return held[: len(self.points)].any(axis=1) | self.slaves

    def prolongation(self, ends: IntArray) -> sp.bsr_array:
        """From the corners of a quadratic mesh and the rigid bodies to all remaining nodes.

        Parameters
        ----------
        ends : (n, 2) int array
            The two corners of which each node is the midpoint; a corner is its own.

        Returns
        -------
        bsr_array (3 n', 3 n')
            Columns of midpoints are empty.
        """
        n = len(self.points)
        node = np.arange(n)
        halves = np.tile(0.5 * np.eye(3), (2 * n, 1, 1))
        middles = _block_matrix(np.repeat(node, 2), ends.reshape(-1), halves, (n, n))
        corner = (ends[:, 0] == node) & (ends[:, 1] == node)
        masters = np.flatnonzero(~self.slaves)
        bodies = n + np.arange(2 * len(self.bodies))
        kept = np.concatenate([np.flatnonzero(corner & ~self.slaves), bodies])
        pick = _block_matrix(kept, kept, np.tile(np.eye(3), (len(kept), 1, 1)), 2 * (self.count,))
        back = _block_matrix(
            masters, masters, np.swapaxes(self.axes[masters], 1, 2), (self.count, n)
        )
        rigid = _block_matrix(
            bodies, bodies, np.tile(np.eye(3), (len(bodies), 1, 1)), 2 * (self.count,)
        )
        return (back @ (middles @ (self.matrix @ pick)) + rigid).tobsr((3, 3))


def _cross(vectors: FloatArray) -> FloatArray:
    """Matrices (k, 3, 3) with ``matrix @ a = vector x a``."""
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


def _block_matrix(
    rows: IntArray, columns: IntArray, blocks: FloatArray, shape: tuple[int, int]
) -> sp.bsr_array:
    """Matrix of 3x3 blocks; those at one place are summed."""
    order = np.lexsort((columns, rows))
    indptr = np.searchsorted(rows[order], np.arange(shape[0] + 1))
    matrix = sp.bsr_array(
        (np.asarray(blocks[order]), columns[order], indptr), shape=(3 * shape[0], 3 * shape[1])
    )
    matrix.sum_duplicates()
    return matrix
