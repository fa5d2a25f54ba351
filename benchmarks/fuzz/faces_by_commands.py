"""Choose faces by three commands: what `faces` lists is what `check` and `solve` take.

Run ``python -m benchmarks.fuzz.faces_by_commands``. Bodies of several kinds are listed as they
stand, turned by 37 degrees and mirrored; every face larger than a cell becomes a patch by its place
and one by its number. Each patch, and each face of that number listed from the part file and from
the mesh, must lie where the face of the body does.
"""

import sys
import tempfile
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import shapely

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.body.files import read_surface, write_mesh
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.meshing import extrude, faces_of_body, mesh_body
from ccfem.cases.inspection import check, faces
from ccfem.fem.elasticity import solve

__all__ = ["bodies", "differences", "plate_of_holes"]

_ANGLE = np.radians(37.0)
_AXIS = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
_CROSS = np.cross(np.eye(3), _AXIS)
TURNS = {
    "as it stands": np.eye(3),
    "turned": np.eye(3) + np.sin(_ANGLE) * _CROSS + (1.0 - np.cos(_ANGLE)) * _CROSS @ _CROSS,
    "mirrored": np.diag([-1.0, 1.0, 1.0]),
}
"""What is done to a body."""


def plate_of_holes(path: Path) -> None:
    """Write a plate of 80 x 60 x 6 mm with twelve holes of radius 4, as a surface."""
    outline = shapely.box(0.0, 0.0, 80.0, 60.0)
    for x in (10.0, 30.0, 50.0, 70.0):
        for y in (10.0, 30.0, 50.0):
            outline = outline.difference(shapely.Point(x, y).buffer(4.0, 16))
    mesh = extrude(outline, 6.0, 5.0)
    used, triangles = np.unique(mesh.boundary, return_inverse=True)
    _write(mesh.points[used], triangles.reshape(-1, 3), path)


def moved(path: Path, turn: FloatArray, out: Path) -> None:
    """Write a surface turned or mirrored."""
    surface = read_surface(path)
    order = [0, 1, 2] if np.linalg.det(turn) > 0.0 else [0, 2, 1]
    _write(surface.points @ turn.T, surface.triangles[:, order], out)


def bodies(folder: Path) -> Iterator[tuple[str, Path, float]]:
    """Write bodies; give name, file and edge length, mm, of each."""
    plate_of_holes(folder / "plate.stl")
    edges = {"plate.stl": 5.0}
    if find_spec("gmsh") is not None:
        from benchmarks.studies.own_parts import main as own_parts

        own_parts(folder)
        yield "l_bracket.step", folder / "l_bracket.step", 4.0
        bracket = faces_of_body(folder / "l_bracket.step")
        _write(bracket.points, bracket.triangles, folder / "l_bracket.stl")
        edges |= {"l_bracket.stl": 4.0, "crane_hook.stl": 5.0, "brake_lever.stl": 4.0}
    for name, edge in edges.items():
        for k, (what, turn) in enumerate(TURNS.items()):
            out = folder / f"{Path(name).stem}_{k}.stl"
            moved(folder / name, turn, out)
            yield f"{name} {what}", out, edge


def differences(body: Path, edge: float) -> list[str]:
    """Say where a command takes another face of a body than `faces` lists; empty if nowhere."""
    listed = faces(body)
    numbers = [n for n in listed.numbers if listed.face(n).area > edge**2]
    part = body.with_suffix(".toml")
    part.write_text(_part_file(body, edge, listed, numbers))
    mesh = mesh_body(body, edge)[0]
    write_mesh(mesh, body.with_suffix(".npz"))
    checked = check(part)
    if checked.mistakes:
        return list(checked.mistakes)
    solved = next(iter(solve(checked.case.problem).values()))
    places = {
        f"faces of {what}": {n: _where(them.points, them.triangles, them, n) for n in numbers}
        for what, them in (
            ("the part", faces(part)),
            ("the mesh", faces(body.with_suffix(".npz"))),
            ("the case", faces(checked.case)),
        )
    }
    for what in ("place", "number"):
        rows = {row.name: row for row in checked.patches}
        named = {n: f"{what}_{n}" for n in numbers}
        places[f"check by {what}"] = {
            n: np.append(rows[name].centre, rows[name].area) for n, name in named.items()
        }
        places[f"solve by {what}"] = {
            n: _of(solved.mesh.points, solved.mesh.patches[name]) for n, name in named.items()
        }
    expected = {n: _where(listed.points, listed.triangles, listed, n) for n in numbers}
    return [
        f"{command}: face {n} at {got[n][:3]} of {got[n][3]:.4g} mm^2, listed at "
        f"{expected[n][:3]} of {expected[n][3]:.4g} mm^2"
        for command, got in places.items()
        for n in numbers
        if np.linalg.norm(got[n][:3] - expected[n][:3]) > 0.2 * edge
        or abs(got[n][3] - expected[n][3]) > 0.1 * expected[n][3]
    ]


def _part_file(body: Path, edge: float, listed: BodyFaces, numbers: list[int]) -> str:
    """Text of a part with a patch for every face by its place, and one by its number."""
    lines = [f'surface = "{body.name}"', f"edge_length = {edge}", 'material = "pla"', "order = 1"]
    for n in numbers:
        lines += [f"[patches.place_{n}]", 'rule = "face"']
        for key, value in listed.place(n).items():
            lines.append(f"{key} = {np.array(value).tolist()!r}")
        lines += [f"[patches.number_{n}]", 'rule = "face"', f"number = {n}"]
    lines += ["[[supports]]", f'patch = "place_{numbers[0]}"']
    lines += ["[[loads.pull]]", 'kind = "force"', f'patch = "number_{numbers[-1]}"']
    return "\n".join([*lines, "vector = [1, 2, 3]", ""])


def _where(points: FloatArray, triangles: IntArray, listed: BodyFaces, number: int) -> FloatArray:
    """Centre and area, (4,), of a face of a listing."""
    return _of(points, triangles[listed.face(number).facets])


def _of(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Centre, mm, and area, mm^2, of triangles, (4,)."""
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.append(area @ (a + b + c) / (3.0 * area.sum()), area.sum())


def _write(points: FloatArray, triangles: IntArray, path: Path) -> None:
    import pyvista

    pyvista.PolyData.from_regular_faces(points, triangles).save(path)


def main() -> int:
    """Try all bodies; return how many are not met as they should be."""
    wrong = count = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, body, edge in bodies(Path(folder)):
            start = time.perf_counter()
            found = differences(body, edge)
            wrong, count = wrong + bool(found), count + 1
            print(f"{name}: {len(found)} differences, {time.perf_counter() - start:.1f} s")
            print(*(f"  {line}" for line in found[:5]), sep="\n", end="\n" if found else "")
    print(f"{count} bodies, {wrong} not met as they should be")
    return wrong


if __name__ == "__main__":
    sys.exit(bool(main()))
