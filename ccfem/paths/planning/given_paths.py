"""Paths planned by another program, as a strategy that lays them unchanged.

On curved layers they are moved onto the nearest one, which their files are near only.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.geometry.facets import areas_and_normals
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.machine.machine import Machine
from ccfem.paths.planning.strategy import Amount
from ccfem.paths.planning.unfolding import may_fold
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, LayerStress, curved_layers

_FEW, _RIVALS = 9, 3
"""Points of a path that tell which layers may be nearest, and how many of these are looked at."""
_SAME = 1e-3
"""Heights nearer than this, mm, are equal: it allows for the rounding of path files."""


@dataclass(frozen=True)
class GivenPaths:
    """Given paths, evaluated like those of strategies, but never changed.

    Attributes
    ----------
    toolpaths : Toolpaths
        In the frame of the mesh.
    source : str
        Where they come from; for reports.
    pattern : str
        Published pattern that they are of, by their file, whose turns back are then kept as those
        of the pattern are; they carry nothing in either.
    """

    toolpaths: Toolpaths
    source: str = ""
    pattern: str = ""

    amount: ClassVar[Amount] = Amount("", 1.0, 1.0)
    crosses: ClassVar[bool] = True
    folds: ClassVar[bool] = True

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Return the paths of one layer."""
        return self.toolpaths.on_layer(layer.index)

    def heights(self, direction: FloatArray) -> FloatArray:
        """Heights, mm, of the layers that the paths lie on, upwards along a unit vector (3,).

        A path that is not flat across it is an error.
        """
        return np.unique(self._levels(np.asarray(direction, dtype=np.float64)).round(3))

    def are_flat(self, direction: FloatArray) -> bool:
        """Whether every path lies in a plane across a direction, (3,)."""
        low, high = self._reach(direction)
        return bool((high - low <= 2.0 * _SAME).all())

    def _reach(self, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest place of each path along a direction, mm."""
        paths, start = self.toolpaths, self.toolpaths.offsets[:-1]
        level = paths.points @ direction
        if not len(paths):
            return level, level
        return np.minimum.reduceat(level, start), np.maximum.reduceat(level, start)

    def _levels(self, direction: FloatArray) -> FloatArray:
        """Height of each path, mm."""
        low, high = self._reach(direction)
        if not len(low):
            return low
        worst = int((high - low).argmax())
        if high[worst] - low[worst] > 2.0 * _SAME:
            raise InputError(
                f"{self.source or 'given paths'}: path {worst} spans {high[worst] - low[worst]:.3g}"
                " mm along the build direction, so it lies in no flat layer: give flat paths, in "
                "the frame that they are in, or the slicing of their curved layers, which "
                "through_strands:folder=FOLDER rebuilds from them"
            )
        return np.asarray(0.5 * (low + high))

    def on(self, layers: Sequence[Layer]) -> "GivenPaths":
        """Return these paths, each with the number of the layer that it lies on.

        Where one is curved, the points are moved onto the layer that is nearest to their path.

        Raises
        ------
        InputError
            When a path lies farther from every layer than half the layer's height.
        """
        if curved_layers(layers):
            return self._on_curved(layers)
        heights = np.array([layer.plane.height for layer in layers])
        level = self._levels(layers[0].plane.frame[2])
        if not len(level):
            return self
        apart = np.abs(level[:, None] - heights[None])
        nearest = apart.argmin(axis=1)
        reach = 0.5 * np.array([layer.thickness for layer in layers])[nearest] + _SAME
        off = apart[np.arange(len(level)), nearest] > reach
        if off.any():
            path = int(np.flatnonzero(off)[0])
            raise InputError(
                f"{self.source or 'given paths'}: path {path} lies at {level[path]:.6g} mm along "
                f"the build direction, on none of the {len(layers)} layers, which reach from "
                f"{heights.min():.6g} to {heights.max():.6g} mm: name the frame that the paths "
                "are in, or give their heights"
            )
        index = np.array([layer.index for layer in layers])[nearest]
        return replace(self, toolpaths=replace(self.toolpaths, layer=index))

    def _on_curved(self, layers: Sequence[Layer]) -> "GivenPaths":
        """Return these paths, each on the layer from which its points are least far on average."""
        paths, start = self.toolpaths, self.toolpaths.offsets[:-1]
        if not len(paths):
            return self
        size = np.diff(paths.offsets)
        nearest = self._nearest_layers(layers)
        points, normals = np.empty_like(paths.points), np.empty_like(paths.points)
        apart, of_point = np.empty(len(paths.points)), np.repeat(nearest, size)
        for k in np.unique(nearest).tolist():
            here, layer = of_point == k, layers[k]
            foot = nearest_on_triangles(layer.points, layer.triangles, paths.points[here])
            points[here], apart[here] = foot.points, foot.distance
            _, normals[here] = areas_and_normals(layer.points, layer.triangles[foot.triangle])
        far = np.maximum.reduceat(apart, start)
        off = far > 0.5 * np.array([layer.thickness for layer in layers])[nearest] + _SAME
        if off.any():
            path = int(np.flatnonzero(off)[0])
            raise InputError(
                f"{self.source or 'given paths'}: path {path} is up to {far[path]:.3g} mm from the "
                f"nearest of {len(layers)} curved layers: name the frame that the paths are in, or "
                "the slicing that they are for"
            )
        index = np.array([layer.index for layer in layers])[nearest]
        return replace(self, toolpaths=replace(paths, points=points, normals=normals, layer=index))

    def _nearest_layers(self, layers: Sequence[Layer]) -> IntArray:
        """Find the layer from which the points of each path are least far on average.

        A few points of each tell which layers come into question.
        """
        paths, size = self.toolpaths, np.diff(self.toolpaths.offsets)

        def away(layer: Layer, chosen: IntArray, counts: IntArray) -> FloatArray:
            """Mean distance of the paths, of which some points are chosen."""
            foot = nearest_on_triangles(layer.points, layer.triangles, paths.points[chosen])
            start = np.cumsum(counts) - counts
            return np.asarray(np.add.reduceat(foot.distance, start) / counts)

        few = np.minimum(size, _FEW)
        share = np.concatenate([np.linspace(0.0, 1.0, count) for count in few])
        first, length = (np.repeat(values, few) for values in (paths.offsets[:-1], size - 1))
        sample = first + np.rint(share * length).astype(np.int64)
        roughly = np.stack([away(layer, sample, few) for layer in layers])
        mean = np.full(roughly.shape, np.inf)
        order = np.argsort(roughly, axis=0, kind="stable")[:_RIVALS]
        for k in np.unique(order).tolist():
            wanted = (order == k).any(axis=0)
            chosen = np.flatnonzero(np.repeat(wanted, size))
            mean[k, wanted] = away(layers[k], chosen, size[wanted])
        return np.asarray(mean.argmin(axis=0))


def pattern_that_folds(strategy: object, name: str) -> str:
    """Name of the published pattern that turns back by design: a strategy's, or a file's; or ""."""
    if isinstance(strategy, GivenPaths):
        return strategy.pattern
    return name if may_fold(strategy) else ""
