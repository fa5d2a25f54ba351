"""The print of a part of curved layers: support, then the matrix of each layer, then its fibre."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.cones import earlier_in_cones
from ccfem.geometry.locate import nearest_on_triangles
from ccfem.geometry.polylines import along_line, is_closed, pack, starts_segment
from ccfem.machine.machine import Machine
from ccfem.paths.linking.print_order import nearest_end_order
from ccfem.paths.splitting.printed_strands import PrintedStrands, printed_strands
from ccfem.paths.toolpaths import FIBRE, SUPPORT, Toolpaths
from ccfem.printing.bed_layout import BedLayout
from ccfem.printing.islands import Islands, clashes, island_order, islands_of, rests_on, steps_of
from ccfem.printing.laid_layer import COORDINATE_DIGITS
from ccfem.printing.layer_matrix import layer_matrix
from ccfem.printing.poses import poses, under_bed
from ccfem.printing.print_plan import PrintPlan
from ccfem.printing.support import SupportLayers, support_paths
from ccfem.slicing.layers.layer import Layer, plane_frame
from ccfem.slicing.layers.slicer import Vector, standing

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
    points, offsets = pack([paths.points[rows] for rows in index])
    return Toolpaths(
        points=points,
        normals=paths.normals[at],
        offsets=offsets,
        layer=paths.layer[order],
        kind=paths.kind[order],
        closed=np.array([is_closed(lines[k]) for k in order.tolist()]),
    ), at


_MISSING = 0.01
"""Share of the part's volume that may be missing without a warning."""
_UP = np.array([0.0, 0.0, 1.0])


def curved_plan(
    strands: PrintedStrands | Toolpaths,
    layers: Sequence[Layer],
    mesh: TetMesh,
    machine: Machine,
    build: Vector = (0.0, 0.0, 1.0),
    support: SupportLayers | None = None,
    spin: float = 0.0,
) -> PrintPlan:
    """Plan the print of a part of curved layers.

    In each layer matrix comes first, as rings of the local layer height, less the share of the
    volume that the fibre takes. Then comes the fibre, always continuing with the strand of nearest
    end. A layer of support is printed just before the layer of the part at its level. If the head
    would touch other pieces while above a piece of a layer, that piece is printed first if possible
    (`ccfem.printing.islands`). The head stands along the normal of the layer, as far as
    `Kinematics.tilt_limit` allows, and leans where it would still touch something (`head_lean`);
    remaining contact is stated in the warnings. The nozzle is at the top of a layer, half its
    thickness above its middle. The part stands in the middle of the bed, on its support or on its
    lowest point.

    Parameters
    ----------
    strands : PrintedStrands, or Toolpaths
        Planned paths are first split into the strands that are printed (`printed_strands`).
    layers : sequence of Layer
        From the first printed to the last, some of them curved.
    mesh : TetMesh
        The part.
    build : sequence of 3 floats
        Build direction. If layers face downwards from there, the part stands along their mean
        normal (`standing`).
    support : SupportLayers, optional
        Support of these layers; the part stands as it does there.
    spin : float, degrees
        Turn about the vertical (`ccfem.printing.bed_layout.BedLayout`).

    Raises
    ------
    InputError
        As `printed_strands`, and where the head
        of a machine of three axes would touch the layer that it lays.
    """
    if isinstance(strands, Toolpaths):
        strands = printed_strands(strands, layers, mesh, machine)
    fibre = strands.fibre
    up = standing(layers, build) if support is None else support.columns.up.tolist()
    frame = BedLayout(spin).frame(plane_frame(up))
    filled = filled_layers(fibre, layers, support, machine)
    islands = islands_of([layer.layer for layer in filled])
    steps = _steps(filled, islands, frame[2], machine)
    paths = Toolpaths.concatenate(
        replace(step_paths, layer=np.full(len(step_paths), number))
        for number, (_, step_paths, _) in enumerate(steps)
    )
    shift = _shift(mesh, support, frame, machine)
    points = (paths.points @ frame.T - shift).round(COORDINATE_DIGITS) + 0.0
    normals = paths.normals @ frame.T
    _check_tilt(normals, machine)
    paths = replace(paths, points=points)
    axes, tops = poses(normals, _UP, machine), islands.tops @ frame.T - shift
    source = np.array([islands.layer[step[0]] for step, _, _ in steps])
    before, leaned = _contact(paths, axes, tops, islands, [step for step, _, _ in steps], machine)
    upright = machine.kinematics.kind == "three_axes"
    owner = np.repeat(paths.layer, np.diff(paths.offsets))
    return PrintPlan(
        replace(paths, normals=normals if upright else leaned.axes),
        np.array([points[owner <= k, 2].max() for k in range(len(steps))]),
        np.array([filled[k].layer.thickness for k in source.tolist()]),
        np.concatenate([shares for _, _, shares in steps]),
        dropped=strands.dropped,
        touched=(before, leaned.before, leaned.after),
        warnings=(
            *strands.warnings,
            *_stands(frame[2], plane_frame(build)[2], support),
            *_not_full(filled, mesh),
            *_said(before, leaned.before, leaned.after, leaned.place),
        ),
    )


