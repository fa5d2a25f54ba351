"""Speed of SIMP and SOMP on plates and in space, and of SIMP beside pyMOTO on the same problem.

Everything printed is measured in this run, ours and the peer alternating; read the ratios, not
the seconds. Ratios come twice: of wall time, and of processor time, which other work on the
machine disturbs less but which counts every thread. ``pip install pymoto`` brings the peer; it
takes PARDISO when that is installed. Its volume constraint is on the variables, ours on the
filtered densities, so the compliances after some iterations are close, not equal.

    python -m benchmarks.speed.topopt
"""

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from statistics import median
from time import perf_counter, process_time
from typing import Any

import numpy as np
import typer

from ccfem.base.arrays import IntArray
from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.patches import Box, patches_from_rules
from ccfem.cases.bodies import bracket_design
from ccfem.fem.elasticity import Force, PointForce, Problem, Support
from ccfem.fem.materials import isotropic, plane_stress
from ccfem.fem.plates import PlaneProblem, raster_mesh
from ccfem.fem.topopt import Simp, Somp, as_problem
from ccfem.papers.plocher_2022.plates import three_point_bending

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


def bridge_of_tets() -> tuple[Problem, IntArray]:
    """Build the bridge of one layer of tetrahedra in plane stress, and the column of each cell."""
    mesh = box_mesh((185.0, 50.0, 1.0), (185, 50, 1), alternating=True)
    boxes = {
        "left": Box((0.0, 0.0, 0.0), (5.0, 0.0, 1.0)),
        "right": Box((180.0, 0.0, 0.0), (185.0, 0.0, 1.0)),
        "top": Box((90.0, 50.0, 0.0), (95.0, 50.0, 1.0)),
    }
    plate = bridge()
    flat = (Support("z_min", "z"), Support("z_max", "z"))
    problem = Problem(
        patches_from_rules(mesh, boxes),
        isotropic(1.0, 0.3),
        (*plate.supports, *flat),
        plate.loads,
    )
    return problem, np.arange(len(mesh.cells)) // 6


def bridges(iterations: int) -> None:
    """Bridge of tetrahedra beside the bridge of quadrilaterals: their designs and their speed."""
    problem, columns = bridge_of_tets()
    method = Somp(0.4, tolerance=0.0, objective_tolerance=0.0, max_iterations=iterations)
    plate, *first = timed(lambda: method(bridge(), WANG))
    tets, *second = timed(lambda: method(problem, WANG, groups=columns))
    ours = tets.filled(0.4)[::6].reshape(50, 185)[::-1].reshape(-1)
    theirs = plate.filled(0.4)
    overlap = (ours & theirs).sum() / (ours | theirs).sum()
    typer.echo(
        f"SOMP, bridge of {len(columns)} tetrahedra, {iterations} iterations: compliance "
        f"{tets.compliance[-1]:.3f}, of quadrilaterals {plate.compliance[-1]:.3f} "
        f"({100.0 * (tets.compliance[-1] / plate.compliance[-1] - 1.0):+.2f} %); overlap of the "
        f"designs {overlap:.3f}; {second[1] / iterations:.4f} s/iteration processor, ratio to "
        f"quadrilaterals {second[1] / first[1]:.1f}"
    )


def bracket_in_space() -> None:
    """Bracket in space, to convergence, and its part."""
    design, wall, processor = timed(bracket_design)
    part, _, cutting = timed(lambda: as_problem(design, design.full.material))
    typer.echo(
        f"SIMP, bracket of {len(design.density)} tetrahedra: {design.compliance[-1]:.1f} in "
        f"{design.iterations} iterations (stopped by {design.converged}), "
        f"{wall / design.iterations:.3f} s/iteration wall, "
        f"{processor / design.iterations:.3f} processor, {processor:.0f} s processor in all; "
        f"part of {len(part.mesh.cells)} cells cut in {cutting:.1f} s processor"
    )


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
    method = Simp(
        0.5,
        radius=2.4,
        filter="density",
        tolerance=0.0,
        objective_tolerance=0.0,
        max_iterations=iterations,
    )

    def ours() -> float:
        return float(method(mbb(columns, rows)).compliance[-1])

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


BLOCK = (26, 26, 13)
"""Bricks of a block in space, with about as many nodes as the bracket has."""
PULL = 100.0
"""Force on the block; pyMOTO's multiplier has an absolute tolerance, which asks for a large one."""


def block() -> Problem:
    """Block of tetrahedra, six a brick: held at one end, pulled sideways along an edge."""
    mesh = box_mesh((26.0, 26.0, 13.0), BLOCK, alternating=True)
    x, y, _ = BLOCK
    edge = np.flatnonzero((mesh.points[:, 0] == x) & (mesh.points[:, 1] == y))
    force = -PULL / len(edge)
    loads = tuple(PointForce(tuple(mesh.points[k]), (0.0, force, 0.0)) for k in edge)
    return Problem(mesh, isotropic(1.0, 0.3), (Support("x_min"),), {"load": loads})


