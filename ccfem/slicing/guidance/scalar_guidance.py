"""The guidance field: one linear solve for a scalar field whose level surfaces are the layers.

Fang et al. 2024 (arXiv:2311.17265), section 2.3, minimise an energy of the field that has no scale
of its own, so that a constant field minimises it. Here the joints set the scale.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ccfem.base.arrays import FloatArray, IntArray, read_only
from ccfem.base.errors import InputError, SolveError
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity import cell_gradients
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.slicing.guidance.energies import (
    alignment_energy,
    gradient_energy,
    gradient_source,
    smoothness_energy,
)
from ccfem.slicing.guidance.joints import Joint

JointForm = Literal["axis", "ring", "literal"]

_MOST_SIGNS = 12
"""Number of joints up to which all signs are tried; above it each is flipped in turn."""
_RESIDUAL = 1e-6
_UP = read_only(np.array([0.0, 0.0, 1.0]))
_FREE = 0.05
"""Share of the stress by which a direction may exceed the least stressed one and count as equal."""
_ANCHOR = 0.01
"""Weight of the direction of least stress if no joint has an axis."""
_TIE = 0.005
"""Share of the lowest energy within which energies tie with it. Joints that are far apart hardly
influence each other's signs (on the T-bracket of the paper, all combinations are within 0.3 %), and
on parts with a mirror plane they come in pairs. Of tied combinations, the one is taken whose layers
are stacked most along the build direction."""


@dataclass(frozen=True)
class Weights:
    """Weights of the terms of the field.

    Attributes
    ----------
    stress : float
        Layers along the strongest stress.
    smoothness : float
        Equal gradients in neighbouring cells.
    joints : float
        Layers normal to the axes of the joints, or of one value round them.
    length : float, mm
        Length over which smoothness acts.
    holes : float, default 0
        Layers normal to the axes of holes within a reach of their walls, besides the joints' term.
    reach : float, mm, default 0
    """

    stress: float
    smoothness: float
    joints: float
    length: float
    holes: float = 0.0
    reach: float = 0.0


@dataclass(frozen=True)
class GuidanceField:
    """A scalar field on a part whose level surfaces are its layers.

    Attributes
    ----------
    values : (n,) array, mm
        At the nodes; the mean size of its gradient is 1. Zero at nodes that are no cell's corner.
    gradient : (m, 3) array
    signs : tuple of int
        Sense, 1 or -1, in which the field rises along the direction of each joint.
    energies : mapping of signs to float
        Energy of every combination of signs that was tried, without its constant term.
    """

    mesh: TetMesh
    values: FloatArray
    gradient: FloatArray
    signs: tuple[int, ...]
    energies: dict[tuple[int, ...], float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", read_only(self.values))
        object.__setattr__(self, "gradient", read_only(self.gradient))


def guidance_field(
    mesh: TetMesh,
    tension: FloatArray,
    importance: FloatArray,
    joints: Sequence[Joint],
    weights: Weights,
    form: JointForm = "axis",
    signs: Sequence[int] | None = None,
    slab: float = 0.5,
    build: FloatArray = _UP,
) -> GuidanceField:
    """Find the field: gradients normal to the stress, smooth, and along the joints' axes.

    Minimises

        w_s sum_e V_e omega_e (g_e . tau_e)^2 + w_c l^2 sum_f A_f / h_f |g_e - g_e'|^2 + joints

    with the term of the joints, by `form`,

    * "axis": ``w_b sum_k sum_e V_e |g_e - s_k a_k|^2`` over the cells of each joint, s_k = 1 or -1;
    * "literal": one value in each joint, as the paper prints it (eq. 3);
    * "ring": one value in each slab of a joint normal to its direction.

    To each, ``w_h sum_k sum_e V_e |g_e - (g_e . a_k) a_k|^2`` over the cells within a reach of the
    wall of a hole is added, which leaves the thickness of the layers there alone.

    The last two set no scale, so it is set by a mean gradient along the axes. Joints without a
    direction have no effect in "axis". If no joint has a direction, ``0.01 sum_e V_e |g_e - d|^2``
    is used instead, with the direction d of least stress.

    Parameters
    ----------
    tension : (m, 3) array
        Direction tau of the strongest stress.
    importance : (m,) array
        omega: 0 where the stress has no effect.
    form : {"axis", "ring", "literal"}
    signs : sequence of {1, -1}, optional
        s_k; by default those of the lowest energy.
    slab : float, mm
        Height of a slab for "ring".
    build : (3,) array
        Unit vector of the build direction: the mean gradient does not point against it.

    Raises
    ------
    InputError
        When neither stress nor joints determine the layers, or the signs do not fit.
    SolveError
        When the solve misses its tolerance.
    """
    if not weights.joints > 0.0:  # joints without weight leave the field to the stress
        joints = ()
    corners = _corners_of(mesh)
    matrix, sources = _quadratic(corners, tension, importance, joints, weights, form, slab)
    if not sources:
        direction = _least_stressed(tension, mesh.volumes * importance, build)
        share, count = _ANCHOR * mesh.volumes, matrix.shape[0]
        matrix = matrix + gradient_energy(corners.gradients, corners.cells, share, count)
        source = gradient_source(corners.gradients, corners.cells, direction, share, count)
        sources = [source]
    solve = _factorised(matrix)
    solutions = np.stack([solve(source) for source in sources])
    energies = _energies(np.array(sources) @ solutions.T, signs)
    # The rise of each joint's field along the build direction, over the volume.
    per_cell = (mesh.volumes, corners.gradients, solutions[:, corners.cells], build)
    best = _best_signs(energies, np.einsum("e,eid,kei,d->k", *per_cell, optimize=True))
    values = np.zeros(len(mesh.points))
    values[corners.nodes] = (np.array(best) @ solutions)[: len(corners.nodes)]
    return _scaled(mesh, values, best, energies, build)


def _scaled(
    mesh: TetMesh,
    values: FloatArray,
    signs: tuple[int, ...],
    energies: dict[tuple[int, ...], float],
    build: FloatArray,
) -> GuidanceField:
    """Field with a mean gradient of size 1, which does not point against the build direction."""
    volume = mesh.volumes
    gradient = np.einsum("eid,ei->ed", cell_gradients(mesh), values[mesh.corners])
    mean = float((volume * np.linalg.norm(gradient, axis=1)).sum() / volume.sum())
    if not mean > 0.0:
        raise InputError("the guidance field is constant: name joints, or give it stress to follow")
    if float((volume @ gradient) @ build) < 0.0:
        mean, signs = -mean, tuple(-sign for sign in signs)
    return GuidanceField(mesh, values / mean, gradient / mean, signs, energies)


class _Corners(NamedTuple):
    """The corners of a mesh, which carry the field; quadratic cells have other nodes besides.

    `nodes` (c,) of the mesh, their `points` (c, 3), the `cells` (m, 4) by position among them, the
    `gradients` (m, 4, 3) of the barycentric coordinates in the cells, 1/mm.
    """

    mesh: TetMesh
    nodes: IntArray
    points: FloatArray
    cells: IntArray
    gradients: FloatArray


def _corners_of(mesh: TetMesh) -> _Corners:
    nodes, cells = np.unique(mesh.corners, return_inverse=True)
    cells = cells.reshape(mesh.corners.shape)
    return _Corners(mesh, nodes, mesh.points[nodes], cells, cell_gradients(mesh))


def _quadratic(
    corners: _Corners,
    tension: FloatArray,
    importance: FloatArray,
    joints: Sequence[Joint],
    weights: Weights,
    form: JointForm,
    slab: float,
) -> tuple[sp.csr_array, list[FloatArray]]:
    """Matrix of the energy, and its linear term for each joint with a direction.

    The unknowns are the values at the corners, then one for each group of equal values.
    """
    mesh, _, points, cells, gradients = corners
    volume = mesh.volumes
    groups = _joint_groups(points, cells, joints, form, slab)
    count = len(points) + sum(number for _, _, number in groups)
    stress = weights.stress * volume * importance
    matrix = alignment_energy(gradients, cells, tension, stress, count)
    smooth = smoothness_energy(points, gradients, cells, mesh.faces, mesh.across, count)
    matrix = matrix + weights.smoothness * weights.length**2 * smooth
    sources, first = [], len(points)
    for k, joint in enumerate(joints):
        share = np.zeros(len(cells))
        share[joint.region] = weights.joints * volume[joint.region]
        if form == "axis" and joint.direction is not None:
            matrix = matrix + gradient_energy(gradients, cells, share, count)
        elif form != "axis":
            nodes, group, number = groups[k]
            weight = float(share.sum()) / weights.length**2
            matrix = matrix + equal_value_energy(nodes, group, weight, first, count)
            first += number
        if joint.direction is not None:
            sources.append(gradient_source(gradients, cells, joint.direction, share, count))
        if weights.holes > 0.0 and joint.direction is not None and joint.radius > 0.0:
            near = cells_at_wall(mesh, joint, weights.reach)
            share = np.zeros(len(cells))
            share[near] = weights.holes * volume[near]
            for across in np.linalg.svd(joint.direction[None])[2][1:]:
                every = np.broadcast_to(across, (len(cells), 3))
                matrix = matrix + alignment_energy(gradients, cells, every, share, count)
    return matrix, sources


def cells_at_wall(mesh: TetMesh, joint: Joint, reach: float) -> IntArray:
    """Cells of a joint, one of whose corners lies within a reach, mm, of its wall."""
    facets = mesh.boundary[np.isin(mesh.boundary, joint.wall).all(axis=1)]
    nodes, corners = np.unique(mesh.corners[joint.region], return_inverse=True)
    away = nearest_on_triangles(mesh.points, facets[:, :3], mesh.points[nodes]).distance
    return joint.region[(away[corners.reshape(-1, 4)] < reach).any(axis=1)]


def _joint_groups(
    points: FloatArray, cells: IntArray, joints: Sequence[Joint], form: JointForm, slab: float
) -> list[tuple[IntArray, IntArray, int]]:
    """Nodes of each joint, the group of each node, and the number of groups; none for "axis"."""
    parts: list[tuple[IntArray, IntArray, int]] = []
    for joint in joints if form != "axis" else ():
        nodes = np.unique(cells[joint.region])
        height, direction = np.inf, np.zeros(3)
        if form == "ring":
            if joint.direction is None:
                raise InputError(
                    f"joint '{joint.name}' is no cylinder and has no slabs: say in directions "
                    "which way the layers are stacked there, or leave it out of the joints"
                )
            height, direction = slab, joint.direction
        parts.append((nodes, *slabs(points, nodes, direction, height)))
    return parts


def _best_signs(energies: dict[tuple[int, ...], float], rising: FloatArray) -> tuple[int, ...]:
    """Signs of the lowest energy; of those that tie with it, the first of those that rise most.

    `rising`, (k,), is the rise of the field of each joint along the build direction.
    """
    least = min(energies.values())
    limit = least + _TIE * abs(least)
    tied = [signs for signs, energy in energies.items() if energy <= limit]
    height = {signs: abs(float(np.array(signs) @ rising)) for signs in tied}
    most = max(height.values())
    enough = most - 1e-6 * float(np.abs(rising).sum())
    return next(signs for signs in tied if height[signs] >= enough)


def _least_stressed(tension: FloatArray, weight: FloatArray, build: FloatArray) -> FloatArray:
    """Direction of least stress; of several equal ones, the nearest to the build direction."""
    total = np.einsum("e,ei,ej->ij", weight, tension, tension)
    if not np.trace(total) > 0.0:
        raise InputError("the layers have nothing to follow: give a stress, or name joints")
    values, vectors = np.linalg.eigh(total)
    free = vectors[:, values <= values[0] + _FREE * values.sum()]
    direction = free @ (free.T @ build)
    if np.linalg.norm(direction) < _FREE:
        direction = free[:, 0]
    return np.asarray(direction / np.linalg.norm(direction))


def _factorised(matrix: sp.csr_array) -> Any:
    """Solver of the matrix with the first node fixed at zero; every residual is checked."""
    inner = sp.csc_array(matrix[1:, 1:])
    options = {"SymmetricMode": True}
    try:
        factor = splu(inner, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except RuntimeError as error:
        raise SolveError(
            f"guidance field: {error}: check that the part is in one piece and the smoothness "
            "above 0"
        ) from error

    def solve(rhs: FloatArray) -> FloatArray:
        wanted = rhs[1:]
        x = factor.solve(wanted)
        x += factor.solve(wanted - inner @ x)
        residual = np.linalg.norm(wanted - inner @ x) / np.linalg.norm(wanted)
        if not residual <= _RESIDUAL:
            raise SolveError(
                f"guidance field: relative residual {residual:.1e} above {_RESIDUAL:.1e}: are "
                "there cells without volume?"
            )
        return np.concatenate([[0.0], x])

    return solve


def _energies(product: FloatArray, wanted: Sequence[int] | None) -> dict[tuple[int, ...], float]:
    """Energy of combinations of signs: ``-s^T P s`` with ``P_jk = b_j . G_k``.

    The field of signs s is ``sum s_k G_k``, so no combination needs a solve of its own. One sign is
    fixed, since flipping all signs flips the field.
    """
    count = len(product)

    def energy(signs: tuple[int, ...]) -> float:
        s = np.array(signs, dtype=np.float64)
        return -float(s @ product @ s)

    if wanted is not None:
        signs = tuple(int(s) for s in wanted)
        if len(signs) != count or any(abs(s) != 1 for s in signs):
            raise InputError(f"signs must be {count} numbers 1 or -1, one a joint; got {signs}")
        return {signs: energy(signs)}
    if count <= _MOST_SIGNS:
        rest = itertools.product((1, -1), repeat=count - 1)
        return {(1, *others): energy((1, *others)) for others in rest}
    energies: dict[tuple[int, ...], float] = {}
    signs = (1,) * count
    while signs not in energies:
        energies[signs] = energy(signs)
        flips = [(*signs[:k], -signs[k], *signs[k + 1 :]) for k in range(1, count)]
        signs = min([signs, *flips], key=energy)
    return energies


# Equal values of a field within groups of nodes: the paper's term for the joints.


def slabs(
    points: FloatArray, nodes: IntArray, direction: FloatArray, height: float
) -> tuple[IntArray, int]:
    """Group nodes (k,) by slabs normal to a direction; return each node's group and their number.

    The height of a slab, mm, is infinite for one group of all.
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


