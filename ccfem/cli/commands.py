"""The command line: what ``ccfem`` understands, a function a command.

Everything heavy is imported by the command that needs it, so that ``ccfem --help`` answers at once.
"""

import logging
from importlib import metadata
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ccfem.base.errors import InputError
from ccfem.base.progress import progress_bar
from ccfem.cli import options
from ccfem.cli.arguments import argument, option, parameters_by_strategy, path_of
from ccfem.cli.bed import bed
from ccfem.cli.fibre_amounts import front
from ccfem.cli.machines import machines
from ccfem.cli.optimising import optimise
from ccfem.cli.part_choices import GivenPart, PlacedPart, PrintedPart, TurnedPart
from ccfem.cli.part_commands import add_part_commands
from ccfem.cli.run import plan_code, run

if TYPE_CHECKING:
    from ccfem.comparison.request import Request

# What ``ccfem support`` does: the layers below a part, summed up, and their paths as a file.


@options.grouped
def support(
    given: GivenPart,
    layers: options.Layers = None,
    slicing: options.Slicing = None,
    angle: Annotated[
        float | None,
        option(
            "DEGREES",
            "Support what leans over by more than this from upright; default 45 below flat layers, "
            "0 (all that looks down) below curved ones.",
        ),
    ] = None,
    lift: Annotated[
        float | None,
        option(
            "MM",
            "Height of the part above the bed; default 0, and ten layers or more below curved "
            "layers, which become flat in it.",
        ),
    ] = None,
    load_case: options.OneLoadCase = None,
    backend: options.Backend = "auto",
    out: Annotated[
        Path | None,
        option(
            "PATHS.vtp|BODY.stl",
            "Also write their paths here, or the support as a body.",
            parser=path_of,
        ),
    ] = None,
) -> None:
    """Lay support below a part, in layers that continue its own down to the bed."""
    import numpy as np

    from ccfem.base.checks import check_known
    from ccfem.base.whole import check_writable, whole_file
    from ccfem.body.files.surface import write_stl
    from ccfem.fem.elasticity.statics import solve
    from ccfem.printing.export.vtk import write_paths
    from ccfem.printing.support import slice_with_support, support_paths
    from ccfem.slicing.layers.layer import plane_frame
    from ccfem.slicing.layers.slicer import check_field
    from ccfem.slicing.slicers import as_slicer

    if out is not None:
        if out.suffix.lower() not in (".vtp", ".stl"):
            raise InputError(f"support is written as .vtp or .stl; got {out}: change its suffix")
        check_writable(out)
    part = given.read()
    names = part.problem.cases
    if load_case is not None:
        check_known("load case", load_case, names)
    chosen = options.LayerOptions(layers, None, slicing).chosen()
    slicer = as_slicer(part.slicing if chosen is None else chosen)
    part.check_layers(slicer)
    check_field(slicer)
    stress = solve(part.printed_problem(slicer), backend=backend)[load_case or names[0]]
    stack, support_stack = slice_with_support(slicer, stress, part.build, part.machine, angle, lift)
    columns = support_stack.columns
    x, y, z = columns.up.tolist()
    if np.abs(columns.up - plane_frame(part.build)[2]).max() > 1e-3:
        print(f"the part stands with ({x:.3f}, {y:.3f}, {z:.3f}) upwards: else layers look down")
    print(
        f"{len(support_stack.layers)} layers of support below {len(stack)} of the part, "
        f"{support_stack.thickness:.3g} mm in the mean: {columns.volume:.5g} mm^3; "
        f"{columns.contact:.5g} mm^2 of the part rest on it, it stands on "
        f"{columns.standing:.5g} mm^2 of the part"
    )
    if out is not None and out.suffix.lower() == ".stl":
        with whole_file(out) as temporary:
            write_stl(temporary, columns.mesh.points, columns.mesh.boundary[:, :3])
        print(f"{out}: the support as a body of {len(columns.mesh.boundary)} triangles")
    elif out is not None:
        paths = support_paths(support_stack, part.machine, layers=stack)
        write_paths(paths, out)
        print(f"{out}: {len(paths)} paths of matrix, {paths.lengths.sum() / 1000.0:.4g} m")


# ``ccfem study``: run a study file, with the time left, and say what came out.


