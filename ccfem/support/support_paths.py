"""Paths of matrix that fill the layers of a support."""

from dataclasses import replace

import numpy as np

from ccfem.checks import check_number
from ccfem.fields.chart import chart_of, flat_view
from ccfem.geometry.offsets import offset_rings
from ccfem.layers.layer import Layer
from ccfem.machine.machine import Machine
from ccfem.support.support_layers import SupportLayers
from ccfem.threads import in_threads
from ccfem.toolpaths import MATRIX, Toolpaths

__all__ = ["support_paths"]


def support_paths(support: SupportLayers, machine: Machine, spacing: float = 3.0) -> Toolpaths:
    """Fill the layers of a support with rings, open enough to be broken off or dissolved.

    Parameters
    ----------
    support : SupportLayers
    machine : Machine
        Its `matrix_width`.
    spacing : float, default 3
        Distance of the rings in widths; 1 fills the layers.

    Returns
    -------
    Toolpaths
        Closed paths of matrix, in the frame of the part, from the border of each layer inwards.
        Their `layer` is the number of the layer of the support: those with
        ``support.before[number] == k`` are printed before layer k of the part.
    """
    check_number("spacing", spacing, at_least=1.0)
    numbered = [replace(layer, index=k) for k, layer in enumerate(support.layers)]

    def filled(layer: Layer) -> Toolpaths:
        width, view = machine.matrix_width, flat_view(layer)
        levels = offset_rings(view.plane.polygon, 0.5 * width, spacing * width, width)
        paths = Toolpaths.from_plane([ring for level in levels for ring in level], view)
        paths = replace(paths, kind=np.full(len(paths), MATRIX, dtype=paths.kind.dtype))
        return paths if view is layer else chart_of(layer).lifted(paths)

    return Toolpaths.concatenate(in_threads(filled, numbered))
