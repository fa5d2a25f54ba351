"""The command line: ``ccfem cases``, ``strategies``, ``compare``, ``plan``, ``calibrate``.

Everything heavy is imported by the command that needs it, so that ``ccfem --help`` answers at once.
"""

import shlex
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ccfem import __version__
from ccfem.cli.arguments import assignment, names_of, numbers_of, parameters_of
from ccfem.errors import InputError, SolveError
from ccfem.progress import Progress, progress_bar

if TYPE_CHECKING:
    from ccfem.cases.case import Case

__all__ = ["app", "main"]

_STARTED = time.perf_counter()

app = typer.Typer(
    name="ccfem",
    help="Finite elements and stress-driven toolpaths for printing continuous fibre. "
    "Units: mm, N, MPa.",
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

_CasePath = Annotated[
    str, typer.Argument(metavar="CASE_OR_PART.toml", help="Name of a case, or a part file.")
]
_Out = Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Folder for the results.")]
_SetCase = Annotated[
    list[str] | None,
    typer.Option(
        "--set-case",
        metavar="NAME=VALUE",
        help="Set a parameter of the case, as element_size=3; repeatable.",
    ),
]
_Layers = Annotated[
    int | None,
    typer.Option("--layers", metavar="N", help="Fibre layers instead of the part's own."),
]
_Heights = Annotated[
    str | None,
    typer.Option(
        "--heights",
        metavar="MM,MM,..",
        help="Heights of the layers along the build direction, instead of --layers.",
    ),
]
_Fibre = Annotated[
    float | None,
    typer.Option(
        "--fibre-per-layer",
        metavar="MM",
        help="Fibre length that each strategy is held to, mean over the layers. By default compare "
        "takes the smallest that any of them lays of its own accord, and one strategy alone lays "
        "its own.",
    ),
]
_VirtualTest = Annotated[
    bool,
    typer.Option(
        "--virtual-test/--no-virtual-test",
        help="Re-solve the part with the fibres of each strategy in it.",
    ),
]
_LoadCase = Annotated[
    str | None,
    typer.Option("--load-case", metavar="NAME", help="Load case to plan for; default the first."),
]
_Calibration = Annotated[
    Path | None,
    typer.Option(
        "--calibration",
        metavar="MATERIAL.toml",
        help="Material of ccfem calibrate, instead of the part's own.",
    ),
]
_Backend = Annotated[
    str,
    typer.Option(
        "--backend",
        metavar="NAME",
        help="Linear solver, such as superlu, amg or pypardiso; default by size.",
    ),
]


@app.callback(invoke_without_command=True)
def _top(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        print(f"ccfem {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())


@app.command()
def cases() -> None:
    """List the cases that come with ccfem."""
    from ccfem.cli.screen import print_cases

    print_cases()


@app.command()
def strategies(
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="Explain this one, and what its parameters mean."),
    ] = None,
) -> None:
    """List the strategies with their parameters and defaults, or explain one of them."""
    from ccfem.cli.screen import print_strategies, print_strategy

    if name is None:
        print_strategies()
    else:
        print_strategy(name)


@app.command()
def compare(
    case: _CasePath,
    strategies: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,..",
            help="Strategies; default isocurve, concentric, zigzag and contour_zigzag.",
        ),
    ] = None,
    set_case: _SetCase = None,
    layers: _Layers = None,
    heights: _Heights = None,
    fibre_per_layer: _Fibre = None,
    natural: Annotated[
        bool, typer.Option("--natural", help="Let each strategy lay its own amount of fibre.")
    ] = False,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="STRATEGY.NAME=VALUE", help="Set a parameter; repeatable."),
    ] = None,
    virtual_test: _VirtualTest = True,
    load_case: _LoadCase = None,
    calibration: _Calibration = None,
    backend: _Backend = "auto",
    out: _Out = None,
) -> None:
    """Plan a part by several strategies and show which is best, with numbers and pictures."""
    from ccfem.comparison.compare import STRATEGIES

    names = STRATEGIES if strategies is None else names_of(strategies)
    parameters: dict[str, dict[str, Any]] = {}
    for text in set_ or ():
        path, value = assignment(text)
        strategy, dot, name = path.partition(".")
        if not dot:
            raise InputError(f"--set expects STRATEGY.NAME=VALUE; got '{text}'")
        parameters.setdefault(strategy, {})[name] = value
    options = _options(layers, heights, fibre_per_layer, virtual_test, load_case, backend)
    options["natural"] = natural
    _run(partial(_load, case, set_case), "", names, parameters, out, options, calibration)


