"""How stiff and how strong a part gets with how much fibre on how many layers, beside the bound."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ccfem.arrays import BoolArray, freeze
from ccfem.cases.case import Case
from ccfem.checks import check_number
from ccfem.comparison.front import on_front
from ccfem.comparison.judging import Solved
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import (
    Part,
    Tell,
    Tests,
    all_tested,
    attempted,
    counted,
    evaluated,
    with_plan,
)
from ccfem.elasticity.stress_field import StressField
from ccfem.errors import InputError
from ccfem.fibre_aware.upper_bound import upper_bound
from ccfem.layers.slicing.planar import Planar
from ccfem.planning.equal_fibre import TOLERANCE, plan_to_lengths
from ccfem.planning.strategy import Strategy
from ccfem.planning.whole_part import full_length
from ccfem.plot.amount_curves import AmountPoint, amount_curves
from ccfem.progress import Progress, silent
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.strand import Strand

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

__all__ = ["FibreFront", "FrontPoint", "counts_to_try", "fibre_front"]

_STIFFNESS, _FAILURE = "times unreinforced stiffness", "first failure, N"

_ALIKE = 0.005
"""Share by which two lengths differ at least to be two points."""


@dataclass(frozen=True)
class FrontPoint:
    """One plan.

    Attributes
    ----------
    layers : int
        Number of layers.
    asked : float, mm
        Length per layer that the strategy was asked for: asked again, it lays the same.
    length : float, mm
        Of fibre in all layers.
    ratio : float
        Stiffness over that of the part without fibre, fibres in tension only.
    failure : float, N
        Load at which something fails first; NaN where that is not known.
    fails_in : str
        "matrix", "fibre" or "interlayer"; empty where that is not known.
    bound : float
        Ratio that no paths of this length exceed, on the largest number of layers of the front.
    why_not : str
        What keeps the paths from being printed as they are; empty where they can be.
    toolpaths : Toolpaths
    """

    layers: int
    asked: float
    length: float
    ratio: float
    failure: float
    fails_in: str
    bound: float
    why_not: str
    toolpaths: Toolpaths


@dataclass(frozen=True)
class FibreFront:
    """Stiffness and first failure over the length of fibre.

    Attributes
    ----------
    case : str
        Name of the part.
    strategy : str
    points : tuple of FrontPoint
        By number of layers, then by length.
    refused : mapping of int to str
        Numbers of layers on which the strategy found no plan, with the reason.
    """

    case: str
    strategy: str
    points: tuple[FrontPoint, ...]
    refused: Mapping[int, str]

    def __post_init__(self) -> None:
        freeze(self, refused=dict)

    def __repr__(self) -> str:
        best = max(self.points, key=lambda each: each.ratio)
        return (
            f"FibreFront of '{self.case}' by {self.strategy}: {len(self.points)} plans, up to "
            f"{best.ratio:.3g} times as stiff with {best.length / 1000.0:.4g} m on {best.layers} "
            "layers"
        )

    @property
    def stiffest(self) -> BoolArray:
        """Printable plans that none with as little fibre exceeds in stiffness."""
        return self._front([each.ratio for each in self.points])

    @property
    def strongest(self) -> BoolArray:
        """Printable plans that none with as little fibre exceeds in first-failure load."""
        return self._front([each.failure for each in self.points])

    def _front(self, values: Sequence[float]) -> BoolArray:
        # Plans to one length differ by what the shortest strand leaves: these count as equal.
        laid = np.array([each.length for each in self.points])
        asked = np.array([each.asked * each.layers for each in self.points])
        lengths = np.where(np.abs(laid - asked) <= TOLERANCE * asked, asked, laid)
        printable = np.array([not each.why_not for each in self.points])
        return on_front(np.where(printable, lengths, np.nan), np.array(values))

    def plot(self) -> "Figure":
        """Draw stiffness and first-failure load over the length of fibre, with the bound."""
        panels: dict[str, dict[str, list[AmountPoint]]] = {_STIFFNESS: {}, _FAILURE: {}}
        rows = zip(self.points, self.stiffest.tolist(), self.strongest.tolist(), strict=True)
        for each, stiffest, strongest in rows:
            name, length, printable = f"{each.layers} layers", 1e-3 * each.length, not each.why_not
            found = (each.ratio, stiffest), (each.failure, strongest)
            for curves, (value, best) in zip(panels.values(), found, strict=True):
                curves.setdefault(name, []).append(AmountPoint(length, value, best, printable))
        bound = [(0.0, 1.0), *((1e-3 * each.length, each.bound) for each in self.points)]
        return amount_curves(panels, bound, f"{self.case}, {self.strategy}")

    def to_frame(self) -> "pd.DataFrame":
        """One row a plan."""
        import pandas as pd

        rows = [
            {
                "layers": each.layers,
                "fibre": each.length,
                "fibre_per_layer": each.asked,
                "stiffness_ratio_tension": each.ratio,
                "bound": each.bound,
                "share_of_gain": (each.ratio - 1.0) / (each.bound - 1.0),
                "first_failure_load": each.failure,
                "fails_in": each.fails_in,
                "printable": not each.why_not,
                "why_not": each.why_not,
                "stiffest": stiffest,
                "strongest": strongest,
            }
            for each, stiffest, strongest in zip(
                self.points, self.stiffest.tolist(), self.strongest.tolist(), strict=True
            )
        ]
        return pd.DataFrame(rows)


def counts_to_try(case: Case, stress: StressField) -> tuple[int, ...]:
    """Numbers of flat layers worth trying: the part's own, and twice as many where they have room.

    A layer has to be as high as a strand is (`Machine.strand_height`).
    """
    own = case.slicing(stress, case.build, case.machine)
    if any(layer.flat is None for layer in own):
        raise InputError(
            f"a front is of flat layers, those of '{case.name}' are curved: give --layers"
        )
    least = min(layer.thickness for layer in own)
    room = 0.5 * least >= case.machine.strand_height
    return (len(own), 2 * len(own)) if room else (len(own),)


def fibre_front(
    case: Case,
    stress: StressField,
    name: str,
    strategy: Strategy,
    counts: Sequence[int],
    points: int = 5,
    strand: Strand | None = None,
    backend: str = "auto",
    progress: Progress = silent,
) -> FibreFront:
    """Plan a part to several lengths of fibre on several numbers of layers, and test every plan.

    Lengths are evenly spaced up to what fills the largest number of layers. Fewer layers carry as
    much on each at the same length, and reach less at their most: a plan that lays its most is one
    point, however much more was asked for.

    Parameters
    ----------
    case : Case
    stress : StressField
        Its solution under the load case that counts.
    name : str
        Of the strategy.
    strategy : Strategy
    counts : sequence of int
        Numbers of flat layers, at least 1 each.
    points : int, default 5
        Lengths, at least 2.
    strand : Strand, optional
        Stiffness and strength of a strand; default rho = EA/E = 4 mm^2.
    backend : str, default "auto"
        As in `solve`.
    progress : callable

    Raises
    ------
    InputError
        When a number makes no sense, or the strategy finds no plan on any number of layers.
    """
    check_number("points", points, at_least=2)
    if not counts:
        raise InputError("a front takes at least one number of layers; got none")
    for count in counts:
        check_number("number of layers", count, at_least=1)
    strand = Strand() if strand is None else strand
    solved = Solved(case, stress, None, Tests.of(stress, None, strand, backend))
    slices = {
        count: case.fibre_layers(stress, Planar(count=count)) for count in sorted(set(counts))
    }
    parts = {count: solved.part(layers) for count, layers in slices.items()}
    most = max(count * full_length(part.layers, case.machine) for count, part in parts.items())
    lengths = most * np.arange(1, points + 1) / points
    tell = counted(progress, 0.1, (2 + 2 * points) * len(parts) + points)
    runs: list[tuple[int, float, Run]] = []
    refused: dict[int, str] = {}
    for count, part in parts.items():
        bare = Run(name, strategy, Toolpaths.empty(), None)
        tell(f"planning {name} on {count} layers")
        planned = _planned(bare, part, (lengths / count).tolist())
        tested = all_tested(
            [evaluated(run, part, tell) for _, run in planned], _of(solved), part, tell, ()
        )
        kept = [
            (count, asked, run)
            for (asked, _), run in zip(planned, tested, strict=True)
            if run.tested
        ]
        if not kept:
            refused[count] = next(
                (said for run in tested for said in (run.failure, run.untested) if said), "no fibre"
            )
        runs += kept
    if not runs:
        why = "; ".join(f"{count} layers: {reason}" for count, reason in refused.items())
        raise InputError(f"{name} finds no plan of '{case.name}': {why}")
    finest = parts[max(parts)]
    found = [_point(count, asked, run, stress, finest, tell) for count, asked, run in runs]
    return FibreFront(case.name, name, tuple(found), refused)


def _of(solved: Solved) -> Tests:
    assert solved.tests is not None
    return solved.tests


def _planned(bare: Run, part: Part, lengths: Sequence[float]) -> list[tuple[float, Run]]:
    """Plans of different length, each with what was asked for; one that says why there is none."""
    found = []

    def work() -> Run:
        found.extend(
            plan_to_lengths(bare.strategy, part.layers, part.stress, part.machine, lengths)
        )
        return bare

    done = attempted(bare, work)
    if done.failure:
        return [(lengths[0], done)]
    kept: list[tuple[float, Run]] = []
    for asked, each in zip(lengths, found, strict=True):
        last = kept[-1][1].length_per_layer if kept else 0.0
        if each.length_per_layer > (1.0 + _ALIKE) * last:
            kept.append((asked, with_plan(bare, each)))
    return kept or [(lengths[0], with_plan(bare, found[0]))]


def _point(
    count: int, asked: float, run: Run, stress: StressField, finest: Part, tell: Tell
) -> FrontPoint:
    """Bound the length of a run, and keep what the front shows of it."""
    assert run.tested is not None
    tell(f"bounding {run.length / 1000.0:.3g} m")
    bound = upper_bound(stress, finest.layers, run.length, finest.machine, finest.strand)
    failure = run.tested.failure
    return FrontPoint(
        layers=count,
        asked=asked,
        length=run.length,
        ratio=run.tested.bracket.tension.ratio,
        failure=float("nan") if failure is None else failure.load,
        fails_in=run.fails_in,
        bound=bound.ratio,
        why_not=run.why_not,
        toolpaths=run.toolpaths,
    )
