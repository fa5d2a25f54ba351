"""Comparison of strategies on one part: with the same stress, layers, machine and fibre length.

`compare` reads from top to bottom: solve and slice, plan, equalise the lengths, evaluate, plan the
print, test, bound.
"""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import Any, overload

from ccfem.cases.case import Case
from ccfem.cases.load_cases import asks_for_all, weighted_cases
from ccfem.cases.reading import read
from ccfem.checks import check_known, member_name
from ccfem.comparison.asked import check_all, check_amount
from ccfem.comparison.judging import Solved, check_propped, judged
from ccfem.comparison.over_slicings import named_slicers, over_slicings
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.slicings import SlicingComparison
from ccfem.comparison.stages import Tests, counted, levelled, planned, timed
from ccfem.elasticity.part_stress import GivenStress
from ccfem.elasticity.solve import solve
from ccfem.elasticity.stress_field import StressField
from ccfem.errors import InputError, known_names
from ccfem.io.stress_file import read_stress
from ccfem.layers import Layer
from ccfem.layers.plane import plane_frame
from ccfem.layers.slicer import Slicer
from ccfem.layers.slicing import as_slicer
from ccfem.planning.given_paths import GivenPaths
from ccfem.planning.strategy import Strategy
from ccfem.printing.print_plan import check_machine
from ccfem.progress import Progress, silent
from ccfem.strategies import create
from ccfem.toolpaths import Toolpaths
from ccfem.virtual_testing.several_cases import specimens
from ccfem.virtual_testing.strand import Strand

__all__ = [
    "DEFAULT_STRAND",
    "STRATEGIES",
    "ForeignStress",
    "compare",
    "create_all",
    "otherwise_held",
    "solve_and_slice",
]

STRATEGIES = ("isocurve", "concentric", "zigzag", "contour_zigzag")
"""The strategies that are compared when none are named."""

DEFAULT_STRAND = Strand()
"""Stiffness and strength of a strand where nothing else is known."""


@dataclass(frozen=True)
class ForeignStress:
    """Stress of another program in a file: see `ccfem.io.read_stress`.

    Attributes
    ----------
    path : path
    unit : str, optional
        Unit of the stress, if the file does not state it.
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
    """Make strategies by name, with the parameters of the case, which those given override.

    Parameters
    ----------
    case : Case
    strategies : sequence of str or Strategy
        A strategy object keeps its parameters and gets the name of its module; a second one of the
        same name gets a number.
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
    stress, read, seconds = _stress_of(case, load_case, backend, given)
    with timed(seconds, "slice"):
        slicer = None if layers is None else as_slicer(layers)
        stack = case.fibre_layers(stress if read is None else read, slicer)
    return stress, read, stack, seconds


def _stress_of(
    case: Case, load_case: str | None, backend: str, given: ForeignStress | None
) -> tuple[StressField, GivenStress | None, dict[str, float]]:
    """Stress of one load case, that of another program, and the seconds of it."""
    seconds: dict[str, float] = {}
    name = _load_case(case, load_case)
    with timed(seconds, "solve"):
        stress = solve(case.problem, backend=backend)[name]
    read = None
    if given is not None:
        found = read_stress(given.path, stress.mesh, given.unit, given.array, stress.held_or_loaded)
        read = replace(found, material=stress.material)
    return stress, read, seconds


@overload
def compare(
    case: Case | str | os.PathLike[str],
    strategies: Mapping[str, Strategy] | Sequence[str | Strategy] = ...,
    layers: int | Sequence[float] | str | Slicer | None = ...,
    fibre_per_layer: float | None = ...,
    natural: bool = ...,
    strand: Strand | None = ...,
    load_case: str | None = ...,
    backend: str = ...,
    print_plans: bool = ...,
    support: bool = ...,
    stress: ForeignStress | None = ...,
    curve: bool | None = ...,
    progress: Progress = ...,
    slicings: None = ...,
    fibre: float | None = ...,
) -> Comparison: ...


