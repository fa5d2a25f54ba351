"""Options that several commands share, with what their help says.

Those that belong together are a group: a frozen value that a command takes whole (`grouped`).
Everything heavy is imported where it is needed, so that ``ccfem --help`` answers at once.
"""

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from ccfem.base.errors import InputError
from ccfem.cli.arguments import (
    drawings_of,
    names_of,
    numbers_of,
    option,
    parameters_by_strategy,
    path_of,
)
from ccfem.cli.run import Output, with_given_paths

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ccfem.cases.case import Case
    from ccfem.comparison.request import ForeignStress
    from ccfem.judging.virtual_testing.strand import Strand
    from ccfem.paths.planning.strategy import Strategy as Planner
    from ccfem.printing.course import Course
    from ccfem.slicing.layers.slicer import Slicer


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """Command that takes the options of its groups one by one, as typer reads them.

    Parameters
    ----------
    command : callable
        Takes options, and groups of them: frozen dataclasses whose fields are options.
    """
    hints: dict[str, Any] = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    options: list[inspect.Parameter] = []
    for parameter in inspect.signature(command).parameters.values():
        group = groups.get(parameter.name)
        inner = [parameter] if group is None else inspect.signature(group).parameters.values()
        options += [option.replace(kind=inspect.Parameter.KEYWORD_ONLY) for option in inner]

    def call(**given: Any) -> None:
        made = {
            name: kind(**{field.name: given.pop(field.name) for field in fields(kind)})
            for name, kind in groups.items()
        }
        command(**given, **made)

    call.__name__, call.__doc__ = command.__name__, command.__doc__
    call.__annotations__ = {option.name: option.annotation for option in options}
    call.__signature__ = inspect.Signature(options)  # type: ignore[attr-defined]
    return call


# Single options.

Out = Annotated[Path | None, option("DIR", "Folder for the results.", parser=path_of)]
Scheduler = Annotated[
    str | None,
    option(
        "ADDRESS",
        "Dask scheduler whose workers plan, evaluate and test instead, as tcp://host:8786.",
    ),
]
Layers = Annotated[int | None, option("N", "Fibre layers instead of the part's own.")]
Slicing = Annotated[
    str | None,
    option(
        "METHOD[:NAME=VALUE,..]",
        "Slicer and its parameters instead of --layers, as planar:thickness=0.4; see ccfem "
        "slicers.",
    ),
]
Fibre = Annotated[
    float | None,
    option(
        "MM",
        "Fibre length that each strategy is held to, mean over the layers. By default compare "
        "takes the shortest natural length of any of them; plan takes the natural length.",
    ),
]
Force = Annotated[
    bool,
    typer.Option(
        "--force",
        help="Replace files with names of results that ccfem did not write, too; let plan end with "
        "exit code 0 though it cannot be printed.",
    ),
]
TestOrNot = Annotated[
    bool | None,
    typer.Option(
        "--virtual-test/--no-virtual-test",
        help="Re-solve the part with the fibres in it; by default up to 3 km of fibre.",
        show_default=False,
    ),
]
VirtualTest = Annotated[
    bool,
    typer.Option(
        "--virtual-test/--no-virtual-test",
        help="Re-solve the part with the fibres of each strategy in it.",
    ),
]
Refine = Annotated[
    bool,
    typer.Option(
        "--refine",
        help="First halve cells where the estimated error sits, until it is below 10 % in energy "
        "norm in all load cases.",
    ),
]
LoadCase = Annotated[
    str | None,
    option(
        "NAME",
        'Load case to plan for; default the first. "all" plans for all at once, by [weights].',
    ),
]
OneLoadCase = Annotated[str | None, option("NAME", "Load case to take; default the first.")]
Backend = Annotated[
    str, option("NAME", "Linear solver, such as superlu, amg or pypardiso; default by size.")
]
SetOfStrategies = Annotated[
    list[str] | None, option("STRATEGY.NAME=VALUE", "Set a parameter; repeatable.", "--set")
]
SetOfOne = Annotated[
    list[str] | None, option("NAME=VALUE", "Set a parameter; repeatable.", "--set")
]
Strategy = Annotated[str, option("S", "See ccfem strategies.")]


# Groups.


