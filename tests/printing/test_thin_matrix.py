"""Matrix that is too thin over strands or at the outside is said, or refused."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.machine import Machine, updated
from ccfem.paths.splitting.slabs import check_cover, slabs_of
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.print_plan import plan_print
from ccfem.slicing.slicers.planar import Planar


def strip(height, values):
    """A strip of 60 x 20 mm with strands a width apart on a tenth of it, in its middle."""
    mesh, machine = box_mesh((60.0, 20.0, height), (6, 2, 1)), updated(Machine(), values)
    layers = Planar(count=1).cut(mesh)
    # Four strands on top of each other.
    stack = [np.array([[4.0, 10.0], [56.0, 10.0 + 0.01 * k]]) for k in range(4)]
    return plan_print(Toolpaths.from_plane(stack, layers[0]), layers, mesh, machine)


def test_thin_matrix_and_thin_cover_are_said_or_refused():
    # Stacks of .43 mm, spread over two widths: higher than the matrix above, on a few hundredths.
    (said, *_) = strip(0.5, {}).warnings
    assert "strands stand higher than the 0.196 mm of matrix above them on " in said
    assert 0.01 < 0.01 * float(said.split("them on ")[1].split("%")[0]) < 0.1
    below = strip(2.0, {}).warnings
    assert below == ()
    assert sum("one layer of matrix" in line for line in strip(0.5, {}).warnings) == 2
    with pytest.raises(InputError, match=r"0\.146 mm of matrix below the first fibre layer do not"):
        strip(0.4, {"process": {"short": "drop"}})


def test_layers_of_matrix_that_no_machine_prints_are_said():
    """Fibre layers 0.13 mm apart and 0.1075 mm high leave 0.0225 mm."""
    layers = Planar(heights=(0.5, 0.63)).cut(box_mesh((60.0, 20.0, 1.5), (6, 2, 1)))
    said = check_cover(slabs_of(layers, 0.0, 1.5, Machine()), Machine())
    assert said == [
        "1 layer of matrix only 0.0225 mm high, less than machine.least_line, 0.05 mm: lay fibre "
        "layers at least 0.1575 mm apart, or with no matrix between them"
    ]
    layers = Planar(heights=(0.5, 0.6075)).cut(box_mesh((60.0, 20.0, 1.5), (6, 2, 1)))
    assert check_cover(slabs_of(layers, 0.0, 1.5, Machine()), Machine()) == []
