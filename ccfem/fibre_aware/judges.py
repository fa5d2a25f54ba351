"""Tests of paths: their value, and the worth of their fibre by its strain."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ccfem.arrays import FloatArray, in_brief
from ccfem.fibre_aware.strain_worth import StrainWorth
from ccfem.fibre_aware.strength_value import Worth, layer_normal
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.equilibrium import equilibrium
from ccfem.virtual_testing.specimen import Specimen
from ccfem.virtual_testing.strand import Strand
from ccfem.virtual_testing.strands import cut_strands
from ccfem.virtual_testing.strength import first_failure
from ccfem.virtual_testing.virtual_test import virtual_test

__all__ = ["Judge", "Judged", "stiffest", "stiffness_judge", "strength_judge"]

_TOLERANCE = 1e-4
"""Relative residual of the tests; the error of the stiffness is of its square."""


@dataclass(frozen=True)
class Judged:
    """Result of a test of paths.

    Attributes
    ----------
    value : float
        Value to be maximised.
    strain_worths : callable
        Returns the worth of fibre by its strain, for each load case. With strength this takes
        further solves, so it is computed only when called.
    """

    value: float
    strain_worths: Callable[[], tuple[StrainWorth, ...]]

    __repr__ = in_brief


Judge: TypeAlias = Callable[[Toolpaths], Judged]


def stiffness_judge(part: Specimen, machine: Machine, strand: Strand | None = None) -> Judge:
    """Judge of paths by the stiffness of the part, as in `ccfem.virtual_test` with the machine."""
    axial = (Strand() if strand is None else strand).stiffness(part.modulus)
    known: list[FloatArray] = []

    def judge(toolpaths: Toolpaths) -> Judged:
        strands = cut_strands(toolpaths, part.unreinforced.mesh, machine=machine)
        found = equilibrium(part, strands, axial, known=known[-1:], tolerance=_TOLERANCE)
        u = found.displacement
        known[:] = [u]
        return Judged(part.stiffness(u, 0.5 * found.work), lambda: (StrainWorth(1.0, u),))

    return judge


def strength_judge(
    part: Specimen,
    layers: Sequence[Layer],
    machine: Machine,
    strand: Strand,
    strength: float,
    for_both: bool = True,
) -> Judge:
    """Judge of paths by the stiffness and the load at first failure.

    The value is ``ratio^(1 - strength) load^strength``: at a strength of one half, relative changes
    of both count equally. With `for_both` the worth of fibre by its strain is that for both,
    else that for the stiffness alone.
    """
    worth = Worth.of((part,), strand, strength)

    def judge(toolpaths: Toolpaths) -> Judged:
        tested = virtual_test(toolpaths, part, strand, span=(), machine=machine)
        failed = first_failure(tested, strand, layers=layers)
        value = tested.ratio ** (1.0 - strength) * failed.load**strength
        strands, normal = tested.strands, layer_normal(toolpaths)

        def strain_worths() -> tuple[StrainWorth, ...]:
            if not for_both:
                return (StrainWorth(1.0, tested.solution.displacement),)
            axial, near = strand.stiffness(part.modulus), (tested.solution.displacement,)
            found = equilibrium(part, strands, axial, known=near, tolerance=_TOLERANCE)
            return worth.strain_worths(strands, (found,), normal)

        return Judged(float(value), strain_worths)

    return judge


def stiffest(candidates: Sequence[Toolpaths], judge: Judge) -> Toolpaths:
    """Return the toolpaths of highest value, the first of equal ones; one alone is not tested."""
    laid = [one for one in candidates if len(one)]
    if len(laid) < 2:
        return laid[0] if laid else candidates[0]
    return laid[int(np.argmax([judge(one).value for one in laid]))]
