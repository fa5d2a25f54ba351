import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.assembly import assemble
from ccfem.fem.elasticity.held import Held, rigid_modes
from ccfem.fem.elasticity.problem import Problem, Support
from ccfem.fem.elasticity.supports import check_support, held
from ccfem.fem.materials import isotropic


def box():
    return box_mesh((10.0, 2.0, 2.0), (4, 2, 2))


def problem(mesh, *supports):
    return Problem(mesh, isotropic(1.0, 0.3), supports)


def joined(*meshes):
    """Return meshes as one, equal nodes merged; the patches are those of the first."""
    points = np.vstack([mesh.points for mesh in meshes])
    shifts = np.cumsum([0] + [len(mesh.points) for mesh in meshes[:-1]])
    cells = np.vstack([mesh.cells + shift for mesh, shift in zip(meshes, shifts, strict=True)])
    merged, number = np.unique(points.round(9), axis=0, return_inverse=True)
    number = number.reshape(-1)
    patches = {name: number[facets] for name, facets in meshes[0].patches.items()}
    return TetMesh(merged, number[cells], patches)


@pytest.mark.parametrize("order", [1, 2])
def test_held_components(order):
    mesh = box() if order == 1 else box().quadratic()
    result = held(problem(mesh, Support("x_min", "xz", (0.1, 9.0, 0.2)), Support("y_min", "y")))
    at_x, at_y = np.isclose(mesh.points[:, 0], 0.0), np.isclose(mesh.points[:, 1], 0.0)
    np.testing.assert_array_equal(result.free, ~np.stack([at_x, at_y, at_x], axis=1))
    np.testing.assert_allclose(result.value[at_x], [[0.1, 0.0, 0.2]] * at_x.sum())
    assert not result.value[~at_x].any()
    np.testing.assert_array_equal(result.nodes, np.flatnonzero(~(at_x & at_y)))


@pytest.mark.parametrize(
    ("supports", "motion"),
    [
        (
            (Support("x_min", "x"),),
            r"move along y and z and to rotate about the axis through \(5, 1, 1\) along x:",
        ),
        ((Support("x_min", "xy"),), "move along z:"),
        ((Support("x_min", "x"), Support("z_min", "z")), "move along y:"),
        (
            (Support("z_min", "z"),),
            r"move along x and y and to rotate about the axis through \(5, 1, 1\) along z:",
        ),
    ],
)
def test_free_motion_is_named(supports, motion):
    with pytest.raises(InputError, match=f"the part is free to {motion}"):
        held(problem(box(), *supports))


def test_free_rotation_about_an_edge_is_named():
    # Everything on the line y = 2, z = 0 is held: the box turns about it.
    mesh = box()
    on_line = np.isclose(mesh.points[:, 1], 2.0) & np.isclose(mesh.points[:, 2], 0.0)
    with pytest.raises(
        InputError, match=r"free to rotate about the axis through \(5, 2, 0\) along x"
    ):
        check_support(mesh, np.repeat(on_line[:, None], 3, axis=1))


@given(st.integers(0, 10_000))
@example(474)  # the edge lies along x but for a thousandth
@settings(max_examples=15, deadline=None)
def test_free_motion_turns_with_the_part(seed):
    generator = np.random.default_rng(seed)
    turn = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    mesh = box()
    on_line = np.isclose(mesh.points[:, 1], 2.0) & np.isclose(mesh.points[:, 2], 0.0)
    turned = TetMesh(mesh.points @ (turn * np.sign(np.linalg.det(turn))).T, mesh.cells)
    with pytest.raises(InputError) as caught:
        check_support(turned, np.repeat(on_line[:, None], 3, axis=1))
    words = str(caught.value)
    assert words.startswith("the part is free to rotate about the axis through (")
    if "along (" in words:
        named = np.array([float(c) for c in words.split("along (")[1].split(")")[0].split(",")])
        assert abs(named @ turn[:, 0]) == pytest.approx(1.0, abs=2e-3)


def test_a_loose_piece_is_found():
    mesh = joined(box(), box_mesh((10.0, 2.0, 2.0), (4, 2, 2), (20.0, 0.0, 0.0)))
    with pytest.raises(InputError, match=r"one of 2 separate pieces\) is free to move along x"):
        held(problem(mesh, Support("x_min")))