def study(
    file: Annotated[
        Path | None, argument("FILE.toml", "Study file; ccfem study --example prints one.")
    ] = None,
    example: Annotated[
        bool, typer.Option("--example", help="Print a study file to start from, and end.")
    ] = False,
    workers: Annotated[
        int | None, option("N", "Processes; default as many as processors.", min=0)
    ] = None,
    scheduler: options.Scheduler = None,
    out: options.Out = None,
    force: options.Force = False,
) -> None:
    """Run parts x slicings x strategies x parameters; one that was stopped goes on where it was."""
    if example:
        text = (
            files("ccfem.comparison.studies").joinpath("example.toml").read_text(encoding="utf-8")
        )
        print(text, end="")
    elif file is None:
        raise typer.BadParameter("name a study file; ccfem study --example prints one")
    else:
        _run(file, out, workers, scheduler, force)


def _run(
    file: Path, out: Path | None, workers: int | None, scheduler: str | None, force: bool
) -> None:
    """Run a study file and print what came out."""
    from ccfem.comparison.front import FRONTS
    from ccfem.comparison.studies import study

    with progress_bar() as progress:
        result = study(file, out, workers, scheduler, force, progress)
    print(result)
    for cost in FRONTS:
        front = result.front(cost)
        if len(front):
            print(f"on the front of stiffness over {cost}: {len(front)} runs")
    parquet = (result.folder / "results.parquet").exists()
    tables = "results.csv, results.parquet" if parquet else "results.csv"
    print(f"{result.folder / 'study.html'}, and beside it {tables} and times.csv")
    if not parquet:
        print("results.parquet needs pyarrow: pip install 'ccfem[parquet]'")


# The command `reproduce`: figures, tables and claims of papers.


def reproduce(
    paper: Annotated[str | None, argument("PAPER", "As wang_2021; none lists them.")] = None,
    part: Annotated[str | None, argument("PART", "As table2 or figure8; none makes all.")] = None,
    out: Annotated[Path | None, option("FOLDER", "Default results/PAPER.")] = None,
) -> None:
    """Make the figures, tables and claims of a paper again, ours beside theirs."""
    from ccfem.base.progress import progress_bar
    from ccfem.papers.reproduce import KEPT, named_papers, reproduce as make

    if paper is None:
        for name, contents in named_papers().items():
            print(f"{name}  {contents.title}; about {contents.seconds:.0f} s")
            if contents.parts:
                print(f"    {', '.join(contents.parts)}")
        return
    with progress_bar(lines=True) as progress:
        made = make(paper, part or "", None if out is None else path_of(out), progress)
    shown = named_papers()[paper].shown
    if shown and not part:
        print((made / shown).read_text(encoding="utf-8"))
    print(made)
    if part:
        print(f"kept; made again only where code or data have changed ({made.parent / KEPT})")


# The call in Python that does what a command does, said by the help of each.


CALLS = {
    "cases": "ccfem.cases.named_cases()",
    "strategies": "ccfem.strategies.named()",
    "slicers": "ccfem.slicing.slicers.named()",
    "machines": "ccfem.machine.machine_names()",
    "faces": "ccfem.faces(BODY)",
    "check": "ccfem.check(CASE)",
    "mesh": "ccfem.body.meshing.mesh_body(BODY, SIZE)",
    "optimise": "ccfem.cases.optimise(CASE, VOLUME_FRACTION)",
    "compare": "ccfem.compare(CASE, [A, B]), and ccfem.save(comparison, DIR)",
    "plan": "ccfem.compare(CASE, [S], natural=True), or ccfem.plan(STRATEGY, LAYERS, STRESS)",
    "bed": "ccfem.comparison.bed_print.print_together([REQUEST, ..])",
    "solve": "ccfem.solve(CASE.problem)",
    "calibrate": "ccfem.calibrate(PROBLEM, CURVE)",
    "reproduce": "ccfem.reproduce(PAPER, PART)",
    "open": "ccfem.open(BODY)",
    "new": "ccfem.cases.inspection.new_part(BODY)",
    "example": "ccfem.cases.inspection.write_example(NAME)",
    "cite": "ccfem.comparison.bibtex(ccfem.comparison.cited([METHOD]))",
    "front": "ccfem.comparison.fibre_front(CASE, STRESS, NAME, STRATEGY, COUNTS)",
    "study": "ccfem.study(FILE, workers=N)",
    "support": "ccfem.printing.support.slice_with_support(SLICER, STRESS, BUILD)",
}
"""Call of each command, as its help prints it."""


