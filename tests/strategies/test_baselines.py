import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.machine import Machine
from ccfem.slicing.layers.layer import Layer, Plane
from ccfem.strategies.concentric import Concentric
from ccfem.strategies.contour_zigzag import ContourZigzag
from ccfem.strategies.zigzag import Zigzag

MACHINE = Machine()
BASELINES = [Concentric(), Concentric(joined=False), Zigzag(), ContourZigzag()]


def layer_of(section, index=0):
    """A layer that knows its border only: the baselines look at nothing else."""
    points, loops = [], []
    for part in shapely.get_parts(section):
        part = shapely.geometry.polygon.orient(part)
        for ring in (part.exterior, *part.interiors):
            loops.append(len(points) + np.arange(len(ring.coords) - 1))
            points += ring.coords[:-1]
    plane = np.array(points).reshape(-1, 2)
    n = len(plane)
    return Layer(
        points=np.column_stack([plane, np.full(n, 3.0)]),
        triangles=np.zeros((0, 3)),
        cell=np.zeros(0),
        nodes=np.zeros((n, 2)),
        weights=np.zeros(n),
        loops=tuple(loops),
        flat=Plane(np.eye(3), 3.0),
        index=index,
        thickness=1.0,
    )


def annulus(inner=20.0, outer=40.0):
    centre = shapely.Point(0.0, 0.0)
    return centre.buffer(outer, quad_segs=90).difference(centre.buffer(inner, quad_segs=90))


def plate_with_hole():
    return shapely.box(-60, -18, 60, 18).difference(shapely.Point(0, 0).buffer(6, quad_segs=32))


def in_plane(paths):
    return [path[:, :2] for path in paths]


def curves(paths):
    return shapely.multilinestrings([shapely.linestrings(line) for line in in_plane(paths)])


@pytest.mark.parametrize("strategy", BASELINES, ids=str)
@pytest.mark.parametrize("section", [annulus(), plate_with_hole()], ids=["annulus", "plate"])
def test_paths_are_half_a_width_inside_and_simple(strategy, section):
    layer = layer_of(section, index=1)
    paths = strategy(layer, None, MACHINE)
    assert len(paths) > 0
    assert (paths.layer == 1).all()
    np.testing.assert_array_equal(paths.points[:, 2], 3.0)
    laid = curves(paths)
    assert section.covers(laid)
    assert laid.distance(section.boundary) == pytest.approx(0.5, abs=0.01)
    assert laid.is_simple
    assert paths.lengths.min() >= MACHINE.minimum_length


@pytest.mark.parametrize("strategy", BASELINES, ids=str)
def test_full_fill_lays_area_over_width(strategy):
    """A strand of width W that fills a section has length area / W; gaps take a few percent."""
    section = annulus()
    length = strategy(layer_of(section), None, MACHINE).lengths.sum()
    assert 0.94 * section.area <= length <= 1.01 * section.area


@pytest.mark.parametrize("strategy", BASELINES, ids=str)
def test_section_thinner_than_a_fibre_has_no_path(strategy):
    thin = shapely.box(0.0, 0.0, 80.0, 0.9)
    assert len(strategy(layer_of(thin), None, MACHINE)) == 0


@pytest.mark.parametrize("strategy", BASELINES, ids=str)
def test_each_part_of_a_section_gets_its_paths(strategy):
    two = shapely.union(annulus(), shapely.box(50.0, -20.0, 90.0, 20.0))
    laid = curves(strategy(layer_of(two), None, MACHINE))
    for part in shapely.get_parts(two):
        inside = shapely.intersection(laid, part).length
        # Closed rings below 42 mm are dropped: the inner 10.5 mm of the square, 7 % of its area.
        assert inside >= 0.92 * part.area
    assert two.covers(laid)


@pytest.mark.parametrize("name", [Concentric, Zigzag, ContourZigzag])
@pytest.mark.parametrize("spacing", [0.5, float("nan"), float("inf")])
def test_spacing_below_one_width_is_refused(name, spacing):
    with pytest.raises(InputError, match="at least 1"):
        name(spacing=spacing)


def test_other_parameters_are_checked():
    with pytest.raises(InputError, match=r"concentric.rings must be at least 1; got 0"):
        Concentric(rings=0)
    with pytest.raises(InputError, match=r"contour_zigzag.contours must be at least 1; got 0"):
        ContourZigzag(contours=0)
    with pytest.raises(InputError, match="finite number of degrees"):
        Zigzag(angle=float("nan"))
    with pytest.raises(InputError, match="finite number of degrees"):
        ContourZigzag(turn=float("inf"))


