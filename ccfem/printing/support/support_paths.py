"""Paths of matrix that fill the layers of a support."""

from dataclasses import replace

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.checks import check_number
from ccfem.base.parallel import in_threads
from ccfem.geometry.offsets import offset_rings
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import Chart
from ccfem.paths.toolpaths import MATRIX, Toolpaths
from ccfem.printing.support.support_layers import SupportLayers
from ccfem.slicing.layers.layer import Layer, Plane, plane_frame


def support_paths(support: SupportLayers, machine: Machine, spacing: float = 3.0) -> Toolpaths:
    """Fill the layers of a support with rings, open enough to be broken off or dissolved.

    Distances are those seen along the build direction: on a tilted layer they are longer.

    Parameters
    ----------
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
        width, seen = machine.matrix_width, _from_above(layer, support.columns.up)
        with np.errstate(divide="ignore", invalid="ignore"):  # of mitres of edges nearly in line
            levels = offset_rings(seen.flat.plane.polygon, 0.5 * width, spacing * width, width)
        paths = Toolpaths.from_plane([ring for level in levels for ring in level], seen.flat)
        paths = replace(paths, kind=np.full(len(paths), MATRIX, dtype=paths.kind.dtype))
        return paths if seen.flat is layer else seen.lifted(paths)

    return Toolpaths.concatenate(in_threads(filled, numbered))


def _from_above(layer: Layer, up: FloatArray) -> Chart:
    """Look at a layer along the build direction: none of a support lies upside down to it."""
    lengths = np.ones((len(layer.triangles), 2))
    if layer.flat is not None:
        return Chart(layer, layer, lengths)
    points = layer.points @ plane_frame(tuple(up.tolist())).T
    seen = points * [1.0, 1.0, 0.0]
    flat = replace(layer, points=seen, flat=Plane(np.eye(3), 0.0), walls=())
    return Chart(layer, flat, lengths)
