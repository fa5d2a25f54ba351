"""Measure what `ccfem.fem.elasticity.solve_cost` tells: CPU seconds and memory of solves by size.

Run ``python benchmarks/speed/solve_cost.py``; one line a size, each in a process of its own.
"""

import resource
import subprocess
import sys
import time

from ccfem.body.mesh import box_mesh
from ccfem.fem.elasticity import Force, Problem, Support, solve
from ccfem.fem.materials import named_material

SIZES = ((1, 30, 12), (1, 60, 24), (2, 24, 10), (2, 45, 18))
"""Order of the cells, cells along the box, cells across."""


def measure(order: int, along: int, across: int) -> None:
    """Solve a box and print what it took."""
    mesh = box_mesh((60.0, 24.0, 24.0), (along, across, across))
    problem = Problem(
        mesh.quadratic() if order == 2 else mesh,
        named_material("pla"),
        (Support("x_min"),),
        {"pull": (Force("x_max", (100.0, 0.0, 10.0)),)},
        order=1 if order == 1 else 2,
    )
    small = Problem(
        box_mesh((1.0, 1.0, 1.0), (2, 2, 2)), problem.material, problem.supports, problem.loads
    )
    solve(small)  # imports and compiled functions count for nothing
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.process_time()
    record = solve(problem)["pull"].record
    spent = time.process_time() - start
    memory = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024
    print(
        f"order {order}: {record.unknowns:7d} unknowns, {record.backend}, {spent:.1f} s, "
        f"{1e6 * spent / record.unknowns:.0f} us and {memory / record.unknowns:.0f} bytes each",
        flush=True,
    )


if __name__ == "__main__":
    if len(sys.argv) > 1:
        measure(*map(int, sys.argv[1:]))
    for size in SIZES if len(sys.argv) == 1 else ():
        subprocess.run([sys.executable, __file__, *map(str, size)], check=True)
