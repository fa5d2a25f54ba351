"""The isocurve strategy on fields whose paths are known, and on the authors' part."""

import itertools
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.cases import create_case
from ccfem.cases.part_file import read_part
from ccfem.fem.elasticity import solve
from ccfem.fem.elasticity.problem import Problem, Support, Traction
from ccfem.fem.elasticity.stress_field import SolveRecord, StressField
from ccfem.fem.materials import isotropic
from ccfem.judging.evaluation import evaluate
from ccfem.judging.evaluation.strand_rules import why_not
from ccfem.machine import Machine
from ccfem.paths.planning import plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create
from ccfem.strategies.isocurve import Isocurve

MACHINE = Machine()


def field_of(mesh: TetMesh, stress_at) -> StressField:
    """Stress field given by a function of points (k, 3)."""
    patch = mesh.boundary[:1]
    mesh = mesh.with_patches({"support": patch})
    problem = Problem(mesh, isotropic(3500.0, 0.35), (Support("support"),))
    zeros = np.zeros_like(mesh.points)
    record = SolveRecord("given", 0, 0.0, 0.0, 0.0, 0)
    cell = stress_at(mesh.points[mesh.cells].mean(axis=1))
    return StressField(problem, "given", zeros, cell, stress_at(mesh.points), zeros, 0.0, record)


def uniform(angle: float, size: float = 10.0):
    t = np.array([np.cos(angle), np.sin(angle), 0.0])

    def stress(points: np.ndarray) -> np.ndarray:
        return np.broadcast_to(size * np.outer(t, t), (len(points), 3, 3))

    return stress


def ring_mesh(inner: float, outer: float) -> TetMesh:
    box = box_mesh((1.0, 1.0, 1.0), (12, 96, 1))
    s, turn, z = box.points.T
    radius, angle = inner + (outer - inner) * s, 2.0 * np.pi * turn
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    joined, inverse = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    cells = inverse.reshape(-1)[box.cells]
    mesh = TetMesh(joined, cells)
    return mesh if mesh.volumes.min() > 0 else TetMesh(joined, cells[:, [0, 1, 3, 2]])


def planned(strategy: Isocurve, field: StressField, count: int = 1) -> tuple:
    layers = Planar(count=count).cut(field.mesh)
    return plan(strategy, layers, field, MACHINE), layers


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.3])
@pytest.mark.parametrize(
    "strategy",
    [Isocurve(), Isocurve(spacing="search"), Isocurve.literal(), Isocurve(spacing="cone")],
)
def test_uniform_tension_gives_straight_equidistant_paths(strategy: Isocurve, angle: float) -> None:
    field = field_of(box_mesh((60.0, 60.0, 2.0), (14, 14, 1)), uniform(angle))
    unlinked = replace(strategy, link_limit=0.0)
    paths, layers = planned(unlinked, field)
    total = evaluate(paths, layers, field, MACHINE).total
    assert total["aligned_10"] == pytest.approx(1.0)
    assert total["angle_mean"] < 0.1
    normal = np.array([-np.sin(angle), np.cos(angle), 0.0])
    places = np.sort([line[0] @ normal for line in paths])
    spread = np.concatenate([line @ normal - line[0] @ normal for line in paths])
    assert np.abs(spread).max() < 0.02
    gaps = np.diff(places)
    assert gaps.min() >= 1.0 - 1e-6
    assert gaps.max() < 1.12
    np.testing.assert_allclose(gaps, gaps.mean(), atol=0.02)


def test_the_exact_solver_ends_where_the_bound_holds_almost_everywhere() -> None:
    """A plate with a hole, pulled: ever more bounds are met with next to no force on them."""
    case = create_case("open_hole")
    field = next(iter(solve(case.problem).values()))
    layers = Planar(count=1).cut(field.mesh)
    exact, quick = (
        plan(Isocurve(spacing=spacing), layers, field, case.machine).lengths.sum()
        for spacing in ("cone", "constrained")
    )
    assert exact == pytest.approx(quick, rel=0.01)


