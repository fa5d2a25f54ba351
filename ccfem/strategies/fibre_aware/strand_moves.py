"""Strands moved sideways to where they make the part better.

The stiffness that a strand adds grows where it slides towards more stretched fibre. The strain of
one virtual test says in which direction that is; for the load at first failure an adjoint solve
does. A step in this direction is corrected until strands keep their distances again, and is tested.
Only steps that make the part better are kept.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse.linalg import splu

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.strategies.fibre_aware.judges import Judge, Judged
from ccfem.strategies.fibre_aware.strand_lines import StrandLines, strand_lines
from ccfem.strategies.fibre_aware.strand_pull import fibre_energy, plane_strain
from ccfem.strategies.fibre_aware.strand_spacing import spacing

_STEP = 0.2
"""First step, in widths: 95 % of the points move by at most this, and none by more than twice."""

_FALL = 0.4
"""Factor on the step after one that did not help."""

_SMALLEST = 0.01
"""Step, in widths, below which the search ends."""

_BETTER = 1e-6
"""Share by which a step has to improve the value."""

_CHEAPEST = 0.1
"""Share of the fibre, that of least strain, whose largest squared strain is the price of length."""

_KEPT = 1.15
"""Radius of bends that slides aim at, over the machine's minimum: they only approach it."""


def moved(
    toolpaths: Toolpaths,
    layers: Sequence[Layer],
    mesh: TetMesh,
    machine: Machine,
    judge: Judge,
    moves: int,
    inset: float = 0.5,
    radius: float = 0.0,
) -> Toolpaths:
    """Move fibre sideways, step by step, as long as a test says that it helps.

    Strands keep a width from each other, or their initial distance if that is less, and the
    machine's minimum length. Tight bends, points within two widths of them, marked links and paths
    of other kinds do not move.

    Parameters
    ----------
    toolpaths : Toolpaths
        Of any strategy, on flat layers.
    layers : sequence of Layer
        Those layers.
    mesh : TetMesh
        Of the part.
    machine : Machine
    judge : callable
        Tests toolpaths: one of `ccfem.strategies.fibre_aware.judges`.
    moves : int
        Number of steps that are tested, at least 0.
    inset : float, default 0.5
        Least distance from the border, in widths. Strands that start nearer come no nearer.
    radius : float, mm, default 0
        Least radius that bends are corrected to; 0 for none.

    Returns
    -------
    Toolpaths
        The given paths if no step helped. Lengths change by some tenths of a per cent.

    Raises
    ------
    InputError
        When a layer is curved, or a number is out of its range.
    """
    check_number("moves", moves, at_least=0)
    check_number("inset", inset, at_least=0.0, unit="fibre widths")
    if any(layer.flat is None for layer in layers):
        raise InputError("strands move on flat layers only; got a curved one: set moves to 0")
    fibre = toolpaths.of_kind(FIBRE)
    if not moves or not len(fibre):
        return toolpaths
    lines = strand_lines(fibre, layers, machine)
    width = machine.fibre_width
    apart = spacing(lines, layers, width, inset * width, radius=radius)
    smooth = splu(apart.roughness)
    best, slide = judge(fibre), np.zeros(len(lines.path))
    direction, step, helped = None, _STEP * machine.fibre_width, False
    for _ in range(moves):
        if direction is None:
            direction = _direction(slide, lines, mesh, best, smooth)
        trial = apart.spread(slide + step * direction)
        judged = judge(lines.slid(trial))
        if judged.value > (1.0 + _BETTER) * best.value:
            best, slide, direction, helped = judged, trial, None, True
            continue
        step *= _FALL
        if step < _SMALLEST * machine.fibre_width:
            break
    if not helped:
        return toolpaths
    others = toolpaths.select(toolpaths.kind != FIBRE)
    return Toolpaths.concatenate([lines.slid(slide), others])


def kept_radius(machine: Machine, tight: float) -> float:
    """Radius, mm, that slides keep where only a share of the fibre may turn too tightly, else 0."""
    return _KEPT * machine.minimum_radius if tight < 1.0 else 0.0


def _direction(
    slide: FloatArray,
    lines: StrandLines,
    mesh: TetMesh,
    judged: Judged,
    smooth: Any,
) -> FloatArray:
    """Direction (P,) of slides that increases the worth of fibre less the price of its length.

    95 % of the points move by at most 1, and none by more than 2.
    """
    points = lines.points(slide)
    strain = plane_strain(mesh, judged.strain_worths(), lines.frame)
    energy, length, slope = fibre_energy(points, lines.heights, lines.offsets, strain)
    squared = energy / np.where(length > 0.0, length, 1.0)
    order = np.argsort(squared, kind="stable")
    along = np.cumsum(length[order])
    price = max(float(squared[order][np.searchsorted(along, _CHEAPEST * along[-1])]), 0.0)
    step = np.diff(points, axis=0) * (lines.path[1:] == lines.path[:-1])[:, None]
    size = np.linalg.norm(step, axis=1)
    step *= price / np.where(size > 0.0, size, 1.0)[:, None]
    slope[:-1] += step
    slope[1:] -= step
    found = smooth.solve(np.einsum("pi,pi->p", slope, lines.normals))
    size = np.abs(found[~lines.fixed])
    usual = float(np.quantile(size, 0.95)) if len(size) else 0.0
    return np.clip(found / usual, -2.0, 2.0) if usual > 0.0 else found
