"""Three parts from their STEP and STL files to G-code, in a real browser, by clicks alone."""

import pytest

from benchmarks.clicking import browser_path, seconds, to_gcode, visited

WANTED = {
    "l_bracket.step": {"kind": "bearing", "vector": [0.0, 0.0, 100.0]},
    "crane_hook.stl": {"kind": "bearing", "vector": [0.0, -500.0, 0.0]},
    "brake_lever.stl": {"kind": "force", "vector": [0.0, -60.0, 0.0]},
}


@pytest.fixture(scope="module")
def visit(tmp_path_factory):
    pytest.importorskip("viser", reason="viser is not installed: pip install ccfem[ui]")
    pytest.importorskip("gmsh", reason="gmsh is not installed: pip install ccfem[cad]")
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    from benchmarks.studies.own_parts import main

    if not browser_path():
        pytest.skip("there is no browser: install chromium, or name one by CCFEM_CHROMIUM")
    folder = tmp_path_factory.mktemp("parts")
    main(folder)
    with sync_api.sync_playwright() as program:
        browser, person = visited(program, folder)
        yield person
        person.page.close()
        browser.close()


def test_an_example_of_the_keystroke_level_model_takes_as_long_as_published():
    """Card, Moran and Newell 1980: a word replaced in a display editor, 2 M + 8 K + 2 H + P, 6.2 s.

    Theirs is an average skilled typist, 0.2 s a key; the button of the mouse counts as one.
    """
    assert seconds("HPK" + "H" + "MK" + 5 * "K" + "MK", K=0.2) == pytest.approx(6.2)


@pytest.mark.slow
@pytest.mark.parametrize("file", WANTED)
def test_from_a_file_to_its_gcode(visit, file):
    load, bench, page = WANTED[file], visit.page.bench, visit.page
    to_gcode(visit, file)
    (case,) = bench.content["loads"].values()
    assert case[0] | load == case[0]
    (gcode,) = page.compare.results.folder.glob("*.gcode")
    assert "T1" in gcode.read_text()
    assert page.view.value == "Print"
    visit.tab.get_by_role("link", name=gcode.name).wait_for(timeout=10_000)
    assert visit.clicks <= 25
    assert seconds(visit.operators) <= 180.0


@pytest.mark.slow
def test_three_parts_are_printed_together(visit):
    """The last of them, with both others beside it, as they were set up above."""
    page = visit.page
    visit.go_to("Compare")
    visit.tab.get_by_text("With other parts on the bed").click()
    for name in ("results/l_bracket.toml", "results/crane_hook.toml"):
        visit.choose("Add a part", name)
    command = "ccfem bed results/brake_lever.toml results/l_bracket.toml results/crane_hook.toml"
    visit.tab.get_by_text(command).wait_for(timeout=10_000)
    visit.press("G-code of all parts in one file")
    assert page.compare.run.wait(240).written, page.compare.run.state
    visit.settle()
    assert page.view.value == "Print"
    assert page.compare.results.names == ["bed"]
    with visit.tab.expect_download() as download:
        visit.tab.get_by_role("link", name="bed.gcode").click()
    assert "T1" in download.value.path().read_text()
    old = "These results are of the part before it was changed."
    assert not visit.tab.get_by_text(old).is_visible()
    visit.tab.get_by_role("columnheader", name="part", exact=True).wait_for(timeout=10_000)
    for name in ("brake_lever", "l_bracket", "crane_hook"):
        visit.tab.get_by_role("row", name=name).wait_for(timeout=10_000)


@pytest.mark.slow
def test_a_part_is_solved_and_its_support_taken_away(visit):
    page = visit.page
    page.act(page.open, "results/l_bracket.toml").result()
    visit.press("Solve")
    assert page.compare.run.wait(120).written, page.compare.run.state
    visit.settle()
    assert page.view.value == "Stress"
    visit.tab.get_by_text("largest displacement").wait_for(timeout=10_000)
    visit.tab.get_by_label("Print support").click()
    visit.settle()
    visit.press("Support as STL")
    assert page.compare.run.wait(120).written, page.compare.run.state
    visit.settle()
    with visit.tab.expect_download() as download:
        visit.tab.get_by_role("link", name="l_bracket-support.stl").click()
    # What was solved can still be taken away.
    visit.tab.get_by_role("link", name="l_bracket-solved.vtu").wait_for(timeout=10_000)
    body = download.value.path().read_bytes()
    assert len(body) == 84 + 50 * int.from_bytes(body[80:84], "little") > 84
