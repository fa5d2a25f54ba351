"""Breaking loads, an experiment, beside those of the prints of Chen et al. 2021.

    CCFEM_CHEN2021=folder python -m benchmarks.studies.breaking_loads [PART ...] [--band] [--bond N]
        [--prints none ...] [--stop SHARE] [--picture FILE]

Parts are "Loop" and "Shell" on the authors' meshes, "Loop, edges of 3.5 mm", the Loop meshed anew
from its surface, and "Shell, pushed", for which the authors' own paths are not published. "Loop"
takes a minute of processor time, "Shell" six minutes; twice that with ``--band``, for the band of
each load too. With ``--bond`` strands come loose from their ends and folds at that
force, N, and carry nothing in folds; with ``--stop 0.9`` curves end at 90 % of their highest load,
which saves minutes. "Shell, pushed" is off by more than twice, since nothing fails in compression:
it takes five minutes with ``--stop 0.9``. The picture has the curves of the first part beside what
is published of the measured ones, their slopes and highest loads: displacements are scaled so that
the slope without fibre is the measured one.

One set of parameters for all: EA/E = 4 mm^2, strands of 105 N, a matrix of 33 MPa (the prints
without fibre) with a softening length of 13.4 mm, layers that hold 18 MPa on each other (the
material "pla"). The strength of strands was taken from the measured loads of the authors' paths, so
that only the rows without fibre and with zigzag are predictions, and the former not quite.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING

import numpy as np

import ccfem
from ccfem.body.files.surface import Surface
from ccfem.body.mesh.patches import patches_from_rules
from ccfem.body.meshing.volume import tetrahedralise
from ccfem.comparison.plot.canvas import png
from ccfem.comparison.plot.colours import INK, palette
from ccfem.comparison.plot.curves import axes_below, legend_below
from ccfem.fem.elasticity import StressField, solve
from ccfem.fem.materials import named_material
from ccfem.judging.virtual_testing.progressive_failure import EXPERIMENT, STOP, BreakingCurve
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strand_room import in_folds
from ccfem.judging.virtual_testing.strands import Strands, cut_strands
from ccfem.machine import Machine
from ccfem.papers.chen_2021.loop import HOLES, LAYERS_TABLE_2, authors_loop
from ccfem.papers.chen_2021.virtual_test import MATRIX_STRENGTH, authors_paths
from ccfem.papers.evidence.prints import shell_field, shell_paths
from ccfem.papers.evidence.rows import LOAD, NONE, SLOPE, measured_of
from ccfem.paths.folds import folds_in
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.slicers.planar import Planar

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _loop(edge: float | None = None) -> StressField:
    problem = authors_loop().problem
    if edge is not None:
        surface = Surface(problem.mesh.points, problem.mesh.boundary[:, :3])
        mesh = patches_from_rules(tetrahedralise(surface, edge, "gmsh"), HOLES)
        problem = replace(problem, mesh=mesh)
    return solve(problem)["pull"]


def _loop_paths(name: str) -> Toolpaths:
    return authors_paths("ours" if name == "authors" else name)


PARTS: Mapping[str, tuple[str, Callable[[], StressField], Callable[[str], Toolpaths]]] = {
    "Loop": ("Loop", _loop, _loop_paths),
    "Loop, edges of 3.5 mm": ("Loop", lambda: _loop(3.5), _loop_paths),
    "Shell": ("Shell, pulled", shell_field, shell_paths),
    "Shell, pushed": ("Shell, pushed", lambda: shell_field(pushed=True), shell_paths),
}
"""Name of the part in the evidence, its solution without fibre, and its paths by name."""


BUILD = (0.0, 1.0, 0.0)
"""Direction in which the parts were printed."""


def _with_bond(field: StressField) -> StressField:
    """Give a part the strengths between layers of printed PLA."""
    bond = named_material("pla")
    material = replace(
        field.problem.material,
        interlayer_tensile=bond.interlayer_tensile,
        interlayer_shear=bond.interlayer_shear,
    )
    return replace(field, problem=replace(field.problem, material=material))


def _without_folds(lines: Toolpaths, field: StressField) -> Strands:
    """Strands that carry nothing in folds."""
    strands, fibre = cut_strands(lines, field.mesh), lines.of_kind(FIBRE)
    number = (np.cumsum(lines.kind == FIBRE) - 1)[strands.path]
    folded = in_folds(folds_in(fibre, Machine()), number, strands.arc)
    return replace(strands, share=np.where(folded, 0.0, strands.share))


def curves_picture(part: str, curves: Mapping[str, BreakingCurve]) -> "Figure":
    """Draw load over displacement; dashed the measured slope, up to the measured highest load."""
    heading = part if "," in part else f"{part}, pulled"
    figure, axes = axes_below(f"{heading} ({EXPERIMENT})", "displacement, mm", "load, kN")
    colours = {NONE: INK} | palette([name for name in curves if name != NONE])
    bare = curves[NONE]
    stiffness = 1e-3 * bare.force[1] / bare.displacement[1]
    scale = stiffness / measured_of(part, NONE, SLOPE)
    most = 0.0
    for name, curve in curves.items():
        axes.plot(scale * curve.displacement, 1e-3 * curve.force, color=colours[name], lw=1.6)
        load, slope = measured_of(part, name, LOAD), measured_of(part, name, SLOPE)
        axes.plot([0.0, load / slope], [0.0, load], color=colours[name], lw=1.0, ls=(0, (4, 3)))
        axes.plot([load / slope], [load], "o", ms=4.5, color=colours[name], mfc="white")
        most = max(most, load, 1e-3 * curve.load)
    axes.set_ylim(0.0, 1.08 * most)
    axes.set_xlim(left=0.0)
    legend_below(axes, colours, list(curves))
    return figure


def main(arguments: list[str]) -> None:
    """Print a table of loads and one of their ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", default=list(PARTS), metavar="PART")
    parser.add_argument("--band", action="store_true")
    parser.add_argument("--bond", type=float, metavar="N")
    parser.add_argument("--prints", nargs="*")
    parser.add_argument("--stop", type=float, default=STOP)
    parser.add_argument("--picture", type=Path)
    asked = parser.parse_args(arguments)
    band, bond = asked.band, asked.bond
    print("| part | cells | print | measured, N | experiment, N | error % | how | processor s |")
    print("|---|---|---|---|---|---|---|---|")
    ratios = ["| part | ratio | measured | experiment | error % |", "|---|---|---|---|---|"]
    for name in asked.parts:
        measured_as, make, paths = PARTS[name]
        field = _with_bond(make())
        layers = Planar(count=LAYERS_TABLE_2).cut(field.mesh, BUILD)
        specimen, loads, measured = Specimen.of(field), {}, {}
        curves = {}
        published = [NONE, "zigzag"] + ["authors"] * (name != "Shell, pushed")
        for fibre in asked.prints or published:
            lines = None if fibre == NONE else paths(fibre)
            strands = lines if lines is None or bond is None else _without_folds(lines, field)
            given = {"band": band, "layers": layers, "bond": bond, "stop": asked.stop}
            started = process_time()
            broken = ccfem.breaking_load(
                strands, specimen, matrix_strength=MATRIX_STRENGTH, **given
            )
            curves[fibre] = broken.curve
            loads[fibre], measured[fibre] = broken.load, 1e3 * measured_of(measured_as, fibre, LOAD)
            off = 100.0 * (broken.load / measured[fibre] - 1.0)
            about = f"{name} | {len(field.mesh.cells)} | {fibre} | {measured[fibre]:.0f}"
            within = " ({:.0f} to {:.0f})".format(*broken.band) if band else ""
            row = f"| {about} | {broken.load:.0f}{within} | {off:+.0f} | {broken.curve.story}"
            print(f"{row} | {process_time() - started:.0f} |", flush=True)
        for first, second in (("zigzag", NONE), ("authors", NONE), ("authors", "zigzag")):
            if not {first, second} <= set(loads):
                continue
            real = measured[first] / measured[second]
            made = loads[first] / loads[second]
            off = 100.0 * (made / real - 1.0)
            ratios.append(f"| {name} | {first} / {second} | {real:.2f} | {made:.2f} | {off:+.0f} |")
        if asked.picture is not None and name == asked.parts[0]:
            asked.picture.write_bytes(png(curves_picture(measured_as, curves)))
    print("\n" + "\n".join(ratios))


if __name__ == "__main__":
    main(sys.argv[1:])
