"""Lines of matrix are no higher than their shape allows, and no thinner than the machine prints."""

from itertools import pairwise

import numpy as np
import pytest
import shapely

from ccfem.body.mesh.box import box_mesh
from ccfem.machine import machine_from, machine_names
from ccfem.paths.splitting.slabs import LOW, slabs_of
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.matrix_flow import with_flow
from ccfem.slicing.slicers.planar import Planar


@pytest.mark.parametrize("name", machine_names())
@pytest.mark.parametrize("pitch", [0.4, 0.9, 1.7])
def test_no_layer_makes_lines_higher_than_their_shape_allows(name, pitch):
    """Lines over fibre fill what is open between its strands, too."""
    machine = machine_from({"profile": name})
    heights = tuple(np.arange(0.5, 4.0, max(pitch, machine.strand_height + 0.11)))
    layers = Planar(heights=heights).cut(box_mesh((60.0, 12.0, 5.0), (6, 2, 2)))
    slabs = slabs_of(layers, 0.0, 5.0, machine)
    assert machine.highest_line <= machine.matrix_width
    assert sum(slab.upper - slab.lower for slab in slabs) == pytest.approx(5.0)
    for below, slab in pairwise(slabs):
        if slab.fibre is None:
            open_ = 0.0 if below.fibre is None else machine.strand_height
            assert slab.upper - slab.lower + open_ <= machine.highest_line + 1e-9
            assert slab.upper - slab.lower > 0.5 * LOW


def test_no_line_is_thinner_than_the_machine_prints():
    """Over a stack of strands as high as the layer above it."""
    machine = machine_from({"profile": "klipper"})
    layer = Planar(count=1).cut(box_mesh((40.0, 10.0, 1.0), (4, 2, 1)))[0]
    # Nearer to each other than they are wide, so that the flow of all is scaled down.
    lines = [np.array([[0.0, y], [40.0, y]]) for y in np.arange(0.4, 10.0, 0.74)]
    stack = [np.array([[0.0, 5.0 + 0.01 * k], [40.0, 5.0 + 0.01 * k]]) for k in range(3)]
    section = shapely.box(0.0, 0.0, 40.0, 10.0)
    paths = Toolpaths.from_plane(lines, layer)
    _, laid, _ = with_flow(paths, section, 0.15, stack, 0.1, machine)
    ends = laid == 0.0
    assert ends.sum() == len(lines)
    assert laid[~ends].min() == machine.least_line
