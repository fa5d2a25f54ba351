"""Edits of a part file's text: what they change reads right, and everything else stays."""

import tomllib
from pathlib import Path

import pytest
import shapely

from ccfem.base.errors import InputError
from ccfem.body.mesh.face_rules import Faces, numbered_faces
from ccfem.body.meshing import extrude
from ccfem.cases.inspection.beginning import empty_part
from ccfem.cases.inspection.face_choice import coplanar, face_rule, like_holes
from ccfem.cases.part_editing import appended, edited, patch_of, rebased, removed, valued

TEXT = """\
# A hook of the user's, with his remarks.
surface = "hook.stl"   # from the CAD
edge_length = 3.0
material = "pla"

[patches.eye]          # where it hangs
rule = "holes"
radius = 6.0

[[supports]]
patch = "eye"          # held

[[loads.lift]]
kind = "force"
patch = "bowl"
vector = [0, -500, 0]  # N

[patches.bowl]
rule = "holes"
radius = 18.0

[strategies.isocurve]
cap = 90.0             # nothing that the page shows
"""


@pytest.fixture(scope="module")
def plate():
    """Faces of a plate 60 x 30 x 4 mm with two holes of radius 3 and one of radius 6 mm."""
    holes = [shapely.Point(x, 15).buffer(r, quad_segs=32) for x, r in ((10, 3), (25, 3), (45, 6))]
    outline = shapely.box(0, 0, 60, 30).difference(shapely.union_all(holes))
    return numbered_faces(extrude(outline, 4.0, 3.0))


def holes_of(plate, radius):
    numbers = zip(plate.numbers, plate.faces, strict=True)
    return [k for k, face in numbers if face.hollow and abs(face.radius - radius) < 0.1]


@pytest.mark.parametrize(
    ("change", "after"),
    [
        (valued(("edge_length",), 2.5), lambda c: c | {"edge_length": 2.5}),
        (valued(("machine", "lift"), 2), lambda c: c | {"machine": {"lift": 2}}),
        (valued(("title",), None), lambda c: c),
        (
            valued(("loads", "lift", 0, "vector"), [0.0, -9.0, 0.0]),
            lambda c: c | {"loads": {"lift": [c["loads"]["lift"][0] | {"vector": [0, -9, 0]}]}},
        ),
        (
            appended(("loads", "lift"), {"kind": "gravity"}),
            lambda c: c | {"loads": {"lift": [*c["loads"]["lift"], {"kind": "gravity"}]}},
        ),
        (
            appended(("loads", "side"), {"kind": "gravity"}),
            lambda c: c | {"loads": c["loads"] | {"side": [{"kind": "gravity"}]}},
        ),
        (
            appended(("supports",), {"kind": "sliding", "patch": "bowl"}),
            lambda c: c | {"supports": [*c["supports"], {"kind": "sliding", "patch": "bowl"}]},
        ),
        (  # the patch that nothing else names goes with its support
            removed(("supports", 0)),
            lambda c: {k: v for k, v in c.items() if k != "supports"}
            | {"patches": {"bowl": c["patches"]["bowl"]}},
        ),
        (
            removed(("loads", "lift", 0)),
            lambda c: {k: v for k, v in c.items() if k != "loads"}
            | {"patches": {"eye": c["patches"]["eye"]}},
        ),
    ],
)  # fmt: skip
def test_an_edit_changes_what_it_says_and_keeps_the_rest(change, after):
    text = edited(TEXT, change)
    assert tomllib.loads(text) == after(tomllib.loads(TEXT))
    for remark in ("# A hook of the user's", "# from the CAD", "# nothing that the page shows"):
        assert remark in text


