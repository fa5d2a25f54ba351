"""Final form of planned paths: steps of about a fibre width, and no paths of zero length."""

from dataclasses import replace

import numpy as np

from ccfem.geometry.even_steps import OFF, even_steps
from ccfem.paths.toolpaths import Toolpaths

_SHORTEST = 1e-6
"""Length, in steps, up to which a path counts as having none."""


def in_even_steps(toolpaths: Toolpaths, step: float) -> Toolpaths:
    """Paths in steps no longer than a length, mm, and shorter only where paths bend.

    Parameters
    ----------
    toolpaths : Toolpaths
    step : float, mm
        Machines that get more points than they need stutter, while indices sampled at points need
        no fewer.

    Returns
    -------
    Toolpaths
        The same paths within 0.005 steps; corners and ends are exact. Paths of no length are left
        out.
    """
    paths = toolpaths.select(toolpaths.lengths > _SHORTEST * step)
    if not len(paths):
        return paths
    # Where a link begins or ends, its first step is the first that is one, or is none any more.
    inner = np.ones(len(paths.points), dtype=bool)
    inner[paths.offsets[:-1]] = False
    changes = inner & (paths.link != np.roll(paths.link, 1))
    points, offsets, source, share = even_steps(
        paths.points, paths.offsets, changes, step, OFF * step
    )
    before, after = (paths.normals[source[:, k]] for k in (0, 1))
    normals = before + share[:, None] * (after - before)
    link = paths.link[source[:, 0]]
    link[offsets[1:] - 1] = False
    return replace(
        paths,
        points=points,
        normals=normals / np.linalg.norm(normals, axis=1)[:, None],
        offsets=offsets,
        link=link,
    )
