"""Fibre that stands out of the top or bottom of the part."""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.body.mesh import TetMesh
from ccfem.geometry.polylines import merge_repeated, sample_midpoints
from ccfem.geometry.shapes import INSIDE, section_places
from ccfem.judging.evaluation.layer_paths import Basis, Column, LayerPaths, LayerSamples
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer

PLACE = 110
"""Of these columns in tables: the smaller, the farther to the left."""


_TOLERANCE = 0.1
"""Share of its height by which a strand may stand out of the part."""
_COARSE = 2.0
"""Distance, mm, of the samples of the fibre."""

COLUMNS = (
    Column(
        "outside_height",
        "1",
        "Share of the fibre's length at which a strand, half its height (machine.fibre_height, or "
        "filament_area over fibre_width) above and below its axis, stands out of the part's top or "
        f"bottom by more than {_TOLERANCE:g} of its height; what lies beside the section is left "
        f"out (sampled every {_COARSE:g} mm).",
        "0 to 1, 0 is best; NaN without fibre",
    ),
)


@dataclass(frozen=True)
class SkinSamples(LayerSamples):
    """Samples of the fibre of a layer."""

    length: FloatArray  # (s,), mm
    stands_out: BoolArray  # (s,)


def sample_skin(fibre: Toolpaths, layer: Layer, mesh: TetMesh, machine: Machine) -> SkinSamples:
    """Take the samples of one layer.

    Parameters
    ----------
    fibre : Toolpaths
        On this layer.
    mesh : TetMesh
        Of the part.
    machine : Machine
        With the height of a strand.
    """
    points, offsets, _ = merge_repeated(fibre.points, fibre.offsets, 1e-6)
    middle, _, length, _ = sample_midpoints(points, offsets, _COARSE)
    if not len(middle):
        return SkinSamples(np.zeros(0), np.zeros(0, dtype=bool))
    normal, beside = _over(layer, middle)
    reach = (0.5 - _TOLERANCE) * machine.strand_height * normal
    beyond = np.concatenate([middle - reach, middle + reach])
    cell, _ = mesh.locate(beyond)
    out = (cell < 0).reshape(2, -1).any(axis=0)
    return SkinSamples(length, out & ~beside)


def _over(layer: Layer, points: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the normal of the layer at each point, and whether it lies beside its section."""
    if layer.flat is not None:
        plane = layer.plane
        beside = section_places(plane.project(points), plane.polygon) != INSIDE
        return np.broadcast_to(plane.frame[2], points.shape), beside
    nearest = layer.nearest(points)
    normal = layer.normals_at(nearest)
    along = points - nearest.points
    along = along - np.einsum("sd,sd->s", along, normal)[:, None] * normal
    return normal, np.linalg.norm(along, axis=1) > 0.5 * nearest.distance + 1e-6


def skin_indices(samples: SkinSamples, _: Basis | None = None) -> dict[str, float]:
    """Value of each of `COLUMNS`."""
    total = float(samples.length.sum())
    share = float(samples.length @ samples.stands_out) / total if total > 0.0 else float("nan")
    return {"outside_height": share}


def sample(paths: LayerPaths) -> SkinSamples:
    """Take the samples of one layer."""
    return sample_skin(paths.fibre, paths.layer, paths.stress.mesh, paths.machine)


indices = skin_indices
