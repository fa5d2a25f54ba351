"""From a design to a part that is solved, sliced and printed like any other."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
import shapely

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.body.files.surface import Surface
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.patches import Plane
from ccfem.body.meshing import extrude
from ccfem.fem.elasticity import Load, Problem
from ccfem.fem.elasticity.problem import Force, PointForce, Support
from ccfem.fem.materials import Material
from ccfem.fem.plates.mesh import PlaneMesh, raster_image
from ccfem.fem.plates.problem import PlaneProblem
from ccfem.fem.topopt.design import Design, anchors
from ccfem.fem.topopt.design_outline import outline
from ccfem.geometry.facets import are_among, connected, positions, signed_volumes, unique_edges

# The part of a tetrahedral mesh where a field lies above a level, as a mesh of its own.


_LEAST = 0.05
"""Least share of an edge on either side of a cut."""
_PRISMS = np.array(
    [
        [0, 1, 2, 3, 4, 5],
        [1, 2, 0, 4, 5, 3],
        [2, 0, 1, 5, 3, 4],
        [3, 5, 4, 0, 2, 1],
        [4, 3, 5, 1, 0, 2],
        [5, 4, 3, 2, 1, 0],
    ]
)
"""Orders of the corners of a prism that begin with each of them and do not turn it inside out."""
_SPLITS = np.array(
    [[[0, 1, 2, 5], [0, 1, 5, 4], [0, 4, 5, 3]], [[0, 1, 2, 4], [0, 4, 2, 5], [0, 4, 5, 3]]]
)
"""Tetrahedra of a prism whose diagonals meet in corner 0, by the third diagonal: 15 or 24."""
_LONE = ((0, 1, 2, 3), (1, 0, 3, 2), (2, 0, 1, 3), (3, 0, 2, 1))
_PAIRS = ((0, 1, 2, 3), (2, 3, 0, 1), (0, 2, 3, 1), (3, 1, 0, 2), (0, 3, 1, 2), (1, 2, 0, 3))
"""Orders of the corners of a tetrahedron that keep it positive."""


class CutMesh(NamedTuple):
    """A part of a mesh with what is left of the patches.

    Each boundary facet lies on one of the whole mesh, (b,); -1 on the cut.
    """

    mesh: TetMesh
    facet: IntArray


def volume_above(mesh: TetMesh, values: FloatArray, level: float) -> float:
    """Volume where a piecewise linear field, (n,) at the nodes, is above a level, mm^3."""
    off = np.sort(values[mesh.corners] - level, axis=1)[:, ::-1]
    count = (off > 0.0).sum(axis=1)
    share = (count == 4).astype(np.float64)
    a, b, c, d = off.T
    with np.errstate(divide="ignore", invalid="ignore"):
        corner = a**3 / ((a - b) * (a - c) * (a - d))
        three = 1.0 + d**3 / ((a - d) * (b - d) * (c - d))
        # Two of three corners, by the prism that is left of the tetrahedron.
        x, y, z, w = a / (a - c), a / (a - d), b / (b - c), b / (b - d)
        two = x * y + z * w * (1.0 - x) + (1.0 - y) * x * w
    for chosen, part in ((1, corner), (2, two), (3, three)):
        share[count == chosen] = part[count == chosen]
    return float(mesh.volumes @ share)


def cut_mesh(mesh: TetMesh, values: FloatArray, level: float) -> CutMesh:
    """Cut out the part of a mesh where a piecewise linear field (n,) is above a level.

    Marching tetrahedra (Doi and Koide, IEICE Trans. E74 (1991) 214); the prisms that are left are
    split by their least node, so that neighbours agree (Dompierre et al., How to subdivide
    pyramids, prisms and hexahedra into tetrahedra, 8th International Meshing Roundtable, 1999).
    """
    n, inside = len(mesh.points), values > level
    # Edges with one end above the level, each once, and where they are cut: not at their very ends.
    ends = np.sort(mesh.cells[:, mesh.edges].reshape(-1, 2), axis=1)
    ends = ends[inside[ends[:, 0]] != inside[ends[:, 1]]]
    keys = np.unique(ends[:, 0] * n + ends[:, 1])
    ends = np.stack(np.divmod(keys, n), axis=1)
    low, high = values[ends].T
    share = np.clip((level - low) / (high - low), _LEAST, 1.0 - _LEAST)[:, None]
    points = (1.0 - share) * mesh.points[ends[:, 0]] + share * mesh.points[ends[:, 1]]
    cells = _cells(mesh, inside, keys)
    points = np.concatenate([mesh.points, points])
    turned = signed_volumes(points, cells) < 0.0
    cells[turned] = cells[turned][:, [0, 2, 1, 3]]
    used, number = np.unique(cells, return_inverse=True)
    kept = TetMesh(points[used], number.reshape(-1, 4))
    ends_of_node = np.repeat(np.arange(n)[:, None], 2, axis=1)
    facet = _facets(mesh, np.concatenate([ends_of_node, ends])[used][kept.boundary])
    patches = {}
    for name, facets in mesh.patches.items():
        left = are_among(mesh.boundary, facets)[facet] & (facet >= 0)
        if left.any():
            patches[name] = kept.boundary[left]
    return CutMesh(kept.with_patches(patches), facet)


def _cells(mesh: TetMesh, inside: BoolArray, keys: IntArray) -> IntArray:
    """Cells (k, 4) of the part, the points of cut edges counted behind the nodes."""
    n = len(mesh.points)

    def cut(a: IntArray, b: IntArray) -> IntArray:
        return n + np.searchsorted(keys, np.minimum(a, b) * n + np.maximum(a, b))

    above = inside[mesh.cells]
    count = above.sum(axis=1)
    pieces = [mesh.cells[count == 4]]
    prisms = [np.zeros((0, 6), dtype=np.int64)]
    # One corner above leaves a tetrahedron, three leave a prism; so do two, below.
    for order in _LONE:
        first = above[:, order[0]]
        a, b, c, d = mesh.cells[(count == 1) & first][:, order].T
        pieces.append(np.stack([a, cut(a, b), cut(a, c), cut(a, d)], axis=1))
        a, b, c, d = mesh.cells[(count == 3) & ~first][:, order].T
        prisms.append(np.stack([b, c, d, cut(a, b), cut(a, c), cut(a, d)], axis=1))
    for order in _PAIRS:
        both = above[:, order[0]] & above[:, order[1]]
        p, q, r, s = mesh.cells[(count == 2) & both][:, order].T
        prisms.append(np.stack([p, cut(p, r), cut(p, s), q, cut(q, r), cut(q, s)], axis=1))
    prism = np.concatenate(prisms)
    # Diagonals of the quadrilateral sides start at their least node: neighbours agree.
    prism = np.take_along_axis(prism, _PRISMS[prism.argmin(axis=1)], axis=1)
    third = prism[:, [1, 5]].min(axis=1) > prism[:, [2, 4]].min(axis=1)
    rows = np.arange(len(prism))[:, None, None]
    pieces.append(prism[rows, _SPLITS[third.astype(np.int64)]].reshape(-1, 4))
    return np.concatenate(pieces)


def _facets(mesh: TetMesh, nodes: IntArray) -> IntArray:
    """Boundary facet of the mesh (b,), or -1, of facets (b, 3, 2) given by the nodes they cut."""
    nodes = np.sort(nodes.reshape(-1, 6), axis=1)
    fresh = np.concatenate([np.ones((len(nodes), 1), dtype=bool), np.diff(nodes) > 0], axis=1)
    flat = fresh.sum(axis=1) == 3
    result = np.full(len(nodes), -1)
    result[flat] = positions(nodes[flat][fresh[flat]].reshape(-1, 3), mesh.boundary)
    return result


_LEAST_VOID = 30.0
"""Enclosed voids below this many cells are filled."""


class _Field(NamedTuple):
    """Density at the nodes of a mesh, and what has to be joined.

    The share (n,) of a node is its part of the volume of the cells round it, in mean cells; pairs
    (e, 2) are joined by an edge; anchors are the nodes of every loaded and held patch, and of
    point forces.
    """

    mesh: TetMesh
    values: FloatArray
    share: FloatArray
    pairs: IntArray
    anchors: list[IntArray]


def part_mesh(
    design: Design, volume_fraction: float | None = None, threshold: float | None = None
) -> TetMesh:
    """Mesh of the part of a design of tetrahedra, with the patches of the whole.

    Parameters
    ----------
    design : Design
        Of tetrahedra.
    volume_fraction : float in (0, 1], optional
        Share of the volume that the part fills; default that of the design.
    threshold : float in (0, 1), optional
        Density at the surface, in place of the share.

    Returns
    -------
    TetMesh
        The piece that joins all loads and supports: cut where the density, averaged at the nodes,
        passes the threshold; small enclosed voids filled; smoothed.

    Raises
    ------
    InputError
        When no piece joins them.
    """
    problem = design.full
    assert isinstance(problem, Problem)
    field = _field(problem, design.density)
    if threshold is None:
        share = design.volume_fraction if volume_fraction is None else volume_fraction
        check_number("volume_fraction", share, above=0.0, at_most=1.0)
        threshold = _level(field, share * float(problem.mesh.volumes.sum()))
        if threshold is None:
            raise InputError(design.apart)
    else:
        check_number("threshold", threshold, above=0.0, below=1.0)
    cleaned = _cleaned(field, threshold)
    if cleaned is None:
        raise InputError(design.apart)
    return relaxed(cut_mesh(problem.mesh, cleaned, threshold))


def _field(problem: Problem, density: FloatArray) -> _Field:
    mesh = problem.mesh
    n, nodes = len(mesh.points), mesh.cells.reshape(-1)
    weight = np.bincount(nodes, np.repeat(mesh.volumes, 4), n)
    total = np.bincount(nodes, np.repeat(mesh.volumes * density, 4), n)
    return _Field(
        mesh=mesh,
        values=total / np.maximum(weight, 1e-300),
        share=0.25 * weight / mesh.volumes.mean(),
        pairs=unique_edges(mesh.cells[:, mesh.edges].reshape(-1, 2))[0],
        anchors=anchors(problem),
    )


def _connected_nodes(field: _Field, chosen: BoolArray) -> IntArray:
    """Piece (n,) of each chosen node, by edges between chosen nodes; others by themselves."""
    return connected(field.pairs[chosen[field.pairs].all(axis=1)], len(chosen))


def _cleaned(field: _Field, level: float) -> FloatArray | None:
    """Keep the piece above a level that joins all anchors, and fill small voids in it.

    None where no piece joins them.
    """
    values = field.values.copy()
    inside = values > level
    piece = _connected_nodes(field, inside)
    joining = None
    for nodes in field.anchors:
        here = np.unique(piece[nodes[inside[nodes]]])
        joining = here if joining is None else np.intersect1d(joining, here)
    if joining is None or not len(joining):
        return None
    inside &= piece == joining[np.bincount(piece)[joining].argmax()]
    piece = _connected_nodes(field, ~inside)
    enclosed = ~np.isin(piece, piece[np.unique(field.mesh.boundary)])
    small = np.bincount(piece, field.share)[piece] < _LEAST_VOID
    values[~inside] = np.minimum(values[~inside], level)
    values[~inside & enclosed & small] = 1.0
    return values


def _level(field: _Field, volume: float) -> float | None:
    """Level whose part has a wanted volume, by bisection; None where none has."""
    low, high, inside, middle = 0.0, 1.0, 0.0, 0.5
    for _ in range(20):
        middle = 0.5 * (low + high)
        cleaned = _cleaned(field, middle)
        inside = 0.0 if cleaned is None else volume_above(field.mesh, cleaned, middle)
        if abs(inside - volume) <= 1e-3 * volume:
            return middle
        low, high = (middle, high) if inside > volume else (low, middle)
    return middle if abs(inside - volume) <= 0.02 * volume else None


# Smoothing of a mesh that was cut out of another: its cut faces, and the cells behind them.


_FLAT = 1e-6
"""Share of the normals round a node in a direction, above which it must not move that way."""
_THIN = 0.02
"""Cells below this share of the mean volume must not shrink."""


def relaxed(cut: CutMesh, passes: int = 30) -> TetMesh:
    """Smooth a cut mesh; cells and patches stay.

    Its surface is smoothed by Taubin's passes 0.5 and -0.53 (Curve and surface smoothing without
    shrinkage, ICCV 1995), where nodes on the border of the whole mesh slide along it, and stay
    where a patch ends; inner nodes move to the mean of their neighbours. A step that would flatten
    a cell is not taken.
    """
    mesh = cut.mesh
    n, surface = len(mesh.points), np.unique(mesh.boundary)
    outer = _mean(_surface_pairs(cut), n)
    inner = _mean(_both_ways(mesh.cells[:, mesh.edges]), n)
    free = _free_directions(cut)
    inside = np.setdiff1d(np.arange(n), surface)
    points = np.array(mesh.points)
    for _ in range(passes):
        # Both steps before the check: one of them alone, taken again and again, would not end.
        wanted = points.copy()
        for factor in (0.5, -0.53):
            step = (outer @ wanted - wanted)[surface]
            wanted[surface] += factor * np.einsum("kij,kj->ki", free[surface], step)
        wanted[inside] = (inner @ wanted)[inside]
        points = _safely_moved(mesh.cells, points, wanted)
    return TetMesh(points, mesh.cells, mesh.patches, mesh.axes, mesh.walls)


def _both_ways(edges: IntArray) -> IntArray:
    """Pairs (k, 2) of each edge (..., 2) and of the same turned round."""
    edges = edges.reshape(-1, 2)
    return np.concatenate([edges, edges[:, ::-1]])


def _surface_pairs(cut: CutMesh) -> IntArray:
    """Nodes (k, 2) of the surface with the neighbours that they follow.

    Nodes of the cut follow neighbours on the cut only, so that its rim stays sharp.
    """
    sides = cut.mesh.boundary[:, [[0, 1], [1, 2], [2, 0]]]
    cut_sides, rest = _both_ways(sides[cut.facet < 0]), _both_ways(sides[cut.facet >= 0])
    return np.concatenate([cut_sides, rest[~np.isin(rest[:, 0], cut_sides[:, 0])]])


def _mean(pairs: IntArray, n: int) -> sp.csr_array:
    """Matrix (n, n) that averages over the second nodes of the pairs (k, 2) of each first one."""
    links = sp.csr_array((np.ones(len(pairs)), pairs.T), shape=(n, n))
    links.data[:] = 1.0
    count = np.maximum(np.diff(links.indptr), 1)
    return sp.csr_array(sp.diags_array(1.0 / count) @ links)


def _free_directions(cut: CutMesh) -> FloatArray:
    """Projections (n, 3, 3) onto the directions along the border of the whole mesh."""
    mesh = cut.mesh
    border = mesh.boundary[cut.facet >= 0]
    area, normal = mesh.facet_areas(border)
    products = area[:, None, None] * normal[:, :, None] * normal[:, None, :]
    sums = np.zeros((len(mesh.points), 3, 3))
    for corner in border.T:
        np.add.at(sums, corner, products)
    size = np.maximum(np.trace(sums, axis1=1, axis2=2), 1e-300)
    values, directions = np.linalg.eigh(sums / size[:, None, None])
    kept = directions * (values <= _FLAT)[:, None, :]
    kept[_patch_ends(mesh, border)] = 0.0
    return kept @ np.swapaxes(kept, 1, 2)


def _patch_ends(mesh: TetMesh, border: IntArray) -> BoolArray:
    """Nodes (n,) where facets (b, 3) inside and outside a patch meet."""
    ends = np.zeros(len(mesh.points), dtype=bool)
    for facets in mesh.patches.values():
        in_patch = are_among(border, facets)
        inside, outside = np.zeros((2, len(mesh.points)), dtype=bool)
        inside[border[in_patch]], outside[border[~in_patch]] = True, True
        ends |= inside & outside
    return ends


def _safely_moved(cells: IntArray, points: FloatArray, wanted: FloatArray) -> FloatArray:
    """Points moved to where they are wanted, except those whose cells would become flat."""
    before = signed_volumes(points, cells)
    least = _THIN * float(before.mean())
    moved = wanted.copy()
    while True:
        after = signed_volumes(moved, cells)
        flat = (after < least) & (after < before * (1.0 - 1e-12))
        stuck = np.unique(cells[flat])
        stuck = stuck[(moved[stuck] != points[stuck]).any(axis=1)]
        if not len(stuck):
            return moved
        moved[stuck] = points[stuck]


def part_shape(
    design: Design,
    volume_fraction: float | None = None,
    threshold: float | None = None,
    domain: Any = None,
) -> Any:
    """Shape of the part that a design stands for.

    Parameters
    ----------
    volume_fraction : float in (0, 1], optional
        Share of the domain that the part fills; default that of the design.
    threshold : float in (0, 1), optional
        Density at the border of the part, in place of the share.
    domain : shapely Polygon, mm, optional
        Exact design domain of a plate; default the pixels.

    Returns
    -------
    shapely Polygon or Surface, mm
        Of a plate on a raster its outline, of tetrahedra a closed surface: of the piece that joins
        all loads and supports, smoothed, within the domain.

    Raises
    ------
    InputError
        When no piece joins them, or a domain is given for tetrahedra.
    """
    if isinstance(design.full, PlaneProblem):
        return plate_outline(design, volume_fraction, threshold, domain)
    _no_plate(domain=domain)
    mesh = part_mesh(design, volume_fraction, threshold)
    used, number = np.unique(mesh.boundary, return_inverse=True)
    return Surface(mesh.points[used], number.reshape(-1, 3))


def _no_plate(**options: Any) -> None:
    """Raise on options that only the part of a plate has."""
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise InputError(
            f"{', '.join(given)}: for plates only; this design is of tetrahedra, whose part is cut "
            "out of its mesh: leave it out"
        )


def as_problem(
    design: Design,
    material: Material,
    thickness: float | None = None,
    edge_length: float | None = None,
    domain: Any = None,
    volume_fraction: float | None = None,
) -> Problem:
    """Make the part of a design a problem of its own: cleaned, meshed, held and loaded.

    The outline of a plate is extruded along z. Its patches of edges become patches of the walls
    nearest to them, with their ends where they were; point forces, and patches of single nodes,
    become small patches about their points. Forces keep their total, tractions and pressures
    their size. The part is held along z on its bottom (patch ``bottom``), where alone nothing
    else holds it: plane stress, as in the design.

    The part of tetrahedra is cut out of their mesh, so that its patches are what is left of those
    of the design; supports and loads stay. ``tetrahedralise(part_shape(design), edge_length)`` is
    another mesh of the same shape.

    Parameters
    ----------
    design : Design
        Of a plate on a raster, or of tetrahedra.
    material : Material
        Its axes turn with the design's angles, where it has angles.
    thickness : float, mm, optional
        Height of the part of a plate; default the thickness of the plate.
    edge_length : float, mm, optional
        Of the tetrahedra aimed at in the part of a plate; default two pixels.
    domain : shapely Polygon, mm, optional
        Exact design domain of a plate; default the pixels.
    volume_fraction : float in (0, 1], optional
        Share of the domain that the part fills; default that of the design.

    Raises
    ------
    InputError
        When no piece joins all loads and supports, or a patch is not reached.
    """
    full = design.full
    if isinstance(full, PlaneProblem):
        return plate_part(design, material, thickness, edge_length, domain, volume_fraction)
    _no_plate(thickness=thickness, edge_length=edge_length, domain=domain)
    mesh = part_mesh(design, volume_fraction)
    axes = design.axes_at(mesh.centres)
    return Problem(mesh, material, full.supports, full.loads, axes, order=full.order)


# The part that a design of a plate stands for: its outline, extruded, with supports and loads.


_BOTTOM = "bottom"


def plate_outline(
    design: Design,
    volume_fraction: float | None = None,
    threshold: float | None = None,
    domain: Any = None,
) -> Any:
    """Outline of a design of squares: see `part_shape`."""
    plate = design.full
    assert isinstance(plate, PlaneProblem)
    raster = raster_image(plate.mesh, design.density)
    if domain is not None:
        domain = shapely.transform(domain, lambda points: points - raster.origin)
    shape = outline(
        raster.image,
        raster.size,
        volume_fraction,
        threshold,
        domain,
        raster.inside,
        _densest(plate, design.density) - raster.origin,
        apart=design.apart,
    )
    return shapely.transform(shape, lambda points: points + raster.origin)


def _densest(plate: PlaneProblem, density: FloatArray) -> FloatArray:
    """Densest node of every loaded and held patch, and those of point forces: (k, 2), mm."""
    dense = np.zeros(len(plate.mesh.points))
    np.maximum.at(dense, plate.mesh.cells, density[:, None])
    return plate.mesh.points[[nodes[dense[nodes].argmax()] for nodes in anchors(plate)]]


def plate_part(
    design: Design,
    material: Material,
    thickness: float | None,
    edge_length: float | None,
    domain: Any,
    volume_fraction: float | None,
) -> Problem:
    """Extrude the outline of a design of squares: see `as_problem`."""
    plate = design.full
    assert isinstance(plate, PlaneProblem)
    if _BOTTOM in plate.mesh.patches:
        raise InputError(
            f"'{_BOTTOM}' names the face at z = 0 of the part: give the plate's patch another name"
        )
    polygon = plate_outline(design, volume_fraction, domain=domain)
    pixel = float(np.sqrt(plate.mesh.areas.mean()))
    edge_length = 2.0 * pixel if edge_length is None else edge_length
    height = _height(plate) if thickness is None else thickness
    mesh = extrude(polygon, height, edge_length, keep=patch_ends(plate.mesh, polygon, pixel))
    walls = Walls.of_mesh(mesh, pixel, edge_length)
    patches = walls.patches(plate.mesh, plate.held_or_loaded)
    patches[_BOTTOM] = Plane("z", "min", 1e-9)(mesh)
    loads: dict[str, tuple[Load, ...]] = {}
    for case, given in plate.loads.items():
        loads[case] = ()
        for load in given:
            if isinstance(load, PointForce):
                name = f"{case}_point_{len(loads[case])}"
                patches[name] = walls.at_point(load)
                load = Force(name, load.vector)
            loads[case] += (load,)
    supports = [
        replace(support, components=support.components.replace("z", ""))
        for support in plate.supports
    ]
    return Problem(
        mesh.with_patches(patches),
        material,
        (*supports, Support(_BOTTOM, "z")),
        loads,
        design.axes_at(mesh.centres),
        order=1,
    )


def _height(plate: PlaneProblem) -> float:
    """Thickness of the plate, mm, where it is the same everywhere."""
    thickness = np.asarray(plate.thickness)
    if np.ptp(thickness) > 1e-9 * thickness.max():
        raise InputError(
            f"the plate is {thickness.min():g} to {thickness.max():g} mm thick: name the "
            "thickness of the part"
        )
    return float(thickness[0])


# Walls of a part extruded from the outline of a plate, and the plate's patches that they take.


_REACH = 1.5
"""How far a wall may lie from the patch that it takes over, in pixels."""
_FACING = 0.5
"""Cosine between the normals of a wall and of the patch that it takes over."""


@dataclass(frozen=True)
class Walls:
    """Boundary facets of an extruded part along its outline.

    Attributes
    ----------
    facets : (w, 3) int array
    middle, normal : (w, 2) arrays
    pixel : float, mm
        Side of a cell of the plate.
    edge_length : float, mm
        Of the part's mesh.
    """

    facets: IntArray
    middle: FloatArray
    normal: FloatArray
    pixel: float
    edge_length: float

    @classmethod
    def of_mesh(cls, mesh: TetMesh, pixel: float, edge_length: float) -> "Walls":
        """Collect the upright boundary facets of a mesh."""
        _, normal = mesh.facet_areas(mesh.boundary)
        upright = np.abs(normal[:, 2]) < 0.5
        facets = mesh.boundary[upright]
        corners = mesh.points[facets, :2]
        # Of a triangle on an upright wall: the middle of its extent along the outline.
        middle = 0.5 * (corners.min(axis=1) + corners.max(axis=1))
        return cls(facets, middle, normal[upright, :2], pixel, edge_length)

    def patches(self, plate: PlaneMesh, needed: tuple[str, ...]) -> dict[str, IntArray]:
        """Patches of the walls by those of the plate; those without a wall are dropped."""
        patches = {}
        for name, edges in plate.patches.items():
            if edges.shape[1] == 1:
                chosen = self._round(plate.points[edges[:, 0]])
            else:
                chosen = self._walls_along(plate, edges)
            if chosen.any():
                patches[name] = self.facets[chosen]
            elif name in needed:
                raise InputError(
                    f"the outline of the design does not reach patch '{name}': mark the cells "
                    "there as solid, or raise the volume fraction"
                )
        return patches

    def at_point(self, load: PointForce) -> IntArray:
        """Facets (k, 3) that carry a point force."""
        near = self._round(np.array([load.point[:2]]))
        if not near.any():
            raise InputError(
                f"the point force at {load.point} is not on the outline of the design: move it to "
                "the border of the plate, or mark the cells there as solid"
            )
        return self.facets[near]

    def _walls_along(self, plate: PlaneMesh, edges: IntArray) -> BoolArray:
        """Walls (w,) that are nearest to edges (k, 2) of all edges of the plate, and face them."""
        boundary, reach = plate.boundary, _REACH * self.pixel
        held = are_among(boundary, edges)
        tree = shapely.STRtree(shapely.linestrings(plate.points[boundary]))
        middles = shapely.points(self.middle)
        (wall, edge), distance = tree.query_nearest(middles, return_distance=True)
        nearest = np.zeros(len(middles), dtype=bool)
        nearest[wall[held[edge] & (distance <= reach)]] = True
        wall, edge = tree.query(middles, predicate="dwithin", distance=reach)
        wall, edge = wall[held[edge]], edge[held[edge]]
        along = plate.points[boundary[edge, 1]] - plate.points[boundary[edge, 0]]
        outward = np.zeros((len(middles), 2))
        np.add.at(outward, wall, along @ np.array([[0.0, -1.0], [1.0, 0.0]]))
        length = np.linalg.norm(outward, axis=1)
        facing = (outward * self.normal).sum(axis=1) > _FACING * np.maximum(length, 1e-300)
        return nearest & facing

    def _round(self, points: FloatArray) -> BoolArray:
        """Walls (w,) round points (k, 2): within half an edge length, or the nearest ones."""
        chosen = np.zeros(len(self.middle), dtype=bool)
        for point in points:
            distance = np.linalg.norm(self.middle - point, axis=1)
            least = float(distance.min())
            if least <= max(_REACH * self.pixel, self.edge_length):
                chosen |= distance <= max(0.5 * self.edge_length, least) + 1e-9
        return chosen


def patch_ends(plate: PlaneMesh, polygon: Any, pixel: float) -> FloatArray:
    """Find the ends (k, 2) of the patches of edges, moved onto the outline within a pixel, mm."""
    ends = [np.zeros((0, 2))]
    for edges in plate.patches.values():
        if edges.shape[1] == 2:
            nodes, count = np.unique(edges, return_counts=True)
            ends.append(plate.points[nodes[count == 1]])
    points = shapely.points(np.concatenate(ends))
    onto = shapely.shortest_line(points, polygon.boundary)
    near = shapely.length(onto) <= pixel
    return shapely.get_coordinates(shapely.get_point(onto[near], -1))
