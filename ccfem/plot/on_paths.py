"""Quantities on the fibre paths of a layer, as pieces with a value each to colour pictures by."""

import numpy as np

from ccfem.arrays import FloatArray
from ccfem.elasticity.stress_field import LayerStress
from ccfem.evaluation.plane_paths import plane_paths
from ccfem.evaluation.sensitivity import acute
from ccfem.geometry.locate import locate
from ccfem.geometry.polylines import resample, sample_midpoints, starts_segment, turning_angles
from ccfem.layers.layer import Layer
from ccfem.plot.paths import Coloured
from ccfem.tensor import in_plane, largest_in_plane
from ccfem.toolpaths import Toolpaths

__all__ = ["alignment_on_paths", "curvature_on_paths", "force_on_paths"]


def alignment_on_paths(paths: Toolpaths, stress: LayerStress, step: float = 1.0) -> Coloured:
    """Angle between the fibre and the larger principal stress, degrees, in steps along the paths.

    Parameters
    ----------
    paths : Toolpaths
    stress : LayerStress
        Its nodal values are used, as in `evaluate.alignment`.
    step : float, mm

    Returns
    -------
    Coloured
        From 0 to 90; NaN where the fibre is outside the section or not in tension.
    """
    layer = stress.layer
    lines = plane_paths(paths, layer)
    middle, tangent, length, _ = sample_midpoints(lines.points, lines.offsets, step)
    triangle, weights = locate(layer.plane.points, layer.triangles, middle, step)
    corners = in_plane(stress.nodal, layer.plane.frame)[layer.triangles[triangle]]
    largest, _, direction = largest_in_plane(np.einsum("qk,qkc->qc", weights, corners))
    angle = np.degrees(acute(np.arctan2(tangent[:, 1], tangent[:, 0]) - direction))
    angle[(triangle < 0) | (largest <= 0.0)] = np.nan
    return Coloured(_pieces(middle, tangent, length), angle, "degrees off tension", (0.0, 90.0))


def curvature_on_paths(paths: Toolpaths, layer: Layer, most: float, step: float = 1.0) -> Coloured:
    """Curvature of the paths, 1/mm, resampled in steps of arc length as in `evaluate.curvature`.

    Parameters
    ----------
    paths : Toolpaths
    layer : Layer
    most : float, 1/mm
        End of the colour scale: that of the tightest turn that the machine allows,
        ``1 / Machine.minimum_radius``.
    step : float, mm
    """
    lines = plane_paths(paths, layer)
    points, offsets = resample(lines.points, lines.offsets, step)
    angle = turning_angles(points, offsets, lines.closed)
    first = np.flatnonzero(starts_segment(offsets))
    segments = np.stack([points[first], points[first + 1]], axis=1)
    size = np.maximum(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1), 1e-9)
    curvature = np.maximum(angle[first], angle[first + 1]) / size
    return Coloured(segments, curvature, "1/mm curvature", (0.0, most))


def force_on_paths(
    middle: FloatArray, tangent: FloatArray, length: FloatArray, force: FloatArray, layer: Layer
) -> Coloured:
    """Axial force in pieces of fibre, N, blue in compression and red in tension.

    Parameters
    ----------
    middle : (s, 3) array, mm
        Middle of each piece, of all layers; those of other layers are left out.
    tangent : (s, 3) array
        Unit vectors along the fibre.
    length : (s,) array, mm
    force : (s,) array, N
        Positive in tension.
    layer : Layer
        A flat layer.

    Returns
    -------
    Coloured
        The scale ends at the force that 99 % of the pieces stay below.
    """
    here = np.abs(middle @ layer.plane.frame[2] - layer.plane.height) < 1e-6 * (
        1.0 + abs(layer.plane.height)
    )
    pieces = _pieces(
        layer.plane.project(middle[here]), layer.plane.project(tangent[here]), length[here]
    )
    size = np.abs(force[here])
    most = float(np.quantile(size, 0.99)) if len(size) else 1.0
    most = max(most, 1e-12)
    return Coloured(pieces, force[here], "N in the fibre", (-most, most), signed=True)


def _pieces(middle: FloatArray, tangent: FloatArray, length: FloatArray) -> FloatArray:
    """Return both ends (s, 2, 2) of straight pieces."""
    half = 0.5 * length[:, None] * tangent
    return np.stack([middle - half, middle + half], axis=1)
