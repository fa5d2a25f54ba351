"""A flat part: its planform, the sheet in plane stress, and what a design of that stands for."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial import cKDTree

from ccfem.base.arrays import BoolArray, FloatArray, IntArray, freeze
from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.patches import Plane
from ccfem.body.meshing.planform import extrude, triangulate
from ccfem.fem.elasticity import Load, Problem
from ccfem.fem.elasticity.load_kinds import patches_in_use, patches_of
from ccfem.fem.elasticity.problem import Support
from ccfem.fem.elasticity.support_kinds import AnySupport
from ccfem.fem.topopt.design import Design, anchors, sheet
from ccfem.fem.topopt.design_outline import outline
from ccfem.geometry.facets import unique_edges
from ccfem.geometry.symmetry import mirror_image, mirrors_of

_ON = 1e-6
"""How far a node may lie from the line that it is on, over the size of the part."""


@dataclass(frozen=True)
class Trace:
    """Where a patch of a flat part lies: lines of its outline, and areas on bottom and top, mm."""

    wall: Any
    faces: tuple[Any, Any]


@dataclass(frozen=True)
class FlatPart:
    """A prism along z.

    Attributes
    ----------
    planform : shapely Polygon, mm
        Its rings are the edges of the mesh.
    low, high : float, mm
        Of the bottom and the top along z.
    traces : mapping of patch name to Trace
    """

    planform: Any
    low: float
    high: float
    traces: Mapping[str, Trace]

    def __post_init__(self) -> None:
        freeze(self, traces=dict)

    @property
    def tolerance(self) -> float:
        """How far a node may lie from the line that it is on, mm."""
        _, _, *far = self.planform.bounds
        return _ON * max(1.0, float(np.abs(far).max()))

    def ends(self) -> FloatArray:
        """Points (k, 2) at which patches on the walls end, mm."""
        walls = [shapely.line_merge(trace.wall) for trace in self.traces.values()]
        lines = shapely.get_parts(walls) if walls else []
        open_ = [line for line in lines if not line.is_empty and not line.is_closed]
        ends = [shapely.get_coordinates(line)[[0, -1]] for line in open_]
        return np.concatenate([np.zeros((0, 2)), *ends])

    def patches(self, mesh: TetMesh) -> dict[str, IntArray]:
        """Patches of another mesh of this planform, or of a piece of it, as high as this part.

        Of the walls those take a patch that lie on its trace, of bottom and top the facets with
        their middle in it. A patch that nothing is left of is missing.
        """
        facets = mesh.boundary
        _, normal = mesh.facet_areas(facets)
        upright = np.abs(normal[:, 2]) < 0.5
        plane = mesh.points[facets][..., :2]
        patches = {}
        for name, trace in self.traces.items():
            chosen = upright & _all_on(plane, trace.wall, self.tolerance)
            for area, way in zip(trace.faces, (-1.0, 1.0), strict=True):
                if not area.is_empty:
                    x, y = plane.mean(axis=1).T
                    chosen |= (way * normal[:, 2] > 0.5) & shapely.contains_xy(area, x, y)
            if chosen.any():
                patches[name] = facets[chosen]
        return patches


def _all_on(plane: FloatArray, line: Any, off: float) -> BoolArray:
    """Facets (t,) whose corners (t, 3, 2) and their middle lie on a line."""
    middle = 0.5 * (plane.min(axis=1) + plane.max(axis=1))
    if line.is_empty:
        return np.zeros(len(plane), dtype=bool)
    every = np.concatenate([plane, middle[:, None]], axis=1)
    near = shapely.dwithin(shapely.points(every[:, :3]), line, off).all(axis=1)
    # A chord of a curved patch leaves it in its middle by a little.
    chord = np.linalg.norm(plane - np.roll(plane, 1, axis=1), axis=2).max(axis=1)
    return np.asarray(near & shapely.dwithin(shapely.points(middle), line, 0.2 * chord + off))


def flat_part(mesh: TetMesh) -> FlatPart | None:
    """Planform of a mesh that is a prism along z, with its patches; None for any other.

    Raises
    ------
    InputError
        For a patch that takes only a part of the height of a wall.
    """
    low, high = (float(z) for z in mesh.bounds[:, 2])
    off = _ON * max(1.0, float(np.abs(mesh.bounds).max()))
    _, normal = mesh.facet_areas(mesh.boundary)
    level = mesh.points[mesh.boundary][..., 2]
    bottom, top = (np.abs(level - z).max(axis=1) <= off for z in (low, high))
    if not (bottom | top | (np.abs(normal[:, 2]) < 1e-6)).all():
        return None
    planform = _union(mesh, mesh.boundary[bottom])
    volume = float(mesh.volumes.sum())
    if planform.geom_type != "Polygon" or abs(planform.area * (high - low) / volume - 1.0) > 1e-6:
        return None
    traces = {}
    for name, facets in mesh.patches.items():
        level = mesh.points[facets][..., 2]
        below, above = (np.abs(level - z).max(axis=1) <= off for z in (low, high))
        wall = facets[~(below | above)]
        line = _foot(mesh, wall, low + off)
        walls = float(mesh.facet_areas(wall)[0].sum()) if len(wall) else 0.0
        if walls < (1.0 - 1e-6) * line.length * (high - low) or (walls > 0.0 and line.is_empty):
            raise InputError(
                f"patch '{name}' takes only a part of the height of its wall, and a plate in plane "
                "stress knows no height: let it reach from bottom to top"
            )
        faces = (_union(mesh, facets[below]), _union(mesh, facets[above]))
        traces[name] = Trace(line, faces)
    return FlatPart(planform, low, high, traces)


def _union(mesh: TetMesh, facets: IntArray) -> Any:
    """Area that facets cover, seen from above; along their edges, exactly."""
    if not len(facets):
        return shapely.Polygon()
    sides = np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]])
    edges, number = unique_edges(sides)
    border = edges[np.bincount(number.reshape(-1), minlength=len(edges)) == 1]
    lines = shapely.linestrings(mesh.points[border][..., :2])
    rings = shapely.get_parts(shapely.polygonize(lines))
    x, y = mesh.points[facets][..., :2].mean(axis=1).T
    middles = shapely.STRtree(shapely.points(x, y))
    filled = [ring for ring in rings if len(middles.query(ring, predicate="contains"))]
    return shapely.union_all(filled)


def _foot(mesh: TetMesh, wall: IntArray, level: float) -> Any:
    """Lines along which wall facets (k, 3) stand on the bottom."""
    if not len(wall):
        return shapely.LineString()
    down = mesh.points[wall][..., 2] <= level
    chosen = down.sum(axis=1) == 2
    edges = wall[chosen][down[chosen]].reshape(-1, 2)
    return shapely.union_all(shapely.linestrings(mesh.points[edges][..., :2]))


# The sheet in plane stress, and the part that a design of it stands for.


_IN_PLANE = np.ix_([0, 1, 5], [0, 1, 5])
_FACES = ("sheet_bottom", "sheet_top")
_SHORTEST = 0.05
"""Shortest edge of the outline, in element sizes."""
_SYMMETRIC = 0.1
"""Mean difference from its mirror image of a design that is meant to be symmetric."""


def plane_stiffness(stiffness: FloatArray) -> FloatArray:
    """Plane stress stiffness (3, 3) of a thin sheet of a solid with stiffness (6, 6), MPa."""
    return np.asarray(np.linalg.inv(np.linalg.inv(stiffness)[_IN_PLANE]))


def sheet_problem(
    problem: Problem, flat: FlatPart, edge_length: float, stiffness: FloatArray
) -> tuple[Problem, IntArray]:
    """One layer of tetrahedra, held along z everywhere, with the supports and loads of a part.

    Parameters
    ----------
    flat : FlatPart
        Of its mesh.
    edge_length : float, mm
    stiffness : (3, 3) array, MPa
        Of the sheet.

    Returns
    -------
    sheet : Problem
        In plane stress.
    prism : (m,) int array
        Cells that are to share their density.
    """
    for name, loads in problem.loads.items():
        for load in loads:
            across = getattr(load, "vector", getattr(load, "acceleration", (0.0, 0.0, 0.0)))[2]
            faces = [flat.traces[patch].faces for patch in patches_of(load)]
            pressed = hasattr(load, "magnitude") and any(
                not f.is_empty for two in faces for f in two
            )
            if across != 0.0 or pressed:
                raise InputError(
                    f"load case '{name}' bends the plate across its plane: a sheet in plane stress "
                    "takes loads along x and y: optimise it in space (--method simp --in-space)"
                )
    mesh, prism = sheet_mesh(flat.planform, flat.low, flat.high, edge_length, flat.ends())
    patches = flat.patches(mesh)
    patches |= {
        name: Plane("z", side, 1e-6)(mesh)
        for name, side in zip(_FACES, ("min", "max"), strict=True)
    }
    broad = np.broadcast_to(sheet(stiffness), (len(mesh.cells), 6, 6))
    supports = tuple(support for support in problem.supports if not _only_across(support, flat))
    return (
        replace(
            problem,
            mesh=mesh.with_patches(patches),
            supports=(*supports, *(Support(name, "z") for name in _FACES)),
            axes=None,
            density=None,
            stiffness=broad,
            regions=(),
            combinations={},
            order=1,
        ),
        prism,
    )


def _only_across(support: AnySupport, flat: FlatPart) -> bool:
    """Whether a support holds the part along z alone, as a table does that it lies on."""
    if isinstance(support, Support) and set(support.components) == {"z"}:
        return True
    names = patches_of(support)
    return bool(names) and all(
        flat.traces[name].wall.is_empty
        and type(support).__name__ in ("PressingSupport", "SlidingSupport")
        for name in names
    )


def sheet_outline(design: Design, flat: FlatPart, edge_length: float, solid: Any, void: Any) -> Any:
    """Outline of the part that a design of a sheet stands for: a shapely Polygon, mm.

    Parameters
    ----------
    design : Design
        Of a problem of `sheet_problem`.
    edge_length : float, mm
        Of its mesh.
    solid, void : shapely geometries, mm
        Areas that stay full, and empty, exactly.
    """
    problem = design.full
    assert isinstance(problem, Problem)
    mesh, dense = problem.mesh, _at_nodes(design)
    left, bottom, right, top = flat.planform.bounds
    count = np.ceil((np.array([right - left, top - bottom]) / edge_length) - 1e-9).astype(int)
    origin = 0.5 * (np.array([left + right, bottom + top]) - count * edge_length)
    # Density on an image centred on the planform, so that it has its mirror axes.
    rows, columns = np.mgrid[: count[1], : count[0]]
    x = origin[0] + (columns + 0.5) * edge_length
    y = origin[1] + (count[1] - rows - 0.5) * edge_length
    inside = np.asarray(shapely.dwithin(shapely.points(x, y), flat.planform, 0.5 * edge_length))
    plane = mesh.points[:, :2]
    image = LinearNDInterpolator(plane[: len(plane) // 2], dense[: len(plane) // 2])(x, y)
    nearest = NearestNDInterpolator(plane, dense)(x, y)
    image = np.where(np.isfinite(image), image, nearest).clip(0.0, 1.0)
    for axis in mirrors_of(flat.planform):
        other = image[:, ::-1] if axis == 0 else image[::-1]
        if np.abs(image - other)[inside].mean() <= _SYMMETRIC:
            image = 0.5 * (image + other)
    domain = shapely.difference(flat.planform, void)
    shift = shapely.transform(domain, lambda points: points - origin)
    keep = [nodes[dense[nodes].argmax()] for nodes in anchors(problem, _FACES)]
    region = outline(
        np.where(inside, image, 0.0),
        edge_length,
        design.volume_fraction,
        domain=shift,
        inside=inside,
        keep=plane[keep] - origin,
        apart=design.apart,
    )
    region = shapely.transform(region, lambda points: points + origin)
    if not shapely.is_empty(solid):
        region = _with_solid(region, shapely.intersection(solid, domain), domain, edge_length)
    ends = flat.ends()
    return without_short_edges(region, flat.planform, ends, _SHORTEST * edge_length)


def _with_solid(region: Any, solid: Any, domain: Any, edge_length: float) -> Any:
    """Outline with areas that stay full, joined to it by rounded corners."""
    round_ = 0.5 * edge_length
    joined = shapely.union(region, solid)
    joined = shapely.intersection(joined.buffer(round_).buffer(-round_), domain)
    pieces = shapely.get_parts(shapely.union(joined, solid))
    return max(pieces, key=lambda piece: piece.area)


def _at_nodes(design: Design) -> FloatArray:
    """Density (n,) at the nodes: mean over the cells round each, by volume."""
    mesh = design.full.mesh
    volume, nodes = design.volumes, mesh.cells.reshape(-1)
    total = np.bincount(nodes, np.repeat(volume * design.density, 4), len(mesh.points))
    both = total + np.roll(total, len(total) // 2)
    weight = np.bincount(nodes, np.repeat(volume, 4), len(mesh.points))
    return np.asarray(both / (weight + np.roll(weight, len(weight) // 2)))


def sheet_part(problem: Problem, flat: FlatPart, planform: Any, edge_length: float) -> Problem:
    """Part of another planform within that of a flat part, held and loaded as that one."""
    mesh = extrude(planform, flat.high - flat.low, edge_length, keep=flat.ends())
    mesh = TetMesh(mesh.points + np.array([0.0, 0.0, flat.low]), mesh.cells)
    patches = flat.patches(mesh)
    loads: dict[str, tuple[Load, ...]] = dict(problem.loads)
    for name in patches_in_use(problem.supports, loads):
        if name not in patches:
            raise InputError(
                f"nothing of patch '{name}' is left in the design: keep it solid (--keep {name}), "
                "or raise the volume fraction"
            )
    return replace(problem, mesh=mesh.with_patches(patches), axes=None, stiffness=None)


# Outlines without the shortest edges, which would make cells a thousand times as long as high.
#
# They come about where the outline of a design meets the border of the whole part.


_ON_LINE = 1e-7
"""Distance, mm, from a border or a point up to which a vertex lies on it."""


def without_short_edges(outline: Any, whole: Any, keep: FloatArray, least: float) -> Any:
    """Leave out vertices of an outline until no edge is shorter than a length, where that can be.

    Of the two ends of such an edge, one that is to be kept stays, then one on the border of the
    whole part, whose walls stay where they are; of two alike the one at the sharper corner.

    Parameters
    ----------
    outline : shapely Polygon, mm
    whole : shapely Polygon, mm
        Whose border the outline follows in places.
    keep : (k, 2) array, mm
        Points that stay.
    least : float, mm

    Returns
    -------
    shapely Polygon
        The outline itself where what is left would not be valid.
    """
    border, points = shapely.boundary(whole), shapely.multipoints(keep)
    rings = []
    for ring in (outline.exterior, *outline.interiors):
        vertices = shapely.get_coordinates(ring)[:-1]
        places = shapely.points(vertices)
        rank = np.where(shapely.distance(places, border) <= _ON_LINE, 1, 0)
        if len(keep):
            rank[shapely.distance(places, points) <= _ON_LINE] = 2
        rings.append(_shortened(vertices, rank, least))
    polygon = shapely.Polygon(rings[0], rings[1:])
    return polygon if polygon.is_valid else outline


def _shortened(vertices: FloatArray, rank: IntArray, least: float) -> FloatArray:
    """Ring of vertices (n, 2), not closed, without those that its short edges do not need."""
    while len(vertices) > 3:
        step = np.roll(vertices, -1, axis=0) - vertices
        size = np.hypot(*step.T)
        after = np.roll(np.arange(len(vertices)), -1)
        loose = np.minimum(rank, rank[after]) < 2
        k = int(np.argmin(np.where(loose, size, np.inf)))
        if not loose[k] or size[k] >= least:
            break
        before = np.roll(step, 1, axis=0)
        cross = before[:, 0] * step[:, 1] - before[:, 1] * step[:, 0]
        turn = np.abs(np.arctan2(cross, (before * step).sum(axis=1)))
        ends = (k, int(after[k]))
        left_out = min(ends, key=lambda n: (rank[n], turn[n]))
        vertices, rank = np.delete(vertices, left_out, axis=0), np.delete(rank, left_out)
    return vertices


# One layer of prisms on a planform, symmetric where the planform is.


def sheet_mesh(
    planform: Any, low: float, high: float, edge_length: float, keep: FloatArray
) -> tuple[TetMesh, IntArray]:
    """Mesh a planform by one layer of prisms, each cut into three tetrahedra.

    Parameters
    ----------
    planform : shapely Polygon, mm
    low, high : float, mm
        Along z.
    edge_length : float, mm
    keep : (k, 2) array, mm
        Points on the outline that become points of the mesh.

    Returns
    -------
    mesh : TetMesh
        Without patches; its own mirror image wherever the planform is.
    prism : (m,) int array
        Prism of each cell.
    """
    # Only a half or a quarter is meshed where the planform is symmetric, and mirrored.
    mirrors = mirrors_of(planform)
    left, bottom, right, top = planform.bounds
    middle = np.array([0.5 * (left + right), 0.5 * (bottom + top)])
    part = shapely.box(
        left, bottom, middle[0] if 0 in mirrors else right, middle[1] if 1 in mirrors else top
    )
    quarter = shapely.intersection(planform, part) if mirrors else planform
    if quarter.geom_type != "Polygon":
        mirrors, quarter = (), planform
    # Points to keep, mirrored into the part that is meshed.
    folded = keep.copy()
    for axis in mirrors:
        folded[:, axis] = middle[axis] - np.abs(folded[:, axis] - middle[axis])
    points, triangles = triangulate(quarter, edge_length, folded)
    rank = np.arange(len(points))
    for axis in mirrors:
        points, triangles, rank = _mirrored(points, triangles, rank, planform, axis)
    n = len(points)
    # The diagonal on a side rises from the end of the higher rank: mirror images match.
    rising = np.take_along_axis(
        triangles, np.argsort(rank[triangles], axis=1, kind="stable"), axis=1
    )
    prism = np.concatenate([rising, rising + n], axis=1)
    cells = prism[:, [[0, 1, 2, 5], [0, 1, 4, 5], [0, 3, 4, 5]]].reshape(-1, 4)
    levels = np.repeat([low, high], n)
    points = np.column_stack([np.tile(points, (2, 1)), levels])
    inside_out = TetMesh(points, cells).volumes < 0.0
    cells[inside_out] = cells[inside_out][:, [0, 2, 1, 3]]
    return TetMesh(points, cells), np.repeat(np.arange(len(triangles)), 3)


def _mirrored(
    points: FloatArray, triangles: IntArray, rank: IntArray, planform: Any, axis: int
) -> tuple[FloatArray, IntArray, IntArray]:
    """Mesh with its mirror image beside it; points on the mirror are shared."""
    image = mirror_image(points, planform, axis)
    size = float(np.ptp(points, axis=0).max())
    away, nearest = cKDTree(points).query(image)
    shared = away <= 1e-9 * size
    number = np.where(shared, nearest, len(points) + np.cumsum(~shared) - 1)
    every = np.concatenate([points, image[~shared]])
    both = np.concatenate([triangles, number[triangles[:, [0, 2, 1]]]])
    return every, both, np.concatenate([rank, rank[~shared]])
