"""A small part with strands on two layers, printed on paper."""

import numpy as np
import pytest
import shapely

from benchmarks.print_checks.job import Job
from ccfem.body.mesh.box import box_mesh
from ccfem.machine import Machine, machine_table, updated
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.bed_layout import BedLayout
from ccfem.printing.export.gcode import gcode
from ccfem.printing.print_plan import plan_print
from ccfem.printing.together import arranged
from ccfem.slicing.slicers.planar import Planar

SIZE = (85.0, 26.0, 1.8)
HEIGHTS = (0.7, 1.3)


def _ring(radius):
    turn = np.linspace(0.0, 2.0 * np.pi, 61)
    line = np.array([15.0, 13.0]) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    line[-1] = line[0]
    return line


LINES = (
    _ring(10.0),
    np.array([[30.0, 3.0], [60.0, 3.0], [78.0, 25.0]]),
    np.array([[26.0, 22.0], [73.0, 22.0]]),
    np.array([[50.0, 18.0], [70.0, 18.0]]),
)


class SmallPart(Job):
    """A box with strands on two layers: its file, what the printer did, and what was planned."""

    def __init__(self, name, values=None, lines=LINES, copies=(1,), size=SIZE, heights=HEIGHTS):
        self.size, self.heights = np.array(size), np.array(heights)
        machine = updated(Machine(), machine_table(name), values or {})
        mesh = box_mesh(size, (8, 3, 1))
        layers = Planar(heights=heights).cut(mesh)
        paths = Toolpaths.concatenate(Toolpaths.from_plane(lines, layer) for layer in layers)
        plan = plan_print(paths, layers, mesh, machine)
        plan = arranged([plan], [BedLayout(copies=copies)], machine)
        middle, half = 0.5 * np.array(machine.gcode.bed[:2]), 0.5 * self.size[:2]
        self.corner = middle - half
        # Copies are as far apart as the part from the block, 4 mm; here all fit round the middle.
        grid = np.array([*copies, 1][:2])
        places = np.array(list(np.ndindex(*grid))) - 0.5 * (grid - 1)
        self.corners = self.corner + places * (self.size[:2] + 4.0)
        self.whole = shapely.union_all([shapely.box(*c, *(c + 2 * half)) for c in self.corners])
        strands = [line + np.append(corner, 0.0) for corner in self.corners for line in paths]
        text = gcode(plan, machine)
        volume = float(self.size.prod()) * len(self.corners)
        area = float(self.whole.area)
        sections = (lambda _: self.whole, lambda _: area)
        super().__init__(name, machine, plan, text, strands, *sections, volume)


@pytest.fixture(scope="session")
def small_part():
    return SmallPart
