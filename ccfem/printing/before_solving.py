"""What is known of a print before the part is solved: machine, lines, bed, covers, overhangs."""

from collections.abc import Sequence

import numpy as np

from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.machine.machine import Machine
from ccfem.paths.splitting.slabs import check_cover, slabs_of
from ccfem.printing.bed_layout import AS_IT_STANDS, BedLayout
from ccfem.printing.line_counts import check_matrix_lines
from ccfem.printing.part_moves import part_moves
from ccfem.printing.print_plan import check_bed, check_machine
from ccfem.printing.support.overhang import overhang
from ccfem.printing.together import arranged, outline
from ccfem.slicing.layers.layer import Layer, plane_frame


def check_print(
    mesh: TetMesh,
    build: Sequence[float],
    machine: Machine,
    layers: Sequence[Layer] = (),
    layout: BedLayout = AS_IT_STANDS,
) -> None:
    """Refuse a print that its machine cannot make, whatever the paths are.

    Parameters
    ----------
    mesh : TetMesh
        The part.
    build : 3 floats
        Build direction.
    layers : sequence of Layer
        Flat layers that get fibre, if they are known before the part is solved; the part then
        stands upright, as its layers lie.
    layout : BedLayout
        Turn, place and copies on the bed.

    Raises
    ------
    InputError
        For speeds of 0, a cutter farther from the nozzle than the shortest strand is long, more
        lines than are planned, a part or copies that do not fit on the bed with all that is laid
        beside them, and layers without room, or without matrix to hold them.
    """
    up = _upwards(build, layers)
    check_machine(machine)
    check_matrix_lines(mesh, up, machine)
    if not layers:
        return
    check_room([mesh], [up], [layout], machine)
    level = mesh.points[np.unique(mesh.corners)] @ up
    check_cover(slabs_of(layers, float(level.min()), float(level.max()), machine), machine)


def _upwards(build: Sequence[float], layers: Sequence[Layer]) -> tuple[float, ...]:
    """Direction in which a part stands: across its flat layers, where they are known."""
    return tuple(layers[0].plane.frame[2].tolist() if layers else build)


def check_room(
    meshes: Sequence[TetMesh],
    builds: Sequence[Sequence[float]],
    layouts: Sequence[BedLayout],
    machine: Machine,
    names: Sequence[str] = ("",),
) -> None:
    """Print the outlines of the boxes of parts, each once at its top, with all beside them."""
    plans, many = [], sum(layout.count for layout in layouts) > 1
    for mesh, build, layout in zip(meshes, builds, layouts, strict=True):
        corners = mesh.points[np.unique(mesh.corners)] @ layout.frame(plane_frame(build)).T
        low, high = corners.min(axis=0), corners.max(axis=0)
        half = 0.5 * np.maximum(high - low - machine.matrix_width, 0.0)[:2]
        middle, height = 0.5 * np.array(machine.gcode.bed[:2]), float(high[2] - low[2])
        ends = (np.append(middle - half, height), np.append(middle + half, height))
        # Of one part the fibre stays on the bed where the matrix does; of several that is computed.
        plans.append(outline(*ends, machine.matrix_height, many))
        check_bed(plans[-1], machine)
    part_moves(arranged(plans, layouts, machine, names), machine)


def refusal(
    mesh: TetMesh,
    build: Sequence[float],
    machine: Machine,
    layers: Sequence[Layer] = (),
    layout: BedLayout = AS_IT_STANDS,
) -> str:
    """Say why `check_print` refuses a print; empty where it does not."""
    try:
        check_print(mesh, build, machine, layers, layout)
    except InputError as error:
        return str(error)
    return ""


def in_air(mesh: TetMesh, machine: Machine, layers: Sequence[Layer]) -> str:
    """Say what flat layers of a part would lay in air without support; empty for nothing."""
    hanging = overhang(mesh, _upwards((), layers), machine) if layers else None
    return "" if hanging is None else hanging.words


def check_support(mesh: TetMesh, layers: Sequence[Layer], machine: Machine) -> None:
    """Refuse support below flat layers that need none."""
    if overhang(mesh, _upwards((), layers), machine) is None:
        raise InputError(
            f"no face of the part hangs over by more than {machine.limits.overhang:g} degrees, so "
            "that its flat layers need no support: leave out --support"
        )
