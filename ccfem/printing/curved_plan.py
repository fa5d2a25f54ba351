"""A part of curved layers as it is printed: each layer filled with matrix, then its fibre."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.errors import InputError
from ccfem.geometry.nearest_on_triangles import nearest_on_triangles
from ccfem.geometry.polylines import is_closed, pack
from ccfem.layers.layer import Layer
from ccfem.layers.plane import plane_frame
from ccfem.linking.print_order import nearest_end_order
from ccfem.machine.machine import Machine
from ccfem.mesh.tet_mesh import TetMesh
from ccfem.printing.layer_matrix import layer_matrix
from ccfem.printing.print_plan import COORDINATE_DIGITS, PrintPlan
from ccfem.toolpaths import FIBRE, Toolpaths

__all__ = ["curved_plan", "limited_tilt"]

_LEAST = 0.2
"""Least share of a layer's height that matrix fills, whatever its fibre takes. Our choice."""


def curved_plan(
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    mesh: TetMesh,
    machine: Machine,
    build: Sequence[float] = (0.0, 0.0, 1.0),
) -> PrintPlan:
    """Plan the print of a part of curved layers.

    Layer by layer matrix comes first, rings as high as the layer is where they lie, less the share
    of its volume that its fibre takes; then the fibre, always on to the strand with the nearest
    end. The head stands along the normal of the layer, as far as `Kinematics.tilt_limit` lets it.
    The part stands in the middle of the bed, on its lowest point. Support under it, a skirt and
    priming are not planned.

    Parameters
    ----------
    toolpaths : Toolpaths
        Fibre; paths of other kinds are left out.
    layers : sequence of Layer
        From the first printed to the last, some of them curved.
    mesh : TetMesh
        The part.
    machine : Machine
    build : sequence of 3 floats
        Build direction.

    Raises
    ------
    InputError
        Where a strand is shorter than the cutter allows and `Process.short` is "error", or the head
        of a machine of three axes would touch a layer.
    """
    fibre = toolpaths.of_kind(FIBRE)
    frame = plane_frame(build)
    corners = mesh.points[np.unique(mesh.corners)] @ frame.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    shift = np.append(0.5 * (low + high)[:2] - 0.5 * np.array(machine.gcode.bed[:2]), low[2])
    limit = max(machine.tail, machine.minimum_length) * (1.0 - 1e-6)
    whole = fibre.lengths >= limit
    if not whole.all() and machine.process.short == "error":
        raise InputError(
            f"{int((~whole).sum())} of {len(fibre)} strands are shorter than the {limit:.4g} mm "
            "that the cutter allows: plan with that minimum_length, or set process.short = 'drop'"
        )
    parts, laid = [], []
    for number, layer in enumerate(layers):
        own = fibre.select(whole & (fibre.layer == layer.index))
        room = float(layer.areas @ layer.local_thickness[layer.triangles].mean(axis=1))
        share = max(1.0 - machine.strand_area * float(own.lengths.sum()) / room, _LEAST)
        for paths in (layer_matrix([layer], machine), own):
            found = _in_order(paths, number)
            parts.append(found)
            laid.append(share * _heights(layer, found.points))
    paths = Toolpaths.concatenate(parts)
    normals = limited_tilt(paths.normals @ frame.T, machine.kinematics.tilt_limit)
    points = (paths.points @ frame.T - shift).round(COORDINATE_DIGITS) + 0.0
    paths = replace(paths, points=points, normals=normals)
    _check_tilt(normals, machine)
    owner = np.repeat(paths.layer, np.diff(paths.offsets))
    tops = [points[owner <= k, 2].max() for k in range(len(layers))]
    thickness = np.array([float(np.mean(layer.local_thickness)) for layer in layers])
    return PrintPlan(
        paths,
        np.array(tops),
        thickness,
        np.concatenate(laid),
        dropped=float(fibre.lengths[~whole].sum()),
    )


def limited_tilt(normals: FloatArray, limit: float) -> FloatArray:
    """Turn directions (n, 3) that tilt from z by more than a limit, degrees, back to it."""
    tilt = np.arctan2(np.hypot(normals[:, 0], normals[:, 1]), normals[:, 2])
    most = np.minimum(tilt, np.radians(limit))
    level = normals[:, :2] / np.maximum(np.hypot(*normals[:, :2].T), 1e-300)[:, None]
    return np.column_stack([level * np.sin(most)[:, None], np.cos(most)])


def _in_order(paths: Toolpaths, number: int) -> Toolpaths:
    """Paths of a layer in the order of printing, with a number for the layer."""
    lines, across = list(paths), np.split(paths.normals, paths.offsets[1:-1])
    if not lines:
        return Toolpaths.empty()
    ends = [np.array([line[k] for line in lines]) for k in (0, -1)]
    order, backward, _ = nearest_end_order(*ends)
    steps = [
        (k, slice(None, None, -1 if back else 1)) for k, back in zip(order, backward, strict=True)
    ]
    points, offsets = pack([lines[k][way] for k, way in steps])
    return Toolpaths(
        points=points,
        normals=np.concatenate([across[k][way] for k, way in steps]),
        offsets=offsets,
        layer=np.full(len(lines), number),
        kind=paths.kind[order],
        closed=np.array([is_closed(lines[k]) for k, _ in steps]),
    )


def _heights(layer: Layer, points: FloatArray) -> FloatArray:
    """Thickness of a layer at points on it, mm."""
    if not len(points):
        return np.zeros(0)
    found = nearest_on_triangles(layer.points, layer.triangles, points)
    corners = layer.local_thickness[layer.triangles[found.triangle]]
    return np.asarray(np.einsum("qk,qk->q", found.weights, corners))


def _check_tilt(normals: FloatArray, machine: Machine) -> None:
    """Refuse layers that an upright head would touch with its side."""
    if machine.kinematics.kind != "three_axes" or not len(normals):
        return
    tilt = float(np.degrees(np.arccos(np.clip(normals[:, 2].min(), -1.0, 1.0))))
    room = 90.0 - machine.head_angle
    if tilt > room:
        raise InputError(
            f"layers tilt by up to {tilt:.0f} degrees, but an upright head with a half angle of "
            f"{machine.head_angle:g} degrees touches those above {room:g}: choose "
            "machine.kinematics.kind = 'table_table' or 'head_head', or flatter layers"
        )
