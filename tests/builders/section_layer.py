"""Layers of sections, for tests of planning alone."""

import numpy as np
import shapely

from ccfem.body.meshing import triangulate
from ccfem.geometry.facets import border_edges
from ccfem.slicing.layers.layer import Layer, Plane
from ccfem.slicing.layers.level_cut import chain


def layer_of(section, edge_length=1.5):
    """Triangulated layer of a section, which may have several parts, at height 0."""
    parts = [triangulate(part, edge_length) for part in shapely.get_parts(section)]
    plane = np.concatenate([points for points, _ in parts])
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    triangles = [start + corners for start, (_, corners) in zip(starts, parts, strict=False)]
    triangles, count = np.concatenate(triangles), len(plane)
    return Layer(
        points=np.column_stack([plane, np.zeros(count)]),
        triangles=triangles,
        cell=np.zeros(len(triangles)),
        nodes=np.zeros((count, 2)),
        weights=np.zeros(count),
        loops=chain(border_edges(triangles, count)),
        flat=Plane(np.eye(3), 0.0),
        index=0,
        thickness=1.0,
    )
