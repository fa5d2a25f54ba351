"""Compare by every strategy on every slicing, as far as the written report.

Run ``python -m benchmarks.fuzz.pairs [pictures]``: each strategy alone on each slicing, with its
own amount of fibre and with a given one, then all strategies on all slicings together. Slicings are
flat and curved, among them a layer too small for any strand. A pair ends well, without a picture
or a view of the report left out, or in one line.
"""

import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import shapely

from benchmarks.fuzz.__main__ import verdict
from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.body.mesh.patches import Cylinder, patches_from_rules
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.body.meshing import extrude
from ccfem.cases.case import Case
from ccfem.comparison.engine import compare
from ccfem.comparison.files import write_results
from ccfem.comparison.request import DEFAULT_STRAND
from ccfem.comparison.result import Comparison
from ccfem.fem.elasticity import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.machine import Machine
from ccfem.slicing.layers.level_surfaces import level_surfaces
from ccfem.slicing.layers.slicer import Slicer
from ccfem.slicing.slicers import LoadOriented, Spatial, Surfaces, ThroughStrands, named
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import named as strategies

__all__ = ["bent_link", "see", "slicings", "write_surfaces"]

_HOLES = ((14.0, 12.0), (46.0, 12.0))
_LENGTHS = {"natural": None, "equal": 150.0}
"""Length of fibre in each layer, mm; None lets each strategy lay its own."""


def bent_link() -> Case:
    """Link 60 x 24 x 4 mm with two holes, bent up, held at one hole and pulled at the other."""
    outline = shapely.box(0.0, 0.0, 60.0, 24.0)
    for hole in _HOLES:
        outline = outline.difference(shapely.Point(hole).buffer(4.0, quad_segs=4))
    rules = {
        name: Cylinder((*hole, 0.0), "z", 4.0)
        for name, hole in zip(("held", "pulled"), _HOLES, strict=True)
    }
    mesh = patches_from_rules(extrude(outline, 4.0, 4.0), rules)
    mesh = TetMesh(mesh.points + _up(mesh.points), mesh.cells, mesh.patches)
    loads = {"pull": (Force("pulled", (300.0, 60.0, 0.0)),)}
    material = isotropic(3500.0, 0.35, tensile_strength=50.0, interlayer_tensile=18.0)
    problem = Problem(mesh, material, (Support("held"),), loads)
    machine = Machine(minimum_length=20.0)
    return Case("link", "Bent link", problem, slicing=Planar(count=2), machine=machine)


def _up(points: FloatArray) -> FloatArray:
    """How far points of the flat link are bent up, mm: 3 mm in the middle."""
    return np.outer(3.0 * np.sin(np.pi * points[:, 0] / 60.0), [0.0, 0.0, 1.0])


def write_surfaces(folder: Path) -> None:
    """Write files of layers, and those of strands into a folder within.

    The layers are the curved middle of the link and a scrap of it of about 5 x 4 mm, the strands
    rows along it, 3 mm apart, on two layers.
    """
    (folder / "strands").mkdir()
    along = np.linspace(1.0, 59.0, 30)
    for number, height in enumerate((1.6, 2.2)):
        rows = [
            np.column_stack([along, np.full(30, y), np.full(30, height)])
            for y in np.arange(2.0, 24.0, 3.0)
        ]
        bent = np.concatenate([row + _up(row) for row in rows])
        vertices = [f"v {x!r} {y!r} {z!r}" for x, y, z in bent.tolist()]
        starts = range(1, len(bent), 30)
        lines = [f"l {k} {k + 1}" for start in starts for k in range(start, start + 29)]
        (folder / "strands" / f"{number}.obj").write_text("\n".join(vertices + lines) + "\n")
    mesh = bent_link().problem.mesh
    flat = (mesh.points - _up(mesh.points))[:, 2]
    (layer,) = level_surfaces(mesh, flat, np.array([2.2]), 0.5, 0.6, 5.0).layers
    middle = layer.points[layer.triangles].mean(axis=1)
    scrap = np.all(np.abs(middle[:, :2] - [30.0, 12.0]) < [2.5, 2.0], axis=1)
    vertices = [f"v {x!r} {y!r} {z!r}" for x, y, z in layer.points.tolist()]
    for number, triangles in enumerate((layer.triangles, layer.triangles[scrap])):
        faces = [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
        (folder / f"layer{number}.obj").write_text("\n".join(vertices + faces) + "\n")


def slicings(folder: Path) -> dict[str, Slicer]:
    """Every slicer, and flat layers of which the lowest is a scrap."""
    made: dict[str, Slicer] = {
        "planar": Planar(count=2),
        "planar, scrap": Planar(heights=(0.1, 2.0)),
        "planar along x": Planar(count=3, axis="x"),
        "spatial": Spatial(count=2),
        "load_oriented": LoadOriented(thickness=3.0, thinnest=2.0, thickest=5.0),
        "surfaces": Surfaces(str(folder)),
        "through_strands": ThroughStrands(str(folder / "strands")),
    }
    missing = set(named()) - {name.partition(",")[0].split()[0] for name in made}
    if missing:
        raise SystemExit(f"no pair has the slicers {', '.join(sorted(missing))}: add them")
    return made


def see(
    slicer: Slicer | dict[str, Slicer],
    strategies: Sequence[str],
    length: float | None,
    pictures: bool,
    folder: Path,
    strand: Strand | None = DEFAULT_STRAND,
) -> Comparison:
    """Compare strategies on one slicing, or on several at once, and write all that it takes."""
    warnings.filterwarnings("error", category=UserWarning)
    case, natural = bent_link(), length is None
    with tempfile.TemporaryDirectory() as written:
        if isinstance(slicer, dict):
            total = None if length is None else 2.0 * length
            found = compare(
                case, strategies, slicings=slicer, natural=natural, fibre=total, strand=strand
            )
            write_results(found, Path(written), pictures=pictures)
        else:
            found = compare(case, strategies, slicer, length, natural, strand)
            if found.succeeded:
                write_results(found, Path(written), pictures=pictures)
    if not found.succeeded:
        raise InputError(found.runs[0].failure)
    return found


def main(pictures: bool = False) -> int:
    """Try all pairs; return how many are not met as they should be."""
    tally: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        write_surfaces(Path(name))
        made = slicings(Path(name))
        known = sorted(strategies())
        jobs: list[tuple[str, Slicer | dict[str, Slicer], list[str], float | None]] = [
            (f"{each} on {where}, {amount}", slicer, [each], length)
            for where, slicer in made.items()
            for each in known
            for amount, length in _LENGTHS.items()
        ]
        jobs += [(f"all, {amount}", made, known, length) for amount, length in _LENGTHS.items()]
        for title, slicer, chosen, length in jobs:
            start = time.perf_counter()
            limit = 600.0 if title.startswith("all, ") else 60.0
            found = verdict(Path(name), partial(see, slicer, chosen, length, pictures), limit)
            tally[found if found in ("read", "refused") else "WRONG"] += 1
            print(f"{title}: {found}, {time.perf_counter() - start:.1f} s", flush=True)
    print(dict(tally))
    return tally["WRONG"]


if __name__ == "__main__":
    sys.exit(bool(main("pictures" in sys.argv[1:])))
