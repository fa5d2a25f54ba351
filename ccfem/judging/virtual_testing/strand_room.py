"""The room of fibre: how much of each strand lies beside others and not on them."""

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.geometry.beads import Beads, beads
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, Toolpaths


def fibre_beads(toolpaths: Toolpaths, machine: Machine) -> Beads:
    """Parts of the fibre paths, in the order of ``toolpaths.of_kind(FIBRE)``, with their room."""
    fibre = toolpaths.of_kind(FIBRE)
    return beads(
        fibre.points,
        fibre.normals,
        fibre.offsets,
        fibre.closed,
        fibre.layer,
        machine.fibre_width,
        machine.strand_height,
    )


def room_of(toolpaths: Toolpaths, path: IntArray, arc: FloatArray, machine: Machine) -> FloatArray:
    """Share of the fibre at places along paths that finds room among strands of its direction.

    Parameters
    ----------
    path : (s,) int array
        Fibre path of each place.
    arc : (s,) array, mm
        Arc length of the path there.
    machine : Machine
        Width and height of a strand.

    Returns
    -------
    (s,) array in (0, 1]
        1 where no strand of the same direction is nearer than a width; 1/N in N copies of a line.
    """
    found = fibre_beads(toolpaths, machine)
    number = (np.cumsum(toolpaths.kind == FIBRE) - 1)[path]
    first, count = found.first[number], np.diff(found.first)[number]
    step = np.maximum(found.length[np.minimum(first, len(found.length) - 1)], 1e-300)
    part = np.clip((arc / step).astype(np.int64), 0, count - 1)
    return np.asarray(found.alone[first + part])
