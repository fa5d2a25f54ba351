"""The keys at the top of a part file."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import shapely

from ccfem.base.checks import check_number
from ccfem.base.errors import InputError, Mistakes, shown
from ccfem.base.toml import from_table
from ccfem.base.whole import existing_file
from ccfem.body.files import Surface, read_mesh
from ccfem.body.mesh.check import check_mesh
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.face_rules import numbered_faces
from ccfem.body.mesh.patches import Vector
from ccfem.body.mesh.smooth_faces import FEATURE_ANGLE
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude, faces_of_body, mesh_body
from ccfem.body.meshing.cad import Joined, is_cad
from ccfem.body.meshing.volume import Mesher
from ccfem.fem.elasticity.problem import Order

# The body of a part file: a mesh, a surface to be filled, or a planform to be extruded.


_SMALLEST, _LARGEST = 0.1, 1e5
"""Diagonals, mm, beyond which a unit is wrong."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """The keys of a part file that say what its body is (see `ccfem.cases.part_file`).

    Exactly one of `mesh`, `surface` and `planform` is given.

    Attributes
    ----------
    mesh : str
        File of tetrahedra: .tet .msh .vtu .vtk .xdmf .inp .unv .med .bdf .nas .mesh .npz.
    surface : str
        Closed surface (.stl .obj .ply .3mf) or CAD file (.step .iges .brep), to be filled with
        tetrahedra.
    planform : table
        A flat part that stands on z = 0: its outline, holes, height and edge length.
    edge_length : float, mm
        Edge length of the tetrahedra that fill a surface.
    scale : float
        Factor on the coordinates of a file; 1000 for metres.
    merge_nodes : bool
        Whether to join pieces of a mesh where their nodes coincide.
    order : int or str
        Linear (1) or quadratic cells (2), or what the estimated error of linear ones calls for.
    mesher : str
        What fills a surface; "auto" is Gmsh where it is installed and works.
    joined : str
        What becomes of solids of a CAD file that touch: "glued" to one part, or "separate" pieces
        that pass no force there.
    """

    mesh: str | None = None
    surface: str | None = None
    planform: dict[str, Any] | None = None
    edge_length: float | None = None
    scale: float = 1.0
    merge_nodes: bool = False
    order: Order = "auto"
    mesher: Mesher = "auto"
    joined: Joined = "glued"

    def check(self, folder: Path) -> None:
        """Raise on keys that do not go together, and on files that do not exist."""
        mistakes = Mistakes()
        given = [key for key in ("mesh", "surface", "planform") if getattr(self, key) is not None]
        if len(given) != 1:
            mistakes.lines.append(
                "a part needs one of mesh, surface and planform; got "
                f"{' and '.join(given) or 'none'}: name one"
            )
        elif (self.edge_length is not None) != (self.surface is not None):
            mistakes.lines.append(
                "edge_length goes with surface, and surface with edge_length: add the one that is "
                "missing (a planform has its own edge_length)"
            )
        if self.planform is not None and self.scale != 1.0:
            mistakes.lines.append("scale goes with mesh or surface: leave it out of a planform")
        if self.joined != "glued" and not (self.surface is not None and is_cad(self.surface)):
            mistakes.lines.append(
                "joined goes with a CAD file of several solids as surface: leave it out (pieces of "
                "a mesh are joined by merge_nodes)"
            )
        if self.planform is not None:
            with mistakes.noted():
                from_table(_Planform, self.planform, "planform")
        with mistakes.noted():
            check_number("scale", self.scale, above=0.0)
        for key in ("mesh", "surface"):
            if getattr(self, key) is not None:
                with mistakes.noted():
                    existing_file(folder / getattr(self, key), f"{key} file")
        mistakes.complain()

    def faces(self, folder: Path, angle: float = FEATURE_ANGLE) -> BodyFaces:
        """Faces of the part, numbered on its body: of a surface before any meshing.

        The feature angle is in degrees.
        """
        self.check(folder)
        if self.surface is None:
            return numbered_faces(self.read(folder)[0], angle)
        return faces_of_body(folder / self.surface, self.scale, angle, self.joined)

    def read(
        self,
        folder: Path,
        before: Callable[[Surface], None] | None = None,
        angle: float = FEATURE_ANGLE,
        known: TetMesh | None = None,
    ) -> tuple[TetMesh, tuple[str, ...]]:
        """Mesh of the part, checked, and what was found in it; files are relative to a folder.

        `before` is called with a surface that has to be meshed; the feature angle between its
        faces is in degrees. A mesh that is known, in mm, takes the place of that of the file.
        """
        self.check(folder)
        made: tuple[str, ...] = ()
        if self.mesh is not None:
            mesh = known or read_mesh(folder / self.mesh, self.scale, check=False)
            if self.order == 1 and mesh.order == 2:
                mesh = mesh.linear()
            mesh, report = check_mesh(mesh, merge=self.merge_nodes)
        elif self.surface is not None and self.edge_length is not None:
            file = folder / self.surface
            how = (self.edge_length, self.scale, self.mesher, before, angle, self.joined)
            mesh, made = mesh_body(file, *how)
            mesh, report = check_mesh(mesh)
        else:
            mesh, report = check_mesh(_extruded(self))
        size = report.diagonal
        if not _SMALLEST <= size <= _LARGEST:
            raise InputError(
                f"the part measures {size:.3g} mm across; expected {_SMALLEST:g} to {_LARGEST:g} "
                "mm: correct scale, which makes the coordinates mm"
            )
        findings = (*made, *report.findings)
        return mesh.quadratic() if self.order == 2 else mesh, findings


@dataclass(frozen=True)
class _Hole:
    """A hole of a planform: a circle or a polygon."""

    centre: tuple[float, float] | None = None
    radius: float | None = None
    outline: tuple[tuple[float, float], ...] | None = None

    def __post_init__(self) -> None:
        circle = self.centre is not None and self.radius is not None
        if circle == (self.outline is not None):
            raise InputError("a hole needs centre and radius, or outline: give one of them")


@dataclass(frozen=True)
class _Planform:
    """The table [planform]."""

    outline: tuple[tuple[float, float], ...]
    height: float
    edge_length: float
    holes: tuple[dict[str, Any], ...] = ()


def _extruded(body: Body) -> TetMesh:
    """Mesh of a planform."""
    plan = from_table(_Planform, body.planform, "planform")
    rings = []
    for k, table in enumerate(plan.holes):
        hole = from_table(_Hole, table, f"planform.holes[{k}]")
        if hole.outline is not None:
            rings.append(_polygon(hole.outline, f"planform.holes[{k}]"))
        else:
            rings.append(shapely.Point(hole.centre).buffer(hole.radius, quad_segs=32))
    outline = _polygon(plan.outline, "planform")
    for k, ring in enumerate(rings):
        if not outline.contains_properly(ring):
            raise InputError(f"planform.holes[{k}] must lie inside the outline: move or shrink it")
    holes = shapely.union_all(rings)
    return extrude(outline.difference(holes), plan.height, plan.edge_length)


def _polygon(outline: tuple[tuple[float, float], ...], where: str) -> shapely.Polygon:
    """Make a polygon of an outline that does not cross itself."""
    if len(outline) < 3:
        raise InputError(f"{where}.outline needs at least 3 points; got {len(outline)}: add some")
    polygon = shapely.Polygon(outline)
    if not polygon.is_valid or not polygon.area > 0.0:
        raise InputError(
            f"{where}.outline is not a valid polygon: {shapely.is_valid_reason(polygon)}: go round "
            "it without crossing"
        )
    return polygon


@dataclass(frozen=True, kw_only=True)
class Part(Body):
    """The keys of a part file.

    Attributes
    ----------
    material : str or table
        A name of the table of materials, or moduli.
    analysis : "deck", optional
        Take supports, loads, materials and regions over from the deck that is the mesh.
    step : str, optional
        The static step of the deck that is taken; by default all, a load case each.
    supports : tuple of tables
        What holds the part; at least one. With ``case`` one holds in these load cases alone.
    loads : dict
        The load cases by name, each a list of loads; at least one.
    alternative_supports : tuple of tables
        Another model of how the part is held. Strategies are tested under both, and no ranking is
        stated on which the two disagree.
    combinations : dict
        Load cases that are sums of others times factors.
    weights : dict
        Weight of each load case when all are planned for together (``--load-case all``). Cases
        that are not named do not count. Without weights all cases but combinations count equally.
    regions : dict
        Cells of another material.
    name : str
        Name of the part; by default that of the file.
    title : str
        One line for tables and reports; by default the name.
    source : str
        Where the part comes from.
    build : str or tuple of 3 floats
        Build direction.
    bed : table
        Turn, place and copies on the bed.
    layers : int
        Number of flat layers of fibre, spread evenly over the height.
    heights : tuple of floats, mm
        Heights of flat layers along the build direction, in place of their number.
    slicing : table
        A slicer with its parameters, in place of layers and heights; without any of the three,
        12 flat layers.
    fibre : table
        Which of the layers, and which regions of them, get fibre; by default all.
    plastic : table
        Walls, skins, infill and seam of the plastic; by default it is solid.
    scatter : table
        How far prints differ in their moduli and in the places of strands.
    patches : dict
        Patches of the boundary, each by a rule. Groups of a mesh file are patches already.
    machine : table
        Values that differ from the default printer.
    strategies : dict
        Parameters of strategies on this part.
    """

    material: str | dict[str, Any] | None = None
    analysis: Literal["deck"] | None = None
    step: str | None = None
    supports: tuple[dict[str, Any], ...] = ()
    loads: dict[str, Any] = field(default_factory=dict)
    alternative_supports: tuple[dict[str, Any], ...] = ()
    combinations: dict[str, Any] = field(default_factory=dict)
    weights: dict[str, Any] = field(default_factory=dict)
    regions: dict[str, Any] = field(default_factory=dict)
    name: str = ""
    title: str = ""
    source: str = ""
    build: str | Vector = "z"
    bed: dict[str, Any] = field(default_factory=dict)
    layers: int | None = None
    heights: tuple[float, ...] | None = None
    slicing: dict[str, Any] | None = None
    fibre: dict[str, Any] | None = None
    plastic: dict[str, Any] = field(default_factory=dict)
    scatter: dict[str, Any] = field(default_factory=dict)
    patches: dict[str, Any] = field(default_factory=dict)
    machine: dict[str, Any] = field(default_factory=dict)
    strategies: dict[str, Any] = field(default_factory=dict)

    def check(self, folder: Path) -> None:
        """Raise as `Body.check`, and on keys that a deck brings with its analysis."""
        mistakes = Mistakes()
        with mistakes.noted():
            super().check(folder)
        if self.analysis is None and self.step is not None:
            mistakes.lines.append('step goes with analysis = "deck": add it, or leave step out')
        if self.analysis == "deck":
            if self.mesh is None or Path(self.mesh).suffix.lower() != ".inp":
                mistakes.lines.append(
                    'analysis = "deck" goes with mesh, a deck of Abaqus or CalculiX (.inp); got '
                    f"{shown(self.mesh)}: name one"
                )
            given = [key for key in _IN_DECK if getattr(self, key)]
            if given:
                mistakes.lines.append(
                    f'with analysis = "deck" the deck gives {", ".join(_IN_DECK)}; got '
                    f"{' and '.join(given)} in the part file: leave out one or the other"
                )
        mistakes.complain()


_IN_DECK = ("material", "regions", "supports", "loads")
"""Keys that a deck brings."""
