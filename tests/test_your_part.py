"""The page on parts of your own is true: its part files read, wrong guesses get their cure."""

import re
from pathlib import Path

import numpy as np
import pytest

import ccfem
from ccfem.body.isolated.process import ChildError, in_own_process
from ccfem.body.meshing import mesh_body, read_cad

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "how_to" / "your_part.md").read_text()
READ = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.S)
BRACKET, HOOK, LEVER = (re.sub(r"edge_length = \S+", "edge_length = 4.0", text) for text in READ)


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """The three parts, where Gmsh works."""
    pytest.importorskip("gmsh")
    from benchmarks.studies.own_parts import main

    folder = tmp_path_factory.mktemp("parts")
    try:
        main(folder)
    except (AttributeError, OSError):
        pytest.skip("the library of Gmsh is missing")
    return folder


def checked(folder, text, *changes):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "part.toml"
    path.write_text(text)
    return ccfem.check(path)


def test_the_bracket_is_as_drawn(parts):
    found = checked(parts, BRACKET)
    assert (found.mistakes, found.warnings) == ((), ())
    rows = {row.name: row for row in found.patches}
    # Walls of holes: circumference times thickness; a polygon of 12 sides has 1.2 % less.
    assert rows["bolts"].area == pytest.approx(4 * 2 * np.pi * 2.75 * 6, rel=0.02)
    assert rows["bolts"].pieces == 4
    assert rows["eye"].area == pytest.approx(2 * np.pi * 5 * 6, rel=0.02)
    assert rows["eye"].centre == pytest.approx([3.0, 20.0, 35.0], abs=0.05)
    (load,) = found.loads
    assert load.resultant == pytest.approx([0.0, 0.0, 200.0])
    assert load.point[:2] == pytest.approx([3.0, 20.0], abs=0.05)


def test_wrong_guesses_on_the_bracket_are_named(parts):
    bolts = '[patches.bolts]\nrule = "holes"\nradius = 2.75\n'
    one = '[patches.bolts]\nrule = "cylinder"\npoint = [25, 10, 0]\naxis = "z"\nradius = 2.75\n'
    (line,) = checked(parts, BRACKET, (bolts, one)).warnings
    assert "'bolts' is one of 4 like walls" in line
    assert "by rule 'holes' with radius 2.75" in line
    beside = one.replace("[25, 10, 0]", "[27, 10, 0]").replace("radius = 2.75", "radius = 3")
    said = " ".join(checked(parts, BRACKET, (bolts, beside)).warnings)
    assert re.search(r"'bolts' takes \d+% of a wall of a hole of radius 2.75", said)
    box = '[patches.bolts]\nrule = "box"\nlower = [40, -1, -1]\nupper = [61, 41, 7]\n'
    said = " ".join(checked(parts, BRACKET, (bolts, box)).warnings)
    assert "its box takes facets of" in said
    assert "give the box a normal" in said
    loose = checked(parts, BRACKET, ('patch = "bolts"', 'patch = "bolts"\ncomponents = "z"'))
    assert any("is free to" in line for line in loose.mistakes)


def test_the_lever_is_as_drawn(parts):
    found = checked(parts, LEVER)
    assert (found.mistakes, found.warnings) == ((), ())
    rows = {row.name: row for row in found.patches}
    assert rows["pivot"].area == pytest.approx(2 * np.pi * 4 * 8, rel=0.02)
    assert rows["finger"].normal[1] > 0.9


def test_surfaces_are_meshed_the_same_every_time(parts, monkeypatch):
    found = checked(parts, HOOK)
    assert (found.mistakes, found.warnings) == ((), ())
    monkeypatch.setenv("CCFEM_CACHE", "")
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    again = checked(parts, HOOK)
    one, other = found.case.problem.mesh, again.case.problem.mesh
    assert np.array_equal(one.points, other.points)
    assert np.array_equal(one.cells, other.cells)


def test_the_volume_of_the_hook_is_that_of_its_surface(parts):
    from ccfem.body.files import read_surface

    mesh, (about,) = mesh_body(parts / "crane_hook.stl", 4.0)
    surface = read_surface(parts / "crane_hook.stl")
    assert mesh.volumes.sum() == pytest.approx(surface.volume, rel=0.01)
    told = float(re.search(r"volume ([\d.]+)%", about)[1])
    assert told == pytest.approx(100 * abs(mesh.volumes.sum() / surface.volume - 1.0), abs=0.006)


def test_faces_of_a_cad_file_are_numbered_as_listed(parts):
    cad = read_cad(parts / "l_bracket.step")
    mesh, _ = mesh_body(parts / "l_bracket.step", 4.0)
    assert len(cad.names) == 13
    for number in range(1, 14):
        facets = mesh.patches[f"face_{number}"]
        area, _ = mesh.facet_areas(facets)
        rows = cad.surface.triangles[cad.face == number]
        a, b, c = np.moveaxis(cad.surface.points[rows], 1, 0)
        listed = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
        assert area.sum() == pytest.approx(listed, rel=0.02)
    total = mesh.facet_areas(mesh.boundary)[0].sum()
    named = sum(mesh.facet_areas(facets)[0].sum() for facets in mesh.patches.values())
    assert named == pytest.approx(total)


def test_a_file_that_is_no_cad_file_is_one_line(parts, tmp_path):
    path = tmp_path / "junk.step"
    path.write_text("ISO-10303-21;\nnothing\n")
    with pytest.raises(ccfem.base.errors.InputError, match="export it again") as caught:
        mesh_body(path, 2.0)
    assert "\n" not in str(caught.value)


def test_a_surface_that_gmsh_cannot_fill_stops_in_its_own_process(parts, started_children):
    with pytest.raises((ChildError, ccfem.base.errors.InputError)):
        in_own_process(
            "gmsh_meshing:cad_volume", seconds=60.0, path="/none.step", size=1.0, scale=1.0
        )