def test_a_new_part_reads_as_what_was_clicked(plate):
    text = empty_part(Path("plate.step"), plate)
    text, bolts = patch_of(text, plate, holes_of(plate, 3.0))
    text, eye = patch_of(text, plate, holes_of(plate, 6.0))
    text = edited(text, appended(("supports",), {"patch": bolts}))
    load = {"kind": "bearing", "patch": eye, "vector": [100.0, 0.0, 0.0]}
    text = edited(text, appended(("loads", "pull"), load))
    content = tomllib.loads(text)
    assert (bolts, eye) == ("holes_r3", "hole_r6")
    assert content["patches"]["holes_r3"] == {"rule": "holes", "radius": 3.0}
    assert content["patches"]["hole_r6"]["axis"] == "z"
    assert content["supports"] == [{"patch": "holes_r3"}]
    assert content["loads"] == {"pull": [load]}
    assert len(text.splitlines()) < 30
    assert patch_of(text, plate, holes_of(plate, 3.0)) == (text, bolts)  # it is there already


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_a_rule_chooses_the_faces_that_were_clicked(plate, count):
    for first in range(len(plate.numbers)):
        numbers = sorted(
            {plate.numbers[(first + 2 * k) % len(plate.numbers)] for k in range(count)}
        )
        rule = dict(face_rule(plate, numbers))
        if rule.pop("rule") == "face":
            assert sorted(Faces(**rule).numbers_on(plate)) == numbers
        else:
            assert numbers == holes_of(plate, rule["radius"])


def test_faces_alike_are_chosen_together(plate):
    small, large = holes_of(plate, 3.0), holes_of(plate, 6.0)
    assert like_holes(plate, small[0]) == small
    assert like_holes(plate, large[0]) == large
    assert coplanar(plate, small[0]) == [small[0]]
    top = next(k for k in plate.numbers if plate.face(k).along == "z")
    assert coplanar(plate, top) == [top]
    with pytest.raises(InputError, match="no face is chosen"):
        patch_of(TEXT, plate, [])


def test_a_copy_elsewhere_names_the_same_files(tmp_path):
    results = tmp_path / "results"
    moved = rebased(TEXT, tmp_path, results)
    assert tomllib.loads(moved) == tomllib.loads(TEXT) | {"surface": "../hook.stl"}
    assert "# from the CAD" in moved
    assert rebased(TEXT, tmp_path, tmp_path) == TEXT


@pytest.mark.parametrize("text", ["a = ", "[[supports]]\n[supports]"])
def test_a_text_that_is_not_toml_is_refused(text):
    with pytest.raises(InputError, match="is not a TOML file"):
        edited(text, valued(("layers",), 3))


def test_what_cannot_be_changed_is_said():
    """Where text and values come out differently nothing is written."""

    def change(content):
        content["layers"] = 3 if type(content) is dict else 4

    with pytest.raises(InputError, match="change it in an editor"):
        edited(TEXT, change)


@pytest.mark.parametrize("given", ["3", '"x"', "[1]", "[[]]", "true"])
def test_a_list_in_the_place_of_a_table_is_said_and_left_alone(plate, given):
    with pytest.raises(InputError, match="change it in an editor"):
        patch_of(f"patches = {given}", plate, [1])
    with pytest.raises(InputError, match="change it in an editor"):
        edited(f"loads = {given}", appended(("loads", "end"), {"kind": "gravity"}))


def test_tables_within_a_line_take_one_more(plate):
    text = 'patches = {end = {rule = "face", number = 1}}  # mine\n'
    text, name = patch_of(text, plate, holes_of(plate, 6.0))
    assert tomllib.loads(text)["patches"].keys() == {"end", name}
    assert "# mine" in text
    text = edited(
        'loads = {a = [{kind = "gravity"}]}  # mine\n', appended(("loads", "b"), {"k": 1})
    )
    assert tomllib.loads(text)["loads"] == {"a": [{"kind": "gravity"}], "b": [{"k": 1}]}
    assert "# mine" in text


def test_what_acts_on_no_patch_is_removed_beside_patches():
    text = edited(TEXT, appended(("loads", "own weight"), {"kind": "gravity"}))
    assert edited(text, removed(("loads", "own weight", 0))).rstrip() == TEXT.rstrip()
