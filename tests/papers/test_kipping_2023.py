"""What judges the layers and strands of Kipping and Schueppstuhl 2023, on known ones."""

from dataclasses import replace

import numpy as np
import pytest

from ccfem.body.mesh import box_mesh
from ccfem.papers.contents import claim_table, judged
from ccfem.papers.kipping_2023.chain import distances_below
from ccfem.papers.kipping_2023.contents import EXPECTED, measured
from ccfem.slicing.slicers import Planar


def test_distances_are_those_of_the_planes():
    mesh = box_mesh((12.0, 8.0, 2.0), (6, 4, 2))
    layers = Planar(heights=(0.2, 0.6, 0.9, 1.6)).cut(mesh)
    found = distances_below(layers)
    np.testing.assert_allclose(np.unique(found.distance.round(9)), [0.3, 0.4, 0.7])
    assert found.within(0.35, 0.5) == pytest.approx(1.0 / 3.0)
    assert found.mean == pytest.approx(1.4 / 3.0)
    assert found.covered == pytest.approx(1.0)
    # A layer beside the others has nothing below.
    beside = replace(layers[3], points=layers[3].points + np.array([30.0, 0.0, 0.0]))
    assert distances_below([*layers[:3], beside]).covered == pytest.approx(2.0 / 3.0)


@pytest.mark.parametrize("bent", [False, True])
def test_a_strand_on_a_disc(bent):
    found = measured("disc", bent)
    assert (found.paths, found.crossings) == (1, 0)
    assert found.coverage > 0.95
    assert found.longest_step < 1.8
    assert found.off_surface < 0.02


def test_claims_are_judged():
    found = {"A: inverted": 0.0, "B: inverted": 0.1}
    checks = {check.quantity: check.verdict for check in judged(found, EXPECTED)}
    assert checks["A: inverted"] == "reproduced"
    assert checks["B: inverted"] == "differs"
    assert checks["A: support, inverted"] == "not tried"
    assert "not tried" in claim_table(judged(found, EXPECTED))
