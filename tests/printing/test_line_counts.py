from dataclasses import replace

import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.machine import Machine
from ccfem.printing.line_counts import check_matrix_lines, check_strands
from ccfem.slicing.slicers.planar import Planar

MESH = box_mesh((400.0, 100.0, 50.0), (4, 1, 1))
UP = (0.0, 0.0, 2.0)


def test_lines_are_layers_times_the_width_of_the_mean_section():
    """A section of 400 x 100 mm is as large as one of 200 x 200: 2,000 lines 0.1 mm wide."""
    machine = Machine(matrix_height=0.1, matrix_width=0.2)
    check_matrix_lines(MESH, UP, machine)
    with pytest.raises(InputError) as caught:
        check_matrix_lines(MESH, UP, replace(machine, matrix_height=0.02, matrix_width=0.1))
    assert "about 2,500 layers of matrix and 5,000,000 lines, 1,000 km" in str(caught.value)
    assert "are all lengths in mm?" in str(caught.value)


def test_strands_are_counted_on_the_layers_as_they_are():
    """1,000 layers of 400 x 100 mm: 200 strands of 1 mm each, 4,000 of 0.05 mm."""
    layers = Planar(count=40).cut(MESH, UP) * 25
    check_strands(layers, Machine(fibre_width=5.0))
    with pytest.raises(InputError) as caught:
        check_strands(layers, Machine(fibre_width=0.05))
    assert "1,000 layers would have about 4,000,000 strands, 800 km" in str(caught.value)
