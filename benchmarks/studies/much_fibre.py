"""How stiff `stream_function` makes parts with usual amounts of fibre, and with much.

    python -m benchmarks.studies.much_fibre [PART ...]

PART is named as in `strand_losses`. Each cell has the stiffness over that of the part without
fibre, and the fibre laid in all layers: less than was asked for where there is no room for more.
"""

import sys
from pathlib import Path

from benchmarks.studies.strand_losses import posed
from benchmarks.studies.table import print_table
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.paths.planning.equal_fibre import plan_to_length
from ccfem.paths.planning.strategy import full_length
from ccfem.strategies.stream_function import StreamFunction

__all__ = ["COVERAGES", "PARTS", "stiffness"]

COVERAGES = (0.45, 0.6, 0.75)
PARTS = ("study:lever", "study:bracket", "l_shape", "loop")


def stiffness(name: str) -> list[str]:
    """Row of the table for one part."""
    stress, layers, machine, _ = posed(name)
    full, cells = full_length(layers, machine), []
    for coverage in COVERAGES:
        planned = plan_to_length(StreamFunction(), layers, stress, machine, coverage * full)
        tested = virtual_test(planned.toolpaths, stress, machine=machine, span=())
        cells.append(f"{tested.ratio:.3f}, {1e-3 * planned.toolpaths.lengths.sum():.1f} m")
    return [f"| {name.removeprefix('study:')} | {' | '.join(cells)} |"]


def main(arguments: list[str]) -> None:
    """Print the table."""

    def rows(name: str, _: Path | None) -> list[str]:
        return stiffness(name)

    print_table(arguments, f"part | {' | '.join(map(str, COVERAGES))}", PARTS, rows)


if __name__ == "__main__":
    main(sys.argv[1:])