def _contact(
    paths: Toolpaths,
    axes: FloatArray,
    tops: FloatArray,
    islands: Islands,
    steps: Sequence[IntArray],
    machine: Machine,
) -> tuple[float, "Cleared"]:
    """Length along which the head would touch layer by layer, and axes that clear these steps."""
    source = np.array([islands.layer[step[0]] for step in steps])
    level = replace(paths, layer=source[paths.layer])
    before = touched_length(level, axes, Matter.of(tops, islands.layer[islands.owner]), machine)
    when = np.full(len(islands), -1)
    for number, step in enumerate(steps):
        when[step] = number
    return before, cleared(paths, axes, Matter.of(tops, when[islands.owner]), machine)


def _steps(
    filled: Sequence[FilledLayer], islands: Islands, up: FloatArray, machine: Machine
) -> list[tuple[IntArray, Toolpaths, FloatArray]]:
    """Islands that are printed one after the other, each step with its paths and their heights."""
    clash = clashes(islands, up, machine)
    steps = [
        (step, *_of_step(filled, islands, step))
        for step in steps_of(islands, island_order(rests_on(islands), clash), clash)
    ]
    steps = [step for step in steps if len(step[1])]
    if not steps:
        raise InputError("there is nothing to print: the part is thinner than a line of matrix")
    return steps


def _of_step(
    filled: Sequence[FilledLayer], islands: Islands, step: IntArray
) -> tuple[Toolpaths, FloatArray]:
    """Paths of some islands of a layer in the order of printing, and the height that they lay."""
    layer = filled[int(islands.layer[step[0]])]
    here = np.isin(layer.piece, islands.piece[step])
    parts, shares = [], []
    for wanted in (layer.paths.kind != FIBRE, layer.paths.kind == FIBRE):
        chosen = here & wanted
        heights = layer.laid[np.repeat(chosen, np.diff(layer.paths.offsets))]
        paths, at = in_order(layer.paths.select(chosen))
        parts.append(paths)
        shares.append(heights[at])
    return Toolpaths.concatenate(parts), np.concatenate(shares)


def _shift(
    mesh: TetMesh, support: SupportLayers | None, frame: FloatArray, machine: Machine
) -> FloatArray:
    """Origin of the printer, (3,), in the frame of the build direction."""
    corners = mesh.points[np.unique(mesh.corners)] @ frame.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    bed = float(low[2])
    if support is not None:
        bed = min(bed, float((support.columns.mesh.points @ frame[2]).min()))
    return np.append(0.5 * (low + high)[:2] - 0.5 * np.array(machine.gcode.bed[:2]), bed)


def _stands(up: FloatArray, wanted: FloatArray, support: SupportLayers | None) -> list[str]:
    """Say how the part stands, if not as asked for, and on what."""
    said = []
    if up @ wanted < np.cos(np.radians(0.1)):
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


