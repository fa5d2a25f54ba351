"""Cuts for stiffness and strength, of which a test says which is worth most.

What fibre is worth for the load at first failure is known for small changes only, and a cut is a
large one. So fibre is cut for the stiffness alone, for the strength as asked for, and half of that.
"""

from collections.abc import Sequence

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.fibre_aware.prune import prune
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.strength import first_failure
from ccfem.virtual_testing.virtual_test import virtual_test

__all__ = ["cut_for_strength", "stiff_and_strong"]

_SHARES = (0.0, 0.5, 1.0)
"""Of the strength asked for, with which fibre is cut."""

_ALL_WAYS = 2
"""Candidates that are cut in all these ways; the others are cut for the stiffness alone."""


def cut_for_strength(
    candidates: Sequence[Toolpaths],
    layers: Sequence[Layer],
    part: Specimen,
    length: float,
    machine: Machine,
    strand: Strand,
    rounds: int,
    strength: float,
    tight: float,
) -> Toolpaths:
    """Cut candidates to a length, mm in all, in several ways, and return what is worth most.

    Those beyond the second are cut for the stiffness alone. Parameters as of
    `ccfem.fibre_aware.prune.prune`; paths are worth `stiff_and_strong`.
    """
    laid = [one for one in candidates if len(one)]
    cuts = [
        prune(one, part, length, machine, strand, rounds, share * strength, tight)
        for k, one in enumerate(laid)
        for share in (_SHARES if k < _ALL_WAYS else _SHARES[:1])
    ]
    cuts = [one for one in cuts if len(one)]
    if not cuts:
        return candidates[0] if not laid else Toolpaths.empty()
    worth = [stiff_and_strong(one, layers, part, machine, strand, strength)[0] for one in cuts]
    return cuts[int(np.argmax(worth))]


def stiff_and_strong(
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    part: Specimen,
    machine: Machine,
    strand: Strand,
    strength: float,
) -> tuple[float, FloatArray]:
    """Weigh the stiffness and the load at first failure of paths, and return their displacement.

    Returns
    -------
    worth : float
        ``ratio^(1 - strength) load^strength``: a share of the one is worth as much as one of the
        other where strength is a half.
    displacement : (n, 3) array, mm
    """
    tested = virtual_test(toolpaths, part, strand, span=(), machine=machine)
    failed = first_failure(tested, strand, layers=layers)
    worth = tested.ratio ** (1.0 - strength) * failed.load**strength
    return float(worth), tested.solution.displacement
