"""The command line: what ``ccfem`` understands, a function a command.

Everything heavy is imported by the command that needs it, so that ``ccfem --help`` answers at once.
"""

import logging
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import typer

from ccfem.base.errors import InputError
from ccfem.cli.arguments import drawings_of, names_of, parameters_by_strategy, path_of
from ccfem.cli.fibre_amounts import front
from ccfem.cli.fibre_choice import SetFibre, fibre_choice
from ccfem.cli.in_python import say_in_python
from ccfem.cli.machines import MachineName, SetMachine, machine_choice, machines
from ccfem.cli.optimising import optimise
from ccfem.cli.options import (
    Backend,
    Calibration,
    CasePath,
    Details,
    Drawings,
    Fibre,
    FibreInAll,
    Force,
    Heights,
    Layers,
    LoadCase,
    OneLoadCase,
    Out,
    Pictures,
    PrintedSupport,
    Refine,
    SetCase,
    Slicing,
    Slicings,
    Stiffness,
    StressFile,
    StressUnit,
    VirtualTest,
)
from ccfem.cli.papers_again import reproduce
from ccfem.cli.part_commands import add_part_commands
from ccfem.cli.run import (
    Output,
    calibrated,
    foreign_stress,
    layers_of,
    load,
    run,
    slicings_of,
    with_given_paths,
)
from ccfem.cli.study_file import study
from ccfem.cli.supporting import support

app = typer.Typer(
    name="ccfem",
    help="Finite elements and stress-driven toolpaths for printing continuous fibre. "
    "Units: mm, N, MPa.",
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
add_part_commands(app)


@app.callback(invoke_without_command=True)
def _top(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", help="Log every step with its time, before the command.")
    ] = False,
) -> None:
    if verbose:
        logging.basicConfig(level=logging.INFO, format="%(asctime)s %(name)s: %(message)s")
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


app.command()(machines)


@app.command()
def faces(
    body: Annotated[
        Path,
        typer.Argument(
            metavar="BODY",
            help="Surface (.stl), CAD file (.step), mesh, part file or case.",
        ),
    ],
    angle: Annotated[
        float,
        typer.Option(metavar="DEGREES", help="Angle at an edge from which it separates two faces."),
    ] = 30.0,
    scale: Annotated[
        float, typer.Option(metavar="S", help="Factor that converts a file's coordinates to mm.")
    ] = 1.0,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="PICTURE", parser=path_of, help="Picture (.png, .pdf, .svg)."
        ),
    ] = Path("faces.png"),
) -> None:
    """List the smooth faces of a body with numbers to choose patches by, and draw them."""
    from ccfem.cli.faces import list_faces

    list_faces(body, angle, scale, out)


@app.command()
def check(
    case: CasePath,
    set_case: SetCase = None,
    machine: MachineName = None,
    set_machine: SetMachine = None,
    set_fibre: SetFibre = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="PICTURE",
            parser=path_of,
            help="Picture (.png, .pdf, .svg), with a rotatable view beside it; default "
            "NAME-check.png.",
        ),
    ] = None,
) -> None:
    """Say and draw all that is known of a part before it is solved; all mistakes at once."""
    from ccfem.cli.check_part import check_part

    code = check_part(
        case, set_case, out, machine_choice(machine, set_machine), fibre_choice(set_fibre)
    )
    if code:
        raise typer.Exit(code)