@overload
def compare(
    case: Case | str | os.PathLike[str],
    strategies: Mapping[str, Strategy] | Sequence[str | Strategy] = ...,
    layers: None = ...,
    fibre_per_layer: None = ...,
    natural: bool = ...,
    strand: Strand | None = ...,
    load_case: str | None = ...,
    backend: str = ...,
    print_plans: bool = ...,
    support: bool = ...,
    stress: ForeignStress | None = ...,
    curve: bool | None = ...,
    progress: Progress = ...,
    *,
    slicings: Mapping[str, Slicer] | Sequence[str | Slicer],
    fibre: float | None = ...,
) -> SlicingComparison: ...


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
    support: bool = False,
    stress: ForeignStress | None = None,
    curve: bool | None = None,
    progress: Progress = silent,
    slicings: Mapping[str, Slicer] | Sequence[str | Slicer] | None = None,
    fibre: float | None = None,
) -> Comparison | SlicingComparison:
    """Solve a case once, and plan and evaluate each strategy on it.

    Strategies are compared at equal length of fibre, since more fibre wins almost any comparison.
    If no length is given, it is the shortest natural length of any strategy. All others are thinned
    to it, each by its own parameter (`LayerStrategy.amount`). Paths of another program
    (`GivenPaths`) are never changed: the shortest of their lengths then applies to all, and their
    heights are those of the layers if no others are given. A strategy that fails stays in the
    result, with the reason. If a strategy cannot lay the length, stiffness is also compared along a
    curve over the length of fibre.

    With `slicings` the part is cut in several ways, and each strategy is planned on each of them.
    All lay the same total length of fibre, whatever the number of layers.

    Parameters
    ----------
    case : Case, str or path
        A case, the name of one, or a part file.
    strategies : sequence of str or Strategy, or mapping of name to Strategy
        Strategies given by name take the parameters of the case.
    layers : int, sequence of float, str or Slicer, optional
        Instead of the case's own slicing: a number of flat layers, their heights along the build
        direction in mm, the name of a slicer, or a slicer.
    fibre_per_layer : float, mm, optional
        Length that every strategy is held to, as a mean over the layers.
    natural : bool, default False
        Let every strategy lay its own amount instead.
    strand : Strand or None
        Stiffness and strength of a strand in the virtual test; None leaves the test out.
    load_case : str, optional
        Load case to plan, evaluate and test for; by default the first one. "all" plans for all of
        them at once, weighted by `Case.weights`, tests under all and ranks by the worst.
    backend : str, default "auto"
        As in `solve`.
    print_plans : bool, default False
        Also plan the print of the whole part, matrix and fibre, for every strategy.
    support : bool, default False
        Also print support below a part of curved layers (`ccfem.support`).
    stress : ForeignStress, optional
        Stress file of another program, on the same mesh, to plan and evaluate on. Virtual tests and
        the bound still solve the part themselves.
    curve : bool, optional
        Test every strategy at three to five lengths of fibre (`Comparison.curve`). By default only
        if a strategy cannot change its amount of fibre to the wanted length. Never over several
        slicings.
    progress : callable, optional
        Receives what is being done, and the share of the work that is done.
    slicings : sequence of str or Slicer, or mapping of name to Slicer, optional
        Ways to cut the part, instead of `layers`, such as ``["planar:z", "planar:x", "spatial"]``.
    fibre : float, mm, optional
        Total length that every strategy is held to in all layers, instead of `fibre_per_layer`.

    Returns
    -------
    Comparison, or SlicingComparison where `slicings` are given

    Raises
    ------
    InputError
        When the case, the name of a strategy or its parameters are invalid, or when a print is
        asked for that the machine cannot do.
    SolveError
        When the solve misses its tolerance.
    """
    case = read(case)
    if asks_for_all(case, load_case):
        check_all(strand, stress, curve, slicings)
    check_amount(fibre_per_layer, fibre, natural)
    if curve and strand is None:
        raise InputError("the curve is one of stiffness: leave the virtual test in, or it out")
    if print_plans:
        check_machine(case.machine)
    elif support:
        raise InputError("support is laid in a print: plan that too (print_plans, --gcode)")
    if not isinstance(strategies, Mapping):
        strategies = create_all(case, strategies)
    foreign = [one for one in strategies.values() if isinstance(one, GivenPaths)]
    if slicings is not None:
        if layers is not None or fibre_per_layer is not None or foreign or curve:
            raise InputError(
                "over several slicings there are no layers, fibre_per_layer, given paths or curve: "
                "drop them, and give fibre, the length in all"
            )
        if print_plans:
            raise InputError("prints are planned on one slicing: drop print_plans or slicings")
        slicers = named_slicers(slicings)
        solved, seconds = _solved(case, strand, load_case, backend, stress, progress)
        return over_slicings(solved, strategies, slicers, fibre, natural, seconds, progress)

    if foreign and layers is None:
        layers = tuple(foreign[0].heights(plane_frame(case.build)[2]).tolist())
    slicer = None if layers is None else as_slicer(layers)
    check_propped(case.slicing if slicer is None else slicer, support)
    solved, seconds = _solved(case, strand, load_case, backend, stress, progress)
    with timed(seconds, "slice"):
        stack, below = solved.cut(slicer, support)
    part = solved.part(stack, below, slicer)
    tell = counted(progress, 0.1, (5 if print_plans else 4) * len(strategies) + 1)
    runs = [
        Run(name, one.on(stack) if isinstance(one, GivenPaths) else one, Toolpaths.empty(), None)
        for name, one in strategies.items()
    ]
    asked_for = runs
    wanted = fibre_per_layer if fibre is None else fibre / max(len(stack), 1)
    if wanted is None and not natural:
        runs, wanted = levelled(runs, part, tell)
    else:
        runs = [planned(run, part, wanted, tell) for run in runs]
    return judged(
        solved, part, runs, asked_for, wanted, tell, curve, print_plans=print_plans, seconds=seconds
    )


def _solved(
    case: Case,
    strand: Strand | None,
    load_case: str | None,
    backend: str,
    stress: ForeignStress | None,
    progress: Progress,
) -> tuple[Solved, dict[str, float]]:
    """Solve a case, and prepare what virtual tests need; also return the seconds of each."""
    progress(f"solving {case.name}", 0.0)
    if asks_for_all(case, load_case) and strand is not None:
        seconds: dict[str, float] = {}
        with timed(seconds, "solve"):
            cases = weighted_cases(case, solve(case.problem, backend=backend))
        first = cases.heaviest
        with timed(seconds, "specimens"):
            specimens(cases, backend)
            tests = Tests.of(first, None, strand, backend)
        return Solved(case, first, None, tests, cases), seconds
    field, given, seconds = _stress_of(case, load_case, backend, stress)
    if strand is None:
        return Solved(case, field, given), seconds
    alternative = None
    if case.alternative_supports:
        with timed(seconds, "solve, alternative supports"):
            alternative = otherwise_held(case, field, backend)
    with timed(seconds, "specimens"):
        tests = Tests.of(field, alternative, strand, backend)
    return Solved(case, field, given, tests), seconds


def otherwise_held(case: Case, field: StressField, backend: str) -> StressField:
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
