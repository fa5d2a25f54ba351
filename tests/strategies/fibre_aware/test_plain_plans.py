"""Rows, contours and isocurves that cost little: planned once for layers that are alike."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.fem.materials import isotropic
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fibre_aware.plain_plans import _longer_side, plain_plans

MACHINE = Machine(minimum_length=15.0)


def beam(*forces):
    """A beam 60 x 12 x 4 mm in four layers, held at one end; its load cases by their forces."""
    mesh = box_mesh((60.0, 12.0, 4.0), (15, 3, 4))
    loads = {str(k): (Force("x_max", force),) for k, force in enumerate(forces)}
    problem = Problem(mesh, isotropic(3500.0, 0.3), (Support("x_min"),), loads, order=1)
    return WeightedCases.of(solve(problem)), Planar(count=4).cut(mesh)


def in_plane(paths, layer):
    return layer.plane.project(paths.on_layer(layer.index).points)


def test_layers_that_are_alike_get_the_same_paths():
    cases, layers = beam((300.0, 0.0, 0.0))
    for paths in plain_plans(cases, layers, MACHINE):
        first = in_plane(paths, layers[0])
        assert len(first)
        for layer in layers[1:]:
            np.testing.assert_allclose(in_plane(paths, layer), first, atol=1e-9)


def test_on_large_parts_two_layers_of_about_one_section_share_stripes(monkeypatch):
    mesh = box_mesh((60.0, 12.0, 4.0), (15, 3, 4))
    wider = 1.0 + 0.002 * mesh.points[:, 2:]
    mesh = replace(mesh, points=np.hstack([mesh.points[:, :2] * wider, mesh.points[:, 2:]]))
    pulled = {"pull": (Force("x_max", (300.0, 0.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.3), (Support("x_min"),), pulled, order=1)
    cases, layers = WeightedCases.of(solve(problem)), Planar(count=4).cut(mesh)
    for_each = plain_plans(cases, layers, MACHINE, curves=False)[-1]
    monkeypatch.setattr("ccfem.strategies.fibre_aware.heights.LARGE_CELLS", 0)
    *rows, shared = plain_plans(cases, layers, MACHINE)
    assert len(rows) == 2  # contours and isocurves take long
    # Two runs of two layers: the upper one of each is planned as without sharing.
    for k, layer in enumerate(layers):
        size = shared.on_layer(layer.index).lengths.sum()
        assert size == pytest.approx(for_each.on_layer(layer.index).lengths.sum(), rel=0.05)
        if k % 2:
            np.testing.assert_allclose(
                in_plane(shared, layer), in_plane(for_each, layer), atol=1e-6
            )


@pytest.fixture
def rows_alone(monkeypatch):
    """No stripes, which take longest, where only rows are looked at."""
    module = "ccfem.strategies.fibre_aware.plain_plans"
    monkeypatch.setattr(f"{module}.plan", lambda *_: Toolpaths.empty())


@pytest.mark.usefixtures("rows_alone")
def test_where_a_beam_bends_across_its_layers_only_stretched_ones_get_rows_along_it():
    cases, layers = beam((0.0, 0.0, -20.0))
    along_tension = plain_plans(cases, layers, MACHINE, curves=False)[0]
    lengths = [along_tension.on_layer(layer.index).lengths.sum() for layer in layers]
    # Bent down, it is stretched along its upper side and pressed along its lower one.
    assert lengths[:2] == [0.0, 0.0]
    assert min(lengths[2:]) > 0.8 * 12 * 60.0


@pytest.mark.usefixtures("rows_alone")
def test_each_layer_is_planned_for_its_own_load_case():
    cases, layers = beam((300.0, 0.0, 0.0), (0.0, 300.0, 0.0))
    paths = plain_plans(cases, layers, MACHINE, curves=False)[0]
    alone = [
        plain_plans(WeightedCases.of(field), layers, MACHINE, curves=False)[0]
        for field in cases.fields
    ]
    for layer, case in zip(layers, (0, 1, 0, 1), strict=True):
        expected = in_plane(alone[case], layer)
        np.testing.assert_allclose(in_plane(paths, layer), expected, atol=0.02)


@pytest.mark.parametrize("rectangle", [False, True])
def test_the_longer_side_of_a_section_turns_with_it(rectangle):
    """Two rectangles round an ellipse are smallest, one the other's mirror image.

    Round a polygon of 48 points on it they lie along the edges nearest to the longer axis.
    """
    angles = 2.0 * np.pi * np.arange(48) / 48
    points = np.stack([38.0 * np.cos(angles), 28.0 * np.sin(angles)], axis=1)
    if rectangle:
        points = shapely.get_coordinates(shapely.box(-38.0, -28.0, 38.0, 28.0))[:-1]
    tension = np.array([np.cos(0.3), np.sin(0.3)])
    for turn in np.radians(np.arange(0.0, 360.0, 7.0)):
        turned = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        along = _longer_side(shapely.Polygon(points @ turned), tension @ turned) @ turned.T
        if rectangle:
            np.testing.assert_allclose(np.abs(along), [1.0, 0.0], atol=1e-9)
        else:
            # Of the chords at the end of the shorter axis that which rises with the tension.
            exact = points[12] - points[13]
            np.testing.assert_allclose(along / along[0], exact / exact[0], atol=1e-9)


@pytest.mark.parametrize(("sides", "along"), [((30.0, 10.0), 0), ((10.0, 30.0), 1)])
@pytest.mark.parametrize("pull", [0, 1])
@pytest.mark.filterwarnings("error")
def test_a_pull_across_the_longer_side_is_no_division_by_zero(sides, along, pull):
    side = _longer_side(shapely.box(0.0, 0.0, *sides), np.eye(2)[pull])
    np.testing.assert_allclose(np.abs(side), np.eye(2)[along], atol=1e-12)
