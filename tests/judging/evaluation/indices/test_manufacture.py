"""Lengths, cuts and print time of hand-made paths."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.judging.evaluation.indices.manufacture import manufacture_indices, sample_manufacture
from ccfem.judging.evaluation.layer_paths import plane_paths
from ccfem.machine import Machine
from ccfem.paths.toolpaths import MATRIX, TRAVEL, Toolpaths

MACHINE = Machine(minimum_length=20.0)


def indices(part, toolpaths, machine=MACHINE):
    paths = plane_paths(toolpaths, part.layers[0])
    return manufacture_indices(sample_manufacture(paths, toolpaths, machine), machine)


def test_lengths_and_shares(pulled):
    toolpaths = pulled.paths(
        [[0, 0], [10, 0]], [[0, 1], [20, 1]], [[0, 2], [30, 2]], [[0, 3], [40, 3]]
    )
    values = indices(pulled, toolpaths)
    assert values["fibre_length"] == 100.0
    assert values["paths"] == values["cuts"] == 4.0
    assert values["length_min"] == 10.0
    assert values["length_median"] == 25.0
    assert values["length_max"] == 40.0
    # A path of exactly the least length is long enough.
    assert values["long_enough_count"] == 0.75
    assert values["long_enough_length"] == 0.9


def test_print_time_of_paths_and_ways(pulled):
    # 10 mm at 5 mm/s, a way of 8 mm at 80 mm/s, 20 mm at 5 mm/s.
    toolpaths = pulled.paths([[0, 0], [10, 0]], [[10, 8], [30, 8]])
    assert indices(pulled, toolpaths)["print_time"] == pytest.approx(2.0 + 0.1 + 4.0)
    # Matrix goes at its own speed, and written travel replaces the straight way.
    matrix = replace(toolpaths, kind=np.array([0, MATRIX]))
    assert indices(pulled, matrix)["print_time"] == pytest.approx(2.0 + 0.1 + 20.0 / 12.0)
    assert indices(pulled, matrix)["fibre_length"] == 10.0
    travel = pulled.paths([[10, 0], [10, 16], [10, 8]])
    travel = replace(travel, kind=np.array([TRAVEL]))
    both = Toolpaths.concatenate(
        [toolpaths.select([True, False]), travel, toolpaths.select([False, True])]
    )
    assert indices(pulled, both)["print_time"] == pytest.approx(2.0 + 0.3 + 4.0)


def test_a_machine_that_stands_still_takes_forever(pulled):
    stopped = replace(MACHINE, fibre_speed=0.0)
    assert indices(pulled, pulled.paths([[0, 0], [10, 0]]), stopped)["print_time"] == np.inf
    assert indices(pulled, pulled.paths(), stopped)["print_time"] == 0.0


def test_paths_of_no_length_are_none(pulled):
    values = indices(pulled, pulled.paths([[5, 5], [5, 5]], [[0, 0], [30, 0]]))
    assert values["paths"] == 1.0
    assert values["length_min"] == 30.0


def test_no_path(pulled):
    values = indices(pulled, pulled.paths())
    assert [values[k] for k in ("fibre_length", "paths", "cuts", "print_time")] == [0.0] * 4
    assert np.isnan([values["length_min"], values["long_enough_count"]]).all()


def test_mass_of_fibre_and_of_the_matrix_that_is_left(pulled):
    machine = replace(MACHINE, filament_area=0.1, fibre_density=1.5, matrix_density=1.2)
    machine = replace(machine, matrix_width=0.8, matrix_height=0.5)
    values = indices(pulled, pulled.paths([[5, 5], [55, 5]]), machine)
    # 50 mm of 0.1 mm^2 in a plate of 60 x 40 x 2 mm
    assert values["fibre_mass"] == pytest.approx(1.5e-3 * 5.0)
    assert values["matrix_mass"] == pytest.approx(1.2e-3 * (4800.0 - 5.0))
    assert values["matrix_length"] == pytest.approx((4800.0 - 5.0) / 0.4)


def test_print_time_by_nearest_ends(pulled):
    """Three strands of 10 mm drawn in an order that goes to and fro."""
    lines = [[[0, 0], [10, 0]], [[0, 8], [10, 8]], [[0, 4], [10, 4]]]
    values = indices(pulled, pulled.paths(*lines))
    ways = np.hypot(10.0, 8.0) + np.hypot(10.0, 4.0)
    assert values["print_time"] == pytest.approx((30.0 / 5.0) + ways / 80.0)
    # walked from either end: 4 mm up, and 4 mm more
    assert values["print_time_nearest"] == pytest.approx((30.0 / 5.0) + 8.0 / 80.0)
