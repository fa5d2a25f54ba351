"""Faces of a part that hang over while it is printed, and the matrix laid in air below none."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.geometry.facets import connected, paired
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import plane_frame
from ccfem.slicing.slicers.planar import Planar

_SLACK = 2.0
"""Degrees by which facets of a face that leans over by the allowed angle may lean over more."""
_LINES = 2
"""Least width of what is laid in air, in lines side by side: edges that are rounded below pass."""
_ARC = 8
"""Segments per quarter circle."""
_ACROSS = 20
"""Lines across a piece that are looked at."""
_SMOOTH = 0.02
"""Deviation of sections that is no matter, mm."""


def hanging_facets(
    mesh: TetMesh, frame: FloatArray, bed: float, angle: float, reach: float, upright: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Find the boundary facets that lean over by more than an angle, but those on the bed.

    Parameters
    ----------
    frame : (3, 3) array
        Its last row is the build direction.
    bed : float, mm
        Height of the bed along it.
    angle : float, degrees
        From upright.
    reach : float, mm
        Facets no higher than this above the bed lie on it.
    upright : float
        Cosine to the build direction up to which facets count as upright, whatever the angle.

    Returns
    -------
    area : (f,) array, mm^2
    lean : (f,) array
        Cosine of the outer normal to the build direction: -1 looks straight down.
    hanging : (f,) bool array
    """
    area, normal = mesh.facet_areas(mesh.boundary)
    lean = normal @ frame[2]
    on_bed = ((mesh.points @ frame[2])[mesh.boundary] <= bed + reach).all(axis=1)
    return area, lean, (lean < -max(np.sin(np.radians(angle)), upright)) & ~on_bed


@dataclass(frozen=True)
class Overhang:
    """What flat layers would lay in air.

    Attributes
    ----------
    region : shapely (Multi)Polygon, mm
        Seen along the build direction, in the frame of `ccfem.slicing.layers.layer.plane_frame`.
    area : float, mm^2
        Of all of it, also of what lies above each other.
    height : float, mm
        Of the lowest of it, above the bed.
    share : float
        Of the matrix: one layer over that area.
    angle : float, degrees
        From upright, up to which the machine lays layers without support.
    """

    region: Region
    area: float
    height: float
    share: float
    angle: float

    @property
    def words(self) -> str:
        """One line: how much it is, from where on, and the cure."""
        share = f"{self.share:.1%}" if self.share >= 1e-3 else "less than 0.1%"
        return (
            f"{share} of the matrix would be laid in air: {self.area:.3g} mm^2 of the part, "
            f"from {self.height:.3g} mm above the bed on, hang over by more than {self.angle:g} "
            "degrees: turn the part, print support below it (--gcode --support), or raise "
            "machine.limits.overhang"
        )


def overhang(mesh: TetMesh, build: Sequence[float], machine: Machine) -> Overhang | None:
    """Find what layers of a part across `build` would lay in air; None where all lies on something.

    That is below faces that lean over by more than `Limits.overhang`. A gap no wider than
    `Limits.free_span` is bridged: what stands on both sides of it holds the lines. Places where
    less than two lines side by side lie in air, as on edges that are rounded below, pass.
    """
    limits, width = machine.limits, machine.matrix_width
    thickness = machine.highest_matrix(0.0)
    frame = plane_frame(tuple(build))
    places = mesh.points @ frame.T
    bed = float(places[np.unique(mesh.corners), 2].min())
    top = float(places[np.unique(mesh.corners), 2].max())
    angle = min(limits.overhang + _SLACK, 90.0)
    *_, hanging = hanging_facets(mesh, frame, bed, angle, _SMOOTH, 0.0)
    facets = mesh.boundary[hanging]
    if angle >= 90.0 or not len(facets):
        return None
    reach = 0.5 * _LINES * width
    regions: list[Region] = []
    lowest: list[float] = []
    for rows in _facet_groups(facets):
        corners = places[facets[rows][:, :3]]
        seen = shapely.union_all(shapely.polygons(corners[:, :, :2]))
        if not shapely.buffer(seen, -reach).is_empty:
            regions.append(seen)
            lowest.append(float(corners[:, :, 2].min()))
    # Just below each piece lies what may hold it, or bridge to it; farther down a round roof is
    # wider than what is bridged.
    step = 0.125 * thickness
    below = np.clip(np.array(lowest) - step, bed + min(step, 0.5 * (top - bed)), None)
    below = bed + np.floor((below - bed) / step + 0.5) * step
    in_air, height = list[Region](), np.inf
    held = _bridged(mesh, frame, np.unique(below), limits.free_span)
    for seen, low, level in zip(regions, lowest, below.tolist(), strict=True):
        below_it = held.get(level, shapely.Polygon())
        free = shapely.difference(seen, below_it)
        if _is_spanned(seen, below_it, limits.free_span):
            continue
        inner = shapely.buffer(free, -reach, quad_segs=_ARC)
        if not inner.is_empty:
            opened = shapely.buffer(inner, reach, quad_segs=_ARC)
            in_air.append(shapely.intersection(opened, free))
            height = min(height, low - bed)
    if not in_air:
        return None
    area = sum(region.area for region in in_air)
    share = area * thickness / float(mesh.volumes.sum())
    return Overhang(shapely.union_all(in_air), area, height, share, limits.overhang)


def _facet_groups(facets: IntArray) -> list[IntArray]:
    """Rows of facets (f, 3 or more) that hang together through edges."""
    edges = facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    pairs, _ = paired(edges)
    piece = connected(pairs // 3, len(facets))
    order = np.argsort(piece, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(piece[order])) + 1)


def _is_spanned(seen: Region, held: Region, span: float) -> bool:
    """Whether lines along a side of a piece lie on something at both of their ends.

    So do those of the roof of a slot, up to its open ends, where `_bridged` leaves corners.
    """
    box = shapely.get_coordinates(shapely.minimum_rotated_rectangle(seen))
    sides = np.diff(box, axis=0)[:2]
    size = np.linalg.norm(sides, axis=1)
    share = np.linspace(-0.49, 0.49, _ACROSS)[:, None]
    for k in range(len(size)):
        if size[k] <= span:
            places = box[:4].mean(axis=0) + share * sides[1 - k]
            reach = (0.5 + 5.0 * _SMOOTH / size[k]) * sides[k]
            ends = shapely.points(np.concatenate([places - reach, places + reach]))
            if shapely.dwithin(ends, held, 5.0 * _SMOOTH).all():
                return True
    return False


def _bridged(
    mesh: TetMesh, frame: FloatArray, levels: FloatArray, span: float
) -> dict[float, Region]:
    """Sections of a part with all gaps filled that are no wider than a span, by their levels."""
    if not len(levels):
        return {}
    filled = {}
    for k, layer in Planar(heights=tuple(levels.tolist())).sections(mesh, frame[2].tolist()):
        section = shapely.simplify(layer.polygon, _SMOOTH)
        reach = 0.5 * span
        wide = shapely.buffer(section, reach, quad_segs=_ARC)
        closed = shapely.buffer(wide, -reach, quad_segs=_ARC)
        filled[float(levels[k])] = shapely.union(closed, section)
    return filled
