"""Processor time of planning with `stream_function` and moves, stage by stage.

    python -m benchmarks.speed.strands [PART ...]

PART is a case, a part file, or a part of `benchmarks.studies.strand_losses`; the default is
`open_hole`, and `authors_loop`, which needs CCFEM_CHEN2021. Each part is planned twice; the second
time counts. The last column is the time in units of a virtual test of the plan.
"""

import os
import sys
import time
from collections.abc import Callable
from typing import Any

import ccfem
from benchmarks.studies.strand_losses import MOVES, posed
from ccfem.paths.planning.strategy import full_length
from ccfem.strategies.fibre_aware.judges import stiffness_judge
from ccfem.strategies.fibre_aware.prune import prune
from ccfem.strategies.fibre_aware.strand_moves import moved
from ccfem.strategies.stream_function import StreamFunction

ROUNDS = 3
"""Virtual tests of pruning, as in the strategy."""


def timed(name: str) -> dict[str, float]:
    """Processor seconds of each stage of a plan, and of a virtual test of it."""
    stress, layers, machine, length = posed(name)
    strategy = StreamFunction(coverage=length / len(layers) / full_length(layers, machine))
    seconds: dict[str, float] = {}

    def stage(what: str, work: Callable[[], Any]) -> Any:
        start = time.process_time()
        found = work()
        seconds[what] = time.process_time() - start
        return found

    problem, group, found = stage("design", lambda: strategy.designed(stress, layers, machine))
    part, (solution,) = problem.parts[0].specimen, found.objective.solution
    strained = ((1.0, solution.displacement),)
    extraction = strategy.extraction(problem.model, found.fields, strained, machine)
    ((whole, *_),) = stage("levels", lambda: extraction.candidates(layers, group, (length,)))
    kept = stage("pruning", lambda: prune(whole, part, length, machine, rounds=ROUNDS))
    mesh, judge = part.unreinforced.mesh, stiffness_judge(part, machine)
    last = stage(f"{MOVES} moves", lambda: moved(kept, layers, mesh, machine, judge, MOVES))
    stage("virtual test", lambda: ccfem.virtual_test(last, part, machine=machine, span=()))
    return seconds


def main() -> None:
    """Print a table for each part."""
    default = ["open_hole", *(["authors_loop"] if os.environ.get("CCFEM_CHEN2021") else [])]
    for name in sys.argv[1:] or default:
        timed(name)
        seconds = timed(name)
        print(f"\n{name}")
        for what, spent in seconds.items():
            print(f"{what:14}{spent:7.2f} s{spent / seconds['virtual test']:7.1f}", flush=True)


if __name__ == "__main__":
    main()
