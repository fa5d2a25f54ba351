"""The four strategies with mode 'raster', on sections that are easy and on ones that are not."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import section_layer
import shapely
from shapely import affinity

from ccfem.base.errors import InputError
from ccfem.machine import Machine
from ccfem.paths.raster.patterns import GUIDE
from ccfem.slicing.layers import LayerStress
from ccfem.strategies.concentric import Concentric
from ccfem.strategies.grid import Grid
from ccfem.strategies.mat import Mat
from ccfem.strategies.mps import Mps

MACHINE = Machine(fibre_width=0.8, minimum_length=0.0)
PATTERNS = {
    "concentric": Concentric(joined=False, mode="raster"),
    "grid": Grid(mode="raster"),
    "diagonals": Grid(lines="paper", mode="raster"),
    "rows": Grid(angle=0.0, mode="raster"),
    "mat": Mat(mode="raster"),
    "mps": Mps(mode="raster"),
}
SECTIONS = {
    "plate": shapely.box(0, 0, 48, 20).difference(shapely.Point(24, 10).buffer(4)),
    "thin": shapely.box(0, 0, 40, 4),
    "disc": shapely.Point(0, 0).buffer(12),
    "ring": shapely.Point(3, 1).buffer(16).difference(shapely.Point(3, 1).buffer(8)),
    "hole at the border": shapely.box(0, 0, 40, 24).difference(shapely.Point(20, 18).buffer(4.9)),
    "two parts": shapely.MultiPolygon([shapely.box(0, 0, 20, 16), shapely.box(20.3, 3, 40, 19)]),
    "slit": shapely.box(0, 0, 40, 20).difference(shapely.box(19.9, 4.0, 20.1, 21.0)),
    "turned": affinity.rotate(shapely.box(0, 0, 40, 12), 27.0),
    "sliver": shapely.box(0, 0, 30, 0.3),
}


@cache
def layer_of(name):
    return section_layer.layer_of(SECTIONS[name], 2.0)


def pulled(layer, angle=0.0):
    """Uniform tension at an angle to the first axis."""
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    nodal = np.broadcast_to(np.outer(along, along), (len(layer.points), 3, 3))
    return LayerStress(layer, np.zeros((0, 3, 3)), nodal)


@cache
def planned(name, section):
    layer = layer_of(section)
    return PATTERNS[name].raster(layer, pulled(layer), MACHINE)


def paths_of(name, section):
    layer = layer_of(section)
    return PATTERNS[name](layer, pulled(layer), MACHINE)


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("name", PATTERNS)
def test_every_pixel_is_on_one_path_or_isolated(name, section):
    plan = planned(name, section)
    mask, paths = plan.raster.mask, plan.paths
    visits = np.zeros(mask.shape, dtype=int)
    np.add.at(visits, tuple(paths.pixels.T), 1)
    np.testing.assert_array_equal(visits + paths.isolated, mask)
    assert paths.isolated.sum() <= 0.05 * mask.sum()
    if section != "sliver":
        assert len(paths) > 0


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("name", PATTERNS)
def test_paths_stay_inside_the_layer(name, section):
    layer, paths = layer_of(section), paths_of(name, section)
    assert len(paths) == len(planned(name, section).paths)
    for path in paths:
        assert layer.plane.polygon.covers(shapely.LineString(path[:, :2]))
    # Ends of closed paths meet; others have two ends.
    for path, closed in zip(paths, paths.closed, strict=True):
        assert np.array_equal(path[0], path[-1]) == closed


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("name", PATTERNS)
def test_paths_do_not_cross(name, section):
    steps = [np.stack([p[:-1, :2], p[1:, :2]], axis=1) for p in paths_of(name, section)]
    pieces = shapely.linestrings(np.concatenate(steps))
    assert shapely.STRtree(pieces).query(pieces, predicate="crosses").shape[1] == 0


@pytest.mark.parametrize("name", PATTERNS)
def test_same_input_gives_the_same_paths(name):
    one, other = paths_of(name, "plate"), paths_of(name, "plate")
    np.testing.assert_array_equal(one.points, other.points)


def test_size_of_the_load_does_not_matter():
    layer = layer_of("plate")
    stress = pulled(layer, 0.3)
    strong = LayerStress(layer, stress.cell, 1e4 * stress.nodal)
    one, other = (PATTERNS["mps"](layer, of, MACHINE) for of in (stress, strong))
    np.testing.assert_array_equal(one.points, other.points)


def test_sections_thinner_than_a_pixel_have_no_path():
    thin = replace(MACHINE, fibre_width=1.0)
    layer = layer_of("sliver")
    for pattern in PATTERNS.values():
        # The pixels are centred on the strip: their centres do lie in it.
        assert len(pattern(layer, pulled(layer), thin)) == 1
        nothing = replace(layer, points=layer.points[:0], triangles=layer.triangles[:0], loops=())
        assert len(pattern(nothing, pulled(nothing), thin)) == 0


def test_rows_are_those_of_the_hand_count():
    # 48 x 20 mm are 60 x 25 pixels: three closed shells, and 19 rows of 54 pixels inside. The hole
    # of 5 pixels has its middle between two columns: at +-0.5 pixels across, the rows 5, 6 and 7
    # pixels off are its shells, and rows 8 and 9 run through.
    layer = layer_of("thin")
    plan = planned("rows", "plate")
    assert plan.raster.mask[1:-1, 1:-1].shape == (25, 60)
    lengths = paths_of("rows", "plate").lengths
    closed = paths_of("rows", "plate").closed
    outer = 2 * 0.8 * (59 + 24) - 8 * 0.8 * np.arange(3)
    np.testing.assert_allclose(np.sort(lengths[closed])[::-1][:3], outer)
    assert np.isclose(lengths[~closed], 53 * 0.8).sum() == 4
    # 40 x 4 mm are 50 x 5 pixels: two rings, and a line of 46 pixels in the middle row.
    lengths = PATTERNS["mat"](layer, pulled(layer), MACHINE).lengths
    np.testing.assert_allclose(np.sort(lengths), 0.8 * np.array([45, 2 * (47 + 2), 2 * (49 + 4)]))


def test_every_diagonal_lays_sqrt_2_of_the_length_inside():
    # Addendum A6: each pixel inside the shells stands for 1.41 pixels of path, less the ends.
    plan = planned("diagonals", "turned")
    inside = plan.regions.domain == 2
    chains = [
        c
        for c, k in zip(plan.chains, plan.paths.offsets[:-1], strict=True)
        if inside[tuple(plan.paths.pixels[k])]
    ]
    steps = sum(len(chain) - 1 for chain in chains)
    length = sum(np.linalg.norm(np.diff(c, axis=0), axis=1).sum() for c in chains)
    assert length == pytest.approx(0.8 * np.sqrt(2.0) * steps)
    assert steps + len(chains) + (plan.paths.isolated & inside).sum() == inside.sum()


@pytest.mark.parametrize("name", ["concentric", "grid", "rows", "mat", "mps"])
@pytest.mark.parametrize("section", ["plate", "ring", "turned", "disc"])
def test_beads_fill_the_section(name, section):
    # Length times width is the area: conservation, to what corners and isolated pixels cost.
    area = SECTIONS[section].area
    assert paths_of(name, section).lengths.sum() * 0.8 == pytest.approx(area, rel=0.08)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 90.0])
def test_mps_follows_the_pull(degrees):
    layer = layer_of("disc")
    angle = np.radians(degrees)
    plan = PATTERNS["mps"].raster(layer, pulled(layer, angle), MACHINE)
    within = plan.regions.domain == GUIDE
    along = np.array([np.cos(angle), np.sin(angle)])
    for line, start in zip(plan.chains, plan.paths.offsets[:-1], strict=True):
        if within[tuple(plan.paths.pixels[start])] and len(line) > 15:
            chord = line[-1] - line[0]
            across = np.abs(along[0] * chord[1] - along[1] * chord[0])
            assert across < 0.25 * np.linalg.norm(chord) + 1.6


def test_seeds_of_mps():
    layer = layer_of("plate")
    points = replace(PATTERNS["mps"], seeds=((5.0, 4.0), (100.0, 100.0)))
    plan = points.raster(layer, pulled(layer), MACHINE)
    rows = np.unique(np.nonzero(plan.regions.domain == GUIDE)[0])
    assert len(rows) == 19
    ends = replace(PATTERNS["mps"], seeds="ends")
    edge = np.flatnonzero(layer.points[:, 0] < 1e-9)
    held = replace(layer, patches={"load": np.stack([edge[:-1], edge[1:]], axis=1)})
    stress = pulled(held)
    stress = replace(stress, held_or_loaded=("load",))
    plan = ends.raster(held, stress, MACHINE)
    # One guide in the middle row: rings mirror each other about it, as far as the hole.
    number = np.where(plan.regions.domain == GUIDE, plan.regions.number, -1)[:, 5:20]
    np.testing.assert_array_equal(number, number[::-1])


def test_spacing_is_the_pixel():
    layer = layer_of("plate")
    wide = replace(PATTERNS["rows"], spacing=2.0).raster(layer, pulled(layer), MACHINE)
    assert wide.raster.pixel == 1.6


def test_shortest_paths_are_dropped():
    layer = layer_of("plate")
    least = replace(PATTERNS["rows"], minimum_length=30.0)(layer, pulled(layer), MACHINE)
    assert 0 < len(least) < len(paths_of("rows", "plate"))
    assert least.lengths.min() >= 30.0


def test_bad_parameters():
    for kind in (Grid, Mat, Mps):
        with pytest.raises(InputError, match="'polyline', 'raster'"):
            kind(mode="bitmap")
    with pytest.raises(InputError, match="'polyline', 'raster'"):
        Concentric(joined=False, mode="bitmap")
    with pytest.raises(InputError, match=r"concentric\.joined"):
        Concentric(mode="raster")
    with pytest.raises(InputError, match="families"):
        Grid(families="both", mode="raster")
