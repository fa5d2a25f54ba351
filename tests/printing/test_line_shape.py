"""Lines of matrix are no higher than their shape allows, and no thinner than the machine prints."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from benchmarks.print_checks.filling import shapes
from benchmarks.print_checks.job import FILAMENT, PART
from benchmarks.print_checks.printer import follow
from ccfem.body.mesh.box import box_mesh
from ccfem.machine import machine_from, machine_names
from ccfem.paths.splitting.slabs import LOW, slabs_of
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.gcode import gcode
from ccfem.printing.laid_layer import Below, with_flow
from ccfem.printing.print_plan import plan_print
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
    _, laid, _ = with_flow(paths, section, 0.15, Below().under(stack, [], 0.1, machine), machine)
    ends = laid == 0.0
    assert ends.sum() == len(lines)
    assert laid[~ends].min() == machine.least_line


@pytest.mark.parametrize("name", machine_names())
@pytest.mark.parametrize("share", [0.35, 0.6, 0.9])
def test_a_line_in_a_gap_is_as_wide_as_the_gap(name, share):
    """A wall of two lines and a gap; the file is read as a printer reads it."""
    machine = machine_from({"profile": name})
    width, gap = machine.matrix_width, share * machine.matrix_width
    size = (70.0, 2.0 * width + gap, 1.5)
    mesh = box_mesh(size, (8, 1, 1))
    layers = Planar(heights=(0.75,)).cut(mesh)
    strand = Toolpaths.from_plane(
        [np.array([[2.0, 0.5 * size[1]], [68.0, 0.5 * size[1]]])], layers[0]
    )
    plan = plan_print(strand, layers, mesh, machine)
    run = follow(gcode(plan, machine), name)
    assert shapes(SimpleNamespace(machine=machine), run) == []
    middle = 0.5 * machine.gcode.bed[1]
    lines = [s for s in run.steps if s.lays and s.tool == 0 and s.kind in PART and s.length > 20.0]
    inner = [s for s in lines if abs(s.end[1] - middle) < 0.1 * width]
    assert {s.width > 0.999 * width for s in lines if s not in inner} == {True}
    assert inner
    for step in inner:
        # The room is filled, and the section stands alone where its height allows no such width.
        assert step.width >= gap - 0.02 * width
        assert step.width == pytest.approx(gap, rel=0.03) or (
            step.height == pytest.approx(machine.line_shape * step.width, abs=2e-3)
        )
        level = max(z for z in (0.0, *plan.top) if z < step.end[2] - 1e-3)
        assert step.fed * FILAMENT == pytest.approx(
            step.width * step.height * step.length, rel=3e-3
        )
        assert step.width * step.height <= 1.1 * gap * (step.end[2] - level + machine.strand_height)
