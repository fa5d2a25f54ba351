"""Slicing: against volumes, areas and boundaries that are known from elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity import GivenStress
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.slicing.layers import plane_frame
from ccfem.slicing.slicers.planar import Planar, slice_heights
from ccfem.strategies import create


def test_a_box_gives_rectangles_of_its_section() -> None:
    mesh = box_mesh((6.0, 4.0, 2.0), (6, 4, 2))
    layers = Planar(count=5).cut(mesh, (0, 0, 1))
    assert len(layers) == 5
    for layer in layers:
        assert layer.plane.polygon.area == pytest.approx(24.0, rel=1e-12)
        assert layer.areas.sum() == pytest.approx(24.0, rel=1e-12)
        assert layer.areas.min() > 0.0
        assert len(layer.loops) == 1


def test_sections_of_a_shell_are_the_areas_between_its_walls() -> None:
    """A hollow frustum: at each height the outer less the inner square, both known."""
    mesh = box_mesh((6.0, 6.0, 4.0), (6, 6, 4))
    middle = np.abs(mesh.points[mesh.corners].mean(axis=1)[:, :2] - 3.0).max(axis=1)
    hollow = TetMesh(mesh.points, mesh.cells[middle > 1.0])
    narrow = 1.0 - 0.1 * hollow.points[:, 2:]
    hollow = replace(hollow, points=np.hstack([3.0 + (hollow.points[:, :2] - 3.0) * narrow,
                                               hollow.points[:, 2:]]))  # fmt: skip
    heights = (0.0, 0.3, 0.31, 1.0, 2.5, 3.9)
    sections = dict(Planar(heights=heights).sections(hollow))
    assert list(sections) == list(range(len(heights)))
    for layer in Planar(heights=heights).cut(hollow):
        section = sections[layer.index]
        # The sides of the cells are straight: squares that shrink by a tenth a mm.
        size = 1.0 - 0.1 * heights[layer.index]
        assert section.polygon.area == pytest.approx(32.0 * size**2, rel=1e-9)
        assert section.polygon.equals_exact(layer.plane.polygon)


def test_layers_through_mesh_nodes_have_the_whole_section() -> None:
    mesh = box_mesh((6.0, 4.0, 2.0), (6, 4, 2))
    low, middle = Planar(heights=[0.0, 1.0]).cut(mesh, (0, 0, 1))
    assert low.areas.sum() == pytest.approx(24.0, rel=1e-12)
    assert middle.areas.sum() == pytest.approx(24.0, rel=1e-12)
    # each face in the plane is taken once, from one of the two cells that share it
    assert len(middle.triangles) == 2 * 6 * 4


@settings(max_examples=10, deadline=None)
@given(
    direction=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda d: np.linalg.norm(d) > 0.1),
    seed=st.integers(0, 1000),
)
def test_section_areas_integrate_to_the_volume(
    direction: tuple[float, float, float], seed: int
) -> None:
    mesh = box_mesh((3.0, 2.0, 1.5), (3, 2, 2))
    moved = mesh.points + np.random.default_rng(seed).uniform(-0.1, 0.1, mesh.points.shape)
    mesh = TetMesh(moved, mesh.cells)
    layers = Planar(count=400).cut(mesh, direction)
    volume = sum(float(layer.areas.sum()) * layer.thickness for layer in layers)
    assert volume == pytest.approx(float(mesh.volumes.sum()), rel=2e-3)
    layer = layers[len(layers) // 2]
    assert layer.plane.polygon.area == pytest.approx(float(layer.areas.sum()), rel=1e-9)


def test_linear_fields_are_interpolated_exactly() -> None:
    mesh = box_mesh((3.0, 2.0, 1.5), (3, 2, 2))
    gradient = np.array([1.0, -2.0, 0.5])
    (layer,) = Planar(count=1).cut(mesh, (1, 2, 3))
    values = layer.interpolate(mesh.points @ gradient)
    np.testing.assert_allclose(values, layer.points @ gradient, atol=1e-12)
    np.testing.assert_allclose(layer.points @ layer.plane.frame[2], layer.plane.height, atol=1e-12)


def test_patches_are_kept_on_the_boundary() -> None:
    mesh = box_mesh((3.0, 2.0, 1.0), (3, 2, 1))
    facets = mesh.boundary
    wall = facets[(mesh.points[facets][:, :, 0] > 3.0 - 1e-9).all(axis=1)]
    (layer,) = Planar(count=1).cut(mesh.with_patches({"wall": wall}))
    edges = layer.points[layer.patches["wall"]]
    np.testing.assert_allclose(edges[:, :, 0], 3.0)
    assert np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).sum() == pytest.approx(2.0)


def test_material_lies_left_of_the_loops() -> None:
    mesh = box_mesh((3.0, 3.0, 1.0), (3, 3, 1))
    centre = mesh.points[mesh.cells].mean(axis=1)
    hole = (np.abs(centre[:, :2] - 1.5) < 0.5).all(axis=1)
    (layer,) = Planar(count=1).cut(TetMesh(mesh.points, mesh.cells[~hole]))
    assert len(layer.loops) == 2
    assert layer.plane.polygon.area == pytest.approx(8.0)
    assert len(layer.plane.polygon.interiors) == 1


def test_frames_are_right_handed_and_y_is_the_tool_frame_of_the_paper() -> None:
    for direction in ((0, 0, 1), (0, 1, 0), (1, 0, 0), (1, -2, 0.3)):
        frame = plane_frame(direction)
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(frame) == pytest.approx(1.0)
    np.testing.assert_allclose(plane_frame((0, 1, 0)), [[1, 0, 0], [0, 0, -1], [0, 1, 0]])


def test_heights_lie_at_the_middle_of_slabs() -> None:
    np.testing.assert_allclose(slice_heights(0.0, 10.0, count=4), [1.25, 3.75, 6.25, 8.75])
    np.testing.assert_allclose(
        slice_heights(1.0, 2.0, thickness=0.25), [1.125, 1.375, 1.625, 1.875]
    )


@given(size=st.floats(1.0, 100.0), share=st.floats(0.01, 1.0))
@example(size=2.00001, share=1.0)
def test_slabs_of_a_thickness_lie_in_the_part_and_leave_no_room_for_one_more(
    size: float, share: float
) -> None:
    """The last layer lay up to half a slab nearer to the top, where its strand stood out."""
    thickness = share * size
    heights = slice_heights(2.0, 2.0 + size, thickness=thickness)
    assert heights[0] == pytest.approx(2.0 + 0.5 * thickness)
    np.testing.assert_allclose(np.diff(heights), thickness)
    above = 2.0 + size - heights[-1]
    assert 0.5 * thickness * (1.0 - 1e-6) <= above < 1.5 * thickness * (1.0 + 1e-6)


def test_the_rest_above_slabs_of_a_thickness_belongs_to_the_last_layer() -> None:
    layers = Planar(thickness=0.4).cut(box_mesh((3.0, 2.0, 1.0), (3, 2, 1)))
    assert [layer.plane.height for layer in layers] == pytest.approx([0.2, 0.6])
    assert [layer.thickness for layer in layers] == pytest.approx([0.4, 0.6])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"heights": [3.0]}, "outside the part"),
        ({"heights": [0.5, 1.0]}, "1 mm lies on the top of the part"),
        ({"count": 0}, "at least 1"),
        ({"thickness": 5.0}, "at most the part's height"),
        ({"count": 2, "heights": [0.5]}, "one of count, thickness and heights; got count and"),
        ({"heights": [float("nan")]}, "finite"),
    ],
)
def test_bad_slices_are_refused(arguments: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Planar(**arguments).cut(box_mesh((1.0, 1.0, 1.0), (1, 1, 1)))


def test_a_build_direction_has_a_direction() -> None:
    with pytest.raises(InputError, match="build direction"):
        Planar(count=1).cut(box_mesh((1.0, 1.0, 1.0), (1, 1, 1)), (0, 0, 0))


def test_twelve_layers_where_nothing_is_asked_for() -> None:
    assert Planar() == Planar(count=12)


def test_a_height_is_given_once() -> None:
    with pytest.raises(InputError, match=r"each layer height must be given once; got 1 mm more"):
        Planar(heights=(1.0, 1.0, 0.5))


def test_layers_are_no_nearer_than_their_fibre_is_high() -> None:
    mesh = box_mesh((60.0, 24.0, 4.0), (6, 3, 2))
    stress = GivenStress(
        mesh, np.zeros((len(mesh.cells), 3, 3)), np.zeros((len(mesh.points), 3, 3))
    )
    machine = Machine(fibre_height=0.1, filament_area=0.1, fibre_width=1.0)
    assert len(Planar(count=40)(stress, (0, 0, 1), machine)) == 40
    with pytest.raises(InputError, match=r"at least 0.1 mm apart.*got 0.08 mm"):
        Planar(count=50)(stress, (0, 0, 1), machine)
    # the volume of a strand needs more height than the machine claims
    with pytest.raises(InputError, match=r"at least 0.2 mm apart"):
        Planar(count=40)(stress, (0, 0, 1), replace(machine, filament_area=0.2))
    layers = Planar(count=50).cut(mesh)
    with pytest.raises(InputError, match="use fewer layers"):
        plan(create("zigzag"), layers, stress, machine)


def test_far_too_many_layers_are_refused_before_any_is_cut(monkeypatch) -> None:
    mesh = box_mesh((20.0, 20.0, 5.0), (4, 4, 2))
    stress = GivenStress(
        mesh, np.zeros((len(mesh.cells), 3, 3)), np.zeros((len(mesh.points), 3, 3))
    )
    monkeypatch.setattr("ccfem.slicing.slicers.planar._cut_plane", None)
    with pytest.raises(InputError, match=r"got 5e-05 mm between those at .* use fewer layers"):
        Planar(count=100_000)(stress, (0.0, 0.0, 1.0), Machine())
