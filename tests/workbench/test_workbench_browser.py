"""The workbench as a person has it: a real browser, clicks, and a look at what comes of them."""

import contextlib
import io
import os
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from browsers import NAMELESS, started

from benchmarks.clicking import View, pixel
from ccfem.body.files.surface import write_stl
from ccfem.body.mesh.box import box_mesh
from ccfem.cases.part_editing import valued
from ccfem.workbench.bench import Bench

EVIL = "<img src=http://127.0.0.1:9/x onerror='window.broken=1'>"
BY_HAND = f"""\
# A bar, by hand.
title = "{EVIL}"
surface = "bar.stl"
edge_length = 3.0
material = "pla"
layers = 2

[patches.plane_minus_x]
rule = "face"
at = [0.0, 10.0, 2.0]
normal = "-x"

[patches.plane_x]
rule = "face"
at = [60.0, 10.0, 2.0]
normal = "x"

[[supports]]
patch = "plane_minus_x"

[[loads.pull]]
kind = "force"
patch = "plane_x"
vector = [200.0, 0.0, 0.0]
"""


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    """A bar in a folder, the page of a workbench there, and visits to it."""
    pytest.importorskip("viser", reason="viser is not installed: pip install ccfem[ui]")
    pytest.importorskip("gmsh", reason="gmsh is not installed: pip install ccfem[cad]")
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    from ccfem.workbench.page import Page

    folder = tmp_path_factory.mktemp("work")
    mesh = box_mesh((60.0, 20.0, 4.0), (1, 1, 1))
    write_stl(folder / "bar.stl", mesh.points, mesh.boundary)
    (folder / "hand.toml").write_text(BY_HAND)
    bench = Bench(folder)
    bench.open("bar.stl")
    with sync_api.sync_playwright() as program:
        browser = started(program)
        page = Page(bench)
        said, asked = [], []

        def visit(width=1000, height=640):
            tab = browser.new_context(viewport={"width": width, "height": height}).new_page()
            tab.on("pageerror", lambda error: said.append(str(error)))
            tab.on("request", lambda one: asked.append(one.url))
            tab.goto(page.link)
            tab.wait_for_selector("canvas", timeout=60_000)
            tab.get_by_role("heading", name="Check").wait_for(timeout=30_000)
            for _ in range(200):
                if page.server.get_clients():
                    break
                tab.wait_for_timeout(20)
            tab.wait_for_timeout(300)
            return View(page, tab)

        first = visit()
        yield SimpleNamespace(
            page=page, bench=bench, visit=visit, first=first, said=said, asked=asked
        )
        page.close()
        browser.close()


def numbers(bench):
    """Face numbers of the bar by their normals."""
    return {
        face.along: number
        for number, face in zip(bench.listing.numbers, bench.listing.faces, strict=True)
    }


def wait(view, until, seconds=60):
    for _ in range(int(seconds * 20)):
        if until():
            return
        view.tab.wait_for_timeout(50)
    raise AssertionError("that does not come")


def test_from_a_body_to_a_part_file_by_clicks_alone(work):
    view, bench, faces = work.first, work.bench, numbers(work.bench)
    tab = view.tab
    tab.get_by_text("a part needs a support").wait_for(timeout=5000)
    view.click_face(faces["-x"])
    tab.get_by_text("1 face, 80 mm²").wait_for(timeout=5000)
    view.click_face(faces["z"], "Shift")
    assert work.page.chosen == [faces["-x"], faces["z"]]
    view.click_face(faces["z"], "Shift")
    view.button("Hold")
    # What is hidden in the picture is chosen from the list.
    tab.get_by_label("Face", exact=True).click()
    tab.get_by_role("option", name=f"{faces['x']}: plane, normal x").click()
    tab.get_by_label("Force, N", exact=True).fill("200")
    tab.get_by_label("Load case").fill("pull")
    view.settle()
    view.button("Add load")
    view.choose_tab("Print")
    tab.get_by_label("Layers of fibre").fill("2")
    tab.get_by_label("Edge of cells, mm").fill("3")
    wait(view, lambda: bench.content.get("edge_length") == 3.0 and bench.content.get("layers") == 2)
    wanted = tomllib.loads(BY_HAND)
    del wanted["title"]
    assert tomllib.loads(bench.text) == wanted
    wait(view, lambda: work.page.drawn.is_set() and work.page.checked)
    assert not [line for kind, line in work.page.said if kind == "mistake"]
    assert tab.evaluate(NAMELESS) == 0