@app.command()
def compare(
    case: CasePath,
    strategies: Annotated[
        str | None,
        typer.Option(
            metavar="A,B,..",
            help="Strategies; default stream_function, isocurve, contour_zigzag and zigzag.",
        ),
    ] = None,
    set_case: SetCase = None,
    layers: Layers = None,
    heights: Heights = None,
    slicing: Slicing = None,
    slicings: Slicings = None,
    fibre_per_layer: Fibre = None,
    fibre: FibreInAll = None,
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
            help="Frame of their coordinates; default mesh for CSV, the printer's tool for "
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
    machine: MachineName = None,
    set_machine: SetMachine = None,
    set_fibre: SetFibre = None,
    backend: Backend = "auto",
    stress: StressFile = None,
    stress_unit: StressUnit = None,
    pictures: Pictures = False,
    drawings: Drawings = None,
    details: Details = False,
    out: Out = None,
    force: Force = False,
) -> None:
    """Plan a part by several strategies and show which is best, in numbers and a report."""

    def ask() -> Any:
        from ccfem.comparison.request import STRATEGIES, Request, named_strategies

        names = STRATEGIES if strategies is None else names_of(strategies)
        files = () if paths is None else names_of(paths)
        parameters = parameters_by_strategy(set_ or ())
        cut = layers_of(layers, heights, slicing)
        several = None if slicings is None else slicings_of(slicings)
        given = foreign_stress(stress, stress_unit, refine)
        if drawings is not None and slicings is not None:
            raise InputError("--drawings works with one slicing only; got --slicings: drop one")
        printer, placed = machine_choice(machine, set_machine), fibre_choice(set_fibre)
        part = load(case, set_case, refine, printer, placed)
        part, strand = calibrated(part, virtual_test, calibration)
        chosen = named_strategies(part, names, parameters) if names or not files else {}
        return Request.of(
            part,
            with_given_paths(part, chosen, files, paths_frame),
            cut,
            several,
            fibre_per_layer,
            fibre,
            natural,
            load_case=load_case,
            strand=strand,
            stress=given,
            backend=backend,
            curve=curve,
        )

    run(case, ask, Output(out, force, pictures, drawings_of(drawings), "", details))


@app.command()
def plan(
    case: CasePath,
    strategy: Annotated[
        str, typer.Option(metavar="S", help="See ccfem strategies.")
    ] = "stream_function",
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter; repeatable."),
    ] = None,
    set_case: SetCase = None,
    layers: Layers = None,
    heights: Heights = None,
    slicing: Slicing = None,
    fibre_per_layer: Fibre = None,
    stiffness: Stiffness = None,
    virtual_test: VirtualTest = True,
    load_case: LoadCase = None,
    refine: Refine = False,
    calibration: Calibration = None,
    machine: MachineName = None,
    set_machine: SetMachine = None,
    set_fibre: SetFibre = None,
    backend: Backend = "auto",
    gcode: Annotated[
        bool,
        typer.Option("--gcode", help="Also write STRATEGY.gcode, matrix and fibre of the part."),
    ] = False,
    support: PrintedSupport = False,
    stress: StressFile = None,
    stress_unit: StressUnit = None,
    pictures: Pictures = False,
    drawings: Drawings = None,
    details: Details = False,
    out: Out = None,
    force: Force = False,
) -> None:
    """Plan a part by one strategy, by default with its natural amount of fibre."""

    def ask() -> Any:
        from ccfem.comparison.request import Request, named_strategies

        parameters = parameters_by_strategy(set_ or (), strategy)
        cut = layers_of(layers, heights, slicing)
        given = foreign_stress(stress, stress_unit, refine)
        printer, placed = machine_choice(machine, set_machine), fibre_choice(set_fibre)
        part = load(case, set_case, refine, printer, placed)
        part, strand = calibrated(part, virtual_test, calibration)
        return Request.of(
            part,
            named_strategies(part, (strategy,), parameters),
            cut,
            fibre_per_layer=fibre_per_layer,
            natural=fibre_per_layer is None and stiffness is None,
            stiffness=stiffness,
            load_case=load_case,
            strand=strand,
            stress=given,
            backend=backend,
            print_plans=gcode,
            support=support,
        )

    run(case, ask, Output(out, force, pictures, drawings_of(drawings), f"-{strategy}", details))


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
    load_case: OneLoadCase = None,
    machine: MachineName = None,
    set_machine: SetMachine = None,
    set_fibre: SetFibre = None,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="MATERIAL.toml", parser=path_of, help="File that is written."
        ),
    ] = Path("calibrated.toml"),
) -> None:
    """Fit modulus, matrix strength and strand stiffness to force-displacement curves (CSV).

    The paths of the reinforced part are planned again as they were printed: give the strategy, its
    parameters and the amount of fibre of that print.
    """
    from ccfem.cli.fitting import fit_material

    parameters = parameters_by_strategy(set_ or (), strategy) if strategy is not None else {}
    options = {
        "layers": layers,
        "fibre_per_layer": fibre_per_layer,
        "natural": fibre_per_layer is None,
        "strand": None,
        "load_case": load_case,
    }
    chosen, placed = machine_choice(machine, set_machine), fibre_choice(set_fibre)

    def read() -> Any:
        return load(case, set_case, machine=chosen, fibre=placed)

    fit_material(read, unreinforced, reinforced, strategy, parameters, options, out)


app.command()(front)
app.command()(optimise)
app.command()(reproduce)
app.command()(study)
app.command()(support)
say_in_python(app)
