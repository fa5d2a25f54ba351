"""Layer normals in the whole part, filled in between regions where they are given.

Kipping and Schueppstuhl 2023 (Materials 16, 998), equations 4 and 5, with weights that approximate
an integral (area over distance of centres). The sense of each region is chosen so that neighbours
agree best. The filled field is linear in the senses, so that trying one costs no solve.
"""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree

from ccfem.base.arrays import FloatArray, IntArray, freeze
from ccfem.base.compiled import compiled
from ccfem.body.mesh import TetMesh
from ccfem.fem.elasticity.direct import superlu
from ccfem.slicing.guidance.energies import faces_between
from ccfem.slicing.guidance.stress_regions import StressRegions

_MOST_TRIED = 10
"""Regions up to which all senses are tried; above, this number of the best by a quadratic form."""
_NOTHING = 1e-6
"""Length of a filled vector below which it has no direction."""
_STARTS = 20
"""Random starts for the quadratic form, from which senses are flipped one by one."""


@dataclass(frozen=True)
class NormalField:
    """Directions that the layers should be normal to.

    Attributes
    ----------
    direction : (m, 3) array
        Of length 1.
    senses : tuple of int
        1 or -1 for each region.
    energy : float, mm^2
        Sum over the faces between cells of area times ``(1 - cosine)^2``.
    """

    direction: FloatArray
    senses: tuple[int, ...]
    energy: float

    def __post_init__(self) -> None:
        freeze(self, direction=float)


def normal_field(mesh: TetMesh, regions: StressRegions, build: FloatArray) -> NormalField:
    """Fill the part with directions that vary least between the regions of critical stress.

    Pieces of the part without a region take the unit vector `build` (3,). The field as a whole does
    not point against it.
    """
    one, other, vector, apart = faces_between(mesh.points, mesh.corners, mesh.faces, mesh.across)
    area = np.linalg.norm(vector, axis=1)
    parts = _filled(regions, one, other, area / apart, build)
    best: tuple[int, ...] = ()
    energy = np.inf
    for senses in _candidates(parts, one, other, area):
        trial = _jump_energy(parts, np.array((*senses, 1.0)), one, other, area)
        if trial < energy * (1.0 - 1e-9):
            best, energy = senses, trial
    mixed = np.tensordot(np.array((*best, 1.0)), parts, axes=1)
    size = np.linalg.norm(mixed, axis=1)[:, None]
    direction = np.where(size > _NOTHING, mixed / np.maximum(size, 1e-300), build)
    if float(mesh.volumes @ (direction @ build)) < 0.0:
        direction, best = -direction, tuple(-sense for sense in best)
    return NormalField(direction, best, energy)


def _filled(
    regions: StressRegions, one: IntArray, other: IntArray, weight: FloatArray, build: FloatArray
) -> FloatArray:
    """Fields (r + 1, m, 3): of each region alone, and last of the pieces without a region."""
    m, count = len(regions.region), regions.count
    half = sp.coo_array((weight, (one, other)), shape=(m, m))
    graph = sp.csr_array(half + half.T)
    piece = connected_components(graph, directed=False)[1]
    fixed = regions.region >= 0
    alone = ~np.isin(piece, np.unique(piece[fixed]))
    parts = np.zeros((count + 1, m, 3))
    for k in range(count):
        inside = regions.region == k
        parts[k, inside] = regions.direction[inside]
    parts[-1, alone] = build
    free = np.flatnonzero(~fixed & ~alone)
    if len(free):
        degree = sp.diags_array(np.asarray(graph.sum(axis=1)))
        solve = superlu((degree - graph)[free][:, free])
        source = graph[free] @ parts[:-1].transpose(1, 0, 2).reshape(m, -1)
        parts[:-1, free] = solve(source).reshape(-1, count, 3).transpose(1, 0, 2)
    return parts


def _candidates(
    parts: FloatArray, one: IntArray, other: IntArray, area: FloatArray
) -> Iterable[tuple[int, ...]]:
    """Senses to be tried: all, or those with the least sums of area times squared jump."""
    count = len(parts) - 1
    if count <= _MOST_TRIED:
        return ((1, *rest) for rest in itertools.product((1, -1), repeat=count - 1))
    jump = (parts[:-1, one] - parts[:-1, other]) * np.sqrt(area)[:, None]
    form = np.tensordot(jump, jump, axes=((1, 2), (1, 2)))
    random = np.random.default_rng(0)
    starts = [_agreeing(form), *(random.choice((-1.0, 1.0), count) for _ in range(_STARTS))]
    energies: dict[tuple[int, ...], float] = {}
    for sense in starts:
        while True:
            # Change by a flip: 4 times the sum of the row without its diagonal, times its sign.
            gain = -4.0 * sense * (form @ sense) + 4.0 * np.diag(form)
            best = int(gain.argmin())
            if not gain[best] < -1e-12 * abs(float(sense @ form @ sense)):
                break
            sense[best] = -sense[best]
        for flipped in (None, *range(count)):
            near = sense.copy()
            if flipped is not None:
                near[flipped] = -near[flipped]
            near = near * near[0]
            energies[tuple(near.astype(int).tolist())] = float(near @ form @ near)
    return sorted(energies, key=lambda senses: energies[senses])[:_MOST_TRIED]


def _agreeing(form: FloatArray) -> FloatArray:
    """Senses for which the most strongly coupled regions agree, along a spanning tree."""
    feel = np.abs(form)
    tree = minimum_spanning_tree(sp.csr_array(np.triu(2.0 * feel.max() - feel, 1)))
    order, before = breadth_first_order(tree, 0, directed=False)
    sense = np.ones(len(form))
    for k in order[1:].tolist():
        sense[k] = sense[before[k]] * (-1.0 if form[k, before[k]] > 0.0 else 1.0)
    return sense


@compiled
def _jump_energy(
    parts: FloatArray, senses: FloatArray, one: IntArray, other: IntArray, area: FloatArray
) -> float:
    """Sum over faces of area times (1 - cosine)^2 of the mixed field, normalised."""
    count, m, _ = parts.shape
    unit = np.zeros((m, 3))
    for c in range(m):
        x = y = z = 0.0
        for k in range(count):
            x += senses[k] * parts[k, c, 0]
            y += senses[k] * parts[k, c, 1]
            z += senses[k] * parts[k, c, 2]
        size = max(np.sqrt(x * x + y * y + z * z), 1e-300)
        unit[c, 0], unit[c, 1], unit[c, 2] = x / size, y / size, z / size
    total = 0.0
    for f in range(len(one)):
        cosine = 0.0
        for d in range(3):
            cosine += unit[one[f], d] * unit[other[f], d]
        total += area[f] * (1.0 - cosine) ** 2
    return total
