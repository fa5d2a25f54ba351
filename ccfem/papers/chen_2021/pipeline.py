"""The algorithm of the paper stage by stage, on one layer: what its figures 4 and 5 show.

The same functions as in `Isocurve.literal()`, called one after the other, so that each stage can be
timed, drawn and left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.isocontours import Isocontours
from ccfem.machine.machine import Machine
from ccfem.paths.fields.directed import Directed, directed
from ccfem.paths.fields.scalar import extract_levels, fit_literal
from ccfem.paths.fields.tensile import Tension, incompatible, orient, spatial_tension
from ccfem.paths.linking.finishing import keep_off_border, lead_into, linked_paths, parallel_curve
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, holes_on
from ccfem.strategies.isocurve import Isocurve

STAGES = ("u", "s", "extraction", "connection")
"""Stages of a layer, as table 1 times them."""
_LITERAL = Isocurve.literal()


@dataclass(frozen=True)
class VectorField:
    """The vectors of section 4.1 on the tetrahedra, before and after each step."""

    # (m, 3): unit vectors with the signs that a decomposition happens to give: drawn at random
    raw: FloatArray
    oriented: FloatArray  # (m, 3): along the minimum spanning tree
    # Oriented, and undefined where the filter of Eq. 2 finds vectors incompatible.
    tension: Tension
    unfiltered: Tension  # the raw vectors, none taken away
    seconds: tuple[float, float]  # of the orientation and of the filter


@dataclass(frozen=True)
class LayerStages:
    """What each stage of one layer gives."""

    layer: Layer
    directed: Directed  # the filled and smoothed vectors
    values: FloatArray  # (n,): the scalar field s
    curves: Isocontours
    rings: list[FloatArray]  # (k, 2) each: curves round the chosen holes
    # (k, 2) each: isocurves, cut back and led into the last of those curves
    led: list[FloatArray]
    paths: Toolpaths
    seconds: tuple[float, ...]  # of `STAGES`


def vector_field(stress: PartStress) -> VectorField:
    """Vectors of all tetrahedra, and the time that their processing takes."""
    raw = spatial_tension(stress.stress, _LITERAL.compression_limit)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], len(raw.stress))
    vectors = raw.direction * signs[:, None]
    started = perf_counter()
    oriented = orient(vectors, stress.mesh.neighbours)
    turned = perf_counter()
    against = incompatible(oriented, stress.mesh.corners, raw.defined, _LITERAL.incompatible)
    filtered = perf_counter()
    return VectorField(
        vectors,
        oriented,
        Tension(oriented, raw.stress, raw.defined & ~against, oriented=True),
        Tension(vectors, raw.stress, raw.defined, oriented=True),
        (turned - started, filtered - turned),
    )


def layer_stages(
    layer: Layer, tension: Tension, patches: Sequence[str], machine: Machine, power: float = 1.0
) -> LayerStages:
    """Run one layer, from the vectors of the tetrahedra to its paths.

    Parameters
    ----------
    tension : Tension
        Of all tetrahedra.
    patches : sequence of str
        Whose holes get curves round them.
    power : float, default 1
        p of Eq. 5.
    """
    strategy, width, section = _LITERAL, machine.fibre_width, layer.plane.polygon
    marks = [perf_counter()]
    known = directed(layer, tension.on(layer), strategy.cap, strategy.fill, strategy.fill_length)
    size = np.clip(known.size / known.cap, 1e-9, None) ** power
    marks.append(perf_counter())
    values = fit_literal(known.surface, np.clip(size, None, 1.0)[:, None] * known.direction)
    marks.append(perf_counter())
    curves = extract_levels(known.surface, values, width)
    marks.append(perf_counter())
    rings: list[FloatArray] = []
    lines = curves.lines()
    for hole in holes_on(layer, tuple(patches)):
        for distance in strategy.rings[:-1]:
            rings += parallel_curve(hole, distance * width, section)
        lines = lead_into(lines, hole, strategy.rings[-1] * width, section)
    least = machine.shortest_strand
    rings = keep_off_border(rings, section, 0.0)
    lines = keep_off_border(lines, section, 0.0)
    joined = linked_paths(
        [*rings, *lines], section, width, strategy.link_limit * width, least, False
    )
    paths = Toolpaths.from_plane(joined.lines, layer, link=joined.link)
    marks.append(perf_counter())
    seconds = tuple(np.diff(marks))
    return LayerStages(layer, known, values, curves, rings, lines, paths, seconds)


def planned(
    layers: Sequence[Layer],
    tension: Tension,
    patches: Sequence[str],
    machine: Machine,
    power: float = 1.0,
) -> list[LayerStages]:
    """Run every layer that has tension."""
    return [
        layer_stages(layer, tension, patches, machine, power)
        for layer in layers
        if tension.on(layer).defined.any()
    ]
