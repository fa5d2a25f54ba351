"""Decks of Abaqus and CalculiX: what they mean by their manuals, with scopes kept apart."""

import itertools

import numpy as np
import pytest
from facet_sets import facets_as_set

from ccfem.base.errors import InputError
from ccfem.body.files import read_mesh
from ccfem.body.mesh import box_mesh
from ccfem.body.mesh.patches import Plane

MESH = box_mesh((2.0, 1.0, 1.0), (1, 1, 1))
NODES = "\n".join(f"{k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(MESH.points.tolist(), 1))
CELLS = "\n".join(f"{k}, {', '.join(map(str, c))}" for k, c in enumerate(MESH.cells + 1, 1))
MESHED = f"*Node\n{NODES}\n*Element, type=C3D4, elset=Eall\n{CELLS}\n"
LEFT = ", ".join(map(str, np.flatnonzero(MESH.points[:, 0] == 0.0) + 1))
PART = f"*Part, name=P\n{MESHED}"
ONE = "*End Part\n*Assembly, name=A\n*Instance, name=P-1, part=P\n*End Instance\n"


def reading(tmp_path, text, **files):
    for name, content in {"part.inp": text, **files}.items():
        (tmp_path / name).write_text(content)
    return read_mesh(tmp_path / "part.inp")


DECK = """*Heading
two tetrahedra on the triangle 20 30 40, nodes numbered with gaps
** a comment
*Part, name=PART-1
*Node, nset=ALL
10, -1., 0., 0.
20,  0., 0., 0.
30,  0., 1., 0.
40,  0., 0., 1.
50,  1.
*Element, type=C3D4, elset=SOLID
1, 20, 30, 40, 50
2, 20, 40, 30, 10
*Nset, nset="Slope", internal
30, 40, 50
*Nset, nset=Even, generate
10, 40, 10
*Elset, elset=_Front_S3, internal, instance=PART-1-1
 1,
*Elset, elset=Pair
 1, 2
*Elset, elset=Nested
 Pair
*Element, type=S3, elset=Skin
7, 20, 30, 50
*Surface, type=ELEMENT, name=Front
_Front_S3, S3
*Surface, type=ELEMENT, name=Direct
1, S4
Nested, S2
*Surface, type=NODE, name=ByNode
Slope,
*End Part
*Material, name=steel
*Elastic
210000., 0.3
"""


def test_abaqus_sets_and_surfaces(tmp_path):
    """Faces by the Abaqus manual: S1 = 1 2 3, S2 = 1 4 2, S3 = 2 4 3, S4 = 3 4 1 of a cell."""
    path = tmp_path / "part.inp"
    path.write_text(DECK)
    mesh = read_mesh(path)
    label = {x: k for k, x in enumerate((10, 20, 30, 40, 50))}

    def facets(*triples):
        return {frozenset(label[x] for x in triple) for triple in triples}

    expected = {
        "Front": facets((30, 50, 40)),
        "Direct": facets((40, 50, 20), (20, 50, 30), (20, 10, 40)),
        "ByNode": facets((30, 40, 50)),
        "Slope": facets((30, 40, 50)),
        "Even": facets((10, 20, 30), (10, 20, 40), (10, 30, 40)),
        "Skin": facets((20, 30, 50)),
        "ALL": facets_as_set(mesh.boundary),
    }
    assert {name: facets_as_set(f) for name, f in mesh.patches.items()} == expected
    assert mesh.volumes.sum() == pytest.approx(2 / 6)
    assert mesh.points[label[50]].tolist() == [1, 0, 0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("1, 20, 30, 40, 50", "1, 20, 30, 40, 60"), "names node 60, which"),
        (("C3D4", "C3D8R"), "10 numbers do not make rows of 9"),
        (("C3D4", "C3D27"), "10 numbers do not make rows of 28"),
        (("C3D4", "B31"), "holds no tetrahedra"),
        (("*Part, name=PART-1", "*Part, name=A\n*Part, name=B"), "holds 2 parts"),
        (("20,  0., 0., 0.", "20, 0, 0, 0, 30, 0, 1, 0, 0"), "line 5: .NODE .* more than a label"),
        (("20,  0., 0., 0.", "20,  0., here, 0."), "line 5: .NODE does not read"),
        (("20,  0., 0., 0.", "2e1,  0., 0., 0."), "whole numbers from 1 on; got '2e1'"),
        (("20,  0., 0., 0.", "10,  0., 0., 0."), "node 10 is given twice at different places"),
        (("2, 20, 40, 30, 10", "1, 20, 40, 30, 10"), "element 1 is given twice with different"),
        (("7, 20, 30, 50", "1, 20, 30, 50"), "element 1 is given twice with different"),
        (
            ("*Heading", "*Include, input=other.inc"),
            "line 1: the file of .INCLUDE .* does not exist",
        ),
        (("*Heading", "*Include, input=part.inp"), "includes itself"),
        (("*Heading", "*Include"), "line 1: the file of .INCLUDE .* is a folder"),
        (("*Heading", "*Ngen\n10, 20"), "line 1: .NGEN does not read .it is not followed"),
        (("10, 40, 10", "10"), "expected first, last and step; got '10'"),
        ((" Pair\n", " Pear\n"), "names the element set 'Pear', which the deck does not have"),
        (("*Heading", "*Part, name=part-1\n*End Part"), "the name 'PART-1' is missing or taken"),
        (("20,  0., 0., 0.", "20,  0., nan, 0."), "NaN or infinity"),
    ],
)
def test_bad_abaqus_decks(tmp_path, change, message):
    path = tmp_path / "part.inp"
    path.write_text(DECK.replace(*change))
    with pytest.raises(InputError, match=message) as caught:
        read_mesh(path)
    assert "part.inp" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("twice", ["", "*Element, type=C3D4\n" + CELLS + "\n"])
