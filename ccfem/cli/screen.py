"""What the command line prints: lists of cases and strategies, and the table of a comparison."""

import dataclasses
import inspect
import os
import re
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ccfem.checks import check_known
from ccfem.cli.docstring import about, attributes
from ccfem.comparison.headline import (
    HEADLINE,
    HEADLINE_OF_SLICINGS,
    Headline,
    cell_text,
    headline_values,
)
from ccfem.comparison.ranking import best_values
from ccfem.comparison.result import Comparison
from ccfem.comparison.runs import Run
from ccfem.comparison.said_of_cases import cases_rows
from ccfem.comparison.slicings import SlicingComparison
from ccfem.elasticity.stress_field import StressField, about_cells
from ccfem.tensor import von_mises
from ccfem.virtual_testing.stiffer import HONEST_PROMISE

__all__ = [
    "print_cases",
    "print_comparison",
    "print_member",
    "print_members",
    "print_slicings",
    "print_solution",
]

_TITLES, _NUMBERS = 30, 20
"""Characters that a table is given for its titles and for each strategy, where neither a terminal
nor COLUMNS sets its width."""


def print_cases() -> None:
    """Print the cases, what they are, and their parameters with defaults."""
    from ccfem.cases import named_cases

    console = Console(highlight=False)
    for name, make in sorted(named_cases().items()):
        console.print(f"[bold]{name}[/bold]  {_first_line(make)}")
        parameters = inspect.signature(make).parameters.values()
        given = ", ".join(f"{each.name} = {each.default!r}" for each in parameters)
        console.print(f"    {given}", markup=False)


def print_members(kind: str) -> None:
    """Print strategies or slicers with their parameters, defaults and choices.

    Parameters
    ----------
    kind : {"strategy", "slicer"}
    """
    console = Console(highlight=False)
    for name, member in sorted(_members(kind).items()):
        console.print(f"[bold]{name}[/bold]  {_first_line(member)}")
        table = Table(box=None, show_header=False, padding=(0, 2, 0, 4))
        hints = typing.get_type_hints(member)
        for field in dataclasses.fields(member):
            note = _amount(member, field.name) or _choices(hints[field.name])
            table.add_row(field.name, _default(field), note)
        console.print(table)


def print_member(kind: str, name: str) -> None:
    """Print what one strategy or slicer does, and what each of its parameters means.

    Raises
    ------
    InputError
        For an unknown name.
    """
    known = _members(kind)
    check_known(kind, name, sorted(known))
    member, by_class = known[name], {each.__name__: each for each in known.values()}
    console = Console(highlight=False)
    console.print(f"[bold]{name}[/bold]")
    for paragraph in about(member):
        console.print(paragraph, markup=False)
    table = Table(box=box.SIMPLE_HEAD, header_style="bold")
    for column in ("parameter", "default", "type, unit", "meaning"):
        table.add_column(column, overflow="fold")
    said = attributes(member)
    for field in dataclasses.fields(member):
        what = said[field.name].kind if field.name in said else ""
        note = _amount(member, field.name)
        meaning = _meaning(member, field.name, by_class)
        text = f"{meaning} {note and f'It {note}.'}".strip()
        table.add_row(*map(escape, (field.name, _default(field), what, text)))
    console.print(table)


def _members(kind: str) -> Mapping[str, typing.Any]:
    if kind == "slicer":
        from ccfem.layers import slicing

        return slicing.named()
    from ccfem import strategies

    return strategies.named()


def _meaning(of: type, parameter: str, by_class: Mapping[str, type]) -> str:
    """Say what a parameter means: "As in `Zigzag`" in the words of that class."""
    text = attributes(of)[parameter].meaning if parameter in attributes(of) else ""
    same = re.match(r"As in `(\w+)`", text)
    if same is None or same[1] not in by_class:
        return text
    return _meaning(by_class[same[1]], parameter, by_class).rstrip(".") + text[same.end() :]


