"""A pattern of pixels as paths in the plane of a layer."""

from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.geometry.polylines import pack
from ccfem.paths.raster.bitmap import Bitmap
from ccfem.paths.raster.patterns import Regions
from ccfem.paths.raster.simplify import corners
from ccfem.paths.raster.tracing import PixelPaths, trace
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer


@dataclass(frozen=True)
class RasterPlan:
    """Paths planned on a bitmap.

    Attributes
    ----------
    raster : Bitmap
    regions : Regions
        The pattern.
    paths : PixelPaths
    """

    raster: Bitmap
    regions: Regions
    paths: PixelPaths

    @property
    def chains(self) -> list[FloatArray]:
        """Centres (n_i, 2), mm, of the pixels of each path; closed ones repeat their first."""
        points = self.raster.centres(self.paths.pixels)
        chains = np.split(points, self.paths.offsets[1:-1]) if len(self.paths) else []
        return [
            np.concatenate([chain, chain[:1]]) if closed else chain
            for chain, closed in zip(chains, self.paths.closed, strict=True)
        ]

    def lines(self) -> list[FloatArray]:
        """Polylines (n_i, 2), mm: straight runs by their ends, staircases made straight.

        A path that would leave the section by a straight step keeps all its staircases.
        """
        chains = self.chains
        if not chains:
            return []
        points, offsets = pack(chains)
        pixels = self.raster.pixels(points)
        found = self._kept(chains, corners(pixels, offsets))
        shapely.prepare(self.raster.section)
        inside = shapely.covers(self.raster.section, [shapely.LineString(x) for x in found])
        if not inside.all():
            plain = self._kept(chains, corners(pixels, offsets, stairs=False))
            found = [a if k else b for a, b, k in zip(found, plain, inside, strict=True)]
        return found

    def _kept(self, chains: list[FloatArray], keep: BoolArray) -> list[FloatArray]:
        ends = np.cumsum([len(chain) for chain in chains])[:-1]
        return [chain[k] for chain, k in zip(chains, np.split(keep, ends), strict=True)]

    def toolpaths(self, layer: Layer) -> Toolpaths:
        """Paths on a layer, however short."""
        return Toolpaths.from_plane(self.lines(), layer, self.paths.closed.tolist())


def raster_plan(raster: Bitmap, regions: Regions) -> RasterPlan:
    """Trace the paths of a pattern."""
    return RasterPlan(raster, regions, trace(regions.number, raster.linked))