@app.command()
def plan(
    case: _CasePath,
    strategy: Annotated[str, typer.Option(metavar="S", help="See ccfem strategies.")],
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter; repeatable."),
    ] = None,
    set_case: _SetCase = None,
    layers: _Layers = None,
    heights: _Heights = None,
    fibre_per_layer: _Fibre = None,
    virtual_test: _VirtualTest = True,
    load_case: _LoadCase = None,
    calibration: _Calibration = None,
    backend: _Backend = "auto",
    gcode: Annotated[
        bool,
        typer.Option("--gcode", help="Also write STRATEGY.gcode, matrix and fibre of the part."),
    ] = False,
    out: _Out = None,
) -> None:
    """Plan a part by one strategy, by default with as much fibre as it lays of its own accord."""
    parameters = {strategy: parameters_of(strategy, set_ or ())}
    options = _options(layers, heights, fibre_per_layer, virtual_test, load_case, backend)
    options["natural"] = fibre_per_layer is None
    options["print_plans"] = gcode
    load = partial(_load, case, set_case)
    _run(load, f"-{strategy}", (strategy,), parameters, out, options, calibration)


@app.command()
def calibrate(
    case: _CasePath,
    unreinforced: Annotated[
        Path, typer.Option(metavar="CURVE.csv", help="Test of the part printed without fibre.")
    ],
    reinforced: Annotated[
        Path | None,
        typer.Option(metavar="CURVE.csv", help="Test of the part printed with fibre."),
    ] = None,
    strategy: Annotated[
        str | None, typer.Option(metavar="S", help="Strategy that planned the reinforced part.")
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Parameter of it; repeatable."),
    ] = None,
    set_case: _SetCase = None,
    layers: _Layers = None,
    fibre_per_layer: _Fibre = None,
    load_case: _LoadCase = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="MATERIAL.toml", help="File that is written.")
    ] = Path("calibrated.toml"),
) -> None:
    """Fit modulus, matrix strength and strand stiffness to force-displacement curves (CSV).

    The paths of the reinforced part are planned again as they were printed: give the strategy, its
    parameters and the amount of fibre of that print.
    """
    from ccfem.comparison.compare import compare as run_comparison
    from ccfem.comparison.compare import create_all
    from ccfem.io.whole import check_writable
    from ccfem.virtual_testing.calibration import calibrate as fit
    from ccfem.virtual_testing.force_displacement import read_curve

    check_writable(out)
    curves = [None if path is None else read_curve(path) for path in (unreinforced, reinforced)]
    if (reinforced is None) != (strategy is None):
        raise InputError("--reinforced and --strategy belong together; got only one of them")
    loaded = _load(case, set_case)
    paths = None
    if strategy is not None:
        parameters = {strategy: parameters_of(strategy, set_ or ())}
        chosen = create_all(loaded, (strategy,), parameters)
        options = _options(layers, None, fibre_per_layer, False, load_case, "auto")
        (run,) = run_comparison(loaded, chosen, natural=fibre_per_layer is None, **options).runs
        if not len(run.toolpaths):
            raise InputError(f"{strategy} could not plan the part: {run.failure}")
        paths = run.toolpaths
    assert curves[0] is not None
    found = fit(loaded.problem, curves[0], curves[1], paths, load_case, out.stem)
    found.write(out)
    rho = "" if found.rho is None else f", rho {found.rho:.3g} mm^2"
    print(
        f"{out}: modulus {found.modulus:.4g} MPa, matrix strength {found.matrix_strength:.3g} MPa"
        f"{rho}; use it with --calibration {out}"
    )


