"""What ``ccfem compare`` and ``ccfem plan`` do: from the words of a command to a folder of results.

Everything heavy is imported where it is needed, so that ``ccfem --help`` answers at once.
"""

import shlex
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ccfem.checks import member_name
from ccfem.cli.arguments import numbers_of
from ccfem.errors import InputError
from ccfem.io.toml import assignment
from ccfem.progress import Progress, progress_bar

if TYPE_CHECKING:
    from ccfem.cases.case import Case
    from ccfem.comparison.result import Comparison
    from ccfem.comparison.slicings import SlicingComparison
    from ccfem.machine.machine import Machine
    from ccfem.placement.fibre_places import FibrePlaces

__all__ = [
    "foreign_stress",
    "layers_of",
    "load",
    "options_of",
    "run",
    "slicings_of",
]

_STARTED = time.perf_counter()

_MESHES = (".msh", ".vtu", ".inp", ".tet", ".npz")
"""Suffixes of files that hold a mesh."""

_SOLVED = 0.75
"""Share of the progress bar at which the comparison is made and the pictures begin."""


def load(
    name: str,
    set_case: Sequence[str] | None,
    refine: bool = False,
    machine: "Callable[[Machine], Machine] | None" = None,
    fibre: "Callable[[FibrePlaces | None], FibrePlaces] | None" = None,
) -> "Case":
    """Read a part file, or make a case from its name and parameters.

    Its cells are refined if wanted; `machine` changes its machine, `fibre` which layers get fibre.
    """
    from ccfem.cases.reading import read

    _refuse_body(name)
    parameters = dict(assignment(text) for text in set_case or ())
    if parameters and name.endswith(".toml"):
        raise InputError(
            f"--set-case is for cases by name; '{name}' is a part file: change the file"
        )
    case = read(name, **parameters)
    if machine is not None:
        case = replace(case, machine=machine(case.machine))
    if fibre is not None:
        case = replace(case, fibre=fibre(case.fibre))
    return _refined(case) if refine else case


def _refuse_body(name: str) -> None:
    """Say what a part file is to who gives the body instead."""
    from ccfem.io.surface import is_surface
    from ccfem.meshing.cad import is_cad

    body = Path(name)
    if is_surface(body) or is_cad(body) or body.suffix.lower() in _MESHES:
        raise InputError(
            f"{name} is a body without material, loads and supports; a part file (TOML) adds "
            f"these: 'ccfem new {shlex.quote(name)}' writes one to fill in"
        )


def _refined(case: "Case") -> "Case":
    """Case on cells that are fine enough by the estimated error; a finding says how many."""
    from ccfem.elasticity.refinement import refine

    problem = refine(case.problem)
    before, after = (len(each.mesh.cells) for each in (case.problem, problem))
    said = f"{before:,} cells were refined to {after:,} by their estimated error"
    findings = (*case.findings, said) if after > before else case.findings
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
    from ccfem.layers.slicing import from_text

    return from_text(slicing)


def slicings_of(text: str) -> tuple[str, ...]:
    """Read the slicings of a comparison over several."""
    from ccfem.layers.slicing import split

    return split(text)


def foreign_stress(path: Path | None, unit: str | None) -> Any:
    """Stress of another program to plan on; None for the part's own."""
    from ccfem.comparison.compare import ForeignStress

    if path is None:
        if unit is not None:
            raise InputError("--stress-unit belongs to --stress; got no file: name it")
        return None
    return ForeignStress(path, unit)


def options_of(
    layers: Any,
    fibre_per_layer: float | None,
    virtual_test: bool,
    load_case: str | None,
    backend: str,
) -> dict[str, Any]:
    """Keyword arguments of `ccfem.comparison.compare.compare`."""
    from ccfem.comparison.compare import DEFAULT_STRAND

    return {
        "layers": layers,
        "fibre_per_layer": fibre_per_layer,
        "strand": DEFAULT_STRAND if virtual_test else None,
        "load_case": load_case,
        "backend": backend,
    }


