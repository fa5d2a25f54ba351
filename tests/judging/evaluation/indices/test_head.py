"""Tilt, overhang and collision of the head on shapes where they are known."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.judging.evaluation.indices.head import head_indices, sample_head
from ccfem.judging.evaluation.layer_paths import printed
from ccfem.machine import Machine
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, Plane, plane_frame

UP = (0.0, 0.0, 1.0)


def surface(at, first, second, index, flat=None):
    """Layer over a grid of two parameters, mapped into space by `at`."""
    u, v = np.meshgrid(first, second, indexing="ij")
    points = np.stack(at(u, v), axis=-1).reshape(-1, 3)
    number = np.arange(u.size).reshape(u.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    triangles = np.concatenate(
        [np.stack(each, axis=-1).reshape(-1, 3) for each in ((a, b, c), (a, c, d))]
    )
    n, t = len(points), len(triangles)
    return Layer(
        points=points,
        triangles=triangles,
        cell=np.zeros(t, dtype=int),
        nodes=np.zeros((n, 2), dtype=int),
        weights=np.zeros(n),
        loops=(),
        index=index,
        thickness=0.5,
        flat=flat,
    )


def roof(radius, half, index=0):
    """Cylinder about y, up to `half` degrees either side of its top."""
    return surface(
        lambda u, v: (radius * np.sin(u), v, radius * np.cos(u)),
        np.radians(np.linspace(-half, half, 241)),
        np.linspace(0.0, 10.0, 11),
        index,
    )


def floor(index=0, flat=None, height=0.0):
    return surface(
        lambda u, v: (u, v, np.full_like(u, height)),
        np.linspace(-30.0, 30.0, 61),
        np.linspace(-30.0, 30.0, 61),
        index,
        flat,
    )


def wall(distance, height, index=0):
    """Upright layer across x."""
    return surface(
        lambda u, v: (np.full_like(u, distance), u, v),
        np.linspace(-20.0, 20.0, 81),
        np.linspace(0.0, height, int(4 * height) + 1),
        index,
    )


def strand(points, layer):
    normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    return Toolpaths.in_space([np.asarray(points, dtype=float)], [normals], layer)


def values(fibre, layer, layers, machine=None, build=UP):
    stack = printed(layers, build)
    return head_indices(sample_head(fibre, layer, stack, machine or Machine()))


@pytest.mark.parametrize(("half", "overhang"), [(30.0, 0.0), (60.0, 0.25), (90.0, 0.5)])
def test_tilt_and_overhang_over_a_round_roof(half, overhang):
    """Along the arc the tilt runs evenly from -half to half."""
    layer = roof(40.0, half)
    angle = np.radians(np.linspace(-half, half, 400))
    along = np.stack([40.0 * np.sin(angle), 5.0 + 0.0 * angle, 40.0 * np.cos(angle)], axis=1)
    found = values(strand(along, layer), layer, [layer])
    assert found["tilt_mean"] == pytest.approx(half / 2.0, rel=0.01)
    # Samples lie 2 mm apart, which is 2.9 degrees.
    assert found["tilt_95"] == pytest.approx(0.95 * half, abs=2.9)
    assert found["overhang"] == pytest.approx(overhang, abs=0.02)
    assert found["head_collision"] == 0.0
    # The ridge is level.
    level = strand([[0.0, y, 40.0] for y in np.linspace(0.0, 10.0, 21)], layer)
    assert values(level, layer, [layer])["tilt_mean"] == pytest.approx(0.0, abs=0.5)


def test_tilt_is_measured_from_the_build_direction_or_the_mean_normal():
    layer = floor()
    fibre = strand([[x, 0.0, 0.0] for x in np.linspace(-9.0, 9.0, 19)], layer)
    slanted = (0.0, np.sin(np.radians(20.0)), np.cos(np.radians(20.0)))
    assert values(fibre, layer, [layer], build=slanted)["tilt_mean"] == pytest.approx(20.0)
    assert values(fibre, layer, [layer], build=None)["tilt_mean"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("height", "length", "reach"), [(30.0, 12.0, 12.0), (8.0, 12.0, 8.0), (30.0, 20.0, 20.0)]
)
def test_head_meets_a_wall_that_is_nearer_than_its_cone_is_wide(height, length, reach):
    """It is reach * tan(35 degrees) wide where the wall or the head ends, whichever is first."""
    machine = Machine(head_angle=35.0, head_length=length)
    wide = reach * np.tan(np.radians(35.0))
    before, layer = wall(0.0, height, 0), floor(1)
    for distance, hits in ((wide - 1.2, 1.0), (wide + 0.1, 0.0)):
        fibre = strand([[distance, y, 0.0] for y in np.linspace(-8.0, 8.0, 17)], layer)
        assert values(fibre, layer, [before, layer], machine)["head_collision"] == hits
        # What is printed later is not in the way.
        later = wall(0.0, height, 2)
        assert values(fibre, layer, [layer, later], machine)["head_collision"] == 0.0


def test_head_meets_the_sides_of_a_groove_up_to_where_it_is_wide_enough():
    """Tip in a round groove: 45 degrees up its side the cone about the normal meets the other."""
    groove = surface(
        lambda u, v: (20.0 * np.sin(u), v, -20.0 * np.cos(u)),
        np.radians(np.linspace(-90.0, 90.0, 181)),
        np.linspace(0.0, 10.0, 21),
        0,
    )
    inner = surface(
        lambda u, v: (19.0 * np.sin(u), v, -19.0 * np.cos(u)),
        np.radians(np.linspace(-90.0, 90.0, 181)),
        np.linspace(0.0, 10.0, 21),
        1,
    )
    fibre = strand([[0.0, y, -19.0] for y in np.linspace(1.0, 9.0, 17)], inner)
    # Seen from the lowest point of a circle, one at the angle u lies u / 2 off its tangent: the
    # cone of a half-angle a takes in all points beyond u = 180 - 2 a, which are there from 45 on.
    for angle, hits in ((40.0, 0.0), (52.0, 1.0)):
        machine = Machine(head_angle=angle, head_length=60.0)
        assert values(fibre, inner, [groove, inner], machine)["head_collision"] == hits


def test_flat_layers_have_none_of_it():
    """Even where a higher one was numbered first."""
    planes = [Plane(plane_frame(UP), height) for height in (0.0, 1.0)]
    layers = [floor(1, planes[0], 0.0), floor(0, planes[1], 1.0)]
    fibre = strand([[x, 0.0, 0.0] for x in np.linspace(-9.0, 9.0, 19)], layers[0])
    assert printed(layers) is None
    assert set(values(fibre, layers[0], layers).values()) == {0.0}
    none = head_indices(sample_head(Toolpaths.empty(), layers[0], None, Machine()))
    assert np.isnan(list(none.values())).all()


def test_head_that_is_no_cone_is_refused():
    with pytest.raises(InputError, match="head_angle must be from 1 to 89 degrees; got 90"):
        Machine(head_angle=90.0)