def _said(level: float, ordered: float, after: float, place: FloatArray | None) -> list[str]:
    """Say where the head touches what is printed, and what was done about it."""
    if not level > 0.0 and not after > 0.0:
        return []
    done = f"{level:.0f} mm layer by layer, {ordered:.0f} mm in the order chosen"
    if place is None:
        return [f"the head would touch printed material along {done}, and nowhere when leaning"]
    x, y, z = place.tolist()
    return [
        f"the head touches printed material along {after:.0f} mm, first at X {x:.1f} Y {y:.1f} Z "
        f"{z:.1f} (without leaning {done}): choose other layers, a smaller "
        "machine.kinematics.tilt_limit, or watch it there"
    ]


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


# Leaning of the head where it would touch printed material, by the least angle that clears it.


_LEANS = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0)
"""Angles, degrees, by which a head may lean from the normal of its layer. Our choice: about half
the angle at which its own side touches the layer (90 degrees less `Machine.head_angle`)."""
_TURNS = (0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0, 135.0, -135.0, 180.0)
"""Directions in which it leans, degrees from the direction away from the contact."""
_RAMP = 8.0
"""Length, mm, over which it leans and returns upright."""
_EVERY = 2.0
"""Distance, mm, between the places along a path at which contact is checked."""


@dataclass(frozen=True)
class Matter:
    """Points that represent printed material, first step first.

    Attributes
    ----------
    points : (n, 3) array, mm
    step : (n,) int array
        In which they are printed, ascending.
    """

    points: FloatArray
    step: IntArray

    def __post_init__(self) -> None:
        freeze(self, points=float, step=int)

    @classmethod
    def of(cls, points: FloatArray, step: IntArray) -> "Matter":
        """Points in any order; those of step -1 are not printed."""
        order = np.argsort(step, kind="stable")
        order = order[step[order] >= 0]
        return cls(points[order], step[order])


@dataclass(frozen=True)
class Cleared:
    """Axes of a head after leaning, and its remaining contact.

    Attributes
    ----------
    axes : (n, 3) array
        At every point of the paths.
    before, after : float, mm
        Length of the paths along which the head touches printed material, or the bed: with the
        given axes, and with these.
    place : (3,) array, mm, or None
        First place of remaining contact.
    """

    axes: FloatArray
    before: float
    after: float
    place: FloatArray | None = None


def cleared(paths: Toolpaths, axes: FloatArray, matter: Matter, machine: Machine) -> Cleared:
    """Let the head lean where it would touch material printed in earlier steps.

    Parameters
    ----------
    paths : Toolpaths
        In the coordinates of the printer; their `layer` is the step in which they are printed.
    axes : (n, 3) array
        Unit vectors along the head at every point of the paths.
    machine : Machine
        A head on three axes cannot lean.
    """
    sample, length, step = _samples(paths)
    tips = paths.points[sample]
    hits, point = _touched(tips, axes[sample], step, matter, machine)
    before = float(length[hits].sum())
    if machine.kinematics.kind == "three_axes" or not hits.any():
        return Cleared(axes, before, before, _first(tips, hits))
    off = _way_off(tips[hits], axes[sample][hits], point[hits], matter.points)
    turned = _turned(tips[hits], axes[sample][hits], off, step[hits], matter, machine)
    axes, old = _spread(paths, axes, sample[hits], turned), axes
    new = np.abs(axes - old).max(axis=1)[sample] > 0.0
    hits[new], _ = _touched(tips[new], axes[sample][new], step[new], matter, machine)
    return Cleared(axes, before, float(length[hits].sum()), _first(tips, hits))


def touched_length(paths: Toolpaths, axes: FloatArray, matter: Matter, machine: Machine) -> float:
    """Length of paths, mm, along which the head touches earlier steps or the bed, as `cleared`."""
    sample, length, step = _samples(paths)
    hits, _ = _touched(paths.points[sample], axes[sample], step, matter, machine)
    return float(length[hits].sum())


def _first(tips: FloatArray, hits: BoolArray) -> FloatArray | None:
    return tips[int(hits.argmax())] if hits.any() else None


