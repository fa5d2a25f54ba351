"""Brackets of the size of Kipping and Schueppstuhl's: what is known of them without a mesh."""

import numpy as np
import pytest
import shapely

from ccfem.cases import create_case
from ccfem.cases.bodies import arm_bracket_outlines, corner_bracket_outlines
from ccfem.geometry.locate import locate
from ccfem.slicing.slicers import LoadOriented


def volume_in_common(outlines, parts=400):
    """Volume of three extrusions at right angles: at each z, a section cut from rectangles."""
    low, high = outlines["y"].bounds[1], outlines["y"].bounds[3]
    heights = low + (np.arange(parts) + 0.5) * (high - low) / parts
    total = 0.0
    for z in heights:
        line = shapely.LineString([(-1e3, z), (1e3, z)])
        along_x, along_y = (shapely.intersection(outlines[axis], line) for axis in "yx")
        boxes = [
            shapely.box(a.bounds[0], b.bounds[0], a.bounds[2], b.bounds[2])
            for a in shapely.get_parts(along_x)
            for b in shapely.get_parts(along_y)
        ]
        total += shapely.union_all(boxes).intersection(outlines["z"]).area
    return total * (high - low) / parts


def test_arm_bracket_is_what_three_outlines_have_in_common():
    case = create_case("arm_bracket")
    mesh = case.problem.mesh
    np.testing.assert_allclose(np.ptp(mesh.points, axis=0), (80.0, 20.0, 28.0), atol=0.06)
    assert mesh.volumes.sum() == pytest.approx(volume_in_common(arm_bracket_outlines()), rel=0.005)
    assert 8000 < len(mesh.cells) < 10000
    assert mesh.aspects.max() < 20.0
    for hole, radius in (("foot_near", 3.0), ("foot_far", 3.0), ("upper", 4.0)):
        area = mesh.facet_areas(mesh.patch(hole))[0].sum()
        assert area == pytest.approx(2.0 * np.pi * radius * 6.0, rel=0.03)
    assert isinstance(case.slicing, LoadOriented)


def test_corner_bracket_is_a_part_of_its_domain():
    mesh = create_case("corner_bracket").problem.mesh
    outlines = corner_bracket_outlines()
    np.testing.assert_allclose(np.ptp(mesh.points, axis=0), (52.0, 52.0, 27.0), atol=1.5)
    assert mesh.volumes.sum() == pytest.approx(0.25 * volume_in_common(outlines), rel=0.03)
    assert 28_000 <= len(mesh.cells) <= 33_000
    x, y, z = mesh.points.T
    for axis, across in (("z", (x, y)), ("y", (x, z)), ("x", (y, z))):
        assert shapely.contains_xy(outlines[axis].buffer(0.15), *across).all()
    # The feet are as high as the hat's brim; the mesh goes on a little above the bolts.
    for k in range(1, 5):
        area = mesh.facet_areas(mesh.patch(f"foot_{k}"))[0].sum()
        assert area >= 0.97 * 2.0 * np.pi * 2.75 * 6.0


def test_the_rims_of_the_corner_bracket_are_as_wide_as_stated():
    """Two millimetres round the holes stay solid, to a fraction of a cell of 1.5 mm."""
    mesh = create_case("corner_bracket").problem.mesh
    turn = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    ring, along = np.stack([np.cos(turn), np.sin(turn)], axis=1), np.ones(len(turn))
    for x, y in ((-20.5, -20.5), (20.5, -20.5), (20.5, 20.5), (-20.5, 20.5)):
        for z in (1.0, 3.0, 5.0):
            place = np.column_stack([(x, y) + (2.75 + 1.5) * ring, z * along])
            assert (locate(mesh.points, mesh.corners, place)[0] >= 0).mean() > 0.97
    for x in (-3.0, 0.0, 3.0):  # the axle's rim ends 5 mm from the middle
        place = np.column_stack([x * along, (0.0, 20.0) + (4.0 + 1.7) * ring])
        assert (locate(mesh.points, mesh.corners, place)[0] >= 0).all()
