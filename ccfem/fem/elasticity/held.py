"""Held components of a displacement, and the reduced equations."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.fem.elasticity.tied_faces import TiedNodes

# Nodes with axes of their own, and nodes that move together as a rigid body.
#
# The displacement u of all nodes depends on that of the remaining nodes, q: ``u = T q``. A node
# with axes F has ``u = F q``. A node of a rigid body has ``u = t + w x r``, with the translation t
# of its centre and the rotation w. Each rigid body adds two nodes after those of the mesh: its
# translation, and its rotation times the size of the body, which makes it a length. The nodes of
# the body itself stay, but nothing depends on them. A node that is tied to a face has
# ``u = P F q + (1 - P) sum w u_k``: P is onto what supports hold there, and the nodes k of the face
# may be tied or rigid themselves.

_CASCADE = 10
"""How often ties are followed, twice as far each time, before they must end."""
_NOTHING = 1e-12
"""Share of a displacement that counts as rounding."""


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
    tied : TiedNodes, optional
        Nodes that follow a face.
    """

    points: FloatArray
    turned: IntArray
    frames: FloatArray
    bodies: tuple[Body, ...] = ()
    tied: TiedNodes | None = None

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
        along = _block_matrix(np.concatenate(rows), np.concatenate(columns),
                              np.concatenate(blocks), (n, self.count))  # fmt: skip
        return along if self._follow is None else (self._follow @ along).tobsr((3, 3))

    @cached_property
    def _follow(self) -> sp.bsr_array | None:
        """Matrix (3n, 3n) that gives tied nodes the displacement of what they are tied to."""
        tied, n = self.tied, len(self.points)
        if tied is None:
            return None
        others = np.setdiff1d(np.arange(n), tied.nodes)
        axes = self.axes[tied.nodes]
        rotated = np.einsum("kij,kj,klj->kil", axes, tied.held, axes)
        shares = tied.weights[:, :, None, None] * (np.eye(3) - rotated)[:, None]
        rows = [others, tied.nodes, np.repeat(tied.nodes, tied.leaders.shape[1])]
        columns = [others, tied.nodes, tied.leaders.reshape(-1)]
        blocks = [np.tile(np.eye(3), (len(others), 1, 1)), rotated, shares.reshape(-1, 3, 3)]
        result = _block_matrix(
            np.concatenate(rows), np.concatenate(columns), np.concatenate(blocks), (n, n)
        )
        # What tied nodes would do by themselves must not reach any node in the end.
        rest = _block_matrix(tied.nodes, tied.nodes, np.eye(3) - rotated, (n, n))
        for _ in range(_CASCADE):
            if abs(result @ rest).max() <= _NOTHING:
                return result
            result = (result @ result).tobsr((3, 3))
        raise InputError(
            "tied patches are tied to each other in a circle: tie each to one that is not tied"
        )

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
        held = held[: len(self.points)].copy()
        if self.tied is not None:
            held[self.tied.nodes] = self.tied.held
        return held.any(axis=1) | self.slaves

    def carried(self, forces: FloatArray) -> FloatArray:
        """Move forces (n, 3) on tied nodes to what they are tied to."""
        if self._follow is None:
            return forces
        return np.asarray(self._follow.T @ forces.reshape(-1)).reshape(-1, 3)

    def prolongation(self, ends: IntArray) -> sp.bsr_array:
        """From the corners of a quadratic mesh and the rigid bodies to all remaining nodes.

        A node is the midpoint of two `ends` (n, 2); a corner is its own. Columns of midpoints are
        empty.
        """
        n = len(self.points)
        node = np.arange(n)
        halves = np.tile(0.5 * np.eye(3), (2 * n, 1, 1))
        middles = _block_matrix(np.repeat(node, 2), ends.reshape(-1), halves, (n, n))
        corner = (ends[:, 0] == node) & (ends[:, 1] == node)
        leads = ~self.slaves
        if self.tied is not None:
            leads[self.tied.nodes] = False
        masters = np.flatnonzero(leads)
        bodies = n + np.arange(2 * len(self.bodies))
        kept = np.concatenate([np.flatnonzero(corner & leads), bodies])
        pick = _block_matrix(kept, kept, np.tile(np.eye(3), (len(kept), 1, 1)), 2 * (self.count,))
        back = _block_matrix(
            masters, masters, np.swapaxes(self.axes[masters], 1, 2), (self.count, n)
        )
        rigid = _block_matrix(
            bodies, bodies, np.tile(np.eye(3), (len(bodies), 1, 1)), 2 * (self.count,)
        )
        result = back @ (middles @ (self.matrix @ pick)) + rigid
        if self.tied is not None:  # corners follow midpoints, which follow other corners
            result = back @ (middles @ (self.matrix @ result)) + rigid
        return result.tobsr((3, 3))


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


_BED = 1e-11
"""Stiffness, over the mean of the diagonal, that a lifted-off component keeps, so that a part that
nothing presses any more has a solution; the force it carries is checked."""

_PULLS = 1e-6
"""Force of a support that pulls, over the largest force, that counts as rounding error."""