def say_in_python(app: typer.Typer) -> None:
    """Let the help of each command end with its call."""
    for command in app.registered_commands:
        name = command.name or (command.callback.__name__ if command.callback else "")
        if name in CALLS:
            command.epilog = f"In Python: {CALLS[name]}"


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
    str | None, argument("NAME", "Explain this one, and what its parameters mean.")
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
        Path, argument("BODY", "Surface (.stl), CAD file (.step), mesh, part file or case.")
    ],
    angle: Annotated[
        float, option("DEGREES", "Angle at an edge from which it separates two faces.")
    ] = 30.0,
    scale: Annotated[float, option("S", "Factor that converts a file's coordinates to mm.")] = 1.0,
    out: Annotated[Path, option("PICTURE", "Picture (.png, .pdf, .svg).", parser=path_of)] = Path(
        "faces.png"
    ),
) -> None:
    """List the smooth faces of a body with numbers to choose patches by, and draw them."""
    from ccfem.cli.check_part import list_faces

    list_faces(body, angle, scale, out)


@app.command()
@options.grouped
def check(
    part: PlacedPart,
    out: Annotated[
        Path | None,
        option(
            "PICTURE",
            "Picture (.png, .pdf, .svg), with a rotatable view beside it; default NAME-check.png.",
            parser=path_of,
        ),
    ] = None,
) -> None:
    """Say and draw all that is known of a part before it is solved; all mistakes at once.

    Mistakes end with exit code 2; a part that cannot be printed whatever is planned ends with 3.
    """
    from ccfem.cli.check_part import check_part

    if code := check_part(part.read, out):
        raise typer.Exit(code)


@app.command()
@options.grouped
def compare(
    *,
    strategies: options.StrategyOptions,
    given: TurnedPart,
    cut: options.LayerOptions,
    amount: options.AmountOptions,
    virtual_test: options.VirtualTest = True,
    solving: options.SolveOptions,
    stress: options.StressOptions,
    results: options.ResultOptions,
) -> None:
    """Plan a part by several strategies and show which is best, in numbers and a report."""

    def ask() -> "Request":
        from ccfem.comparison.request import Request
        from ccfem.slicing.slicers import split

        chosen, foreign = strategies.chooser(), stress.foreign(solving.refine)
        if results.drawings is not None and amount.slicings is not None:
            raise InputError("--drawings works with one slicing only; got --slicings: drop one")
        layers = cut.chosen()
        part, strand = solving.calibrated(given.read(solving.refine), virtual_test)
        return Request.of(
            part,
            chosen(part),
            layers,
            None if amount.slicings is None else split(amount.slicings),
            amount.fibre_per_layer,
            amount.fibre,
            amount.natural,
            load_case=solving.load_case,
            strand=strand,
            stress=foreign,
            backend=solving.backend,
            curve=amount.curve,
            every_layer=solving.every_layer,
            breaking_load=solving.breaking_load,
        )

    run(given.case, ask, results.output(), results.scheduler)


