"""Make three parts as a user brings them: crane hook and brake lever (STL), bracket (STEP).

Run ``python benchmarks/studies/own_parts.py FOLDER``; docs/how_to/your_part.md goes on from there.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

__all__ = ["brake_lever", "crane_hook", "l_bracket"]


@contextmanager
def _shapes() -> Iterator[tuple[Any, Any]]:
    """Gmsh with an empty model, and its shapes."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        yield gmsh, gmsh.model.occ
    finally:
        gmsh.finalize()


def _write(gmsh: Any, path: Path, size: float) -> None:
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


def crane_hook(path: Path) -> None:
    """Make a hook 12 mm thick: an eye of radius 6 at (0, 70), a bowl of radius 18 at (0, 0)."""
    with _shapes() as (gmsh, shapes):
        bowl = shapes.addDisk(0, 0, 0, 32, 32)
        inner = shapes.addDisk(0, 0, 0, 18, 18)
        mouth = shapes.addRectangle(-40, 0, 0, 36, 40)
        bowl = shapes.cut([(2, bowl)], [(2, inner), (2, mouth)])[0]
        shank = shapes.addRectangle(-4, 20, 0, 16, 50)
        head = shapes.addDisk(4, 70, 0, 14, 14)
        body = shapes.fuse(bowl, [(2, shank), (2, head)])[0]
        body = shapes.cut(body, [(2, shapes.addDisk(4, 70, 0, 6, 6))])[0]
        shapes.extrude(body, 0, 0, 12)
        shapes.remove(body)
        _write(gmsh, path, 6.0)


def l_bracket(path: Path) -> None:
    """Make a bracket 60 x 40 x 50 mm, 6 thick: four bolt holes of radius 2.75, an eye of 5."""
    with _shapes() as (gmsh, shapes):
        foot, wall = shapes.addBox(0, 0, 0, 60, 40, 6), shapes.addBox(0, 0, 0, 6, 40, 50)
        body = shapes.fuse([(3, foot)], [(3, wall)])[0]
        holes = [
            (3, shapes.addCylinder(x, y, -1, 0, 0, 8, 2.75)) for x in (25, 50) for y in (10, 30)
        ]
        shapes.cut(body, [*holes, (3, shapes.addCylinder(-1, 20, 35, 8, 0, 0, 5))])
        _write(gmsh, path, 3.0)


def brake_lever(path: Path) -> None:
    """Make a lever 120 mm long, 8 mm thick: a pivot of radius 4, a cable hole of radius 2.5."""
    with _shapes() as (gmsh, shapes):
        head, tip = shapes.addDisk(0, 0, 0, 11, 11), shapes.addDisk(110, -12, 0, 6, 6)
        corners = [(0, 11), (0, -11), (110, -18), (110, -6)]
        points = [shapes.addPoint(x, y, 0) for x, y in corners]
        sides = [shapes.addLine(points[k], points[(k + 1) % 4]) for k in range(4)]
        arm = shapes.addPlaneSurface([shapes.addCurveLoop(sides)])
        body = shapes.fuse([(2, head)], [(2, arm), (2, tip)])[0]
        pivot, cable = shapes.addDisk(0, 0, 0, 4, 4), shapes.addDisk(22, 0, 0, 2.5, 2.5)
        body = shapes.cut(body, [(2, pivot), (2, cable)])[0]
        shapes.extrude(body, 0, 0, 8)
        shapes.remove(body)
        _write(gmsh, path, 4.0)


def main(folder: Path) -> None:
    """Write all three into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    crane_hook(folder / "crane_hook.stl")
    l_bracket(folder / "l_bracket.step")
    brake_lever(folder / "brake_lever.stl")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "parts"))
