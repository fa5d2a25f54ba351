"""Layers that share a plan: those of the same section with the same stress directions.

Layers that differ only by rounding should get the same plan. If the stress turns from layer to
layer, as in a twisted part, each layer gets its own.
"""

from collections.abc import Sequence

import numpy as np
import shapely

from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import LayerStress, stress_on
from ccfem.strategies.stress_tracing.stress_lines import plane_stress_at, stress_lines

_SAME = 1e-6
"""Share of its area by which a section may differ from an equal one."""
_TURNED = 0.1
"""Largest mean squared sine of the angle between the stresses on two layers that share a plan:
about 18 degrees."""
_WEAK = 0.2
"""Share of the largest mean stress below which a layer takes the plan of the most stressed one:
near the neutral plane of a part in bending, directions are random."""
_AS_LARGE = 0.99
"""Share of the largest mean stress above which a layer counts as most stressed; the first is taken.
"""
_REACH = 1.0
"""Distance, mm, from a layer up to which its stress is used."""


def alike(layers: Sequence[Layer], stress: PartStress) -> dict[int, Layer]:
    """Layer whose stress is used to plan each flat layer, by the index of the layer.

    Among layers of the same section it is the first with the largest mean stress. The same is then
    repeated for layers whose stress has other directions.

    Parameters
    ----------
    layers : sequence of Layer
    stress : PartStress
    """
    found: dict[int, Layer] = {}
    for group in _same_sections(layers):
        left = [stress_on(layer, stress) for layer in group] if len(group) > 1 else []
        sizes = [_mean_size(each) for each in left]
        if len(group) == 1:
            found[group[0].index] = group[0]
        while left:
            largest = max(sizes)
            guide = next(
                each for each, size in zip(left, sizes, strict=True) if size >= _AS_LARGE * largest
            )
            rest = []
            for each, size in zip(left, sizes, strict=True):
                if size <= _WEAK * largest or apart(guide, each) <= _TURNED:
                    found[each.layer.index] = guide.layer
                else:
                    rest.append((each, size))
            left, sizes = [each for each, _ in rest], [size for _, size in rest]
    return found


def apart(one: LayerStress, other: LayerStress) -> float:
    """Mean squared sine of the angle between the principal stresses on two layers, from 0 to 1.

    The principal stress is that of largest absolute value, weighted by both values and by area.

    Parameters
    ----------
    one, other : LayerStress
        On layers of the same section.
    """
    layer = one.layer
    middles = layer.plane.points[layer.triangles].mean(axis=1)
    first, second = (stress_lines(plane_stress_at(each, middles, _REACH)) for each in (one, other))
    both = first.defined & second.defined
    weight = np.where(both, layer.areas * np.sqrt(np.abs(first.value * second.value)), 0.0)
    cosine = np.einsum("ki,ki->k", first.direction, second.direction)
    total = float(weight.sum())
    return float(weight @ (1.0 - cosine**2)) / total if total > 0.0 else 0.0


def _mean_size(stress: LayerStress) -> float:
    """Mean size of the largest principal stress over a layer, MPa."""
    layer = stress.layer
    middles = layer.plane.points[layer.triangles].mean(axis=1)
    value = np.abs(stress_lines(plane_stress_at(stress, middles, _REACH)).value)
    return float(layer.areas @ value / layer.areas.sum())


def _same_sections(layers: Sequence[Layer]) -> list[list[Layer]]:
    """Flat layers in groups of the same section."""
    found: list[list[Layer]] = []
    for layer in layers:
        if layer.flat is None:
            continue
        section = layer.plane.polygon
        for group in found:
            other = group[0].plane.polygon
            difference = shapely.symmetric_difference(section, other).area
            if difference <= _SAME * max(section.area, 1e-300):
                group.append(layer)
                break
        else:
            found.append([layer])
    return found
