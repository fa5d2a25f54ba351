"""Paths of given points, for tests of what becomes of them."""

import numpy as np

from ccfem.paths.toolpaths import FIBRE, Toolpaths


def flat_paths(lines, kind=FIBRE, closed=False, link=None):
    """Paths (n, 3) of layer 0, whose normals are along z."""
    lines = list(lines)
    points = np.concatenate(lines).astype(float)
    zeros = np.zeros(len(lines), dtype=int)
    return Toolpaths(
        points,
        np.broadcast_to([0.0, 0.0, 1.0], points.shape),
        np.cumsum([0, *map(len, lines)]),
        zeros,
        zeros + kind,
        np.full(len(lines), closed),
        link,
    )