TYPE = """(fields) => { for (const [label, text] of fields) {
    const input = document.querySelector(`[aria-label="${label}"]`)
      || [...document.querySelectorAll("label")].find((each) => each.textContent === label).control;
    const put = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
    put.call(input, text);
    input.dispatchEvent(new Event("input", { bubbles: true }));
} }"""
"""Types in fields, one after the other without a moment between."""


def test_what_is_typed_in_one_moment_all_arrives(work):
    view, loads = work.first, work.page.loads
    view.choose_tab("Loads")
    view.tab.evaluate(TYPE, [["Load case", "a"], ["Force, N", "70.5"], ["Load case", "pull"]])
    view.settle()
    assert loads.vector.value[0] == 70.5
    assert loads.case.value == "pull"
    # With a comma, too; and what is left empty is as it was before.
    force = view.tab.get_by_label("Force, N", exact=True).first
    for keys, wanted in (("80,25", 80.25), ("", 80.25)):
        force.press("Control+a")
        force.press("Delete")
        force.press_sequentially(keys)
        force.press("Tab")
        view.settle()
        assert loads.vector.value[0] == wanted
        assert force.input_value() == "80.25"


def drag(view, at, to):
    """Drag from one pixel to another with the mouse."""
    view.tab.mouse.move(*at)
    view.tab.wait_for_timeout(200)
    view.tab.mouse.down()
    view.tab.mouse.move(0.5 * (at[0] + to[0]), 0.5 * (at[1] + to[1]), steps=3)
    view.tab.mouse.move(*to, steps=3)
    view.tab.wait_for_timeout(200)
    view.tab.mouse.up()


def test_an_arrow_is_dragged_and_undone(work):
    view, bench = work.first, work.bench
    before = bench.text
    ball = next(handle for handle in work.page._drawn if handle.name.endswith("_ball"))
    start = np.array(ball.position)
    at, to = pixel(view, start), pixel(view, start + np.array([-12.0, 0.0, 12.0]))
    drag(view, at, to)
    wait(view, lambda: bench.text != before, 10)
    vector = np.array(bench.content["loads"]["pull"][0]["vector"])
    assert np.linalg.norm(vector) == pytest.approx(200.0, rel=1e-3)
    assert vector[2] > 10.0
    view.button("Undo")
    assert bench.text == before
    view.button("Redo")
    assert bench.text != before
    view.button("Undo")


def test_the_bed_is_dragged_round_the_part(work):
    view, bench, before = work.first, work.bench, work.bench.text
    rim = next(handle for handle in work.page._drawn if handle.name == "/body/bed_rim")
    corners = np.asarray(rim.vertices)
    # Its front side, between the outer and the inner edge.
    sides = 0.25 * (
        corners[:4] + np.roll(corners[:4], -1, 0) + corners[4:] + np.roll(corners[4:], -1, 0)
    )
    camera = np.asarray(next(iter(work.page.server.get_clients().values())).camera.position)
    start = min(sides, key=lambda place: np.linalg.norm(place - camera))
    at, to = pixel(view, start), pixel(view, start + np.array([0.0, 0.0, 60.0]))
    drag(view, at, to)
    wait(view, lambda: "build" in bench.content, 10)
    view.button("Undo")
    assert bench.text == before


def alive(group):
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def ticked(view, wanted):
    """Tick one strategy alone."""
    view.choose_tab("Compare")
    for name, tick in view.page.compare.ticks.items():
        if tick.value != (name == wanted) and (name == wanted or tick.value):
            view.tab.get_by_label(name, exact=True).click()
    view.settle()