def test_concentric_rings_are_closed_unless_joined():
    layer = layer_of(annulus())
    rings = Concentric(joined=False)(layer, None, MACHINE)
    assert rings.closed.all()
    assert len(rings) == 20
    radii = np.sort([np.hypot(*line[0]) for line in in_plane(rings)])
    np.testing.assert_allclose(radii, 20.5 + np.arange(20.0), atol=0.02)
    strands = Concentric()(layer, None, MACHINE)
    assert len(strands) == 2
    assert not strands.closed.any()


def test_concentric_rings_can_be_few_and_start_where_wanted():
    paths = Concentric(rings=3, start=(0.0, 100.0))(layer_of(annulus()), None, MACHINE)
    outer, inner = in_plane(paths)
    np.testing.assert_allclose(outer[0], [0.0, 39.5], atol=0.02)
    np.testing.assert_allclose(inner[0], [0.0, 20.5], atol=0.02)
    np.testing.assert_allclose(
        [np.hypot(*outer[-1]), np.hypot(*inner[-1])], [37.5, 22.5], atol=0.02
    )


def test_joining_keeps_small_rings_that_are_too_short_alone():
    """The 0.5 mm ring round a hole of 10.9 mm is 37 mm long, below the cutter's 42 mm."""
    around_hole = shapely.box(-40, -40, 40, 40).difference(shapely.Point(0, 0).buffer(5.45))
    near = shapely.Point(0, 0).buffer(6.2)
    lone = Concentric(joined=False)(layer_of(around_hole), None, MACHINE)
    joined = Concentric()(layer_of(around_hole), None, MACHINE)
    assert curves(lone).intersection(near).length == 0.0
    assert curves(joined).intersection(near).length > 30.0


def test_zigzag_turns_from_layer_to_layer():
    for index, expected in ((0, 45.0), (1, 135.0), (2, 45.0)):
        paths = Zigzag()(layer_of(annulus(), index), None, MACHINE)
        step = np.concatenate([np.diff(line, axis=0) for line in in_plane(paths)])
        long = np.hypot(*step.T) > 5.0
        angle = np.degrees(np.arctan2(step[long, 1], step[long, 0])) % 180.0
        np.testing.assert_allclose(angle, expected, atol=1e-6)
    fourth = Zigzag(angle=0.0, turn=45.0)(layer_of(annulus(), 3), None, MACHINE)
    step = np.concatenate([np.diff(line, axis=0) for line in in_plane(fourth)])
    long = np.hypot(*step.T) > 5.0
    np.testing.assert_allclose(
        np.degrees(np.arctan2(step[long, 1], step[long, 0])) % 180.0, 135.0, atol=1e-6
    )


def test_zigzag_length_follows_the_spacing():
    layer = layer_of(plate_with_hole())
    full = Zigzag()(layer, None, MACHINE).lengths.sum()
    half = Zigzag(spacing=2.0)(layer, None, MACHINE).lengths.sum()
    assert half == pytest.approx(0.5 * full, rel=0.05)


def test_contours_and_zigzag_keep_their_distance():
    layer = layer_of(plate_with_hole())
    paths = in_plane(ContourZigzag(spacing=2.0)(layer, None, MACHINE))
    contours = in_plane(Concentric(rings=2)(layer, None, MACHINE))
    for contour, path in zip(contours, paths, strict=False):
        np.testing.assert_array_equal(contour, path)
    zigzag = [shapely.linestrings(line) for line in paths[len(contours) :]]
    gap = shapely.distance(
        shapely.multilinestrings([shapely.linestrings(c) for c in contours]),
        shapely.multilinestrings(zigzag),
    )
    assert 0.98 <= gap <= 1.05


def test_a_wider_fibre_scales_everything():
    """Part, width and minimum length twice as large: the same paths, twice as large."""
    small, large = (
        layer_of(plate_with_hole()),
        layer_of(shapely.affinity.scale(plate_with_hole(), 2, 2, origin=(0, 0))),
    )
    wide = Machine(fibre_width=2.0, minimum_length=84.0)
    for strategy in BASELINES:
        one, two = strategy(small, None, MACHINE), strategy(large, None, wide)
        np.testing.assert_allclose(two.points[:, :2], 2.0 * one.points[:, :2], atol=1e-6)
