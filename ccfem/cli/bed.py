"""What ``ccfem bed`` does: different parts, each with its own fibre, in one file."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from ccfem.base.errors import InputError
from ccfem.cli import options
from ccfem.cli.arguments import bed_table_of, parameters_by_strategy
from ccfem.cli.machines import MachineName, SetMachine
from ccfem.cli.part_choices import SetPlastic

if TYPE_CHECKING:
    from ccfem.cases.case import Case
    from ccfem.comparison.request import Request

_EACH = "once for all parts, or once for each in their order"


_Parts = Annotated[
    list[str],
    typer.Argument(metavar="CASE_OR_PART.toml ...", help="Parts; one may be named twice."),
]
_Strategies = Annotated[
    list[str] | None, typer.Option(metavar="S", help=f"Strategy, {_EACH}; default stream_function.")
]
_Layers = Annotated[list[int] | None, typer.Option(metavar="N", help=f"Layers of fibre, {_EACH}.")]
_Copies = Annotated[
    list[str] | None,
    typer.Option(metavar="N|NXxNY", help=f"How many, as 4, or 2x3 by X and Y, {_EACH}."),
]
_Turns = Annotated[
    list[str] | None, typer.Option(metavar="AXIS=DEGREES", help=f"Turn, as z=37, {_EACH}.")
]
_Centres = Annotated[
    list[str] | None,
    typer.Option(
        metavar="X,Y", help="Middle of each part on the bed, mm; else they are laid out in rows."
    ),
]


def bed(
    parts: _Parts,
    strategy: _Strategies = None,
    set_: options.SetOfStrategies = None,
    layers: _Layers = None,
    copies: _Copies = None,
    turn: _Turns = None,
    centre: _Centres = None,
    machine: MachineName = None,
    set_machine: SetMachine = None,
    set_plastic: SetPlastic = None,
    support: options.PrintedSupport = False,
    virtual_test: options.TestOrNot = None,
    backend: options.Backend = "auto",
    pause: options.Pause = None,
    from_layer: options.FromLayer = 0,
    cell: options.RobotCell = False,
    out: options.Out = None,
    force: options.Force = False,
) -> None:
    """Print several parts, each with its own fibre, in one file.

    Each part is planned by one strategy, with its natural amount of fibre. A part file says in its
    table [bed] how the part is turned, where it stands and how often; parts without a centre are
    laid out in rows. A print with a part that cannot be printed as planned is written, and ends
    with exit code 3; with --force it ends with 0.
    """
    from ccfem.base.progress import progress_bar
    from ccfem.base.result_folder import whole_folder
    from ccfem.cli.first_run import compiling_beside
    from ccfem.cli.run import elapsed, load, plan_code
    from ccfem.cli.screen import print_bed
    from ccfem.comparison.bed_files import BED_FILES, write_bed
    from ccfem.comparison.bed_print import needs_support, print_together
    from ccfem.printing.course import Course

    where = out or Path("results") / "bed"

    def ask() -> "list[Request]":
        given = (strategy or ["stream_function"], layers, turn, centre, copies)
        parameters, requests = parameters_by_strategy(set_ or ()), []
        for part, number in _counted(parts, *given).items():
            table = bed_table_of(part.turn and [part.turn], part.centre, number)
            case = load(part.case, None, False, machine, set_machine, None, table, set_plastic)
            request = _request(part, case, parameters, virtual_test, backend)
            requests.append(replace(request, support=support and needs_support(request)))
        return requests

    with (
        whole_folder(where, BED_FILES, force) as folder,
        compiling_beside(),
        progress_bar(lines=True) as progress,
    ):
        course = Course(tuple(pause or ()), from_layer)
        printed = print_together(ask(), course, progress)
        progress("writing results", 1.0)
        write_bed(printed, folder, shlex.join(["ccfem", *sys.argv[1:]]), cell)
    print_bed(printed, where, elapsed())
    codes = [plan_code(comparison, force) for comparison in printed.comparisons.values()]
    if any(codes):
        raise typer.Exit(max(codes))


class _Part(NamedTuple):
    """What is said of a part; parts of which the same is said are copies of one."""

    case: str
    strategy: str
    layers: int | None
    turn: str | None
    centre: str | None


def _request(
    part: _Part,
    case: "Case",
    parameters: dict[str, dict[str, Any]],
    test: bool | None,
    backend: str,
) -> "Request":
    """Ask for one part with its natural amount of fibre; short tests unless they are named."""
    from ccfem.comparison.request import DEFAULT_STRAND, LONGEST_TEST, Request, named_strategies

    chosen = {name: values for name, values in parameters.items() if name == part.strategy}
    return Request.of(
        case,
        named_strategies(case, (part.strategy,), chosen),
        part.layers,
        natural=True,
        strand=DEFAULT_STRAND if test is not False else None,
        backend=backend,
        print_plans=True,
        longest_test=LONGEST_TEST if test is None else float("inf"),
    )


def _counted(parts: Sequence[str], *given: Sequence[Any] | None) -> dict[_Part, str | None]:
    """Parts in their order, and how many of each; given are strategies and so on, and copies."""
    flags = ("--strategy", "--layers", "--turn", "--centre", "--copies")
    columns = [_for_each(*named, parts) for named in zip(flags, given, strict=True)]
    numbers: dict[_Part, list[str | None]] = {}
    for *about, number in zip(parts, *columns, strict=True):
        numbers.setdefault(_Part(*about), []).append(number)
    return {part: _together(several) for part, several in numbers.items()}


def _for_each(option: str, given: Sequence[Any] | None, parts: Sequence[str]) -> Sequence[Any]:
    """Values of an option for each part: one for all, or as many as there are parts."""
    if not given:
        return [None] * len(parts)
    if len(given) not in (1, len(parts)):
        raise InputError(
            f"{option} is given {_EACH}; got {len(given)} for {len(parts)} parts: give it once "
            f"or {len(parts)} times"
        )
    return list(given) * (len(parts) if len(given) == 1 else 1)


def _together(numbers: Sequence[str | None]) -> str | None:
    """Count copies of a part that is named once or several times."""
    from ccfem.printing.bed_layout import copies_of

    if len(numbers) == 1:
        return numbers[0]
    return str(sum(prod(copies_of(number or 1)) for number in numbers))
