"""Plates of Plocher et al. 2022: shape, symmetry, loads, and the layers planned on."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.base.tensor import in_plane
from ccfem.papers.plocher_2022.plates import five_holes, optimised_beam, plates, single_hole
from ccfem.slicing.layers.layer import stress_on


@pytest.fixture(scope="module", params=["I", "II", "III"])
def plate(request):
    return plates()[request.param]()


def test_cut_out_areas_of_the_paper():
    # Table 3 states 251 mm^2 for case II; case I states 131 mm^2 beside a radius of 6 mm.
    plate = five_holes()
    assert 108.0 * 36.0 - plate.polygon.area == pytest.approx(251.0, rel=0.003)
    assert plate.mask.shape == (45, 135)
    plate = single_hole()
    assert 201.6 * 36.0 - plate.polygon.area == pytest.approx(36.0 * np.pi, rel=0.003)
    assert plate.mask.shape == (45, 252)
    assert 201.6 * 36.0 - single_hole(radius=6.46).polygon.area == pytest.approx(131.0, rel=0.003)


def test_bitmap_is_the_polygon_and_symmetric(plate):
    pixel = plate.bead**2
    assert plate.mask.sum() * pixel == pytest.approx(plate.polygon.area, rel=0.004)
    assert (plate.mask == plate.mask[:, ::-1]).all()
    if plate.name != "III":
        assert (plate.mask == plate.mask[::-1]).all()


def test_reactions_balance_the_load(plate):
    field = plate.isotropic_field
    expected = [0.0, 2.0] if plate.name == "III" else [-1.0, 0.0]
    np.testing.assert_allclose(field.reactions.sum(axis=0), expected, atol=1e-9)


def test_far_from_the_hole_the_tension_is_uniform():
    field = single_hole().isotropic_field
    far = np.abs(field.mesh.centres[:, 0] - 40.0) < 1.0
    # 1 N over 36 mm^2.
    np.testing.assert_allclose(field.stress[far].mean(axis=0), [1.0 / 36.0, 0.0, 0.0], atol=1e-5)


def test_hole_concentrates_the_stress_as_howland_found():
    # Howland (1930) for a hole of a third of the width: 2.31 on the net section (Heywood's fit).
    field = single_hole(bead=0.4).isotropic_field
    assert field.stress[:, 0].max() * 24.0 == pytest.approx(2.31, rel=0.1)


def test_the_material_of_the_first_solution_has_no_direction(plate):
    """Plane stress, Poisson's ratio 0.3: C12 = 0.3 C11 and C66 = 0.35 C11, for any modulus."""
    stiffness = plate.isotropic_field.problem.stiffness
    expected = np.array([[1.0, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 0.35]])
    expected = np.broadcast_to(expected, stiffness.shape)
    np.testing.assert_allclose(stiffness / stiffness[..., :1, :1], expected, rtol=1e-12)


def test_layers_carry_the_stress_of_the_pixels(plate):
    layers, stress = plate.planned_on(2)
    assert [layer.index for layer in layers] == [0, 1]
    for layer in layers:
        assert layer.plane.polygon.area == pytest.approx(plate.polygon.area, rel=0.003)
    centres = layers[0].plane.points[layers[0].triangles].mean(axis=1)
    found = in_plane(stress_on(layers[0], stress).nodal, layers[0].plane.frame)[
        layers[0].triangles
    ].mean(axis=1)
    field = plate.isotropic_field
    nearest = np.linalg.norm(field.mesh.centres[:, None] - centres[::37], axis=2).argmin(axis=0)
    off = np.linalg.norm(found[::37] - field.stress[nearest], axis=1)
    assert np.median(off) < 0.1 * np.median(np.linalg.norm(field.stress, axis=1))
    names = set(stress.problem.held_or_loaded)
    assert names >= {"load", "support"}
    assert all(len(stress.mesh.patch(name)) for name in names)


def test_peaks_are_left_out_round_point_loads():
    plate = optimised_beam()
    near = ~plate.off_peaks
    assert 0.0 < near.mean() < 0.05
    energy = plate.isotropic_field.cell_energy
    assert energy[near].sum() / energy.sum() > 2.0 * near.mean()
    assert single_hole().off_peaks.all()


def test_bead_width_out_of_range():
    with pytest.raises(InputError, match="bead width must be above 0"):
        single_hole(bead=0.0)
