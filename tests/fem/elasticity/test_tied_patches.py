"""Patches of unlike meshes tied together, beside one mesh, beam theory and CalculiX 2.20."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh, box_mesh
from ccfem.fem.elasticity import (
    Displacement,
    Force,
    PointForce,
    Pressure,
    Problem,
    Support,
    TiedPatch,
    prepare,
    solve,
)
from ccfem.fem.elasticity.tied_faces import tied_nodes
from ccfem.fem.materials import isotropic

PLASTIC = isotropic(2000.0, 0.3)
FIRST, SECOND = (4, 1, 2), (5, 2, 3)
JOINT = TiedPatch("near", "far")


def two_bars(first=FIRST, second=SECOND, gap=0.0, order=2):
    """Two bars of 20 x 5 x 10 mm end to end: foot and far of one, near and tip of the other."""
    one, other = box_mesh((20.0, 5.0, 10.0), first), box_mesh((20.0, 5.0, 10.0), second)
    count = len(one.points)
    patches = {"foot": one.patches["x_min"], "far": one.patches["x_max"]}
    patches |= {"near": other.patches["x_min"] + count, "tip": other.patches["x_max"] + count}
    patches["below"] = np.concatenate([one.patches["z_min"], other.patches["z_min"] + count])
    points = np.concatenate([one.points, other.points + np.array([20.0 + gap, 0, 0])])
    mesh = TetMesh(points, np.concatenate([one.cells, other.cells + count]), patches)
    return mesh.quadratic() if order == 2 else mesh


def one_bar(half):
    """The bar of the mesh of one half."""
    mesh = box_mesh((40.0, 5.0, 10.0), (2 * half[0], *half[1:]))
    patches = {"foot": mesh.patches["x_min"], "tip": mesh.patches["x_max"]}
    return mesh.with_patches(patches).quadratic()


def pulled(mesh, vector, supports, **more):
    """Mean displacement of the tip under a force, and the field."""
    loads = {"pull": (Force("tip", vector),)}
    field = solve(Problem(mesh, PLASTIC, supports, loads), **more)["pull"]
    nodes = np.unique(mesh.facet_nodes(mesh.patches["tip"]))
    return field.displacement[nodes].mean(axis=0), field


def test_unlike_bars_bend_and_stretch_as_one():
    mesh, held = two_bars(), (Support("foot"), JOINT)
    for vector, c in (((0.0, 0.0, 20.0), 2), ((0.0, 20.0, 0.0), 1), ((500.0, 0.0, 0.0), 0)):
        moved, field = pulled(mesh, vector, held)
        # As the mesh of the one and of the other gives all along.
        ends = [pulled(one_bar(k), vector, (Support("foot"),))[0][c] for k in (FIRST, SECOND)]
        assert moved[c] == pytest.approx(np.mean(ends), rel=0.01)
        # The tie passes the force on; what it carries itself is no support.
        assert list(field.support_forces) == ["foot"]
        np.testing.assert_allclose(field.support_forces["foot"], -np.array(vector), atol=1e-6)
        np.testing.assert_allclose(field.reactions.sum(axis=0), -np.array(vector), atol=1e-6)


def test_a_tie_is_that_of_calculix():
    """The same quadratic cells with *TIE, POSITION TOLERANCE=0.1, ADJUST=NO in CalculiX 2.20."""
    mesh = two_bars()
    force = PointForce(tuple(mesh.points[-1].tolist()), (0.0, 0.0, 1.0))
    loads = {"both": (Pressure("tip", 2.0), force)}
    field = solve(Problem(mesh, PLASTIC, (Support("foot"), JOINT), loads))["both"]
    wanted = {
        101: (-4.406783e-02, -1.485955e-03, 2.721121e-02),
        35: (-3.536864e-02, 1.233132e-03, 2.180787e-02),
        89: (-4.399712e-02, -2.874233e-03, 2.469784e-02),
        29: (-2.302546e-02, -2.757138e-04, 9.842535e-03),
        96: (-2.302546e-02, -2.757138e-04, 9.842535e-03),
    }
    here = field.displacement[list(wanted)]
    np.testing.assert_allclose(here, list(wanted.values()), rtol=1e-5, atol=1e-9)


def test_matching_nodes_give_what_one_mesh_gives():
    vector, held = (0.0, 0.0, 20.0), (Support("foot"), JOINT)
    moved, field = pulled(two_bars(FIRST, FIRST), vector, held)
    wanted, one = pulled(one_bar(FIRST), vector, (Support("foot"),))
    np.testing.assert_allclose(moved, wanted, rtol=1e-9, atol=1e-12)
    assert field.strain_energy == pytest.approx(one.strain_energy, rel=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_every_backend_solves_it(order):
    """The two-level preconditioner reaches midpoints of the face that corners follow."""
    mesh, held = two_bars(order=order), (Support("foot"), JOINT)
    wanted, _ = pulled(mesh, (0.0, 5.0, 20.0), held, backend="superlu")
    moved, field = pulled(
        mesh, (0.0, 5.0, 20.0), held, backend="two-level" if order == 2 else "amg"
    )
    np.testing.assert_allclose(moved, wanted, rtol=1e-5)
    assert field.record.iterations < 60


def test_without_the_tie_the_second_bar_is_free():
    problem = Problem(two_bars(), PLASTIC, (Support("foot"),), {"pull": (Force("tip", (1, 0, 0)),)})
    with pytest.raises(InputError, match=r"one of 2 separate pieces\) is free to"):
        prepare(problem)


def test_what_supports_hold_of_tied_nodes_stays_held():
    """A patch over both bars is held across itself: the nodes at the joint follow along it."""
    mesh = two_bars()
    held = (Support("foot", "x"), Support("below", "z"), Support("foot", "y"), JOINT)
    moved, field = pulled(mesh, (500.0, 0.0, 0.0), held)
    nodes = np.unique(mesh.facet_nodes(mesh.patches["below"]))
    assert np.abs(field.displacement[nodes, 2]).max() == 0.0
    assert moved[0] == pytest.approx(500.0 * 40.0 / (2000.0 * 50.0), rel=0.01)
    assert set(field.support_forces) == {"foot", "below"}


def test_a_support_that_moves_takes_the_tied_part_along():
    mesh, loads = two_bars(), {"move": (Displacement("foot", (0.0, 0.0, 0.3)),)}
    field = solve(Problem(mesh, PLASTIC, (Support("foot"), JOINT), loads))["move"]
    np.testing.assert_allclose(
        field.displacement, np.tile([0, 0, 0.3], (len(mesh.points), 1)), atol=1e-9
    )


def test_nodes_follow_the_nearest_place_of_a_curved_face():
    """On a quadratic arc the nearest place is that of the parabola, here of height y = x - x^2."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1], [0.3, -1, 0.3]])
    cell = TetMesh(corners, [[0, 1, 2, 3]]).quadratic()
    points = cell.points.copy()
    number = {tuple(p): k for k, p in enumerate(points.round(9).tolist())}
    for x, z in ((0.5, 0.0), (0.5, 0.5)):
        points[number[x, 0.0, z], 1] = x - x * x
    bent = TetMesh(points, cell.cells)
    (face,) = np.flatnonzero(bent.corners[0] != number[0.3, -1.0, 0.3])[None]
    at = np.array([0.3, 0.21, 0.2])
    normal = np.array([-0.4, 1.0, 0.0])
    far = at + 0.05 * normal / np.linalg.norm(normal)
    with_node = TetMesh(np.vstack([points, far]), cell.cells)
    tied = tied_nodes(with_node, np.array([10]), bent.corners[0][face][None], 0.06, "it")
    np.testing.assert_allclose(tied.weights @ points[tied.leaders[0]], at[None], atol=1e-6)


