"""Held components of the displacement, and whether they hold the part at all."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ccfem.arrays import BoolArray, FloatArray, IntArray, read_only
from ccfem.elasticity.body import SupportedProblem
from ccfem.errors import InputError
from ccfem.mesh.cell_mesh import CellMesh
from ccfem.mesh.measures import connected

__all__ = ["Held", "check_support", "held", "rigid_modes"]


@dataclass(frozen=True)
class Held:
    """Which components are held, and where; in the plane two a node instead of three.

    Attributes
    ----------
    free : (n, 3) bool array
        Components that the solve finds.
    value : (n, 3) array, mm
        What held components are held at; zero elsewhere.
    nodes : (k,) int array
        Nodes with at least one free component: the rows of the reduced matrix.
    """

    free: BoolArray
    value: FloatArray
    nodes: IntArray

    def reduce(self, matrix: sp.bsr_array) -> sp.bsr_array:
        """Return the matrix (3k, 3k) of the nodes that can move.

        Held components of such nodes keep a row with nothing but a diagonal entry, as large as
        the mean one.
        """
        (n, d), k = self.free.shape, len(self.nodes)
        place = np.full(n, -1, dtype=np.int32)
        place[self.nodes] = np.arange(k, dtype=np.int32)
        row = np.repeat(place, np.diff(matrix.indptr))
        column = place[matrix.indices]
        kept = (row >= 0) & (column >= 0)
        row, column, data = row[kept], column[kept], matrix.data[kept]
        free = self.free[self.nodes]
        partly = np.logical_not(free.all(axis=1))
        if partly.any():
            cut = np.flatnonzero(partly[row] | partly[column])
            data[cut] *= free[row[cut], :, None] & free[column[cut], None, :]
            diagonal = cut[row[cut] == column[cut]]
            size = float(np.abs(matrix.diagonal()).mean())
            data[diagonal] += size * np.eye(d) * np.logical_not(free[row[diagonal]])[:, :, None]
        indptr = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=k))]).astype(np.int32)
        return sp.bsr_array((data, column, indptr), shape=(d * k, d * k))

    def right_hand_side(self, matrix: sp.bsr_array, forces: FloatArray) -> FloatArray:
        """Right-hand side (3k,), N, of the reduced matrix, for nodal forces (n, 3)."""
        rest = forces
        if self.value.any():
            rest = forces - (matrix @ self.value.reshape(-1)).reshape(forces.shape)
        return np.where(self.free, rest, 0.0)[self.nodes].reshape(-1)

    def expand(self, solution: FloatArray) -> FloatArray:
        """Displacement (n, 3) of a solution (3k,) of the reduced system, mm."""
        result = self.value.copy()
        free = self.free[self.nodes]
        result[self.nodes] += np.where(free, solution.reshape(free.shape), 0.0)
        return result

    def restrict(self, displacement: FloatArray) -> FloatArray:
        """Solution (3k,) of the reduced system that stands for a displacement (n, 3)."""
        return np.where(self.free, displacement, 0.0)[self.nodes].reshape(-1)


def held(problem: SupportedProblem) -> Held:
    """Collect the supports of a problem and check that they hold the part.

    Nodes that belong to no cell are held at zero.

    Raises
    ------
    InputError
        For no support, an empty or unknown patch, values that contradict each other or are not
        finite, and a part that is free to move; the message names the motion.
    """
    mesh = problem.mesh
    if not problem.supports:
        raise InputError("the part has no support: hold at least one patch")
    free = np.ones(mesh.points.shape, dtype=bool)
    value = np.zeros(mesh.points.shape)
    known = "xyz"[: mesh.points.shape[1]]
    for support in problem.supports:
        if not np.isfinite(support.value).all():
            raise InputError(f"a support must be held at finite values; got {support}")
        facets = mesh.patch(support.patch)
        if not len(facets):
            raise InputError(f"patch '{support.patch}' is empty: no boundary facet meets its rule")
        nodes = np.unique(mesh.facet_nodes(facets))
        for component in sorted(set(support.components) & set(known)):
            k = "xyz".index(component)
            before = nodes[~free[nodes, k]]
            if (np.abs(value[before, k] - support.value[k]) > 1e-12).any():
                raise InputError(
                    f"supports contradict each other: nodes of patch '{support.patch}' are held "
                    f"in {component} at {support.value[k]} mm and at another value"
                )
            free[nodes, k] = False
            value[nodes, k] = support.value[k]
    check_support(mesh, ~free)
    unused = np.ones(len(mesh.points), dtype=bool)
    unused[mesh.cells] = False
    free[unused] = False
    nodes = np.flatnonzero(free.any(axis=1))
    return Held(read_only(free, np.bool_), read_only(value), read_only(nodes, np.int64))


def rigid_modes(points: FloatArray) -> FloatArray:
    """Displacements (3n, 6) of points (n, 3) in the three translations and three rotations."""
    x, y, z = points.T
    modes = np.zeros((len(points), 3, 6))
    modes[:, [0, 1, 2], [0, 1, 2]] = 1.0
    modes[:, 1, 3], modes[:, 2, 3] = -z, y
    modes[:, 2, 4], modes[:, 0, 4] = -x, z
    modes[:, 0, 5], modes[:, 1, 5] = -y, x
    return modes.reshape(-1, 6)


def check_support(mesh: CellMesh, fixed: BoolArray) -> None:
    """Check that no piece of the part can move as a rigid body.

    Bodies are cells joined through faces (edges in the plane); bodies that share only an edge or a
    node are hinged there. A piece is held when no rigid motion of its bodies respects the hinges
    and the supports.

    Parameters
    ----------
    mesh : TetMesh, or mesh of a plate
    fixed : (n, 3) bool array, or (n, 2) in the plane

    Raises
    ------
    InputError
        Names the free motion.
    """
    body = connected(mesh.neighbours, len(mesh.cells))
    count = int(body.max()) + 1
    corner_body = np.repeat(body, mesh.corners.shape[1])
    points = mesh.points
    if points.shape[1] == 2:  # the plane z = 0 in space, every node held across it
        points = np.pad(points, ((0, 0), (0, 1)))
        fixed = np.pad(fixed, ((0, 0), (0, 1)), constant_values=True)
    if count == 1:
        used = np.zeros(len(fixed), dtype=bool)
        used[mesh.corners] = True
        node = np.flatnonzero(used)
        motion = _free_motions(points, fixed, node, np.zeros(len(node), dtype=np.int64))
        if motion is not None:
            raise InputError(f"the part is free to {motion}: add a support that holds it")
        return
    members = np.unique(mesh.corners.reshape(-1) * count + corner_body)
    node, owner = members // count, members % count
    piece = connected(np.stack([owner, count + node], axis=1), count + len(fixed))
    named = np.unique(piece[:count])
    for k in named:
        chosen = piece[owner] == k
        motion = _free_motions(points, fixed, node[chosen], owner[chosen])
        if motion is not None:
            which = f" (one of {len(named)} separate pieces)" if len(named) > 1 else ""
            raise InputError(f"the part{which} is free to {motion}: add a support that holds it")


def _free_motions(
    points: FloatArray, fixed: BoolArray, node: IntArray, owner: IntArray
) -> str | None:
    """Words for the rigid motions left to the bodies of one piece; None when it is held."""
    bodies, owner = np.unique(owner, return_inverse=True)
    points = points[node]
    centre = points.mean(axis=0)
    radius = float(np.linalg.norm(points - centre, axis=1).max())
    modes = rigid_modes((points - centre) / radius).reshape(-1, 3, 6)
    gram = np.zeros((len(bodies), 6, len(bodies), 6))
    rows, sides = np.nonzero(fixed[node])
    for body in range(len(bodies)):
        own = modes[rows, sides][owner[rows] == body]
        gram[body, :, body, :] += own.T @ own
    for a, b in _hinges(node):
        difference = np.zeros((3, len(bodies), 6))
        difference[:, owner[a]], difference[:, owner[b]] = modes[a], -modes[b]
        gram += np.einsum("kbi,kcj->bicj", difference, difference)
    size = 6 * len(bodies)
    values, vectors = np.linalg.eigh(gram.reshape(size, size))
    null = vectors[:, values <= 1e-10 * max(1.0, values[-1])]
    if not null.shape[1]:
        return None
    null = null.reshape(len(bodies), 6, -1)
    worst = np.linalg.norm(null, axis=(1, 2)).argmax()
    return " and to ".join(_words(null[worst], centre, radius))


def _hinges(node: IntArray) -> Iterator[tuple[int, int]]:
    """Pairs of entries that name the same node."""
    order = np.argsort(node, kind="stable")
    for k in np.flatnonzero(node[order[1:]] == node[order[:-1]]):
        yield int(order[k]), int(order[k + 1])


def _words(motions: FloatArray, centre: FloatArray, radius: float) -> list[str]:
    """Words for the span of rigid motions (6, k): translation, then rotation over `radius`."""
    values, combination = np.linalg.eigh(motions[3:].T @ motions[3:])
    moving = values <= 1e-8
    words = []
    translations = np.linalg.qr(motions[:3] @ combination[:, moving])[0]
    if translations.shape[1]:
        words.append("move along " + " and ".join(_directions(translations)))
    rotating = motions @ combination[:, ~moving]
    # Translations that are free anyway say nothing about where an axis of rotation lies.
    rotating[:3] -= translations @ (translations.T @ rotating[:3])
    rotations = rotating[3:]
    for direction in _axes(rotations):
        weights = np.linalg.lstsq(rotations, direction, rcond=None)[0]
        shift = rotating[:3] @ weights
        through = centre + radius * np.cross(direction, shift)
        pitch = float(direction @ shift)
        through[np.abs(through) < 1e-9 * radius] = 0.0
        point = ", ".join(f"{c:.4g}" for c in through)
        verb = "rotate" if abs(pitch) < 1e-6 else "screw"
        words.append(f"{verb} about the axis through ({point}) along {_name(direction)}")
    return words


def _axes(span: FloatArray) -> list[FloatArray]:
    """Basis of the column span (3, k), of coordinate axes where it can be."""
    if not span.shape[1]:
        return []
    basis = np.linalg.svd(span, full_matrices=False)[0]
    inside = [axis for axis in np.eye(3) if np.linalg.norm(basis.T @ axis) > 1.0 - 1e-6]
    rest = basis - sum((np.outer(axis, axis @ basis) for axis in inside), np.zeros_like(basis))
    more, size, _ = np.linalg.svd(rest, full_matrices=False)
    return inside + [more[:, k] for k in np.flatnonzero(size > 1e-6)]


def _directions(span: FloatArray) -> list[str]:
    return [_name(direction) for direction in _axes(span)]


def _name(direction: FloatArray) -> str:
    """Name of a direction: a coordinate axis, or its components."""
    k = int(np.abs(direction).argmax())
    if abs(direction[k]) > 1.0 - 1e-6:
        return "xyz"[k]
    direction = direction * np.sign(direction[k])
    return "(" + ", ".join(f"{c:.3g}" for c in direction) + ")"
