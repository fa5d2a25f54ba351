"""How much of the gap between the bound and the paths is the width of a strand.

    python -m benchmarks.studies.narrow_strands [PART ...]

The parts of `confirmed_gain` are planned with strands of the usual width, and of a half and a
quarter of it, at the same coverage, stiffness of fibre per area, and mesh. The shortest length and
the least radius of the machine shrink with the width. The bound stays the same.
"""

import sys
from dataclasses import replace
from pathlib import Path

from benchmarks.studies.confirmed_gain import COVERAGE, LAYERS, PARTS, posed
from benchmarks.studies.table import print_table
from ccfem.fem.elasticity.statics import solve
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.machine.machine import Machine
from ccfem.paths.planning.equal_fibre import plan_to_length
from ccfem.paths.planning.strategy import full_length
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies.fibre_aware.upper_bound import upper_bound
from ccfem.strategies.stream_function import StreamFunction

__all__ = ["NARROWER", "shares"]

NARROWER = (1.0, 2.0, 4.0)
"""Times that strands are narrower."""


def shares(name: str) -> list[str]:
    """Row of the table for one part."""
    problem, usual = posed(name), Machine()
    stress, layers = solve(problem)["planned"], Planar(count=LAYERS).cut(problem.mesh)
    cells = [name]
    for times in NARROWER:
        machine = replace(
            usual,
            fibre_width=usual.fibre_width / times,
            minimum_length=usual.minimum_length / times,
            minimum_radius=usual.minimum_radius / times,
        )
        strand = Strand(Strand().rho / times)
        wanted = COVERAGE * full_length(layers, machine)
        planner = StreamFunction(rho=strand.rho)
        planned = plan_to_length(planner, layers, stress, machine, wanted)
        ratio = virtual_test(planned.toolpaths, stress, strand, span=(), machine=machine).ratio
        bound = upper_bound(stress, layers, wanted * LAYERS, machine, strand)
        cells.append(f"{ratio:.3f}, {bound.share(ratio):.0%}")
    return [f"| {' | '.join([*cells, f'{bound.ratio:.3f}'])} |"]


def main(arguments: list[str]) -> None:
    """Print the table."""

    def rows(name: str, _: Path | None) -> list[str]:
        return shares(name)

    print_table(arguments, "part | usual width | half | quarter | bound", PARTS, rows)


if __name__ == "__main__":
    main(sys.argv[1:])
