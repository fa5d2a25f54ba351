"""Designs on curved layers, against flat ones, an unrolled cylinder and an assembled stiffness."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from ccfem.base.tensor import rotate_stiffness
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.materials import isotropic
from ccfem.geometry.polylines import line_length
from ccfem.machine import Machine
from ccfem.paths.fields.chart import chart_of
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fibre_aware.layer_axes import frames_in_cells
from ccfem.strategies.fibre_aware.smeared import SmearedPart
from ccfem.strategies.fibre_aware.spline_grid import SplineGrid
from ccfem.strategies.fibre_aware.stream_paths import Extraction, refined
from ccfem.strategies.fibre_aware.upper_bound import upper_bound
from ccfem.strategies.stream_function import StreamFunction

MACHINE = Machine(minimum_length=20.0)
PLA = isotropic(3500.0, 0.35)
RADIUS, SLANT = 30.0, np.radians(20.0)
SIZE, CELLS = (48.0, 16.0, 2.0), (16, 6, 1)


def rolled(points):
    """Points of a flat strip, on a cylinder along y."""
    angle, out = (points[:, 0] - 24.0) / RADIUS, RADIUS + points[:, 2] - 1.0
    return np.column_stack([out * np.sin(angle), points[:, 1], out * np.cos(angle)])


def turned(points, degrees):
    """Points about (1, 2, 3)."""
    axis, angle = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0), np.radians(degrees)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return points @ (np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k).T


def strip(place, load):
    """A strip of one layer, clamped at one end, its points and its load placed."""
    flat = box_mesh(SIZE, CELLS)
    layers = Planar(count=1).cut(flat)
    mesh = replace(flat, points=place(flat.points))
    loads = {"tip": (Force("x_max", tuple(load)),)}
    stress = solve(Problem(mesh, PLA, (Support("x_min"),), loads, order=1), tolerance=1e-11)["tip"]
    return stress, [replace(layer, points=place(layer.points), flat=None) for layer in layers]


@pytest.fixture(scope="module")
def cylinder():
    return strip(rolled, [30.0, 10.0, -20.0])


def part_of(stress, layers):
    return SmearedPart.of(stress, frames_in_cells(stress.mesh.centres, layers))


def of_quadratic(grid, value, laplacian):
    """Coefficients of a quadratic field: its values at the splines' middles less their spread."""
    middle = grid.centre + grid.size * (grid.used + 0.5) @ grid.axes
    return value(middle[:, 0], middle[:, 1]) - grid.size**2 / 8.0 * laplacian


def test_fibre_along_curved_layers_is_that_of_an_assembled_stiffness(cylinder):
    # Round the cylinder at a slant: the frame of each cell and its fibre, by the elasticity solver.
    stress, layers = cylinder
    part, axial = part_of(stress, layers), 4000.0
    angle = np.arctan2(stress.mesh.centres[:, 0], stress.mesh.centres[:, 2])
    hoop = np.column_stack([np.cos(angle), np.zeros(len(angle)), -np.sin(angle)])
    fibre = np.cos(SLANT) * hoop + [0.0, np.sin(SLANT), 0.0]
    # Frames of the facets of the layer, which lie up to half a facet's turn off the cylinder.
    x, y = part.axes.along(fibre).T
    size = np.hypot(x, y)
    assert size.min() > np.cos(0.5 * SIZE[0] / CELLS[0] / RADIUS)
    x, y = x / size, y / size
    q = np.stack([x * x, y * y, x * y], axis=1)
    found = part.solve(lambda strain: axial * q[:, :, None] * q[:, None, :], tolerance=1e-10)
    first = part.axes.in_space(np.stack([x, y], axis=1))
    second = np.cross(part.frame[:, 2], first)
    along = np.zeros((6, 6))
    along[0, 0] = axial
    frames = np.stack([first, second, part.frame[:, 2]], axis=2)
    total = [PLA.stiffness + rotate_stiffness(along, frame) for frame in frames]
    whole = solve(replace(stress.problem, stiffness=np.array(total)), tolerance=1e-10)["tip"]
    assert found.work == pytest.approx(2.0 * whole.strain_energy, rel=1e-8)
    scale = np.abs(whole.displacement).max()
    np.testing.assert_allclose(found.displacement, whole.displacement, atol=1e-7 * scale)


