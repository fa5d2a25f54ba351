"""Where a head runs into parts of curved layers, and what order and leaning mend.

    python -m benchmarks.studies.head_clearance [CASE ...]

prints a table: cases with their own curved slicing, `t_bracket` in spatial layers, each with its
support on a machine of five axes, matrix alone. Takes minutes.
"""

import sys
from dataclasses import replace

from ccfem.cases import create_case
from ccfem.fem.elasticity.statics import solve
from ccfem.machine import Kinematics
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.print_plan import plan_print
from ccfem.printing.support import slice_with_support
from ccfem.slicing.slicers import as_slicer

__all__ = ["row"]

CASES = ("arm_bracket", "corner_bracket", "t_bracket", "lifting_eye")
SLICINGS = {"t_bracket": "spatial"}


def row(name: str) -> str:
    """Row of a case: lengths of paths, and along which the head touches what is printed, mm."""
    case = create_case(name)
    stress = solve(case.problem)[case.problem.cases[0]]
    slicer = as_slicer(SLICINGS.get(name, case.slicing))
    layers, support = slice_with_support(slicer, stress, case.build, case.machine)
    machine = replace(case.machine, kinematics=Kinematics("head_head"))
    about = (layers, stress.mesh, machine, support)
    plan = plan_print(Toolpaths.empty(), *about, build=case.build)
    lengths = " | ".join(f"{value:.0f}" for value in plan.touched)
    return (
        f"| {name} | {len(layers)} + {len(support.layers)} | {len(plan.top)} | "
        f"{plan.paths.lengths.sum():.0f} | {lengths} |"
    )


if __name__ == "__main__":
    print("| part | layers + support | steps | paths | layer by layer | ordered | leaning |")
    print("|---" * 7 + "|", flush=True)
    for one in sys.argv[1:] or CASES:
        print(row(one), flush=True)
