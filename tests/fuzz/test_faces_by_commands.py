"""One face by three commands. More bodies: benchmarks.fuzz.faces_by_commands."""

import numpy as np
import pytest

from benchmarks.fuzz.faces_by_commands import TURNS, differences, moved
from ccfem.cases.inspection import faces


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """The bracket and the lever of the page on parts of one's own, where Gmsh works."""
    pytest.importorskip("gmsh")
    from benchmarks.studies.own_parts import brake_lever, l_bracket

    folder = tmp_path_factory.mktemp("bodies")
    try:
        l_bracket(folder / "bracket.step")
        brake_lever(folder / "lever.stl")
    except (AttributeError, OSError):
        pytest.skip("the library of Gmsh is missing")
    return folder


def test_faces_of_a_cad_file(parts):
    assert differences(parts / "bracket.step", 6.0) == []


def test_faces_of_a_turned_surface(parts):
    moved(parts / "lever.stl", TURNS["turned"], parts / "turned.stl")
    assert differences(parts / "turned.stl", 6.0) == []


def test_a_place_turns_with_the_body(parts):
    """Each face of the turned or mirrored lever is at the image of its place on the lever."""
    plain = faces(parts / "lever.stl")
    for what in ("turned", "mirrored"):
        turn = TURNS[what]
        moved(parts / "lever.stl", turn, parts / "image.stl")
        image = faces(parts / "image.stl")
        for number, face in zip(plain.numbers, plain.faces, strict=True):
            place = plain.place(number)
            given = {k: turn @ np.array(place[k]) for k in ("at", "normal", "axis") if k in place}
            found = image.face(image.number_at(**given, radius=place.get("radius", 1.0)))
            assert found.area == pytest.approx(face.area, rel=1e-4), what
            np.testing.assert_allclose(found.centre, turn @ face.centre, atol=1e-3)