@dataclass(frozen=True)
class LayerOptions:
    """Layers of fibre instead of the part's own: one of three options."""

    layers: Layers = None
    heights: Annotated[
        str | None,
        option("MM,MM,..", "Heights of the layers along the build direction, instead of --layers."),
    ] = None
    slicing: Slicing = None

    def chosen(self) -> "int | Sequence[float] | Slicer | None":
        """Read the layers from the one option that is given; None for the part's own."""
        given = {"--layers": self.layers, "--heights": self.heights, "--slicing": self.slicing}
        named = [name for name, value in given.items() if value is not None]
        if len(named) > 1:
            raise InputError(f"give --layers, --heights or --slicing; got {' and '.join(named)}")
        if self.heights is not None:
            return numbers_of(self.heights)
        if self.slicing is None:
            return self.layers
        from ccfem.slicing.slicers import from_text

        return from_text(self.slicing)


@dataclass(frozen=True)
class StrategyOptions:
    """What is compared: strategies with their parameters, and paths of other programs."""

    strategies: Annotated[
        str | None,
        option(
            "A,B,..", "Strategies; default stream_function, isocurve, contour_zigzag and zigzag."
        ),
    ] = None
    set_: SetOfStrategies = None
    paths: Annotated[
        str | None,
        option(
            "FILE,..",
            "Paths of other programs, judged beside the strategies: waypoints, CSV with "
            "x,y,z,path,layer, or a folder of strands on curved layers (.obj, .txt, a file a "
            "layer).",
        ),
    ] = None
    paths_frame: Annotated[
        str | None,
        option(
            "mesh|tool",
            "Frame of their coordinates; default mesh for CSV, the printer's tool for waypoints.",
        ),
    ] = None

    def chooser(self) -> "Callable[[Case], dict[str, Planner]]":
        """Return what makes the strategies, and paths of files, of a part by their names."""
        from ccfem.comparison.request import STRATEGIES, named_strategies

        names = STRATEGIES if self.strategies is None else names_of(self.strategies)
        files = () if self.paths is None else names_of(self.paths)
        parameters = parameters_by_strategy(self.set_ or ())

        def chosen(part: "Case") -> "dict[str, Planner]":
            made = named_strategies(part, names, parameters) if names or not files else {}
            return with_given_paths(part, made, files, self.paths_frame)

        return chosen


@dataclass(frozen=True)
class AmountOptions:
    """How much fibre strategies are compared at, and over which slicings."""

    slicings: Annotated[
        str | None,
        option(
            "A,B,..",
            "Compare over several slicings at equal fibre in all, as planar:z,planar:x,spatial; "
            "flat layers are as thick as the part's own unless they say otherwise.",
        ),
    ] = None
    fibre_per_layer: Fibre = None
    fibre: Annotated[
        float | None,
        option("MM", "Fibre length in all layers together, instead of --fibre-per-layer."),
    ] = None
    natural: Annotated[
        bool, typer.Option("--natural", help="Let each strategy lay its own amount of fibre.")
    ] = False
    curve: Annotated[
        bool | None,
        typer.Option(
            "--curve/--no-curve",
            help="Test every strategy at three to five lengths of fibre and draw stiffness over "
            "length; by default only where one cannot lay the length of the others, and no "
            "curve that would take more than five minutes.",
        ),
    ] = None


@dataclass(frozen=True)
class PlanAmountOptions:
    """How much fibre a plan lays: a length, or what makes the part so stiff."""

    fibre_per_layer: Fibre = None
    stiffness: Annotated[
        str | None,
        option(
            "RATIO",
            "Lay the least fibre that makes the part so stiff: as 2.5, over the part without "
            "fibre, or as 1200N/mm. With all load cases every one of them, as a ratio.",
        ),
    ] = None


