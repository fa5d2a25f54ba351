"""Direction and stress everywhere on a layer, ready for scalar fields of any density."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.paths.fields.crease import orient_along
from ccfem.paths.fields.fill import fill_laplacian, fill_screened
from ccfem.paths.fields.layer_elements import Surface
from ccfem.paths.fields.orientation import orient
from ccfem.paths.fields.tensile import Tension
from ccfem.slicing.layers.layer import Layer


@dataclass(frozen=True)
class Directed:
    """Direction and stress everywhere on a layer, whatever the density of its strands.

    Attributes
    ----------
    layer : Layer
    surface : Surface
    tension : Tension
    cap : float, MPa
        Stress at which the density reaches its full value.
    confidence : (t,) array in [0, 1]
        Stress over the cap; 0 where the tension has no direction.
    direction : (t, 2) array
        Oriented unit vectors.
    size : (t,) array, MPa
    """

    layer: Layer
    surface: Surface
    tension: Tension
    cap: float
    confidence: FloatArray
    direction: FloatArray
    size: FloatArray


def directed(
    layer: Layer,
    tension: Tension,
    cap: float,
    fill: Literal["screened", "laplacian"],
    fill_length: float,
) -> Directed:
    """Extend the directions of the tension to the whole layer, and orient them.

    Parameters
    ----------
    layer : Layer
    tension : Tension
        On its triangles.
    cap : float
        Percentile, by area, of the stress at which the density reaches its full value.
    fill : {"screened", "laplacian"}
        See `fields.fill`.
    fill_length : float, mm
        Length over which the screened fill carries the field on.
    """
    surface = Surface.of(layer)
    percentile = np.quantile(
        tension.stress,
        cap / 100.0 * (1.0 - 1e-12),
        weights=surface.areas,
        method="inverted_cdf",
    )
    top = max(float(percentile), 1e-300)
    confidence = np.where(tension.defined, np.minimum(tension.stress / top, 1.0), 0.0)
    direction = tension.direction
    if fill == "screened":
        direction, size = fill_screened(surface, direction, tension.stress, confidence, fill_length)
        direction = orient_along(surface, direction, confidence)
    else:
        if not tension.oriented:
            direction = orient(direction, surface.neighbours)
        direction, size = fill_laplacian(surface, direction, tension.stress, tension.defined)
    return Directed(layer, surface, tension, top, confidence, direction, size)