def test_a_run_is_stopped_found_again_and_shown(work):
    view, bench, compare = work.first, work.bench, work.page.compare
    ticked(view, "zigzag")
    command = "ccfem compare results/bar.toml --strategies zigzag"
    view.tab.get_by_text(command).wait_for(timeout=5000)
    view.button("Compare")
    wait(view, lambda: compare.run and compare.run.state.step != "starting")
    assert compare.run.state.running, compare.run.state
    group = compare.run._process.pid
    view.button("Stop")
    wait(view, lambda: not compare.run.state.running)
    wait(view, lambda: not alive(group), 5)
    view.tab.get_by_text("stopped", exact=True).wait_for(timeout=5000)
    assert not (bench.results / "bar").exists()
    # A page that is closed leaves the run going; opened again it shows it.
    view.button("Compare")
    wait(view, lambda: compare.run.state.step != "starting")
    work.page.act(work.page.edit, valued(("layers",), 3)).result()
    view.tab.goto("about:blank")
    view.tab.goto(work.page.link.partition("?")[0])
    again = work.first
    again.choose_tab("Compare")
    wait(again, lambda: not compare.run.state.running, 120)
    again.settle()
    assert compare.run.state.code == 0, compare.run.state
    again.tab.get_by_text("stiffness ratio").wait_for(timeout=5000)
    again.tab.get_by_role("row", name="zigzag yes").wait_for(timeout=5000)
    assert "Layer 1" in again.tab.get_by_text("of the build direction").inner_text()
    again.tab.get_by_role("slider", name="Layer").press("ArrowLeft")
    again.tab.get_by_text("Layer 0, at 1.00 mm").wait_for(timeout=5000)
    drawn = np.asarray(again.page.server.scene.get_handle_by_name("/fibre_0_fibre").points)
    assert 1.0 == pytest.approx(drawn[..., 2].min()) == pytest.approx(drawn[..., 2].max())
    # What was changed meanwhile is said beside what was computed of the part before.
    old = again.tab.get_by_text("These results are of the part before it was changed.")
    old.wait_for(timeout=5000)
    again.button("Undo")
    old.wait_for(state="hidden", timeout=5000)
    # The part without fibre: its stress, and deformed.
    for name, said in (
        ("Stress", "von Mises stress, up to "),
        ("Deformed", "displacement, up to "),
    ):
        again.button(name)
        again.settle()
        scene = again.page.server.scene
        assert scene.get_handle_by_name("/surface_said").text.startswith(said)
        assert scene.get_handle_by_name("/fibre_0_fibre") is None
    # There is no print yet: that is said, and the part is shown.
    again.button("Print")
    why = "there is no print of zigzag to show: press “G-code of this strategy”"
    again.tab.get_by_text(why).wait_for(timeout=5000)
    assert work.page.view.value == "Part"
    assert work.page.body.visible
    again.button("Fibre")
    again.settle()
    assert again.page.server.scene.get_handle_by_name("/surface") is None
    link = again.tab.get_by_role("link", name="report.html").get_attribute("href")
    report = again.tab.request.get(work.page.link.partition("/?")[0] + link)
    assert "stiffness ratio" in report.text()
    assert report.headers["content-security-policy"].startswith("sandbox allow-scripts")
    with again.tab.expect_download() as download:
        again.tab.get_by_role("link", name="results.csv").click()
    assert download.value.path().read_bytes() == (bench.results / "bar/results.csv").read_bytes()


def test_the_same_by_hand_is_the_same_byte_for_byte(work):
    """The part file that was clicked, and one by hand of the same content, by the command line."""
    folder = work.bench.folder
    text = BY_HAND.replace(f'title = "{EVIL}"', 'name = "bar"')
    (folder / "hand.toml").write_text(text)
    command = [sys.executable, "-m", "ccfem", "compare", "hand.toml", "--strategies", "zigzag"]
    subprocess.run([*command, "--out", "by_hand"], cwd=folder, check=True, capture_output=True)
    for name in ("results.csv", "paths.vtp", "zigzag_waypoints.txt"):
        by_page = (work.bench.results / "bar" / name).read_bytes()
        assert by_page == (folder / "by_hand" / name).read_bytes(), name


DROP = """(bytes) => {
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File([new Uint8Array(bytes)], "dropped.stl"));
    for (const kind of ["dragover", "drop"]) document.querySelector("canvas").dispatchEvent(
        new DragEvent(kind, { dataTransfer, bubbles: true, cancelable: true }));
}"""


def bar_file(folder):
    return (folder / "bar.stl").read_bytes()


