import numpy as np
import pytest

from ccfem.base.plain import plain
from ccfem.body.mesh.patches import Box, Cylinder
from ccfem.cases import create_case
from ccfem.fem.elasticity import Force, PointForce, RigidPatch, Support, Temperature
from ccfem.printing.bed_layout import BedLayout
from ccfem.slicing.slicers.planar import Planar

ARRAY, TUPLE = np.array([1.0, 2.0, 3.0]), (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("of_arrays", "of_tuples"),
    [
        (Force("tip", ARRAY), Force("tip", TUPLE)),
        (PointForce(ARRAY, [1, 2, np.int64(3)]), PointForce(TUPLE, (1, 2, 3))),
        (Support("foot", value=ARRAY), Support("foot", value=TUPLE)),
        (RigidPatch("foot", centre=ARRAY), RigidPatch("foot", centre=TUPLE)),
        (Temperature(ARRAY, np.eye(3)), Temperature(TUPLE, plain(np.eye(3)))),
        (Box(ARRAY, 2.0 * ARRAY), Box(TUPLE, (2.0, 4.0, 6.0))),
        (Cylinder(ARRAY, "z", np.float64(3.0)), Cylinder(TUPLE, "z", 3.0)),
        (BedLayout(centre=ARRAY[:2]), BedLayout(centre=TUPLE[:2])),
        (Planar(heights=ARRAY), Planar(heights=TUPLE)),
    ],
)
def test_values_of_arrays_are_those_of_tuples(of_arrays, of_tuples):
    """They are compared, hashed and printed alike: messages and part files hold plain numbers."""
    assert of_arrays == of_tuples
    assert hash(of_arrays) == hash(of_tuples)
    assert repr(of_arrays) == repr(of_tuples)


def test_a_case_has_a_plain_build_direction():
    from dataclasses import replace

    case = replace(create_case("bar"), build=np.array([0.0, 0.0, 1.0]))
    assert case.build == (0.0, 0.0, 1.0)
