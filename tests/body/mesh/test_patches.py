import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.body.files import read_mesh
from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.body.mesh.patches import (
    Box,
    Cylinder,
    Group,
    Nearest,
    Plane,
    match_boundary,
    patches_from_rules,
    unit_vector,
)
from ccfem.body.meshing import extrude


@pytest.fixture(scope="module")
def plate():
    """Plate 40 x 20 x 4 with a hole of radius 4 in the middle."""
    outline = shapely.box(-20, -10, 20, 10).difference(shapely.Point(0, 0).buffer(4, 64))
    return extrude(outline, 4.0, 2.0)


def area(mesh, facets):
    return mesh.facet_areas(facets)[0].sum()


def test_plane_takes_the_whole_end_and_nothing_else(plate):
    for rule in (
        Plane("x", 20.0),
        Plane("x", "max"),
        Plane("-x", "min"),
        Plane((3.0, 0.0, 0.0), 20.0),
        Plane.through((20.0, 3.0, -7.0), "x"),
    ):
        facets = rule(plate)
        assert area(plate, facets) == pytest.approx(20.0 * 4.0)
        assert (plate.points[facets][:, :, 0] == 20.0).all()


def test_plane_within_its_tolerance_only(plate):
    with pytest.raises(InputError, match=r"misses it by 0\.5 mm"):
        Plane("x", 20.5, tolerance=0.4)(plate)
    assert len(Plane("x", 20.5, tolerance=0.6)(plate)) == len(Plane("x", 20.0)(plate))


def test_plane_leaves_out_facets_that_stand_across_it(plate):
    # A tolerance of 2.5 mm takes in the first row of the side walls' facets, but they face away.
    facets = Plane("x", "max", tolerance=2.5)(plate)
    assert area(plate, facets) == pytest.approx(80.0)


def test_cylinder_takes_the_wall_and_its_half(plate):
    whole = Cylinder((0, 0, 0), "z", 4.0)(plate)
    centre = plate.points[whole].mean(axis=1)
    assert area(plate, whole) == pytest.approx(2 * np.pi * 4.0 * 4.0, rel=0.01)
    assert (np.hypot(centre[:, 0], centre[:, 1]) < 4.0).all()
    for half in ("y", "-y", (0.0, 2.0, 5.0)):
        facets = Cylinder((0, 0, 0), "z", 4.0, half=half)(plate)
        y = plate.points[facets].mean(axis=1)[:, 1]
        assert (y > 0).all() if half != "-y" else (y < 0).all()
        assert area(plate, facets) == pytest.approx(0.5 * area(plate, whole), rel=0.05)


def test_wide_cylinder_leaves_out_flat_ends(plate):
    # Radius 7 takes in whole triangles of top and bottom round the hole; the wall alone stays.
    facets = Cylinder((0, 0, 0), "z", 7.0)(plate)
    assert area(plate, facets) == pytest.approx(area(plate, Cylinder((0, 0, 0), "z", 4.0)(plate)))


def test_box_and_nearest_and_group(plate):
    inside = Box((-20, -10, -1), (-10, 10, 0))(plate)
    points = plate.points[inside]
    assert (points[..., 2] == 0).all()
    assert (points[..., 0] <= -10).all()
    everything = Box((-np.inf,) * 3, (np.inf,) * 3)(plate)
    assert len(everything) == len(plate.boundary)
    centres = plate.points[plate.boundary].mean(axis=1)
    distance = np.linalg.norm(centres - [20, 10, 4], axis=1)
    assert len(Nearest((20, 10, 4))(plate)) == 1
    taken = Nearest((20, 10, 4), count=7)(plate)
    assert set(map(tuple, taken)) == set(map(tuple, plate.boundary[np.argsort(distance)[:7]]))
    assert len(Nearest((20, 10, 4), radius=3.0)(plate)) == (distance <= 3.0).sum()
    named = patches_from_rules(plate, {"end": Plane("x", "max")})
    again = patches_from_rules(named, {"load": Group("end")})
    assert np.array_equal(again.patch("load"), named.patch("end"))
    assert set(again.patches) == {"end", "load"}


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        (Plane("x", 25.0), r"plane x at 25 mm .* misses it by 5 mm, its centre at \(20, "),
        (Cylinder((50, 0, 0), "z", 4.0), "misses it by"),
        (Cylinder((0, 0, 0), "z", 3.0, tolerance=0.0), "misses it by 1 mm"),
        (Box((30, 0, 0), (40, 1, 1)), "misses it by 10 mm"),
        (Nearest((30, 0, 2), radius=1.0), "misses it by"),
        (Group("end"), "no group 'end'; it has: none"),
    ],
)
def test_empty_patch_names_the_nearest_candidate(plate, rule, message):
    with pytest.raises(InputError, match=message) as caught:
        patches_from_rules(plate, {"load": rule})
    assert str(caught.value).startswith("patch 'load': ")
    assert "\n" not in str(caught.value)


