"""What the report draws: paths, angles, forces, fronts, citations."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.comparison.citations import METHODS, bibtex, cited, methods_of, sentence
from ccfem.comparison.report import charts
from ccfem.comparison.report.html_report import _coarser
from ccfem.comparison.report.layer_view import (
    DrawnPaths,
    _nearest,
    _paths,
    angle_on_layer,
    drawn_paths,
    in_layer,
)
from ccfem.comparison.report.packing import Rounded, pack, unpack
from ccfem.comparison.report.report_views import RunResults
from ccfem.comparison.runs import Run
from ccfem.judging.evaluation.strand_rules import BrokenRule, StrandVerdict
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import LayerStress
from ccfem.slicing.slicers import Planar, named as slicers
from ccfem.strategies import Zigzag, named

(LAYER,) = Planar(count=1).cut(box_mesh((80.0, 60.0, 4.0), (8, 6, 1)))


def test_thinned_paths_keep_corners_shape_and_curvature():
    """A square with sharp corners and a circle of radius 10 with 2000 points."""
    turn = np.linspace(0.0, 2.0 * np.pi, 2001)
    circle = np.stack([40.0 + 10.0 * np.cos(turn), 30.0 + 10.0 * np.sin(turn)], axis=1)
    circle[-1] = circle[0]
    square = np.array([[5.0, 5.0], [75.0, 5.0], [75.0, 55.0], [5.0, 55.0], [5.0, 5.0]])
    run = Run("rings", Zigzag(), Toolpaths.from_plane([square, circle], LAYER), None)
    found = drawn_paths(run, 1.5, 1.0)
    assert len(found.points) < 250
    plane = LAYER.plane.project(found.points)
    first = slice(found.offsets[0], found.offsets[1])
    for corner in square:
        assert np.linalg.norm(plane[first] - corner, axis=1).min() < 1e-9
    assert np.linalg.norm(np.diff(plane[first], axis=0), axis=1).max() <= 3.0 + 1e-9
    ring = plane[found.offsets[1] : found.offsets[2]]
    radius = np.linalg.norm(0.5 * (ring[1:] + ring[:-1]) - [40.0, 30.0], axis=1)
    assert radius.min() > 10.0 * np.cos(0.5 * 1.6 / 10.0)
    bend = found.curvature[found.offsets[1] : found.offsets[2] - 1]
    np.testing.assert_allclose(bend, 0.1, rtol=0.02)
    assert np.isnan(found.force).all()


def test_strands_that_break_a_rule_are_drawn_as_such():
    lines = [np.array([[5.0, y], [75.0, y]]) for y in (10.0, 20.0, 30.0)]
    rule = BrokenRule("folds", np.array([2, 0]), np.zeros((2, 3)), "2 of 3 strands fold")
    paths = Toolpaths.from_plane(lines, LAYER)
    run = Run("rows", Zigzag(), paths, None, strand_verdict=StrandVerdict((rule,)))
    drawn = drawn_paths(run, 1.5, 1.0)
    assert drawn.broken.tolist() == [True, False, True]
    none = (np.zeros((len(LAYER.triangles), 3, 3)), np.zeros((len(LAYER.points), 3, 3)))
    stress = LayerStress(LAYER, *none)
    scales = {"force": 1.0, "angle": 90.0, "curvature": 1.0}
    assert _paths(drawn, LAYER, stress, scales)["broken"].tolist() == [1, 0, 1]
    whole = replace(drawn, broken=np.zeros(3, dtype=bool))
    assert _paths(whole, LAYER, stress, scales)["broken"] is None


def test_angles_are_to_the_larger_stress():
    """Tension along 30 degrees: a line along x is 30 degrees off, one along y 60."""
    t = np.radians(30.0)
    tensor = np.zeros((3, 3))
    tensor[:2, :2] = 5.0 * np.outer([np.cos(t), np.sin(t)], [np.cos(t), np.sin(t)])
    count = len(LAYER.points)
    stress = LayerStress(
        LAYER,
        np.broadcast_to(tensor, (len(LAYER.triangles), 3, 3)),
        np.broadcast_to(tensor, (count, 3, 3)),
    )
    line = np.array([[10.0, 10.0], [30.0, 10.0], [30.0, 40.0], [30.0, 200.0]])
    found = angle_on_layer(line, stress)
    np.testing.assert_allclose(found[:2], [30.0, 60.0])
    assert np.isnan(found[2:]).all()  # outside, and the last point


def test_values_go_to_the_nearest_piece_of_the_same_path():
    line, arc = np.array([0, 0, 2]), np.array([1.0, 5.0, 1.0])
    found = _nearest(
        line, arc, np.array([10.0, 20.0, 30.0]), np.array([0, 0, 1, 2]), np.array([2.9, 3.1, 1, 9])
    )
    np.testing.assert_array_equal(found, [10.0, 20.0, np.nan, 30.0])


def test_a_front_is_what_nothing_beats():
    points = [tuple(p) for p in np.random.default_rng(3).integers(0, 20, (60, 2)).astype(float)]
    for better, sign in (("low", 1.0), ("high", -1.0)):
        beaten = {
            p for p in points for q in points
            if q != p and sign * q[0] <= sign * p[0] and q[1] >= p[1]
        }  # fmt: skip
        assert charts.front(points, better) == sorted(set(points) - beaten)


def test_a_large_part_is_drawn_coarser():
    side = np.linspace(0.0, 1.0, 130)
    points = np.stack([*np.meshgrid(side, side), np.zeros((130, 130))], axis=-1).reshape(-1, 3)
    k = np.arange(129 * 130).reshape(129, 130)[:, :-1].ravel()
    triangles = np.concatenate(
        [np.stack([k, k + 1, k + 130], 1), np.stack([k + 1, k + 131, k + 130], 1)]
    )
    kept, coarse, shade = _coarser(points, triangles, np.zeros(len(triangles), np.uint8), 2.0**0.5)
    assert len(coarse) == len(shade) <= 16_000
    a, b, c = np.moveaxis(points[kept][coarse], 1, 0)
    area = 0.5 * np.cross(b - a, c - a)[:, 2].sum()
    assert area == pytest.approx(1.0, rel=0.05)


def test_every_method_says_what_to_cite():
    assert set(named()) | set(slicers()) <= set(METHODS)
    known = set(re.findall(r"^@\w+\{(\w+),", bibtex(cited(METHODS)), flags=re.MULTILINE))
    assert known == {"ccfem", *(key for keys in METHODS.values() for key in keys)}
    assert cited(["zigzag", "mine"]) == ["ccfem"]
    changelog = Path(__file__).parents[2].joinpath("CHANGELOG.md").read_text(encoding="utf-8")
    released = re.search(r"^## \[(\d[\d.]*)\]", changelog, flags=re.MULTILINE)
    assert released
    assert f"version = {{{released[1]}}}" in bibtex(["ccfem"])
    assert sentence("chen_2021").endswith(
        "Additive Manufacturing 49 102470. 2021. doi:10.1016/j.addma.2021.102470."
    )


def test_the_record_names_the_methods():
    stack = {"strategies": [{"name": "a", "methods": ["pruned", "isocurve"]}], "slicer": "spatial"}
    solver = {"backend": "amg", "error": 0.1}
    assert methods_of({**stack, "solver": solver}) == [
        *("pruned", "isocurve", "spatial", "amg", "error")
    ]
    assert methods_of({"slicings": {"z": stack}}) == ["pruned", "isocurve", "spatial"]
    assert cited(methods_of(stack)) == ["ccfem", "chen_2021", "fang_2024"]


def test_a_curved_layer_is_drawn_as_rolled_off():
    """An arc of radius 25 round a cylinder becomes a straight line of its length."""
    radius = 25.0
    angle = (LAYER.points[:, 0] - 40.0) / radius
    bent = np.column_stack([radius * np.sin(angle), LAYER.points[:, 1], radius * np.cos(angle)])
    turn = np.linspace(-1.2, 1.2, 40)
    line = np.column_stack([radius * np.sin(turn), np.full(40, 30.0), radius * np.cos(turn)])
    curved = replace(LAYER, points=bent, flat=None)
    assert in_layer(np.zeros((0, 3)), curved).shape == (0, 2)  # a layer without fibre
    plane = in_layer(line, curved)
    steps = np.linalg.norm(np.diff(plane, axis=0), axis=1)
    assert steps.sum() == pytest.approx(2.4 * radius, rel=0.02)
    assert np.linalg.norm(plane[-1] - plane[0]) == pytest.approx(steps.sum(), rel=1e-3)


def test_strands_of_a_curved_layer_are_read_back_where_they_lie():
    """Two strands round a cylinder of radius 25, the second of unknown force, from a report."""
    radius, turn = 25.0, np.linspace(-1.2, 1.2, 20)
    points = np.concatenate(
        [np.column_stack([radius * np.sin(turn), np.full(20, y), radius * np.cos(turn)])
         for y in (10.0, 50.0)]
    )  # fmt: skip
    angle = (LAYER.points[:, 0] - 40.0) / radius
    bent = np.column_stack([radius * np.sin(angle), LAYER.points[:, 1], radius * np.cos(angle)])
    curved = replace(LAYER, points=bent, flat=None)
    force = np.where(points[:, 1] < 30.0, 30.0, np.nan)
    offsets, none = np.array([0, 20, 40]), np.zeros(40, dtype=bool)
    drawn = DrawnPaths(points, offsets, np.zeros(2), none, force, none[:2], np.zeros(40))
    nodal = np.zeros((len(LAYER.points), 3, 3))
    stress = LayerStress(LAYER, nodal[LAYER.triangles[:, 0]], nodal)
    laid = _paths(drawn, curved, stress, {"force": 60.0, "angle": 90.0, "curvature": 1.0})
    (loop,) = LAYER.loops
    rim = bent[np.append(loop, loop[:1])]
    view = {"space": Rounded(rim, 0.01), "rim_offsets": np.array([0, len(rim)])}
    stack = {"layers": [view], "runs": [{"name": "rings", "layers": [laid]}], "first": 0}
    views = {"layers": {"stacks": [stack], "scales": {"force": 60.0}, "width": 1.0}}
    results = RunResults(Path(), {}, unpack(pack(views)))
    pieces = results.pieces("rings", 0)
    assert pieces.ends.shape == (38, 2, 3)
    np.testing.assert_allclose(np.hypot(*pieces.ends[..., [0, 2]].T), radius, atol=0.02)
    lengths = np.linalg.norm(pieces.ends[:, 1] - pieces.ends[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(2 * 2.4 * radius, rel=1e-3)
    np.testing.assert_allclose(pieces.share, np.repeat([0.5, 0.0], 19))
    np.testing.assert_allclose(np.hypot(*results.rims(0)[..., [0, 2]].T), radius, atol=0.02)
