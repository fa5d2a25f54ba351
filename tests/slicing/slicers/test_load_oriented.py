"""Layers square to the least principal stress, against stress fields whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity.stress_field import GivenStress
from ccfem.machine import Machine
from ccfem.slicing.guidance.height_field import height_field
from ccfem.slicing.guidance.normal_field import normal_field
from ccfem.slicing.guidance.stress_regions import StressRegions, stress_regions
from ccfem.slicing.layers.sublayers import layers_within
from ccfem.slicing.slicers import LoadOriented, create
from ccfem.slicing.slicers.load_oriented import across_layers, best_plane

UP = np.array([0.0, 0.0, 1.0])
SIZE = (24.0, 8.0, 6.0)


@pytest.fixture(scope="module")
def block():
    return box_mesh(SIZE, (24, 8, 6))


def tilted(degrees):
    """Axes of a stress that pulls along the first, with the last turned about y out of z."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def stress_of(axes, values=(10.0, 4.0, -3.0)):
    """Stress (..., 3, 3) with principal values along the rows of axes (..., 3, 3)."""
    return np.einsum("k,...ki,...kj->...ij", np.array(values), axes, axes)


def part_stress(mesh, of_points):
    centres = mesh.points[mesh.corners].mean(axis=1)
    return GivenStress(mesh, of_points(centres), of_points(mesh.points))


def everywhere(axes):
    return lambda points: np.broadcast_to(stress_of(axes), (len(points), 3, 3))


def bent(points):
    """Axes turned about y by up to 25 degrees either way along x."""
    return stress_of(np.stack([tilted(25.0 * (x / 12.0 - 1.0)) for x in points[:, 0]]))


def test_one_direction_gives_flat_layers_at_their_thickness(block):
    normal = tilted(20.0)[2]
    found = LoadOriented(thickness=0.4).slice(part_stress(block, everywhere(tilted(20.0))))
    heights = [layer.points @ normal for layer in found.layers]
    assert max(np.ptp(height) for height in heights) < 1e-6
    middles = np.sort([height.mean() for height in heights])
    assert np.diff(middles) == pytest.approx(0.4, abs=1e-6)
    # The block is 6 cos 20 + 24 sin 20 mm high along that direction; corners hold small pieces.
    wanted = (6.0 * np.cos(np.radians(20)) + 24.0 * np.sin(np.radians(20))) / 0.4
    assert wanted - 12 < len(middles) <= wanted
    assert found.across.angle == pytest.approx(0.0, abs=1e-4)
    # Across z acts 10 sin^2 20 - 3 cos^2 20 < 0: nothing.
    assert found.across.tension == found.across_build.tension == 0.0
    assert found.across_build.angle == pytest.approx(20.0, abs=1e-6)
    assert (found.inverted, found.field.blend) == (0.0, 0.0)


def test_layers_bend_with_the_stress_and_turn_with_the_part(block):
    found = LoadOriented(thickness=0.4).slice(part_stress(block, bent))
    assert found.across.angle < 3.0 < 10.0 < found.across_build.angle
    mean = [
        np.average(x.local_thickness[x.triangles].mean(1), weights=x.areas) for x in found.layers
    ]
    area = [layer.areas.sum() for layer in found.layers]
    assert np.average(mean, weights=area) == pytest.approx(0.4, rel=0.02)
    # Volume over area is the mean thickness, too: nothing is laid twice or left out.
    assert np.prod(SIZE) / np.sum(area) == pytest.approx(0.4, rel=0.05)
    turn = tilted(50.0) @ np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    mesh = replace(block, points=block.points @ turn.T)
    turned = LoadOriented(thickness=0.4).slice(
        part_stress(mesh, lambda points: turn @ bent(points @ turn) @ turn.T), tuple(turn @ UP)
    )
    assert len(turned.layers) == len(found.layers)
    middle = len(found.layers) // 2
    points = found.layers[middle].points @ turn.T
    assert KDTree(points).query(turned.layers[middle].points)[0].max() < 1e-6


def test_senses_are_those_of_the_lowest_energy():
    """Two regions of opposite sense, and what lies between: as a dense solve of its own has it."""
    block = box_mesh((24.0, 4.0, 4.0), (12, 2, 2))
    centres = block.points[block.corners].mean(axis=1)
    region = np.full(len(centres), -1)
    region[centres[:, 0] < 5.0], region[centres[:, 0] > 19.0] = 0, 1
    direction = np.zeros((len(centres), 3))
    direction[region == 0], direction[region == 1] = tilted(10.0)[2], -tilted(-10.0)[2]
    regions = StressRegions(region >= 0, region, direction, np.ones(len(centres)))
    found = normal_field(block, regions, UP)
    assert found.senses == (1, -1)
    one, other = block.neighbours.T
    shared = [np.intersect1d(*block.corners[[i, j]]) for i, j in zip(one, other, strict=True)]
    area = block.facet_areas(np.array(shared))[0]
    weight = area / np.linalg.norm(centres[one] - centres[other], axis=1)
    laplacian = np.zeros((len(centres), len(centres)))
    for i, j, w in zip(one, other, weight, strict=True):
        laplacian[[i, j], [i, j]] += w
        laplacian[[i, j], [j, i]] -= w
    free, held = region < 0, region >= 0
    given = direction * np.where(region == 1, -1.0, 1.0)[:, None]
    inner = laplacian[np.ix_(free, free)]
    given[free] = np.linalg.solve(inner, -laplacian[np.ix_(free, held)] @ given[held])
    given /= np.linalg.norm(given, axis=1)[:, None]
    np.testing.assert_allclose(found.direction, given, atol=1e-9)
    cosine = np.einsum("fd,fd->f", given[one], given[other])
    assert found.energy == pytest.approx(area @ (1.0 - cosine) ** 2)