def _amount(member: typing.Any, parameter: str) -> str:
    """Say that a parameter of a strategy sets the amount of fibre, where it does."""
    amount = getattr(member, "amount", None)
    if amount is None:
        return ""
    for name, most in amount.beyond:
        if name == parameter:
            return f"changes next, up to {most:g}, where {amount.parameter} alone lays too little"
    if parameter != amount.parameter:
        return ""
    return f"sets the amount of fibre: {amount.most:g} lays the most, {amount.least:g} the least"


def _default(field: "dataclasses.Field[typing.Any]") -> str:
    """Write the default of a parameter."""
    if field.default_factory is not dataclasses.MISSING:
        return repr(field.default_factory())
    return repr(field.default)


def _choices(hint: object) -> str:
    """Words that a parameter takes, where it takes words."""
    if typing.get_origin(hint) is not typing.Literal:
        return ""
    return "one of " + ", ".join(repr(word) for word in typing.get_args(hint))


def _first_line(what: object) -> str:
    return (inspect.getdoc(what) or "").split("\n")[0]


def print_comparison(comparison: Comparison, where: Path, seconds: float) -> None:
    """Print the headline table, the best of each row in bold, and where the results are."""
    console = Console(highlight=False, emoji=False)
    runs = [run for run in comparison.ranking if run.evaluation is not None]
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = max(console.width, _TITLES + _NUMBERS * len(runs))
    console.print(comparison.case.title, style="bold", markup=False)
    console.print(_headline_table(runs, best_values(comparison.runs, comparison.fibre_per_layer)))
    _print_load_cases(console, runs)
    _print_findings(console, comparison.case.findings, comparison.stress)
    console.print(about_cells(comparison.stress), style="dim", markup=False)
    for line in comparison.remarks:
        console.print(line, style="dim", markup=False)
    for said in comparison.verdicts:
        console.print(said, style="bold", markup=False)
    if any(run.tested is not None for run in runs):
        console.print(HONEST_PROMISE, style="dim", markup=False)
    console.print(f"{where / 'report.html'}  ({seconds:.1f} s)", markup=False, soft_wrap=True)


def _print_findings(
    console: Console, of_mesh: Sequence[str], field: StressField, margin: str = ""
) -> None:
    """Print what was found in a mesh, then what is doubtful about the part and its solution."""
    kinds = {"mesh": of_mesh, "warning": field.findings}
    for kind, lines in kinds.items():
        for line in lines:
            console.print(
                f"{margin}{kind}: {line}", style="dim", markup=False, soft_wrap=bool(margin)
            )


def _print_load_cases(console: Console, runs: Sequence[Run]) -> None:
    """Print what every run does under every load case, where there are several."""
    heads, rows = cases_rows(runs)
    if not rows:
        return
    table = Table(header_style="bold", box=box.SIMPLE_HEAD)
    table.add_column("load cases")
    for name, _ in rows:
        table.add_column(escape(name), justify="right", overflow="fold")
    for k, head in enumerate(heads):
        table.add_row(escape(head), *(cells[k] for _, cells in rows))
    console.print(table)


