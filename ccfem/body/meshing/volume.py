"""Closed surface to tetrahedra, with Gmsh or fTetWild, each in a process of its own."""

from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Literal, get_args

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.checks import check_known, check_number
from ccfem.base.errors import InputError
from ccfem.body.files.surface import Surface
from ccfem.body.isolated.process import ChildError, in_own_process
from ccfem.body.mesh import TetMesh, check_mesh
from ccfem.body.mesh.check import in_metres
from ccfem.body.mesh.curved_cells import nodes_on_walls
from ccfem.body.mesh.smooth_faces import FEATURE_ANGLE, round_walls, smooth_faces
from ccfem.geometry.facets import connected, signed_volumes
from ccfem.geometry.locate import nearest_on_triangles

# How well a mesh fills the surface that it was made from.


_VOLUME = 0.02
"""Share of the volume that may be lost or gained."""
_FAR = 4.0
"""Deviation over the mesher's envelope from which a shape may be lost."""
_FINEST = 0.001
"""Distance, mm, below which none is told from zero."""


@dataclass(frozen=True)
class Fidelity:
    """How a mesh differs from its surface.

    Attributes
    ----------
    volume : float
        Volume of the mesh less that of the surface, over the latter.
    deviation : float, mm
        Farthest that a node of the mesh lies from the surface, or a corner or the middle of a
        triangle of the surface from the boundary of the mesh.
    overlap : float
        Share of the surface's volume that its shells hold twice: the mesh has it once.
    envelope : float, mm
        Distance from the surface that the mesher takes for none; 0 for one that takes none.
    """

    volume: float
    deviation: float
    overlap: float = 0.0
    envelope: float = 0.0

    @property
    def good(self) -> bool:
        """Whether the volume is kept to 2 %."""
        return abs(self.volume) <= _VOLUME

    def about(self, mesher: str) -> str:
        """One line: who made the mesh, and how well it fits; with a cure where it does not."""
        word = "more" if self.volume > 0.0 else "less"
        text = (
            f"meshed by {mesher}: volume {abs(self.volume):.2%} {word} than the surface's, "
            f"boundaries within {max(self.deviation, _FINEST):.3g} mm"
        )
        return text if self.good else f"{text}: shorten edge_length to keep the shape"

    @property
    def doubts(self) -> tuple[str, ...]:
        """One line for each shape of the surface that the mesh may not have."""
        overlap = (
            f"shells of the surface overlap in {self.overlap:.1%} of their volume and are united: "
            "where one within another is a cavity, turn its triangles round"
        )
        lost = (
            f"parts of the surface lie up to {self.deviation:.3g} mm from the mesh: gaps and walls "
            f"thinner than {2.0 * self.envelope:.2g} mm may be lost: widen them, or take mesher = "
            "'gmsh'"
        )
        far = 0.0 < _FAR * self.envelope < self.deviation
        return (*([overlap] if self.overlap else []), *([lost] if far else []))


def fidelity(
    surface: Surface, mesh: TetMesh, overlap: float = 0.0, envelope: float = 0.0
) -> Fidelity:
    """Compare a mesh with the surface that it was made from, some of it inside its other shells."""
    shell = np.unique(mesh.boundary)
    deviation = _distance(surface.points, surface.triangles, mesh.points[shell])
    if not overlap:
        nodes = surface.points[np.unique(surface.triangles)]
        middles = surface.points[surface.triangles].mean(axis=1)
        places = np.concatenate([nodes, middles])
        deviation = max(deviation, _distance(mesh.points, mesh.boundary, places))
    change = float(mesh.volumes.sum()) / (surface.volume * (1.0 - overlap)) - 1.0
    return Fidelity(change, deviation, overlap, envelope)


_RAYS = 128
"""Rays along each side of the bounding box, by which overlapping shells are looked for."""
_SHIFT = np.array([0.4142, 0.2679])
"""Place of a ray between the lines of their grid: not where edges and diagonals are likely."""
_AT_ONCE = 2_000_000
"""Rays and triangles that are looked at together."""
_NO_OVERLAP = 1e-3
"""Share of the volume below which rays that hit an edge twice may have made it up."""


