"""What ``ccfem compare`` and ``ccfem plan`` do: from the words of a command to a folder of results.

Everything heavy is imported where it is needed, so that ``ccfem --help`` answers at once.
"""

import contextlib
import shlex
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ccfem.base.errors import InputError
from ccfem.base.progress import progress_bar

if TYPE_CHECKING:
    from ccfem.cases.case import Case
    from ccfem.comparison.request import Request
    from ccfem.comparison.result import Comparison
    from ccfem.paths.planning.strategy import Strategy

_STARTED = time.perf_counter()


def elapsed() -> float:
    """Seconds since the program began."""
    return time.perf_counter() - _STARTED


def complain(*messages: str) -> int:
    """Print mistakes on standard error, one line each; the exit code."""
    for message in messages:
        print("ccfem: error:", " ".join(message.split()), file=sys.stderr)
    return 2


@dataclass(frozen=True)
class Output:
    """Where the results of a command go, and what is drawn of them."""

    out: Path | None = None  # folder; default ``results/`` and the name of the case with `suffix`
    # Replace files with names of results that ccfem did not write, too; a plan that cannot be
    # printed ends with exit code 0.
    force: bool = False
    pictures: bool = False  # also draw PNG files of what the report shows
    # Also draw, as "svg" or "dxf", every flat layer of every strategy to scale.
    drawings: tuple[str, ...] = ()
    suffix: str = ""
    details: bool = False  # print every index and remark
    cell: bool = False  # also write the moves of a print for a cell of robots

    def folder(self, case: "Case") -> Path:
        """Folder for the results of a case."""
        return self.out or Path("results") / f"{case.name}{self.suffix}"


NOT_PRINTABLE = 3
"""Exit code of a plan that is written, but cannot be printed as it is."""


def run(
    name: str, ask: "Callable[[], Request]", output: Output, scheduler: str | None = None
) -> "Comparison":
    """Carry out what is asked of a part, write the results, print the table, and return it.

    A failure leaves nothing behind.

    Parameters
    ----------
    name : str
        Of a case, or of a part file.
    ask : callable
        Reads the part, and returns what is asked of it.
    scheduler : str, optional
        Address of a Dask scheduler, as of `ccfem.base.cluster.on_cluster`.
    """
    from ccfem.base.cluster import on_cluster
    from ccfem.base.result_folder import whole_folder
    from ccfem.cli.first_run import compiling_beside
    from ccfem.cli.screen import print_comparison
    from ccfem.comparison.engine import answer
    from ccfem.comparison.expected import START, Schedule
    from ccfem.comparison.files import RESULT_FILES, write_results

    imported, text = time.perf_counter(), _text_of(name)  # it may change while this runs
    request = ask()
    seconds = {"start": imported - _STARTED, "mesh": time.perf_counter() - imported}
    where = output.folder(request.case)
    with (
        whole_folder(where, RESULT_FILES, output.force) as folder,
        compiling_beside(),
        on_cluster(scheduler),
        progress_bar(lines=True) as progress,
    ):
        schedule = Schedule(progress, command=True, passed={START: elapsed()})
        comparison = answer(request, schedule)
        _check(comparison)
        command = shlex.join(["ccfem", *sys.argv[1:]])
        about = (command, seconds, schedule, output.pictures, text, output.drawings)
        write_results(comparison, folder, *about, cell=output.cell)
    print_comparison(comparison, where, elapsed(), output.details)
    return comparison


def plan_code(comparison: "Comparison", force: bool) -> int:
    """Exit code of a plan: `NOT_PRINTABLE`, with a line on standard error, unless it is forced."""
    refused = [run for run in comparison.succeeded if not run.printable]
    for run in refused:
        accepted = "" if force else " (--force accepts the plan as it is)"
        print(f"ccfem: not printable as planned: {run.why_not}{accepted}", file=sys.stderr)
    return NOT_PRINTABLE if refused and not force else 0


def _text_of(name: str) -> str:
    """Text of a part file; empty for the name of a case, and where there is none to be read."""
    with contextlib.suppress(OSError, ValueError):
        return Path(name).read_text(encoding="utf-8") if name.endswith(".toml") else ""
    return ""


def with_given_paths(
    case: "Case", strategies: "dict[str, Strategy]", files: Sequence[str], frame: str | None
) -> "dict[str, Strategy]":
    """Strategies, and paths of other programs by the names of their files.

    Parameters
    ----------
    frame : {"mesh", "tool"}, optional
        What the coordinates of the files are in.
    """
    if not files:
        if frame is not None:
            raise InputError(
                "--paths-frame gives the frame of the --paths files; got no --paths: name them"
            )
        return strategies
    from ccfem.paths.planning.given_paths import GivenPaths
    from ccfem.printing.export.path_table import read_paths
    from ccfem.printing.export.waypoints import pattern_of
    from ccfem.slicing.layers.layer import plane_frame

    named = dict(strategies)
    for file in files:
        name = Path(file).stem
        if name in named:
            raise InputError(f"'{name}' is the name of two runs: rename the file {file}")
        toolpaths = read_paths(file, plane_frame(case.build), frame)
        if not len(toolpaths):
            raise InputError(f"{file} holds no paths: check its name")
        named[name] = GivenPaths(toolpaths, file, pattern_of(file))
    return named


def _check(comparison: "Comparison") -> None:
    """Refuse a comparison in which nothing was planned, or what was cannot be printed as asked."""
    if not comparison.succeeded:
        reasons = "; ".join(f"{run.name}: {run.failure}" for run in comparison.runs)
        raise InputError(f"no strategy could plan '{comparison.case.name}': {reasons}")
    for run in comparison.runs:
        if run.unprinted and comparison.request.print_plans:
            raise InputError(run.unprinted)