def test_two_visits_see_one_part_and_texts_of_files_are_texts(work, monkeypatch):
    (work.bench.folder / "hand.toml").write_text(BY_HAND)
    first, second = work.first, work.visit(390, 800)
    # A body that is dropped on the page is opened, and kept in results, whatever tab is shown.
    first.tab.evaluate(DROP, list(bar_file(work.bench.folder)))
    first.tab.get_by_role("heading", name="dropped", exact=True).wait_for(timeout=10_000)
    first.choose_tab("Part file")
    first.tab.get_by_label("In this folder").click()
    first.tab.get_by_role("option", name="hand.toml", exact=True).click()
    for view in (first, second):
        view.tab.get_by_role("heading", name=EVIL).wait_for(timeout=10_000)
        assert view.tab.evaluate("window.broken") is None
    # 390 px: nothing is cut off to the right.
    wide = "document.documentElement.scrollWidth - window.innerWidth"
    assert second.tab.evaluate(wide) <= 0
    # A file that is too large is one line, and the next one is opened, and kept in results.
    monkeypatch.setattr("ccfem.workbench.guard.UPLOAD_LIMIT", 1_000_000)
    bodies = {"large.stl": bytes(3_000_000), "up.stl": bar_file(work.bench.folder)}
    large, up = ({"name": k, "mimeType": "", "buffer": v} for k, v in bodies.items())
    first.tab.locator('input[type="file"]').set_input_files(files=[large])
    said = "large.stl has 3 MB; files of up to 1 MB can be uploaded: start ccfem open in its folder"
    first.tab.get_by_role("alert").filter(has_text=said).wait_for(timeout=10_000)
    first.tab.get_by_text("Uploading large.stl").wait_for(state="detached", timeout=10_000)
    assert not (work.bench.results / "uploads/large.stl").exists()
    assert work.bench.text == BY_HAND
    first.tab.locator('input[type="file"]').set_input_files(files=[up])
    first.tab.get_by_role("heading", name="up", exact=True).wait_for(timeout=10_000)
    assert (work.bench.results / "uploads/up.stl").exists()
    work.page.act(work.page.open, "hand.toml").result()
    # A file that is no body is one line, and changes nothing.
    (work.bench.folder / "wrong.stl").write_text("no body")
    work.page.act(work.page.file.show).result()
    first.tab.get_by_label("In this folder").click()
    first.tab.get_by_role("option", name="wrong.stl", exact=True).click()
    first.tab.get_by_role("alert").filter(has_text="wrong.stl").wait_for(timeout=10_000)
    assert work.bench.text == BY_HAND


def test_nothing_serious_is_found_by_axe(work):
    """On every tab: critical or serious findings of axe-core, which brings its own script."""
    axe = pytest.importorskip("axe_playwright_python", reason="axe-playwright-python is missing")
    script = Path(axe.__file__).with_name("axe.min.js").read_text(encoding="utf-8")
    view = work.first
    view.tab.evaluate(f"{script};0")
    work.page.act(setattr, work.page.compare.bar, "visible", True).result()  # as in a run
    for name in ("Loads", "Print", "Compare", "Part file"):
        view.choose_tab(name)
        view.tab.wait_for_timeout(400)  # names are given a moment after things are drawn
        found = view.tab.evaluate("axe.run().then((it) => it.violations)")
        grave = [it for it in found if it["impact"] in ("serious", "critical")]
        assert not grave, (name, grave)
        assert found  # it has looked: there are findings that do not count


def test_no_request_left_the_machine_and_nothing_went_wrong(work):
    host = work.page.link.partition("/?")[0]
    assert len(work.asked) > 5
    assert not [u for u in work.asked if not u.startswith((host, "data:", f"blob:{host}"))]
    assert work.said == []


@pytest.mark.skipif(os.name != "posix", reason="signals are of Unix")
def test_ctrl_c_ends_all(work, tmp_path):
    """The command prints a link, and ends in one line with no process left."""
    import signal

    command = [sys.executable, "-m", "ccfem", "open", "bar.stl", "--no-browser"]
    process = subprocess.Popen(
        command,
        cwd=work.bench.folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    with contextlib.closing(process.stdout or io.StringIO()) as said:
        assert said.readline().startswith("http://127.0.0.1:")
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=20)
    assert process.returncode == 130
    assert error == "ccfem: stopped by SIGINT\n"
    assert not alive(process.pid)