def run(
    name: str,
    set_case: Sequence[str] | None,
    strategies: Sequence[str],
    parameters: Mapping[str, Mapping[str, Any]],
    options: Mapping[str, Any],
    calibration: Path | None,
    out: Path | None,
    suffix: str = "",
    paths: Sequence[str] = (),
    frame: str | None = None,
    force: bool = False,
    refine: bool = False,
    pictures: bool = False,
    drawings: Sequence[str] = (),
    machine: "Callable[[Machine], Machine] | None" = None,
    fibre: "Callable[[FibrePlaces | None], FibrePlaces] | None" = None,
) -> None:
    """Compare strategies, write the results and print the table; a failure leaves nothing behind.

    Parameters
    ----------
    name : str
        Of a case, or of a part file.
    set_case : sequence of str, optional
        Parameters of the case, as ``NAME=VALUE``.
    strategies : sequence of str
    parameters : mapping of strategy name to parameters
    options : mapping
        From `options_of`, and others that `compare` knows; with ``stiffness``, a text, the one
        strategy lays the least fibre that reaches it.
    calibration : Path, optional
        Material that goes before the part's own.
    out : Path, optional
        Folder; default ``results/`` and the name of the case with `suffix`.
    suffix : str
    paths : sequence of str
        Files with paths of other programs, to be judged beside the strategies.
    frame : {"mesh", "tool"}, optional
        What the coordinates of these files are in.
    force : bool
        Replace files with names of results that ccfem did not write, too.
    refine : bool
        Refine the cells by their estimated error first.
    pictures : bool
        Also draw PNG files of what the report shows.
    drawings : sequence of {"svg", "dxf"}
        Also draw every flat layer of every strategy to scale.
    machine : callable, optional
        What it makes of the part's machine (`ccfem.cli.machines.machine_choice`).
    fibre : callable, optional
        What it makes of the layers that get fibre (`ccfem.cli.fibre_choice.fibre_choice`).
    """
    if refine and options.get("stress") is not None:
        raise InputError("--refine changes the mesh that the file of --stress is on: drop one")
    from ccfem.cli.screen import print_comparison, print_slicings
    from ccfem.comparison.compare import compare, create_all
    from ccfem.comparison.files import RESULT_FILES, write_drawings, write_results
    from ccfem.comparison.slicings import SlicingComparison
    from ccfem.comparison.slicings_files import write_slicings
    from ccfem.io.result_folder import whole_folder

    imported = time.perf_counter()
    if drawings and options.get("slicings") is not None:
        raise InputError("--drawings works with one slicing only; got --slicings: drop one")
    case = load(name, set_case, refine, machine, fibre)
    seconds = {"start": imported - _STARTED, "mesh": time.perf_counter() - imported}
    if calibration is not None:
        case, options = _calibrated(case, options, calibration)
    chosen = create_all(case, strategies, parameters) if strategies or not paths else {}
    chosen |= _given(case, paths, frame, chosen)
    if options.get("stiffness") is not None:
        from ccfem.cli.wanted_stiffness import least_fibre_options, planned_for

        first = next(iter(chosen))
        chosen[first] = planned_for(case, chosen[first], options)
        options = least_fibre_options(case, chosen[first], options)
    where = out if out is not None else Path("results") / f"{case.name}{suffix}"
    part_file = _text_of(name)
    slicer = member_name(_slicer_of(case, options.get("layers")))
    with whole_folder(where, RESULT_FILES, force) as folder, progress_bar(lines=True) as progress:
        comparison = compare(case, chosen, progress=_part(progress, 0.0, _SOLVED), **options)
        _check(comparison)
        command, rest = shlex.join(["ccfem", *sys.argv[1:]]), _part(progress, _SOLVED, 1.0)
        if isinstance(comparison, SlicingComparison):
            write_slicings(comparison, folder, command, seconds, rest, pictures, part_file)
        else:
            if drawings:
                write_drawings(comparison, folder, drawings)
            write_results(comparison, folder, command, seconds, rest, pictures, part_file, slicer)
    spent = time.perf_counter() - _STARTED
    if isinstance(comparison, SlicingComparison):
        print_slicings(comparison, where, spent)
    else:
        print_comparison(comparison, where, spent)


def _slicer_of(case: "Case", layers: Any) -> Any:
    """Return what cuts the layers: the part's own slicer, or the one that was asked for."""
    from ccfem.layers.slicing import as_slicer

    return case.slicing if layers is None else as_slicer(layers)


def _text_of(name: str) -> str:
    """Text of a part file; empty for the name of a case."""
    return Path(name).read_text(encoding="utf-8") if name.endswith(".toml") else ""


def _given(
    case: "Case", files: Sequence[str], frame: str | None, taken: Mapping[str, Any]
) -> dict[str, Any]:
    """Paths of other programs, by the names of their files."""
    if not files:
        if frame is not None:
            raise InputError(
                "--paths-frame gives the frame of the --paths files; got no --paths: name them"
            )
        return {}
    from ccfem.export.path_table import read_paths
    from ccfem.layers.plane import plane_frame
    from ccfem.planning.given_paths import GivenPaths

    found: dict[str, Any] = {}
    for file in files:
        name = Path(file).stem
        if name in taken or name in found:
            raise InputError(f"'{name}' is the name of two runs: rename the file {file}")
        toolpaths = read_paths(file, plane_frame(case.build), frame)
        if not len(toolpaths):
            raise InputError(f"{file} holds no paths: check its name")
        found[name] = GivenPaths(toolpaths, file)
    return found


def _calibrated(
    case: "Case", options: Mapping[str, Any], calibration: Path
) -> tuple["Case", dict[str, Any]]:
    """Case and options with the matrix and the strand of a calibration."""
    from ccfem.virtual_testing.calibration import read_calibration

    fitted, strand = read_calibration(calibration), options["strand"]
    if strand is not None:
        strand = fitted.strand(strand)
    case = replace(case, problem=replace(case.problem, material=fitted.material))
    return case, {**options, "strand": strand}


def _check(comparison: "Comparison | SlicingComparison") -> None:
    """Refuse a comparison in which nothing was planned, or what was cannot be printed as asked."""
    if not comparison.succeeded:
        reasons = "; ".join(f"{run.name}: {run.failure}" for run in comparison.runs)
        raise InputError(f"no strategy could plan '{comparison.case.name}': {reasons}")
    for each in comparison.runs:
        if each.unprinted:
            raise InputError(each.unprinted)


def _part(progress: Progress, first: float, last: float) -> Progress:
    """Progress of a piece of work that takes the bar from `first` to `last`."""
    return lambda what, share: progress(what, first + (last - first) * share)
