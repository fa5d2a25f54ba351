"""Check of the distance between layers: at least the height of their fibre."""

from collections.abc import Sequence

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import Layer

_ROUNDING = 1e-6
"""Share of a strand's height by which layers may be nearer than it, because of rounding."""


def check_pitch(layers: Sequence[Layer], machine: Machine) -> None:
    """Refuse flat layers nearer to each other than the height of a strand of the machine.

    Curved layers are not checked, since their distance varies.
    """
    check_heights(
        np.sort([layer.flat.height for layer in layers if layer.flat is not None]), machine
    )


def check_heights(heights: FloatArray, machine: Machine) -> None:
    """Refuse ascending heights, mm, of flat layers that are nearer than the height of a strand."""
    if len(heights) < 2:
        return
    gaps, least = np.diff(heights), machine.strand_height
    k = int(gaps.argmin())
    if gaps[k] < least * (1.0 - _ROUNDING):
        raise InputError(
            f"layers must lie at least {least:.4g} mm apart, the height of a strand "
            f"(machine.fibre_height, or filament_area over fibre_width); got {gaps[k]:.4g} mm "
            f"between those at {heights[k]:.6g} and {heights[k + 1]:.6g} mm: use fewer layers"
        )
