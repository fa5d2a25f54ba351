"""The ring with two lugs, pulled along its length or across: one print for both."""

from dataclasses import replace
from math import inf

from ccfem.body.mesh.patches import Box, PatchRule, patches_from_rules
from ccfem.cases.case import Case
from ccfem.cases.loop import ELEMENT_SIZE, RING_RADIUS, loop
from ccfem.fem.elasticity.problem import Force, Order
from ccfem.slicing.slicers.planar import Planar

SIDE = 12.0
"""Half of the length, mm, of the sides of the ring that are pulled apart."""


def two_pull_loop(
    element_size: float = ELEMENT_SIZE, order: Order = 1, force: float = 1000.0
) -> Case:
    """Ring with two lugs, 140 x 100 x 10 mm, its top hole pulled along y or along x.

    The part of `ccfem.cases.loop`: the outer half of the bottom hole is fixed, the outer half of
    the top hole is loaded. Its load cases are meant to be planned for at once
    (``--load-case all``).

    Parameters
    ----------
    element_size, order
        As in `ccfem.cases.bar`.
    force : float, N
        Of the load case "along", along y; a tenth of it, along x, in "across".
    """
    case = loop(element_size, order, force)
    rules: dict[str, PatchRule] = {
        "left": Box((-inf, -SIDE, -inf), (SIDE - RING_RADIUS, SIDE, inf), "-x"),
        "right": Box((RING_RADIUS - SIDE, -SIDE, -inf), (inf, SIDE, inf), "x"),
    }
    mesh = patches_from_rules(case.problem.mesh, rules)
    loads = {
        "along": (Force("load", (0.0, force, 0.0)),),
        "across": (Force("left", (-force, 0.0, 0.0)), Force("right", (force, 0.0, 0.0))),
    }
    return replace(
        case,
        name="two_pull_loop",
        title="Ring with two lugs, 140 x 100 x 10 mm, pulled along its length or across",
        problem=replace(case.problem, mesh=mesh, loads=loads),
        slicing=Planar(count=8),
        source=f"{case.source}; the second load is ours",
    )