def print_slicings(comparison: SlicingComparison, where: Path, seconds: float) -> None:
    """Print the table over slicings and strategies, the best of each column in bold."""
    console = Console(highlight=False, emoji=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = max(console.width, 160)
    console.print(comparison.case.title, style="bold", markup=False)
    runs = comparison.ranking
    best = best_values(runs, comparison.wanted)
    values = {run.name: headline_values(run) for run in runs}
    known = {column for found in values.values() for column in found}
    heads = [head for head in HEADLINE_OF_SLICINGS if head.column in known]
    shown = list(heads)
    table = _slicings_table(runs, shown, values, best)
    while len(shown) > 1 and _is_cut(console, table):
        del shown[-1]
        table = _slicings_table(runs, shown, values, best)
    console.print(table)
    if len(shown) < len(heads):
        left = ", ".join(head.title for head in heads[len(shown) :])
        console.print(f"in the report: {left}", style="dim", markup=False)
    _print_findings(console, comparison.case.findings, comparison.stress)
    for line in comparison.remarks:
        console.print(line, style="dim", markup=False)
    if comparison.verdict:
        console.print(comparison.verdict, style="bold", markup=False)
    if any(run.tested is not None for run in runs):
        console.print(HONEST_PROMISE, style="dim", markup=False)
    console.print(f"{where / 'report.html'}  ({seconds:.1f} s)", markup=False, soft_wrap=True)


def _is_cut(console: Console, table: Table) -> bool:
    """Whether a screen is so narrow that words or numbers of a table are cut."""
    with console.capture() as capture:
        console.print(table)
    return "\N{HORIZONTAL ELLIPSIS}" in capture.get()


def _slicings_table(
    runs: Sequence[Run],
    heads: Sequence[Headline],
    values: Mapping[str, Mapping[str, float]],
    best: Mapping[str, float],
) -> Table:
    """Make the table over slicings and strategies: a row for each run, numbers in one piece."""
    table = Table(header_style="bold", box=box.SIMPLE_HEAD)
    table.add_column("", no_wrap=True)
    for head in heads:
        table.add_column(head.title, justify="right")
    for run in runs:
        if run.evaluation is None:
            table.add_row(run.name, "failed")
            continue
        cells = []
        for head in heads:
            text, extra = cell_text(run, head)
            if run.printable and values[run.name].get(head.column) == best.get(head.column, np.nan):
                text = f"[bold green]{text}[/]"
            cells.append(f"{text} [dim]({extra})[/]" if extra else text)
        table.add_row(run.name, *cells)
    return table


def print_solution(field: StressField, findings: Sequence[str], where: Path) -> None:
    """Print what a solve found in one load case, and where it is written."""
    console = Console(highlight=False, emoji=False)
    sizes = np.linalg.norm(field.displacement, axis=1)
    at = ", ".join(f"{x:.4g}" for x in field.mesh.points[sizes.argmax()])
    mises = von_mises(field.stress)
    record = field.record
    lines = [
        f"largest displacement {sizes.max():.4g} mm at ({at}) mm, strain energy "
        f"{field.strain_energy:.4g} N mm",
        f"von Mises stress of the cells up to {mises.max():.4g} MPa",
    ]
    for label, force in field.support_forces.items():
        lines.append(f"support {label}: ({', '.join(f'{x:.4g}' for x in force)}) N")
    lines.append(about_cells(field))
    how = f"{record.iterations} iterations" if record.iterations else "direct"
    seconds = record.assembly_seconds + record.solve_seconds
    lines.append(
        f"{record.backend} ({record.backend_because}), {record.unknowns:,} unknowns, {how}, "
        f"backward error {record.backward_error:.1e}, {seconds:.1f} s"
    )
    console.print(f"load case {field.case}", style="bold", markup=False)
    for line in lines:
        console.print(f"  {line}", markup=False, soft_wrap=True)
    _print_findings(console, findings, field, "  ")
    console.print(f"  {where}", markup=False, soft_wrap=True)


def _headline_table(runs: Sequence[Run], best: Mapping[str, float]) -> Table:
    """One column a run, one row an index; indices that no run has are left out."""
    table = Table(header_style="bold", box=box.SIMPLE_HEAD)
    table.add_column("")
    for run in runs:
        table.add_column(run.name, justify="right", overflow="fold")
    values = [headline_values(run) for run in runs]
    for head in HEADLINE:
        if not any(head.column in found for found in values):
            continue
        cells = []
        for run, found in zip(runs, values, strict=True):
            text, extra = cell_text(run, head)
            if run.printable and found.get(head.column) == best.get(head.column, np.nan):
                text = f"[bold green]{text}[/]"
            cells.append(f"{text} [dim]({extra})[/]" if extra else text)
        table.add_row(head.title, *cells)
    return table
