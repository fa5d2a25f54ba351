"""First in, spiral out: one strand a region, that covers it, without crossings or long steps."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.machine import Machine
from ccfem.papers.kipping_2023.contents import SHAPES
from ccfem.paths.fields.chart import chart_of
from ccfem.slicing.slicers import Planar
from ccfem.strategies import create
from ccfem.strategies.fiso import contour_trees, first_in_spiral_out

WIDTH = 0.9


def disc(x, y, radius):
    return shapely.Point(x, y).buffer(radius, quad_segs=24)


def laid(section, closest=0.0, radius=0.0, entry=False, width=WIDTH):
    start = np.array(section.exterior.coords[0])
    trees = contour_trees(section, width, start, closest, radius)
    lines = [
        line for tree in trees for line in first_in_spiral_out(tree, width, start, entry, radius)
    ]
    return np.array([shapely.linestrings(line) for line in lines])


def covered(lines, section):
    """Share of a section within 0.525 widths of the strands, as the paper's authors count."""
    bands = shapely.buffer(lines, 0.525 * WIDTH, cap_style="flat")
    return shapely.union_all(bands).intersection(section).area / section.area


def longest_step(line, section):
    """Longest way, in widths, between contours: what lies off all distances at which they lie.

    A step at right angles to contours a width apart is so long less twice the margin.
    """
    margin = 0.15 * WIDTH
    border = shapely.segmentize(section.boundary, 1.0)
    points = shapely.get_coordinates(shapely.segmentize(line, 0.05))
    off = shapely.distance(shapely.points(points), border) - 0.5 * WIDTH
    away = np.abs(off - WIDTH * np.round(off / WIDTH)) > margin
    size = np.append(np.linalg.norm(np.diff(points, axis=0), axis=1), 0.0)
    turns = np.concatenate([[0], np.cumsum(np.diff(away.astype(int)) != 0)])
    runs = np.bincount(turns[away], size[away], minlength=1)
    return float(runs.max() + 2.0 * margin) / WIDTH


@pytest.mark.parametrize("name", SHAPES)
def test_every_region_is_one_strand_that_covers_it(name):
    section = SHAPES[name]
    (line,) = laid(section)
    assert line.is_simple
    assert section.contains(line)
    opened = section.buffer(-0.5 * WIDTH).buffer(0.5 * WIDTH)
    assert covered([line], section) >= 0.95
    assert covered([line], opened) >= 0.96
    # A strand a width wide that covers a section once is as long as the section over the width.
    assert line.length == pytest.approx(section.area / WIDTH, rel=0.05)
    if name not in ("star", "twelve holes"):  # whose sharp corners lie off the contours, smoothed
        assert longest_step(line, section) < 1.8


def test_the_strand_begins_in_the_middle_and_ends_at_the_border():
    section = SHAPES["rectangle"]
    (line,) = laid(section)
    first, last = line.boundary.geoms
    ends = sorted(end.distance(section.exterior) for end in (first, last))
    assert ends[0] == pytest.approx(0.5 * WIDTH, abs=0.01)
    assert ends[1] > 10.0 - 1.5 * WIDTH
    (line,) = laid(section, entry=True)
    assert line.is_simple
    for end in line.boundary.geoms:
        assert end.distance(section.exterior) == pytest.approx(0.5 * WIDTH, abs=0.01)


def test_a_narrow_neck_parts_two_regions():
    neck = [shapely.box(-20.0, -0.4, 20.0, 0.4), disc(-20.0, 0.0, 8.0), disc(20.0, 0.0, 8.0)]
    assert len(laid(shapely.union_all(neck))) == 2
    wide = [shapely.box(-20.0, -0.6, 20.0, 0.6), *neck[1:]]
    assert len(laid(shapely.union_all(wide))) == 1
    assert len(laid(shapely.union_all(wide), closest=0.5)) == 2
    assert len(laid(shapely.box(0.0, 0.0, 50.0, 0.8))) == 0


def test_strands_on_both_sides_of_a_ridge_keep_apart():
    """A ring 12 mm wide leaves 0.3 mm between its innermost contours; with `closest` they end."""
    for closest, shared in ((0.0, True), (1.0, False)):
        (line,) = laid(SHAPES["annulus"], closest=closest)
        area = line.buffer(0.49 * WIDTH, cap_style="flat").area
        assert (area < 0.97 * 0.98 * WIDTH * line.length) == shared