def test_flat_layers_as_surfaces_are_flat_layers(bent_beam):
    # Quadratic splines in the plane and in space hold the same quadratic field: nothing but
    # rounding tells the two designs apart.
    stress, layers = bent_beam
    surfaces = [replace(layer, flat=None) for layer in layers]
    results = []
    strategy = StreamFunction(coverage=0.4, evaluations=5)
    for some in (layers, surfaces):
        problem, _, found = strategy.designed(stress, some, MACHINE)
        field = of_quadratic(
            problem.model.grid, lambda x, y: 0.4 * y + 0.006 * x * y - 0.004 * x * x, -0.008
        )
        objective = problem.evaluate(field, tolerance=1e-11)
        bound = upper_bound(stress, some, 2000.0, MACHINE, iterations=3)
        results.append((objective.ratio[0], objective.length, bound.ratio, bound.reached))
        results[-1] += (found.objective.ratio[0],)
    flat, curved = np.array(results)
    np.testing.assert_allclose(curved[:4], flat[:4], rtol=1e-8)
    # Splines in space hold every field of the plane: what they reach is no worse.
    assert flat[2] > curved[4] > 0.99 * flat[4]


def test_gradient_on_curved_layers_is_that_of_the_objective(cylinder, rng):
    stress, layers = cylinder
    problem, _, found = StreamFunction(coverage=0.3, evaluations=2).designed(
        stress, layers, MACHINE
    )
    field = found.fields.ravel()
    gradient = problem.evaluate(field, tolerance=1e-11).gradient
    size = np.linalg.norm(gradient)
    way = gradient / size + 0.3 * rng.standard_normal(len(field)) / np.sqrt(len(field))
    up, down = (problem.evaluate(field + h * way, tolerance=1e-11).value for h in (1e-3, -1e-3))
    assert (up - down) / 2e-3 == pytest.approx(gradient @ way, rel=1e-4)


def test_designs_and_bounds_turn_with_the_part(cylinder):
    load = np.array([[30.0, 10.0, -20.0]])
    results = []
    for stress, layers in (
        cylinder,
        strip(lambda p: turned(rolled(p), 37.0), turned(load, 37.0)[0]),
    ):
        found = StreamFunction(coverage=0.3, evaluations=3).designed(stress, layers, MACHINE)[2]
        bound = upper_bound(stress, layers, 300.0, MACHINE, iterations=3)
        results.append((found.objective.ratio[0], found.objective.length, bound.ratio))
    np.testing.assert_allclose(results[1], results[0], rtol=1e-6)


def test_levels_on_a_cylinder_are_those_of_the_unrolled_strip(cylinder):
    # Helices 1.5 mm apart: straight lines of the strip. The field is one of space, of splines 2 mm
    # wide, whose gradient is off by up to (2 / R)^2 of its size: by .5 %, or .2 mm in 48 mm.
    stress, (layer,) = cylinder
    chart, places = chart_of(layer), refined(layer, in_space=True)[0]
    grid = SplineGrid.over(places, places.mean(axis=0), np.eye(3), 2.0)
    arc = RADIUS * np.arctan2(places[:, 0], places[:, 2])
    values = (np.sin(SLANT) * arc + np.cos(SLANT) * places[:, 1]) / 1.5
    splines = grid.values(places)
    field = sparse.linalg.lsqr(splines, values, atol=1e-10, btol=1e-10)[0]
    charts = {layer.index: chart}
    extraction = Extraction((field,), grid, stress.mesh, (), MACHINE, 1, 0.5, 10.0, 0.0, charts)
    lines = extraction.levels(chart.flat, field, 0.0)
    ends = np.array([[line[0], line[-1]] for line in lines if line_length(line) > 30.0])
    assert len(ends) >= 5
    way = ends[:, 1] - ends[:, 0]
    way = way / np.linalg.norm(way, axis=1)[:, None]
    off = []
    for line, unit in zip((one for one in lines if line_length(one) > 30.0), way, strict=True):
        off.append(np.abs((line - line[0]) @ [-unit[1], unit[0]]).max())
    assert max(off) < 0.2
    across = np.sort((ends[:, 0] - ends[0, 0]) @ [-way[0, 1], way[0, 0]])
    np.testing.assert_allclose(np.diff(across), 1.5, atol=0.05)
    # On the part they are as long as in the strip.
    lifted = extraction.on_part(Toolpaths.from_plane(lines, chart.flat), chart.flat)
    sizes = [line_length(line) for line in lines]
    np.testing.assert_allclose(lifted.lengths, sizes, rtol=5e-3)
