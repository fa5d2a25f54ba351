"""The evaluator on the published paths of Chen et al. 2021, against the figures stated for them."""

import os

import numpy as np
import pytest

pytestmark = pytest.mark.skipif(
    "CCFEM_CHEN2021" not in os.environ, reason="CCFEM_CHEN2021 does not name the authors' folder"
)

TOLERANCE = {
    # Stated to a millimetre; the median 167.45 as 168: next to it lie 167.50 and 168.05.
    "length": 0.6,
    # Both take 1 mm samples of the nodal-averaged stress; how the wall facets of the holes are
    # told into halves moves these shares by up to 0.005, the angle by 0.1 degrees.
    "aligned": 0.006,
    "angle": 0.2,
    "efficiency": 0.004,
    # Stated from point to point 0.2 mm apart, here from point to strand, which is never more.
    "spacing": 0.03,
    "spacing_below": 0.004,
    # Stated from a coarser grid; the area itself agrees with shapely's to 0.0002 (below).
    "coverage": 0.003,
    "coverage_stress": 0.012,
    "coverage_quartile": 0.012,
    "coverage_top": 0.02,
}


@pytest.fixture(scope="module")
def authors():
    from ccfem.papers.chen_2021 import authors

    return authors


@pytest.fixture(scope="module")
def evaluations(authors):
    return {name: authors.evaluate_published(name) for name in authors.STATED}


@pytest.fixture(scope="module")
def totals(evaluations):
    return {name: each.total for name, each in evaluations.items()}


def test_lengths_are_those_of_table_2(authors, evaluations):
    for name, stated in authors.TABLE_2.items():
        length = evaluations[name].values["fibre_length"][:12].sum()
        # The files, rounded to six digits a coordinate, are 5 mm longer and 2 mm shorter.
        assert length == pytest.approx(1000.0 * stated, abs=6.0)


def test_indices_are_those_stated(authors, totals):
    for name, stated in authors.STATED.items():
        for index, value in stated.items():
            if index.startswith("curvature"):
                continue
            key = max((k for k in TOLERANCE if index.startswith(k)), key=len)
            assert totals[name][index] == pytest.approx(value, abs=TOLERANCE[key]), (name, index)


def test_curvature_at_the_waypoints_is_that_stated(authors):
    for name, stated in authors.STATED.items():
        curvature = authors.waypoint_curvature(name)
        found = np.percentile(curvature, [50, 80, 95, 100])
        expected = [stated[f"curvature_{k}"] for k in ("50", "80", "95", "max")]
        # Stated to two figures.
        assert found == pytest.approx(np.array(expected), rel=0.06)
        assert (curvature < 0.26).mean() == pytest.approx(stated["curvature_ok"], abs=5e-4)


def test_curvature_by_arc_length_is_near_that_at_the_waypoints(authors, totals):
    # A corner at one waypoint lies between two points of the resampled path and turns it at both,
    # by half as much at each: more samples above 0.26 1/mm, most where there are many corners.
    for name, stated in authors.STATED.items():
        total = totals[name]
        assert total["curvature_ok"] == pytest.approx(stated["curvature_ok"], abs=0.016)
        assert total["curvature_80"] == pytest.approx(stated["curvature_80"], rel=0.06)
        assert total["curvature_95"] == pytest.approx(stated["curvature_95"], rel=0.1)


def test_coverage_is_the_area_of_the_buffered_paths(authors, totals):
    import shapely

    _, layers, _ = authors.solved_loop()
    paths = authors.published_paths("ours")
    covered = area = 0.0
    for layer in layers:
        lines = [shapely.LineString(layer.plane.project(p)) for p in paths.on_layer(layer.index)]
        band = shapely.union_all([line.buffer(0.5) for line in lines])
        covered += band.intersection(layer.plane.polygon).area
        area += layer.plane.polygon.area
    assert totals["ours"]["coverage"] == pytest.approx(covered / area, abs=2e-4)


def test_crossings_and_kinks_are_those_stated(authors, totals):
    from ccfem.judging.evaluation.indices.crossings import find_crossings
    from ccfem.judging.evaluation.layer_paths import plane_paths

    _, layers, _ = authors.solved_loop()
    paths = authors.published_paths("ours")
    pairs, own = set(), set()
    for layer in layers:
        plane = plane_paths(paths, layer)
        found = find_crossings(plane.points, plane.offsets, plane.closed)
        line = np.searchsorted(plane.offsets, found, side="right") - 1
        for a, b in line.tolist():
            (own if a == b else pairs).add((layer.index, a, b))
    # "3 crossing pairs and 2 self-intersections in Loop's 20 layers"; 8 and 3 places.
    assert (len(pairs), len(own)) == (3, 2)
    assert (totals["ours"]["crossings"], totals["ours"]["self_crossings"]) == (8.0, 3.0)
    # "1.1-1.7 % of turns > 90 degrees".
    waypoints = len(paths.points) - 2 * len(paths)
    turns = totals["ours"]["turns_90"] * totals["ours"]["fibre_length"] / 1000.0
    assert 0.011 <= turns / waypoints <= 0.017


def test_published_paths_stay_in_the_part_and_are_long_enough(totals):
    for total in totals.values():
        assert total["outside_length"] == 0.0
        assert total["outside_depth"] == 0.0
    assert totals["ours"]["long_enough_count"] == 1.0
