"""The result of a comparison: what each strategy did on the same part."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ccfem.arrays import freeze
from ccfem.cases.case import Case
from ccfem.elasticity.part_stress import GivenStress, PartStress
from ccfem.elasticity.stress_field import StressField
from ccfem.evaluation import Evaluation
from ccfem.export.print_plan import PrintPlan
from ccfem.fibre_aware.upper_bound import UpperBound
from ccfem.layers import Layer
from ccfem.planning.strategy import Strategy
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.strength import FirstFailure
from ccfem.virtual_testing.virtual_test import Bracket

__all__ = ["Comparison", "Run", "Tested"]


@dataclass(frozen=True)
class Tested:
    """The virtual test of one strategy's paths.

    Attributes
    ----------
    bracket : Bracket
        Fibres that carry tension only, and bonded fibres.
    failure : FirstFailure or None
        Of the tension-only test; None where a strength is unknown.
    note : str
        Why there is no first-failure load; else empty.
    """

    bracket: Bracket
    failure: FirstFailure | None
    note: str = ""


@dataclass(frozen=True)
class Run:
    """What one strategy did on the part.

    Attributes
    ----------
    name : str
    strategy : Strategy
        With the parameters that it ran with.
    toolpaths : Toolpaths
    evaluation : Evaluation or None
        None where the strategy failed.
    tested : Tested or None
        None where the strategy failed, and where no virtual test was asked for or possible.
    print_plan : PrintPlan or None
        The whole part, matrix and fibre; None where the strategy failed, and where no print was
        asked for or possible.
    length_per_layer : float, mm
    note : str
        Why the length is not the wanted one, or that it sets it; else empty.
    failure : str
        One line that says why there are no paths, or why they could not be evaluated; else empty.
    untested : str
        Why there is no virtual test though one was asked for; else empty.
    unprinted : str
        Why the part cannot be printed as planned though a print was asked for; else empty.
    seconds : mapping of stage to float
    """

    name: str
    strategy: Strategy
    toolpaths: Toolpaths
    evaluation: Evaluation | None
    tested: Tested | None = None
    print_plan: PrintPlan | None = None
    length_per_layer: float = 0.0
    note: str = ""
    failure: str = ""
    untested: str = ""
    unprinted: str = ""
    seconds: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        freeze(self, seconds=dict)

    @property
    def parameters(self) -> dict[str, Any]:
        """Parameters of the strategy by name."""
        fields = dataclasses.fields(self.strategy)  # type: ignore[arg-type]
        return {f.name: getattr(self.strategy, f.name) for f in fields}


@dataclass(frozen=True)
class Comparison:
    """Runs of several strategies on the same part.

    Attributes
    ----------
    case : Case
    stress : StressField
        Of the load case that the paths are planned and evaluated for.
    layers : tuple of Layer
    runs : tuple of Run
        In the order they were asked for, failed ones included.
    fibre_per_layer : float, mm, or None
        Length that every strategy was held to; None where each laid its own.
    seconds : mapping of stage to float
        Solve and slice; the stages of each strategy are in its run.
    given : GivenStress, optional
        Stress of another program, where paths are planned and evaluated on that.
    bound : UpperBound or None
        Stiffness that no paths exceed at the largest length of any run; None without virtual tests.
    """

    case: Case
    stress: StressField
    layers: tuple[Layer, ...]
    runs: tuple[Run, ...]
    fibre_per_layer: float | None
    seconds: Mapping[str, float]
    bound: UpperBound | None = None
    given: GivenStress | None = None

    @property
    def planned_on(self) -> PartStress:
        """Stress that the paths are planned and evaluated on."""
        return self.stress if self.given is None else self.given

    def __post_init__(self) -> None:
        freeze(self, seconds=dict)

    @property
    def succeeded(self) -> tuple[Run, ...]:
        """Runs that did not fail."""
        return tuple(run for run in self.runs if run.evaluation is not None)