@pytest.mark.parametrize(
    ("supports", "message"),
    [
        ((TiedPatch("near", "far", 0.01),), "no node of patch 'near' lies within 0.01 mm"),
        ((JOINT, TiedPatch("far", "near")), "in a circle"),
        ((TiedPatch("near", "nothing"),), "nothing"),
    ],
)
def test_ties_that_make_no_sense(supports, message):
    gap = 0.5 if "within" in message else 0.0
    loads = {"pull": (Force("tip", (1.0, 0.0, 0.0)),)}
    with pytest.raises(InputError, match=message):
        solve(Problem(two_bars(gap=gap), PLASTIC, (Support("foot"), *supports), loads))


def test_a_patch_is_not_tied_to_itself():
    with pytest.raises(InputError, match="tied to itself"):
        TiedPatch("near", "near")
    with pytest.raises(InputError, match="within of the tied patch 'near'"):
        TiedPatch("near", "far", -1.0)


def test_a_coarser_patch_that_follows_a_finer_one_is_named():
    """The finer face of the other bar bends between the nodes that are tied: too soft."""
    mesh = two_bars()
    moved = {}
    for joint in (JOINT, TiedPatch("far", "near")):
        tip, field = pulled(mesh, (0.0, 0.0, 20.0), (Support("foot"), joint))
        said = [line for line in field.findings if "tie 'near' to 'far'" in line]
        moved[len(said)] = tip[2]
    assert moved[1] > moved[0]
