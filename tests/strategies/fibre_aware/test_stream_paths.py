"""Levels of a field, and what of a part lies away from its border, against what is known."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.studies.strand_losses import share_inside
from ccfem.body.mesh import box_mesh
from ccfem.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers import Planar
from ccfem.strategies.fibre_aware.smeared import SmearedPart
from ccfem.strategies.fibre_aware.spline_grid import SplineGrid
from ccfem.strategies.fibre_aware.stream_paths import Extraction, refined

SIDE, HEIGHT = 24.0, 4.0
"""Of the plate, mm."""


def test_levels_of_a_linear_field_are_straight_and_a_unit_apart(two_pulls):
    mesh, layer = two_pulls[0].fields[0].mesh, two_pulls[1][0]
    points = refined(layer)[0]
    grid = SplineGrid.over(points, points.mean(axis=0), np.eye(2), 2.0)
    # Splines of degree two hold a linear field whose coefficients are its values at their middles.
    field = 0.8 * (grid.centre[1] + grid.size * (grid.used[:, 1] + 0.5))
    extraction = Extraction((field,), grid, mesh, (), Machine(), 5, 0.5, 10.0)
    low = points[:, 1].min()
    field = field - 0.8 * low - 0.2  # at the side 0.2 below a whole number
    lines = extraction.levels(layer, field, 0.3)
    assert len(lines) == 19  # 24 mm at 0.8 levels a mm, the first one 0.5 levels from the side
    for k, line in enumerate(sorted(lines, key=lambda line: line[0, 1])):
        np.testing.assert_allclose(line[:, 1], low + (0.5 + k) / 0.8, atol=1e-9)
        assert np.ptp(line[:, 0]) == pytest.approx(SIDE, abs=1e-9)


@pytest.mark.parametrize("inset", [3.0, 6.0])
def test_inside_is_what_is_left_of_a_plate_without_its_outer_cells(two_pulls, inset):
    cases, layers = two_pulls
    part = SmearedPart.of(cases.fields[0], layers[0].plane.frame)
    share = share_inside(part, layers, inset)
    # Insets of whole cells, 3 mm wide: every cell lies on one side.
    assert set(np.unique(share)) == {0.0, 1.0}
    left = (SIDE - 2.0 * inset) ** 2 * HEIGHT
    assert part.mesh.volumes @ share == pytest.approx(left, rel=1e-9)


def test_links_by_worth_are_tried_at_whole_numbers_too(two_pulls, monkeypatch):
    mesh, layers = two_pulls[0].fields[0].mesh, two_pulls[1][:1]
    points = refined(layers[0])[0]
    grid = SplineGrid.over(points, points.mean(axis=0), np.eye(2), 2.0)
    extraction = Extraction((np.zeros(len(grid)),), grid, mesh, (), Machine(), 5, 0.5, 10.0)
    gains = {(0.2, 0.0): 1.0, (0.2, 0.5): 1.1, (0.0, 1.0): 1.3}  # by levels and reach of links

    def linked(self, layer, lines, reach=0.0):
        line = [[lines[0], reach], [lines[0] + 50.0, reach]]
        return Toolpaths.from_plane([np.array(line)], layer, [False])

    def placed(self, paths, layer):
        return tuple(np.round(paths.points[0] @ layers[0].plane.frame[:2].T, 6).tolist())

    def gain(self, along, price):
        return gains.get(along, 0.5)

    monkeypatch.setattr(Extraction, "strands", lambda self, layer, field, shift: [shift])
    monkeypatch.setattr(Extraction, "round_holes", lambda self, lines, *_: (lines, 0))
    monkeypatch.setattr(Extraction, "linked", linked)
    monkeypatch.setattr(Extraction, "profiles", placed)
    monkeypatch.setattr(Extraction, "_price", lambda self, *_: 0.0)
    monkeypatch.setattr(Extraction, "_gain", gain)
    ((_, *_, best),) = extraction.candidates(layers, np.zeros(1, dtype=int), [100.0])
    assert placed(extraction, best, layers[0]) == (0.0, 1.0)
    # On a large part only the levels that are worth most by themselves are drawn.
    monkeypatch.setattr("ccfem.strategies.fibre_aware.stream_paths.LARGE_CELLS", 0)
    large = replace(extraction, strains_of=((1.0, np.zeros((0, 3))),))
    ((paths,),) = large.candidates(layers, np.zeros(1, dtype=int), [100.0])
    assert placed(large, paths, layers[0]) == (0.2, 0.0)


def test_layers_of_one_section_are_drawn_once_for_each_field(two_pulls, monkeypatch):
    mesh, layers = two_pulls[0].fields[0].mesh, two_pulls[1]
    points = refined(layers[0])[0]
    grid = SplineGrid.over(points, points.mean(axis=0), np.eye(2), 2.0)
    rising = grid.centre[1] + grid.size * (grid.used[:, 1] + 0.5)  # levels a width apart
    extraction = Extraction(
        (rising, 0.5 * rising), grid, mesh, (), Machine(minimum_length=20.0), 1, 0.5, 10.0
    )
    drawn = []
    linked = Extraction.linked

    def counted(self, layer, lines, reach=0.0):
        drawn.append((layer.index, len(lines)))
        return linked(self, layer, lines, reach)

    monkeypatch.setattr(Extraction, "linked", counted)
    monkeypatch.setattr("ccfem.strategies.fibre_aware.stream_paths._REACHES", (0.0,))
    ((paths,),) = extraction.candidates(layers, np.array([0, 1, 0, 0]), [1000.0])
    # Once to choose the levels and once to draw them; layer 2 stands for 0 and 3 too.
    assert sorted(layer for layer, _ in drawn) == [1, 1, 2, 2]
    of = [[layers[k].plane.project(path) for path in paths.on_layer(k)] for k in range(4)]
    for k in (0, 3):
        np.testing.assert_allclose(np.concatenate(of[k]), np.concatenate(of[2]), atol=1e-9)
        heights = paths.on_layer(k).points @ layers[k].plane.frame[2]
        np.testing.assert_allclose(heights, layers[k].plane.height, atol=1e-9)
    assert len(of[1]) < len(of[2])


def test_sections_that_grow_by_less_than_half_a_width_are_drawn_each(monkeypatch):
    """Three layers of 24 x 24 mm below three of 24 x 24.2 mm: one kind, of two sections."""
    parts = [box_mesh((24.0, side, 6.0), (4, 4, 2)) for side in (24.0, 24.2)]
    lower, upper = (Planar(count=6).cut(part) for part in parts)
    layers = (*lower[:3], *upper[3:])
    points = refined(upper[0])[0]
    grid = SplineGrid.over(points, points.mean(axis=0), np.eye(2), 2.0)
    rising = grid.centre[1] + grid.size * (grid.used[:, 1] + 0.5)
    machine = Machine(minimum_length=20.0)
    extraction = Extraction((rising,), grid, parts[1], (), machine, 1, 0.5, 10.0)
    monkeypatch.setattr("ccfem.strategies.fibre_aware.stream_paths._REACHES", (0.0,))
    ((paths,),) = extraction.candidates(layers, np.zeros(6, dtype=int), [1000.0])
    assert set(paths.layer) == {layer.index for layer in layers}
