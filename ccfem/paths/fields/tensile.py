"""Tension: its direction and size, signs and filter [Chen et al. 2021, section 4.1]."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import check_known
from ccfem.base.compiled import compiled
from ccfem.base.tensor import in_plane, largest_in_plane, principal, strongest, strongest_in_plane
from ccfem.fem.elasticity import PartStress
from ccfem.slicing.layers.layer import Layer, LayerStress

# The incompatibility filter: where neighbouring vectors disagree [Chen et al. 2021, Eq. 2].


_LIMIT = 0.5
"""The paper's eta."""

Incompatible = Literal["any", "majority", "all", "none"]


def incompatible(
    direction: FloatArray, cells: IntArray, defined: BoolArray, rule: Incompatible = "any"
) -> BoolArray:
    """Mark, (m,), cells whose vector disagrees with those of neighbouring cells.

    Cells that share a node are neighbours. They disagree when ``v . v* <= 0.5``, the paper's eta.

    Parameters
    ----------
    direction : (m, 3) array
        Oriented unit vectors.
    cells : (m, 4) int array
        Corner nodes.
    defined : (m,) bool array
        Cells without a vector are neither marked nor compared.
    rule : {"any", "majority", "all", "none"}, default "any"
        How many of the neighbours have to disagree. The paper prints "for all", which marks almost
        nothing; "any" reproduces its figures.
    """
    if rule == "none":
        return np.zeros(len(cells), dtype=bool)
    check_known("rule on incompatible directions", rule, get_args(Incompatible))
    nodes = cells.ravel()
    order = np.argsort(nodes, kind="stable")
    start = np.searchsorted(nodes[order], np.arange(int(nodes.max()) + 2))
    against, asked = _disagreeing(direction, cells, defined, order // 4, start)
    if rule == "any":
        return defined & (against > 0)
    if rule == "majority":
        return defined & (2 * against > asked)
    return defined & (against == asked) & (asked > 0)


@compiled
def _disagreeing(
    direction: FloatArray, cells: IntArray, defined: BoolArray, cell_of: IntArray, start: IntArray
) -> tuple[IntArray, IntArray]:
    count = len(cells)
    against = np.zeros(count, np.int64)
    asked = np.zeros(count, np.int64)
    seen = np.full(count, -1)
    for e in range(count):
        if not defined[e]:
            continue
        # Every cell that shares a node with this one is asked once.
        seen[e] = e
        for node in cells[e]:
            for k in range(start[node], start[node + 1]):
                other = cell_of[k]
                if seen[other] == e or not defined[other]:
                    continue
                seen[other] = e
                asked[e] += 1
                product = 0.0
                for axis in range(3):
                    product += direction[e, axis] * direction[other, axis]
                against[e] += product <= _LIMIT
    return against, asked


@dataclass(frozen=True)
class Tension:
    """Tension at k places, such as the triangles of a layer or the tetrahedra of a part.

    Attributes
    ----------
    direction : (k, 2) array in a plane, (k, 3) in space
        Unit vectors; arbitrary where undefined.
    stress : (k,) array, MPa
        Tensile stress along the direction, 0 where there is none. The paper uses 1e-5 MPa, which
        would count more, the smaller the load is.
    defined : (k,) bool array
        Whether there is a tensile direction.
    oriented : bool
        Whether neighbouring vectors point the same way. Otherwise they are lines, whose sign is
        arbitrary.
    """

    direction: FloatArray
    stress: FloatArray
    defined: BoolArray
    oriented: bool = False

    def on(self, layer: Layer) -> "Tension":
        """Project from tetrahedra to a flat layer: each triangle takes the values of its cell."""
        direction = self.direction[layer.cell]
        if layer.turns is not None:
            direction = np.einsum("tij,tj->ti", layer.turns, direction)
        plane = direction @ layer.plane.frame[:2].T
        length = np.linalg.norm(plane, axis=1)
        defined = self.defined[layer.cell] & (length > 1e-6)
        unit = plane / np.maximum(length, 1e-300)[:, None]
        unit = np.where(defined[:, None], unit, [1.0, 0.0])
        return Tension(unit, self.stress[layer.cell], defined, self.oriented)


def spatial_tension(stress: FloatArray, compression_limit: float = 3.0) -> Tension:
    """Tension of stress (k, 3, 3), MPa, in space, by the paper's rule with the limit mu.

    Principal stresses are sorted by absolute value, largest first. The first is used if it is
    tensile. Otherwise the second is used if it is tensile, and the first is less than
    `compression_limit` times as large. Otherwise there is no tensile direction, and the first
    direction replaces it.
    """
    values, directions = principal(stress)
    order = np.argsort(-np.abs(values), axis=1, kind="stable")
    values = np.take_along_axis(values, order, axis=1)
    directions = np.take_along_axis(directions, order[:, None, :], axis=2)
    first = values[:, 0] > 0.0
    second = ~first & (values[:, 1] > 0.0) & (-values[:, 0] < compression_limit * values[:, 1])
    taken = np.where(second, 1, 0)
    rows = np.arange(len(values))
    defined = first | second
    size = np.where(defined, values[rows, taken], 0.0)
    return Tension(directions[rows, :, taken], size, defined)


def plane_tension(plane_stress: FloatArray, compression_limit: float = 3.0) -> Tension:
    """Tension of plane stress, by the paper's rule applied in the plane of the layer.

    A fibre in a flat layer carries only the stress in its plane, so planning uses this by default.
    For in-plane stress it equals the projection of `spatial_tension`. The plane stress (k, 3), MPa,
    is s11, s22, s12; the limit is the paper's mu.
    """
    largest, smallest, angle = largest_in_plane(plane_stress)
    defined = (largest > 0.0) & (-smallest < compression_limit * largest)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    across = np.stack([-direction[:, 1], direction[:, 0]], axis=1)
    compressed, _ = strongest(largest, smallest)
    direction = np.where((compressed & ~defined)[:, None], across, direction)
    return Tension(direction, np.where(defined, largest, 0.0), defined)


# Tension on the triangles of a layer, from the in-plane stress or from the whole part.


_ANY_COMPRESSION = 1e12
"""Limit of compression over tension that excludes nothing."""


def layer_tension(
    stress: LayerStress,
    source: Literal["nodal", "cell"] = "nodal",
    sense: Literal["tensile", "absolute"] = "tensile",
    compression_limit: float = 3.0,
) -> Tension:
    """Tension on the triangles of a layer from its in-plane stress.

    Parameters
    ----------
    source : {"nodal", "cell"}
        Recovered stress, averaged over the corners of each triangle, or stress of its tetrahedron.
    sense : {"tensile", "absolute"}
        Use the tensile principal stress, or that of largest absolute value.
    compression_limit : float, default 3.0
        See `fields.tensile.plane_tension`.
    """
    layer = stress.layer
    tensors = stress.cell if source == "cell" else stress.nodal[layer.triangles].mean(axis=1)
    plane = in_plane(tensors, layer.plane.frame)
    if sense == "tensile":
        return plane_tension(plane, compression_limit)
    value, angle, _ = strongest_in_plane(plane)
    size = np.abs(value)
    return Tension(np.stack([np.cos(angle), np.sin(angle)], axis=1), size, size > 0.0)


def mesh_tension(
    stress: PartStress,
    source: Literal["nodal", "cell"] = "cell",
    sense: Literal["tensile", "absolute"] = "tensile",
    compression_limit: float = 3.0,
    rule: Incompatible = "any",
) -> Tension:
    """Tension in space of all tetrahedra, as Chen et al. 2021 section 4.1 processes it.

    Vectors are chosen by `spatial_tension` and oriented along the minimum spanning tree over the
    faces; cells without a tensile direction only take part in the orientation. Where the filter
    finds vectors incompatible, they become undefined, but the stress is kept.
    """
    cells = stress.mesh.corners
    tensors = stress.stress if source == "cell" else stress.nodal[cells].mean(axis=1)
    tension = spatial_tension(tensors, compression_limit)
    if sense == "absolute":
        pushed = spatial_tension(-tensors, _ANY_COMPRESSION)
        push = pushed.stress > tension.stress
        tension = Tension(
            np.where(push[:, None], pushed.direction, tension.direction),
            np.where(push, pushed.stress, tension.stress),
            tension.defined | pushed.defined,
        )
    direction = orient(tension.direction, stress.mesh.neighbours)
    against = incompatible(direction, cells, tension.defined, rule)
    return Tension(direction, tension.stress, tension.defined & ~against, oriented=True)


# Consistent signs for a field of lines along a minimum spanning tree [Chen et al. 2021, Eq. 1].


def orient(
    direction: FloatArray, pairs: IntArray, confidence: FloatArray | None = None
) -> FloatArray:
    """Flip vectors so that neighbours point the same way wherever possible.

    Signs are propagated along the minimum spanning tree of the weights ``1 - |v_i . v_j|``. Edges
    are taken in the order of their weight. The trees are joined by union-find, which stores the
    sign of every element relative to its root, so that no graph is traversed.

    Parameters
    ----------
    direction : (k, 2) or (k, 3) array
        Unit vectors.
    pairs : (e, 2) int array
        Neighbouring elements.
    confidence : (k,) array in [0, 1], optional
        Weights become ``1 - min(c_i, c_j) |v_i . v_j|``. If a field of lines cannot be oriented
        consistently, it flips across a cut. In a smooth field only the confidence tells where that
        cut does no harm.

    Returns
    -------
    (k, 2) or (k, 3) array
        `direction` or its opposite, element by element. Each connected component keeps the sign
        of its first element.
    """
    product = np.einsum("ij,ij->i", direction[pairs[:, 0]], direction[pairs[:, 1]])
    alike = np.abs(product)
    if confidence is not None:
        alike = np.minimum(confidence[pairs[:, 0]], confidence[pairs[:, 1]]) * alike
    order = np.argsort(1.0 - alike, kind="stable")
    count = len(direction)
    sign, parent, parity = np.ones(count), np.arange(count), np.zeros(count, dtype=bool)
    _set_signs(pairs[order], product[order] < 0.0, parent, parity, sign)
    return direction * sign[:, None]


@compiled
def _set_signs(
    pairs: IntArray, opposite: BoolArray, parent: IntArray, parity: BoolArray, sign: FloatArray
) -> None:
    """Turn signs; the parity of an element is relative to its parent, first itself."""
    root_of_pair = np.empty(2, np.int64)
    odd = np.empty(2, np.bool_)
    for e in range(len(pairs)):
        for side in range(2):
            element = pairs[e, side]
            turned = False
            while parent[element] != element:
                above = parent[element]
                parity[element] ^= parity[above] and parent[above] != above
                parent[element] = parent[above]
                turned ^= parity[element]
                element = parent[element]
            root_of_pair[side] = element
            odd[side] = turned
        a, b = root_of_pair[0], root_of_pair[1]
        if a != b:
            # The smaller index stays the root: the first element keeps its sign.
            if b < a:
                a, b = b, a
            parent[b] = a
            parity[b] = odd[0] ^ odd[1] ^ opposite[e]
    for start in range(len(sign)):
        element = start
        turned = False
        while parent[element] != element:
            turned ^= parity[element]
            element = parent[element]
        if turned:
            sign[start] = -1.0
