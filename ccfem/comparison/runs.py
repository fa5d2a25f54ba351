"""One strategy of a comparison: its paths, and their results."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any, Protocol

from ccfem.base.arrays import freeze, in_brief
from ccfem.comparison.tested_cases import TestedCases
from ccfem.judging.evaluation import Evaluation
from ccfem.judging.evaluation.strand_rules import StrandVerdict
from ccfem.judging.virtual_testing.pinned_joints import PinnedJoint
from ccfem.judging.virtual_testing.progressive_failure import BreakingLoad
from ccfem.judging.virtual_testing.scatter import RatioScatter
from ccfem.judging.virtual_testing.stiffness_test import Bracket
from ccfem.judging.virtual_testing.strength import FirstFailure
from ccfem.paths.planning.strategy import Strategy
from ccfem.paths.splitting.printed_strands import PrintedStrands
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.moves import Moves
from ccfem.printing.print_plan import PrintPlan
from ccfem.printing.print_totals import PrintTotals


class Printed(Protocol):
    """What is printed in one file: a run, or several parts together."""

    @property
    def name(self) -> str:
        """Name of the print."""

    @property
    def print_plan(self) -> PrintPlan | None:
        """All layers; None where no print is planned."""

    @property
    def moves(self) -> Moves | None:
        """All that the machine does."""

    @property
    def print_totals(self) -> PrintTotals | None:
        """What it takes."""


@dataclass(frozen=True)
class Tested:
    """The virtual test of one strategy's paths.

    Attributes
    ----------
    bracket : Bracket
        By what fibre in compression carries.
    failure : FirstFailure or None
        Of the tension-only test; None where a strength is unknown.
    note : str
        Why there is no first-failure load; else empty.
    matrix_before : float, MPa
        Peak of the averaged von Mises stress without fibre; NaN where it cannot be judged.
    alternative : Tested, optional
        The same under the alternative supports of the case, if it has any.
    most : float
        Stiffness ratio that no paths of the compared length can exceed; NaN without a bound.
    cases : TestedCases, optional
        The tests under all load cases, if paths are planned for several.
    joints : tuple of PinnedJoint
        Holes that pins press on, the weakest first; none where a strength is unknown.
    pins_not_judged : str
        In which holes pins press where the wall is no cylinder; empty without any.
    scatter : RatioScatter, optional
        Of the stiffness ratio in tension only.
    """

    bracket: Bracket
    failure: FirstFailure | None
    note: str = ""
    matrix_before: float = float("nan")
    alternative: "Tested | None" = None
    most: float = float("nan")
    cases: TestedCases | None = None
    scatter: RatioScatter | None = None
    joints: tuple[PinnedJoint, ...] = ()
    pins_not_judged: str = ""

    __repr__ = in_brief


@dataclass(frozen=True)
class Run:
    """Result of one strategy on the part.

    Attributes
    ----------
    name : str
        Of the strategy, and of the slicing where several are compared: "zigzag on planar:z".
    strategy : Strategy
        With the parameters that it ran with.
    toolpaths : Toolpaths
        The strands of fibre as they are printed: what is judged, timed, drawn and written.
    strands : PrintedStrands or None
        These, and what became of the rest of the planned paths; None where there are no paths, and
        where they cannot be split into strands (`unprinted`).
    evaluation : Evaluation or None
        None where the strategy failed.
    strand_verdict : StrandVerdict
        Which strands break which rule, and where.
    tested : Tested or None
        None where the strategy failed, and where no virtual test was asked for or possible.
    print_plan : PrintPlan or None
        The whole part, matrix and fibre; None where the strategy failed, and where no print was
        asked for or possible.
    moves : Moves or None
        All that the machine does in that print.
    print_totals : PrintTotals or None
        Its time and mass.
    printed_volume : float
        Volume of matrix and fibre of the print plan over that of the part; NaN without a plan.
    length_per_layer : float, mm
    asked : float, mm, optional
        Length per layer that the strategy was asked for: asked again, it lays the same. None where
        it was asked for none, or for the one of the whole comparison.
    sampled : float, mm, optional
        The same on a few layers, if no others were planned.
    note : str
        Why the length is not the wanted one, or that this run sets it; else empty.
    failure : str
        One line on why there are no paths, or why they could not be evaluated; else empty.
    untested : str
        Why there is no virtual test although one was asked for; else empty.
    why_not : str
        What keeps the paths from being printed as they are: `unprinted`, and lengths, turns, room,
        fibre outside the part or on nothing; empty if they can be.
    broken : BreakingLoad or None
        The load that breaks the part, an experiment; None where it was not asked for or possible.
    unbroken : str
        Why there is no breaking load although it was asked for; else empty.
    unprinted : str
        Why the machine cannot print the part as planned, or why no file of the print can be made
        although one was asked for; else empty.
    slicing : str
        Name of the slicing; empty where slicings are not compared.
    planned_layers : int
        Number of layers that were planned, where the others take their paths; else 0.
    seconds : mapping of stage to float
    """

    name: str
    strategy: Strategy
    toolpaths: Toolpaths
    evaluation: Evaluation | None
    strand_verdict: StrandVerdict = field(default_factory=StrandVerdict)
    tested: Tested | None = None
    strands: PrintedStrands | None = None
    print_plan: PrintPlan | None = None
    moves: Moves | None = None
    print_totals: PrintTotals | None = None
    printed_volume: float = float("nan")
    length_per_layer: float = 0.0
    asked: float | None = None
    sampled: float | None = None
    note: str = ""
    failure: str = ""
    untested: str = ""
    why_not: str = ""
    unprinted: str = ""
    broken: BreakingLoad | None = None
    unbroken: str = ""
    slicing: str = ""
    planned_layers: int = 0
    seconds: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        freeze(self, seconds=dict)

    def __repr__(self) -> str:
        if self.failure:
            return f"Run {self.name!r}: failed: {self.failure}"
        amount = f"{len(self.toolpaths)} paths, {self.length_per_layer:.0f} mm of fibre a layer"
        if self.tested is None:
            return f"Run {self.name!r}: {amount}"
        return (
            f"Run {self.name!r}: {amount}, {self.tested.bracket.tension.ratio:.2f} times as stiff"
        )

    def _repr_html_(self) -> str:
        remarks = (self.note, self.why_not, self.untested)
        lines = [f"<p>{escape(line)}</p>" for line in (repr(self), *remarks) if line]
        return "".join(lines) + (self.toolpaths._repr_html_() if len(self.toolpaths) else "")

    def plot(self, layer: int | None = None) -> Any:
        """Draw the paths of one layer, by default of the one with most fibre."""
        return self.toolpaths.plot(layer=layer)

    @property
    def strategy_name(self) -> str:
        """Name of the strategy alone."""
        return self.name.removesuffix(f" on {self.slicing}") if self.slicing else self.name

    @property
    def length(self) -> float:
        """Length of fibre in all layers, mm; 0 if nothing was evaluated."""
        layers = 0 if self.evaluation is None else len(self.evaluation.layers)
        return self.length_per_layer * layers

    @property
    def printable(self) -> bool:
        """Whether there are paths, within all limits of the machine."""
        return self.evaluation is not None and not self.why_not

    @property
    def cases(self) -> TestedCases | None:
        """Tests under all load cases, where paths are planned for several."""
        return None if self.tested is None else self.tested.cases

    @property
    def fails_in(self) -> str:
        """What fails first, as "matrix", "fibre" or "interlayer"; empty if that is not known."""
        failure = None if self.tested is None else self.tested.failure
        return "" if failure is None else failure.what

    @property
    def empty_layers(self) -> int:
        """Layers on which the run lays no fibre."""
        if self.evaluation is None:
            return 0
        return int((self.evaluation.values["paths"][:-1] == 0.0).sum())

    @property
    def parameters(self) -> dict[str, Any]:
        """Parameters of the strategy by name."""
        fields = dataclasses.fields(self.strategy)  # type: ignore[arg-type]
        return {f.name: getattr(self.strategy, f.name) for f in fields}