def test_a_radius_is_kept_and_costs_coverage():
    """Circles through three points 0.9 mm apart along the strand, as a bending test would see."""
    (sharp,), (line,) = (laid(SHAPES["rectangle"], closest=0.5, radius=r) for r in (0.0, 3.0))
    assert line.is_simple
    smallest = []
    for strand in (sharp, line):
        at = np.arange(0.0, strand.length, 0.45)
        points = shapely.get_coordinates(shapely.line_interpolate_point(strand, at))
        a, b, c = points[:-2], points[1:-1], points[2:]
        u, v, w = b - a, c - b, c - a
        twice = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
        sides = np.prod([np.linalg.norm(s, axis=1) for s in (u, v, w)], axis=0)
        smallest.append(float((sides / np.maximum(2.0 * twice, 1e-12)).min()))
    assert smallest[0] < 1.0
    assert smallest[1] > 0.8 * 3.0
    assert covered([line], SHAPES["rectangle"]) < covered([sharp], SHAPES["rectangle"]) - 0.1


@pytest.mark.parametrize("seed", range(4))
def test_odd_sections(seed):
    """Jagged outlines with holes: one strand a piece wider than it, inside, without a crossing."""
    random = np.random.default_rng(seed)
    count = int(random.integers(5, 30))
    angle, radius = np.sort(random.random(count)) * 2.0 * np.pi, random.uniform(8.0, 30.0, count)
    outline = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    section = shapely.Polygon(outline).buffer(0.0)
    holes = [disc(*random.uniform(-20.0, 20.0, 2), random.uniform(1.0, 5.0)) for _ in range(4)]
    for piece in shapely.get_parts(section.difference(shapely.union_all(holes))):
        inner = shapely.get_parts(piece.buffer(-0.5 * WIDTH, quad_segs=16))
        wanted = sum(part.exterior.length >= 2.2 * WIDTH for part in inner)
        for options in ({}, {"entry": True}):
            lines = laid(piece, **options)
            assert len(lines) == wanted
            assert shapely.is_simple(lines).all()
            assert shapely.contains(piece, lines).all()
            assert not shapely.crosses(lines[:, None], lines).any()


def test_a_bent_sheet_is_filled_as_the_flat_one():
    """A rectangle of 50 x 20 mm bent to a radius of 25 mm: the same length, on the surface."""
    flat = Planar(count=1).cut(box_mesh((50.0, 20.0, 1.0), (100, 4, 1)))[0]
    x, y, _ = flat.points.T
    bent = np.stack([25.0 * np.sin(x / 25.0), y, 25.0 * np.cos(x / 25.0)], axis=1)
    layer = replace(flat, points=bent, flat=None)
    chart = chart_of(layer)
    machine = Machine()
    (path,) = chart.lifted(create("fiso")(chart.flat, None, machine))
    assert np.hypot(path[:, 0], path[:, 2]) == pytest.approx(25.0, abs=0.02)
    length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    (same,) = laid(SHAPES["rectangle"], width=machine.fibre_width)
    assert length == pytest.approx(same.length, rel=0.01)


def test_a_way_in_leaves_no_room_for_ramps():
    with pytest.raises(InputError, match=r"set fiso.least_radius to 0, or fiso.entry to false"):
        create("fiso", {"entry": True, "least_radius": 2.0})


@pytest.mark.parametrize("radius", [0.0, 3.85])
def test_wide_turns_cost_the_middle_alone(radius):
    """A rectangle of 50 x 20 mm holds area / width of strand, less what its corners lose.

    A corner of radius r leaves (1 - pi/4) r^2 open in every contour; where contours are narrower
    than 2 r the strand ends, so that a strip of 2 r x (50 - 20 + 2 r) stays without.
    """
    layer = Planar(count=1).cut(box_mesh((50.0, 20.0, 1.0), (100, 4, 1)))[0]
    machine = Machine()
    paths = create("fiso", {"least_radius": radius})(layer, None, machine)
    middle = 2.0 * radius * (30.0 + 2.0 * radius)
    corners = (4.0 - np.pi) * radius**2
    least = (50.0 * 20.0 - middle - corners) / machine.fibre_width
    assert 0.9 * least < paths.lengths.sum() < 50.0 * 20.0 / machine.fibre_width
