"""Speed of SIMP and SOMP on plates, and of SIMP beside pyMOTO on the same problem.

Everything printed is measured in this run, ours and the peer alternating; read the ratios, not
the seconds. Ratios come twice: of wall time, and of processor time, which other work on the
machine disturbs less but which counts every thread. ``pip install pymoto`` brings the peer; it
takes PARDISO when that is installed. Its volume constraint is on the variables, ours on the
filtered densities, so the compliances after some iterations are close, not equal.

    python benchmarks/speed/topopt.py
"""

from collections.abc import Callable
from importlib.util import find_spec
from statistics import median
from time import perf_counter, process_time
from typing import Any

import numpy as np
import typer

from ccfem.elasticity import (
    Force,
    PlaneProblem,
    PointForce,
    Support,
    raster_mesh,
)
from ccfem.materials import plane_stress
from ccfem.topopt import simp, somp, three_point_bending

UNIT = plane_stress(1.0, 1.0, 0.3, 1.0 / 2.6)
WANG = plane_stress(18300.0, 19800.0, 0.17, 5150.0)


def mbb(columns: int, rows: int) -> PlaneProblem:
    mesh = raster_mesh(np.ones((rows, columns), dtype=bool))
    mesh = mesh.with_patches({"roller": mesh.nearest_nodes([[columns, 0]])[:, None]})
    loads = {"load": (PointForce((0.0, rows, 0.0), (0.0, -1.0, 0.0)),)}
    supports = (Support("x_min", "x"), Support("roller", "y"))
    return PlaneProblem(mesh, UNIT, 1.0, supports, loads)


def bridge() -> PlaneProblem:
    """Bridge of Wang et al. 2021, 185 x 50 mm: 100 N over 5 mm, supports of 5 mm."""
    mesh = raster_mesh(np.ones((50, 185), dtype=bool))
    x, y = mesh.points.T
    sides = {
        "left": mesh.boundary_where((y == 0.0) & (x <= 5.0)),
        "right": mesh.boundary_where((y == 0.0) & (x >= 180.0)),
        "top": mesh.boundary_where((y == 50.0) & (np.abs(x - 92.5) <= 2.5)),
    }
    supports = (Support("left", "xy"), Support("right", "y"))
    loads = {"down": (Force("top", (0.0, -100.0, 0.0)),)}
    return PlaneProblem(mesh.with_patches(sides), WANG, 1.0, supports, loads)


def timed(work: Callable[[], Any]) -> tuple[Any, float, float]:
    wall, processor = perf_counter(), process_time()
    result = work()
    return result, perf_counter() - wall, process_time() - processor


def pymoto_mbb(columns: int, rows: int, iterations: int) -> float:
    """Compliance after some iterations of pyMOTO's own optimality criteria, density filter."""
    import pymoto as pym

    domain = pym.VoxelDomain(columns, rows)
    held = np.concatenate(
        [
            domain.get_dofnumber(domain.nodes[0, :].flatten(), 0, 2),
            domain.get_dofnumber(domain.nodes[columns, 0].flatten(), 1, 2),
        ]
    )
    force = np.zeros(2 * domain.nnodes)
    force[domain.get_dofnumber(domain.nodes[0, rows], 1, 2)] = -1.0
    density = pym.Signal("x", state=np.full(domain.nel, 0.5))
    with pym.Network() as network:
        filtered = pym.DensityFilter(domain, radius=2.4)(density)
        factor = pym.MathExpression("1e-9 + (1 - 1e-9) * inp0^3")(filtered)
        stiffness = pym.AssembleStiffness(domain, e_modulus=1.0, plane="stress", bc=held)(factor)
        displacement = pym.LinSolve(symmetric=True, positive_definite=True)(stiffness, force)
        compliance = pym.EinSum("i,i->")(displacement, force)
    pym.minimize_oc(
        density, compliance, network, move=0.2, maxit=iterations, tolx=0.0, tolf=0.0, verbosity=0
    )
    return float(np.asarray(compliance.state))


def against_pymoto(columns: int, rows: int, iterations: int, repeats: int) -> None:
    def ours() -> float:
        design = simp(
            mbb(columns, rows),
            0.5,
            radius=2.4,
            filter="density",
            tolerance=0.0,
            objective_tolerance=0.0,
            iterations=iterations,
        )
        return float(design.compliance[-1])

    rows_of_times = []
    for _ in range(repeats):
        own, *first = timed(ours)
        other, *second = timed(lambda: pymoto_mbb(columns, rows, iterations))
        rows_of_times.append([a / b for a, b in zip(first, second, strict=True)] + first + second)
    wall, processor, own_wall, _, other_wall, _ = map(median, zip(*rows_of_times, strict=True))
    typer.echo(
        f"MBB {columns} x {rows}, {iterations} iterations: compliance {own:.4f} and {other:.4f}; "
        f"{own_wall / iterations:.4f} s/iteration, pyMOTO {other_wall / iterations:.4f}; "
        f"ratio of wall time {wall:.2f}, of processor time {processor:.2f}"
    )


def main(repeats: int = 3) -> None:
    simp(mbb(12, 4), 0.5, iterations=2)  # compile
    for name, radius, filter in (
        ("sensitivity 1.5", 1.5, "sensitivity"),
        ("sensitivity 2.4", 2.4, "sensitivity"),
        ("density 2.4", 2.4, "density"),
    ):
        design, wall, processor = timed(
            lambda radius=radius, filter=filter: simp(mbb(60, 20), 0.5, 3.0, radius, filter)
        )
        typer.echo(
            f"MBB 60 x 20, {name}: {design.compliance[-1]:.2f} in {design.iterations} iterations, "
            f"{wall:.2f} s wall, {processor:.2f} s processor"
        )
    for name, work in (
        ("SIMP, bridge 185 x 50", lambda: simp(bridge(), 0.4, least=1e-3)),
        ("SOMP, bridge 185 x 50", lambda: somp(bridge(), WANG, 0.4)),
    ):
        design, wall, processor = timed(work)
        typer.echo(
            f"{name}: {design.compliance[-1]:.3f} in {design.iterations} iterations, "
            f"{wall / design.iterations:.4f} s/iteration wall, "
            f"{processor / design.iterations:.4f} processor"
        )
    _, wall, processor = timed(three_point_bending)
    typer.echo(f"three-point bending: {wall:.2f} s wall, {processor:.2f} s processor")
    if find_spec("pymoto") is None:
        typer.echo("pymoto is not installed: no comparison")
        return
    against_pymoto(60, 20, 50, repeats)
    against_pymoto(185, 50, 20, repeats)


if __name__ == "__main__":
    typer.run(main)