@app.command()
@options.grouped
def plan(
    *,
    strategy: options.Strategy = "stream_function",
    set_: options.SetOfOne = None,
    given: PlacedPart,
    cut: options.LayerOptions,
    amount: options.PlanAmountOptions,
    virtual_test: options.TestOrNot = None,
    solving: options.SolveOptions,
    stress: options.StressOptions,
    printing: options.PlanPrintOptions,
    results: options.ResultOptions,
) -> None:
    """Plan a part by one strategy, by default with its natural amount of fibre.

    A plan that cannot be printed as it is is written, with the reason, and ends with exit code 3;
    with --force it ends with 0.
    """

    def ask() -> "Request":
        from ccfem.comparison.request import LONGEST_TEST, Request, named_strategies

        parameters = parameters_by_strategy(set_ or (), strategy)
        layers, foreign = cut.chosen(), stress.foreign(solving.refine)
        if not printing.gcode and not (given.centre is None and given.copies is None):
            raise InputError("--centre and --copies place a print on the bed: add --gcode")
        if printing.cell and not printing.gcode:
            raise InputError("--cell writes the moves of a print: add --gcode")
        course = printing.course
        part, strand = solving.calibrated(given.read(solving.refine), virtual_test is not False)
        natural = amount.fibre_per_layer is None and amount.stiffness is None
        untold = virtual_test is None and amount.stiffness is None and solving.load_case != "all"
        return Request.of(
            part,
            named_strategies(part, (strategy,), parameters),
            layers,
            fibre_per_layer=amount.fibre_per_layer,
            natural=natural,
            stiffness=amount.stiffness,
            load_case=solving.load_case,
            strand=strand,
            stress=foreign,
            backend=solving.backend,
            print_plans=printing.gcode,
            support=printing.support,
            course=course,
            every_layer=solving.every_layer,
            longest_test=LONGEST_TEST if untold else float("inf"),
            breaking_load=solving.breaking_load,
        )

    output = results.output(f"-{strategy}", printing.cell)
    if code := plan_code(run(given.case, ask, output, results.scheduler), results.force):
        raise typer.Exit(code)


@app.command()
@options.grouped
def calibrate(
    given: PrintedPart,
    unreinforced: Annotated[Path, option("CURVE.csv", "Test of the part printed without fibre.")],
    reinforced: Annotated[
        Path | None, option("CURVE.csv", "Test of the part printed with fibre.")
    ] = None,
    strategy: Annotated[
        str | None, option("S", "Strategy that planned the reinforced part.")
    ] = None,
    set_: Annotated[
        list[str] | None, option("NAME=VALUE", "Parameter of it; repeatable.", "--set")
    ] = None,
    layers: options.Layers = None,
    fibre_per_layer: options.Fibre = None,
    load_case: options.OneLoadCase = None,
    out: Annotated[Path, option("MATERIAL.toml", "File that is written.", parser=path_of)] = Path(
        "calibrated.toml"
    ),
) -> None:
    """Fit modulus, matrix strength and strand stiffness to force-displacement curves (CSV).

    The paths of the reinforced part are planned again as they were printed: give the strategy, its
    parameters and the amount of fibre of that print.
    """
    from ccfem.base.whole import check_writable
    from ccfem.comparison.engine import answer
    from ccfem.comparison.request import Request, named_strategies
    from ccfem.fem.elasticity.plausibility import about_problem
    from ccfem.judging.virtual_testing.calibration import calibrate as fitted, read_curve

    parameters = parameters_by_strategy(set_ or (), strategy) if strategy is not None else {}
    curves = [curve.resolve() for curve in (unreinforced, reinforced) if curve is not None]
    if out.resolve() in curves:
        raise InputError(f"--out {out} is the curve of a test: name another file for the material")
    check_writable(out)
    without = read_curve(unreinforced)
    with_fibre = None if reinforced is None else read_curve(reinforced)
    if (reinforced is None) != (strategy is None):
        raise InputError("--reinforced and --strategy belong together; got only one of them")
    part, paths = given.read(), None
    if strategy is not None:
        request = Request.of(
            part,
            named_strategies(part, (strategy,), parameters),
            layers,
            fibre_per_layer=fibre_per_layer,
            natural=fibre_per_layer is None,
            strand=None,
            load_case=load_case,
        )
        (planned,) = answer(request).runs
        if not len(planned.toolpaths):
            raise InputError(f"{planned.name} could not plan the part: {planned.failure}")
        paths = planned.toolpaths
    for line in (*part.findings, *about_problem(part.problem)):
        print(f"warning: {line}")
    problem = part.printed_problem()
    calibration = fitted(problem, without, with_fibre, paths, load_case, out.stem)
    calibration.write(out)
    rho = "" if calibration.rho is None else f", rho {calibration.rho:.3g} mm^2"
    print(
        f"{out}: modulus {calibration.modulus:.4g} MPa, "
        f"matrix strength {calibration.tensile_strength:.3g} MPa"
        f"{rho}; use it with --calibration {out}"
    )


app.command()(bed)
app.command()(front)
app.command()(optimise)
app.command()(reproduce)
app.command()(study)
app.command()(support)
say_in_python(app)
