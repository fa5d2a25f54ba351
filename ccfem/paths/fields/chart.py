"""A curved layer laid flat with little distortion, so that planar methods work on it too.

Least-squares conformal map (Levy et al. 2002), then the local/global iteration for maps that are as
rigid as possible (Liu, Zhang, Xu, Gotsman, Gortler, A local/global approach to mesh
parameterization, Computer Graphics Forum 27 (2008) 1495-1504).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.compiled import compiled
from ccfem.base.errors import InputError
from ccfem.geometry.locate import locate, nearest_on_triangles
from ccfem.geometry.polylines import subdivide
from ccfem.paths.fields.layer_elements import Surface, positive_definite
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, Plane, charted_rings, curved_layers, plane_frame

_ROUNDS = 30
_STEP = 0.5
_MOST_OVER = 0.01
_ON = 0.01
_CHART = "_chart"
_GAP = 10.0
"""Distance between pieces of a layer in its chart, mm."""


@dataclass(frozen=True)
class Chart:
    """A curved layer and its flat image.

    Attributes
    ----------
    flat : Layer
        The same triangles in the plane z = 0; its `turns` rotate tensors of the part into it.
    stretches : (t, 2) array
        Singular values of the map on each triangle, the larger first: 1 where lengths are kept.
    """

    layer: Layer
    flat: Layer
    stretches: FloatArray

    def __post_init__(self) -> None:
        freeze(self, stretches=float)

    @property
    def distortion(self) -> float:
        """Relative change of length that 95 % of the area does not exceed."""
        worst = np.maximum(self.stretches[:, 0], 1.0 / np.maximum(self.stretches[:, 1], 1e-9))
        order = np.argsort(worst, kind="stable")
        below = np.cumsum(self.layer.areas[order])
        at = min(int(np.searchsorted(below, 0.95 * below[-1])), len(order) - 1)
        return float(worst[order[at]] - 1.0)

    def images(self, points: FloatArray) -> FloatArray:
        """Images (n, 3) in the chart of points (n, 3) on the layer, mm."""
        if not len(points):
            return np.zeros((0, 3))
        return self.layer.values_at(self.layer.nearest(points), self.flat.points)

    def flattened(self, paths: Toolpaths) -> Toolpaths:
        """Images in the chart of paths on the layer."""
        points = self.images(paths.points)
        normals = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
        return replace(paths, points=points, normals=normals)

    def pieces(
        self, middle: FloatArray, tangent: FloatArray, most: float = _ON
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Images of small pieces of fibre, and the mask of those that lie on the layer.

        Parameters
        ----------
        middle, tangent : (s, 3) arrays
            Middle and direction of each piece, on any layer.
        most : float, default 0.01 mm
            Distance from the layer below which a piece lies on it.

        Returns
        -------
        middle, tangent : (k, 3) arrays
            Of the pieces on the layer.
        near : (s,) bool array
            Mask of these pieces.
        """
        nearest = nearest_on_triangles(self.layer.points, self.layer.triangles, middle)
        near = nearest.distance < most
        triangle = nearest.triangle[near]
        corners = self.flat.points[self.layer.triangles[triangle]]
        points = np.einsum("qk,qkd->qd", nearest.weights[near], corners)
        assert self.flat.turns is not None
        return points, np.einsum("qij,qj->qi", self.flat.turns[triangle], tangent[near]), near

    def lifted(self, paths: Toolpaths) -> Toolpaths:
        """Paths of the chart on the curved layer, with points at most half a millimetre apart."""
        if not len(paths):
            return paths
        flat, offsets, segment = subdivide(paths.points, paths.offsets, _STEP)
        triangle, weights = locate(self.flat.points[:, :2], self.layer.triangles, flat[:, :2])
        left = np.flatnonzero(triangle < 0)
        if len(left):
            nearest = nearest_on_triangles(self.flat.points, self.layer.triangles, flat[left])
            triangle[left], weights[left] = nearest.triangle, nearest.weights
        corners = self.layer.triangles[triangle]
        points = np.einsum("qk,qkd->qd", weights, self.layer.points[corners])
        normals = np.einsum("qk,qkd->qd", weights, self.layer.point_normals[corners])
        size = np.linalg.norm(normals, axis=1, keepdims=True)
        return replace(
            paths,
            points=points,
            normals=normals / np.maximum(size, 1e-300),
            offsets=offsets,
            link=paths.link[segment],
        )