def test_hoop_tension_gives_concentric_circles() -> None:
    def hoop(points: np.ndarray) -> np.ndarray:
        radius = np.hypot(points[:, 0], points[:, 1])
        t = np.column_stack([-points[:, 1], points[:, 0], np.zeros(len(points))]) / radius[:, None]
        return 10.0 * t[:, :, None] * t[:, None, :]

    field = field_of(ring_mesh(10.0, 24.0), hoop)
    paths, layers = planned(Isocurve(spiral=False), field)
    assert len(paths) >= 12
    for line in paths:
        radius = np.hypot(line[:, 0], line[:, 1])
        np.testing.assert_allclose(radius, radius.mean(), atol=0.12)
    wound, _ = planned(Isocurve(), field)
    assert len(wound) <= 2
    total = evaluate(wound, layers, field, MACHINE).total
    assert total["crossings"] == total["self_crossings"] == 0


def test_adaptive_density_follows_the_stress() -> None:
    def bending(points: np.ndarray) -> np.ndarray:
        stress = np.zeros((len(points), 3, 3))
        stress[:, 0, 0] = points[:, 1]  # 0 to 60 MPa across the width
        return stress

    field = field_of(box_mesh((60.0, 60.0, 2.0), (15, 30, 1)), bending)
    adaptive = Isocurve(cap=100.0, floor=0.0, link_limit=0.0, trim=False)
    paths, _ = planned(adaptive, field)
    places = np.sort([line[0, 1] for line in paths])
    # one strand a width at the largest stress, and their number up to y as the stress's integral
    expected = places**2 / (2.0 * 60.0 * 1.03)
    np.testing.assert_allclose(np.arange(len(places)) + 0.5, expected, atol=1.0)
    even, _ = planned(replace(adaptive, power=0.0), field)
    places = np.sort([line[0, 1] for line in even])
    gaps = np.diff(places[places > 6.0])  # next to the edge there is no stress to follow
    np.testing.assert_allclose(gaps, gaps.mean(), rtol=0.05)


@pytest.mark.parametrize("finer", ["low", "high"])
def test_cap_is_a_percentile_of_the_area_not_of_the_triangles(finer: str) -> None:
    """Half of the part is stressed twice as much, and one half has nine times the triangles."""

    def halves(points: np.ndarray) -> np.ndarray:
        stress = np.zeros((len(points), 3, 3))
        stress[:, 1, 1] = np.where(points[:, 0] < 30.0, 10.0, 20.0)
        return stress

    box = box_mesh((20.0, 60.0, 2.0), (40, 20, 1))
    x = box.points[:, 0]
    x = np.where(x < 15.0, 2.0 * x, 30.0 + 6.0 * (x - 15.0))  # 30 and 10 columns of cells
    x = x if finer == "low" else 60.0 - x[::-1]
    field = field_of(replace(box, points=np.column_stack([x, box.points[:, 1:]])), halves)
    for cap, dense in ((40.0, True), (60.0, False)):
        paths, _ = planned(Isocurve(cap=cap, floor=0.0, link_limit=0.0), field)
        low = sum(line[:, 0].mean() < 28.0 for line in paths)
        # The low half is filled where its stress is the cap; half filled where it is half of it.
        assert low == pytest.approx(27 if dense else 14, abs=3)


def test_strands_keep_off_the_boundary() -> None:
    field = field_of(box_mesh((60.0, 60.0, 2.0), (14, 14, 1)), uniform(0.4))
    for inset in (0.45, 2.0):
        paths, _ = planned(Isocurve(inset=inset, link_limit=0.0), field)
        edge = np.minimum(paths.points[:, :2], 60.0 - paths.points[:, :2]).min()
        assert inset - 1e-9 <= edge < inset + 0.1


