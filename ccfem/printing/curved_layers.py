"""Matrix and fibre on each curved layer, of the part or of its support."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.nearest_on_triangles import nearest_on_triangles
from ccfem.geometry.polylines import is_closed, pack, starts_segment
from ccfem.machine.machine import Machine
from ccfem.paths.linking.print_order import nearest_end_order
from ccfem.paths.toolpaths import FIBRE, SUPPORT, Toolpaths
from ccfem.printing.layer_matrix import layer_matrix
from ccfem.printing.support import SupportLayers, support_paths
from ccfem.slicing.layers.layer import Layer

_LEAST = 0.2
"""Least share of a layer's height that matrix fills, however much its fibre takes. Our choice."""
_UNEVEN = 0.1
"""Share by which rings may be higher or lower than that, so that their layer is exactly full."""


@dataclass(frozen=True)
class FilledLayer:
    """A layer, and the paths laid on it.

    Attributes
    ----------
    layer : Layer
    paths : Toolpaths
        Matrix or support first, then fibre; at the top of the layer, half its thickness above it.
    laid : (P,) array, mm
        Height of matrix at each point.
    piece : (K,) int array
        Piece of the layer (`Layer.component`) that each path lies on.
    missing : float, mm^3
        Volume that rings leave out because they do not fit; negative if they lay too much.
    """

    layer: Layer
    paths: Toolpaths
    laid: FloatArray
    piece: IntArray
    missing: float = 0.0


def filled_layers(
    fibre: Toolpaths, layers: Sequence[Layer], support: SupportLayers | None, machine: Machine
) -> list[FilledLayer]:
    """Fill layers with matrix and fibre, and those of the support in between.

    Parameters
    ----------
    fibre : Toolpaths
    layers : sequence of Layer
        From the first printed to the last.
    support : SupportLayers, optional
    machine : Machine

    Returns
    -------
    list of FilledLayer
        A layer of support stands just before the layer of the part at its level.
    """
    props = None if support is None else support_paths(support, machine)
    found = []
    for number, layer in enumerate(layers):
        if support is not None and props is not None:
            for k in np.flatnonzero(support.before == number).tolist():
                own = props.on_layer(k)
                own = replace(own, kind=np.full(len(own), SUPPORT))
                found.append(_on_top(support.layers[k], own))
        strands = fibre.on_layer(layer.index)
        whole = _on_top(layer, Toolpaths.concatenate([layer_matrix([layer], machine), strands]))
        found.append(_full(whole, machine))
    return found


def _on_top(layer: Layer, paths: Toolpaths) -> FilledLayer:
    """Paths on the middle of a layer, raised to its top."""
    if not len(paths):
        return FilledLayer(layer, paths, np.zeros(0), np.zeros(0, dtype=np.int64))
    found = nearest_on_triangles(layer.points, layer.triangles, paths.points)
    corners = layer.local_thickness[layer.triangles[found.triangle]]
    height = np.einsum("qk,qk->q", found.weights, corners)
    piece = layer.component[found.triangle[paths.offsets[:-1]]]
    raised = paths.points + 0.5 * height[:, None] * paths.normals
    return FilledLayer(layer, replace(paths, points=raised), height, piece)


def _full(filled: FilledLayer, machine: Machine) -> FilledLayer:
    """Reduce matrix by the volume of fibre, and correct what rings lay too little or too much."""
    layer, paths = filled.layer, filled.paths
    room = float(layer.areas @ layer.local_thickness[layer.triangles].mean(axis=1))
    strands = paths.kind == FIBRE
    rest = room - machine.strand_area * float(paths.lengths[strands].sum())
    share = max(rest / room, _LEAST)
    start = np.flatnonzero(starts_segment(paths.offsets))
    start = start[~np.repeat(strands, np.diff(paths.offsets))[start]]
    steps = np.linalg.norm(paths.points[start + 1] - paths.points[start], axis=1)
    rings = machine.matrix_width * float(steps @ filled.laid[start])
    flow = share
    if rings > 0.0:
        flow = float(np.clip(rest / rings, share * (1.0 - _UNEVEN), share * (1.0 + _UNEVEN)))
    return replace(filled, laid=flow * filled.laid, missing=rest - flow * rings)


def in_order(paths: Toolpaths) -> tuple[Toolpaths, IntArray]:
    """Paths in the order of printing, nearest end next, and the former places of their points."""
    if not len(paths):
        return paths, np.zeros(0, dtype=np.int64)
    lines = list(paths)
    ends = [np.array([line[k] for line in lines]) for k in (0, -1)]
    order, backward, _ = nearest_end_order(*ends)
    index = [
        np.arange(paths.offsets[k], paths.offsets[k + 1])[:: -1 if back else 1]
        for k, back in zip(order.tolist(), backward.tolist(), strict=True)
    ]
    at = np.concatenate(index)
    points, offsets = pack([paths.points[own] for own in index])
    return Toolpaths(
        points=points,
        normals=paths.normals[at],
        offsets=offsets,
        layer=paths.layer[order],
        kind=paths.kind[order],
        closed=np.array([is_closed(lines[k]) for k in order.tolist()]),
    ), at