def _samples(paths: Toolpaths) -> tuple[IntArray, FloatArray, IntArray]:
    """Points of the paths at about this distance, the length each stands for, and its step."""
    index, length = [np.zeros(0, dtype=np.int64)], [np.zeros(0)]
    for start, end in zip(paths.offsets[:-1].tolist(), paths.offsets[1:].tolist(), strict=True):
        along = along_line(paths.points[start:end])
        cell = np.floor(along / _EVERY)
        first = np.flatnonzero(np.append(True, np.diff(cell) > 0.0))
        index.append(start + first)
        length.append(np.diff(np.append(along[first], along[-1])))
    chosen = np.concatenate(index)
    step = np.repeat(paths.layer, np.diff(paths.offsets))[chosen]
    return chosen, np.concatenate(length), step


def _touched(
    tips: FloatArray, axes: FloatArray, step: IntArray, matter: Matter, machine: Machine
) -> tuple[BoolArray, IntArray]:
    """Whether the head touches earlier steps, or the bed, and a point of the former, or -1."""
    size = (machine.head_angle, machine.head_length)
    point = earlier_in_cones(tips, axes, step, matter.points, matter.step, *size)
    return (point >= 0) | under_bed(tips, axes, machine), point


def _turned(
    tips: FloatArray,
    axes: FloatArray,
    off: FloatArray,
    step: IntArray,
    matter: Matter,
    machine: Machine,
) -> FloatArray:
    """Axes that clear by the least lean; axes without any are not changed."""
    across = np.cross(axes, off)
    left = np.ones(len(tips), dtype=bool)
    turned = axes.copy()
    limit = np.cos(np.radians(machine.kinematics.tilt_limit)) - 1e-9
    room = 90.0 - machine.head_angle
    for lean in np.radians([lean for lean in _LEANS if lean < room]):
        for turn in np.radians(_TURNS):
            way = np.cos(turn) * off[left] + np.sin(turn) * across[left]
            tried = np.cos(lean) * axes[left] + np.sin(lean) * way
            hits, _ = _touched(tips[left], tried, step[left], matter, machine)
            clear = (tried[:, 2] >= limit) & ~hits
            done = np.flatnonzero(left)[clear]
            turned[done] = tried[clear]
            left[done] = False
            if not left.any():
                return turned
    return turned


def _way_off(tips: FloatArray, axes: FloatArray, at: IntArray, points: FloatArray) -> FloatArray:
    """Direction normal to each axis, away from a point that the head touches; else upright."""
    way = np.where(at[:, None] >= 0, tips - points[np.maximum(at, 0)], [0.0, 0.0, 1.0])
    way -= np.einsum("kd,kd->k", way, axes)[:, None] * axes
    alike = np.linalg.norm(way, axis=1) < 1e-6
    way[alike] = np.cross(axes[alike], np.eye(3)[np.abs(axes[alike]).argmin(axis=1)])
    return np.asarray(way / np.linalg.norm(way, axis=1, keepdims=True))


def _spread(paths: Toolpaths, axes: FloatArray, at: IntArray, turned: FloatArray) -> FloatArray:
    """Axes at all points, which turn to those at some points and back along the paths."""
    spread = axes.copy()
    path = np.searchsorted(paths.offsets, at, side="right") - 1
    lean = turned - axes[at]
    for number in np.unique(path).tolist():
        start, end = int(paths.offsets[number]), int(paths.offsets[number + 1])
        along, on_path = along_line(paths.points[start:end]), path == number
        away = np.abs(along[:, None] - along[at[on_path] - start])
        if paths.closed[number]:
            away = np.minimum(away, along[-1] - away)
        # Full over the stretch that a sample stands for, then decreasing.
        share = np.clip(1.0 - np.maximum(away - _EVERY, 0.0) / _RAMP, 0.0, 1.0)
        total = np.maximum(share.max(axis=1), 1e-300)
        weight = share**4 / np.maximum((share**4).sum(axis=1), 1e-300)[:, None]
        spread[start:end] += total[:, None] * (weight @ lean[on_path])
    return np.asarray(spread / np.linalg.norm(spread, axis=1, keepdims=True))
