"""What ``ccfem bed`` does: different parts, each with its own fibre, in one file."""

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeVar

import typer

from ccfem.base.errors import InputError
from ccfem.cli import options
from ccfem.cli.arguments import argument, option, parameters_by_strategy
from ccfem.cli.machines import MachineName, SetMachine
from ccfem.cli.part_choices import PlacedPart, SetPlastic

if TYPE_CHECKING:
    from ccfem.cases.case import Case
    from ccfem.comparison.request import Request

_Value = TypeVar("_Value", str, int)
_EACH = "once for all parts, or once for each in their order"


class _Part(NamedTuple):
    """What is said of a part; parts of which the same is said are copies of one."""

    case: str
    strategy: str
    layers: int | None
    turn: str | None
    centre: str | None


@dataclass(frozen=True)
class PartsOptions:
    """Parts, and what is said of each of them."""

    parts: Annotated[list[str], argument("CASE_OR_PART.toml ...", "Parts; one may be named twice.")]
    strategy: Annotated[
        list[str] | None, option("S", f"Strategy, {_EACH}; default stream_function.")
    ] = None
    layers: Annotated[list[int] | None, option("N", f"Layers of fibre, {_EACH}.")] = None
    copies: Annotated[
        list[str] | None, option("N|NXxNY", f"How many, as 4, or 2x3 by X and Y, {_EACH}.")
    ] = None
    turn: Annotated[list[str] | None, option("AXIS=DEGREES", f"Turn, as z=37, {_EACH}.")] = None
    centre: Annotated[
        list[str] | None,
        option("X,Y", "Middle of each part on the bed, mm; else they are laid out in rows."),
    ] = None

    def counted(self) -> dict[_Part, str | None]:
        """Parts in their order, and how many of each."""
        strategy = _for_each("--strategy", self.strategy or ["stream_function"], self.parts)
        layers = _for_each("--layers", self.layers, self.parts)
        turn, centre = (
            _for_each(option, given, self.parts)
            for option, given in (("--turn", self.turn), ("--centre", self.centre))
        )
        copies = _for_each("--copies", self.copies, self.parts)
        numbers: dict[_Part, list[str | None]] = {}
        for *about, number in zip(self.parts, strategy, layers, turn, centre, copies, strict=True):
            numbers.setdefault(_Part(*about), []).append(number)
        return {part: _together(several) for part, several in numbers.items()}


@options.grouped
def bed(
    *,
    parts: PartsOptions,
    set_: options.SetOfStrategies = None,
    machine: MachineName = None,
    set_machine: SetMachine = None,
    set_plastic: SetPlastic = None,
    virtual_test: options.TestOrNot = None,
    backend: options.Backend = "auto",
    printing: options.PrintOptions,
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
    from ccfem.cli.run import elapsed, plan_code
    from ccfem.cli.screen import print_bed
    from ccfem.comparison.bed_print import needs_support, print_together
    from ccfem.comparison.files import BED_FILES, write_bed

    where = out or Path("results") / "bed"

    def ask() -> "list[Request]":
        parameters, requests = parameters_by_strategy(set_ or ()), []
        for part, number in parts.counted().items():
            turn = None if part.turn is None else [part.turn]
            chosen = PlacedPart(
                part.case,
                machine=machine,
                set_machine=set_machine,
                set_plastic=set_plastic,
                turn=turn,
                centre=part.centre,
                copies=number,
            )
            request = _request(part, chosen.read(), parameters, virtual_test, backend)
            support = printing.support and needs_support(request)
            requests.append(replace(request, support=support))
        return requests

    with (
        whole_folder(where, BED_FILES, force) as folder,
        compiling_beside(),
        progress_bar(lines=True) as progress,
    ):
        course = printing.course
        printed = print_together(ask(), course, progress)
        progress("writing results", 1.0)
        write_bed(printed, folder, shlex.join(["ccfem", *sys.argv[1:]]), printing.cell)
    print_bed(printed, where, elapsed())
    codes = [plan_code(comparison, force) for comparison in printed.comparisons.values()]
    if any(codes):
        raise typer.Exit(max(codes))


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


def _for_each(
    option: str, given: Sequence[_Value] | None, parts: Sequence[str]
) -> Sequence[_Value | None]:
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
