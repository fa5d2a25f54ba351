"""What strands hold beside the loaded holes of the Loop and the pulled Shell of Chen et al. 2021.

    CCFEM_CHEN2021=folder python -m benchmarks.studies.held_at_holes [Loop Shell]
        [--strategies A,B,..]

A row has, for each pinned hole, the load of the part at which the matrix beside it breaks, and the
one that the strands beside it hold until they break or are pulled out: of the authors' paths, of
their zigzag, and of strategies planned with the fibre of the authors.
"""

import sys
from collections.abc import Iterable
from pathlib import Path

from benchmarks.studies.authors_parts import PARTS as PLANNED
from benchmarks.studies.breaking_loads import BUILD, PARTS
from benchmarks.studies.table import with_strategies
from ccfem.fem.elasticity import StressField
from ccfem.judging.virtual_testing.anchorage import Anchorage
from ccfem.judging.virtual_testing.pinned_joints import NET_SECTION, PULL_OUT, pinned_joints
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.strand import Limits
from ccfem.judging.virtual_testing.strands import Strands, cut_strands
from ccfem.judging.virtual_testing.virtual_test import virtual_test
from ccfem.machine import Machine
from ccfem.papers.chen_2021.loop import LAYERS_TABLE_2
from ccfem.papers.chen_2021.virtual_test import MATRIX_STRENGTH
from ccfem.paths.planning import plan_to_length
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create

__all__ = ["rows"]

_STRATEGIES = ("stream_function", "isocurve")


def _held(strands: Strands, field: StressField) -> str:
    """Find the loads of the holes, in the order of their patches: of matrix and of strands, N."""
    specimen = Specimen.of(field)
    test = virtual_test(strands, specimen, span=())
    limits = Limits.of(field.material, matrix_strength=MATRIX_STRENGTH)
    given = test.solution, specimen.forces, test.force
    joints = pinned_joints(*given, limits, Anchorage.of(strands, Machine()))
    return " | ".join(
        f"{joint.loads[NET_SECTION]:.0f} | {joint.loads.get(PULL_OUT, 0.0):.0f}"
        for joint in sorted(joints, key=lambda joint: joint.patch)
    )


def rows(name: str, pictures: Path | None, strategies: Iterable[str] = ()) -> list[str]:
    """Rows of the table for one part."""
    _, solved, published = PARTS[name]
    field, machine = solved(), Machine()
    lines = [
        f"| {name} | {print_} | {_held(cut_strands(published(print_), field.mesh), field)} |"
        for print_ in ("authors", "zigzag")
    ]
    layers = Planar(count=LAYERS_TABLE_2).cut(field.mesh, BUILD)
    wanted = PLANNED[name.lower()][0] / len(layers)
    for strategy in strategies or _STRATEGIES:
        paths = plan_to_length(create(strategy), layers, field, machine, wanted).toolpaths
        strands = cut_strands(paths, field.mesh, machine=machine, layers=layers, crosses=False)
        lines.append(f"| {name} | {strategy} | {_held(strands, field)} |")
    return lines


def main(arguments: list[str]) -> None:
    """Print the table."""
    holes = " | ".join(f"{hole}: matrix, N | strands, N" for hole in ("load", "support"))
    parts = {name: PARTS[name] for name in ("Loop", "Shell")}
    with_strategies(arguments, f"part | print | {holes}", parts, rows)


if __name__ == "__main__":
    main(sys.argv[1:])
