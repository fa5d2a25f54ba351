"""Check whether the supports hold a part: the rigid motions that remain.

Bodies are cells joined through faces (edges in the plane), and rigid patches. Bodies that share a
node are hinged there. A part is held if no rigid motion of its bodies satisfies hinges and
supports. Bodies that share three nodes off a line are merged.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import eigsh

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import CellMesh
from ccfem.fem.elasticity.held import rigid_modes
from ccfem.geometry.facets import connected

_DENSE = 100
"""Number of bodies up to which motions are found by a dense eigenvalue problem."""
_FREE = 1e-10
"""Eigenvalue, over the largest, that counts as zero; it is the square of the gap of a motion."""
_APART = 1e-8
"""Gap at a hinge or a support, over the motion, that counts as zero."""


@dataclass(frozen=True)
class Holds:
    """Directions that are held.

    Attributes
    ----------
    nodes : (h,) int array
        Nodes that are held.
    directions : (h, 3) array
        Direction held at each.
    bodies : tuple of (k,) int arrays
        Nodes of each rigid patch.
    centres : (r, 3) array, mm
        Of the rigid patches.
    moved, turned : (g,) int arrays
        Rigid patches whose centre, or whose rotation, is held ...
    along, about : (g, 3) arrays
        ... and in which direction.
    centre_of : (g,) int array
        Row of `centres` for each of `moved`.
    """

    nodes: IntArray
    directions: FloatArray
    bodies: tuple[IntArray, ...] = ()
    centres: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    moved: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    along: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    turned: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    about: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    centre_of: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))


def check_motion(mesh: CellMesh, points: FloatArray, holds: Holds) -> None:
    """Check that no piece of the part, nodes at points (n, 3), mm, can move as a rigid body."""
    body = connected(mesh.neighbours, len(mesh.cells))
    count = int(body.max()) + 1
    used = np.zeros(len(points), dtype=bool)
    used[mesh.corners] = True
    if count == 1 and not holds.bodies:
        node = np.unique(holds.nodes)
        members = _Members(node, np.zeros(len(node), dtype=np.int64))
        piece = np.zeros(1, dtype=np.int64)
    else:
        key = np.unique(mesh.cells.reshape(-1) * count + np.repeat(body, mesh.cells.shape[1]))
        node = np.concatenate([key // count, *holds.bodies])
        added = [np.full(len(nodes), count + k) for k, nodes in enumerate(holds.bodies)]
        members = _Members(node, np.concatenate([key % count, *added]))
        members, holds = _merged_bodies(points, members, holds, count)
        size = members.bodies
        joined = np.stack([members.owner, size + members.node], axis=1)
        piece = connected(joined, size + len(points))[:size]
    named = np.unique(piece)
    for k in named:
        which = piece == k
        group = members.of(which)
        place = used if len(named) == 1 else np.isin(np.arange(len(points)), group.node)
        centre = points[place].mean(axis=0)
        radius = float(np.linalg.norm(points[place] - centre, axis=1).max())
        motion = _free_motions((points - centre) / radius, group, holds, which, centre, radius)
        if motion:
            about = f" (one of {len(named)} separate pieces)" if len(named) > 1 else ""
            raise InputError(f"the part{about} is free to {motion}: add a support that holds it")


@dataclass(frozen=True)
class _Members:
    """Nodes of the bodies: entry k says that body ``owner[k]`` has ``node[k]``."""

    node: IntArray
    owner: IntArray

    @property
    def bodies(self) -> int:
        return int(self.owner.max()) + 1 if len(self.owner) else 1

    def of(self, chosen: BoolArray) -> "_Members":
        """Return the entries of chosen bodies, sorted by their nodes."""
        kept = chosen[self.owner]
        order = np.argsort(self.node[kept], kind="stable")
        return _Members(self.node[kept][order], self.owner[kept][order])

    def pairs(self) -> tuple[IntArray, IntArray]:
        """Consecutive entries with the same node; the entries must be sorted."""
        first = np.flatnonzero(self.node[1:] == self.node[:-1])
        return first, first + 1


def _merged_bodies(
    points: FloatArray, members: _Members, holds: Holds, count: int
) -> tuple[_Members, Holds]:
    """Merge bodies with three common nodes off a line; `count` are bodies of cells."""
    points = (points - points.mean(axis=0)) / max(float(np.ptp(points, axis=0).max()), 1e-300)
    number = np.arange(members.bodies)
    while True:
        order = np.lexsort((members.owner, members.node))
        members = _Members(members.node[order], members.owner[order])
        step, left, right = 1, [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
        while True:  # every two bodies at a node, not only neighbours
            first = np.flatnonzero(members.node[step:] == members.node[:-step])
            if not len(first):
                break
            left.append(first)
            right.append(first + step)
            step += 1
        # Nodes that two bodies have in common, and their spread: a second axis off the line through
        # them.
        i, j = np.concatenate(left), np.concatenate(right)
        pair, inverse = np.unique(
            members.owner[i] * members.bodies + members.owner[j], return_inverse=True
        )
        place = points[members.node[i]]
        total = np.bincount(inverse, minlength=len(pair))
        mean = np.zeros((len(pair), 3))
        np.add.at(mean, inverse, place)
        mean /= np.maximum(total, 1)[:, None]
        spread = np.zeros((len(pair), 3, 3))
        arm = place - mean[inverse]
        np.add.at(spread, inverse, arm[:, :, None] * arm[:, None])
        stiff = np.linalg.eigvalsh(spread)[:, 1] > 1e-14 if len(pair) else np.zeros(0, dtype=bool)
        if not stiff.any():
            break
        # Such bodies are one; this may give others three nodes in common, so it is repeated.
        ends = np.column_stack(np.divmod(pair[stiff], members.bodies))
        label = connected(ends, members.bodies)
        number = label[number]
        bodies = int(label.max()) + 1
        key = np.unique(members.node * bodies + label[members.owner])
        members = _Members(key // bodies, key % bodies)
    return members, replace(
        holds, moved=number[count + holds.moved], turned=number[count + holds.turned]
    )


def _constraints(
    points: FloatArray, members: _Members, holds: Holds, chosen: BoolArray, centres: FloatArray
) -> sp.csr_array:
    """Matrix (c, 6 b) from the motions of the chosen bodies to those that supports hinder."""
    place = np.cumsum(chosen) - 1
    size = 6 * int(chosen.sum())

    def rows(body: IntArray, factors: FloatArray) -> sp.csr_array:
        columns = 6 * place[body][:, None] + np.arange(6)
        starts = np.arange(0, 6 * len(body) + 1, 6)
        return sp.csr_array((factors.reshape(-1), columns.reshape(-1), starts), (len(body), size))

    # A held node moves by the motion of its body: its component along the support must vanish.
    modes = rigid_modes(points[members.node]).reshape(-1, 3, 6)
    low = np.searchsorted(members.node, holds.nodes, side="left")
    count = np.searchsorted(members.node, holds.nodes, side="right") - low
    which = np.repeat(np.arange(len(low)), count)
    entry = low[which] + np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    held = np.einsum("hk,hkj->hj", holds.directions[which], modes[entry])
    moved, turned = chosen[holds.moved], chosen[holds.turned]
    centre_modes = rigid_modes(centres[holds.centre_of[moved]]).reshape(-1, 3, 6)
    shift = np.einsum("hk,hkj->hj", holds.along[moved], centre_modes)
    twist = np.pad(holds.about[turned], ((0, 0), (3, 0)))
    # Bodies with a node in common move it alike.
    i, j = members.pairs()
    first = rows(np.repeat(members.owner[i], 3), modes[i].reshape(-1, 6))
    other = rows(np.repeat(members.owner[j], 3), modes[j].reshape(-1, 6))
    return sp.vstack(
        [
            rows(members.owner[entry], held),
            rows(holds.moved[moved], shift),
            rows(holds.turned[turned], twist),
            first - other,
        ],
        format="csr",
    )


def _free_motions(
    points: FloatArray,
    members: _Members,
    holds: Holds,
    chosen: BoolArray,
    centre: FloatArray,
    radius: float,
) -> str:
    """Names of the rigid motions left to the bodies of one piece; empty if it is held."""
    centres = (holds.centres - centre) / radius
    matrix = _constraints(points, members, holds, chosen, centres)
    null = _null_space(matrix, int(chosen.sum()))
    if not null.shape[1]:
        return ""
    null = null.reshape(-1, 6, null.shape[1])
    worst = np.linalg.norm(null, axis=(1, 2)).argmax()
    return " and to ".join(_words(null[worst], centre, radius))


def _null_space(matrix: sp.csr_array, bodies: int) -> FloatArray:
    """Motions (6 b, k), of unit length, that a sparse matrix of constraints leaves free."""
    gram = (matrix.T @ matrix).tocsc()
    if bodies <= _DENSE:
        values, vectors = np.linalg.eigh(gram.toarray())
        return np.asarray(vectors[:, values <= _FREE * max(1.0, values[-1])])
    # Chains of bodies have motions that are almost free: the gap they leave tells them apart.
    shift = -1e-15 * max(1.0, float(gram.diagonal().max()))
    start = np.random.default_rng(0).normal(size=gram.shape[0])
    _, vectors = eigsh(gram, k=6, sigma=shift, which="LM", v0=start)
    gaps = np.abs(matrix @ vectors).max(axis=0, initial=0.0) / np.abs(vectors).max(axis=0)
    return np.asarray(vectors[:, gaps <= _APART])


def _words(motions: FloatArray, centre: FloatArray, radius: float) -> list[str]:
    """Names of the span of rigid motions (6, k): translation, then rotation over `radius`."""
    values, combination = np.linalg.eigh(motions[3:].T @ motions[3:])
    moving = values <= 1e-8
    words = []
    translations = np.linalg.qr(motions[:3] @ combination[:, moving])[0]
    if translations.shape[1]:
        words.append("move along " + " and ".join(map(_name, _axes(translations))))
    rotating = motions @ combination[:, ~moving]
    # Free translations say nothing about where an axis of rotation lies.
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
    """Basis of the column span (3, k), made of coordinate axes where possible."""
    if not span.shape[1]:
        return []
    basis = np.linalg.svd(span, full_matrices=False)[0]
    # Use each axis as projected onto the span: a direction may differ from it by a thousandth.
    near = [np.asarray(basis @ (basis.T @ axis)) for axis in np.eye(3)]
    inside = [axis / np.linalg.norm(axis) for axis in near if np.linalg.norm(axis) > 1.0 - 1e-6]
    rest = basis - sum((np.outer(axis, axis @ basis) for axis in inside), np.zeros_like(basis))
    more, size, _ = np.linalg.svd(rest, full_matrices=False)
    return inside + [more[:, k] for k in np.flatnonzero(size > 1e-6)]


def _name(direction: FloatArray) -> str:
    """Name of a direction: a coordinate axis, or its components."""
    k = int(np.abs(direction).argmax())
    if abs(direction[k]) > 1.0 - 1e-6:
        return "xyz"[k]
    direction = direction * np.sign(direction[k])
    return "(" + ", ".join(f"{c:.3g}" for c in direction) + ")"
