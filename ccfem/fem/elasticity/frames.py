"""Nodal axes for supports that hold, or press, along oblique directions."""

from collections.abc import Sequence

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError

_PARALLEL = 1e-6
"""Sine of the angle below which held directions count as the same."""

_ALIKE, _ACROSS = 0.98, 0.2
"""Cosine of the angle above which two directions of pressing count as the same, and below which
they count as perpendicular: normals at nodes of a mesh are accurate to some degrees."""


def node_frames(
    oblique: Sequence[tuple[IntArray, FloatArray, FloatArray]],
    pressing: Sequence[tuple[IntArray, FloatArray]],
    free: BoolArray,
    value: FloatArray,
    presses: BoolArray,
) -> tuple[IntArray, FloatArray]:
    """Find axes along which components are held or press; the arrays are changed to these axes.

    Parameters
    ----------
    oblique : sequence of nodes (k,), directions (k, 3), values (k,) mm
        Directions held that are oblique to the global axes.
    pressing : sequence of nodes (k,), directions (k, 3)
        Directions along which nodes may only move back.
    free : (n, 3) bool array
        Changed in place: a direction that presses counts as held.
    value : (n, 3) array, mm
        Changed in place.
    presses : (n, 3) bool array
        Changed in place: components that only press.

    Returns
    -------
    turned : (k,) int array
        Nodes with axes of their own.
    frames : (k, 3, 3) array
        These axes as columns: first those held, then those that press.

    Raises
    ------
    InputError
        For values that contradict each other, and for pressing patches that meet obliquely.
    """
    wanted: dict[int, list[tuple[FloatArray, float]]] = {}
    for nodes, directions, values in oblique:
        for node, direction, at in zip(nodes, directions, values, strict=True):
            wanted.setdefault(int(node), []).append((direction, float(at)))
    outward: dict[int, list[FloatArray]] = {}
    for nodes, directions in pressing:
        for node, direction in zip(nodes, directions, strict=True):
            outward.setdefault(int(node), []).append(direction)
    turned = np.array(sorted({*wanted, *outward}), dtype=np.int64)
    frames = np.empty((len(turned), 3, 3))
    for k, node in enumerate(turned):
        fixed = ~free[node]
        more = wanted.get(int(node), [])
        rows = np.concatenate([np.eye(3)[fixed], *(d[None] for d, _ in more)])
        levels = np.concatenate([value[node, fixed], [v for _, v in more]])
        axes, at = _held_axes(rows, levels, node)
        rank = len(at)
        presses_along = _pressing_axes(axes[:rank], at, outward.get(int(node), []), node)
        bound = np.concatenate([axes[:rank], *(d[None] for d in presses_along)])
        frames[k] = np.concatenate([bound, np.linalg.svd(bound)[2][len(bound) :]]).T
        free[node] = np.arange(3) >= len(bound)
        presses[node, rank : len(bound)] = True
        value[node] = np.concatenate([at, np.zeros(3 - rank)])
    return turned, frames


def _held_axes(rows: FloatArray, levels: FloatArray, node: int) -> tuple[FloatArray, FloatArray]:
    """Axes (3, 3) as rows, of which the first (r,) are held, at those values."""
    _, sizes, axes = np.linalg.svd(rows)
    rank = int((sizes > _PARALLEL).sum())
    at = np.linalg.lstsq(rows @ axes[:rank].T, levels, rcond=None)[0]
    worst = np.abs(rows @ axes[:rank].T @ at - levels).max(initial=0.0)
    if worst > 1e-9 * max(1.0, np.abs(at).max(initial=0.0)):
        raise InputError(
            f"supports contradict each other at node {node}, which is held along several "
            "directions: give them values that agree"
        )
    return axes, at


def _pressing_axes(
    held: FloatArray, at: FloatArray, directions: Sequence[FloatArray], node: int
) -> list[FloatArray]:
    """Find unit directions (3,) along which a node presses, at right angles to what is held."""
    found: list[FloatArray] = []
    for direction in directions:
        cosines = [abs(float(direction @ other)) for other in found]
        if any(cosine > _ALIKE for cosine in cosines):
            continue
        if any(cosine > _ACROSS for cosine in cosines):
            raise InputError(
                "patches that only press must meet at right angles or smoothly; those at node "
                f"{node} do not: leave a gap between them, or make one patch of both"
            )
        along = held @ direction
        if (np.abs(along * at) > 0.0).any():
            raise InputError(
                f"node {node} presses against a support while another one moves it: leave a gap "
                "between their patches"
            )
        rest = direction - held.T @ along
        for other in found:
            rest = rest - (rest @ other) * other
        if np.linalg.norm(rest) > _PARALLEL:
            found.append(rest / np.linalg.norm(rest))
    return found
