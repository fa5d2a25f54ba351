"""Matrix of layers, flat or curved: rings parallel to the border that fill them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ccfem.base.parallel import in_threads
from ccfem.geometry.offsets import offset_rings
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import chart_of, flat_view
from ccfem.paths.toolpaths import MATRIX, Toolpaths
from ccfem.slicing.layers.layer import Layer

_HALF_WIDTHS = 0.5
"""Distance of the outermost ring from the border, in widths."""


def layer_matrix(layers: Sequence[Layer], machine: Machine) -> Toolpaths:
    """Fill layers with matrix: rings a line's width apart, measured in the chart of curved layers.

    A line has the width of the machine and the height that the layer has where it lies, so that
    its cross-section changes along it: `ccfem.printing.export.robot_waypoints` writes that height.

    Parameters
    ----------
    machine : Machine
        Its `matrix_width`.

    Returns
    -------
    Toolpaths
        Closed paths of matrix, from the border inwards, layer by layer.
    """
    return Toolpaths.concatenate(in_threads(lambda layer: _rings(layer, machine), layers))


def _rings(layer: Layer, machine: Machine) -> Toolpaths:
    """Matrix of one layer."""
    width, view = machine.matrix_width, flat_view(layer)
    levels = offset_rings(view.plane.polygon, _HALF_WIDTHS * width, width, width)
    paths = Toolpaths.from_plane([ring for level in levels for ring in level], view)
    paths = replace(paths, kind=np.full(len(paths), MATRIX, dtype=paths.kind.dtype))
    return chart_of(layer).lifted(paths)
