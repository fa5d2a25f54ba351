"""Fibre that stands out of the top or bottom: known from where its layer lies."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.body.mesh.box import box_mesh
from ccfem.judging.evaluation.indices.skin import sample_skin, skin_indices
from ccfem.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.slicers.planar import Planar

MACHINE = Machine(fibre_width=1.0, fibre_height=0.2, filament_area=0.1)
MESH = box_mesh((60.0, 40.0, 2.0), (12, 8, 2))


def share(height, *lines, rise=0.0):
    """Share that stands out, of lines on a layer of a plate 2 mm high, `rise` above the layer."""
    (layer,) = Planar(heights=(height,)).cut(MESH)
    paths = Toolpaths.from_plane([np.array(line, dtype=float) for line in lines], layer)
    risen = replace(paths, points=paths.points + np.array([0.0, 0.0, rise]))
    return skin_indices(sample_skin(risen, layer, MESH, MACHINE))["outside_height"]


@pytest.mark.parametrize(
    ("height", "expected"), [(0.0, 1.0), (0.07, 1.0), (0.09, 0.0), (1.0, 0.0), (1.95, 1.0)]
)
def test_a_strand_fits_half_its_height_below_the_skin(height, expected):
    assert share(height, [[5, 20], [55, 20]]) == expected


def test_what_lies_above_its_layer_is_seen_where_it_is():
    assert share(1.8, [[5, 20], [55, 20]], rise=0.18) == 1.0
    assert share(1.8, [[5, 20], [55, 20]], rise=0.3) == 1.0
    assert share(1.8, [[5, 20], [55, 20]], rise=0.1) == 0.0


def test_what_lies_beside_the_section_is_left_out():
    assert share(1.0, [[50, 20], [70, 20]]) == 0.0
    assert share(0.0, [[50, 20], [70, 20]]) == pytest.approx(0.5)


def test_no_fibre_has_no_share():
    assert np.isnan(share(1.0))