@dataclass(frozen=True)
class SolveOptions:
    """What is solved, and how plans are judged."""

    load_case: LoadCase = None
    refine: Refine = False
    calibration: Annotated[
        Path | None,
        option("MATERIAL.toml", "Material of ccfem calibrate, instead of the part's own."),
    ] = None
    backend: Backend = "auto"
    breaking_load: Annotated[
        bool,
        typer.Option(
            "--breaking-load",
            help="Also break every plan, step by step: an experiment that takes minutes a plan.",
        ),
    ] = False
    every_layer: Annotated[
        bool,
        typer.Option(
            "--every-layer",
            help="Plan all layers, and take every index on them; by default, where there are more "
            "than 60, layers of equal section under stress within 1 % are planned once by "
            "strategies that plan layer by layer, and indices that some layers tell (angles, "
            "distances, coverage) are taken on 60, evenly spread.",
        ),
    ] = False

    def calibrated(self, part: "Case", virtual_test: bool) -> "tuple[Case, Strand | None]":
        """Part and strand of the virtual test, with the matrix and the strand of a calibration."""
        from ccfem.comparison.request import DEFAULT_STRAND

        strand = DEFAULT_STRAND if virtual_test else None
        if self.calibration is None:
            return part, strand
        from ccfem.judging.virtual_testing.calibration import read_calibration

        fitted = read_calibration(self.calibration)
        if strand is not None:
            strand = fitted.strand(strand)
        return replace(part, problem=replace(part.problem, material=fitted.material)), strand


@dataclass(frozen=True)
class StressOptions:
    """Stress of another program."""

    stress: Annotated[
        Path | None,
        option(
            "FILE",
            "Plan and evaluate on the stress of another program on the same mesh: .vtu, .vtk or "
            ".xdmf with an array of tensors, .frd of CalculiX, or .csv by element or node.",
        ),
    ] = None
    stress_unit: Annotated[
        str | None, option("UNIT", "MPa, Pa, .., where the file does not say it.")
    ] = None
    stress_array: Annotated[str | None, option("NAME", "Array of a .vtu, .vtk or .xdmf file.")] = (
        None
    )
    stress_step: Annotated[
        int | None, option("NUMBER", "Step of a .frd or .xdmf file that has several.")
    ] = None
    stress_components: Annotated[
        str | None, option("xx,yy,...", "Order of six components without names.")
    ] = None

    def foreign(self, refine: bool) -> "ForeignStress | None":
        """Stress to plan on; None for the part's own."""
        from ccfem.comparison.request import ForeignStress

        if self.stress is None:
            for field in fields(self):
                if getattr(self, field.name) is not None:
                    option = field.name.replace("_", "-")
                    raise InputError(f"--{option} belongs to --stress; got no file: name it")
            return None
        if refine:
            raise InputError("--refine changes the mesh that the file of --stress is on: drop one")
        return ForeignStress(
            self.stress,
            self.stress_unit,
            self.stress_array,
            self.stress_step,
            self.stress_components,
        )


@dataclass(frozen=True)
class PrintOptions:
    """How the file of a print is written."""

    support: Annotated[
        bool,
        typer.Option("--support", help="With --gcode: print support below what hangs over, too."),
    ] = False
    pause: Annotated[
        list[str] | None,
        option(
            "LAYER|MMmm",
            "Halt before a layer, as 12, or when a height is printed, as 3.4mm; repeatable.",
        ),
    ] = None
    from_layer: Annotated[
        int,
        option("N", "Begin the file at this layer, on what is printed below it; the lowest is 0."),
    ] = 0
    cell: Annotated[
        bool,
        typer.Option(
            "--cell", help="With --gcode: write all moves as a table for a cell of robots, too."
        ),
    ] = False

    @property
    def course(self) -> "Course":
        """Where the file begins and halts."""
        from ccfem.printing.course import Course

        return Course(tuple(self.pause or ()), self.from_layer)


@dataclass(frozen=True)
class PlanPrintOptions(PrintOptions):
    """Whether a plan is printed, and how its file is written."""

    gcode: Annotated[
        bool,
        typer.Option("--gcode", help="Also write STRATEGY.gcode, matrix and fibre of the part."),
    ] = False


@dataclass(frozen=True)
class ResultOptions:
    """Where results go, what is drawn of them, and who computes them."""

    pictures: Annotated[
        bool, typer.Option("--pictures", help="Also draw what the report shows as PNG files.")
    ] = False
    drawings: Annotated[
        str | None,
        option(
            "svg,dxf",
            "Also draw every flat layer of every strategy to scale, in mm: border, fibre, links.",
        ),
    ] = None
    details: Annotated[
        bool,
        typer.Option("--details", help="Print every index and remark, as the report shows them."),
    ] = False
    scheduler: Scheduler = None
    out: Out = None
    force: Force = False

    def output(self, suffix: str = "", cell: bool = False) -> Output:
        """Return where results go and what is drawn, with the end of the folder's name."""
        drawings = drawings_of(self.drawings)
        return Output(self.out, self.force, self.pictures, drawings, suffix, self.details, cell)
