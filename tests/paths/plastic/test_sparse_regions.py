"""Where a part is solid and where its infill is sparse, by areas that are known by hand."""

import numpy as np
import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.machine import Machine
from ccfem.paths.plastic import Plastic
from ccfem.paths.plastic.plastic import GYROID
from ccfem.paths.plastic.sparse_regions import matrix_sections
from ccfem.paths.splitting.slabs import Slab
from ccfem.printing.matrix_lines import gyroid_lines, parallel_lines
from ccfem.slicing.slicers.planar import Planar

MACHINE = Machine()
WIDTH = MACHINE.matrix_width
UP = np.array([0.0, 0.0, 1.0])
SIDE = 30.0


def _slabs(count):
    return [Slab(0.8 * k, 0.8 * (k + 1)) for k in range(count)]


def _sections(mesh, count, plastic, fibre=()):
    _, sections = matrix_sections(_slabs(count), fibre, mesh, UP, plastic, MACHINE)
    return [sections[k] for k in range(count)]


@pytest.mark.parametrize(("walls", "skins"), [(1, 2), (2, 3), (3, 0)])
def test_a_box_has_walls_and_skins(walls, skins):
    mesh = box_mesh((SIDE, SIDE, 8.0), (2, 2, 1))
    found = _sections(mesh, 10, Plastic("gyroid", 0.2, walls, skins))
    inner = SIDE - 2.0 * walls * WIDTH
    # Corners of the sparse part are as round as a line.
    area = inner**2 - (4.0 - np.pi) * WIDTH**2
    for number, (_, section, sparse) in enumerate(found):
        covered = skins <= number < 10 - skins
        assert section.area == pytest.approx(SIDE**2)
        assert sparse.area == pytest.approx(covered * area, rel=1e-3)


def test_a_ledge_is_a_top_too():
    mesh = box_mesh((SIDE, SIDE, 8.0), (6, 6, 2))
    low = (mesh.centres[:, 0] < 15.0) | (mesh.centres[:, 2] < 4.0)
    stairs = TetMesh(mesh.points, mesh.cells[low])
    found = _sections(stairs, 10, Plastic("grid", 0.2, 2, 3))
    on_ledge = shapely.Point(22.0, 15.0)
    # The ledge is at 4 mm: of the five layers below it three are its skin, and three the bottom's.
    assert [one.sparse.contains(on_ledge) for one in found] == [False] * 10
    thicker = _sections(stairs, 10, Plastic("grid", 0.2, 2, 1))
    assert [one.sparse.contains(on_ledge) for one in thicker] == [False] + [True] * 3 + [False] * 6
    beside = shapely.Point(8.0, 15.0)
    assert [one.sparse.contains(beside) for one in thicker] == [False] + [True] * 8 + [False]
    # The skin reaches two lines under the step, to lie on infill there.
    assert not thicker[4].sparse.contains(shapely.Point(15.0 - 1.9 * WIDTH, 15.0))
    assert thicker[4].sparse.contains(shapely.Point(15.0 - 2.3 * WIDTH, 15.0))


def test_regions_are_combined_from_the_lowest_layer_up(monkeypatch):
    """In the order of a set, places differed by rounding from one run of Python to the next."""
    box = box_mesh((SIDE, SIDE, 8.0), (2, 2, 1))
    cone = TetMesh(box.points * (1.0 - 0.02 * box.points[:, 2:]) ** [1, 1, 0], box.cells)
    combined, intersection = [], shapely.intersection_all
    monkeypatch.setattr(
        shapely, "intersection_all", lambda some: combined.append(some) or intersection(some)
    )
    _sections(cone, 10, Plastic("grid", 0.2, 2, 3))
    assert [len(some) for some in combined] == [7] * 4
    for some in combined:
        assert (np.diff([region.area for region in some]) < 0.0).all()


def test_layers_beside_fibre_are_solid_where_fibre_may_lie():
    mesh = box_mesh((SIDE, SIDE, 16.0), (2, 2, 1))
    fibre = Planar(heights=(8.0,)).cut(mesh)
    slabs = [Slab(0.8 * k, 0.8 * (k + 1)) for k in range(20)]
    half = 0.5 * MACHINE.strand_height
    slabs[9:11] = [Slab(7.2, 8.0 - half), Slab(8.0 - half, 8.0 + half, 0), Slab(8.0 + half, 8.8)]
    for skins, solid in ((1, {9, 11}), (2, {8, 9, 11, 12})):
        plastic = Plastic("lines", 0.2, 1, 0, fibre_skins=skins)
        _, found = matrix_sections(slabs, fibre, mesh, UP, plastic, MACHINE)
        assert {k for k, one in found.items() if one.sparse.is_empty} == solid


def test_a_region_smaller_than_a_cell_of_infill_is_solid():
    thin = box_mesh((SIDE, 5.0, 8.0), (4, 1, 1))
    assert all(one.sparse.is_empty for one in _sections(thin, 10, Plastic("grid", 0.05, 2, 0)))
    assert not _sections(thin, 10, Plastic("grid", 0.3, 2, 0))[5].sparse.is_empty


def test_lines_of_all_layers_stand_on_each_other():
    lines = parallel_lines(shapely.box(1.0, 2.0, 11.0, 13.0), 2.0, 0.0)
    np.testing.assert_allclose(sorted(line[0, 1] for line in lines), np.arange(2.0, 13.0, 2.0))
    assert all(np.ptp(line[:, 0]) == pytest.approx(10.0) for line in lines)


def test_the_length_of_a_gyroids_lines_is_that_of_its_density():
    """By PrusaSlicer's factor of 2.44, and by the surface's own integral."""
    period, square = 5.0, shapely.box(0.0, 0.0, 20.0, 20.0)
    # Heights at which lines meet count for nothing: a prime number of them misses these.
    heights = (np.arange(37) + 0.5) * period / 37
    lengths = [
        sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines)
        for lines in (gyroid_lines(square, height, period) for height in heights)
    ]
    mean = np.mean(lengths) * period / square.area
    assert mean == pytest.approx(2.44, rel=0.01)
    assert mean == pytest.approx(GYROID, rel=2e-3)
    # Length in an area is the integral of the slope where the field is near 0 (coarea formula).
    x, y, z = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, (3, 2_000_000))
    field = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    along = np.cos(x) * np.cos(y) - np.sin(z) * np.sin(x)
    across = np.cos(y) * np.cos(z) - np.sin(x) * np.sin(y)
    near = np.abs(field) < 0.05
    length = 2.0 * np.pi * np.hypot(along, across)[near].sum() / (len(x) * 0.1)
    assert mean == pytest.approx(length, rel=0.01)


def test_lines_of_a_gyroid_lie_on_it():
    period = 7.0
    for line in gyroid_lines(shapely.box(3.0, 4.0, 30.0, 20.0), 2.2, period):
        x, y = 2.0 * np.pi / period * line.T
        z = 2.0 * np.pi / period * 2.2
        field = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
        assert np.abs(field).max() < 0.02


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"infill": "honeycomb"}, "infill"),
        ({"density": 0.0}, "density"),
        ({"density": 0.9}, "at most 0.6"),
        ({"walls": 0}, "walls"),
        ({"walls": 1.5}, "whole number"),
        ({"skins": -1}, "skins"),
        ({"fibre_skins": 0}, "fibre_skins"),
        ({"seam": "front"}, "seam"),
    ],
)
def test_plastic_that_nobody_prints_is_refused(values, said):
    with pytest.raises(InputError, match=said):
        Plastic(**values)
