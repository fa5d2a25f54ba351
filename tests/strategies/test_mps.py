from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import shapely
from section_layer import layer_of
from shapely import affinity

from ccfem.base.errors import InputError
from ccfem.cases import create_case
from ccfem.fem.elasticity import solve
from ccfem.judging.evaluation import evaluate
from ccfem.machine import Machine
from ccfem.paths.planning import plan as plan_part
from ccfem.slicing.layers import LayerStress
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create
from ccfem.strategies.concentric import Concentric
from ccfem.strategies.grid import Grid
from ccfem.strategies.mat import Mat
from ccfem.strategies.mps import Mps

MACHINE = Machine(fibre_width=0.8)
FILLED = Concentric(joined=False, filled=True, minimum_length=0.0)
PATTERNS = {
    "concentric": FILLED,
    "grid": Grid(minimum_length=0.0),
    "mat": Mat(minimum_length=0.0),
    "mps": Mps(minimum_length=0.0),
}
BAR = shapely.box(0, 0, 60, 20)
HOLE = shapely.Point(30, 10).buffer(3, quad_segs=16)


def stress_of(layer, tensor):
    """Stress in the plane, a function of points (n, 2) with values (n, 3): s11, s22, s12."""
    s11, s22, s12 = np.broadcast_to(tensor(layer.plane.points).T, (3, len(layer.points)))
    nodal = np.zeros((len(layer.points), 3, 3))
    nodal[:, 0, 0], nodal[:, 1, 1] = s11, s22
    nodal[:, 0, 1] = nodal[:, 1, 0] = s12
    return LayerStress(layer, np.zeros((0, 3, 3)), nodal)


def along_x(points):
    return np.array([1.0, 0.0, 0.0]) + 0.0 * points[:, :1]


def round_hole(points, centre=(30.0, 10.0), radius=3.0):
    """Kirsch: stress round a hole in an infinite plate under unit tension along x."""
    x, y = (points - centre).T
    angle = np.arctan2(y, x)
    q = np.minimum(radius / np.hypot(x, y), 1.0) ** 2
    c, s = np.cos(2 * angle), np.sin(2 * angle)
    radial = 0.5 * (1 - q) + 0.5 * (1 - 4 * q + 3 * q**2) * c
    hoop = 0.5 * (1 + q) - 0.5 * (1 + 3 * q**2) * c
    shear = -0.5 * (1 + 2 * q - 3 * q**2) * s
    mean, half = 0.5 * (radial + hoop), 0.5 * (radial - hoop)
    return np.stack(
        [mean + half * c - shear * s, mean - half * c + shear * s, half * s + shear * c], axis=1
    )


def plan(strategy, section, tensor=along_x):
    layer = layer_of(section)
    paths = strategy(layer, stress_of(layer, tensor), MACHINE)
    return [path[:, :2] for path in paths], layer.plane.polygon


def curves(lines):
    return shapely.multilinestrings([shapely.LineString(x) for x in lines])


def covered(lines, width=0.8):
    return shapely.union_all(shapely.buffer([shapely.linestrings(x) for x in lines], 0.5 * width))


def shares(lines, section, width=0.8):
    """Gaps and overlap over the area of the section."""
    length = sum(np.linalg.norm(np.diff(x, axis=0), axis=1).sum() for x in lines)
    gaps = section.difference(covered(lines)).area / section.area
    return gaps, length * width / section.area - 1.0 + gaps


def agreement(lines, section, tensor):
    """Mean of 1 - turn / 90 degrees between path and the larger principal stress, in percent."""
    low, high = np.array(section.bounds).reshape(2, 2)
    grid = np.stack(
        np.meshgrid(*(np.arange(a, b, 0.8) + 0.4 for a, b in zip(low, high, strict=True))), -1
    )
    points = grid.reshape(-1, 2)
    points = points[shapely.contains_xy(section, points)]
    sides = np.concatenate([np.stack([x[:-1], x[1:]], axis=1) for x in lines])
    tree = shapely.STRtree(shapely.linestrings(sides))
    at, side = tree.query_nearest(shapely.points(points), all_matches=False)
    way = sides[side, 1] - sides[side, 0]
    s11, s22, s12 = tensor(points[at]).T
    wanted = 0.5 * np.arctan2(s12, 0.5 * (s11 - s22)) + np.where(s11 + s22 < 0, 0.5 * np.pi, 0)
    turn = np.degrees(np.arctan2(way[:, 1], way[:, 0]) - wanted)
    return 100.0 * (1.0 - np.abs((turn + 90.0) % 180.0 - 90.0).mean() / 90.0)


