"""Axes of the layers in the cells of a part: what tells flat layers from curved ones in designs.

Flat layers share one frame, and a field on them has two coordinates: those of their plane. On
curved layers every cell has the frame of the layer nearest to it. A field on them is one of space,
of which each layer has the values along its surface: the gradient that counts is that along the
layer. What is designed is thus the same at neighbouring layers, as it is at all flat ones, and does
not depend on how a layer is laid flat.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import Any

import numpy as np
import scipy.sparse as sp

from ccfem.base.arrays import FloatArray, IntArray, freeze
from ccfem.base.tensor import bond_matrix
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.slicing.layers.layer import Layer, curved_layers
from ccfem.strategies.fibre_aware.spline_grid import SplineGrid

_NEAREST = "_nearest_layers"

_ALONG = [0, 1, 5]
"""Places of stresses 11, 22 and 12 among those of Voigt."""


@dataclass(frozen=True)
class LayerAxes:
    """Axes of the layers in the cells: those of flat layers, or a frame for each cell.

    Attributes
    ----------
    frames : (3, 3) or (m, 3, 3) array
        Rows: two unit vectors along the layers, and their normal.
    """

    frames: FloatArray

    def __post_init__(self) -> None:
        freeze(self, frames=float)

    @property
    def curved(self) -> bool:
        """Whether every cell has a frame of its own."""
        return self.frames.ndim == 3

    @property
    def normal(self) -> FloatArray | None:
        """Normal (3,) that all layers share, if they do."""
        return None if self.curved else self.frames[2]

    def places(self, points: FloatArray) -> FloatArray:
        """Coordinates (n, d) in which fields are given, of points (n, 3)."""
        return points if self.curved else points @ self.frames[:2].T

    def along(self, vectors: FloatArray, cells: IntArray | None = None) -> FloatArray:
        """Components (k, .., 2) along the layers of vectors (k, .., 3) in cells (k,) or in all."""
        if not self.curved:
            return vectors @ self.frames[:2].T
        axes = self._of(cells)[:, :2]
        return np.asarray(np.einsum("k...d,kid->k...i", vectors, axes))

    def across(self, vectors: FloatArray, cells: IntArray) -> FloatArray:
        """Components (k,) along the normals of the layers of vectors (k, 3) in cells (k,)."""
        if not self.curved:
            return vectors @ self.frames[2]
        return np.asarray(np.einsum("kd,kd->k", vectors, self._of(cells)[:, 2]))

    def moved(self, places: FloatArray, steps: FloatArray, cells: IntArray) -> FloatArray:
        """Coordinates (k, d) of places in cells (k,) after steps (k, 2) along the layers."""
        if not self.curved:
            return places + steps
        return places + np.einsum("ki,kid->kd", steps, self._of(cells)[:, :2])

    def in_space(self, vectors: FloatArray) -> FloatArray:
        """Vectors (m, 3) of components (m, 2) along the layers, one for each cell."""
        axes = np.broadcast_to(self.frames, (len(vectors), 3, 3))[:, :2]
        return np.asarray(np.einsum("ki,kid->kd", vectors, axes))

    def stiffness_in_space(self, stiffness: FloatArray) -> FloatArray:
        """Stiffness (m, 6, 6), MPa, of one along the layers, (m, 3, 3) for 11, 22 and 12."""
        turn = bond_matrix(np.swapaxes(self.frames, -1, -2))[..., _ALONG]
        return np.asarray(turn @ stiffness @ np.swapaxes(turn, -1, -2))

    def slopes(
        self, grid: SplineGrid, places: FloatArray, cells: IntArray | None = None
    ) -> tuple[Any, Any]:
        """Matrices (k, c) from a field's coefficients to both components of its gradient, 1/mm.

        Parameters
        ----------
        places : (k, d) array, mm
        cells : (k,) int array, optional
            By default the places are one in each cell, in their order.
        """
        gradient = grid.slopes(places)
        if not self.curved:
            return gradient[0], gradient[1]
        first, second = (
            reduce(
                add, (sp.diags_array(a) @ part for a, part in zip(axis.T, gradient, strict=True))
            )
            for axis in np.moveaxis(self._of(cells)[:, :2], 1, 0)
        )
        return first.tocsr(), second.tocsr()

    def _of(self, cells: IntArray | None) -> FloatArray:
        return self.frames if cells is None else self.frames[cells]


@dataclass(frozen=True)
class NearestLayers:
    """The layer nearest to each cell of a part, where layers are curved.

    Attributes
    ----------
    number : (m,) int array
        Position of the layer in the stack.
    frames : (m, 3, 3) array
        Two unit vectors along the layer there, and its normal.
    thickness : (m,) array, mm
        Of the layer there.
    """

    number: IntArray
    frames: FloatArray
    thickness: FloatArray

    def __post_init__(self) -> None:
        freeze(self, number=int, frames=float, thickness=float)

    @classmethod
    def of(cls, centres: FloatArray, layers: Sequence[Layer]) -> "NearestLayers":
        """Layers nearest to the centres (m, 3) of cells; the first layer stores them."""
        key = (np.asarray(centres).tobytes(), tuple(map(id, layers)))
        # The layers are kept, so that no other layer can get the same id.
        known = vars(layers[0]).setdefault(_NEAREST, {})
        if key not in known:
            known[key] = cls._found(centres, layers), layers
        nearest: NearestLayers = known[key][0]
        return nearest

    @classmethod
    def _found(cls, centres: FloatArray, layers: Sequence[Layer]) -> "NearestLayers":
        sizes = [len(layer.points) for layer in layers]
        first = np.cumsum([0, *sizes])
        points = np.concatenate([layer.points for layer in layers])
        triangles = np.concatenate(
            [layer.triangles + k for layer, k in zip(layers, first, strict=False)]
        )
        nearest = nearest_on_triangles(points, triangles, centres)
        corners = triangles[nearest.triangle]
        normals = np.concatenate([layer.point_normals for layer in layers])
        thickness = np.concatenate([layer.local_thickness for layer in layers])
        normal = np.einsum("qk,qkd->qd", nearest.weights, normals[corners])
        return cls(
            np.searchsorted(first, corners[:, 0], side="right") - 1,
            _frames(normal, np.ptp(points, axis=0)),
            np.einsum("qk,qk->q", nearest.weights, thickness[corners]),
        )


def _frames(normal: FloatArray, extent: FloatArray) -> FloatArray:
    """Frames (m, 3, 3) of normals (m, 3): the first axis lies along the longest side, if it can."""
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    longest, second = np.argsort(-extent, kind="stable")[:2]
    steep = np.abs(normal[:, longest]) > np.sqrt(0.5)
    axis = np.where(steep[:, None], np.eye(3)[second], np.eye(3)[longest])
    first = axis - np.einsum("kd,kd->k", axis, normal)[:, None] * normal
    first = first / np.maximum(np.linalg.norm(first, axis=1), 1e-300)[:, None]
    return np.stack([first, np.cross(normal, first), normal], axis=1)


def frames_in_cells(centres: FloatArray, layers: Sequence[Layer]) -> FloatArray:
    """Frame (3, 3) of flat layers, or frames (m, 3, 3) at the centres (m, 3) of cells."""
    if not curved_layers(layers):
        return layers[0].plane.frame
    return NearestLayers.of(centres, layers).frames
