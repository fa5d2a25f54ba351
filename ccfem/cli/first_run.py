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

    They come in the order in which a run needs them, beginning after its solve, so that both seldom
    compile the same: a run compiles what solving takes itself, while this begins with planning.
    """
    import numpy as np

    from ccfem.body.mesh.box import box_mesh
    from ccfem.cases.case import Case
    from ccfem.comparison.engine import answer, solved
    from ccfem.comparison.request import Request
    from ccfem.fem.elasticity.problem import Force, Problem, Support
    from ccfem.fem.elasticity.stress_field import GivenStress
    from ccfem.fem.materials import printed_pla
    from ccfem.paths.planning.layer_plans import plan
    from ccfem.slicing.slicers.planar import Planar
    from ccfem.strategies import create
    from ccfem.strategies.fibre_aware.smeared import SmearedPart
    from ccfem.strategies.stream_function import StreamFunction

    mesh = box_mesh((60.0, 24.0, 2.0), (15, 6, 2))
    pull = Force("x_max", (100.0, 10.0, 0.0))
    problem = Problem(mesh, printed_pla(), (Support("x_min"),), {"pull": (pull,)}, order=1)
    case = Case("strip", "Strip", problem, slicing=Planar(count=2))
    of_cells, of_nodes = (
        (1.0 + 0.05 * places[:, 0] * places[:, 1])[:, None, None] * np.diag([1.0, 0.0, 0.0])
        for places in (mesh.centres, mesh.points)
    )
    stress = GivenStress(mesh, of_cells, of_nodes, material=problem.material)
    layers = case.slicing(stress, case.build, case.machine)
    for name in ("isocurve", "contour_zigzag", "zigzag"):
        plan(create(name), layers, stress, case.machine)
    stream = StreamFunction(evaluations=2, phases=2)
    request = Request(case, {"isocurve": create("isocurve"), "stream_function": stream})
    known = solved(request)
    part = SmearedPart.of(known.field, np.eye(3))
    part.respond(np.tile(np.eye(3), (len(part.centroids), 1, 1)), part.specimen.forces)
    answer(request, known=known)
