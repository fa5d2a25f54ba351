"""Arguments and options that several commands share, with what their help says."""

from pathlib import Path
from typing import Annotated

import typer

from ccfem.cli.arguments import path_of

CasePath = Annotated[
    str,
    typer.Argument(
        metavar="CASE_OR_PART.toml",
        help="Name of a case, a part file, or a deck with its analysis (.inp).",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", parser=path_of, help="Folder for the results."),
]
SetCase = Annotated[
    list[str] | None,
    typer.Option(
        "--set-case",
        metavar="NAME=VALUE",
        help="Set a parameter of the case, as element_size=3; repeatable.",
    ),
]
Layers = Annotated[
    int | None,
    typer.Option("--layers", metavar="N", help="Fibre layers instead of the part's own."),
]
Heights = Annotated[
    str | None,
    typer.Option(
        "--heights",
        metavar="MM,MM,..",
        help="Heights of the layers along the build direction, instead of --layers.",
    ),
]
Slicing = Annotated[
    str | None,
    typer.Option(
        "--slicing",
        metavar="METHOD[:NAME=VALUE,..]",
        help="Slicer and its parameters instead of --layers, as planar:thickness=0.4; see ccfem "
        "slicers.",
    ),
]
Fibre = Annotated[
    float | None,
    typer.Option(
        "--fibre-per-layer",
        metavar="MM",
        help="Fibre length that each strategy is held to, mean over the layers. By default compare "
        "takes the shortest natural length of any of them; plan takes the natural length.",
    ),
]
FibreInAll = Annotated[
    float | None,
    typer.Option(
        "--fibre",
        metavar="MM",
        help="Fibre length in all layers together, instead of --fibre-per-layer.",
    ),
]
Slicings = Annotated[
    str | None,
    typer.Option(
        "--slicings",
        metavar="A,B,..",
        help="Compare over several slicings at equal fibre in all, as planar:z,planar:x,spatial; "
        "flat layers are as thick as the part's own unless they say otherwise.",
    ),
]
Turn = Annotated[
    list[str] | None,
    typer.Option(
        "--turn",
        metavar="AXIS=DEGREES",
        help="Turn the part on the bed, as z=37; x and y change the build direction; repeatable, "
        "one after the other.",
    ),
]
Centre = Annotated[
    str | None,
    typer.Option(
        "--centre", metavar="X,Y", help="Middle of the part, or of all copies, on the bed, mm."
    ),
]
Copies = Annotated[
    str | None,
    typer.Option(
        "--copies", metavar="N|NXxNY", help="Print several in one file, as 4, or 2x3 by X and Y."
    ),
]
Pause = Annotated[
    list[str] | None,
    typer.Option(
        "--pause",
        metavar="LAYER|MMmm",
        help="Halt before a layer, as 12, or when a height is printed, as 3.4mm; repeatable.",
    ),
]
FromLayer = Annotated[
    int,
    typer.Option(
        "--from-layer",
        metavar="N",
        help="Begin the file at this layer, on what is printed below it; the lowest is 0.",
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
Pictures = Annotated[
    bool, typer.Option("--pictures", help="Also draw what the report shows as PNG files.")
]
Drawings = Annotated[
    str | None,
    typer.Option(
        "--drawings",
        metavar="svg,dxf",
        help="Also draw every flat layer of every strategy to scale, in mm: border, fibre, links.",
    ),
]
RobotCell = Annotated[
    bool,
    typer.Option(
        "--cell", help="With --gcode: write all moves as a table for a cell of robots, too."
    ),
]
Details = Annotated[
    bool, typer.Option("--details", help="Print every index and remark, as the report shows them.")
]
PrintedSupport = Annotated[
    bool, typer.Option("--support", help="With --gcode: print support below what hangs over, too.")
]
VirtualTest = Annotated[
    bool,
    typer.Option(
        "--virtual-test/--no-virtual-test",
        help="Re-solve the part with the fibres of each strategy in it.",
    ),
]
BreakingLoad = Annotated[
    bool,
    typer.Option(
        "--breaking-load",
        help="Also break every plan, step by step: an experiment that takes minutes a plan.",
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
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Dask scheduler whose workers plan, evaluate and test instead, as tcp://host:8786.",
    ),
]
EveryLayer = Annotated[
    bool,
    typer.Option(
        "--every-layer",
        help="Plan all layers, and take every index on them; by default, where there are more than "
        "60, layers of equal section under stress within 1 % are planned once by strategies that "
        "plan layer by layer, and indices that some layers tell (angles, distances, coverage) are "
        "taken on 60, evenly spread.",
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
    typer.Option(
        "--load-case",
        metavar="NAME",
        help='Load case to plan for; default the first. "all" plans for all at once, by [weights].',
    ),
]
OneLoadCase = Annotated[
    str | None,
    typer.Option("--load-case", metavar="NAME", help="Load case to take; default the first."),
]
Calibration = Annotated[
    Path | None,
    typer.Option(
        "--calibration",
        metavar="MATERIAL.toml",
        help="Material of ccfem calibrate, instead of the part's own.",
    ),
]
Backend = Annotated[
    str,
    typer.Option(
        "--backend",
        metavar="NAME",
        help="Linear solver, such as superlu, amg or pypardiso; default by size.",
    ),
]
Stiffness = Annotated[
    str | None,
    typer.Option(
        "--stiffness",
        metavar="RATIO",
        help="Lay the least fibre that makes the part so stiff: as 2.5, over the part without "
        "fibre, or as 1200N/mm. With all load cases every one of them, as a ratio.",
    ),
]
StressFile = Annotated[
    Path | None,
    typer.Option(
        "--stress",
        metavar="FILE",
        help="Plan and evaluate on the stress of another program on the same mesh: .vtu, .vtk or "
        ".xdmf with an array of tensors, .frd of CalculiX, or .csv by element or node.",
    ),
]
StressUnit = Annotated[
    str | None,
    typer.Option(
        "--stress-unit", metavar="UNIT", help="MPa, Pa, .., where the file does not say it."
    ),
]
StressArray = Annotated[
    str | None,
    typer.Option("--stress-array", metavar="NAME", help="Array of a .vtu, .vtk or .xdmf file."),
]
StressComponents = Annotated[
    str | None,
    typer.Option(
        "--stress-components", metavar="xx,yy,...", help="Order of six components without names."
    ),
]
StressStep = Annotated[
    int | None,
    typer.Option(
        "--stress-step", metavar="NUMBER", help="Step of a .frd or .xdmf file that has several."
    ),
]
SetOfStrategies = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="STRATEGY.NAME=VALUE", help="Set a parameter; repeatable."),
]
SetOfOne = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter; repeatable."),
]
Strategy = Annotated[str, typer.Option("--strategy", metavar="S", help="See ccfem strategies.")]
Strategies = Annotated[
    str | None,
    typer.Option(
        "--strategies",
        metavar="A,B,..",
        help="Strategies; default stream_function, isocurve, contour_zigzag and zigzag.",
    ),
]
Natural = Annotated[
    bool, typer.Option("--natural", help="Let each strategy lay its own amount of fibre.")
]
Paths = Annotated[
    str | None,
    typer.Option(
        "--paths",
        metavar="FILE,..",
        help="Paths of other programs, judged beside the strategies: waypoints, CSV with "
        "x,y,z,path,layer, or a folder of strands on curved layers (.obj, .txt, a file a layer).",
    ),
]
PathsFrame = Annotated[
    str | None,
    typer.Option(
        "--paths-frame",
        metavar="mesh|tool",
        help="Frame of their coordinates; default mesh for CSV, the printer's tool for waypoints.",
    ),
]
Curve = Annotated[
    bool | None,
    typer.Option(
        "--curve/--no-curve",
        help="Test every strategy at three to five lengths of fibre and draw stiffness over "
        "length; by default only where one cannot lay the length of the others.",
    ),
]
PrintFile = Annotated[
    bool, typer.Option("--gcode", help="Also write STRATEGY.gcode, matrix and fibre of the part.")
]