def test_sets_of_part_and_assembly_are_apart(tmp_path, twice):
    """As Abaqus/CAE writes them: Set-1 of the part is the part, that of the assembly its end."""
    text = PART + twice + "*Nset, nset=Set-1, generate\n1, 8, 1\n*Nset, nset=Foot\n" + LEFT + "\n"
    text += f"{ONE}*Nset, nset=Set-1, instance=P-1\n{LEFT}\n"
    text += "*Nset, nset=Again\nP-1.Foot\n*Nset, nset=Nodes\n"
    text += ", ".join(f"P-1.{label}" for label in LEFT.split(", "))
    text += f"\nP-1.0, P-1.{'9' * 20}\n*Nset, nset=Inner"
    text += ", instance=P-1\nFoot\n*Surface, type=NODE, name=Face\nP-1.Foot,\n*End Assembly\n"
    mesh = reading(tmp_path, text)
    left, skin = facets_as_set(Plane("x", "min")(mesh)), facets_as_set(mesh.boundary)
    assert (len(left), len(skin)) == (2, 12)
    expected = dict.fromkeys(("Set-1", "Foot", "Again", "Nodes", "Inner", "Face"), left)
    found = {name: facets_as_set(facets) for name, facets in mesh.patches.items()}
    assert found == {**expected, "P-1.Set-1": skin}


def test_every_instance_is_placed_with_its_sets(tmp_path):
    """Abaqus translates first; then (12, 0, 0) turns about z through (10, 0) to (10, 2, 0)."""
    text = f"{PART}*Nset, nset=End\n{LEFT}\n{ONE}*Instance, name=P-2, part=p\n10., 0.\n"
    text += "10., 0., 0., 10., 0., 1., 90.\n*Surface, name=Top\nEall, S1\n*End Instance\n"
    text += f"*Node\n1, 7., 7., 7.\n*Nset, nset=RP\n1\n*Nset, nset=Held, instance=P-2\n{LEFT}\n"
    with pytest.warns(UserWarning, match="falls into 2 separate") as said:
        mesh = reading(tmp_path, text)
    assert any("patches without a facet on the boundary: RP" in str(w.message) for w in said)
    assert mesh.volumes.sum() == pytest.approx(4.0)
    np.testing.assert_allclose(mesh.points[:8], MESH.points)
    x, y, z = MESH.points.T
    np.testing.assert_allclose(mesh.points[8:], np.stack([10.0 - y, x, z], 1), atol=1e-14)
    first, second = (
        {frozenset(k + n for k in facet) for facet in facets_as_set(MESH.patches["x_min"])}
        for n in (0, 8)
    )
    assert facets_as_set(mesh.patches["P-1.End"]) == first
    assert facets_as_set(mesh.patches["P-2.End"]) == facets_as_set(mesh.patches["Held"]) == second
    assert mesh.patches["Top"].min() >= 8


def test_surfaces_of_the_assembly_are_faces_of_instances(tmp_path):
    """As Abaqus/CAE writes them; face S3 of a cell has its corners 2, 4 and 3."""
    text = PART + ONE + "*Instance, name=P-2, part=P\n9.\n*End Instance\n"
    for k in (1, 2):
        text += f"*Elset, elset=_Surf_S3, internal, instance=P-{k}\n 1, 2, 3, 4, 5, 6\n"
    text += "*Surface, type=ELEMENT, name=Surf\n_Surf_S3, S3\n*End Assembly\n"
    with pytest.warns(UserWarning, match="falls into 2 separate"):
        mesh = reading(tmp_path, text)
    faces = {frozenset(cell) for cell in MESH.cells[:, [1, 3, 2]].tolist()}
    faces &= facets_as_set(MESH.boundary)
    assert len(faces) > 0
    both = faces | {frozenset(node + 8 for node in face) for face in faces}
    assert facets_as_set(mesh.patches["Surf"]) == both


