"""Strands in the mesh: every fibre path cut where it passes from one cell to the next."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray, freeze, in_brief
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.polylines import starts_segment
from ccfem.judging.virtual_testing.cut_steps import cut_steps
from ccfem.judging.virtual_testing.strand_room import room_of
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, Toolpaths


@dataclass(frozen=True)
class Strands:
    """Straight pieces of fibre, each inside one cell, in the order of the paths.

    A piece that lies on a face or an edge belongs to all cells round it in equal shares: it comes
    once a cell, with its length divided by their number, so that lengths add up.

    Attributes
    ----------
    cell : (s,) int array
        Cell of the mesh that holds each piece.
    length : (s,) array, mm
    tangent : (s, 3) array
        Unit vectors along the path.
    path : (s,) int array
        Index of the path in the toolpaths.
    arc : (s,) array, mm
        Arc length of the path at the middle of the piece.
    middle : (s, 3) array, mm
    outside : float, mm
        Length of fibre, links left out, that lies outside the mesh and carries nothing.
    share : (s,) array in [0, 1]
        How much of its stiffness each piece lends: fibre on other fibre has no room, and lends
        nothing (`ccfem.judging.virtual_testing.strand_room`).
    """

    cell: IntArray
    length: FloatArray
    tangent: FloatArray
    path: IntArray
    arc: FloatArray
    middle: FloatArray
    outside: float
    share: FloatArray

    __repr__ = in_brief

    def __post_init__(self) -> None:
        freeze(self, cell=int, path=int, length=float, tangent=float)
        freeze(self, arc=float, middle=float, share=float)

    def __len__(self) -> int:
        return len(self.cell)

    @property
    def total(self) -> float:
        """Length of fibre inside the mesh, mm."""
        return float(self.length.sum())


def cut_strands(
    toolpaths: Toolpaths,
    mesh: TetMesh,
    most_outside: float = 0.01,
    machine: Machine | None = None,
) -> Strands:
    """Cut the fibre paths at the faces of the cells.

    Parameters
    ----------
    toolpaths : Toolpaths
        Fibre paths are cut, other kinds left out. Links outside the mesh are left out too: beyond
        the part they are cut off, and over a void nothing embeds them.
    mesh : TetMesh
        Quadratic cells are taken as straight-sided.
    most_outside : float in [0, 1], default 0.01
        Share of the fibre length, links left out, that may lie outside the mesh.
    machine : Machine, optional
        Its strands need room: those of about the same direction that lie nearer than its fibre
        width share it. Default: every strand counts in full, wherever it lies.

    Returns
    -------
    Strands
        Their lengths add up to the length of the paths inside the mesh; relative error below
        1e-9, also for paths along faces, along edges and through nodes.

    Raises
    ------
    InputError
        When there is no fibre, or none but links outside the mesh; or when more of it than allowed
        lies outside.
    """
    fibre = np.repeat(toolpaths.kind == FIBRE, np.diff(toolpaths.offsets))
    first_point = np.flatnonzero(fibre & starts_segment(toolpaths.offsets))
    path = np.searchsorted(toolpaths.offsets, first_point, side="right") - 1
    start = toolpaths.points[first_point]
    step = toolpaths.points[first_point + 1] - start
    length = np.linalg.norm(step, axis=1)
    if not length.sum() > 0.0:
        raise InputError(
            f"the virtual test needs fibre; got {len(toolpaths)} paths and 0 mm of fibre: "
            "lower the least amount that the strategy lays, or test the unreinforced part"
        )
    segment, cell, begin, end, share = cut_steps(start, step, length, mesh)
    count = len(segment)
    piece = (end - begin) * length[segment]
    own = np.where(toolpaths.link[first_point], 0.0, length)
    if not count and not own.any():
        raise InputError(
            f"the virtual test needs fibre inside the mesh; got only {length.sum():.4g} mm of "
            "links outside it: lay strands, or mark as links only fibre that joins them"
        )
    inside = float(((end - begin) * own[segment] * share).sum())
    outside = max(float(own.sum()) - inside, 0.0)
    if outside > most_outside * own.sum():
        raise InputError(
            f"fibre must lie inside the mesh; {outside:.4g} mm of {own.sum():.4g} mm lie "
            f"outside ({100 * outside / own.sum():.3g} %, allowed {100 * most_outside:g} %): "
            "give paths and mesh in the same frame and unit"
        )
    before = np.cumsum(length) - length
    before -= before[np.searchsorted(path, path)]
    middle = 0.5 * (begin + end)
    unit = step / np.maximum(length, 1e-300)[:, None]
    arc = before[segment] + middle * length[segment]
    lent = np.ones(count) if machine is None else room_of(toolpaths, path[segment], arc, machine)
    return Strands(
        cell=cell,
        length=piece * share,
        tangent=unit[segment],
        path=path[segment],
        arc=arc,
        middle=start[segment] + middle[:, None] * step[segment],
        outside=outside,
        share=lent,
    )