def test_a_hinge_is_found():
    # The boxes share only the edge x = 10, y = 2.
    mesh = joined(box(), box_mesh((10.0, 2.0, 2.0), (4, 2, 2), (10.0, 2.0, 0.0)))
    with pytest.raises(
        InputError, match=r"free to rotate about the axis through \(10, 2, 1\) along z"
    ):
        held(problem(mesh, Support("x_min")))


def test_a_frame_of_hinged_boxes_is_free_until_it_is_braced():
    mesh = joined(
        box_mesh((2.0, 1.0, 1.0), (2, 1, 1)),
        box_mesh((1.0, 2.0, 1.0), (1, 2, 1), (2.0, 1.0, 0.0)),
        box_mesh((2.0, 2.0, 1.0), (2, 2, 1), (0.0, 3.0, 0.0)),
        box_mesh((0.5, 2.0, 1.0), (1, 2, 1), (-0.5, 1.0, 0.0)),
    )
    with pytest.raises(InputError, match="free to"):  # four bars, four hinges
        held(problem(mesh, Support("x_min")))
    braced = joined(mesh, box_mesh((1.0, 2.0, 1.0), (1, 2, 1), (0.0, 1.0, 0.0)))
    assert held(problem(braced, Support("x_min"))).free.any()


@pytest.mark.parametrize(
    ("supports", "message"),
    [
        ((), "no support"),
        ((Support("nowhere"),), "no patch named 'nowhere'"),
        ((Support("empty"),), "patch 'empty' is empty"),
        ((Support("x_min", "x", (float("nan"), 0.0, 0.0)),), "finite values"),
        (
            (Support("x_min"), Support("y_min", "y", (0.0, 1.0, 0.0))),
            "contradict each other: .*'y_min' are held in y at 1.0 mm",
        ),
    ],
)
def test_bad_supports_are_refused(supports, message):
    mesh = box().with_patches({"empty": np.empty((0, 3), dtype=int)})
    with pytest.raises(InputError, match=message):
        held(problem(mesh, *supports))


def test_support_components_are_checked():
    with pytest.raises(InputError, match="letters of 'xyz'; got 'xw'"):
        Support("x_min", "xw")


def test_nodes_without_cells_are_left_out():
    mesh = box()
    loose = TetMesh(np.vstack([mesh.points, [[50.0, 0.0, 0.0]]]), mesh.cells, mesh.patches)
    result = held(problem(loose, Support("x_min")))
    assert not result.free[-1].any()
    assert len(mesh.points) not in result.nodes


def test_reduced_matrix_is_the_free_part():
    mesh = box()
    generator = np.random.default_rng(0)
    free = generator.random((len(mesh.points), 3)) < 0.6
    value = np.where(free, 0.0, generator.normal(size=free.shape))
    constraint = Held(free, value, np.flatnonzero(free.any(axis=1)))
    matrix = assemble(mesh, isotropic(3.0, 0.2).stiffness)
    reduced = constraint.reduce(matrix)
    forces = generator.normal(size=free.shape)
    solution = np.linalg.solve(reduced.toarray(), constraint.right_hand_side(matrix, forces))
    u = constraint.expand(solution)
    np.testing.assert_allclose(u[~free], value[~free])
    flat, dense = free.reshape(-1), matrix.toarray()
    rest = forces.reshape(-1) - dense @ value.reshape(-1)
    expected = np.linalg.solve(dense[np.ix_(flat, flat)], rest[flat])
    np.testing.assert_allclose(u[free], expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(constraint.restrict(u), solution, atol=1e-15)
    assert constraint.reduce(matrix).has_sorted_indices


def test_rigid_modes_have_no_strain():
    points = np.random.default_rng(1).normal(size=(4, 3))
    modes = rigid_modes(points).reshape(4, 3, 6)
    for k in range(6):
        slope = np.linalg.lstsq(np.hstack([points, np.ones((4, 1))]), modes[:, :, k], rcond=None)[
            0
        ][:3]
        np.testing.assert_allclose(slope + slope.T, 0.0, atol=1e-12)
