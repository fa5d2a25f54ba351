"""The incompatibility filter: where neighbouring vectors disagree [Chen et al. 2021, Eq. 2]."""

from typing import Literal, get_args

import numpy as np
from numba import njit

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.checks import check_known

_LIMIT = 0.5
"""The paper's eta."""

Incompatible = Literal["any", "majority", "all", "none"]


def incompatible(
    direction: FloatArray,
    cells: IntArray,
    defined: BoolArray,
    rule: Incompatible = "any",
) -> BoolArray:
    """Mark, (m,), cells whose vector disagrees with those of neighbouring cells.

    Cells that share a node are neighbours. They disagree when ``v . v* <= 0.5``, the paper's eta.

    Parameters
    ----------
    direction : (m, 3) array
        Oriented unit vectors.
    cells : (m, 4) int array
        Corner nodes.
    defined : (m,) bool array
        Cells without a vector are neither marked nor compared.
    rule : {"any", "majority", "all", "none"}, default "any"
        How many of the neighbours have to disagree. The paper prints "for all", which marks almost
        nothing; "any" reproduces its figures.
    """
    if rule == "none":
        return np.zeros(len(cells), dtype=bool)
    check_known("rule on incompatible directions", rule, get_args(Incompatible))
    nodes = cells.ravel()
    order = np.argsort(nodes, kind="stable")
    start = np.searchsorted(nodes[order], np.arange(int(nodes.max()) + 2))
    against, asked = _disagreeing(direction, cells, defined, order // 4, start)
    if rule == "any":
        return defined & (against > 0)
    if rule == "majority":
        return defined & (2 * against > asked)
    return defined & (against == asked) & (asked > 0)


@njit(cache=True)
def _disagreeing(
    direction: FloatArray, cells: IntArray, defined: BoolArray, cell_of: IntArray, start: IntArray
) -> tuple[IntArray, IntArray]:
    count = len(cells)
    against = np.zeros(count, np.int64)
    asked = np.zeros(count, np.int64)
    seen = np.full(count, -1)
    for e in range(count):
        if not defined[e]:
            continue
        # Every cell that shares a node with this one is asked once.
        seen[e] = e
        for node in cells[e]:
            for k in range(start[node], start[node + 1]):
                other = cell_of[k]
                if seen[other] == e or not defined[other]:
                    continue
                seen[other] = e
                asked[e] += 1
                product = 0.0
                for axis in range(3):
                    product += direction[e, axis] * direction[other, axis]
                against[e] += product <= _LIMIT
    return against, asked
