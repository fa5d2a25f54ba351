"""Three parts from their STEP and STL files to G-code, in a real browser, by clicks alone."""

import os

import pytest
from browsers import started

from benchmarks.clicking import View
from ccfem.workbench.bench import Bench


class Clicks(View):
    """A visit that counts: a click, a choice of two clicks, a number that is typed."""

    count = 0

    def face(self, number, *modifiers):
        self.count += 1
        self.click_face(number, *modifiers)

    def press(self, name):
        self.count += 1
        self.button(name)

    def go_to(self, tab):
        self.count += 1
        self.choose_tab(tab)

    def choose(self, label, option):
        self.count += 2
        self.tab.get_by_label(label, exact=True).click()
        self.tab.get_by_role("option", name=option, exact=True).click()
        self.settle()

    def type(self, label, text, place=0):
        self.count += 1
        field = self.tab.get_by_label(label, exact=True).nth(place)
        field.fill(text)
        self.settle()

    def tick_alone(self, name):
        for other, tick in self.page.compare.ticks.items():
            if tick.value != (other == name):
                self.count += 1
                self.tab.get_by_label(other, exact=True).click()
                self.settle()


def holes(bench, radius):
    pairs = zip(bench.listing.numbers, bench.listing.faces, strict=True)
    return [k for k, face in pairs if face.hollow and abs(face.radius - radius) < 0.1]


def bracket(visit, bench):
    """Bolted down at four holes, an eye pulled upwards."""
    visit.choose("Face", named(bench, holes(bench, 2.75)[0]))
    visit.press("Same radius")
    visit.press("Hold")
    visit.face(holes(bench, 5.0)[0])


def hook(visit, bench):
    """Hung from its eye, the bowl pulled down."""
    visit.choose("Face", named(bench, holes(bench, 6.0)[0]))
    visit.press("Hold")
    visit.choose("Face", named(bench, holes(bench, 18.0)[0]))
    visit.type("Force, N y", "-500")


def lever(visit, bench):
    """Held at pivot and cable, a finger on its long side."""
    for radius in (4.0, 2.5):
        visit.choose("Face", named(bench, holes(bench, radius)[0]))
    visit.press("Hold")
    pairs = zip(bench.listing.numbers, bench.listing.faces, strict=True)
    sides = [
        (face.area, k) for k, face in pairs if face.kind == "plane" and face.direction[1] > 0.9
    ]
    visit.choose("Face", named(bench, max(sides)[1]))
    visit.type("Force, N", "0")
    visit.type("Force, N y", "-60")


def named(bench, number):
    return f"{number}: {bench.listing.face(number).shape}"


WANTED = {
    "l_bracket.step": (bracket, {"kind": "bearing", "vector": [0.0, 0.0, 100.0]}),
    "crane_hook.stl": (hook, {"kind": "bearing", "vector": [0.0, -500.0, 0.0]}),
    "brake_lever.stl": (lever, {"kind": "force", "vector": [0.0, -60.0, 0.0]}),
}


@pytest.fixture(scope="module")
def visit(tmp_path_factory):
    pytest.importorskip("viser", reason="viser is not installed: pip install ccfem[ui]")
    pytest.importorskip("gmsh", reason="gmsh is not installed: pip install ccfem[cad]")
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    from benchmarks.studies.own_parts import main
    from ccfem.workbench.page import Page

    folder = tmp_path_factory.mktemp("parts")
    main(folder)
    with sync_api.sync_playwright() as program:
        browser = started(program)
        page = Page(Bench(folder))
        tab = browser.new_page(viewport={"width": 1100, "height": 700})
        tab.goto(page.link)
        tab.get_by_role("tab", name="Part file").wait_for(timeout=60_000)
        yield Clicks(page, tab)
        page.close()
        browser.close()


@pytest.mark.skipif(
    not os.environ.get("CCFEM_SLOW"), reason="takes a minute: set CCFEM_SLOW=1 to run it"
)
@pytest.mark.parametrize("file", WANTED)
def test_from_a_file_to_its_gcode(visit, file):
    set_up, load = WANTED[file]
    bench, page = visit.page.bench, visit.page
    visit.count = 0
    visit.go_to("Part file")
    visit.choose("In this folder", file)
    page.act(lambda: None).result(30)
    visit.tab.wait_for_timeout(1500)
    visit.go_to("Loads")
    set_up(visit, bench)
    visit.press("Add load")
    visit.go_to("Print")
    visit.type("Layers of fibre", "1")
    visit.type("Edge of cells, mm", "6")
    visit.go_to("Compare")
    visit.tick_alone("zigzag")
    visit.press("G-code of the ticked strategy")
    assert page.compare.run.wait(120).written, page.compare.run.state
    visit.settle()
    (case,) = bench.content["loads"].values()
    assert case[0] | load == case[0]
    (gcode,) = page.compare.results.folder.glob("*.gcode")
    assert "T1" in gcode.read_text()
    assert page.view.value == "Print"
    visit.tab.get_by_role("link", name=gcode.name).wait_for(timeout=10_000)
    assert visit.count <= 20


@pytest.mark.skipif(
    not os.environ.get("CCFEM_SLOW"), reason="takes a minute: set CCFEM_SLOW=1 to run it"
)
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


@pytest.mark.skipif(
    not os.environ.get("CCFEM_SLOW"), reason="takes a minute: set CCFEM_SLOW=1 to run it"
)
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
