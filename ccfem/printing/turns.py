"""Strands that leave the part: on pads, cut at its border, or refused."""

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.printing.pads import border_crossings, cut_at_border


def turned(
    lines: list[FloatArray], border: Region, layer: int, machine: Machine
) -> tuple[list[FloatArray], FloatArray]:
    """Strands of a layer by what `Process.turns` says, and where they cross its border."""
    crossings = border_crossings(lines, border)
    if not len(crossings) or machine.process.turns == "pad":
        return lines, crossings
    if machine.process.turns == "inside":
        raise InputError(
            f"strands leave fibre layer {layer} in {len(crossings)} places, but process.turns is "
            "'inside': plan without loops outside (svt: links = 'none'), or set it to 'pad' or "
            "'cut'"
        )
    return cut_at_border(lines, border), np.zeros((0, 2))
