"""Curved layers as they are printed: support, then the matrix of each layer, then its fibre."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.geometry.polylines import starts_segment
from ccfem.machine.machine import Machine
from ccfem.paths.splitting.printed_strands import PrintedStrands
from ccfem.paths.toolpaths import FIBRE, SUPPORT, Toolpaths
from ccfem.printing.bed_layout import Place
from ccfem.printing.islands import Islands, clashes, island_order, islands_of, rests_on, steps_of
from ccfem.printing.laid_layer import COORDINATE_DIGITS, LaidLayer, Stack, in_order
from ccfem.printing.layer_matrix import layer_matrix
from ccfem.printing.poses import Matter, Obstacles
from ccfem.printing.support import SupportLayers, support_paths
from ccfem.slicing.layers.layer import Layer, plane_frame
from ccfem.slicing.layers.slicer import Vector

# Matrix and fibre on each curved layer, of the part or of its support.


_LEAST = 0.2
"""Least share of a layer's height that matrix fills, however much its fibre takes. Our choice."""
_UNEVEN = 0.1
"""Share by which rings may be higher or lower than that, so that their layer is exactly full."""


@dataclass(frozen=True)
class FilledLayer:
    """A layer, and the paths laid on it.

    Attributes
    ----------
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
    layers : sequence of Layer
        From the first printed to the last.

    Returns
    -------
    list of FilledLayer
        A layer of support stands just before the layer of the part at its level.
    """
    props = None if support is None else support_paths(support, machine, layers=layers)
    filled = []
    for number, layer in enumerate(layers):
        if support is not None and props is not None:
            for k in np.flatnonzero(support.before == number).tolist():
                own = props.on_layer(k)
                own = replace(own, kind=np.full(len(own), SUPPORT))
                filled.append(_on_top(support.layers[k], own))
        strands = fibre.on_layer(layer.index)
        whole = _on_top(layer, Toolpaths.concatenate([layer_matrix([layer], machine), strands]))
        filled.append(_full(whole, machine))
    return filled


def _on_top(layer: Layer, paths: Toolpaths) -> FilledLayer:
    """Paths on the middle of a layer, raised to its top."""
    if not len(paths):
        return FilledLayer(layer, paths, np.zeros(0), np.zeros(0, dtype=np.int64))
    nearest = nearest_on_triangles(layer.points, layer.triangles, paths.points)
    corners = layer.local_thickness[layer.triangles[nearest.triangle]]
    height = np.einsum("qk,qk->q", nearest.weights, corners)
    piece = layer.component[nearest.triangle[paths.offsets[:-1]]]
    raised = paths.points + 0.5 * height[:, None] * paths.normals
    no_link = np.zeros(len(raised), dtype=bool)  # those of fibre are fibre to the printer
    return FilledLayer(layer, replace(paths, points=raised, link=no_link), height, piece)


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


_MISSING = 0.01
"""Share of the part's volume that may be missing without a warning."""


def curved_stack(
    strands: PrintedStrands,
    layers: Sequence[Layer],
    mesh: TetMesh,
    machine: Machine,
    place: Place,
    support: SupportLayers | None,
    build: Vector,
) -> Stack:
    """Lay matrix and fibre on curved layers, piece by piece in an order that the head clears.

    Parameters
    ----------
    build : tuple of 3 floats
        Direction in which the part was to stand.
    """
    filled = filled_layers(strands.fibre, layers, support, machine)
    islands = islands_of([layer.layer for layer in filled])
    clash = clashes(islands, place.axes[2], machine)
    steps = steps_of(islands, island_order(rests_on(islands), clash), clash)
    laid = [(step, _of_step(filled, islands, step, place)) for step in steps]
    laid = [(step, layer) for step, layer in laid if len(layer.paths)]
    when = np.full(len(islands), -1)
    for number, (step, _) in enumerate(laid):
        when[step] = number
    tops, level = place.on_bed(islands.tops), islands.layer
    return Stack(
        [layer for _, layer in laid],
        (*_stands(place.axes[2], build, support), *_not_full(filled, mesh)),
        Obstacles(
            Matter.of(tops, level[islands.owner]),
            Matter.of(tops, when[islands.owner]),
            np.array([level[step[0]] for step, _ in laid], dtype=np.int64),
        ),
    )


def _of_step(
    filled: Sequence[FilledLayer], islands: Islands, step: IntArray, place: Place
) -> LaidLayer:
    """Paths of some islands of a layer, on the bed, matrix before fibre."""
    layer = filled[int(islands.layer[step[0]])]
    here = np.isin(layer.piece, islands.piece[step])
    parts, shares = [], []
    for wanted in (layer.paths.kind != FIBRE, layer.paths.kind == FIBRE):
        chosen = here & wanted
        heights = layer.laid[np.repeat(chosen, np.diff(layer.paths.offsets))]
        paths, _, at = in_order(layer.paths.select(chosen))
        parts.append(paths)
        shares.append(heights[at])
    paths = Toolpaths.concatenate(parts)
    points = place.on_bed(paths.points).round(COORDINATE_DIGITS) + 0.0
    return LaidLayer(
        replace(paths, points=points, normals=paths.normals @ place.axes.T),
        float(points[:, 2].max(initial=0.0)),
        layer.layer.thickness,
        np.concatenate(shares),
    )


def _stands(up: FloatArray, build: Vector, support: SupportLayers | None) -> list[str]:
    """Say how the part stands, if not as asked for, and on what."""
    said = []
    if up @ plane_frame(build)[2] < np.cos(np.radians(0.1)):
        x, y, z = up.tolist()
        said.append(
            f"the part stands with ({x:.3f}, {y:.3f}, {z:.3f}) upwards: along its build direction "
            "layers would look down"
        )
    if support is None:
        said.append("nothing is laid below layers that hang over: plan with support (--support)")
    return said


def _not_full(filled: Sequence[FilledLayer], mesh: TetMesh) -> list[str]:
    """Say how much of the part's volume rings cannot fill."""
    missing, whole = sum(layer.missing for layer in filled), float(mesh.volumes.sum())
    if missing < _MISSING * whole:
        return []
    return [
        f"{missing:.0f} mm^3 of the part, {missing / whole:.1%}, stay empty, because its layers "
        "are too narrow there for lines of matrix"
    ]
