"""Parts that two extrusions have in common: their size and volume are known without a mesh."""

import numpy as np
import pytest
import shapely

from ccfem.cases import create_case
from ccfem.cases.bodies import lifting_eye_outlines, twist_bar_outlines
from ccfem.slicing.slicers import Spatial

SIZES = {
    "twist_bar": ((330.0, 157.4, 60.0), {"base": (9.75, 60.0), "head": (9.75, 60.0)}),
    "lifting_eye": (
        (96.0, 64.0, 30.0),
        # The flange narrows away from the middle: 30 mm there, 28.5 mm at the sides of the eye.
        {"bolt_left": (4.5, 12.0), "bolt_right": (4.5, 12.0), "eye": (9.0, 29.0)},
    ),
}


def volume_in_common(front, top, parts=2000):
    """Volume of what is in both extrusions: at each x, height times depth."""
    low, high = max(front.bounds[0], top.bounds[0]), min(front.bounds[2], top.bounds[2])
    step = (high - low) / parts
    at = low + (np.arange(parts) + 0.5) * step
    ends = np.stack([np.stack([at, 0 * at - 500.0], 1), np.stack([at, 0 * at + 500.0], 1)], 1)
    lines = shapely.linestrings(ends)
    tall = shapely.length(shapely.intersection(lines, front))
    deep = shapely.length(shapely.intersection(lines, top))
    return float((tall * deep).sum() * step)


@pytest.mark.parametrize("name", SIZES)
def test_stored_mesh_is_what_the_two_outlines_have_in_common(name):
    mesh = create_case(name, order=1).problem.mesh
    size, holes = SIZES[name]
    np.testing.assert_allclose(np.ptp(mesh.points, axis=0), size, atol=2e-3 * max(size))
    outlines = {"twist_bar": twist_bar_outlines, "lifting_eye": lifting_eye_outlines}[name]()
    assert mesh.volumes.sum() == pytest.approx(volume_in_common(*outlines.values()), rel=0.005)
    assert mesh.volumes.min() > 0.0
    assert mesh.aspects.max() < 20.0
    for hole, (radius, height) in holes.items():
        area, normal = mesh.facet_areas(mesh.patch(hole))
        # Flat facets on a round wall: 2 % less.
        assert area.sum() == pytest.approx(2.0 * np.pi * radius * height, rel=0.03)
        axis = 1 if hole.startswith("b") else 2
        assert np.average(np.abs(normal[:, axis]), weights=area) < 0.06


def test_twist_bar_has_the_volume_of_the_authors_part():
    """1.23e6 mm^3, measured on their layers (specification, addendum A)."""
    assert volume_in_common(*twist_bar_outlines().values()) == pytest.approx(1.23e6, rel=0.005)


@pytest.mark.parametrize("name", SIZES)
def test_part_is_pulled_by_its_force_and_layered_along_the_stress(name):
    case = create_case(name, order=1, force=500.0)
    assert isinstance(case.slicing, Spatial)
    first = case.problem.cases[0]
    (load,) = case.problem.loads[first]
    assert np.linalg.norm(load.vector) == pytest.approx(500.0)
    assert len(case.problem.cases) == 2