def test_half_the_width_gives_twice_the_length() -> None:
    field = field_of(box_mesh((60.0, 30.0, 2.0), (20, 10, 1)), uniform(0.3))
    layers = Planar(count=1).cut(field.mesh)
    lengths = [
        plan(Isocurve(), layers, field, Machine(fibre_width=width)).lengths.sum()
        for width in (1.0, 0.5)
    ]
    assert lengths[1] / lengths[0] == pytest.approx(2.0, rel=0.05)


def test_conformal_curves_follow_the_named_hole() -> None:
    mesh = ring_mesh(8.0, 40.0)
    radius = np.hypot(*np.moveaxis(mesh.points[mesh.boundary][:, :, :2], -1, 0))
    hole = mesh.boundary[(radius < 8.001).all(axis=1)]
    field = field_of(mesh.with_patches({"hole": hole}), uniform(0.0))
    # Where isocurves are led into the last curve they fold: with folds, their ends are all there.
    led = Isocurve(conformal=("hole",), spiral=False, link_limit=0.0, folds=True)
    paths, _ = planned(led, field)
    reach = [np.hypot(line[:, 0], line[:, 1]) for line in paths]
    assert min(r.min() for r in reach) == pytest.approx(9.5, abs=0.05)
    rings = [r for r in reach if np.ptp(r) < 0.05]
    assert [r.mean() for r in rings] == pytest.approx([9.5], abs=0.05)
    rest = [r.min() for r in reach if np.ptp(r) >= 0.05]
    assert min(rest) == pytest.approx(10.5, abs=0.05)


def test_no_tension_names_the_largest_stress_and_the_option() -> None:
    field = field_of(box_mesh((60.0, 30.0, 2.0), (10, 5, 1)), uniform(0.0, -10.0))
    with pytest.raises(InputError, match=r"largest tensile stress.*sense = 'absolute'"):
        planned(Isocurve(), field)
    paths, _ = planned(Isocurve(sense="absolute", link_limit=0.0), field)
    assert paths.lengths.sum() > 0.9 * 60.0 * 30.0 / 1.1
    for line in paths:
        np.testing.assert_allclose(line[:, 1], line[0, 1], atol=0.02)


def test_a_layer_without_tension_gets_no_path() -> None:
    def bending(points: np.ndarray) -> np.ndarray:
        stress = np.zeros((len(points), 3, 3))
        stress[:, 0, 0] = points[:, 2] - 4.0
        return stress

    field = field_of(box_mesh((60.0, 30.0, 8.0), (10, 5, 4)), bending)
    paths, _ = planned(Isocurve(), field, count=4)
    assert set(paths.layer.tolist()) == {2, 3}


@pytest.mark.parametrize(
    "wrong", [{"cap": 0.0}, {"cap": 101.0}, {"fill": "heat"}, {"power": -1.0}, {"conformal": "all"}]
)
def test_wrong_parameters_are_refused(wrong: dict) -> None:
    with pytest.raises(InputError, match=f"isocurve.{next(iter(wrong))}"):
        create("isocurve", wrong)


def test_solved_bar_is_filled_with_straight_strands() -> None:
    mesh = box_mesh((80.0, 12.0, 4.0), (40, 6, 2))
    problem = Problem(
        mesh,
        isotropic(3500.0, 0.35),
        (Support("x_min"),),
        {"pull": (Traction("x_max", (10.0, 0.0, 0.0)),)},
    )
    field = solve(problem)["pull"]
    paths, layers = planned(Isocurve(inset=0.0), field, count=3)
    total = evaluate(paths, layers, field, MACHINE).total
    assert total["aligned_stress_10"] > 0.95
    assert total["coverage"] > 0.85


LUG = """
name = "lug"
layers = 1
order = 1
build = "z"
material = "pla"
[planform]
outline = {outline}
holes = [{{centre = {centre}, radius = 6}}]
height = 6.0
edge_length = {edge_length}
[patches.foot]
rule = "plane"
normal = {along}
offset = "min"
[patches.pin]
rule = "cylinder"
point = {point}
axis = "z"
radius = 6.0
[[supports]]
patch = "foot"
[[loads.pull]]
kind = "bearing"
patch = "pin"
vector = {along}
"""