def _options(
    layers: int | None,
    heights: str | None,
    fibre_per_layer: float | None,
    virtual_test: bool,
    load_case: str | None,
    backend: str,
) -> dict[str, Any]:
    """Keyword arguments of `ccfem.comparison.compare.compare`."""
    from ccfem.comparison.compare import DEFAULT_STRAND

    if layers is not None and heights is not None:
        raise InputError("give either --layers or --heights, not both")
    return {
        "layers": layers if heights is None else numbers_of(heights),
        "fibre_per_layer": fibre_per_layer,
        "strand": DEFAULT_STRAND if virtual_test else None,
        "load_case": load_case,
        "backend": backend,
    }


def _run(
    load: Callable[[], "Case"],
    suffix: str,
    names: tuple[str, ...],
    parameters: dict[str, dict[str, Any]],
    out: Path | None,
    options: dict[str, Any],
    calibration: Path | None,
) -> None:
    """Compare and write; a failure leaves nothing behind."""
    from ccfem.cli.screen import print_comparison
    from ccfem.comparison.compare import compare as run_comparison
    from ccfem.comparison.compare import create_all
    from ccfem.comparison.files import staged, write_results

    imported = time.perf_counter()
    case = load()
    seconds = {"start": imported - _STARTED, "mesh": time.perf_counter() - imported}
    if calibration is not None:
        from ccfem.virtual_testing.calibration import read_calibration

        fitted = read_calibration(calibration)
        case = replace(case, problem=replace(case.problem, material=fitted.material))
        if options["strand"] is not None:
            options["strand"] = fitted.strand(options["strand"])
    chosen = create_all(case, names, parameters)
    where = out if out is not None else Path("results") / f"{case.name}{suffix}"
    with staged(where) as folder, progress_bar() as progress:
        comparison = run_comparison(case, chosen, progress=_part(progress, 0.0, 0.75), **options)
        if not comparison.succeeded:
            reasons = "; ".join(f"{run.name}: {run.failure}" for run in comparison.runs)
            raise InputError(f"no strategy could plan '{case.name}': {reasons}")
        for run in comparison.runs:
            if run.unprinted:
                raise InputError(run.unprinted)
        command = shlex.join(["ccfem", *sys.argv[1:]])
        write_results(comparison, folder, command, seconds, _part(progress, 0.75, 1.0))
    print_comparison(comparison, where, time.perf_counter() - _STARTED)


def _part(progress: Progress, first: float, last: float) -> Progress:
    """Progress of a piece of work that takes the bar from `first` to `last`."""
    return lambda what, share: progress(what, first + (last - first) * share)


def _load(name: str, set_case: list[str] | None) -> "Case":
    """Read a part file, or make a case from its name and parameters."""
    from ccfem.cases.named import create_case

    parameters = dict(assignment(text) for text in set_case or ())
    if not (name.endswith(".toml") or "/" in name or "\\" in name):
        return create_case(name, **parameters)
    if parameters:
        raise InputError(
            f"--set-case is for cases by name; '{name}' is a part file: change the file"
        )
    from ccfem.cases.part_file import read_part

    return read_part(Path(name))


def main() -> None:
    """Run the command line; bad input and failed solves end in one line and exit code 2."""
    # The base class of a wrong option or argument, wherever typer keeps it.
    usage_error: Any = typer.BadParameter.__mro__[1]
    try:
        code = typer.main.get_command(app)(standalone_mode=False)
    except (InputError, SolveError) as error:
        code = _complain(str(error))
    except usage_error as error:
        code = _complain(error.format_message())
    except (typer.Abort, KeyboardInterrupt):
        code = 130
    sys.exit(code if isinstance(code, int) else 0)


def _complain(message: str) -> int:
    print("ccfem: error:", " ".join(message.split()), file=sys.stderr)
    return 2
