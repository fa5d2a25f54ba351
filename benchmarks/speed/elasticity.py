"""Speed and memory of the elasticity solver beside scikit-fem and beside direct solves.

Everything printed is measured in this run, ours and the peer alternating; read the ratios, not
the seconds. Ratios come twice: of wall time, and of processor time, which other work on the
machine disturbs less but which counts every thread. ``pip install -e ".[dev]"`` brings the peer.
With ``CCFEM_CHEN2021`` set to the folder of the authors' data the first part is their Loop mesh,
else a stand-in of the same size.

    python benchmarks/speed/elasticity.py
    python benchmarks/speed/elasticity.py --large
"""

import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

import numpy as np
import typer

from ccfem.body.files import read_mesh
from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.assembly import assemble, pattern
from ccfem.fem.elasticity.held import Held
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.system import System
from ccfem.fem.materials import isotropic

MATERIAL = (3500.0, 0.35)

BOXES = {
    "box32k": ((100.0, 60.0, 40.0), (24, 16, 14)),
    "plate112k": ((140.0, 100.0, 10.0), (64, 48, 6)),
    "box112k": ((100.0, 60.0, 40.0), (32, 28, 21)),
    "box421k": ((100.0, 60.0, 40.0), (50, 39, 36)),
}


def part(name: str) -> TetMesh:
    if name == "loop":
        mesh = read_mesh(Path(os.environ["CCFEM_CHEN2021"]) / "Loop" / "Loop.tet")
    else:
        mesh = box_mesh(*BOXES[name])
    return TetMesh(mesh.points, mesh.cells)


def ends(mesh: TetMesh) -> tuple[np.ndarray, np.ndarray]:
    """Nodes at the two ends of the longest side: held, and loaded."""
    axis = int(np.ptp(mesh.bounds, axis=0).argmax())
    place = (mesh.points[:, axis] - mesh.bounds[0, axis]) / np.ptp(mesh.bounds[:, axis])
    return place <= 0.03, place >= 0.97


def forces_on(mesh: TetMesh) -> np.ndarray:
    _, loaded = ends(mesh)
    forces = np.zeros(mesh.points.shape)
    forces[loaded, 0] = 100.0 / loaded.sum()
    return forces


@dataclass
class Run:
    """One run: wall and processor time of assembly and solve, s, largest displacement, mm."""

    assembly: tuple[float, float]
    solve: tuple[float, float]
    largest: float
    record: str


def clock() -> np.ndarray:
    return np.array([perf_counter(), process_time()])


def ours(mesh: TetMesh, backend: str = "auto") -> Run:
    mesh = TetMesh(mesh.points, mesh.cells)  # nothing cached
    stiffness = isotropic(*MATERIAL).stiffness
    started = clock()
    where = pattern(mesh)
    matrix = assemble(mesh, stiffness, where=where)
    assembled = clock()
    fixed, _ = ends(mesh)
    free = np.repeat(~fixed[:, None], 3, axis=1)
    held = Held(free, np.zeros(free.shape), np.flatnonzero(~fixed))
    system = System(Problem(mesh, isotropic(*MATERIAL), ()), held, {})
    solver = system.factorise(matrix, backend)
    solution = solver.solve(held.right_hand_side(matrix, forces_on(mesh)))
    u = held.expand(solution.values)
    done = clock()
    record = f"{solver.backend}, {solution.iterations} iterations, {solution.residual:.0e}"
    largest = float(np.linalg.norm(u, axis=1).max())
    return Run(tuple(assembled - started), tuple(done - assembled), largest, record)


def scikit_fem(mesh: TetMesh) -> Run:
    import skfem
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    peer = skfem.MeshTet(np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(mesh.corners.T))
    started = clock()
    basis = skfem.Basis(peer, skfem.ElementVector(skfem.ElementTetP1()))
    matrix = linear_elasticity(*lame_parameters(*MATERIAL)).assemble(basis)
    assembled = clock()
    fixed, _ = ends(mesh)
    load = np.zeros(basis.N)
    load[basis.nodal_dofs] = forces_on(mesh).T
    u = skfem.solve(*skfem.condense(matrix, load, D=basis.nodal_dofs[:, fixed].reshape(-1)))
    done = clock()
    largest = float(np.linalg.norm(u[basis.nodal_dofs], axis=0).max())
    return Run(
        tuple(assembled - started), tuple(done - assembled), largest, "its default direct solve"
    )