def test_only_instances_are_in_the_model(tmp_path):
    other = "*Part, name=Spare\n*Node\n1, 0, 0, 0\n*End Part\n"
    with pytest.warns(UserWarning, match="parts without an instance are left out: Spare"):
        assert len(reading(tmp_path, other + PART + ONE).points) == 8
    for wrong, said in (
        (PART + ONE.replace("part=P", "part=Q"), "is of part 'Q', which the deck does not have"),
        (PART + ONE.replace("*End I", "1., 2., 3., 4.\n*End I"), "expected 3 or 7 finite numbers"),
        (PART + ONE.replace("*End I", "0, 0, 0, 0, 0, 0, 9\n*End I"), "has no length"),
        (PART + ONE + "*Nset, nset=A, instance=P-3\n1\n", "is of instance 'P-3', which"),
        (PART + ONE.replace(", part=P", ""), "names no part"),
    ):
        with pytest.raises(InputError, match=said):
            reading(tmp_path, wrong)


def test_one_name_for_sets_of_several_kinds(tmp_path):
    left = f"*Nset, nset=Fix\n{LEFT}\n"
    mesh = reading(tmp_path, MESHED + left + "*Elset, elset=FIX\n1, 2\n")
    assert facets_as_set(mesh.patches["Fix"]) == facets_as_set(MESH.patches["x_min"])
    assert list(mesh.patches) == ["Fix"]
    text = f"{MESHED}{left}*Surface, type=NODE, name=FIX\nFix,\n"
    assert list(reading(tmp_path, text).patches) == ["Fix"]
    said = "the node set 'Fix' differs from the surface of that name: it is patch .Fix .node set"
    with pytest.warns(UserWarning, match=said):
        mesh = reading(tmp_path, f"{MESHED}{left}*Surface, name=FIX\nEall,\n")
    assert facets_as_set(mesh.patches["Fix"]) == facets_as_set(mesh.boundary)
    assert facets_as_set(mesh.patches["Fix (node set)"]) == facets_as_set(MESH.patches["x_min"])


def test_sets_of_elements_and_free_surfaces(tmp_path):
    """Of the faces of a cell those on the boundary count. Unions are not read, but named."""
    text = f"{MESHED}*Nset, nset=All, elset=Eall\n*Surface, name=Skin\nEall,\n"
    text += "*Surface, name=One\n1,\n*Surface, name=Both, combine=union\nSkin, One\n"
    with pytest.warns(UserWarning, match="patches without a facet on the boundary: Both"):
        mesh = reading(tmp_path, text)
    assert facets_as_set(mesh.patches["All"]) == facets_as_set(MESH.boundary)
    assert facets_as_set(mesh.patches["Skin"]) == facets_as_set(MESH.boundary)
    faces = map(frozenset, itertools.combinations(MESH.cells[0].tolist(), 3))
    assert facets_as_set(mesh.patches["One"]) == set(faces) & facets_as_set(MESH.boundary)


@pytest.mark.filterwarnings("ignore:.* cells repeated another")
@pytest.mark.parametrize("labels", [CELLS, "\n".join(f"9{row}" for row in CELLS.split("\n"))])
def test_elements_that_are_written_twice_keep_their_patches(tmp_path, labels):
    text = f"{MESHED}*Element, type=C3D4\n{labels}\n*Nset, nset=Fix\n{LEFT}\n"
    mesh = reading(tmp_path, text)
    assert facets_as_set(mesh.patches["Fix"]) == facets_as_set(MESH.patches["x_min"])


@pytest.mark.parametrize(
    ("nodes", "files"),
    [
        ("*NODE\n1\n2, 2.0D+01\n3, , 1.d1,\n4, ,  , 5", {}),
        ("*Node\n1,0,0,0,1,0,0\n2,20,0,0,1,0,0\n3,0,10,0,0,0,1\n4,0,0,5,0,0,1", {}),
        ("*NODE, INPUT=a.txt", {"a.txt": "1\n2, 20\n3, 0, 10\n4, 0, 0, 5\n"}),
        (
            "*INCLUDE, INPUT=a.txt",
            {"a.txt": "*NODE\n1\n2, 20\n*INCLUDE,INPUT=b", "b": "3,,10\n4,,,5"},
        ),
        ("*NODE\n1\n*INCLUDE,\nINPUT=b\n4,,,5", {"b": "2, 20\n3, 0, 10\n"}),
        ("*NODE\n1\n2, 20\n3, 0, 10\n4, 0, 0, 5\n*NODE\n2, 20", {}),
    ],
)
def test_nodes_as_decks_may_write_them(tmp_path, nodes, files):
    mesh = reading(tmp_path, f"{nodes}\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n", **files)
    assert mesh.points.tolist() == [[0, 0, 0], [20, 0, 0], [0, 10, 0], [0, 0, 5]]
    assert mesh.volumes.sum() == pytest.approx(20.0 * 10.0 * 5.0 / 6.0)
