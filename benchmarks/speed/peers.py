"""The elasticity solver beside dolfinx (MUMPS, GAMG) and CalculiX, in one run.

The peers are child processes: Debian's ``python3-dolfinx`` by the system's own interpreter, since
it wants NumPy 1, and ``ccx``; where one is missing it is left out with a word. Every program has
one thread. Programs alternate; what counts is the processor time, which other work on the machine
disturbs least, and the ratio of a round, of which the median is printed: read the ratios, not the
seconds. Reading of files, meshing and compiling are not counted; of CalculiX, which does all in
one, the whole process is.

    python benchmarks/speed/peers.py
    python benchmarks/speed/peers.py box32k box421k --order 1 --rounds 3
"""

import json
import os
import resource
import shutil
import subprocess
import tempfile
from pathlib import Path
from statistics import median
from typing import Annotated

for library in ("OMP", "MKL", "OPENBLAS", "NUMBA"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402
import typer  # noqa: E402
from elasticity import BOXES, MATERIAL, Run, ends, forces_on, ours, part  # noqa: E402

from ccfem.body.mesh import TetMesh  # noqa: E402
from ccfem.body.mesh.box import box_mesh  # noqa: E402
from ccfem.fem.elasticity.assembly import assemble  # noqa: E402
from ccfem.fem.materials import isotropic  # noqa: E402

HERE = Path(__file__).parent
SYSTEM = "/usr/bin/python3"
BOXES["box1030k"] = ((100.0, 60.0, 40.0), (68, 52, 48))
BOXES["box4930k"] = ((100.0, 60.0, 40.0), (113, 88, 82))


def has_dolfinx() -> bool:
    """Whether the system's interpreter has dolfinx."""
    tried = subprocess.run([SYSTEM, "-c", "import dolfinx, petsc4py"], capture_output=True)
    return tried.returncode == 0


def dolfinx(mesh: TetMesh, order: int, solver: str, folder: Path) -> Run:
    """Solve a mesh by dolfinx."""
    axis = int(np.ptp(mesh.bounds, axis=0).argmax())
    np.savez(
        folder / "part.npz",
        points=mesh.points,
        cells=mesh.corners,
        material=MATERIAL,
        axis=axis,
        low=mesh.bounds[0, axis],
        high=mesh.bounds[1, axis],
    )
    command = [SYSTEM, str(HERE / "dolfinx_peer.py"), str(folder / "part.npz"), solver, str(order)]
    kept = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    done = subprocess.run(command, capture_output=True, text=True, env=kept)
    if done.returncode:
        raise SystemExit(f"dolfinx failed: {done.stderr.splitlines()[-1]}")
    found = json.loads(done.stdout.splitlines()[-1])
    return Run(
        tuple(found["assembly"]),
        tuple(found["solve"]),
        found["largest"],
        f"{found['record'] or 'mumps'}, {', '.join(found['blas']) or 'BLAS unknown'}",
    )


def calculix(mesh: TetMesh, folder: Path) -> Run:
    """Solve a mesh by CalculiX with its default solver: the whole process is timed."""
    fixed, _ = ends(mesh)
    forces = forces_on(mesh)
    with (folder / "part.inp").open("w") as file:
        file.write("*NODE, NSET=ALL\n")
        numbered = np.column_stack([np.arange(1, len(mesh.points) + 1), mesh.points])
        np.savetxt(file, numbered, fmt=["%d"] + 3 * ["%.15g"], delimiter=",")
        file.write(f"*ELEMENT, TYPE=C3D{4 if mesh.order == 1 else 10}, ELSET=E\n")
        cells = np.column_stack([np.arange(1, len(mesh.cells) + 1), mesh.cells + 1])
        np.savetxt(file, cells, fmt="%d", delimiter=",")
        file.write(f"*MATERIAL, NAME=M\n*ELASTIC\n{MATERIAL[0]}, {MATERIAL[1]}\n")
        file.write("*SOLID SECTION, ELSET=E, MATERIAL=M\n*BOUNDARY\n")
        file.writelines(f"{node + 1}, 1, 3\n" for node in np.flatnonzero(fixed))
        file.write("*STEP\n*STATIC\n*CLOAD\n")
        file.writelines(f"{n + 1}, 1, {forces[n, 0]:.15g}\n" for n in np.flatnonzero(forces[:, 0]))
        file.write("*NODE PRINT, NSET=ALL\nU\n*END STEP\n")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(["ccx", "part"], cwd=folder, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    rows = [line.split() for line in (folder / "part.dat").read_text().splitlines()]
    u = np.array([row[1:] for row in rows if len(row) == 4], dtype=float)
    largest = float(np.linalg.norm(u, axis=1).max())
    return Run((0.0, 0.0), (np.nan, seconds), largest, "whole process")


def compared(name: str, order: int, rounds: int, folder: Path) -> None:
    """Time all programs on one part, and print the ratios."""
    linear = part(name)
    mesh = linear if order == 1 else linear.quadratic()
    print(f"{name}, order {order}: {len(mesh.cells):,} cells, {3 * len(mesh.points):,} unknowns")
    # As the peer does, memory is touched once before: a process's first pages take their time.
    assemble(mesh, isotropic(*MATERIAL).stiffness)
    runs = {"ccfem": lambda: ours(mesh)}
    if has_dolfinx():
        if len(mesh.points) < (60_000 if order == 1 else 200_000):
            runs["dolfinx, MUMPS"] = lambda: dolfinx(linear, order, "mumps", folder)
        runs["dolfinx, GAMG"] = lambda: dolfinx(linear, order, "gamg", folder)
    if shutil.which("ccx") and len(mesh.points) < 50_000:
        runs["CalculiX"] = lambda: calculix(mesh, folder)
    found: dict[str, list[Run]] = {program: [] for program in runs}
    for _ in range(rounds):
        for program, run in runs.items():
            found[program].append(run())
    sizes = [run.largest for results in found.values() for run in results]
    if np.ptp(sizes) > 1e-5 * max(sizes):
        raise SystemExit(f"the programs disagree on the displacement: {sizes}")
    for program, results in found.items():
        assembly, solve = (median(getattr(r, k)[1] for r in results) for k in ("assembly", "solve"))
        pairs = list(zip(found["ccfem"], results, strict=True))
        total = median(
            (a.assembly[1] + a.solve[1]) / (b.assembly[1] + b.solve[1]) for a, b in pairs
        )
        faster = median(
            a.assembly[1] / b.assembly[1] if b.assembly[1] else np.nan for a, b in pairs
        )
        print(
            f"  {program:15s} assembly {assembly:7.2f} s, solve {solve:7.2f} s  "
            f"ccfem takes {total:.2f} of it, assembly {faster:.2f}  ({results[0].record})",
            flush=True,
        )


def main(
    parts: Annotated[list[str] | None, typer.Argument(help="Names of parts.")] = None,
    order: int = 1,
    rounds: int = 3,
) -> None:
    """Print processor times and ratios of each part."""
    for program, there in (("dolfinx", has_dolfinx()), ("CalculiX", bool(shutil.which("ccx")))):
        if not there:
            print(f"{program} is not installed: left out")
    warm = box_mesh((1.0, 1.0, 1.0), (4, 4, 4))
    ours(warm, "superlu")
    ours(box_mesh((1.0, 1.0, 1.0), (12, 12, 12)), "amg")  # three levels
    ours(warm.quadratic(), "two-level")
    with tempfile.TemporaryDirectory() as folder:
        for name in parts or ("box32k", "plate112k"):
            compared(name, order, rounds, Path(folder))


if __name__ == "__main__":
    typer.run(main)