# Quality of a guidance field, before anything is cut.


_RANGE = (0.4, 1.5)
"""Range of the local thickness, over the nominal one, that can be printed."""


@dataclass(frozen=True)
class FieldQuality:
    """Thickness of the layers of a field, and the angle of the stress to them.

    Attributes
    ----------
    thickness_5, thickness_50, thickness_95 : float, mm
        Percentiles by volume of the distance between neighbouring layers.
    thickness_outside : float
        Share of the volume in which it is outside 0.4 to 1.5 times the nominal thickness.
    folded : float
        Share of the area between cells across which the field reverses.
    angle_mean, angle_95 : float, degrees
        Between the strongest stress and the layer, by volume over the critical region.
    angle_mean_weighted, angle_95_weighted : float, degrees
        The same, with each cell also weighted by its importance.
    within_10, within_10_weighted : float
        Share of the critical region where that angle is at most 10 degrees.
    """

    thickness_5: float
    thickness_50: float
    thickness_95: float
    thickness_outside: float
    folded: float
    angle_mean: float
    angle_95: float
    angle_mean_weighted: float
    angle_95_weighted: float
    within_10: float
    within_10_weighted: float


def field_quality(
    field: GuidanceField, tension: FloatArray, importance: FloatArray, step: float, nominal: float
) -> FieldQuality:
    """Measure a field.

    Parameters
    ----------
    tension : (m, 3) array
        Direction of the strongest stress.
    importance : (m,) array
        The critical region is where this is above 0; without one the angles are nan.
    step : float
        Difference of the field between layers.
    nominal : float, mm
        Wanted thickness.
    """
    volume = field.mesh.volumes
    size = np.linalg.norm(field.gradient, axis=1)
    thickness = step / np.maximum(size, 1e-12)
    low, middle, high = _quantiles(thickness, volume, (0.05, 0.5, 0.95))
    ratio = thickness / nominal
    outside = float(volume[(ratio < _RANGE[0]) | (ratio > _RANGE[1])].sum() / volume.sum())
    normal = field.gradient / np.maximum(size, 1e-300)[:, None]
    sine = np.abs(np.einsum("ed,ed->e", normal, tension))
    angle = np.degrees(np.arcsin(np.clip(sine, 0.0, 1.0)))
    critical = importance > 0.0
    values = []
    for weight in (volume[critical], (volume * importance)[critical]):
        values.append(_angles(angle[critical], weight))
    (mean, top, near), (mean_w, top_w, near_w) = values
    return FieldQuality(
        low, middle, high, outside, folded_share(field), mean, top, mean_w, top_w, near, near_w
    )


