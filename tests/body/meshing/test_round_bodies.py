"""A hole of 12 mm is one of 12 mm, and nothing holds a part against turning on it."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

import ccfem
from ccfem.base.errors import InputError
from ccfem.body.files.surface import Surface
from ccfem.body.mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.body.meshing.cad import mesh_cad
from ccfem.body.meshing.volume import fill
from ccfem.fem.elasticity import Problem
from ccfem.fem.elasticity.support_kinds import PressingSupport, SlidingSupport
from ccfem.fem.elasticity.supports import held
from ccfem.fem.materials import isotropic
from ccfem.paths.fields.chart import flat_view
from ccfem.slicing.slicers import Planar
from ccfem.slicing.slicers.surfaces import layer_from_surface

ANGLE = np.radians(37.0)
TURN = np.array(
    [[np.cos(ANGLE), -np.sin(ANGLE), 0.0], [np.sin(ANGLE), np.cos(ANGLE), 0.0], [0.0, 0.0, 1.0]]
)
CENTRE, RADIUS = np.array([20.0, 18.0, 0.0]), 6.0


def outline(sides: int) -> shapely.Polygon:
    hole = shapely.Point(CENTRE).buffer(RADIUS, quad_segs=sides // 4)
    return shapely.box(0, 0, 40, 40).difference(hole)


def of_stl(turn: np.ndarray) -> TetMesh:
    """A surface of 24 chords a turn, as coarse as they come, with nodes on these chords too."""
    source = extrude(outline(24), 4.0, 1.0)
    triangles = source.boundary if np.linalg.det(turn) > 0.0 else source.boundary[:, ::-1]
    return fill(Surface(source.points @ turn.T, triangles), 3.0, "gmsh")[0]


@pytest.fixture(scope="module", params=["planform", "turned", "mirrored", "cad"])
def body(request, tmp_path_factory):
    """A mesh with edges of 3 mm, and a point of the axis of its hole."""
    if request.param == "planform":
        return extrude(outline(128), 4.0, 3.0), CENTRE
    gmsh = pytest.importorskip("gmsh")
    if request.param == "cad":
        path = tmp_path_factory.mktemp("cad") / "plate.step"
        gmsh.initialize(interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        block = gmsh.model.occ.addBox(0, 0, 0, 40, 40, 4)
        pin = gmsh.model.occ.addCylinder(*CENTRE[:2], -1, 0, 0, 6, RADIUS)
        gmsh.model.occ.cut([(3, block)], [(3, pin)])
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
        gmsh.finalize()
        return mesh_cad(path, 3.0)[0], CENTRE
    turn = TURN if request.param == "turned" else TURN @ np.diag([1.0, -1.0, 1.0])
    return of_stl(turn), turn @ CENTRE


def test_a_hole_takes_the_pin_that_it_was_drawn_for(body):
    """At the mesh's chords it took one of 11.6 mm."""
    mesh, centre = body
    for layer in Planar(count=2).cut(mesh):
        (hole,) = layer.plane.polygon.interiors
        pin = 2.0 * hole.distance(shapely.Point(layer.plane.project(centre)))
        assert pin == pytest.approx(2.0 * RADIUS, abs=0.02)


def test_a_surface_of_another_program_follows_the_wall_that_it_ends_at(body):
    """A slightly slanted surface through the nodes of a section, whose border are chords."""
    mesh, centre = body
    (cut,) = Planar(count=1).cut(mesh)
    slanted = cut.points + [0.0, 0.0, 0.02] * (cut.points[:, :1] - centre[0])
    layer = flat_view(layer_from_surface(mesh, slanted, cut.triangles, 0, 0.5))
    (hole,) = layer.plane.polygon.interiors
    ends = shapely.points(shapely.get_coordinates(hole))
    middle = shapely.Polygon(hole).centroid
    assert shapely.distance(hole, middle) == pytest.approx(RADIUS, abs=0.02)
    assert shapely.distance(ends, middle).max() == pytest.approx(RADIUS, abs=0.02)


def test_an_oval_hole_of_a_cad_file_is_printed_within_five_hundredths(tmp_path):
    """By a size of 12 edges a turn, as on round walls, the chords were up to 0.2 mm off."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    occ, path = gmsh.model.occ, tmp_path / "oval.step"
    oval = occ.addPlaneSurface([occ.addCurveLoop([occ.addEllipse(20, 18, -1, 9, 5)])])
    ((_, pin),) = [one for one in occ.extrude([(2, oval)], 0, 0, 6) if one[0] == 3]
    occ.cut([(3, occ.addBox(0, 0, 0, 40, 40, 4))], [(3, pin)])
    occ.synchronize()
    gmsh.write(str(path))
    gmsh.finalize()
    turn = np.linspace(0.0, 2.0 * np.pi, 10_000)
    true = shapely.LinearRing(np.column_stack([20 + 9 * np.cos(turn), 18 + 5 * np.sin(turn)]))
    (layer,) = Planar(count=1).cut(mesh_cad(path, 6.0)[0])
    (hole,) = layer.plane.polygon.interiors
    assert shapely.hausdorff_distance(hole.segmentize(0.2), true) < 0.05


@pytest.mark.parametrize("kind", [SlidingSupport, PressingSupport])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("share", [1.0, 0.2])
def test_a_part_that_slides_on_its_bore_is_free_to_turn(body, kind, order, share):
    """On the whole bore, and on a fifth of its facets, which alone would show no cylinder."""
    mesh, _ = body
    (wall,) = np.unique(mesh.wall_of[mesh.wall_of >= 0])
    bore = mesh.boundary[mesh.wall_of == wall]
    bore = bore[:: round(1.0 / share)]
    low = mesh.boundary[(mesh.points[mesh.boundary][..., 2] < 1e-6).all(axis=1)]
    mesh = replace(mesh, patches={"bore": bore, "low": low})
    mesh = mesh.quadratic() if order == 2 else mesh
    supports = (kind("bore"), SlidingSupport("low"))
    problem = Problem(mesh, isotropic(100.0, 0.3), supports, {}, order=order)
    with pytest.raises(InputError, match=r"the part is free to .*rotate about the axis through"):
        held(problem)


def test_a_wavy_top_is_no_round_wall():
    """The sections are those of the mesh: a cylinder through the crests adds 1.5 % to them."""
    mesh = ccfem.read("m_shape", element_size=6.0).problem.mesh
    assert not mesh.round_walls
    (layer,) = Planar(count=1).cut(mesh)
    assert layer.plane.polygon.area == pytest.approx(mesh.volumes.sum(), rel=1e-3)  # 1 mm
