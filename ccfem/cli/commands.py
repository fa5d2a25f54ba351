"""The command line: what ``ccfem`` understands, a function a command.

Everything heavy is imported by the command that needs it, so that ``ccfem --help`` answers at once.
"""

import os
import signal
import sys
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import typer

from ccfem.cli.arguments import names_of, parameters_by_strategy
from ccfem.cli.options import (
    Backend,
    Calibration,
    CasePath,
    Fibre,
    Force,
    Heights,
    Layers,
    LoadCase,
    Out,
    Refine,
    SetCase,
    Slicing,
    StressFile,
    StressUnit,
    VirtualTest,
)
from ccfem.cli.run import foreign_stress, layers_of, load, options_of, run
from ccfem.errors import InputError, SolveError

__all__ = ["app", "main"]

app = typer.Typer(
    name="ccfem",
    help="Finite elements and stress-driven toolpaths for printing continuous fibre. "
    "Units: mm, N, MPa.",
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.callback(invoke_without_command=True)
def _top(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        print(f"ccfem {metadata.version('ccfem')}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        print(context.get_help())


@app.command()
def cases() -> None:
    """List the cases that come with ccfem."""
    from ccfem.cli.screen import print_cases

    print_cases()


_Explained = Annotated[
    str | None,
    typer.Argument(metavar="NAME", help="Explain this one, and what its parameters mean."),
]


@app.command()
def strategies(name: _Explained = None) -> None:
    """List the strategies with their parameters and defaults, or explain one of them."""
    _list("strategy", name)


@app.command()
def slicers(name: _Explained = None) -> None:
    """List the slicers with their parameters and defaults, or explain one of them."""
    _list("slicer", name)


def _list(kind: str, name: str | None) -> None:
    from ccfem.cli.screen import print_member, print_members

    if name is None:
        print_members(kind)
    else:
        print_member(kind, name)


@app.command()
def faces(
    body: Annotated[
        Path,
        typer.Argument(metavar="BODY", help="Surface (.stl ...), mesh, part file or case."),
    ],
    angle: Annotated[
        float, typer.Option(metavar="DEGREES", help="Angle from which an edge separates faces.")
    ] = 30.0,
    scale: Annotated[
        float, typer.Option(metavar="S", help="Factor that makes a file's coordinates mm.")
    ] = 1.0,
    out: Annotated[
        Path, typer.Option("--out", metavar="PICTURE", help="Picture (.png, .pdf, .svg).")
    ] = Path("faces.png"),
) -> None:
    """List the smooth faces of a body with numbers to choose patches by, and draw them."""
    from ccfem.cli.faces import list_faces

    list_faces(body, angle, scale, out)


@app.command()
def compare(
    case: CasePath,
    strategies: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,..",
            help="Strategies; default isocurve, concentric, zigzag and contour_zigzag.",
        ),
    ] = None,
    set_case: SetCase = None,
    layers: Layers = None,
    heights: Heights = None,
    slicing: Slicing = None,
    fibre_per_layer: Fibre = None,
    natural: Annotated[
        bool, typer.Option("--natural", help="Let each strategy lay its own amount of fibre.")
    ] = False,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="STRATEGY.NAME=VALUE", help="Set a parameter; repeatable."),
    ] = None,
    paths: Annotated[
        str | None,
        typer.Option(
            metavar="FILE,..",
            help="Paths of other programs, judged beside the strategies: waypoints, or CSV with "
            "x,y,z,path,layer.",
        ),
    ] = None,
    paths_frame: Annotated[
        str | None,
        typer.Option(
            metavar="mesh|tool",
            help="What their coordinates are in; default mesh for CSV, the printer's tool for "
            "waypoints.",
        ),
    ] = None,
    curve: Annotated[
        bool | None,
        typer.Option(
            "--curve/--no-curve",
            help="Test every strategy at three to five lengths of fibre and draw stiffness over "
            "length; by default only where one cannot lay the length of the others.",
        ),
    ] = None,
    virtual_test: VirtualTest = True,
    load_case: LoadCase = None,
    refine: Refine = False,
    calibration: Calibration = None,
    backend: Backend = "auto",
    stress: StressFile = None,
    stress_unit: StressUnit = None,
    out: Out = None,
    force: Force = False,
) -> None:
    """Plan a part by several strategies and show which is best, with numbers and pictures."""
    from ccfem.comparison.compare import STRATEGIES

    names = STRATEGIES if strategies is None else names_of(strategies)
    parameters = parameters_by_strategy(set_ or ())
    chosen = layers_of(layers, heights, slicing)
    options = options_of(chosen, fibre_per_layer, virtual_test, load_case, backend)
    options["natural"] = natural
    options["curve"] = curve
    options["stress"] = foreign_stress(stress, stress_unit)
    files = names_of(paths) if paths is not None else ()
    run(
        case,
        set_case,
        names,
        parameters,
        options,
        calibration,
        out,
        paths=files,
        frame=paths_frame,
        force=force,
        refine=refine,
    )