def overlap_of(surface: Surface) -> float:
    """Share of the volume of a surface that its shells hold twice, from rays along z.

    Along a ray the winding number rises by one where it enters a shell and falls where it leaves.
    """
    low, high = surface.points.min(axis=0)[:2], surface.points.max(axis=0)[:2]
    corners = surface.points[surface.triangles]
    grid = (corners[..., :2] - low) / (high - low) * _RAYS - _SHIFT  # rays at whole numbers
    first = np.ceil(grid.min(axis=1)).astype(np.int64)
    count = np.maximum(np.floor(grid.max(axis=1)).astype(np.int64) - first + 1, 0)
    pairs = count.prod(axis=1)
    rays, heights, steps = [], [], []
    for chunk in np.split(
        np.arange(len(pairs)), np.flatnonzero(np.diff(np.cumsum(pairs) // _AT_ONCE)) + 1
    ):
        triangle = np.repeat(chunk, pairs[chunk])
        k = np.arange(len(triangle)) - np.repeat(
            np.cumsum(pairs[chunk]) - pairs[chunk], pairs[chunk]
        )
        ray = first[triangle] + np.stack([k // count[triangle, 1], k % count[triangle, 1]], axis=1)
        a, b, c = np.moveaxis(grid[triangle], 1, 0)
        weights = np.stack(
            [_cross(b - ray, c - ray), _cross(c - ray, a - ray), _cross(a - ray, b - ray)], axis=1
        )
        size = weights.sum(axis=1)
        hit = (size != 0.0) & (weights * np.sign(size)[:, None] >= 0.0).all(axis=1)
        rays.append(ray[hit] @ [_RAYS, 1])
        heights.append(
            np.einsum("ij,ij->i", weights[hit], corners[triangle[hit], :, 2]) / size[hit]
        )
        steps.append(-np.sign(size[hit]))  # a facet that looks down is where a ray upward enters
    ray, height, step = map(np.concatenate, (rays, heights, steps))
    through = np.bincount(ray, weights=step)[ray] == 0.0  # others hit an edge once or three times
    ray, height, step = ray[through], height[through], step[through]
    order = np.lexsort([height, ray])
    winding = np.cumsum(step[order])[:-1]
    length = np.where(np.diff(ray[order]) == 0, np.diff(height[order]), 0.0)
    whole = float(winding @ length)
    share = 1.0 - float(length[winding > 0.5].sum()) / whole if whole > 0.0 else 0.0
    return share if share > _NO_OVERLAP else 0.0


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _distance(points: FloatArray, triangles: IntArray, queries: FloatArray) -> float:
    """Farthest that queries (q, 3) lie from a surface, mm."""
    return float(nearest_on_triangles(points, triangles, queries).distance.max())


Mesher = Literal["auto", "gmsh", "ftetwild"]

_MOST = 2e7
"""Number of cells above which an edge length is taken for a mistake of units."""
_ENVELOPE = 1e-3
"""Distance of fTetWild's meshes from the surface, over the diagonal."""
_FLAT = 0.3
"""Least volume of a cell whose nodes move onto a round wall, over what it was."""
_LOST = 0.2
"""Share of the volume that no mesh may lose or gain."""
_PATIENCE = {"gmsh": 30.0, "ftetwild": 300.0}
"""Seconds after which a mesher has lost its way, as on a surface that cuts itself."""
_PER_SECOND = 500.0
"""Cells to be expected, and triangles given, for which it gets a second more."""


def tetrahedralise(surface: Surface, edge_length: float, mesher: Mesher = "auto") -> TetMesh:
    """Fill a closed surface with tetrahedra.

    Parameters
    ----------
    edge_length : float, mm
        Target edge length.
    mesher : {"auto", "gmsh", "ftetwild"}, default "auto"
        Gmsh meshes the smooth faces of the surface anew, which takes a clean surface in one piece;
        equal input gives equal meshes. fTetWild (Hu et al., Fast Tetrahedral Meshing in the Wild)
        takes any closed surface and stays within 1e-3 of the part's diagonal of it; it is slower,
        and makes another mesh each time. "auto" takes Gmsh where it is installed, and fTetWild
        where that fails or loses 2 % of the volume.

    Returns
    -------
    TetMesh
        Linear, checked, without patches.

    Raises
    ------
    InputError
        When the edge length is too long or too short for the part, no cells are left or a fifth of
        the volume is lost, the mesher is not installed, or it fails.
    """
    return fill(surface, edge_length, mesher)[0]


def fill(
    surface: Surface, edge_length: float, mesher: Mesher = "auto"
) -> tuple[TetMesh, Fidelity, str]:
    """Mesh of a surface, how well it fits, and who made it: see `tetrahedralise`."""
    more = check_edge_length(surface, edge_length) + len(surface.triangles)
    patience = {name: least + more / _PER_SECOND for name, least in _PATIENCE.items()}
    check_known("mesher", mesher, get_args(Mesher))
    why = "it is not installed (pip install 'ccfem[cad]')"
    if mesher != "ftetwild" and find_spec("gmsh") is not None:
        try:
            mesh = _by_gmsh(surface, edge_length, None if mesher == "gmsh" else patience["gmsh"])
            fit = fidelity(surface, mesh)
            if mesher == "gmsh" or fit.good:
                return mesh, fit, "Gmsh"
        except (ChildError, InputError) as error:
            why = str(error)
    if mesher == "gmsh":
        raise InputError(f"Gmsh cannot mesh the surface: {why}: take mesher = 'ftetwild'")
    try:
        made = in_own_process(
            "ftetwild:fill",
            patience["ftetwild"],
            points=surface.points,
            triangles=surface.triangles,
            size=edge_length,
        )
    except ChildError as error:
        raise InputError(
            f"meshing failed: {error}: check that the surface is closed and does not cut itself, "
            "or take another edge_length"
        ) from None
    if not len(made["cells"]):
        raise InputError(
            "meshing left no cells inside the surface: check that it is closed, does not cut "
            "itself, and that the edge length suits its thickness"
        )
    mesh = on_round_walls(TetMesh(made["points"], made["cells"]), surface, _ENVELOPE)
    envelope = _ENVELOPE * float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    fit = fidelity(surface, mesh, overlap_of(surface), envelope)
    if abs(fit.volume) > _LOST:
        raise InputError(
            f"the mesh of the surface has {1.0 + fit.volume:.1%} of its volume: shorten "
            "edge_length, or mesh the part in another program"
        )
    return mesh, fit, "fTetWild"


def check_edge_length(surface: Surface, edge_length: float) -> float:
    """Cells to expect; raise on an edge length that is too long or too short for a part."""
    size = float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    doubt = in_metres(surface.points)
    if doubt and edge_length >= size:
        raise InputError(f"an edge length of {edge_length:g} mm is longer than the part: {doubt}")
    check_number("edge length", edge_length, above=0.0, below=size, unit="mm (the part's diagonal)")
    expected = surface.volume / (edge_length**3 / (6.0 * np.sqrt(2.0)))
    if expected > _MOST:
        raise InputError(
            f"an edge length of {edge_length:g} mm would make about {expected:.1g} cells of a "
            f"part {size:.3g} mm across: choose a longer one"
        )
    return float(expected)


def _walls(surface: Surface) -> FloatArray:
    """Round walls of a surface, (k, 8): middle of the axis, direction, radius, half the length."""
    rows: list[FloatArray] = []
    for face in smooth_faces(surface.points, surface.triangles):
        if face.kind == "cylinder":
            nodes = surface.points[np.unique(surface.triangles[face.facets])]
            half = 0.5 * float(np.ptp(nodes @ face.direction))
            rows.append(np.array([*face.centre, *face.direction, face.radius, half]))
    return np.array(rows).reshape(-1, 8)


def _by_gmsh(surface: Surface, edge_length: float, seconds: float | None) -> TetMesh:
    """Mesh by Gmsh of a surface in one piece."""
    edges = surface.triangles[:, [[0, 1], [1, 2]]].reshape(-1, 2)
    piece = connected(edges, len(surface.points))
    if len(np.unique(piece[surface.triangles[:, 0]])) > 1:
        raise InputError("it has several pieces or a cavity")
    sides = np.sort(surface.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    if np.unique(sides, axis=0, return_counts=True)[1].max() > 2:
        raise InputError("it touches itself along an edge")
    made = in_own_process(
        "gmsh_meshing:fill",
        seconds,
        points=surface.points,
        triangles=surface.triangles,
        size=edge_length,
        angle=FEATURE_ANGLE,
        walls=_walls(surface),
    )
    if not len(made["cells"]):
        raise InputError("it left no cells")
    return on_round_walls(TetMesh(made["points"], made["cells"]), surface)


def on_round_walls(mesh: TetMesh, surface: Surface, envelope: float = 0.0) -> TetMesh:
    """Check a mesh of a surface, and move its nodes from chords of round walls onto these walls.

    Parameters
    ----------
    mesh : TetMesh
        Linear.
    surface : Surface
        Whose round walls are those of the part.
    envelope : float, default 0
        Distance of the mesh from it, over the diagonal.

    Returns
    -------
    TetMesh
        It knows these walls. Nodes that would flatten a cell stay.
    """
    slack = envelope * float(np.linalg.norm(np.ptp(surface.points, axis=0)))
    faces = smooth_faces(surface.points, surface.triangles)
    walls = tuple(
        replace(wall, tolerance=wall.tolerance + slack)
        for wall in round_walls(surface.points, surface.triangles, faces)
    )
    mesh = check_mesh(replace(mesh, walls=walls))[0]
    _, normals = mesh.facet_areas(mesh.boundary)
    nodes, places = nodes_on_walls(mesh.points, mesh.boundary, normals, walls, mesh.wall_of)
    moved = np.zeros(len(mesh.points), dtype=bool)
    moved[nodes] = True
    points = mesh.points.copy()
    points[nodes] = places
    while True:
        flat = signed_volumes(points, mesh.cells) < _FLAT * mesh.volumes
        stays = np.unique(mesh.cells[flat])
        stays = stays[moved[stays]]
        if not len(stays):
            return replace(mesh, points=points)
        points[stays] = mesh.points[stays]
        moved[stays] = False
