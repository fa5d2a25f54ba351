"""Which layers and regions get fibre, against boxes and cylinders whose sections are known."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.files import write_mesh
from ccfem.body.files.surface import Surface
from ccfem.body.mesh import box_mesh
from ccfem.body.meshing import extrude
from ccfem.cases.case import Case
from ccfem.cases.inspection import check
from ccfem.cases.part_file import read_part
from ccfem.cases.part_writing import part_text
from ccfem.comparison.engine import compare
from ccfem.comparison.plot.part_picture import fibre_outlines
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.materials import isotropic
from ccfem.machine import Machine
from ccfem.paths.placement import FibrePlaces, FibreRegion, InBody, InBox, InCylinder, NearPatch
from ccfem.paths.planning import plan
from ccfem.printing.print_plan import plan_print
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create

SIZE = (60.0, 30.0, 12.0)
MESH = box_mesh(SIZE, (12, 6, 2))
LAYERS = Planar(count=12).cut(MESH)  # at .5, 1.5, .. 11.5 mm
MACHINE = Machine(minimum_length=20.0, cutter_distance=20.0)
NONE = -np.inf, np.inf


def numbers(places, machine=MACHINE):
    return [layer.index for layer in places.on(LAYERS, MESH, machine)]


@pytest.mark.parametrize(
    ("keys", "wanted"),
    [
        ({}, list(range(12))),
        ({"layers": "2:-2:3"}, [2, 5, 8]),
        ({"layers": (0, 7)}, [0, 7]),
        ({"from_height": 1.5, "to_height": 4.6}, [1, 2, 3, 4]),
        ({"every": 4}, [0, 4, 8]),
        ({"layers": "1:", "every": 4}, [1, 5, 9]),
        # A layer of matrix is .8 mm high, a strand .1075: 1 mm of distance holds two, 2 mm three.
        ({"between": 2}, list(range(12))),
        ({"between": 3}, [0, 2, 4, 6, 8, 10]),
    ],
)
def test_layers_of_a_box(keys, wanted):
    assert numbers(FibrePlaces(**keys)) == wanted


def test_layers_that_matrix_does_not_cover_get_no_fibre():
    machine = replace(MACHINE, process=replace(MACHINE.process, cover=0.5))
    # The middle of the lowest is .5 mm over the bottom, its strands half their height less.
    assert numbers(FibrePlaces(), machine) == list(range(1, 11))
    assert numbers(FibrePlaces(covered=False), machine) == list(range(12))


def section(shape, mode="only", layer=6, **keys):
    places = FibrePlaces(layers=(layer,), regions=(FibreRegion(shape, mode),), **keys)
    (cut,) = places.on(LAYERS, MESH, MACHINE)
    return cut


def cube(low, high):
    """A closed surface, outward."""
    body = box_mesh(tuple(np.subtract(high, low)), (1, 1, 1))
    return Surface(body.points + low, body.boundary)


ELLIPSE = InCylinder((30.0, 15.0, 6.5), (1.0, 0.0, 1.0), 5.0)
AREAS = {
    "box": (InBox((10.0, -np.inf, 0.0), (33.3, 17.7, 12.0)), 23.3 * 17.7),
    "cylinder": (InCylinder((30.0, 15.0, 0.0), "z", 7.0), np.pi * 49.0),
    "ellipse": (ELLIPSE, np.pi * 25.0 * np.sqrt(2.0)),
    "lying": (InCylinder((30.0, 15.0, 6.0), "y", 3.0), 30.0 * 2.0 * np.sqrt(9.0 - 0.25)),
    "wall": (NearPatch("x_min", 5.0), 5.0 * 30.0),
    "body": (InBody(cube((5.0, 5.0, 5.0), (15.0, 45.0, 8.0))), 10.0 * 25.0),
}


@pytest.mark.parametrize("name", AREAS)
def test_regions_have_the_areas_of_their_sections(name):
    shape, area = AREAS[name]
    # Circles have 64 sides: their area is .16 % less.
    inside, outside = section(shape), section(shape, "exclude")
    assert inside.plane.polygon.area == pytest.approx(area, rel=2e-3)
    assert outside.plane.polygon.area == pytest.approx(1800.0 - inside.plane.polygon.area, abs=1e-3)
    for layer in (inside, outside):
        # Triangles, borders and what points stand on tell one story.
        assert layer.areas.sum() == pytest.approx(layer.plane.polygon.area, abs=1e-6)
        assert layer.areas.min() > 0.0
        np.testing.assert_allclose(layer.interpolate(MESH.points), layer.points, atol=1e-5)
        assert (layer.normals[:, 2] > 0.999).all()


@pytest.mark.parametrize("mode", ["only", "exclude"])
def test_regions_of_a_part_with_a_round_hole_have_no_notches(mode):
    """A hole of 12 mm in 40 x 40 mm, of which 28 x 27 mm about the hole are chosen."""
    hole = shapely.Point(20.0, 18.0).buffer(6.0, quad_segs=32)
    mesh = extrude(shapely.box(0, 0, 40, 40).difference(hole), 4.0, 3.0)
    places = FibrePlaces(regions=(FibreRegion(InBox((5, 4, 0), (33, 31, 4)), mode),))
    area = {"only": 28.0 * 27.0 - 36.0 * np.pi, "exclude": 1600.0 - 28.0 * 27.0}[mode]
    for layer in places.on(Planar(count=6).cut(mesh), mesh, MACHINE):
        # Walls are kept to within .005 mm of 38 mm round the hole.
        assert layer.plane.polygon.area == pytest.approx(area, abs=0.2)
        assert layer.areas.sum() == pytest.approx(layer.plane.polygon.area, abs=1e-4)


def test_near_a_face_lie_the_layers_that_are_near_it():
    region = FibreRegion(NearPatch("z_max", 3.0))
    assert numbers(FibrePlaces(regions=(region,))) == [9, 10, 11]


def test_the_lowest_priority_number_counts_where_regions_overlap():
    left, right = InBox((0, 0, 0), (40, 30, 12)), InBox((20, 0, 0), (60, 30, 12))

    def area(first, second):
        regions = (FibreRegion(left, "only", first), FibreRegion(right, "exclude", second))
        (layer,) = FibrePlaces(layers=(3,), regions=regions).on(LAYERS, MESH, MACHINE)
        return layer.plane.polygon.area

    assert area(1, 2) == pytest.approx(40.0 * 30.0)
    assert area(2, 1) == pytest.approx(20.0 * 30.0)
    assert area(1, 1) == pytest.approx(20.0 * 30.0)


def test_edges_on_patches_stay_on_them():
    layer = section(InBox((-1.0, 5.0, 0.0), (33.3, 17.7, 12.0)))
    ends = layer.points[layer.patches["x_min"]]
    assert np.abs(ends[..., 0]).max() < 1e-9
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(12.7)
    assert not len(layer.patches["x_max"])


def test_pieces_narrower_than_a_strand_get_no_fibre():
    slit = InBox((20.0, 0.0, 0.0), (20.0 + 0.9 * MACHINE.fibre_width, 30.0, 12.0))
    both = (FibreRegion(slit), FibreRegion(InBox((40, 0, 0), (50, 30, 12))))
    (layer,) = FibrePlaces(layers=(3,), regions=both).on(LAYERS, MESH, MACHINE)
    assert layer.plane.polygon.bounds == pytest.approx((40.0, 0.0, 50.0, 30.0))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"layers": "3"}, "FIRST:END:STEP"),
        ({"layers": "1:2:0"}, "FIRST:END:STEP"),
        ({"layers": (99,)}, "layer 99, but there are 0 to 11"),
        ({"layers": "9:3"}, "none is left"),
        ({"from_height": 3.0, "to_height": 1.0}, "upside down"),
        ({"from_height": np.nan}, "finite"),
        ({"every": 0}, "at least 1"),
        ({"between": -1}, "at least 0"),
        ({"regions": (FibreRegion(InBox((90, 0, 0), (99, 9, 9))),)}, "none is left"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(keys, said):
    with pytest.raises(InputError, match=said) as refused:
        numbers(FibrePlaces(**keys))
    assert len(refused.value.mistakes) == 1


@pytest.fixture(scope="module")
def case():
    problem = Problem(
        MESH, isotropic(3500.0, 0.3), (Support("x_min"),), {"pull": (Force("x_max", (9, 0, 0)),)}
    )
    regions = (
        FibreRegion(InBox((0, 0, 0), (45, 30, 12))),
        FibreRegion(InCylinder((30.0, 15.0, 0.0), "z", 6.0), "exclude"),
    )
    fibre = FibrePlaces(layers="1:8", every=3, regions=regions)
    return Case("box", "A box", problem, slicing=Planar(count=12), machine=MACHINE, fibre=fibre)


def test_every_strategy_gets_the_same_layers_and_regions(case):
    strategies = {"zigzag": create("zigzag", {}), "concentric": create("concentric", {})}
    found = compare(case, strategies, strand=None)
    assert [layer.index for layer in found.layers] == [1, 4, 7]
    assert any("fibre on 3 layers" in line and "every 3 layers" in line for line in found.remarks)
    lengths = []
    for run in found.runs:
        fibre = run.toolpaths
        assert set(fibre.layer.tolist()) == {1, 4, 7}
        # Never outside the region, by the strands' own width; links run along its border.
        allowed = shapely.box(0, 0, 45, 30) - shapely.Point(30, 15).buffer(5.99)
        lines = shapely.multilinestrings([shapely.linestrings(path[:, :2]) for path in fibre])
        assert shapely.length(shapely.difference(lines, allowed)) < 1e-6
        lengths.append(fibre.lengths.sum())
    assert lengths[0] == pytest.approx(lengths[1], rel=0.02)


def test_what_has_no_fibre_is_printed_full_of_matrix(case):
    stress = solve(case.problem)["pull"]
    layers = case.fibre_layers(stress)
    paths = plan(create("zigzag", {}), layers, stress, MACHINE)
    printed = plan_print(paths, layers, MESH, MACHINE)
    assert printed.volume(MACHINE) == pytest.approx(np.prod(SIZE), rel=0.01)
    assert printed.outside == 0.0


def test_the_check_says_and_draws_where_fibre_lies(case):
    checked = check(case)
    assert "fibre on 3 layers (1, 4, 7)" in str(checked)
    outlines = fibre_outlines(checked)
    assert {round(float(line[0, 2]), 3) for line in outlines} == {1.5, 4.5, 7.5}
    assert len(outlines) == 6  # a border and a hole a layer


def test_a_part_file_says_where_fibre_lies_and_is_written_again(case, tmp_path):
    write_mesh(MESH, tmp_path / "body.npz")
    near = FibreRegion(NearPatch("x_min", 4.0), "exclude", 2)
    places = replace(case.fibre, regions=(*case.fibre.regions, near), from_height=0.2)
    text = part_text(replace(case, fibre=places), "body.npz")
    (tmp_path / "box.toml").write_text(text)
    assert "\nfrom = 0.2" in text
    assert read_part(tmp_path / "box.toml").fibre == places


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("every = 3", "evry = 3", "fibre has no key 'evry'.*every"),
        ("every = 3", "from_height = 3.0", "write from"),
        ("every = 3", 'from = "low"', r"fibre\.from must be a number"),
        ("radius = 6", "radius = -6", "radius"),
        ('rule = "box"', 'rule = "ball"', "box, cylinder"),
        ('rule = "box"', 'rule = "patch"\npatch = "no"\nwithin = 1.0\nno = 1', "no key 'no'"),
        ('mode = "exclude"', 'mode = "never"', "only"),
    ],
)
def test_a_mistake_in_the_table_is_named(case, tmp_path, old, new, said):
    write_mesh(MESH, tmp_path / "body.npz")
    text = part_text(case, "body.npz")
    assert old in text
    (tmp_path / "box.toml").write_text(text.replace(old, new))
    with pytest.raises(InputError, match=said):
        read_part(tmp_path / "box.toml")
