"""Strategies on the Loop and the pulled Shell of Chen et al. 2021, with the authors' fibre.

    CCFEM_CHEN2021=folder python -m benchmarks.studies.authors_parts [loop] [shell]
        [--strategies A,B,..] [--pictures FOLDER]

On the authors' meshes and twelve layers, 34.66 m of fibre on the Loop and 25.46 m on the Shell. A
row has the fibre; the strands; those of them that fold, by the polyline as it is; the stiffness of
the virtual test over that of the part without fibre, of what carries of the strands; its share of
the gain that the upper bound allows; and the CPU seconds of planning. The authors' own paths are
tested as they are published. A strategy may have parameters, as in `stream_function:moves=6`.
"""

import sys
from collections.abc import Iterable
from pathlib import Path
from time import process_time

from benchmarks.studies.table import with_strategies
from ccfem.base.toml import assignment
from ccfem.fem.elasticity.statics import solve
from ccfem.judging.virtual_testing.specimen import Specimen
from ccfem.judging.virtual_testing.stiffness_test import virtual_test
from ccfem.judging.virtual_testing.strands import cut_strands
from ccfem.machine.machine import Machine
from ccfem.papers.chen_2021.loop import LAYERS_TABLE_2, authors_loop
from ccfem.papers.chen_2021.virtual_test import authors_paths
from ccfem.papers.evidence.prints import shell_field, shell_paths
from ccfem.paths.folds import folds
from ccfem.paths.planning.equal_fibre import plan_to_length
from ccfem.paths.planning.strategy import Strategy
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create
from ccfem.strategies.fibre_aware.upper_bound import upper_bound

__all__ = ["PARTS", "rows"]

PARTS = {
    "loop": (34.66e3, lambda: solve(authors_loop().problem)["pull"], lambda: authors_paths("ours")),
    "shell": (25.46e3, shell_field, lambda: shell_paths("authors")),
}
"""Fibre, mm in all, the solved part, and the authors' paths."""
_STRATEGIES = ("stream_function", "isocurve")
_BUILD = (0.0, 1.0, 0.0)


def _strategy(text: str) -> Strategy:
    """Make a strategy from ``NAME:PARAMETER=VALUE:...``."""
    name, *settings = text.split(":")
    return create(name, dict(map(assignment, settings)))


def rows(name: str, pictures: Path | None, strategies: Iterable[str] = ()) -> list[str]:
    """Rows of the table for one part: the bound, the authors' paths, then strategies."""
    length, solved, published = PARTS[name]
    field, machine = solved(), Machine()
    layers = Planar(count=LAYERS_TABLE_2).cut(field.mesh, _BUILD)
    specimen, bound = Specimen.of(field), upper_bound(field, layers, length, machine)
    lines = [f"| **{name}**, bound | {1e-3 * length:.2f} | | | {bound.ratio:.4f} | | |"]
    for what in ("authors", *(strategies or _STRATEGIES)):
        before = process_time()
        if what == "authors":
            paths = published()
            strands = cut_strands(paths, field.mesh)
        else:
            wanted = length / len(layers)
            paths = plan_to_length(_strategy(what), layers, field, machine, wanted).toolpaths
            strands = cut_strands(paths, field.mesh, machine=machine, layers=layers, crosses=False)
        seconds, ratio = process_time() - before, virtual_test(strands, specimen, span=()).ratio
        about = (paths.points, paths.offsets, paths.closed, machine.minimum_radius)
        folded = int((folds(*about, strict=True).counts > 0).sum())
        lines.append(
            f"| {what} | {1e-3 * paths.lengths.sum():.2f} | {len(paths)} | {folded} "
            f"| {ratio:.4f} | {bound.share(ratio):.1%} | {seconds:.0f} |"
        )
        if pictures is not None:
            for layer in (0, len(layers) // 2):
                figure = paths.plot(layer=layer)
                figure.savefig(pictures / f"{name}_{what}_{layer}.png", dpi=100)
    return lines


def main(arguments: list[str]) -> None:
    """Print the table."""
    heads = "planned | m | strands | with a fold | stiffness | share of the gain | CPU s"
    with_strategies(arguments, heads, PARTS, rows)


if __name__ == "__main__":
    main(sys.argv[1:])