def test_empty_patch_lists_the_groups_of_the_mesh(box):
    with pytest.raises(InputError, match="groups in the mesh: left, right"):
        Plane("z", 9.0)(box)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Plane("w", 0.0),
        lambda: Plane((0, 0, 0), 0.0),
        lambda: Plane("x", "middle"),
        lambda: Plane("x", 0.0, tolerance=-1.0),
        lambda: Plane("x", 0.0, tolerance=float("nan")),
        lambda: Box((1, 0, 0), (0, 1, 1)),
        lambda: Box((0, 0), (1, 1)),
        lambda: Box((0, 0, float("nan")), (1, 1, 1)),
        lambda: Cylinder((0, 0, 0), "z", 0.0),
        lambda: Cylinder((0, 0, 0), "z", 1.0, half="z"),
        lambda: Cylinder((0, 0, 0), (1, 2), 1.0),
        lambda: Nearest((0, 0, 0), count=0),
        lambda: Nearest((0, 0, 0), radius=-1.0),
        lambda: Nearest((0, 0, 0), count=1, radius=1.0),
        lambda: Nearest(("a", 0, 0)),
        lambda: Nearest((0, 1e308, 0)),
        lambda: Cylinder((0, 0, float("inf")), "x", 1.0),
    ],
)
def test_bad_rules_are_refused_when_made(make):
    with pytest.raises(InputError):
        make()


@settings(max_examples=25, deadline=None)
@given(st.randoms(use_true_random=False), st.floats(0.0, 6.3), st.integers(0, 2))
def test_rules_move_with_the_part(plate, random, angle, axis):
    """Turning, shifting and renumbering the part together with a rule chooses the same facets."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.roll(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]]), (axis, axis), axis=(0, 1))
    shift = np.array([random.uniform(-50, 50) for _ in range(3)])
    order = np.random.default_rng(random.randint(0, 2**31)).permutation(len(plate.points))
    number = np.argsort(order)
    points = plate.points @ turn.T + shift
    moved = TetMesh(points[order], number[plate.cells])

    def place(x):
        return tuple(turn @ np.array(x, dtype=float) + shift)

    def way(x):
        return tuple(turn @ np.array(x, dtype=float))

    pairs = [
        (Plane.through((20, 0, 0), "x"), Plane.through(place((20, 0, 0)), way((1, 0, 0)))),
        (
            Cylinder((0, 0, 0), "z", 4.0, half="y"),
            Cylinder(place((0, 0, 9)), way((0, 0, 1)), 4.0, half=way((0, 1, 0))),
        ),
        (Nearest((20, 10, 4), radius=3.1), Nearest(place((20, 10, 4)), radius=3.1)),
    ]
    for rule, moved_rule in pairs:
        expected = {frozenset(f) for f in number[rule(plate)].tolist()}
        assert {frozenset(f) for f in moved_rule(moved).tolist()} == expected


def test_match_boundary_turns_facets_outward(box):
    facets = box.patches["left"]
    inside = box.cells[:, :3]
    found = match_boundary(box, np.concatenate([facets[:, ::-1], facets, inside[:4]]))
    assert {frozenset(f) for f in facets.tolist()} <= {frozenset(f) for f in found.tolist()}
    normals = box.facet_areas(match_boundary(box, facets[:, ::-1]))[1]
    assert np.allclose(normals, [-1, 0, 0])
    assert match_boundary(box, np.zeros((0, 3), dtype=int)).shape == (0, 3)


def test_unit_vector():
    assert np.allclose(unit_vector("-y", "axis"), [0, -1, 0])
    assert np.allclose(unit_vector((0, 3, 4), "axis"), [0, 0.6, 0.8])
    with pytest.raises(InputError, match="axis must be"):
        unit_vector("--y", "axis")


@pytest.mark.skipif("CCFEM_CHEN2021" not in os.environ, reason="the authors' data is not here")
@pytest.mark.parametrize("tolerance", [None, 0.0])
@pytest.mark.parametrize("top", [True, False])
def test_holes_of_the_published_loop(top, tolerance):
    """Against a plain loop over the facets of the cells, with the definition in words."""
    mesh = read_mesh(Path(os.environ["CCFEM_CHEN2021"]) / "Loop" / "Loop.tet")
    z = 50.0 if top else -50.0
    counts: dict[frozenset[int], int] = {}
    for cell in mesh.cells.tolist():
        for leave in range(4):
            face = frozenset(cell[:leave] + cell[leave + 1 :])
            counts[face] = counts.get(face, 0) + 1
    expected = set()
    for face in (face for face, count in counts.items() if count == 1):
        x = mesh.points[list(face)]
        near = all((p[0] + 0.2) ** 2 + (p[2] - z) ** 2 <= 5.45**2 for p in x)
        flat = all(p[1] < 0.05 for p in x) or all(p[1] > 9.95 for p in x)
        if near and not flat and (x[:, 2].mean() > z) == top:
            expected.add(face)
    rule = Cylinder(
        (-0.2, 0.0, z), "y", 5.45, tolerance=tolerance, half=(0, 0, 1) if top else (0, 0, -1)
    )
    found = {frozenset(f) for f in rule(mesh).tolist()}
    assert len(expected) > 50
    assert found == expected


def test_messages_list_patches_by_number_and_not_by_the_hundred():
    mesh = box_mesh((1.0, 1.0, 1.0), (1, 1, 1))
    few = replace(mesh, patches={f"face_{k}": mesh.boundary[:1] for k in (10, 9, 2)})
    assert few.patch_list == "face_2, face_9, face_10"
    many = replace(mesh, patches={f"face_{k}": mesh.boundary[:1] for k in range(1, 106)})
    assert many.patch_list.endswith("face_10, face_11, ... face_105 (105 in all)")
    assert replace(mesh, patches={}).patch_list == "none"