def folded_share(field: GuidanceField) -> float:
    """Share of the area between cells across which the gradient turns by more than 90 degrees."""
    first, side = np.nonzero(field.mesh.across > np.arange(len(field.mesh.cells))[:, None])
    second = field.mesh.across[first, side]
    area, _ = field.mesh.facet_areas(field.mesh.corners[first[:, None], field.mesh.faces[side]])
    against = np.einsum("fd,fd->f", field.gradient[first], field.gradient[second]) <= 0.0
    return float(area[against].sum() / max(float(area.sum()), 1e-300))


def _angles(angle: FloatArray, weight: FloatArray) -> tuple[float, float, float]:
    """Mean, 95th percentile and share within 10 degrees."""
    if not weight.sum() > 0.0:
        return np.nan, np.nan, np.nan
    return (
        float(np.average(angle, weights=weight)),
        _quantiles(angle, weight, (0.95,))[0],
        float(weight[angle <= 10.0].sum() / weight.sum()),
    )


def _quantiles(
    values: FloatArray, weight: FloatArray, shares: tuple[float, ...]
) -> tuple[float, ...]:
    """Quantiles of weighted values."""
    order = np.argsort(values, kind="stable")
    along = np.cumsum(weight[order]) / weight.sum()
    at = np.minimum(np.searchsorted(along, shares), len(values) - 1)
    return tuple(float(v) for v in values[order][at])
