"""Share of the tension that acts across layers, where they are weakest."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray

_DIRECTIONS = 2000
"""Number of plane directions that are tried, over half a sphere: 3 degrees apart."""


@dataclass(frozen=True)
class Across:
    """Stress across layers, averaged by volume over the critical cells.

    Attributes
    ----------
    tension : float
        Tensile traction normal to the layer, over the largest principal stress.
    angle : float, degrees
        Between the normal of the layer and the direction of the least principal stress.
    """

    tension: float
    angle: float


def across_layers(
    stress: FloatArray, volume: FloatArray, critical: BoolArray, normal: FloatArray
) -> Across:
    """Measure layers of given normals.

    Parameters
    ----------
    stress : (m, 3, 3) array, MPa
    volume : (m,) array, mm^3
    critical : (m,) bool array
        Cells that count, at least one.
    normal : (m, 3) or (3,) array
        Of any length.
    """
    normal = np.broadcast_to(normal, (len(stress), 3))[critical]
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
    values, axes = np.linalg.eigh(stress[critical])
    pull = np.einsum("ei,eij,ej->e", normal, stress[critical], normal)
    share = np.maximum(pull, 0.0) / values[:, 2]
    cosine = np.abs(np.einsum("ed,ed->e", axes[:, :, 0], normal))
    weight = volume[critical]
    angle = np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0)))
    return Across(
        float(np.average(share, weights=weight)), float(np.average(angle, weights=weight))
    )


def best_plane(stress: FloatArray, volume: FloatArray, critical: BoolArray) -> FloatArray:
    """Find the normal (3,) of flat layers across which the least tension acts, to 3 degrees."""
    k = np.arange(_DIRECTIONS)
    z = (k + 0.5) / _DIRECTIONS
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    out = np.sqrt(1.0 - z**2)
    tried = np.column_stack([out * np.cos(turn), out * np.sin(turn), z])
    tried = np.concatenate([np.eye(3), tried])
    weight = volume[critical] / np.linalg.eigvalsh(stress[critical])[:, 2]
    flat = stress[critical].reshape(-1, 9)
    products = np.einsum("ki,kj->kij", tried, tried).reshape(-1, 9)
    total = [float(weight @ np.maximum(flat @ each, 0.0)) for each in products]
    return np.asarray(tried[int(np.argmin(total))])
