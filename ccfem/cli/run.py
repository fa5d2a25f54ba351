"""What ``ccfem compare`` and ``ccfem plan`` do: from the words of a command to a folder of results.

Everything heavy is imported where it is needed, so that ``ccfem --help`` answers at once.
"""

import contextlib
import shlex
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from ccfem.base.errors import InputError
from ccfem.base.progress import Progress, progress_bar
from ccfem.base.toml import assignment
from ccfem.cli.arguments import numbers_of
from ccfem.cli.machines import machine_choice
from ccfem.cli.part_choices import fibre_choice, plastic_choice

if TYPE_CHECKING:
    from ccfem.cases.case import Case
    from ccfem.comparison.request import Request
    from ccfem.comparison.result import Comparison
    from ccfem.judging.virtual_testing.strand import Strand
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


def load(
    name: str,
    set_case: Sequence[str] | None = None,
    refine: bool = False,
    machine: str | None = None,
    set_machine: Sequence[str] | None = None,
    set_fibre: Sequence[str] | None = None,
    bed: Mapping[str, Any] = MappingProxyType({}),
    set_plastic: Sequence[str] | None = None,
) -> "Case":
    """Read a part file, or make a case from its name and parameters.

    Parameters
    ----------
    set_case : sequence of str, optional
        Parameters of a case by name, each as ``NAME=VALUE``.
    refine : bool, default False
        Refine cells until they are fine enough by the estimated error.
    machine, set_machine
        As in `machine_choice`.
    set_fibre, set_plastic
        As in `fibre_choice` and `plastic_choice`.
    bed : mapping
        As in `ccfem.cli.arguments.bed_table_of`.
    """
    from ccfem.cases.reading import read

    printer, places = machine_choice(machine, set_machine), fibre_choice(set_fibre)
    plastic = plastic_choice(set_plastic)
    _refuse_body(name)
    parameters = dict(assignment(text) for text in set_case or ())
    if parameters and name.endswith(".toml"):
        raise InputError(
            f"--set-case is for cases by name; '{name}' is a part file: change the file"
        )
    case = read(name, **parameters)
    if printer is not None:
        case = replace(case, machine=printer(case.machine))
    if places is not None:
        case = replace(case, fibre=places(case.fibre))
    if plastic is not None:
        case = replace(case, plastic=plastic(case.plastic))
    if bed:
        case = case.on_bed(bed)
    return _refined(case) if refine else case


def _refuse_body(name: str) -> None:
    """Say what a part file is to who gives the body instead."""
    from ccfem.body.files.formats import suffixes
    from ccfem.body.files.surface import is_surface
    from ccfem.body.meshing.cad import is_cad
    from ccfem.cases.reading import is_analysis

    body = Path(name)
    if is_analysis(body):
        return
    if is_surface(body) or is_cad(body) or body.suffix.lower() in suffixes():
        raise InputError(
            f"{name} is a body without material, loads and supports; a part file (TOML) adds "
            f"these: 'ccfem new {shlex.quote(name)}' writes one to fill in"
        )


def _refined(case: "Case") -> "Case":
    """Case on cells that are fine enough by the estimated error; a finding says how many."""
    from ccfem.fem.elasticity.statics import refine

    problem = refine(case.problem)
    before, after = (len(solved.mesh.cells) for solved in (case.problem, problem))
    # Between walls and infill the stress jumps: there cells of any size have an estimated error.
    solid = "" if case.plastic.solid else " with solid plastic"
    remark = f"{before:,} cells were refined to {after:,} by their estimated error{solid}"
    findings = (*case.findings, remark) if after > before else case.findings
    return replace(case, problem=problem, findings=findings)


def layers_of(layers: int | None, heights: str | None, slicing: str | None) -> Any:
    """Read the layers from the one of three options that is given; None for the part's own."""
    given = {"--layers": layers, "--heights": heights, "--slicing": slicing}
    named = [name for name, value in given.items() if value is not None]
    if len(named) > 1:
        raise InputError(f"give --layers, --heights or --slicing; got {' and '.join(named)}")
    if heights is not None:
        return numbers_of(heights)
    if slicing is None:
        return layers
    from ccfem.slicing.slicers import from_text

    return from_text(slicing)


def slicings_of(text: str) -> tuple[str, ...]:
    """Read the slicings of a comparison over several."""
    from ccfem.slicing.slicers import split

    return split(text)


def foreign_stress(path: Path | None, refine: bool, *values: Any) -> Any:
    """Stress of another program to plan on; None for the part's own.

    Values are those of its unit, array, step and components, each of which may be None.
    """
    from ccfem.comparison.request import ForeignStress

    how = dict(zip(("unit", "array", "step", "components"), values, strict=True))
    if path is None:
        for name, value in how.items():
            if value is not None:
                raise InputError(f"--stress-{name} belongs to --stress; got no file: name it")
        return None
    if refine:
        raise InputError("--refine changes the mesh that the file of --stress is on: drop one")
    return ForeignStress(path, **how)


@dataclass(frozen=True)
class Output:
    """Where the results of a command go, and what is drawn of them.

    Attributes
    ----------
    out : Path, optional
        Folder; default ``results/`` and the name of the case with `suffix`.
    force : bool
        Replace files with names of results that ccfem did not write, too; a plan that cannot be
        printed ends with exit code 0.
    pictures : bool
        Also draw PNG files of what the report shows.
    drawings : tuple of {"svg", "dxf"}
        Also draw every flat layer of every strategy to scale.
    details : bool
        Print every index and remark.
    cell : bool
        Also write the moves of a print for a cell of robots.
    """

    out: Path | None = None
    force: bool = False
    pictures: bool = False
    drawings: tuple[str, ...] = ()
    suffix: str = ""
    details: bool = False
    cell: bool = False

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
    from ccfem.comparison.expected import share_before_writing
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
        written = share_before_writing(request)
        comparison = answer(request, _part(progress, 0.0, written))
        _check(comparison)
        command, rest = shlex.join(["ccfem", *sys.argv[1:]]), _part(progress, written, 1.0)
        about = (command, seconds, rest, output.pictures, text, output.drawings)
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
    strategies : dict of name to Strategy
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


def calibrated(
    case: "Case", virtual_test: bool, calibration: Path | None
) -> "tuple[Case, Strand | None]":
    """Case and strand of the virtual test, with the matrix and the strand of a calibration."""
    from ccfem.comparison.request import DEFAULT_STRAND

    strand = DEFAULT_STRAND if virtual_test else None
    if calibration is None:
        return case, strand
    from ccfem.judging.virtual_testing.calibration import read_calibration

    fitted = read_calibration(calibration)
    if strand is not None:
        strand = fitted.strand(strand)
    return replace(case, problem=replace(case.problem, material=fitted.material)), strand


def _check(comparison: "Comparison") -> None:
    """Refuse a comparison in which nothing was planned, or what was cannot be printed as asked."""
    if not comparison.succeeded:
        reasons = "; ".join(f"{run.name}: {run.failure}" for run in comparison.runs)
        raise InputError(f"no strategy could plan '{comparison.case.name}': {reasons}")
    for run in comparison.runs:
        if run.unprinted and comparison.request.print_plans:
            raise InputError(run.unprinted)


def _part(progress: Progress, first: float, last: float) -> Progress:
    """Progress of a piece of work that takes the bar from `first` to `last`."""
    return lambda what, share: progress(what, first + (last - first) * share)