_SINKS = 1e-7
"""Displacement into a support, over the largest displacement, that counts as rounding error."""


def rigid_modes(points: FloatArray) -> FloatArray:
    """Displacements (3n, 6) of points (n, 3) in the three translations and three rotations."""
    x, y, z = points.T
    modes = np.zeros((len(points), 3, 6))
    modes[:, [0, 1, 2], [0, 1, 2]] = 1.0
    modes[:, 1, 3], modes[:, 2, 3] = -z, y
    modes[:, 2, 4], modes[:, 0, 4] = -x, z
    modes[:, 0, 5], modes[:, 1, 5] = -y, x
    return modes.reshape(-1, 6)


@dataclass(frozen=True)
class Held:
    """Which components are held, and at which values; in the plane each node has two components.

    Attributes
    ----------
    free : (n, 3) bool array
        Components that the solve finds.
    value : (n, 3) array, mm
        Values of held components; zero elsewhere.
    nodes : (k,) int array
        Nodes with at least one free component: the rows of the reduced matrix.
    ties : Ties, optional
        Where nodes have axes of their own, or move together as a rigid body. Then `free`, `value`
        and `nodes` refer to the nodes that the ties leave, along their axes.
    presses : (n, 3) bool array, optional
        Components that may move back, below zero, but not forth. Those in contact are not free.
    """

    free: BoolArray
    value: FloatArray
    nodes: IntArray
    ties: Ties | None = None
    presses: BoolArray | None = None

    @cached_property
    def _pressing(self) -> tuple[IntArray, IntArray, FloatArray]:
        """Node, component and axis (3,) of all pressing components."""
        assert self.presses is not None
        assert self.ties is not None
        node, component = np.nonzero(self.presses)
        return node, component, self.ties.axes[node, :, component]

    def along_pressing(self, vectors: FloatArray) -> FloatArray:
        """Components (k,) of nodal vectors (n, 3) along the pressing axes, out of the part."""
        node, _, axis = self._pressing
        return np.einsum("ki,ki->k", axis, vectors[node])

    @property
    def contact(self) -> BoolArray:
        """Mask (k,) of the pressing components that are in contact."""
        node, component, _ = self._pressing
        return ~self.free[node, component]

    def with_contact(self, contact: BoolArray) -> "Held":
        """Return the same supports in another contact (k,)."""
        node, component, _ = self._pressing
        free = self.free.copy()
        free[node, component] = ~contact
        return replace(self, free=free)

    def touching(self, displacement: FloatArray) -> "Held":
        """Return the same supports with the contact of a solution (n, 3), mm."""
        if self.presses is None:
            return self
        back = -1e-12 * float(np.abs(displacement).max())
        return self.with_contact(self.along_pressing(displacement) >= back)

    def following(self, displacement: FloatArray, reactions: FloatArray) -> "Held":
        """Contact that follows from a displacement, mm, and reactions, N, (n, 3); self if the same.

        Components that pull are released, those that sink in are held: the primal-dual active set
        method (Hintermueller, Ito and Kunisch, SIAM J. Optimization 13, 2002, 865-888).
        """
        if self.presses is None:
            return self
        before = self.contact
        pulls, sinks = self.along_pressing(reactions), self.along_pressing(displacement)
        pulled = pulls > _PULLS * np.abs(pulls[before]).max(initial=0.0)
        sunk = sinks > _SINKS * float(np.abs(displacement).max())
        after = np.where(before, ~pulled, sunk)
        return self if (after == before).all() else self.with_contact(after)

    def at(self, value: FloatArray) -> "Held":
        """Return the same held components at other values (n, 3), mm."""
        return replace(self, value=value)

    @property
    def unknowns(self) -> int:
        """Free components."""
        return int(self.free.sum())

    def reduce(self, matrix: sp.bsr_array) -> sp.bsr_array:
        """Return the matrix (3k, 3k) of the nodes that can move.

        Held components of such nodes keep a row with nothing but a diagonal entry, as large as
        the mean one.
        """
        if self.ties is not None:
            matrix = self.ties.reduce(matrix)
        (n, d), k = self.free.shape, len(self.nodes)
        place = np.full(n, -1, dtype=np.int32)
        place[self.nodes] = np.arange(k, dtype=np.int32)
        row = np.repeat(place, np.diff(matrix.indptr))
        column = place[matrix.indices]
        kept = (row >= 0) & (column >= 0)
        row, column, data = row[kept], column[kept], matrix.data[kept]
        free = self.free[self.nodes]
        partly = np.logical_not(free.all(axis=1))
        size = (
            0.0
            if not partly.any() and self.presses is None
            else float(np.abs(matrix.diagonal()).mean())
        )
        if self.presses is not None:
            pressed = np.flatnonzero(row == column)
            lifted = (self.presses & self.free)[self.nodes][row[pressed]]
            data[pressed] += _BED * size * np.eye(d) * lifted[:, :, None]
        if partly.any():
            cut = np.flatnonzero(partly[row] | partly[column])
            data[cut] *= free[row[cut], :, None] & free[column[cut], None, :]
            diagonal = cut[row[cut] == column[cut]]
            data[diagonal] += size * np.eye(d) * np.logical_not(free[row[diagonal]])[:, :, None]
        indptr = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=k))]).astype(np.int32)
        return sp.bsr_array((data, column, indptr), shape=(d * k, d * k))

    def right_hand_side(self, matrix: sp.bsr_array, forces: FloatArray) -> FloatArray:
        """Right-hand side (3k,), N, of the reduced matrix, for nodal forces (n, 3)."""
        rest = forces
        if self.value.any():
            moved = self.value if self.ties is None else self.ties.expand(self.value)
            rest = forces - (matrix @ moved.reshape(-1)).reshape(forces.shape)
        return self.project(rest)

    def project(self, forces: FloatArray) -> FloatArray:
        """Sum forces (3k,), N, on the free components, of nodal forces (n, 3)."""
        if self.ties is not None:
            forces = self.ties.gather(forces)
        carried = forces.take(self.nodes, axis=0)
        return (carried if self._whole else carried * self.free[self.nodes]).reshape(-1)

    @cached_property
    def _whole(self) -> bool:
        """Whether every node that can move can do so in all components."""
        return bool(self.free[self.nodes].all())

    @cached_property
    def _row(self) -> IntArray:
        """Row (n,) of each node among those that can move; behind the last one of the others."""
        row = np.full(len(self.free), len(self.nodes))
        row[self.nodes] = np.arange(len(self.nodes))
        return row

    def expand(self, solution: FloatArray) -> FloatArray:
        """Displacement (n, 3) of a solution (3k,) of the reduced system, mm."""
        result = self.value + self._moved(solution)
        return result if self.ties is None else self.ties.expand(result)

    def motion(self, solution: FloatArray) -> FloatArray:
        """Displacement (n, 3) of a solution (3k,) with everything else held at zero, mm."""
        result = self._moved(solution)
        return result if self.ties is None else self.ties.expand(result)

    def _moved(self, solution: FloatArray) -> FloatArray:
        """Solution (3k,) at its nodes, and zero at the others: (n, 3), mm."""
        values = solution.reshape(-1, self.free.shape[1])
        if not self._whole:
            values = values * self.free[self.nodes]
        # Rows that are taken by number: ten times as fast as rows that are put in their places.
        padded = np.concatenate([values, np.zeros((1, values.shape[1]))])
        return padded.take(self._row, axis=0)

    def restrict(self, displacement: FloatArray) -> FloatArray:
        """Solution (3k,) of the reduced system that stands for a displacement (n, 3)."""
        if self.ties is not None:
            displacement = self.ties.restrict(displacement)
        return np.where(self.free, displacement, 0.0)[self.nodes].reshape(-1)

    def supported(self, forces: FloatArray) -> FloatArray:
        """Keep what of nodal forces (n, 3) acts on held components; zero elsewhere."""
        if self.ties is None:
            return np.where(self.free, 0.0, forces)
        touched = self.ties.touched(~self.free)
        return np.where(touched[:, None], self.ties.carried(forces), 0.0)

    def lost_in_ties(self, forces: FloatArray) -> FloatArray:
        """Find what ties change in nodal forces (n, 3): a moment where faces lie apart."""
        if self.ties is None or self.ties.tied is None:
            return np.zeros_like(forces)
        return forces - self.ties.carried(forces)

    def modes(self, points: FloatArray) -> FloatArray:
        """Rigid motions (3k, 6) of points (n, 3), mm, as solutions of the reduced system.

        Rotations are about the centre of the points, by the inverse of their extent.
        """
        size = float(np.ptp(points, axis=0).max())
        if self.ties is None:
            points = points[self.nodes]
            return rigid_modes((points - points.mean(axis=0)) / size)
        modes = rigid_modes((points - points.mean(axis=0)) / size).reshape(-1, 3, 6)
        tied = np.stack([self.ties.restrict(modes[:, :, k]) for k in range(6)], axis=2)
        return tied[self.nodes].reshape(-1, 6)

    def prolongation(self, ends: IntArray) -> tuple[sp.bsr_array, IntArray]:
        """Linear displacements among the solutions, where there are ties.

        (3k, 3c), with the rows (c,) of nodes that stand for corners and rigid bodies; ends (n, 2)
        as there.
        """
        assert self.ties is not None
        rows = (3 * self.nodes[:, None] + np.arange(3)).reshape(-1)
        kept = self.ties.prolongation(ends).tocsr()[rows][:, rows]
        nodes = np.flatnonzero(np.diff(kept.tocsc().indptr).reshape(-1, 3).any(axis=1))
        columns = (3 * nodes[:, None] + np.arange(3)).reshape(-1)
        return kept[:, columns].tobsr((3, 3)), nodes

    def parents(self, ends: IntArray) -> IntArray:
        """Rows of the two corners that each row's node is the middle of; -1 for a held corner.

        The two ends (n, 2) of a corner are itself.
        """
        place = np.full(len(self.free), -1)
        place[self.nodes] = np.arange(len(self.nodes))
        return place[ends[self.nodes]]
