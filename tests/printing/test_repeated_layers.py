"""Layers that repeat others are laid and timed once: the file is the same to the last byte."""

import numpy as np
import pytest

from ccfem.base.parallel import in_processes
from ccfem.body.mesh.box import box_mesh
from ccfem.machine import Machine, machine_table, updated
from ccfem.paths.splitting import printed_strands
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing import flat_stack, part_moves, print_plan
from ccfem.printing.export.gcode import gcode
from ccfem.slicing.slicers.planar import Planar

LINES = [np.array([[5.0, 5.0], [60.0, 5.0], [78.0, 21.0]]), np.array([[20.0, 20.0], [73.0, 20.0]])]
MESH = box_mesh((85.0, 26.0, 4.2), (8, 3, 7))


@pytest.mark.parametrize("machine", ["klipper", "aura_like"])
def test_the_file_of_repeated_layers_is_that_of_layers_one_by_one(machine, monkeypatch):
    machine = updated(Machine(), machine_table(machine), {})
    layers = Planar(heights=(0.7, 1.3, 1.9, 2.5, 3.1)).cut(MESH)
    lines = [LINES, LINES, LINES[:1], LINES, LINES]
    paths = Toolpaths.concatenate(
        Toolpaths.from_plane(some, layer) for some, layer in zip(lines, layers, strict=True)
    )
    laid, fibre_layer = [], flat_stack.fibre_layer
    monkeypatch.setattr(
        flat_stack, "fibre_layer", lambda *about: laid.append(about) or fibre_layer(*about)
    )

    def file():
        return gcode(print_plan.plan_print(paths, layers, MESH, machine), machine)

    once = file()
    assert len(laid) == 2  # as many as there are different ones
    for module in (flat_stack, part_moves):
        monkeypatch.setattr(module, "repeating", one_by_one)
    monkeypatch.setattr(printed_strands, "repeated_layers", lambda _, some, __=None: all_of(some))
    assert file() == once
    assert len(laid) == 2 + 5


def one_by_one(work, what, again):
    return in_processes(work, range(len(what)))


def all_of(layers):
    return np.arange(len(layers))
