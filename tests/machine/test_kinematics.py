"""Five axes: their values beside rotation matrices of another library."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ccfem.base.errors import InputError
from ccfem.machine.kinematics import Kinematics, axis_values

CENTRE = (140.0, 160.0, -20.0)


def walk(count=200):
    """Tips and directions that turn and tilt, upright in between."""
    turn = np.linspace(0.0, 6.0 * np.pi, count)
    tilt = np.radians(50.0) * np.sin(0.5 * turn) ** 2
    tilt[60:64] = 0.0
    normal = np.column_stack(
        [np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)]
    )
    return np.random.default_rng(3).uniform(0.0, 200.0, (count, 3)), normal


@pytest.mark.parametrize("kind", ["table_table", "head_head"])
def test_the_axes_bring_the_head_to_its_place(kind):
    kinematics, (place, normal) = Kinematics(kind, CENTRE, 85.0), walk()
    linear, turning = axis_values(kinematics, place, normal)
    tilt, spin = turning.T
    if kind == "table_table":
        # Trunnion: the part is turned about Z by C, then with that table about X by A.
        turned = Rotation.from_euler("zx", np.column_stack([spin, tilt]), degrees=True)
        np.testing.assert_allclose(turned.apply(normal), np.tile([0, 0, 1], (200, 1)), atol=1e-12)
        np.testing.assert_allclose(turned.apply(place - CENTRE) + CENTRE, linear, atol=1e-9)
    else:
        # Head: about its own Y by B, then about Z by C; the tip hangs 85 mm below the pivot.
        turned = Rotation.from_euler("yz", turning, degrees=True)
        np.testing.assert_allclose(turned.apply([0, 0, 1]), normal, atol=1e-12)
        pivot = linear + np.array([0, 0, 85.0])
        np.testing.assert_allclose(pivot + turned.apply([0, 0, -85.0]), place, atol=1e-9)


@pytest.mark.parametrize("kind", ["table_table", "head_head"])
def test_the_turning_axis_does_not_jump(kind):
    place, normal = walk()
    _, turning = axis_values(Kinematics(kind, CENTRE), place, normal)
    assert np.abs(np.diff(turning[:, 1])).max() <= 90.0
    # Upright, it stays where it is.
    assert np.ptp(turning[60:64, 1]) == 0.0
    assert np.abs(turning[:, 0]).max() == pytest.approx(50.0, abs=0.1)
    # Straight over the pole, the tilt changes its sign and nothing turns.
    tilt = np.radians(np.linspace(-20.0, 20.0, 9))
    over = np.column_stack([0.0 * tilt, np.sin(tilt), np.cos(tilt)])
    _, turning = axis_values(Kinematics(kind, CENTRE), place[:9], over)
    assert np.ptp(turning[:, 1]) == pytest.approx(0.0, abs=1e-9)
    assert np.ptp(turning[:, 0]) == pytest.approx(40.0)
    _, still = axis_values(Kinematics(kind, CENTRE), place, np.tile([0.0, 0.0, 1.0], (200, 1)))
    assert (still == 0.0).all()


def test_three_axes_stay_upright():
    place, normal = walk()
    linear, turning = axis_values(Kinematics(), place, normal)
    assert linear is place
    assert not turning.any()


def test_kinematics_that_make_no_sense():
    with pytest.raises(InputError, match=r"kinematics\.kind must be one of 'three_axes'"):
        Kinematics("hexapod")
    with pytest.raises(InputError, match=r"kinematics\.pivot must be 0 or from 0.1 to 10000 mm"):
        Kinematics("head_head", pivot=-1.0)