# The plates of Plocher et al. 2022: one hole, and five.
ONE = shapely.box(-100.8, -18, 100.8, 18) - shapely.Point(0, 0).buffer(6, quad_segs=32)
FIVE = shapely.box(-18, -54, 18, 54) - shapely.union_all(
    [
        shapely.Point(x, y).buffer(4, quad_segs=32)
        for x, y in ((0, 0), (9, 30), (9, -30), (-9, 30), (-9, -30))
    ]
)


def kirsch(points):
    return round_hole(points, (0.0, 0.0), 6.0)


@pytest.mark.parametrize(
    ("name", "part"), [("concentric", ONE), ("concentric", FIVE), ("mat", ONE), ("mat", FIVE)]
)
def test_plates_with_holes_are_filled(name, part):
    lines, section = plan(PATTERNS[name], part)
    gaps, overlap = shares(lines, section)
    assert gaps < 0.02
    assert overlap < 0.016
    assert section.buffer(1e-6).covers(curves(lines))


def test_mps_fills_the_plate_along_the_stress():
    """Chain of Plocher et al. 2022, first plate: agreement 95 %, gaps 2 %, overlap 1.6 %."""
    lines, section = plan(PATTERNS["mps"], ONE, kirsch)
    gaps, overlap = shares(lines, section)
    assert gaps < 0.02
    assert overlap < 0.016
    assert section.buffer(1e-6).covers(curves(lines))
    assert agreement(lines, section, kirsch) > 95.0


@pytest.mark.parametrize("angle", [0.0, 45.0])
def test_grids_agree_with_the_stress_by_half(angle):
    """Both directions of a grid on a plate in tension: 53 to 57 %, shells included."""
    layer = layer_of(ONE)
    stress = stress_of(layer, kirsch)
    grid = Grid(angle=angle, minimum_length=0.0)
    found = []
    for index in (0, 1):
        paths = grid(replace(layer, index=index), stress, MACHINE)
        found.append(agreement([path[:, :2] for path in paths], layer.plane.polygon, kirsch))
    assert 53.0 < np.mean(found) < 57.0


def test_diagonals_of_the_paper_overlap_by_the_root_of_two():
    part = shapely.box(0, 0, 80, 80)
    lengths = {}
    for lines in ("printable", "paper"):
        found, _ = plan(Grid(shells=0, lines=lines, minimum_length=0.0), part)
        lengths[lines] = sum(np.linalg.norm(x[-1] - x[0]) for x in found)
    assert lengths["printable"] == pytest.approx(80 * 80 / 0.8, rel=0.01)
    assert lengths["paper"] / lengths["printable"] == pytest.approx(np.sqrt(2.0), rel=0.01)


def test_guides_are_streamlines():
    """Uniform tension at 30 degrees: all strands inside the shells are straight and parallel."""
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    lines, _ = plan(
        Mps(minimum_length=0.0),
        shapely.box(0, 0, 80, 50),
        lambda p: [c * c, s * s, c * s] + 0 * p[:, :1],
    )
    inner = [x for x in lines if not np.array_equal(x[0], x[-1])]
    assert len(inner) > 40
    for line in inner:
        steps = np.diff(line, axis=0)
        np.testing.assert_allclose(steps @ [-s, c], 0.0, atol=0.02)
    across = np.sort([line[0] @ [-s, c] for line in inner])
    np.testing.assert_allclose(np.diff(across), 0.8, atol=0.02)


def test_compression_is_followed_where_it_is_larger():
    def squeezed(points):
        return np.array([1.0, -3.0, 0.0]) + 0.0 * points[:, :1]

    lines, section = plan(PATTERNS["mps"], shapely.box(0, 0, 40, 40), squeezed)
    assert agreement(lines, section, squeezed) > 85.0


@pytest.mark.parametrize("name", PATTERNS)
@pytest.mark.parametrize("pixels", [2, 4, 6])
def test_thin_parts_are_all_shells(name, pixels):
    """Up to six strands across: all patterns are the same rings."""
    lines, section = plan(PATTERNS[name], shapely.box(0, 0, 50, 0.8 * pixels))
    shells, _ = plan(replace(FILLED, rings=3), shapely.box(0, 0, 50, 0.8 * pixels))
    assert len(lines) == len(shells) == pixels // 2
    for line, shell in zip(lines, shells, strict=True):
        np.testing.assert_allclose(line, shell)
    assert shares(lines, section)[0] < 0.02


