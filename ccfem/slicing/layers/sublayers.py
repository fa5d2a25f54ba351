"""Layers of a field of varying gradient: more where they lie far apart, fewer where they are near.

Kipping and Schueppstuhl 2023 (Materials 16, 998), section 2.6, cast rays from layer to layer. Here
the distance follows from the gradient. Layers are inserted, or left out, by powers of two, so that
the choice is consistent over the whole part.
"""

from dataclasses import replace

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.body.mesh import TetMesh
from ccfem.geometry.facets import border_edges, edges_left
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.level_cut import chain
from ccfem.slicing.layers.level_surfaces import LevelSurfaces, level_surfaces, thickness_at_nodes

_OFF = 1e-3
"""Least distance, in steps, of a layer from the ends of the field, which may be faces of cells."""
_DEEPEST = 2
"""Largest number of times that the distance of layers is halved or doubled."""


def layers_within(
    mesh: TetMesh,
    values: FloatArray,
    step: float,
    thinnest: float,
    thickest: float,
    shortest: float,
    least_area: float,
    origin: float | None = None,
) -> LevelSurfaces:
    """Cut layers at every step of a field, and between them where they would be too thick.

    Parameters
    ----------
    values : (n,) array
        At the nodes.
    step : float
        Difference of the values between layers.
    thinnest, thickest : float, mm
        Wanted range of the thickness; the second value is at least twice the first.
    shortest : float, mm
        Shorter edges of the triangles are collapsed.
    least_area : float, mm^2
        Smaller pieces are left out.
    origin : float, optional
        Value half a step below a layer; by default the lowest value. Layers that continue others
        use the origin of those.

    Returns
    -------
    LevelSurfaces
        With the resulting thickness at each point. Inserted layers only contain triangles with a
        corner where the layers would otherwise be too thick.
    """
    low, high = (float(end) for end in np.quantile(values[mesh.corners], [0.0, 1.0]))
    start = low if origin is None else origin + step * np.ceil((low - origin) / step - 0.5)
    count = max(int((high - start) / step + (0.0 if origin is None else 0.5)), 1)
    whole: FloatArray = start + (np.arange(count, dtype=np.float64) + 0.5) * step
    raw = thickness_at_nodes(mesh, values, step)
    kept: list[tuple[float, Layer]] = []
    bubbles = specks = 0
    for halving in range(_DEEPEST + 1):
        limit = thickest * 2.0 ** (halving - 1)
        levels = whole
        if halving:
            # Half way between the layers so far, where a cell that spans the level is too thick.
            odd = np.arange(1, 2**halving, 2) * (step / 2**halving)
            between = np.sort(np.add.outer(np.append(whole[0] - step, whole), odd).ravel())
            thick = values[mesh.corners[(raw[mesh.corners] > limit).any(axis=1)]]
            begun = np.searchsorted(np.sort(thick.min(axis=1)), between, side="right")
            ended = np.searchsorted(np.sort(thick.max(axis=1)), between, side="left")
            within = (between > low + _OFF * step) & (between < high - _OFF * step)
            levels = np.asarray(between[(begun > ended) & within])
        surfaces = level_surfaces(mesh, values, levels, step, shortest, least_area)
        bubbles, specks = bubbles + surfaces.bubbles, specks + surfaces.specks
        for layer in surfaces.layers:
            level = float(np.median(layer.interpolate(values)))
            number = round((level - (low if origin is None else origin)) / step - 0.5)
            t = layer.local_thickness
            if halving:
                wanted: BoolArray = t > limit
            else:
                times = 2.0 ** np.ceil(np.log2(np.maximum(thinnest / t, 1.0)))
                wanted = np.asarray(number % np.minimum(times, 2.0**_DEEPEST) == 0)
            some = np.asarray(wanted[layer.triangles].any(axis=1))
            rest = _restricted(layer, some, least_area)
            if rest is not None:
                local = _left(rest.local_thickness, thinnest, thickest)
                mean = np.average(local[rest.triangles].mean(axis=1), weights=rest.areas)
                kept.append((level, replace(rest, local_thickness=local, thickness=float(mean))))
    kept.sort(key=lambda pair: pair[0])
    layers = tuple(replace(layer, index=k) for k, (_, layer) in enumerate(kept))
    return LevelSurfaces(layers, bubbles, specks)


def _left(raw: FloatArray, thinnest: float, thickest: float) -> FloatArray:
    """Thickness that results from a raw one, once layers are inserted or left out."""
    halvings = np.clip(np.ceil(np.log2(raw / thickest)), 0.0, _DEEPEST)
    doublings = np.clip(np.ceil(np.log2(thinnest / raw)), 0.0, _DEEPEST)
    return np.asarray(raw * 2.0 ** (doublings - halvings))


def _restricted(layer: Layer, wanted: BoolArray, least_area: float) -> Layer | None:
    """Layer with some of its triangles; None if less than the least area is left."""
    if wanted.all():
        return layer
    if not layer.areas[wanted].sum() >= least_area:
        return None
    used, triangles = np.unique(layer.triangles[wanted], return_inverse=True)
    triangles = triangles.reshape(-1, 3)
    border = border_edges(triangles, len(used))
    place = np.full(len(layer.points), -1)
    place[used] = np.arange(len(used))
    return replace(
        layer,
        points=layer.points[used],
        triangles=triangles,
        cell=layer.cell[wanted],
        nodes=layer.nodes[used],
        weights=layer.weights[used],
        loops=chain(border),
        patches={name: edges_left(edges, place) for name, edges in layer.patches.items()},
        walls=tuple((wall, edges_left(edges, place)) for wall, edges in layer.walls),
        local_thickness=layer.local_thickness[used],
    )
