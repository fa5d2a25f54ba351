"""Conversion of supports to held components, nodal axes and rigid bodies, for each load case."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, read_only
from ccfem.base.errors import InputError
from ccfem.body.mesh.patches import unit_vector
from ccfem.body.mesh.tet_mesh import CellMesh
from ccfem.fem.elasticity.assembly import add_blocks
from ccfem.fem.elasticity.held import Body, Held, Ties
from ccfem.fem.elasticity.load_kinds import Displacement
from ccfem.fem.elasticity.nodes import (
    FACET_PRODUCTS,
    LoadedBody,
    SupportedProblem,
    edge_nodes,
    facet_normals,
    nearest_node,
    nearest_nodes,
    patch_facets,
    patch_nodes,
    patch_normals,
)
from ccfem.fem.elasticity.rigid_motion import Holds, check_motion
from ccfem.fem.elasticity.support_kinds import (
    AnySupport,
    EdgeSupport,
    Foundation,
    LocalSupport,
    NodeSupport,
    Pin,
    PointSpring,
    PointSupport,
    PressingSupport,
    RigidPatch,
    SlidingSupport,
    Spring,
    Support,
    TiedPatch,
    local_axes,
)
from ccfem.fem.elasticity.tied_faces import TiedNodes, tied_nodes


def held(problem: SupportedProblem) -> Held:
    """Collect the supports of a problem and check that they hold the part.

    Nodes that belong to no cell are held at zero.

    Raises
    ------
    InputError
        For no support, an empty or unknown patch, values that contradict each other or are not
        finite, and a part that is free to move; the message names the motion.
    """
    if not problem.supports:
        raise InputError("the part has no support: hold at least one patch")
    collected = _collect(problem, {})
    check_motion(problem.mesh, _in_space(problem.mesh.points), collected.holds())
    return collected.held()


def held_in(problem: SupportedProblem, case: str, at_rest: Held) -> Held:
    """Return the components of `held` at the values of one load case."""
    loads = problem.loads[case]
    moves = {load.patch: load.vector for load in loads if isinstance(load, Displacement)}
    if not moves:
        return at_rest
    for patch, vector in moves.items():
        holding = [s for s in problem.supports if type(s) in _KINDS and _moves(s) == patch]
        holding = [s for s in holding if not isinstance(s, PressingSupport | TiedPatch)]
        turned = [s for s in holding if isinstance(s, LocalSupport)]
        known = {letter for s in holding for letter in getattr(s, "components", "xyz")}
        known |= set("xyz" if turned else "")
        wanted = {letter for letter, size in zip("xyz", vector, strict=True) if size}
        if not np.isfinite(vector).all() or not wanted <= known:
            raise InputError(
                f"load case '{case}' moves patch '{patch}' by {tuple(vector)} mm, and supports on "
                f"it hold {', '.join(sorted(known)) or 'nothing'}: hold the components to be moved"
            )
    return at_rest.at(_collect(problem, moves).held().value)


def check_support(mesh: CellMesh, fixed: BoolArray) -> None:
    """Check that no piece can move as a rigid body with fixed components (n, 3), or (n, 2)."""
    check_motion(mesh, _in_space(mesh.points), Holds(*_axis_holds(fixed)))


def _in_space(points: FloatArray) -> FloatArray:
    """Points of the plane as points with z = 0; points in space unchanged."""
    return points if points.shape[1] == 3 else np.pad(points, ((0, 0), (0, 1)))


def _axis_holds(fixed: BoolArray) -> tuple[IntArray, FloatArray]:
    """Nodes and directions of held components; in the plane, every node is held normal to it."""
    if fixed.shape[1] == 2:
        fixed = np.pad(fixed, ((0, 0), (0, 1)), constant_values=True)
    nodes, components = np.nonzero(fixed)
    return nodes, np.eye(3)[components]


@dataclass
class _Rigid:
    """A rigid patch: the held components of its motion along its axes, and their values."""

    label: str
    body: Body
    held: BoolArray
    value: FloatArray


@dataclass
class _Collected:
    """Collected effect of the supports of a problem."""

    mesh: CellMesh
    surface: LoadedBody
    free: BoolArray
    value: FloatArray
    oblique: list[tuple[IntArray, FloatArray, FloatArray]] = field(default_factory=list)
    pressing: list[tuple[IntArray, FloatArray]] = field(default_factory=list)
    rigid: list[_Rigid] = field(default_factory=list)
    soft: list[tuple[IntArray, FloatArray]] = field(default_factory=list)
    tied: list[TiedNodes] = field(default_factory=list)

    def components(
        self, nodes: IntArray, components: str, value: Sequence[float], what: str
    ) -> None:
        """Hold components of nodes."""
        if not np.isfinite(value).all():
            raise InputError(f"a support must be held at finite values; got {value} on {what}")
        known = "xyz"[: self.mesh.points.shape[1]]
        for component in sorted(set(components) & set(known)):
            k = "xyz".index(component)
            before = nodes[~self.free[nodes, k]]
            if (np.abs(self.value[before, k] - value[k]) > 1e-12).any():
                raise InputError(
                    f"supports contradict each other: nodes of {what} are held in {component} at "
                    f"{value[k]} mm and at another value: give one value"
                )
            self.free[nodes, k] = False
            self.value[nodes, k] = value[k]

    def along(self, nodes: IntArray, axes: FloatArray, components: str, values: FloatArray) -> None:
        """Hold components of nodes (k,) along axes (k, 3, 3), as columns, at values (k, 3)."""
        for component in sorted(set(components)):
            k = "xyz".index(component)
            self.oblique.append((nodes, axes[:, :, k], values[:, k]))

    def holds(self) -> Holds:
        """Directions that are held, including those of springs and pressing supports."""
        nodes, directions = _axis_holds(~self.free)
        more = [(n, d) for n, d, _ in self.oblique] + self.pressing + self.soft
        moved = [(k, a) for k, r in enumerate(self.rigid) for a in r.body.axes.T[r.held[0]]]
        turned = [(k, a) for k, r in enumerate(self.rigid) for a in r.body.axes.T[r.held[1]]]
        which = np.array([k for k, _ in moved], dtype=np.int64)
        return Holds(
            nodes=np.concatenate([nodes, *(n for n, _ in more)]),
            directions=np.concatenate([directions, *(d for _, d in more)]),
            # Nodes that are tied, and those that they follow, move alike.
            bodies=(
                *(r.body.nodes for r in self.rigid),
                *(np.union1d(t.nodes, t.leaders) for t in self.tied),
            ),
            centres=np.array([r.body.centre for r in self.rigid]).reshape(-1, 3),
            moved=which,
            along=np.array([a for _, a in moved]).reshape(-1, 3),
            turned=np.array([k for k, _ in turned], dtype=np.int64),
            about=np.array([a for _, a in turned]).reshape(-1, 3),
            centre_of=which,
        )

    def held(self) -> Held:
        """Held components, with the ties due to oblique and rigid supports."""
        free, value, ties = self.free.copy(), self.value.copy(), None
        unused = np.ones(len(free), dtype=bool)
        unused[self.mesh.cells] = False
        free[unused] = False
        presses = np.zeros(free.shape, dtype=bool)
        if self.oblique or self.rigid or self.pressing or self.tied:
            turned, frames = node_frames(self.oblique, self.pressing, free, value, presses)
            bodies, tied = tuple(r.body for r in self.rigid), self._tied(free, presses)
            ties = Ties(self.mesh.points, turned, frames, bodies, tied)
            self._check_slaves(ties, free)
            if tied is not None:
                free[tied.nodes] = False
            free[ties.slaves] = False
            for rigid in self.rigid:
                free = np.concatenate([free, ~rigid.held])
                presses = np.concatenate([presses, np.zeros((2, 3), dtype=bool)])
                value = np.concatenate([value, np.where(rigid.held, rigid.value, 0.0)])
        nodes = np.flatnonzero((free | presses).any(axis=1))
        return Held(
            read_only(free, np.bool_),
            read_only(value),
            read_only(nodes, np.int64),
            ties,
            read_only(presses, np.bool_) if presses.any() else None,
        )

    def _tied(self, free: BoolArray, presses: BoolArray) -> TiedNodes | None:
        """All tied nodes; what the first of several tied patches ties counts."""
        if not self.tied:
            return None
        nodes, first = np.unique(np.concatenate([t.nodes for t in self.tied]), return_index=True)
        if presses[nodes].any() or any(np.isin(r.body.nodes, nodes).any() for r in self.rigid):
            raise InputError(
                "a tied patch has nodes that a pressing support or a rigid patch holds as well: "
                "leave a gap between them, or tie the other patch to it"
            )
        leaders, weights = (
            np.concatenate([getattr(t, name) for t in self.tied])[first]
            for name in ("leaders", "weights")
        )
        return TiedNodes(nodes, leaders, weights, ~free[nodes])

    def _check_slaves(self, ties: Ties, free: BoolArray) -> None:
        """Refuse nodes of a rigid patch that are also held, or belong to two rigid patches."""
        seen = np.zeros(len(self.mesh.points), dtype=bool)
        for rigid in self.rigid:
            nodes = rigid.body.nodes
            if seen[nodes].any():
                raise InputError(
                    f"{rigid.label} shares nodes with another rigid patch: make one patch of both, "
                    "or leave a gap between them"
                )
            seen[nodes] = True
            if not free[nodes].all() or np.isin(nodes, ties.turned).any():
                raise InputError(
                    f"{rigid.label} has nodes that another support holds as well: hold the rigid "
                    "patch itself, or leave a gap between them"
                )


def _collect(problem: SupportedProblem, moves: Mapping[str, Sequence[float]]) -> _Collected:
    """Collect what the supports hold; some patches take other values."""
    mesh = problem.mesh
    free = np.ones(mesh.points.shape, dtype=bool)
    collected = _Collected(mesh, problem.body, free, np.zeros(mesh.points.shape))
    for support in problem.supports:
        move = moves.get(_moves(support))
        if isinstance(support, Spring | PointSpring | Foundation):
            collected.soft += soft_holds(mesh, problem.body, support)
        else:
            _KINDS[type(support)](collected, support, move)
    return collected


def _moves(support: AnySupport) -> str:
    """Patch through which a `Displacement` moves a support; empty for none."""
    return getattr(support, "patch", "")


def _patch(collected: _Collected, support: Support, move: Sequence[float] | None) -> None:
    nodes = patch_nodes(collected.mesh, support.patch)
    value = support.value if move is None else move
    collected.components(nodes, support.components, value, f"patch '{support.patch}'")


def _edge(collected: _Collected, support: EdgeSupport, move: Sequence[float] | None) -> None:
    nodes = edge_nodes(collected.mesh, support.patches)
    collected.components(nodes, support.components, support.value, f"the edge of {support.patches}")


def _point(collected: _Collected, support: PointSupport, move: Sequence[float] | None) -> None:
    node = np.array([nearest_node(collected.mesh, support.point, "a point support")])
    collected.components(node, support.components, support.value, f"the point {support.point}")


def _nodes(collected: _Collected, support: NodeSupport, move: Sequence[float] | None) -> None:
    nodes = nearest_nodes(collected.mesh, support.points, f"the support '{support.name}'")
    if support.axes:
        axes = np.asarray(support.axes, dtype=np.float64).swapaxes(1, 2)
        collected.along(nodes, axes, support.components, np.tile(support.value, (len(nodes), 1)))
        return
    collected.components(nodes, support.components, support.value, f"nodes '{support.name}'")


def _local(collected: _Collected, support: LocalSupport, move: Sequence[float] | None) -> None:
    nodes = patch_nodes(collected.mesh, support.patch)
    axes = local_axes(support.system, support.points, collected.mesh.points[nodes])
    values = np.tile(support.value, (len(nodes), 1))
    if move is not None:
        values = np.einsum("kji,j->ki", axes, np.asarray(move))
    collected.along(nodes, axes, support.components, values)


def _sliding(collected: _Collected, support: SlidingSupport, move: Sequence[float] | None) -> None:
    nodes = patch_nodes(collected.mesh, support.patch)
    if support.normal is None:
        facets = patch_facets(collected.surface, support.patch)
        normals = patch_normals(collected.surface, facets, nodes)
    else:
        normal = unit_vector(support.normal, "normal of the sliding support")
        normals = np.tile(normal, (len(nodes), 1))
    values = np.full(len(nodes), support.value) if move is None else normals @ np.asarray(move)
    collected.oblique.append((nodes, normals, values))


def _pressing(
    collected: _Collected, support: PressingSupport, move: Sequence[float] | None
) -> None:
    mesh = collected.mesh
    facets, nodes = patch_facets(collected.surface, support.patch), patch_nodes(mesh, support.patch)
    if len(mesh.cells[0]) > len(mesh.corners[0]):
        nodes = np.setdiff1d(nodes, facets)
    if support.normal is None:
        normals = patch_normals(collected.surface, facets, nodes)
    else:
        normal = unit_vector(support.normal, "normal of the pressing support")
        normals = np.tile(normal, (len(nodes), 1))
    collected.pressing.append((nodes, normals))


def _rigid(collected: _Collected, support: RigidPatch, move: Sequence[float] | None) -> None:
    value = support.value if move is None else move
    held = np.array([[c in letters for c in "xyz"] for letters in
                     (support.components, support.rotations)])  # fmt: skip
    centre = None if support.centre is None else np.array(support.centre)
    angle = np.radians(support.angle)
    label = f"rigid patch '{support.patch}'"
    _add_body(collected, label, support.patch, centre, np.eye(3), held, np.array([value, angle]))


def _pin(collected: _Collected, support: Pin, move: Sequence[float] | None) -> None:
    axis = unit_vector(support.axis, "axis of the pin")
    axes = np.linalg.svd(axis[None])[2].T
    axes[:, 0] = axis
    held = np.array([[not support.slides, True, True], [False, True, True]])
    value = np.array([axes.T @ np.array(support.value if move is None else move), np.zeros(3)])
    label = f"the pin in patch '{support.patch}'"
    _add_body(collected, label, support.patch, np.array(support.point), axes, held, value)


def _add_body(
    collected: _Collected,
    label: str,
    patch: str,
    centre: FloatArray | None,
    axes: FloatArray,
    held: BoolArray,
    value: FloatArray,
) -> None:
    """Make a patch a rigid body; `value` is its translation and its rotation, mm and radians."""
    facets, nodes = patch_facets(collected.mesh, patch), patch_nodes(collected.mesh, patch)
    if centre is None:
        area, _ = collected.surface.facet_areas(facets)
        centre = area @ collected.mesh.points[facets].mean(axis=1) / area.sum()
    size = float(np.linalg.norm(collected.mesh.points[nodes] - centre, axis=1).max())
    body = Body(nodes, np.asarray(centre, dtype=np.float64), axes, size)
    collected.rigid.append(_Rigid(label, body, held, value * np.array([[1.0], [size]])))


def _tie(collected: _Collected, support: TiedPatch, move: Sequence[float] | None) -> None:
    nodes = patch_nodes(collected.mesh, support.patch)
    facets = patch_facets(collected.mesh, support.to)
    what = f"patch '{support.patch}'"
    collected.tied.append(tied_nodes(collected.mesh, nodes, facets, support.within, what))


_KINDS: dict[type, Callable[..., None]] = {
    Support: _patch,
    EdgeSupport: _edge,
    PointSupport: _point,
    NodeSupport: _nodes,
    LocalSupport: _local,
    SlidingSupport: _sliding,
    PressingSupport: _pressing,
    RigidPatch: _rigid,
    Pin: _pin,
    TiedPatch: _tie,
}
"""Functions that collect supports of each kind, except elastic ones."""


# Nodal axes for supports that hold, or press, along oblique directions.


_PARALLEL = 1e-6
"""Sine of the angle below which held directions count as the same."""

_ALIKE, _ACROSS = 0.98, 0.2
"""Cosine of the angle above which two directions of pressing count as the same, and below which
they count as perpendicular: normals at nodes of a mesh are accurate to some degrees."""


def node_frames(
    oblique: Sequence[tuple[IntArray, FloatArray, FloatArray]],
    pressing: Sequence[tuple[IntArray, FloatArray]],
    free: BoolArray,
    value: FloatArray,
    presses: BoolArray,
) -> tuple[IntArray, FloatArray]:
    """Find axes along which components are held or press; the arrays are changed to these axes.

    Parameters
    ----------
    oblique : sequence of nodes (k,), directions (k, 3), values (k,) mm
        Directions held that are oblique to the global axes.
    pressing : sequence of nodes (k,), directions (k, 3)
        Directions along which nodes may only move back.
    free : (n, 3) bool array
        Changed in place: a direction that presses counts as held.
    value : (n, 3) array, mm
        Changed in place.
    presses : (n, 3) bool array
        Changed in place: components that only press.

    Returns
    -------
    turned : (k,) int array
        Nodes with axes of their own.
    frames : (k, 3, 3) array
        These axes as columns: first those held, then those that press.

    Raises
    ------
    InputError
        For values that contradict each other, and for pressing patches that meet obliquely.
    """
    wanted: dict[int, list[tuple[FloatArray, float]]] = {}
    for nodes, directions, values in oblique:
        for node, direction, at in zip(nodes, directions, values, strict=True):
            wanted.setdefault(int(node), []).append((direction, float(at)))
    outward: dict[int, list[FloatArray]] = {}
    for nodes, directions in pressing:
        for node, direction in zip(nodes, directions, strict=True):
            outward.setdefault(int(node), []).append(direction)
    turned = np.array(sorted({*wanted, *outward}), dtype=np.int64)
    frames = np.empty((len(turned), 3, 3))
    for k, node in enumerate(turned):
        fixed = ~free[node]
        more = wanted.get(int(node), [])
        # Axes of what is held, then of what presses, then any to complete the frame.
        rows = np.concatenate([np.eye(3)[fixed], *(d[None] for d, _ in more)])
        levels = np.concatenate([value[node, fixed], [v for _, v in more]])
        axes, at = _held_axes(rows, levels, node)
        rank = len(at)
        presses_along = _pressing_axes(axes[:rank], at, outward.get(int(node), []), node)
        bound = np.concatenate([axes[:rank], *(d[None] for d in presses_along)])
        frames[k] = np.concatenate([bound, np.linalg.svd(bound)[2][len(bound) :]]).T
        free[node] = np.arange(3) >= len(bound)
        presses[node, rank : len(bound)] = True
        value[node] = np.concatenate([at, np.zeros(3 - rank)])
    return turned, frames


def _held_axes(rows: FloatArray, levels: FloatArray, node: int) -> tuple[FloatArray, FloatArray]:
    """Axes (3, 3) as rows, of which the first (r,) are held, at those values."""
    _, sizes, axes = np.linalg.svd(rows)
    rank = int((sizes > _PARALLEL).sum())
    at = np.linalg.lstsq(rows @ axes[:rank].T, levels, rcond=None)[0]
    worst = np.abs(rows @ axes[:rank].T @ at - levels).max(initial=0.0)
    if worst > 1e-9 * max(1.0, np.abs(at).max(initial=0.0)):
        raise InputError(
            f"supports contradict each other at node {node}, which is held along several "
            "directions: give them values that agree"
        )
    return axes, at


def _pressing_axes(
    held: FloatArray, at: FloatArray, directions: Sequence[FloatArray], node: int
) -> list[FloatArray]:
    """Find unit directions (3,) along which a node presses, at right angles to what is held."""
    basis: list[FloatArray] = []
    for direction in directions:
        cosines = [abs(float(direction @ other)) for other in basis]
        if any(cosine > _ALIKE for cosine in cosines):
            continue
        if any(cosine > _ACROSS for cosine in cosines):
            raise InputError(
                "patches that only press must meet at right angles or smoothly; those at node "
                f"{node} do not: leave a gap between them, or make one patch of both"
            )
        along = held @ direction
        if (np.abs(along * at) > 0.0).any():
            raise InputError(
                f"node {node} presses against a support while another one moves it: leave a gap "
                "between their patches"
            )
        # What is left of the direction beside those held and those that press already (Gram-
        # Schmidt).
        rest = direction - held.T @ along
        for other in basis:
            rest = rest - (rest @ other) * other
        if np.linalg.norm(rest) > _PARALLEL:
            basis.append(rest / np.linalg.norm(rest))
    return basis


# Springs and elastic beds: their stiffness, and the directions they hold.


Soft = Spring | PointSpring | Foundation


def soft_supports(problem: SupportedProblem) -> tuple[Soft, ...]:
    """Supports of a problem that are elastic."""
    return tuple(s for s in problem.supports if isinstance(s, Spring | PointSpring | Foundation))


def soft_holds(
    mesh: CellMesh, surface: LoadedBody, support: Soft
) -> list[tuple[IntArray, FloatArray]]:
    """Nodes (k,) and directions (k, 3) that a soft support holds against rigid motions."""
    if isinstance(support, Foundation):
        # At the corners of each facet, since directions differ between them on a curved patch.
        facets = patch_facets(surface, support.patch)
        normals = facet_normals(surface, facets, surface.points[facets]).reshape(-1, 1, 3)
        across = np.linalg.svd(normals)[2]  # orthonormal, the first along the normal
        chosen = [across[:, 0]] if support.normal > 0.0 else []
        chosen += [across[:, 1], across[:, 2]] if support.tangential > 0.0 else []
        return [(facets.reshape(-1), held) for held in chosen]
    if isinstance(support, Spring):
        nodes = patch_nodes(mesh, support.patch)
    else:
        nodes = np.array([nearest_node(mesh, support.point, "a spring")])
    axes = [np.eye(3)[k] for k in range(3) if support.stiffness[k] > 0.0]
    return [(nodes, np.tile(axis, (len(nodes), 1))) for axis in axes]


def add_springs(matrix: sp.bsr_array, mesh: LoadedBody, supports: tuple[Soft, ...]) -> None:
    """Add the stiffness of springs and beds, N/mm, to a stiffness matrix (3n, 3n), in place."""
    for support in supports:
        add_blocks(matrix, *_elements(mesh, support))


def spring_forces(
    mesh: LoadedBody, supports: tuple[Soft, ...], displacement: FloatArray
) -> FloatArray:
    """Find the forces (n, 3), N, of springs and beds on the part displaced by (n, 3), mm."""
    result = np.zeros_like(displacement)
    for support in supports:
        nodes, blocks = _elements(mesh, support)
        move = displacement[nodes].reshape(len(nodes), -1)
        forces = np.einsum("kij,kj->ki", blocks, move).reshape(*nodes.shape, 3)
        np.subtract.at(result, nodes, forces)
    return result


def _elements(mesh: LoadedBody, support: Soft) -> tuple[IntArray, FloatArray]:
    """Nodes (k, q) and element matrices (k, 3q, 3q), N/mm, of a soft support."""
    if isinstance(support, PointSpring):
        node = nearest_node(mesh, support.point, "a spring")
        return np.array([[node]]), np.diag(support.stiffness)[None]
    facets = patch_facets(mesh, support.patch)
    area, _ = mesh.facet_areas(facets)
    nodes = mesh.facet_nodes(facets)
    shapes = FACET_PRODUCTS[nodes.shape[1]]
    if isinstance(support, Spring):
        bed = np.diag(support.stiffness) / area.sum()
        blocks = np.einsum("k,ab,ij->kaibj", area, shapes, bed)
    else:
        # Across and along the bed at each node, interpolated between them.
        normal = facet_normals(mesh, facets, mesh.points[nodes])
        along = np.eye(3) - normal[..., :, None] * normal[..., None, :]
        bed = support.normal * np.einsum("kai,kbj->kabij", normal, normal)
        bed += support.tangential * np.einsum("kail,kblj->kabij", along, along)
        blocks = np.einsum("k,ab,kabij->kaibj", area, shapes, bed)
    return nodes, blocks.reshape(len(nodes), 3 * nodes.shape[1], -1)
