"""Comparison of strategies on one part: the same stress, layers, machine and length of fibre.

`compare` reads from top to bottom: solve and slice, plan, level the lengths, evaluate, plan the
print, test, bound.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any

from ccfem.cases.case import Case
from ccfem.cases.reading import read
from ccfem.checks import check_known, member_name
from ccfem.comparison.curve_stages import along_curve
from ccfem.comparison.ranking import off_length
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.stages import (
    Part,
    Tell,
    all_tested,
    evaluated,
    levelled,
    planned,
    timed,
    with_print,
)
from ccfem.elasticity.part_stress import GivenStress
from ccfem.elasticity.solve import solve
from ccfem.elasticity.stress_field import StressField
from ccfem.elasticity.support_kinds import PressingSupport
from ccfem.errors import InputError, known_names
from ccfem.export.print_plan import check_machine
from ccfem.fibre_aware.upper_bound import upper_bound
from ccfem.io.stress_file import read_stress
from ccfem.layers import Layer
from ccfem.layers.plane import plane_frame
from ccfem.layers.slicer import Slicer
from ccfem.layers.slicing import as_slicer
from ccfem.planning.equal_fibre import check_wanted
from ccfem.planning.given_paths import GivenPaths
from ccfem.planning.strategy import Strategy
from ccfem.progress import Progress, silent
from ccfem.strategies import create
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.strand import Strand

__all__ = [
    "DEFAULT_STRAND",
    "STRATEGIES",
    "ForeignStress",
    "compare",
    "create_all",
    "solve_and_slice",
]

STRATEGIES = ("isocurve", "concentric", "zigzag", "contour_zigzag")
"""The strategies that are compared when none are named."""

DEFAULT_STRAND = Strand()
"""What a strand is worth where nothing else is known."""

_BOUND_ITERATIONS = 7
"""The bound holds after any number of iterations; more than these lower it by half a per cent."""


@dataclass(frozen=True)
class ForeignStress:
    """Stress of another program in a file: see `ccfem.io.read_stress`.

    Attributes
    ----------
    path : path
    unit : str, optional
        Where the file does not say it.
    array : str, default "stress"
        Name of the array in a ``.vtu`` file.
    """

    path: str | os.PathLike[str]
    unit: str | None = None
    array: str = "stress"


def create_all(
    case: Case,
    strategies: Sequence[str | Strategy] = STRATEGIES,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
) -> dict[str, Strategy]:
    """Strategies by name, with the parameters of the case and, above these, those given.

    Parameters
    ----------
    case : Case
    strategies : sequence of str or Strategy
        One that is given itself keeps its parameters, and has the name of its module; a second one
        of a name gets a number.
    parameters : mapping of strategy name to parameters, optional

    Raises
    ------
    InputError
        For an unknown strategy or parameter, or one named twice.
    """
    given = dict(parameters or {})
    names = [one for one in strategies if isinstance(one, str)]
    if not strategies:
        raise InputError("name at least one strategy to compare; got none")
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        raise InputError(f"name each strategy once; got '{min(repeated)}' more than once")
    for name in given:
        if name not in names:
            raise InputError(
                f"parameters are given for '{name}', which is not among the strategies: "
                f"{known_names(name, names)}"
            )
    found: dict[str, Strategy] = {}
    for one in strategies:
        if isinstance(one, str):
            found[one] = create(one, {**case.parameters.get(one, {}), **given.get(one, {})})
            continue
        name = member_name(one)
        numbers = (f"{name}_{k}" for k in count(2))
        taken = {*found, *names}
        found[name if name not in taken else next(n for n in numbers if n not in taken)] = one
    return found


def solve_and_slice(
    case: Case,
    layers: int | Sequence[float] | str | Slicer | None = None,
    load_case: str | None = None,
    backend: str = "auto",
    given: ForeignStress | None = None,
) -> tuple[StressField, GivenStress | None, tuple[Layer, ...], dict[str, float]]:
    """Stress of one load case, that of another program, the layers, and the seconds of each.

    Parameters
    ----------
    case : Case
    layers : int, sequence of float, str or Slicer, optional
        Instead of the case's own slicing: a number of flat layers, their heights along the build
        direction in mm, the name of a slicer, or a slicer.
    load_case : str, optional
        By default the first one.
    backend : str, default "auto"
        As in `solve`.
    given : ForeignStress, optional
        Stress that the part is sliced on instead of the solved one.

    Raises
    ------
    InputError
        For an unknown load case, a problem that cannot be solved or sliced, and stress on another
        mesh.
    """
    seconds: dict[str, float] = {}
    name = _load_case(case, load_case)
    with timed(seconds, "solve"):
        stress = solve(case.problem, backend=backend)[name]
    read = None
    if given is not None:
        read = read_stress(given.path, stress.mesh, given.unit, given.array, stress.held_or_loaded)
    with timed(seconds, "slice"):
        slicer = case.slicing if layers is None else as_slicer(layers)
        stack = slicer(stress if read is None else read, case.build, case.machine)
    return stress, read, stack, seconds


def compare(
    case: Case | str | os.PathLike[str],
    strategies: Mapping[str, Strategy] | Sequence[str | Strategy] = STRATEGIES,
    layers: int | Sequence[float] | str | Slicer | None = None,
    fibre_per_layer: float | None = None,
    natural: bool = False,
    strand: Strand | None = DEFAULT_STRAND,
    load_case: str | None = None,
    backend: str = "auto",
    print_plans: bool = False,
    stress: ForeignStress | None = None,
    curve: bool | None = None,
    progress: Progress = silent,
) -> Comparison:
    """Solve a case once, and plan and evaluate each strategy on it.

    Strategies are compared at equal length of fibre: more fibre wins almost any comparison. When no
    length is given, it is the shortest natural length of any of them, and all others are thinned to
    it, each by its own parameter (`LayerStrategy.amount`). Paths of another program (`GivenPaths`)
    stay as they are: the least of their lengths is then the one for all, and their heights are
    those of the layers where no others are given. A strategy that fails stays in the result, with
    the reason. Where one cannot lay the length, the comparison is made along a curve too: stiffness
    over length of fibre.

    Parameters
    ----------
    case : Case, str or path
        A case, the name of one, or a part file.
    strategies : sequence of str or Strategy, or mapping of name to Strategy
        Those by name take the parameters of the case.
    layers : int, sequence of float, str or Slicer, optional
        Instead of the case's own slicing: a number of flat layers, their heights along the build
        direction in mm, the name of a slicer, or a slicer.
    fibre_per_layer : float, mm, optional
        Length that every strategy is held to, mean over the layers.
    natural : bool, default False
        Let every strategy lay its own amount instead.
    strand : Strand or None
        What a strand is worth in the virtual test; None leaves the test out.
    load_case : str, optional
        Load case to plan, evaluate and test for; by default the first one.
    backend : str, default "auto"
        As in `solve`.
    print_plans : bool, default False
        Also plan the print of the whole part by every strategy, matrix and fibre.
    stress : ForeignStress, optional
        File of another program with the stress, on the same mesh, to plan and evaluate on. Virtual
        tests and the bound solve the part themselves all the same.
    curve : bool, optional
        Test every strategy at three to five lengths of fibre (`Comparison.curve`). By default only
        where a strategy lays neither more nor less than its own, which is not the wanted length.
    progress : callable, optional
        Told what is being done, and the share that is done.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        When the case, a strategy's name or its parameters make no sense, or the machine cannot
        print though that was asked for.
    SolveError
        When the solve misses its tolerance.
    """
    case = read(case)
    if natural and fibre_per_layer is not None:
        raise InputError("give either a fibre length per layer or the natural amount, not both")
    if curve and strand is None:
        raise InputError("the curve is one of stiffness: leave the virtual test in, or it out")
    if fibre_per_layer is not None:
        check_wanted(fibre_per_layer)
    if print_plans:
        check_machine(case.machine)
    if not isinstance(strategies, Mapping):
        strategies = create_all(case, strategies)

    foreign = [one for one in strategies.values() if isinstance(one, GivenPaths)]
    if foreign and layers is None:
        layers = tuple(foreign[0].heights(plane_frame(case.build)[2]).tolist())
    progress(f"solving {case.name}", 0.0)
    field, given, stack, seconds = solve_and_slice(case, layers, load_case, backend, stress)
    part = Part(field if given is None else given, stack, case.machine, strand)
    tell = _counted(progress, 0.1, (5 if print_plans else 4) * len(strategies) + 1)
    runs = [
        Run(name, one.on(stack) if isinstance(one, GivenPaths) else one, Toolpaths.empty(), None)
        for name, one in strategies.items()
    ]
    asked_for, wanted = runs, fibre_per_layer
    if wanted is None and not natural:
        runs, wanted = levelled(runs, part, tell)
    else:
        runs = [planned(run, part, wanted, tell) for run in runs]
    runs = [evaluated(run, part, tell) for run in runs]
    if print_plans:
        runs = [with_print(run, part, tell) for run in runs]
    if strand is not None:
        alternative = None
        if case.alternative_supports:
            with timed(seconds, "solve, alternative supports"):
                alternative = _otherwise_held(case, field, backend)
        runs = all_tested(runs, field, part, strand, backend, tell, alternative)
    along = None
    if strand is not None and (curve or (curve is None and _misses(runs, wanted))):
        with timed(seconds, "curve"):
            along = along_curve(
                _as_asked(runs, asked_for),
                part,
                wanted,
                lambda some: all_tested(some, field, part, strand, backend, tell, alternative, ()),
                tell,
            )
    equal = [run for run in runs if run.tested is not None and not off_length(run, wanted)]
    lengths = [float(run.toolpaths.lengths.sum()) for run in equal]
    bound = None
    # The bound is one for flat layers, and for supports that hold both ways.
    pressing = any(isinstance(each, PressingSupport) for each in field.problem.supports)
    if lengths and not pressing and all(layer.flat is not None for layer in stack):
        tell("bounding what any paths could reach")
        with timed(seconds, "bound"):
            bound = upper_bound(
                field, stack, max(lengths), case.machine, strand, iterations=_BOUND_ITERATIONS
            )
    return Comparison(case, field, stack, tuple(runs), wanted, seconds, bound, given, along)


def _misses(runs: Sequence[Run], wanted: float | None) -> bool:
    """Whether a strategy lays another length than the wanted one, since it cannot lay that."""
    return any(
        off_length(run, wanted) and not isinstance(run.strategy, GivenPaths)
        for run in runs
        if run.evaluation is not None
    )


def _as_asked(runs: Sequence[Run], asked_for: Sequence[Run]) -> list[Run]:
    """Give runs the strategies back that were asked for, before any was brought to a length."""
    return [
        replace(run, strategy=asked.strategy) for run, asked in zip(runs, asked_for, strict=True)
    ]


def _otherwise_held(case: Case, field: StressField, backend: str) -> StressField:
    """Solution of the same load case under the alternative supports."""
    loads = {field.case: field.problem.loads[field.case]}
    supports = case.alternative_supports
    try:
        problem = replace(field.problem, supports=supports, loads=loads, combinations={})
        return solve(problem, backend)[field.case]
    except InputError as error:
        raise InputError(f"alternative supports: {error}") from None


def _load_case(case: Case, name: str | None) -> str:
    known = case.problem.cases
    if not known:
        raise InputError(f"case '{case.name}' has no load case; give it at least one load")
    if name is None:
        return known[0]
    check_known("load case", name, known)
    return name


def _counted(progress: Progress, first: float, steps: int) -> Tell:
    """Progress in steps of equal share, from the share `first` on."""
    number = count()

    def tell(what: str) -> None:
        progress(what, min(first + (1.0 - first) * next(number) / steps, 1.0))

    return tell
