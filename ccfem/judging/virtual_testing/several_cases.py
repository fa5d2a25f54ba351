"""One set of fibre paths tested under several load cases."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, in_brief
from ccfem.fem.elasticity.stress_field import WeightedCases
from ccfem.judging.virtual_testing.equilibrium import TENSION
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import VirtualTest, virtual_test
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.judging.virtual_testing.strands import Strands, cut_strands
from ccfem.judging.virtual_testing.strength import FirstFailure, first_failure
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers import Layer


@dataclass(frozen=True)
class CasesTest:
    """Virtual tests of one set of paths, one for each load case."""

    tests: tuple[VirtualTest, ...]  # in the order of the cases

    __repr__ = in_brief

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cases."""
        return tuple(test.unreinforced.case for test in self.tests)

    @property
    def ratios(self) -> FloatArray:
        """Stiffness over that of the part without fibre in each case, (n,)."""
        return np.array([test.ratio for test in self.tests])


@dataclass(frozen=True)
class CasesFailure:
    """First failure of a part that is loaded by one of several cases at a time."""

    each: tuple[FirstFailure, ...]  # first failure under each case
    factors: tuple[float, ...]  # load at first failure over the load of the case
    case: str  # the one that fails at the least factor

    __repr__ = in_brief

    @property
    def factor(self) -> float:
        """Least load at first failure over the load of its case."""
        return min(self.factors)


def specimens(cases: WeightedCases, backend: str = "auto") -> tuple[Specimen, ...]:
    """Specimens of several load cases; those of one problem share one factorisation."""
    leaders: dict[int, Specimen] = {}
    parts = []
    for field in cases.fields:
        leader = leaders.get(id(field.problem))
        specimen = Specimen.of(field, backend) if leader is None else leader.under(field)
        leaders.setdefault(id(field.problem), specimen)
        parts.append(specimen)
    return tuple(parts)


def virtual_tests(
    fibres: Toolpaths | Strands,
    parts: WeightedCases | Sequence[Specimen],
    strand: Strand | None = None,
    mode: str = TENSION,
    machine: Machine | None = None,
    known: Sequence[FloatArray] | None = None,
    tolerance: float = 1e-8,
    energy: float = 0.0,
) -> CasesTest:
    """Test a part with its fibres under several load cases, each with the fibres that it stretches.

    Paths are cut at the cells once; cases of one problem share one factorisation.

    Parameters
    ----------
    parts : WeightedCases, or sequence of Specimen
        The part without fibres under each case.
    strand, mode, machine, tolerance, energy
        As in `virtual_test`.
    known : sequence of (n, 3) arrays, mm, optional
        For each case a displacement near its solution, to start from.

    Raises
    ------
    InputError
        As `virtual_test`.
    SolveError
        When a solve misses its tolerance.
    """
    specimens_of_cases = specimens(parts) if isinstance(parts, WeightedCases) else tuple(parts)
    if isinstance(fibres, Toolpaths):
        fibres = cut_strands(fibres, specimens_of_cases[0].unreinforced.mesh, machine=machine)
    near = [()] * len(specimens_of_cases) if known is None else [(one,) for one in known]
    return CasesTest(
        tuple(
            virtual_test(fibres, one, strand, mode, (), None, start, tolerance, energy)
            for one, start in zip(specimens_of_cases, near, strict=True)
        )
    )


def cases_failure(
    tested: CasesTest, strand: Strand | None = None, layers: Sequence[Layer] | None = None
) -> CasesFailure:
    """Find the case in which a part fails at the least multiple of its load.

    Parameters and errors as in `first_failure`.
    """
    failures = tuple(first_failure(test, strand, layers=layers) for test in tested.tests)
    factors = tuple(
        failure.load / test.force for failure, test in zip(failures, tested.tests, strict=True)
    )
    return CasesFailure(failures, factors, tested.names[int(np.argmin(factors))])
