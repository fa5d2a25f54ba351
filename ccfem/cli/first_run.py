"""Compile for a first run, in a process beside it, what it needs later on.

Functions are compiled when they are first used, and stored for later runs. On a first run that
takes longer than the work itself. A process beside it therefore goes through the same stages with a
strip of a few cells: what it compiles is stored by the time that the run needs it.
"""

import multiprocessing
import signal
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ccfem.base.parallel import processors

LATE = ("ccfem.judging.virtual_testing.equilibrium", "_bar_forces")
"""Module and name of a compiled function that a comparison needs late."""


@contextmanager
def compiling_beside() -> Iterator[None]:
    """Compile in another process while the block runs, where nothing is stored yet."""
    stored = is_stored()
    if not stored:
        print("ccfem: first run: compiling takes half a minute more, once", file=sys.stderr)
    if stored or processors() < 2 or sys.platform != "linux":
        yield
        return
    process = multiprocessing.get_context("fork").Process(target=_beside, daemon=True)
    process.start()
    try:
        yield
    finally:
        process.kill()
        process.join()


def is_stored() -> bool:
    """Whether functions that a comparison needs late were compiled by an earlier run."""
    from numba import config

    module = Path(__file__).parents[2].joinpath(*LATE[0].split("."))
    name = f"{module.name}.{LATE[1]}-*.nbi"
    if config.CACHE_DIR:
        return any(Path(config.CACHE_DIR).glob(f"*/{name}"))
    return any((module.parent / "__pycache__").glob(name))


def _beside() -> None:
    """Rehearse in silence, until the run is over."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):  # the run says that it was stopped
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    warnings.simplefilter("ignore")
    rehearse()


def rehearse() -> None:
    """Go through the stages of a comparison of a small strip.

    Those come first that a run comes to last; what solving takes the run compiles meanwhile.
    """
    import numpy as np

    from ccfem.body.mesh.box import box_mesh
    from ccfem.cases.case import Case
    from ccfem.comparison.engine import answer
    from ccfem.comparison.request import Request
    from ccfem.fem.elasticity.problem import Force, Problem, Support
    from ccfem.fem.elasticity.stress_field import GivenStress
    from ccfem.fem.materials import printed_pla
    from ccfem.judging.evaluation import evaluate
    from ccfem.judging.evaluation.strand_rules import strand_verdict
    from ccfem.paths.planning.layer_plans import plan
    from ccfem.slicing.slicers.planar import Planar
    from ccfem.strategies import create
    from ccfem.strategies.stream_function import StreamFunction

    mesh = box_mesh((60.0, 24.0, 2.0), (15, 6, 2))
    pull = Force("x_max", (100.0, 10.0, 0.0))
    problem = Problem(mesh, printed_pla(), (Support("x_min"),), {"pull": (pull,)})
    case = Case("strip", "Strip", problem, slicing=Planar(count=2))
    of_cells, of_nodes = (
        (1.0 + 0.05 * places[:, 0] * places[:, 1])[:, None, None] * np.diag([1.0, 0.0, 0.0])
        for places in (mesh.centres, mesh.points)
    )
    stress = GivenStress(mesh, of_cells, of_nodes, material=problem.material)
    layers = case.slicing(stress, case.build, case.machine)
    for name in ("isocurve", "contour_zigzag", "zigzag"):
        paths = plan(create(name), layers, stress, case.machine)
        evaluate(paths, layers, stress, case.machine)
        strand_verdict(paths, layers, case.machine)
    stream = StreamFunction(evaluations=2, phases=2)
    answer(Request(case, {"isocurve": create("isocurve"), "stream_function": stream}))
