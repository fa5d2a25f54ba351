"""The T-bracket: its size is that of the published layers, its holes are round."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.cases.t_bracket import HOLES, t_bracket, t_bracket_front, t_bracket_top
from ccfem.fem.elasticity import solve
from ccfem.slicing.slicers import Planar, Spatial


@pytest.fixture(scope="module")
def case():
    return t_bracket(order=1)


def test_volume_and_extent_are_those_of_the_authors_part(case):
    """78,746 mm^3 and 130 x 60 x 30 mm: measured on their layers (specification, addendum A)."""
    mesh = case.problem.mesh
    assert mesh.volumes.sum() == pytest.approx(78746.0, rel=0.005)
    np.testing.assert_allclose(np.ptp(mesh.points, axis=0), [130.0, 60.0, 30.0], atol=0.2)
    assert mesh.volumes.min() > 0.0
    assert mesh.aspects.max() < 20.0


def test_arcs_of_the_outline_run_into_each_other():
    """Drawn in steps of 6 degrees; the only corners are those of the base's two ends."""
    line = np.array(t_bracket_front().exterior.coords)
    steps = np.diff(line, axis=0)
    steps = steps[np.linalg.norm(steps, axis=1) > 1e-6]
    after = np.roll(steps, -1, axis=0)
    across = steps[:, 0] * after[:, 1] - steps[:, 1] * after[:, 0]
    turns = np.degrees(np.abs(np.arctan2(across, np.einsum("ij,ij->i", steps, after))))
    corners = turns > 6.5
    assert turns[corners] == pytest.approx([90.0] * 4)


def test_walls_of_the_holes_have_the_area_of_cylinders(case):
    mesh = case.problem.mesh
    expected = {"base_left": 15.0, "base_right": 15.0, "head": 30.0, "pull": 15.0}
    assert set(HOLES) == set(mesh.patches)
    for name, height in expected.items():
        area, normal = mesh.facet_areas(mesh.patch(name))
        assert area.sum() == pytest.approx(2.0 * np.pi * 5.5 * height, rel=0.015)
        axis = 2 if name in ("head", "pull") else 1
        assert np.average(np.abs(normal[:, axis]), weights=area) < 0.05


def test_bolts_press_on_the_walls_and_under_their_heads(case):
    assert case.alternative_supports == ()
    bolted = t_bracket(order=1, bolts=True)
    mesh = bolted.problem.mesh
    names = tuple(support.patch for support in bolted.alternative_supports)
    assert names == ("base_left", "base_right", "head_left", "head_right")
    assert bolted.problem.supports == case.problem.supports
    for name in ("head_left", "head_right"):
        area, normal = mesh.facet_areas(mesh.patch(name))
        assert (normal[:, 1] > 0.9).all()
        # The ring from the hole to the rim of the head, on top at y = 20.
        assert area.sum() == pytest.approx(np.pi * (9.5**2 - 5.5**2), rel=0.15)
        np.testing.assert_allclose(mesh.points[mesh.patch(name)][:, :, 1], 20.0, atol=0.1)


def test_outlines_meet_in_the_part():
    front, top = t_bracket_front(), t_bracket_top()
    assert front.is_valid
    assert top.is_valid
    assert len(front.interiors) == 1
    assert len(top.interiors) == 2
    assert front.bounds[1::2] == pytest.approx((5.0, 65.0))
    assert top.area == pytest.approx(100.0 * 30.0 + np.pi * (15.0**2 - 2 * 5.5**2), rel=0.005)


def test_it_is_layered_along_the_stress_unless_asked_otherwise(case):
    assert isinstance(case.slicing, Spatial)
    assert case.problem.held_or_loaded == ("base_left", "base_right", "pull")


@pytest.mark.parametrize(("axis", "direction"), [("x", 0), ("y", 1), ("z", 2)])
def test_planar_layers_lie_across_the_axis_asked_for(case, axis, direction):
    for layer in Planar(count=3, axis=axis).cut(case.problem.mesh, (1.0, 1.0, 0.0)):
        assert np.ptp(layer.points[:, direction]) < 1e-9
        assert layer.flat.frame[2][direction] == 1.0


def test_pull_is_held_by_bolts_that_only_press():
    """Where walls and heads meet, on the rims of the holes, they press at right angles."""
    case = t_bracket(order=1, bolts=True)
    loads = {"pull": case.problem.loads["pull"]}
    problem = replace(case.problem, supports=case.alternative_supports, loads=loads)
    found = solve(problem)["pull"]
    forces = found.support_forces
    np.testing.assert_allclose(sum(forces.values()), [0.0, -1000.0, 0.0], atol=1.0)
    # The heads hold it down; each side its half.
    for name in ("head_left", "head_right"):
        assert forces[name][1] == pytest.approx(-500.0, rel=0.1)
