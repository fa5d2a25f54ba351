"""What ``ccfem support`` does: the layers below a part, summed up, and their paths as a file."""

from pathlib import Path
from typing import Annotated

import typer

from ccfem.cli.arguments import path_of
from ccfem.cli.options import Backend, CasePath, Layers, OneLoadCase, SetCase, Slicing


def support(
    case: CasePath,
    set_case: SetCase = None,
    layers: Layers = None,
    slicing: Slicing = None,
    angle: Annotated[
        float | None,
        typer.Option(
            metavar="DEGREES",
            help="Support what leans over by more than this from upright; default 45 below flat "
            "layers, 0 (all that looks down) below curved ones.",
        ),
    ] = None,
    lift: Annotated[
        float | None,
        typer.Option(
            metavar="MM",
            help="Height of the part above the bed; default 0, and ten layers or more below curved "
            "layers, which become flat in it.",
        ),
    ] = None,
    load_case: OneLoadCase = None,
    backend: Backend = "auto",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="PATHS.vtp", parser=path_of, help="Also write their paths here."
        ),
    ] = None,
) -> None:
    """Lay support below a part, in layers that continue its own down to the bed."""
    import numpy as np

    from ccfem.base.checks import check_known
    from ccfem.base.whole import check_writable
    from ccfem.cli.run import layers_of, load
    from ccfem.fem.elasticity.solve import solve
    from ccfem.printing.export.vtk import write_paths
    from ccfem.printing.support import slice_with_support, support_paths
    from ccfem.slicing.layers.plane import plane_frame
    from ccfem.slicing.slicers import as_slicer

    if out is not None:
        check_writable(out)
    part = load(case, set_case)
    names = part.problem.cases
    if load_case is not None:
        check_known("load case", load_case, names)
    stress = solve(part.problem, backend=backend)[load_case or names[0]]
    chosen = layers_of(layers, None, slicing)
    slicer = as_slicer(part.slicing if chosen is None else chosen)
    own, found = slice_with_support(slicer, stress, part.build, part.machine, angle, lift)
    columns = found.columns
    x, y, z = columns.up.tolist()
    if np.abs(columns.up - plane_frame(part.build)[2]).max() > 1e-3:
        print(f"the part stands with ({x:.3f}, {y:.3f}, {z:.3f}) upwards: else layers look down")
    print(
        f"{len(found.layers)} layers of support below {len(own)} of the part, "
        f"{found.thickness:.3g} mm in the mean: {columns.volume:.5g} mm^3; "
        f"{columns.contact:.5g} mm^2 of the part rest on it, it stands on "
        f"{columns.standing:.5g} mm^2 of the part"
    )
    if out is not None:
        paths = support_paths(found, part.machine)
        write_paths(paths, out)
        print(f"{out}: {len(paths)} paths of matrix, {paths.lengths.sum() / 1000.0:.4g} m")
