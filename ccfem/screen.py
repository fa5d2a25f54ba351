"""What the command line prints: lists of cases and strategies, and the table of a comparison."""

import dataclasses
import inspect
import os
import typing
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from ccfem.comparison import Comparison
from ccfem.evaluate.virtual_test.verdict import HONEST_PROMISE
from ccfem.headline import (
    HEADLINE,
    best_values,
    cell_text,
    headline_values,
    ranking,
    remarks,
    verdict,
)

__all__ = ["print_cases", "print_comparison", "print_strategies"]

_TITLES, _NUMBERS = 30, 20
"""Characters that a table is given for its titles and for each strategy, where neither a terminal
nor COLUMNS sets its width."""


def print_cases() -> None:
    """Print the cases, what they are, and their parameters with defaults."""
    from ccfem.cases import named_cases

    console = Console(highlight=False)
    for name, about in sorted(named_cases().items()):
        console.print(f"[bold]{name}[/bold]  {_first_line(about)}")
        parameters = inspect.signature(about).parameters.values()
        given = ", ".join(f"{each.name} = {each.default!r}" for each in parameters)
        console.print(f"    {given}", markup=False)


def print_strategies() -> None:
    """Print the strategies with their parameters, defaults and choices; the amount is marked."""
    from ccfem.strategies import named

    console = Console(highlight=False)
    for name, strategy in sorted(named().items()):
        console.print(f"[bold]{name}[/bold]  {_first_line(strategy)}")
        table = Table(box=None, show_header=False, padding=(0, 2, 0, 4))
        hints = typing.get_type_hints(strategy)
        for field in dataclasses.fields(strategy):  # type: ignore[arg-type]
            note = _choices(hints[field.name])
            if field.name == strategy.amount.parameter:
                amount = strategy.amount
                note = f"sets the amount of fibre: {amount.most:g} most, {amount.least:g} least"
            table.add_row(field.name, repr(field.default), note)
        console.print(table)


def _choices(hint: object) -> str:
    """Words that a parameter takes, where it takes words."""
    if typing.get_origin(hint) is not typing.Literal:
        return ""
    return "one of " + ", ".join(repr(word) for word in typing.get_args(hint))


def _first_line(what: object) -> str:
    return (inspect.getdoc(what) or "").split("\n")[0]


def print_comparison(comparison: Comparison, where: Path, seconds: float) -> None:
    """Print the headline table, the best of each row in bold, and where the results are."""
    console = Console(highlight=False)
    best = best_values(comparison)
    runs = [run for run in ranking(comparison) if run.evaluation is not None]
    values = [headline_values(run) for run in runs]
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = max(console.width, _TITLES + _NUMBERS * len(runs))
    console.print(comparison.case.title, style="bold", markup=False)
    table = Table(header_style="bold", box=box.SIMPLE_HEAD)
    table.add_column("")
    for run in runs:
        table.add_column(run.name, justify="right", overflow="fold")
    for head in HEADLINE:
        if not any(head.column in found for found in values):
            continue
        cells = []
        for run, found in zip(runs, values, strict=True):
            text, extra = cell_text(run, head)
            if found.get(head.column) == best.get(head.column, np.nan):
                text = f"[bold green]{text}[/]"
            cells.append(f"{text} [dim]({extra})[/]" if extra else text)
        table.add_row(head.title, *cells)
    console.print(table)
    for line in remarks(comparison):
        console.print(line, style="dim", markup=False)
    said = verdict(comparison)
    if said:
        console.print(said, style="bold", markup=False)
    if any(run.tested is not None for run in runs):
        console.print(HONEST_PROMISE, style="dim", markup=False)
    console.print(f"{where / 'report.html'}  ({seconds:.1f} s)", markup=False, soft_wrap=True)
