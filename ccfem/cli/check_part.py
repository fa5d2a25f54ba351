"""What ``ccfem check`` and ``ccfem faces`` do: print what is known of a part, and draw it."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import SolveError
from ccfem.base.whole import check_writable, whole_file
from ccfem.body.mesh.smooth_faces import Face, place_text
from ccfem.body.meshing.cad import is_cad
from ccfem.cases.case import Case
from ccfem.cases.inspection import check
from ccfem.cases.inspection.body_faces import faces as faces_of
from ccfem.cli.run import NOT_PRINTABLE, complain
from ccfem.comparison.effort import about_effort
from ccfem.comparison.plot.canvas import check_picture, save
from ccfem.comparison.plot.part_picture import part_page, part_picture
from ccfem.comparison.plot.part_views import Label, draw_part
from ccfem.fem.elasticity.plausibility import MOST_CELLS, why_quadratic
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.solve_cost import about_quadratic, solve_costs
from ccfem.fem.elasticity.statics import solve
from ccfem.fem.elasticity.stress_field import StressField
from ccfem.judging.virtual_testing.pinned_joints import about_pins
from ccfem.printing.build_directions import better_direction
from ccfem.slicing.slicers.planar import Planar


def check_part(read: Callable[[], Case], picture: Path | None) -> int:
    """Print a check; write its picture, and beside it the page that turns.

    Parameters
    ----------
    read : callable
        Returns the part; called when the name of the picture has been looked at.
    picture : Path, optional
        .png, .pdf or .svg; default the part's name and ``-check.png``.

    Returns
    -------
    int
        Exit code, that of a plan: 2 where something keeps the part from being solved or planned, 3
        where it cannot be printed whatever is planned.
    """
    if picture is not None:
        check_picture(picture)
    checked = check(read())
    if picture is None:
        picture = check_picture(Path(f"{checked.case.name}-check.png"))
    page = check_writable(picture.with_suffix(".html"))
    print(checked.known)
    if not checked.mistakes and not checked.not_planned:
        for line in _of_a_solve(checked.case):
            print(f"remark: {line}")
    if not checked.not_planned:
        for line in about_effort(checked.case, checked.case.known_layers()):
            print(f"expected: {line}")
    save(part_picture(checked), picture)
    with whole_file(page) as temporary:
        temporary.write_text(part_page(checked), encoding="utf-8")
    print(f"{picture}, and {page} with a rotatable view")
    for line in checked.not_printable:
        print(f"ccfem: not printable as planned: {line}", file=sys.stderr)
    if checked.mistakes or checked.not_planned:
        return complain(*checked.mistakes, *checked.not_planned)
    return NOT_PRINTABLE if checked.not_printable else 0


_QUICK = 15.0
"""Estimated seconds of a solve that a check may take."""


def _of_a_solve(case: Case) -> list[str]:
    """Say what the first load case shows, solved on the cells that there are, if that is quick.

    That is whether quadratic cells will be taken, a build direction in which fibre would take much
    more, and a pin that tears out; of the plastic as it is printed.
    """
    slicing, problem = case.slicing, case.printed_problem()
    if solve_costs(problem)[0].seconds > _QUICK:
        return []
    name = next(iter(problem.loads))
    rough = replace(
        problem,
        order=1 if problem.mesh.order == 1 else 2,
        loads={name: problem.loads[name]},
        combinations={},
        case_supports={k: v for k, v in problem.case_supports.items() if k == name},
    )
    try:
        stress = solve(rough)[name]
    except SolveError as error:
        return [
            f"neither build directions nor pins are judged, for the part is not solved: {error}"
        ]
    turned = isinstance(slicing, Planar) and slicing.axis == "build"
    proposal = better_direction(stress, case.build, case.machine) if turned else ""
    return [line for line in (_about_order(problem, stress), proposal, about_pins(stress)) if line]


def _about_order(problem: Problem, rough: StressField) -> str:
    """Say that quadratic cells will be taken by themselves, at which cost and why."""
    linear = rough.mesh.order == 1
    why = why_quadratic(problem, rough.record.error) if linear else ""
    if not why or problem.order != "auto" or len(problem.mesh.cells) > MOST_CELLS:
        return ""
    return f"solved on {about_quadratic(problem, why)}"


# What ``ccfem faces`` does: the smooth faces of a body listed, and drawn with their numbers.


_COLOURS = ("#9ec1e3", "#f3c98b", "#a8d5a2", "#e3a9c0", "#c9b8e0", "#e8e08a", "#9fd6d2", "#d9b89c")
_NAMED = 60
"""Faces that are named in the picture; the rest are smaller."""


def list_faces(body: Path, angle: float, scale: float, picture: Path) -> None:
    """Print the faces of a surface, a mesh file or a part, and draw them.

    Parameters
    ----------
    body : Path
        Surface, CAD or mesh file, part file, or the name of a case.
    angle : float, degrees
        Feature angle.
    scale : float
        Factor on the coordinates of a surface or mesh file, to make them mm.
    picture : Path
        File of the picture.
    """
    check_picture(picture)
    listing = faces_of(body, angle, scale)
    points, triangles, faces, names = (
        listing.points,
        listing.triangles,
        listing.faces,
        listing.names,
    )
    columns = ("face", "area, mm^2", "at", "what", "name")[: 5 if any(names) else 4]
    table = Table(box=None, padding=(0, 2, 0, 0))
    for column in columns:
        table.add_column(column, justify="right" if column in columns[:2] else "left")
    for k, (number, face) in enumerate(zip(listing.numbers, faces, strict=True)):
        at = place_text(listing.point_on(face))
        row = (str(number), f"{face.area:.4g}", at, face.shape, *names[k : k + 1])
        table.add_row(*row[: len(columns)])
    console = Console(highlight=False, markup=False)
    console.print(table)
    of = np.zeros(len(triangles), dtype=np.int64)
    for k, face in enumerate(faces):
        of[face.facets] = k
    colour = [_COLOURS[k % len(_COLOURS)] for k in of.tolist()]
    largest = sorted(range(len(faces)), key=lambda k: -faces[k].area)[:_NAMED]
    labels = [_label(points, triangles, faces[k], listing.numbers[k]) for k in sorted(largest)]
    draw_part(points, triangles, colour, labels, picture, title=f"{body.name}: {len(faces)} faces")
    about = "" if is_cad(body) else f" at a feature angle of {angle:g} degrees"
    console.print(
        f"{len(faces)} faces{about}; picture: {picture}\n"
        + (f"warning: {listing.doubt}\n" if listing.doubt else "")
        + 'in a part file: [patches.NAME] with rule = "face", at = [...] and normal, or axis and '
        "radius; lengths are mm"
    )


def _label(points: FloatArray, triangles: IntArray, face: Face, number: int) -> Label:
    """Label of a face at its triangle nearest to its centre."""
    corners = points[triangles[face.facets]]
    middles = corners.mean(axis=1)
    nearest = int(np.argmin(np.linalg.norm(middles - face.centre, axis=1)))
    a, b, c = corners[nearest]
    normal = np.cross(b - a, c - a)
    return Label(str(number), middles[nearest], normal / max(float(np.linalg.norm(normal)), 1e-300))