def test_odd_thin_part_has_a_line_in_its_middle():
    for strategy in PATTERNS.values():
        lines, _ = plan(strategy, shapely.box(0, 0, 50, 0.8 * 3))
        ring, middle = lines
        np.testing.assert_allclose(middle[:, 1], 1.2, atol=1e-6)
        np.testing.assert_array_equal(ring[0], ring[-1])


@pytest.mark.parametrize("name", PATTERNS)
def test_hole_that_touches_the_shells(name):
    """A hole one strand off the side: its rings and those of the side merge."""
    near = shapely.box(0, 0, 60, 20) - shapely.Point(30, 3.9).buffer(3, quad_segs=16)
    lines, section = plan(PATTERNS[name], near)
    assert section.covers(curves(lines))
    gaps, overlap = shares(lines, section)
    assert gaps < 0.05
    assert overlap < 0.03


@pytest.mark.parametrize("name", PATTERNS)
def test_discs_and_rings(name):
    disc = shapely.Point(0, 0).buffer(12, quad_segs=24)
    ring = disc - shapely.Point(0, 0).buffer(5, quad_segs=24)
    for part in (disc, ring):
        lines, section = plan(PATTERNS[name], part)
        assert section.buffer(1e-6).covers(curves(lines))
        assert shares(lines, section)[0] < 0.06


def test_disc_has_no_medial_axis_so_mat_is_concentric():
    disc = shapely.Point(0, 0).buffer(12, quad_segs=24)
    mat, section = plan(PATTERNS["mat"], disc)
    rings, _ = plan(FILLED, disc)
    assert covered(mat).symmetric_difference(covered(rings)).area < 0.02 * section.area


def test_mat_of_a_ring_is_made_of_closed_paths():
    ring = shapely.Point(0, 0).buffer(20, quad_segs=48) - shapely.Point(0, 0).buffer(
        8, quad_segs=48
    )
    lines, _ = plan(PATTERNS["mat"], ring)
    long = [x for x in lines if len(x) > 20]
    assert len(long) >= 13
    assert all(np.array_equal(x[0], x[-1]) for x in long)


@pytest.mark.parametrize("name", PATTERNS)
def test_parts_of_a_slice_are_planned_each_by_itself(name):
    one = BAR - HOLE
    two = shapely.MultiPolygon([one, affinity.translate(one, 100.0, 0.0)])
    single, _ = plan(PATTERNS[name], one)
    both, section = plan(PATTERNS[name], two)
    assert section.covers(curves(both))
    alone = covered(single).area
    assert covered(both).area == pytest.approx(2.0 * alone, rel=0.01)


def test_symmetric_part_has_symmetric_paths():
    """The medial axis and its strands; width 24 fibres, even."""
    part = shapely.box(-30, -9.6, 30, 9.6) - affinity.translate(HOLE, -30, -10)
    lines, section = plan(PATTERNS["mat"], part)
    laid = covered(lines)
    for x, y in ((-1, 1), (1, -1)):
        mirrored = affinity.scale(laid, x, y, origin=(0, 0))
        assert laid.symmetric_difference(mirrored).area < 0.01 * section.area


def test_seeds_by_points_and_at_loads():
    layer = layer_of(BAR)
    nodes = np.flatnonzero(layer.points[:, 0] < 1e-9)
    nodes = nodes[np.argsort(layer.points[nodes, 1])]
    layer = replace(layer, patches={"left": np.stack([nodes[:-1], nodes[1:]], axis=1)})
    stress = replace(stress_of(layer, along_x), held_or_loaded=("left",))
    for seeds in ("ends", ((5.0, 10.0),), ((-3.0, 10.0),)):
        paths = Mps(seeds=seeds)(layer, stress, MACHINE)
        middle = [p for p in paths if abs(p[:, 1] - 10.0).max() < 0.5]
        assert len(middle) == 1
        assert np.ptp(middle[0][:, 0]) == pytest.approx(60 - 2 * 2.4, abs=0.1)


def test_without_a_direction_mps_is_concentric():
    lines, section = plan(PATTERNS["mps"], BAR, lambda p: np.array([1.0, 1.0, 0.0]) + 0 * p[:, :1])
    assert shares(lines, section)[0] < 0.02
    assert sum(np.array_equal(x[0], x[-1]) for x in lines) >= 12