def alternate(runs: Mapping[str, Callable[[], Run]], repeat: int) -> dict[str, list[Run]]:
    """Run each in turn, `repeat` times; they must find the same displacement."""
    found: dict[str, list[Run]] = {name: [] for name in runs}
    for _ in range(repeat):
        for name, run in runs.items():
            found[name].append(run())
    sizes = [run.largest for results in found.values() for run in results]
    if np.ptp(sizes) > 1e-5 * max(sizes):
        raise SystemExit(f"the programs disagree on the displacement: {sizes}")
    return found


def report(found: dict[str, list[Run]]) -> None:
    """Print times, and the median over the rounds of each ratio of the first to the others."""
    for name, results in found.items():
        assembly, solve = (median(getattr(r, k)[0] for r in results) for k in ("assembly", "solve"))
        print(
            f"  {name:12s} assembly {assembly:7.3f} s, solve {solve:7.3f} s  ({results[0].record})"
        )
    (first, own), *others = found.items()
    for name, results in others:
        pairs = list(zip(own, results, strict=True))
        faster, share = [], []
        for k in range(2):
            faster.append(median(b.assembly[k] / a.assembly[k] for a, b in pairs))
            share.append(
                median(
                    (a.assembly[k] + a.solve[k]) / (b.assembly[k] + b.solve[k]) for a, b in pairs
                )
            )
        print(
            f"  {first} against {name}: assembly {faster[0]:.1f} times as fast (processor "
            f"{faster[1]:.1f}), total {share[0]:.2f} of its time (processor {share[1]:.2f})"
        )


def peak_memory(name: str, order: int, backend: str) -> float:
    """Peak memory, MB, of a process that solves one part and nothing else."""
    command = [sys.executable, __file__, "--alone", f"{name},{order},{backend}"]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def alone(what: str) -> None:
    """Solve one part and print the peak memory of this process, MB."""
    name, order, backend = what.split(",")
    mesh = part(name)
    if backend == "scikit-fem":
        scikit_fem(mesh)
    else:
        ours(mesh if order == "1" else mesh.quadratic(), backend)
    status = Path("/proc/self/status").read_text()
    print(float(status.split("VmHWM:")[1].split()[0]) / 1024.0)


def main(repeat: int = 3, large: bool = False, alone_: str = typer.Option("", "--alone")) -> None:
    """Print times, ratios and peak memory."""
    if alone_:
        return alone(alone_)
    first = "loop" if "CCFEM_CHEN2021" in os.environ else "box32k"
    warm = box_mesh((1.0, 1.0, 1.0), (2, 2, 2))
    ours(warm, "amg"), ours(warm.quadratic(), "two-level")

    parts = [(first, repeat), ("plate112k", 1)] + [("box112k", 1)] * large
    for name, rounds in parts:
        mesh = part(name)
        print(f"{name}, linear: {len(mesh.cells)} cells, {3 * len(mesh.points)} unknowns")
        runs = {"ccfem": partial(ours, mesh), "scikit-fem": partial(scikit_fem, mesh)}
        report(alternate(runs, rounds))
        own, peer = (peak_memory(name, 1, backend) for backend in ("auto", "scikit-fem"))
        print(f"  peak memory: ccfem {own:.0f} MB, scikit-fem {peer:.0f} MB")

    mesh = part(first).quadratic()
    print(f"{first}, quadratic: {len(mesh.cells)} cells, {3 * len(mesh.points)} unknowns")
    direct = "pypardiso" if find_spec("pypardiso") else "superlu"
    report(alternate({b: partial(ours, mesh, b) for b in ("two-level", direct)}, repeat))
    own, peer = (peak_memory(first, 2, backend) for backend in ("two-level", direct))
    print(f"  peak memory: two-level {own:.0f} MB, {direct} {peer:.0f} MB")

    if large:
        mesh = part("box421k")
        print(f"box421k, linear: {len(mesh.cells)} cells, {3 * len(mesh.points)} unknowns")
        report(alternate({"ccfem": lambda: ours(mesh)}, 1))
        print(f"  peak memory: {peak_memory('box421k', 1, 'auto'):.0f} MB")
    return None


if __name__ == "__main__":
    typer.run(main)