@pytest.mark.parametrize(
    ("edge_length", "turn"), [(2.5, 0.0), (1.5, 0.0), (2.5, 20.0), (2.5, 45.0)]
)
def test_halves_of_a_symmetric_lug_get_the_same_fibre(
    edge_length: float, turn: float, tmp_path: Path
) -> None:
    # The tension turns round the pin and goes back: no signs of its lines are continuous there.
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    turned = np.array([[c, -s], [s, c]])
    corners = np.array([[0.0, 0.0], [80.0, 0.0], [80.0, 30.0], [0.0, 30.0]])
    centre = (turned @ [65.0, 15.0]).tolist()
    file = tmp_path / "lug.toml"
    file.write_text(
        LUG.format(
            outline=(corners @ turned.T).tolist(),
            centre=centre,
            point=[*centre, 0.0],
            edge_length=edge_length,
            along=[float(c), float(s), 0.0],
        )
    )
    case = read_part(file)
    field = solve(case.problem)["pull"]
    # Short pieces stay: of two that are alike one may be a hair too short, and go as a whole.
    layers = Planar(count=1).cut(field.mesh)
    paths = plan(Isocurve(), layers, field, replace(MACHINE, minimum_length=10.0))
    width = MACHINE.fibre_width
    upper = lower = 0.0
    for line in paths:
        height = line[:, :2] @ turned[:, 1] - 15.0
        middle = 0.5 * (height[1:] + height[:-1])
        length = np.linalg.norm(np.diff(line, axis=0), axis=1)
        # a strand on the line of symmetry belongs to neither half
        upper += length[middle > width].sum()
        lower += length[middle < -width].sum()
    assert upper == pytest.approx(lower, rel=0.05)
    assert evaluate(paths, layers, field, MACHINE).total["aligned_stress_10"] > 0.94


needs_authors_data = pytest.mark.skipif(
    "CCFEM_CHEN2021" not in os.environ, reason="needs the authors' data: set CCFEM_CHEN2021"
)


@needs_authors_data
def test_figures_on_the_authors_loop() -> None:
    """The promises on the authors' Loop, at no more fibre than theirs: 34.658 m on 12 layers."""
    from ccfem.papers.chen_2021.loop import authors_loop

    case = authors_loop()
    field = next(iter(solve(case.problem).values()))
    layers = Planar(count=12).cut(field.mesh, case.build)[1::5]
    paths: Toolpaths = plan(Isocurve(), layers, field, MACHINE)
    total = evaluate(paths, layers, field, MACHINE).total
    assert total["fibre_length"] <= 34658.0 * 3.0 / 12.0
    assert total["aligned_10"] >= 0.93
    assert total["aligned_stress_10"] >= 0.95
    assert total["coverage_top_20"] >= 0.72
    assert total["curvature_95"] <= 0.12
    assert total["outside_depth"] <= 0.02
    assert total["crossings"] == total["self_crossings"] == 0
    assert total["curvature_ok"] >= 0.99  # at most 1 % turns tighter than 3.85 mm
    assert total["outside_width"] <= 0.005
    assert why_not(total, case.machine) == ()
    assert sharpest_strand(paths) <= 90.0
    linked = plan(
        Isocurve(smooth=False, link_limit=7.0, inset=0.0, folds=True), layers[:1], field, MACHINE
    )
    assert np.bincount(linked.layer).max() <= 16


def sharpest_strand(paths: Toolpaths) -> float:
    """Largest turn, degrees, at a point that no step marked as a link touches."""
    most = 0.0
    for start, end in itertools.pairwise(paths.offsets):
        steps = np.diff(paths.points[start:end], axis=0)
        steps /= np.linalg.norm(steps, axis=1)[:, None]
        strand = ~paths.link[start : end - 1]
        cosine = (steps[1:] * steps[:-1]).sum(axis=1)[strand[1:] & strand[:-1]]
        most = max(most, float(np.degrees(np.arccos(np.clip(cosine.min(initial=1.0), -1.0, 1.0)))))
    return most