@app.command()
def plan(
    case: CasePath,
    strategy: Annotated[str, typer.Option(metavar="S", help="See ccfem strategies.")],
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter; repeatable."),
    ] = None,
    set_case: SetCase = None,
    layers: Layers = None,
    heights: Heights = None,
    slicing: Slicing = None,
    fibre_per_layer: Fibre = None,
    virtual_test: VirtualTest = True,
    load_case: LoadCase = None,
    refine: Refine = False,
    calibration: Calibration = None,
    backend: Backend = "auto",
    gcode: Annotated[
        bool,
        typer.Option("--gcode", help="Also write STRATEGY.gcode, matrix and fibre of the part."),
    ] = False,
    stress: StressFile = None,
    stress_unit: StressUnit = None,
    out: Out = None,
    force: Force = False,
) -> None:
    """Plan a part by one strategy, by default with its natural amount of fibre."""
    parameters = parameters_by_strategy(set_ or (), strategy)
    chosen = layers_of(layers, heights, slicing)
    options = options_of(chosen, fibre_per_layer, virtual_test, load_case, backend)
    options["natural"] = fibre_per_layer is None
    options["print_plans"] = gcode
    options["stress"] = foreign_stress(stress, stress_unit)
    alone, suffix = (strategy,), f"-{strategy}"
    run(
        case,
        set_case,
        alone,
        parameters,
        options,
        calibration,
        out,
        suffix,
        force=force,
        refine=refine,
    )


@app.command()
def solve(
    case: CasePath,
    out: Annotated[
        Path,
        typer.Option("-o", "--out", metavar="RESULT.vtu", help="File that is written."),
    ],
    set_case: SetCase = None,
    load_case: Annotated[
        str | None,
        typer.Option(
            "--load-case",
            metavar="NAME",
            help="Only this one; default all, the name of each behind that of the file where "
            "there are several.",
        ),
    ] = None,
    backend: Backend = "auto",
    refine: Refine = False,
) -> None:
    """Solve a part and write displacement, strain, stress, reactions and error for ParaView."""
    from ccfem.checks import check_known
    from ccfem.cli.screen import print_solution
    from ccfem.elasticity.solve import solve as solved
    from ccfem.export.vtu_result import result_path, write_result
    from ccfem.io.whole import check_writable

    loaded = load(case, set_case, refine)
    names = loaded.problem.cases
    if load_case is not None:
        check_known("load case", load_case, names)
        names = (load_case,)
    files = {name: out if len(names) == 1 else result_path(out, name) for name in names}
    for file in files.values():
        check_writable(result_path(file))
    fields = solved(loaded.problem, backend=backend)
    for name, file in files.items():
        write_result(fields[name], file)
        print_solution(fields[name], loaded.findings, file)


@app.command()
def calibrate(
    case: CasePath,
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
    set_case: SetCase = None,
    layers: Layers = None,
    fibre_per_layer: Fibre = None,
    load_case: LoadCase = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="MATERIAL.toml", help="File that is written.")
    ] = Path("calibrated.toml"),
) -> None:
    """Fit modulus, matrix strength and strand stiffness to force-displacement curves (CSV).

    The paths of the reinforced part are planned again as they were printed: give the strategy, its
    parameters and the amount of fibre of that print.
    """
    from ccfem.comparison.compare import compare, create_all
    from ccfem.io.whole import check_writable
    from ccfem.virtual_testing.calibration import calibrate as fit
    from ccfem.virtual_testing.force_displacement import read_curve

    check_writable(out)
    without = read_curve(unreinforced)
    with_fibre = None if reinforced is None else read_curve(reinforced)
    if (reinforced is None) != (strategy is None):
        raise InputError("--reinforced and --strategy belong together; got only one of them")
    loaded, paths = load(case, set_case), None
    if strategy is not None:
        chosen = create_all(loaded, (strategy,), parameters_by_strategy(set_ or (), strategy))
        options = options_of(layers, fibre_per_layer, False, load_case, "auto")
        (planned,) = compare(loaded, chosen, natural=fibre_per_layer is None, **options).runs
        if not len(planned.toolpaths):
            raise InputError(f"{strategy} could not plan the part: {planned.failure}")
        paths = planned.toolpaths
    found = fit(loaded.problem, without, with_fibre, paths, load_case, out.stem)
    found.write(out)
    rho = "" if found.rho is None else f", rho {found.rho:.3g} mm^2"
    print(
        f"{out}: modulus {found.modulus:.4g} MPa, matrix strength {found.tensile_strength:.3g} MPa"
        f"{rho}; use it with --calibration {out}"
    )


def main() -> None:
    """Run the command line; bad input and failed solves end in one line and exit code 2."""
    # The base class of a wrong option or argument, wherever typer keeps it.
    usage_error: Any = typer.BadParameter.__mro__[1]
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        code = typer.main.get_command(app)(standalone_mode=False)
    except (InputError, SolveError) as error:
        code = _complain(str(error))
    except usage_error as error:
        code = _complain(error.format_message())
    except (typer.Abort, KeyboardInterrupt):
        code = 130
    except BrokenPipeError:  # as under `ccfem cases | head -1`: nobody reads on
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 141
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        code = _complain(f"cannot go on{where}: {error.strerror or error}: see to it and repeat")
    sys.exit(code if isinstance(code, int) else 0)


def _complain(message: str) -> int:
    print("ccfem: error:", " ".join(message.split()), file=sys.stderr)
    return 2
