"""The print of a part of curved layers: support, then the matrix of each layer, then its fibre."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.printing.curved_layers import FilledLayer, filled_layers, in_order
from ccfem.printing.head_lean import Matter, cleared, touched_length
from ccfem.printing.islands import Islands, clashes, island_order, islands_of, rests_on, steps_of
from ccfem.printing.laid_layer import COORDINATE_DIGITS
from ccfem.printing.poses import poses
from ccfem.printing.print_plan import PrintPlan
from ccfem.printing.support import SupportLayers
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.plane import plane_frame
from ccfem.slicing.layers.slicer import Vector
from ccfem.slicing.layers.standing import standing

_MISSING = 0.01
"""Share of the part's volume that may be missing without a warning."""
_UP = np.array([0.0, 0.0, 1.0])


def curved_plan(
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    mesh: TetMesh,
    machine: Machine,
    build: Vector = (0.0, 0.0, 1.0),
    support: SupportLayers | None = None,
) -> PrintPlan:
    """Plan the print of a part of curved layers.

    In each layer matrix comes first, as rings of the local layer height, less the share of the
    volume that the fibre takes. Then comes the fibre, always continuing with the strand of nearest
    end. A layer of support is printed just before the layer of the part at its level. If the head
    would touch other pieces while above a piece of a layer, that piece is printed first if possible
    (`ccfem.printing.islands`). The head stands along the normal of the layer, as far as
    `Kinematics.tilt_limit` allows, and leans where it would still touch something
    (`ccfem.printing.head_lean`); remaining contact is stated in the warnings. The nozzle is at the
    top of a layer, half its thickness above its middle. The part stands in the middle of the bed,
    on its support or on its lowest point.

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
        Build direction. If layers face downwards from there, the part stands along their mean
        normal (`standing`).
    support : SupportLayers, optional
        Support of these layers; the part stands as it does there.

    Raises
    ------
    InputError
        Where a strand is shorter than the cutter allows and `Process.short` is "error", or the head
        of a machine of three axes would touch the layer that it lays.
    """
    fibre, dropped = _long_enough(toolpaths.of_kind(FIBRE), machine)
    wanted = plane_frame(build)[2]
    if support is None:
        frame = plane_frame(standing(layers, build))
    else:
        frame = plane_frame(support.columns.up.tolist())
    filled = filled_layers(fibre, layers, support, machine)
    islands = islands_of([each.layer for each in filled])
    clash = clashes(islands, frame[2], machine)
    steps = [
        (step, *_of_step(filled, islands, step))
        for step in steps_of(islands, island_order(rests_on(islands), clash), clash)
    ]
    steps = [step for step in steps if len(step[1])]
    if not steps:
        raise InputError("there is nothing to print: the part is thinner than a line of matrix")
    paths = Toolpaths.concatenate(
        replace(own, layer=np.full(len(own), number)) for number, (_, own, _) in enumerate(steps)
    )
    shift = _shift(mesh, support, frame, machine)
    points = (paths.points @ frame.T - shift).round(COORDINATE_DIGITS) + 0.0
    normals = paths.normals @ frame.T
    _check_tilt(normals, machine)
    paths = replace(paths, points=points)
    axes, tops = poses(normals, _UP, machine), islands.tops @ frame.T - shift
    source = np.array([islands.layer[step[0]] for step, _, _ in steps])
    level = replace(paths, layer=source[paths.layer])
    before = touched_length(level, axes, Matter.of(tops, islands.layer[islands.owner]), machine)
    when = np.full(len(islands), -1)
    for number, (step, _, _) in enumerate(steps):
        when[step] = number
    found = cleared(paths, axes, Matter.of(tops, when[islands.owner]), machine)
    upright = machine.kinematics.kind == "three_axes"
    owner = np.repeat(paths.layer, np.diff(paths.offsets))
    return PrintPlan(
        replace(paths, normals=normals if upright else found.axes),
        np.array([points[owner <= k, 2].max() for k in range(len(steps))]),
        np.array([filled[k].layer.thickness for k in source.tolist()]),
        np.concatenate([laid for _, _, laid in steps]),
        dropped=dropped,
        touched=(before, found.before, found.after),
        warnings=(
            *_stands(frame[2], wanted, support),
            *_not_full(filled, mesh),
            *_said(before, found.before, found.after, found.place),
        ),
    )


def _long_enough(fibre: Toolpaths, machine: Machine) -> tuple[Toolpaths, float]:
    """Strands that the cutter allows, and the length of the others."""
    limit = max(machine.tail, machine.minimum_length) * (1.0 - 1e-6)
    whole = fibre.lengths >= limit
    if not whole.all() and machine.process.short == "error":
        raise InputError(
            f"{int((~whole).sum())} of {len(fibre)} strands are shorter than the {limit:.4g} mm "
            "that the cutter allows: plan with that minimum_length, or set process.short = 'drop'"
        )
    return fibre.select(whole), float(fibre.lengths[~whole].sum())


def _of_step(
    filled: Sequence[FilledLayer], islands: Islands, step: IntArray
) -> tuple[Toolpaths, FloatArray]:
    """Paths of some islands of a layer in the order of printing, and the height that they lay."""
    own = filled[int(islands.layer[step[0]])]
    here = np.isin(own.piece, islands.piece[step])
    parts, laid = [], []
    for wanted in (own.paths.kind != FIBRE, own.paths.kind == FIBRE):
        chosen = here & wanted
        heights = own.laid[np.repeat(chosen, np.diff(own.paths.offsets))]
        paths, at = in_order(own.paths.select(chosen))
        parts.append(paths)
        laid.append(heights[at])
    return Toolpaths.concatenate(parts), np.concatenate(laid)


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
    missing, whole = sum(each.missing for each in filled), float(mesh.volumes.sum())
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
