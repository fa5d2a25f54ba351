"""What acts on a part by its part file, whatever is written there."""

import numpy as np
import pytest

from ccfem.cases.inspection.acting import entries
from ccfem.cases.inspection.patch_places import PatchPlace
from ccfem.cases.part_draft import PartDraft
from ccfem.cases.part_loads import LOADS

BODY = np.array([[[0, 0, 0], [8.0, 0, 0], [0, 4.0, 6.0]]])
PLACES = {
    "left": PatchPlace(np.array([[[0, 0, 0], [0, 3.0, 0], [0, 0, 3.0]]]), (4,)),
    "right": PatchPlace(np.array([[[9.0, 0, 0], [9.0, 3, 0], [9.0, 0, 3]]]), (2,)),
}


def only(**table):
    """A load of a table alone: its entry, and where it acts."""
    (entry,) = entries(PartDraft({"loads": {"a": [table]}})).values()
    return entry, entry.place(PLACES, BODY)


def test_every_kind_of_load_has_a_size_with_its_unit():
    for kind in LOADS:
        entry, _ = only(kind=kind, acceleration=[0, 3, 4], vector=[0, 3, 4], magnitude=5, speed=5)
        if kind not in ("nodes", "temperature"):
            assert entry.said.startswith("5 ")
            assert len(entry.said) > 2
    assert only(kind="temperature", change=-40)[0].said == "-40 K"
    assert only(kind="gravity")[0].amount == (0.0, 0.0, -9.81)


def test_loads_act_on_patches_at_points_and_about_axes():
    entry, place = only(kind="moment", patch="left", vector=[0, 0, -2])
    assert place.numbers == (4,)
    np.testing.assert_allclose(place.centre, [0, 1, 1])
    np.testing.assert_array_equal(entry.along, [0, 0, -2])
    entry, place = only(kind="point", point=[1, 2, 3], vector=[1, 0, 0])
    np.testing.assert_array_equal(place.centre, [1, 2, 3])
    entry, place = only(kind="nodes", points=[[0, 0, 0], [2, 0, 0]], vectors=[[1, 0, 2], [3, 0, 4]])
    np.testing.assert_array_equal(place.centre, [1, 0, 0])
    np.testing.assert_array_equal(entry.along, [4, 0, 6])
    # On its axis, beside the middle of the part, which is at (8, 4, 6) / 3.
    entry, place = only(kind="centrifugal", speed=5, point=[1, 1, 90], axis=[0, 0, -3])
    np.testing.assert_allclose(place.centre, [1, 1, 2])
    np.testing.assert_array_equal(entry.along, [0, 0, -3])
    for kind in ("gravity", "body_force", "temperature"):
        np.testing.assert_allclose(only(kind=kind)[1].centre, [8 / 3, 4 / 3, 2])


def test_supports_have_no_size_and_a_place():
    edge = {"kind": "edge", "patches": ["left", "right"], "value": [0, 0, 1]}
    supports = [edge, {"patch": "left"}, {"kind": "point", "point": [1, 2, 3]}]
    those = entries(PartDraft({"supports": supports}))
    assert [name[0] for name in those] == ["edge on ['left', 'right']", "Hold on left", "point"]
    assert [entry.amount for entry in those.values()] == [None] * 3
    places = [entry.place(PLACES, BODY) for entry in those.values()]
    assert [place.numbers for place in places] == [(4, 2), (4,), ()]
    np.testing.assert_array_equal(places[2].centre, [1, 2, 3])


@pytest.mark.parametrize(
    "table",
    [
        {},
        {"kind": 3},
        {"kind": "force", "patch": ["left"], "vector": "x"},
        {"kind": "force", "patch": "none", "vector": [1, 2]},
        {"kind": "point", "point": [1, 2], "vector": [1, 2, float("nan")]},
        {"kind": "nodes", "points": [[1, 2, 3], [4]], "vectors": 3},
        {"kind": "centrifugal", "point": [0, 0, 0, 0], "axis": [0, 0, 0]},
        {"kind": "centrifugal", "point": 3, "axis": "z"},
        {"kind": "moment", "patches": 5, "vector": [0, 0, 0]},
    ],
)
def test_what_cannot_be_read_acts_nowhere(table):
    entry, place = only(**table)
    assert place is None
    assert entry.along is None
    assert entry.said
    assert entries(PartDraft({"loads": [table], "supports": table})) == {}
