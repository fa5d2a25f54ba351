"""Layers: what they know of their surface, flat or curved."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh import box_mesh
from ccfem.slicing.slicers import Planar


def bent(radius: float):
    """A flat layer of 20 x 8 mm, bent about the y axis to a radius without stretching."""
    layer = Planar(count=1).cut(box_mesh((20.0, 8.0, 1.0), (80, 4, 1)))[0]
    x, y, _ = layer.points.T
    points = np.stack([radius * np.sin(x / radius), y, radius * np.cos(x / radius)], axis=1)
    return replace(layer, points=points, flat=None)


def test_a_bent_sheet_keeps_its_area_and_has_radial_normals():
    layer = bent(30.0)
    # Chords are shorter than arcs by (h / r)^2 / 24.
    assert layer.areas.sum() == pytest.approx(160.0, rel=(0.25 / 30.0) ** 2 / 20.0)
    middle = layer.points[layer.triangles].mean(axis=1)
    radial = middle * [1.0, 0.0, 1.0]
    radial /= np.linalg.norm(radial, axis=1)[:, None]
    np.testing.assert_allclose(layer.normals, radial, atol=0.25 / 30.0)


def test_normals_of_a_flat_layer_point_up():
    layer = Planar(count=1).cut(box_mesh((6.0, 4.0, 2.0), (3, 2, 1)), (1.0, 2.0, 3.0))[0]
    up = np.broadcast_to(layer.plane.frame[2], layer.normals.shape)
    np.testing.assert_allclose(layer.normals, up, atol=1e-12)


def test_a_curved_layer_has_no_plane():
    with pytest.raises(InputError, match="layer 0 is curved and lies in no plane: choose"):
        _ = bent(30.0).plane


def test_plane_coordinates_lead_back_to_space():
    layer = Planar(count=1).cut(box_mesh((6.0, 4.0, 2.0), (3, 2, 1)), (1.0, 2.0, 3.0))[0]
    np.testing.assert_allclose(layer.plane.to_space(layer.plane.points), layer.points, atol=1e-12)


def test_a_layer_shows_itself_in_one_line():
    flat = Planar(count=1).cut(box_mesh((6.0, 4.0, 2.0), (3, 2, 1)))[0]
    assert repr(flat).startswith("Layer 0, flat at 1 mm: ")
    assert repr(bent(30.0)).startswith("Layer 0, curved: ")
    assert "\n" not in repr(flat)
