"""Boundary loops of a layer that run round a joint."""

from collections.abc import Iterable

import numpy as np

from ccfem.base.arrays import IntArray
from ccfem.slicing.layers.layer import Layer

_SHARE = 0.4
"""Share of a loop's length that lies on the patch. Half of a hole may carry the load. If a layer
leaves a hole through its outer border, the hole takes only a small share of that."""


def joint_loops(layer: Layer, names: Iterable[str]) -> dict[str, IntArray]:
    """Find the loops of a layer that run round its joints.

    Parameters
    ----------
    names : iterable of str
        Patches; those that the layer does not meet have no loop.

    Returns
    -------
    dict of str to (k,) int arrays
        Points of each loop by the patch that it lies on. If two loops lie on one patch, as where a
        layer meets a hole twice, there is a second entry: the name with a prime.
    """
    loops: dict[str, IntArray] = {}
    taken: set[int] = set()
    for name in names:
        edges = layer.patches.get(name)
        if edges is None or not len(edges):
            continue
        keys = {tuple(edge) for edge in np.sort(edges, axis=1).tolist()}
        for k, loop in enumerate(layer.loops):
            after = np.roll(loop, -1)
            length = np.linalg.norm(layer.points[after] - layer.points[loop], axis=1)
            sides = np.sort(np.stack([loop, after], axis=1), axis=1).tolist()
            on = np.array([tuple(side) in keys for side in sides])
            if k in taken or length[on].sum() < _SHARE * length.sum():
                continue
            taken.add(k)
            while name in loops:
                name += "'"
            loops[name] = loop
    return loops