def pymoto_block(iterations: int) -> float:
    """Optimise the block of bricks in pyMOTO: compliance after some iterations."""
    import pymoto as pym

    domain = pym.VoxelDomain(*BLOCK)
    held = domain.get_dofnumber(domain.nodes[0, :, :].flatten(), np.arange(3), 3).flatten()
    edge = domain.nodes[BLOCK[0], BLOCK[1], :].flatten()
    force = np.zeros(3 * domain.nnodes)
    force[domain.get_dofnumber(edge, 1, 3)] = -PULL / len(edge)
    density = pym.Signal("x", state=np.full(domain.nel, 0.3))
    with pym.Network() as network:
        filtered = pym.DensityFilter(domain, radius=1.8)(density)
        factor = pym.MathExpression("1e-6 + (1 - 1e-6) * inp0^3")(filtered)
        stiffness = pym.AssembleStiffness(domain, e_modulus=1.0, poisson_ratio=0.3, bc=held)(factor)
        displacement = pym.LinSolve(symmetric=True, positive_definite=True)(stiffness, force)
        compliance = pym.EinSum("i,i->")(displacement, force)
    pym.minimize_oc(
        density, compliance, network, move=0.2, maxit=iterations, tolx=0.0, tolf=0.0, verbosity=0
    )
    return float(np.asarray(compliance.state))


def block_against_pymoto(iterations: int, repeats: int) -> None:
    """Compare iterations in space: tetrahedra, six a brick, and pyMOTO's bricks, of equal nodes."""
    problem = block()
    columns = np.arange(len(problem.mesh.cells)) // 6
    method = Simp(
        0.3,
        radius=1.8,
        filter="density",
        minimum_stiffness=1e-6,
        tolerance=0.0,
        objective_tolerance=0.0,
        max_iterations=iterations - 1,  # as many solves as the peer
    )

    def ours() -> float:
        return float(method(problem, groups=columns).compliance[-1])

    found = []
    for _ in range(repeats):
        own, *first = timed(ours)
        other, *second = timed(lambda: pymoto_block(iterations))
        found.append([*(a / b for a, b in zip(first, second, strict=True)), first[1], second[1]])
    wall, processor, own_time, other_time = map(median, zip(*found, strict=True))
    typer.echo(
        f"block of {len(columns)} tetrahedra and of {len(columns) // 6} bricks, {iterations} "
        f"iterations: compliance {own:.3f} and {other:.3f}; processor {own_time / iterations:.3f} "
        f"s/iteration, pyMOTO {other_time / iterations:.3f}; ratio of wall time {wall:.2f}, of "
        f"processor time {processor:.2f}"
    )


def main(repeats: int = 3, iterations: int = 100) -> None:
    Simp(0.5, max_iterations=2)(mbb(12, 4))  # compile
    for name, strategy in (
        ("sensitivity 1.5", Simp(0.5, 3.0, 1.5, "sensitivity")),
        ("sensitivity 2.4", Simp(0.5, 3.0, 2.4, "sensitivity")),
        ("density 2.4", Simp(0.5, 3.0, 2.4, "density")),
    ):
        design, wall, processor = timed(partial(strategy, mbb(60, 20)))
        typer.echo(
            f"MBB 60 x 20, {name}: {design.compliance[-1]:.2f} in {design.iterations} iterations, "
            f"{wall:.2f} s wall, {processor:.2f} s processor"
        )
    for name, work in (
        ("SIMP, bridge 185 x 50", lambda: Simp(0.4, minimum_stiffness=1e-3)(bridge())),
        ("SOMP, bridge 185 x 50", lambda: Somp(0.4)(bridge(), WANG)),
    ):
        design, wall, processor = timed(work)
        typer.echo(
            f"{name}: {design.compliance[-1]:.3f} in {design.iterations} iterations, "
            f"{wall / design.iterations:.4f} s/iteration wall, "
            f"{processor / design.iterations:.4f} processor"
        )
    bridges(iterations)
    bracket_in_space()
    _, wall, processor = timed(three_point_bending)
    typer.echo(f"three-point bending: {wall:.2f} s wall, {processor:.2f} s processor")
    if find_spec("pymoto") is None:
        typer.echo("pymoto is not installed: no comparison")
        return
    against_pymoto(60, 20, 50, repeats)
    against_pymoto(185, 50, 20, repeats)
    block_against_pymoto(5, repeats)


if __name__ == "__main__":
    typer.run(main)