def test_many_regions_find_the_senses_that_agree():
    """Twelve regions in a row of random sense: all alike in the end, without 2048 tries."""
    mesh = box_mesh((48.0, 2.0, 2.0), (48, 2, 2))
    centres = mesh.points[mesh.corners].mean(axis=1)
    region = np.where(centres[:, 0] % 4.0 < 2.0, centres[:, 0] // 4.0, -1).astype(int)
    sense = np.array([1, -1, -1, 1, -1, 1, 1, 1, -1, -1, 1, -1])
    direction = np.where(region[:, None] >= 0, sense[region][:, None] * UP, 0.0)
    regions = StressRegions(region >= 0, region, direction, np.ones(len(centres)))
    found = normal_field(mesh, regions, UP)
    assert found.senses == tuple(sense.tolist())
    assert found.energy == pytest.approx(0.0, abs=1e-12)


def test_regions_leave_out_what_has_no_direction(block):
    """Half of the block is pulled one way only: any direction across that is as good."""

    def half(points):
        plain = np.einsum("i,j->ij", [10.0, 0.0, 0.0], [1.0, 0.0, 0.0])
        both = np.where((points[:, 0] < 12.0)[:, None, None], stress_of(tilted(15.0)), plain)
        return both

    stress = part_stress(block, half)
    centres = block.points[block.corners].mean(axis=1)
    found = stress_regions(block, stress.stress, UP)
    assert found.critical.all()
    np.testing.assert_array_equal(found.region >= 0, centres[:, 0] < 12.0)
    inside = found.direction[found.region == 0]
    np.testing.assert_allclose(inside, np.broadcast_to(tilted(15.0)[2], inside.shape), atol=1e-9)
    assert (stress_regions(block, stress.stress, UP, gap=0.0).region >= 0).sum() > 3000
    with pytest.raises(InputError, match="lower share or gap"):
        stress_regions(block, -stress.stress * [[1.0, 0, 0], [0, 0, 0], [0, 0, 0]], UP)


def test_the_least_blend_leaves_no_cell_upside_down(block):
    """Directions that turn over along x: by 240 degrees from end to end."""
    centres = block.points[block.corners].mean(axis=1)
    angle = np.radians(10.0 * (centres[:, 0] - 12.0))
    direction = np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
    plain = height_field(block, direction, 0.0)
    assert (plain.gradient @ plain.up < 0.0).any()
    found = height_field(block, direction)
    assert found.blend > 0.1
    assert (found.gradient @ found.up >= 0.0).all()
    less = height_field(block, direction, found.blend - 0.1)
    assert (less.gradient @ less.up < 0.0).any()


def test_layers_are_put_in_and_left_out_by_their_distance(block):
    """A field along z that is four times as steep at one end of the block as at the other."""
    x, _, z = block.points.T
    values = z * (0.6 + 1.8 * x / 24.0)
    found = layers_within(block, values, 0.7, 0.25, 0.6, 0.2, 1.0)
    points = np.concatenate([layer.points for layer in found.layers])
    steep = np.hypot(0.6 + 1.8 * points[:, 0] / 24.0, 1.8 * points[:, 2] / 24.0)
    local = np.concatenate([layer.local_thickness for layer in found.layers])
    times = np.log2(0.7 / steep / local)
    np.testing.assert_allclose(times, np.round(times), atol=0.15)
    # Independent: the height to the layer below, at x near the ends and in the middle.
    for at in (2.0, 12.0, 22.0):
        heights = []
        for layer in found.layers:
            near = layer.points[np.abs(layer.points[:, 0] - at) < 0.8]
            if len(near):
                here = near[:, 2] * (0.6 + 1.8 * near[:, 0] / 24.0) / (0.6 + 1.8 * at / 24.0)
                heights.append(here.mean())
        gaps = np.diff(np.sort(heights))
        assert 0.24 < gaps.min() <= gaps.max() < 0.61
    # Layers in part of the block keep the names of its sides: all edges there, each once.
    assert any(len(layer.patches["x_min"]) == 0 for layer in found.layers)
    for layer in found.layers:
        sides = layer.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        sides, used = np.unique(np.sort(sides), axis=0, return_counts=True)
        for name, axis, at in (("x_min", 0, 0.0), ("x_max", 0, 24.0), ("y_min", 1, 0.0)):
            on = (used == 1) & (np.abs(layer.points[sides, axis] - at) < 1e-9).all(axis=1)
            assert set(map(tuple, np.sort(layer.patches[name]))) == set(map(tuple, sides[on]))


def test_tension_across_flat_layers_is_that_of_the_tensor(block):
    stress = np.broadcast_to(stress_of(tilted(30.0)), (len(block.cells), 3, 3))
    all_cells = np.ones(len(stress), dtype=bool)
    found = across_layers(stress, block.volumes, all_cells, np.array([3.0, 0.0, 0.0]))
    # The first axis lies at 30 degrees to x, the last at 60.
    assert found.tension == pytest.approx((10.0 * 0.75 - 3.0 * 0.25) / 10.0)
    assert found.angle == pytest.approx(60.0)
    best = best_plane(stress, block.volumes, all_cells)
    assert best @ stress[0] @ best <= 0.0


def test_what_cannot_be_is_said(block):
    with pytest.raises(InputError, match=r"thickest must be at least twice thinnest"):
        create("load_oriented", {"thinnest": 0.3})
    with pytest.raises(InputError, match=r"thickness must lie from 0.2 to 0.5 mm; got 0.7"):
        create("load_oriented", {"thickness": 0.7})

    def turning(points):
        return stress_of(np.stack([tilted(10.0 * (x - 12.0)) for x in points[:, 0]]))

    stress = part_stress(block, turning)
    with pytest.raises(InputError, match=r"upside down in .* raise load_oriented.blend"):
        create("load_oriented", {"blend": 0.0, "even": False})(stress, (0.0, 0.0, 1.0), Machine())
    layers = create("load_oriented")(stress, (0.0, 0.0, 1.0), Machine())
    assert len(layers) > 10


@pytest.mark.parametrize(
    ("values", "options", "said"),
    [
        ((0.0, 0.0, 0.0), {}, "give a load that pulls"),
        ((-1.0, -4.0, -9.0), {}, "give a load that pulls"),
        ((10.0, 0.0, 0.0), {}, "lower share or gap"),
        ((10.0, 4.0, -3.0), {"thickness": 40.0, "thickest": 80.0}, "give a smaller thickness"),
    ],
)
def test_degenerate_stress_is_refused_in_one_line(block, values, options, said):
    """Nothing, compression alone, a pull along one axis, a part thinner than its layers."""
    stress = part_stress(
        block,
        lambda points: np.broadcast_to(stress_of(tilted(20.0), values), (len(points), 3, 3)),
    )
    with pytest.raises(InputError, match=said) as refused:
        LoadOriented(**options).slice(stress)
    assert "\n" not in str(refused.value)


def test_specks_of_stress_are_no_region(block):
    centres = block.points[block.corners].mean(axis=1)
    near = np.argsort(np.linalg.norm(centres - centres[0], axis=1))[:6]
    given = np.zeros((len(centres), 3, 3))
    given[near] = stress_of(tilted(20.0))
    with pytest.raises(InputError, match="no region of critical stress has 10 cells"):
        stress_regions(block, given, UP, quantile=1.0)


def test_a_part_in_two_pieces_is_layered_in_both(block):
    """One piece is loaded, the other is not: its layers are flat."""
    count = len(block.points)
    points = np.concatenate([block.points, block.points + np.array([0.0, 20.0, 0.0])])
    mesh = replace(block, points=points, cells=np.concatenate([block.cells, block.cells + count]))

    def of(points):
        return np.where((points[:, 1] < 10.0)[:, None, None], stress_of(tilted(20.0)), 0.0)

    found = LoadOriented(thickness=0.4).slice(part_stress(mesh, of))
    other = mesh.points[mesh.corners].mean(axis=1)[:, 1] > 10.0
    np.testing.assert_allclose(
        found.field.gradient[other], UP + np.zeros((other.sum(), 3)), atol=1e-9
    )
    np.testing.assert_allclose(found.field.gradient[~other] @ tilted(20.0)[2], 1.0, atol=1e-9)


def test_layers_are_put_in_where_a_cell_is_higher_than_many_steps():
    """One cell 12 mm high: levels of 0.35 lie 0.7 mm apart, and one comes between each two."""
    mesh = box_mesh((6.0, 6.0, 12.0), (2, 2, 1))
    found = layers_within(mesh, 0.5 * mesh.points[:, 2], 0.35, 0.2, 0.5, 0.5, 1.0)
    heights = np.array([float(layer.points[:, 2].mean()) for layer in found.layers])
    np.testing.assert_allclose(np.diff(heights), 0.35, atol=1e-6)
    assert len(heights) >= 2 * 17 - 1
