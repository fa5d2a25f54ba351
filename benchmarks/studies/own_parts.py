"""Make three parts as a user brings them: crane hook and brake lever (STL), bracket (STEP).

Run ``python benchmarks/studies/own_parts.py FOLDER``; docs/how_to/your_part.md goes on from there.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

__all__ = ["brake_lever", "crane_hook", "l_bracket", "shapes", "write"]


@contextmanager
def shapes() -> Iterator[tuple[Any, Any]]:
    """Gmsh with an empty model, and what makes shapes in it."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        yield gmsh, gmsh.model.occ
    finally:
        gmsh.finalize()


def write(gmsh: Any, path: Path, size: float) -> None:
    """Write the model: STEP as it is, STL as triangles of a size."""
    gmsh.model.occ.synchronize()
    if path.suffix == ".stl":
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 32)
        gmsh.option.setNumber("Mesh.Binary", 1)
        gmsh.model.mesh.generate(2)
        for _, tag in gmsh.model.getEntities(3):
            gmsh.model.mesh.setOutwardOrientation(tag)
    gmsh.write(str(path))


def crane_hook(path: Path, size: float = 6.0) -> None:
    """Make a hook 12 mm thick: an eye of radius 6 at (0, 70), a bowl of radius 18 at (0, 0)."""
    with shapes() as (gmsh, occ):
        bowl = occ.addDisk(0, 0, 0, 32, 32)
        inner = occ.addDisk(0, 0, 0, 18, 18)
        mouth = occ.addRectangle(-40, 0, 0, 36, 40)
        bowl = occ.cut([(2, bowl)], [(2, inner), (2, mouth)])[0]
        shank = occ.addRectangle(-4, 20, 0, 16, 50)
        head = occ.addDisk(4, 70, 0, 14, 14)
        body = occ.fuse(bowl, [(2, shank), (2, head)])[0]
        body = occ.cut(body, [(2, occ.addDisk(4, 70, 0, 6, 6))])[0]
        occ.extrude(body, 0, 0, 12)
        occ.remove(body)
        write(gmsh, path, size)


def l_bracket(path: Path) -> None:
    """Make a bracket 60 x 40 x 50 mm, 6 thick: four bolt holes of radius 2.75, an eye of 5."""
    with shapes() as (gmsh, occ):
        foot, wall = occ.addBox(0, 0, 0, 60, 40, 6), occ.addBox(0, 0, 0, 6, 40, 50)
        body = occ.fuse([(3, foot)], [(3, wall)])[0]
        holes = [(3, occ.addCylinder(x, y, -1, 0, 0, 8, 2.75)) for x in (25, 50) for y in (10, 30)]
        occ.cut(body, [*holes, (3, occ.addCylinder(-1, 20, 35, 8, 0, 0, 5))])
        write(gmsh, path, 3.0)


def brake_lever(path: Path) -> None:
    """Make a lever 120 mm long, 8 mm thick: a pivot of radius 4, a cable hole of radius 2.5."""
    with shapes() as (gmsh, occ):
        head, tip = occ.addDisk(0, 0, 0, 11, 11), occ.addDisk(110, -12, 0, 6, 6)
        corners = [(0, 11), (0, -11), (110, -18), (110, -6)]
        points = [occ.addPoint(x, y, 0) for x, y in corners]
        sides = [occ.addLine(points[k], points[(k + 1) % 4]) for k in range(4)]
        arm = occ.addPlaneSurface([occ.addCurveLoop(sides)])
        body = occ.fuse([(2, head)], [(2, arm), (2, tip)])[0]
        pivot, cable = occ.addDisk(0, 0, 0, 4, 4), occ.addDisk(22, 0, 0, 2.5, 2.5)
        body = occ.cut(body, [(2, pivot), (2, cable)])[0]
        occ.extrude(body, 0, 0, 8)
        occ.remove(body)
        write(gmsh, path, 4.0)


def main(folder: Path) -> None:
    """Write all three into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    crane_hook(folder / "crane_hook.stl")
    l_bracket(folder / "l_bracket.step")
    brake_lever(folder / "brake_lever.stl")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "parts"))
