"""Virtual tests of one strategy's paths under all load cases, and their merit."""

from collections.abc import Sequence
from dataclasses import dataclass

from ccfem.base.arrays import FloatArray, in_brief
from ccfem.base.errors import InputError
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.judging.virtual_testing.anchorage import Anchorage
from ccfem.judging.virtual_testing.equilibrium import IN_COMPRESSION, TENSION
from ccfem.judging.virtual_testing.pinned_joints import PinnedJoint, pinned_joints
from ccfem.judging.virtual_testing.several_cases import (
    CasesFailure,
    CasesTest,
    cases_failure,
    specimens,
    virtual_tests,
)
from ccfem.judging.virtual_testing.strand import Limits, Strand
from ccfem.judging.virtual_testing.strands import Strands
from ccfem.machine import Machine
from ccfem.slicing.layers import Layer
from ccfem.strategies.fibre_aware.upper_bound import UpperBound

RESIDUAL = 1e-6
"""Largest relative residual of the tests: the error of the stiffness is of its square."""

ENERGY = 1e-3
"""Error in energy norm of those on quadratic cells, far below what cells leave by themselves: the
error of the stiffness is of its square, that of a force in a strand of its size."""


@dataclass(frozen=True)
class TestedCases:
    """Virtual tests of one strategy's paths under several load cases."""

    # Fibres that carry no compression, a fifth of it, and all of it.
    tension: CasesTest
    partial: CasesTest
    bonded: CasesTest
    # Of the tests in tension; None where a strength is unknown.
    failure: CasesFailure | None
    # Holes that pins press on in each case, the weakest first; empty where a strength is unknown.
    joints: tuple[tuple[PinnedJoint, ...], ...] = ()
    # What no paths of the compared length can exceed; None without a bound.
    bound: UpperBound | None = None

    __repr__ = in_brief

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cases."""
        return self.tension.names

    def shares(self, mode: str = TENSION) -> FloatArray:
        """Stiffness ratio of each case over its own bound, (n,); over 1 without a bound."""
        ratios = self._of(mode).ratios
        return ratios if self.bound is None else self.bound.shares(ratios)

    def _of(self, mode: str) -> CasesTest:
        test: CasesTest = getattr(self, mode)
        return test

    def merit(self, mode: str = TENSION) -> float:
        """Least share of all cases, by which runs are ranked."""
        return float(self.shares(mode).min())

    @property
    def weakest_pin(self) -> tuple[float, str, PinnedJoint] | None:
        """Least load at which a pin tears out over that of its case, the case, and the joint."""
        tests = self.tension.tests
        pins = [
            (joints[0].load / test.force, name, joints[0])
            for name, test, joints in zip(
                self.names, tests, self.joints or [()] * len(tests), strict=True
            )
            if joints
        ]
        return min(pins, key=lambda pin: pin[0], default=None)

    def values(self) -> dict[str, float]:
        """Every value by its column; those of a case have its name in brackets."""
        values: dict[str, float] = {}
        for k, name in enumerate(self.names):
            for mode in IN_COMPRESSION:
                values[f"stiffness_ratio_{mode}[{name}]"] = float(self._of(mode).ratios[k])
            if self.bound is not None:
                values[f"share_of_bound[{name}]"] = float(self.shares()[k])
            if self.failure is not None:
                values[f"first_failure_load[{name}]"] = self.failure.each[k].load
                values[f"first_failure_factor[{name}]"] = self.failure.factors[k]
        if self.bound is not None:
            values["worst_share_of_bound"] = self.merit()
            values["above_bound"] = self.bound.gap(self.tension.ratios)
        if self.failure is not None:
            values["first_failure_factor"] = self.failure.factor
        for name, joints in zip(self.names, self.joints, strict=False):
            if joints:
                values[f"pinned_joint_load[{name}]"] = joints[0].load
        if (weakest := self.weakest_pin) is not None:
            values["pinned_joint_factor"] = weakest[0]
        return values


def in_all_cases(
    strands: Strands,
    cases: WeightedCases,
    strand: Strand,
    layers: Sequence[Layer],
    machine: Machine,
) -> TestedCases:
    """Test strands under all cases, in every mode."""
    parts = specimens(cases)
    modes: list[CasesTest] = []
    near = None
    for mode in IN_COMPRESSION:  # each starts from the one before
        modes.append(
            virtual_tests(strands, parts, strand, mode, None, near, RESIDUAL, energy=ENERGY)
        )
        near = [test.solution.displacement for test in modes[-1].tests]
    try:
        failure = cases_failure(modes[0], strand, layers=layers)
    except InputError:  # the strength of matrix or strand is unknown: `Tested.note` says so
        return TestedCases(modes[0], modes[1], modes[2], None)
    limits = Limits.of(parts[0].unreinforced.material, strand)
    anchorage = Anchorage.of(strands, machine)
    joints = tuple(
        pinned_joints(test.solution, part.forces, test.force, limits, anchorage)
        for test, part in zip(modes[0].tests, parts, strict=True)
    )
    return TestedCases(modes[0], modes[1], modes[2], failure, joints)