class IdentityChart(Chart):
    """The chart of a flat layer: the layer itself, and its paths as they are."""

    def images(self, points: FloatArray) -> FloatArray:
        """Return the points."""
        return points

    def flattened(self, paths: Toolpaths) -> Toolpaths:
        """Return the paths."""
        return paths

    def pieces(
        self, middle: FloatArray, tangent: FloatArray, most: float = _ON
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Return the pieces of fibre; no length is projected, so all lie on the layer."""
        return middle, tangent, np.ones(len(middle), dtype=bool)

    def lifted(self, paths: Toolpaths) -> Toolpaths:
        """Return the paths."""
        return paths


def chart_of(layer: Layer) -> Chart:
    """Lay a layer flat: a flat one as it is; a curved one stores its chart, computed once.

    Raises
    ------
    InputError
        When more than 1 % of the area is inverted, since the layer is closed or doubly curved too
        strongly. Single slivers at the border may be.
    """
    if layer.flat is not None:
        return IdentityChart(layer, layer, np.ones((len(layer.triangles), 2)))
    known = vars(layer)
    if _CHART not in known:
        known[_CHART] = _flattened(layer)
    chart: Chart = known[_CHART]
    return chart


def flat_view(layer: Layer) -> Layer:
    """Return a flat layer itself, and the chart of a curved one."""
    return chart_of(layer).flat


def in_charts(paths: Toolpaths, layers: Sequence[Layer]) -> Toolpaths:
    """Paths, of which those on curved layers are laid flat."""
    if not curved_layers(layers):
        return paths
    parts = []
    for layer in layers:
        mine = paths.on_layer(layer.index)
        parts.append(chart_of(layer).flattened(mine) if len(mine) else mine)
    return Toolpaths.concatenate(parts)


def _flattened(layer: Layer) -> Chart:
    surface = Surface(layer.points, layer.triangles)
    image = np.zeros((len(layer.points), 2))
    rotation = np.zeros((len(layer.triangles), 2, 2))
    right = 0.0
    for number in range(int(layer.component.max(initial=-1)) + 1):
        rows = np.flatnonzero(layer.component == number)
        nodes, local = np.unique(layer.triangles[rows], return_inverse=True)
        piece = Surface(layer.points[nodes], local.reshape(-1, 3))
        placed, turned = _rigid(piece, _conformal(piece))
        rotation[rows] = turned @ np.einsum("tkd,tld->tkl", piece.frames, surface.frames[rows])
        spin = _along_axes(piece, placed)
        placed, rotation[rows] = placed @ spin.T, spin @ rotation[rows]
        # Pieces side by side.
        placed = placed - placed.min(axis=0) + [right, 0.0]
        right = float(placed[:, 0].max()) + _GAP
        image[nodes] = placed
    jacobian = np.einsum("tid,tik->tdk", image[layer.triangles], surface.gradients)
    stretches = np.linalg.svd(jacobian, compute_uv=False)
    # Triangles that are turned over, or folded flat.
    over = np.linalg.det(jacobian) <= 0.0
    if surface.areas[over].sum() > _MOST_OVER * surface.areas.sum():
        raise InputError(
            f"layer {layer.index} cannot be laid flat without a fold: choose a strategy for curved "
            "layers (winding), or a planar slicing"
        )
    turns = np.concatenate(
        [np.einsum("tij,tjd->tid", rotation, surface.frames), layer.normals[:, None]], axis=1
    )
    maps = np.concatenate([jacobian @ surface.frames, layer.normals[:, None]], axis=1)
    about = (layer.points, image, layer.triangles, maps, layer.loops, layer.walls)
    flat = replace(
        layer,
        points=np.column_stack([image, np.zeros(len(image))]),
        flat=Plane(np.eye(3), 0.0),
        walls=(),
        outline=charted_rings(*about),
        turns=turns,
        point_turns=_point_rotations(layer, turns),
    )
    return Chart(layer, flat, stretches)


def _conformal(surface: Surface) -> FloatArray:
    """Least-squares conformal map, (n, 2), with two distant points fixed."""
    n, points = len(surface.points), surface.points
    laplacian = surface.energy(surface.areas[:, None, None] * np.eye(2))
    border = _border(surface.triangles)
    value = np.full(len(border), 0.5)
    # Area of the image: half the sum of u_a v_b - u_b v_a along its border.
    area = sp.coo_array((value, border.T), shape=(n, n)).tocsr()
    skew = area - area.T
    matrix = sp.block_array([[laplacian, -skew], [-skew.T, laplacian]]).tocsc()
    ends = np.unique(border) if len(border) else np.arange(n)
    first = ends[np.argmax(np.linalg.norm(points[ends] - points[ends].mean(axis=0), axis=1))]
    last = ends[np.argmax(np.linalg.norm(points[ends] - points[first], axis=1))]
    values = np.zeros(2 * n)
    values[last] = np.linalg.norm(points[last] - points[first])
    held = np.array([first, last, n + first, n + last])
    free = np.setdiff1d(np.arange(2 * n), held)
    rows = sp.csr_array(matrix)[free]
    values[free] = positive_definite(rows[:, free]).solve(-(rows @ values))
    return values.reshape(2, n).T


def _rigid(surface: Surface, image: FloatArray) -> tuple[FloatArray, FloatArray]:
    """As rigid a map as possible, from a first one, and the rotation (t, 2, 2) of each triangle."""
    metric = surface.areas[:, None, None] * np.eye(2)
    matrix = sp.csr_array(surface.energy(metric))[1:]
    factor = positive_definite(matrix[:, 1:])
    rotation = _rotations(surface, image)
    for _ in range(_ROUNDS):
        moved = np.zeros_like(image)
        for axis in (0, 1):
            wanted = surface.areas[:, None] * rotation[:, axis]
            moved[1:, axis] = factor.solve(surface.source(wanted)[1:])
        rotation, image = _rotations(surface, moved), moved
    return image, rotation


def _rotations(surface: Surface, image: FloatArray) -> FloatArray:
    """Rotation (t, 2, 2) nearest to the map of each triangle."""
    rotations: FloatArray = _nearest_rotations(surface.gradients, surface.triangles, image)
    return rotations


@compiled
def _nearest_rotations(gradients: FloatArray, triangles: IntArray, image: FloatArray) -> FloatArray:
    rotations = np.empty((len(triangles), 2, 2))
    for t in range(len(triangles)):
        cosine, sine = 0.0, 0.0
        for i in range(3):
            u, v = image[triangles[t, i], 0], image[triangles[t, i], 1]
            cosine += u * gradients[t, i, 0] + v * gradients[t, i, 1]
            sine += v * gradients[t, i, 0] - u * gradients[t, i, 1]
        size = np.hypot(cosine, sine)
        if size > 0.0:
            cosine, sine = cosine / size, sine / size
        else:
            cosine, sine = 1.0, 0.0
        rotations[t, 0, 0], rotations[t, 0, 1] = cosine, -sine
        rotations[t, 1, 0], rotations[t, 1, 1] = sine, cosine
    return rotations


def _along_axes(surface: Surface, image: FloatArray) -> FloatArray:
    """Rotation (2, 2) that aligns the chart with its mean plane: see `plane_frame`."""
    normal = np.cross(surface.frames[:, 0], surface.frames[:, 1])
    mean = surface.areas @ normal
    up = mean.tolist() if np.linalg.norm(mean) > 0.0 else [0.0, 0.0, 1.0]
    axis = plane_frame(up)[0]
    j = np.einsum("tid,tik->tdk", image[surface.triangles], surface.gradients)
    x, y = np.einsum("t,tdk,tkc,c->d", surface.areas, j, surface.frames, axis, optimize=True)
    size = max(float(np.hypot(x, y)), 1e-300)
    return np.array([[x, y], [-y, x]]) / size


def _border(triangles: IntArray) -> IntArray:
    """Border edges (b, 2), directed as in their triangles."""
    sides = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    count = int(triangles.max()) + 1
    forth, back = sides[:, 0] * count + sides[:, 1], sides[:, 1] * count + sides[:, 0]
    return np.asarray(sides[~np.isin(forth, back)])


def _point_rotations(layer: Layer, turns: FloatArray) -> FloatArray:
    """Rotation (n, 3, 3) at each point, nearest to the mean of the triangles round it."""
    n, corners = len(layer.points), layer.triangles.ravel()
    first = np.zeros((n, 3))
    for axis in range(3):
        share = np.repeat(layer.areas * turns[:, 0, axis], 3)
        first[:, axis] = np.bincount(corners, share, minlength=n)
    normal = layer.point_normals
    first = first - np.einsum("nd,nd->n", first, normal)[:, None] * normal
    first = first / np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    return np.stack([first, np.cross(normal, first), normal], axis=1)
