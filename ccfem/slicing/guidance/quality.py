"""Quality of a guidance field, before anything is cut."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.slicing.guidance.guidance_field import GuidanceField

_RANGE = (0.4, 1.5)
"""Range of the local thickness, over the nominal one, that can be printed."""


@dataclass(frozen=True)
class FieldQuality:
    """Thickness of the layers of a field, and the angle of the stress to them.

    Attributes
    ----------
    thickness_5, thickness_50, thickness_95 : float, mm
        Percentiles by volume of the distance between neighbouring layers.
    thickness_outside : float
        Share of the volume in which it is outside 0.4 to 1.5 times the nominal thickness.
    folded : float
        Share of the area between cells across which the field reverses.
    angle_mean, angle_95 : float, degrees
        Between the strongest stress and the layer, by volume over the critical region.
    angle_mean_weighted, angle_95_weighted : float, degrees
        The same, with each cell also weighted by its importance.
    within_10, within_10_weighted : float
        Share of the critical region where that angle is at most 10 degrees.
    """

    thickness_5: float
    thickness_50: float
    thickness_95: float
    thickness_outside: float
    folded: float
    angle_mean: float
    angle_95: float
    angle_mean_weighted: float
    angle_95_weighted: float
    within_10: float
    within_10_weighted: float


def field_quality(
    field: GuidanceField,
    tension: FloatArray,
    importance: FloatArray,
    step: float,
    nominal: float,
) -> FieldQuality:
    """Measure a field.

    Parameters
    ----------
    tension : (m, 3) array
        Direction of the strongest stress.
    importance : (m,) array
        The critical region is where this is above 0; without one the angles are nan.
    step : float
        Difference of the field between layers.
    nominal : float, mm
        Wanted thickness.
    """
    volume = field.mesh.volumes
    size = np.linalg.norm(field.gradient, axis=1)
    thickness = step / np.maximum(size, 1e-12)
    low, middle, high = _quantiles(thickness, volume, (0.05, 0.5, 0.95))
    ratio = thickness / nominal
    outside = float(volume[(ratio < _RANGE[0]) | (ratio > _RANGE[1])].sum() / volume.sum())
    normal = field.gradient / np.maximum(size, 1e-300)[:, None]
    sine = np.abs(np.einsum("ed,ed->e", normal, tension))
    angle = np.degrees(np.arcsin(np.clip(sine, 0.0, 1.0)))
    critical = importance > 0.0
    values = []
    for weight in (volume[critical], (volume * importance)[critical]):
        values.append(_angles(angle[critical], weight))
    (mean, top, near), (mean_w, top_w, near_w) = values
    return FieldQuality(
        low, middle, high, outside, folded_share(field), mean, top, mean_w, top_w, near, near_w
    )


def folded_share(field: GuidanceField) -> float:
    """Share of the area between cells across which the gradient turns by more than 90 degrees."""
    first, side = np.nonzero(field.mesh.across > np.arange(len(field.mesh.cells))[:, None])
    second = field.mesh.across[first, side]
    area, _ = field.mesh.facet_areas(field.mesh.corners[first[:, None], field.mesh.faces[side]])
    against = np.einsum("fd,fd->f", field.gradient[first], field.gradient[second]) <= 0.0
    return float(area[against].sum() / max(float(area.sum()), 1e-300))


def _angles(angle: FloatArray, weight: FloatArray) -> tuple[float, float, float]:
    """Mean, 95th percentile and share within 10 degrees."""
    if not weight.sum() > 0.0:
        return np.nan, np.nan, np.nan
    return (
        float(np.average(angle, weights=weight)),
        _quantiles(angle, weight, (0.95,))[0],
        float(weight[angle <= 10.0].sum() / weight.sum()),
    )


def _quantiles(
    values: FloatArray, weight: FloatArray, shares: tuple[float, ...]
) -> tuple[float, ...]:
    """Quantiles of weighted values."""
    order = np.argsort(values, kind="stable")
    along = np.cumsum(weight[order]) / weight.sum()
    at = np.minimum(np.searchsorted(along, shares), len(values) - 1)
    return tuple(float(v) for v in values[order][at])