@pytest.mark.parametrize(
    ("kind", "wrong", "message"),
    [
        (Mps, {"spacing": 0.5}, "spacing"),
        (Mps, {"shells": -1}, "shells"),
        (Mps, {"seeds": "corners"}, "seeds"),
        (Mps, {"closest": 0.2}, "closest"),
        (Mat, {"minimum_length": -1.0}, "minimum_length"),
        (Mat, {"spacing": 0.5}, "spacing"),
        (Grid, {"angle": np.nan}, "angle"),
        (Grid, {"families": "three"}, "families"),
        (Grid, {"lines": "every"}, "lines"),
        (Concentric, {"filled": True}, "joined"),
    ],
)
def test_parameters_are_checked(kind, wrong, message):
    with pytest.raises(InputError, match=message):
        kind(**wrong)


def round_and_round(points):
    """Tension along circles about the origin, as in a ring that is blown up."""
    x, y = points.T / np.hypot(*points.T)
    return np.column_stack([y * y, x * x, -x * y])


@pytest.mark.parametrize("outer", [16.0, 16.3, 16.6])
def test_streamlines_that_close_give_closed_strands(outer):
    origin = shapely.Point(0, 0)
    ring = origin.buffer(outer, quad_segs=48) - origin.buffer(6, quad_segs=48)
    lines, section = plan(PATTERNS["mps"], ring, round_and_round)
    closed = [np.array_equal(line[0], line[-1]) for line in lines]
    length = np.array([shapely.LineString(line).length for line in lines])
    assert length[closed].sum() > 0.9 * length.sum()
    assert agreement(lines, section, round_and_round) > 95.0
    assert shares(lines, section)[0] < 0.06


@pytest.mark.parametrize("name", PATTERNS)
def test_parts_thinner_than_a_strand_stay_empty(name):
    """A strip of half a strand, alone and beside a part that is wide enough."""
    strip = shapely.box(0, 0, 50, 0.4)
    assert plan(PATTERNS[name], strip)[0] == []
    both, _ = plan(PATTERNS[name], shapely.MultiPolygon([strip, affinity.translate(BAR, 0, 5)]))
    alone, _ = plan(PATTERNS[name], affinity.translate(BAR, 0, 5))
    assert covered(both).area == pytest.approx(covered(alone).area, rel=1e-3)


def test_mps_under_mirrored_tension_is_mirrored():
    """Nothing prefers a side: a symmetric part under a symmetric stress."""
    part = shapely.box(-30, -10, 30, 10) - shapely.Point(0, 0).buffer(3, quad_segs=16)
    lines, section = plan(PATTERNS["mps"], part, partial(round_hole, centre=(0.0, 0.0)))
    laid = covered(lines)
    mirrored = affinity.scale(laid, 1, -1, origin=(0, 0))
    assert laid.symmetric_difference(mirrored).area < 0.01 * section.area


@pytest.fixture(scope="module")
def loop():
    """A machine with wide fibre, the stress on the loop, and one layer."""
    case = create_case("loop", element_size=8.0)
    stress = solve(case.problem)["pull"]
    machine = replace(case.machine, fibre_width=2.4)  # fewer strands than of 1 mm
    return machine, stress, Planar(count=1).cut(case.problem.mesh, case.build)


@pytest.mark.parametrize("shells", [0, 1])
def test_guides_that_circle_a_hole_go_round_once(loop, shells):
    """Streamlines round the loop never quite close: of each turn but one no strand is laid."""
    machine, stress, layers = loop
    paths = plan_part(create("mps", {"shells": shells}), layers, stress, machine)
    total = evaluate(paths, layers, stress, machine).total
    assert total["spacing_below"] < 0.1
    assert total["on_fibre"] < 0.02


def test_halves_of_the_loop_get_the_same_fibre(loop):
    """Part and load are symmetric about x = 0; the mesh is not, nor is the place of a seed."""
    machine, stress, layers = loop
    points = np.concatenate(list(plan_part(create("mps"), layers, stress, machine)))
    lugs = points[np.abs(points[:, 1]) > 50.0]
    assert (lugs[:, 0] > 0.0).mean() == pytest.approx(0.5, abs=0.05)


def test_strands_too_short_to_be_cut_are_not_led_back():
    """A strip pulled across: strands of 16 mm, where the machine cuts 42, could only be folded."""
    strip = shapely.box(0.0, 0.0, 22.0, 60.0)
    lines, _ = plan(Mps(), strip, along_x)
    assert len(lines) == 3
    assert all(np.array_equal(x[0], x[-1]) for x in lines)  # the shells
