"""What is typed reaches the part file, whatever is drawn, checked or undone meanwhile."""

import asyncio
import re
import shlex
import shutil
import threading
from contextlib import contextmanager
from functools import partial
from html import unescape
from types import SimpleNamespace

import numpy as np
import pytest

from ccfem.body.files import write_mesh
from ccfem.body.files.surface import write_stl
from ccfem.body.mesh.box import box_mesh
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.cases.part_editing import removed, valued
from ccfem.comparison.report.print_view import FILLS, KINDS, MOVES
from ccfem.comparison.report.report_views import PrintLayer
from ccfem.workbench import compare_tab
from ccfem.workbench.bench import Bench
from ccfem.workbench.child_run import RunState

HELD = """\
mesh = "bar.npz"
material = "pla"

[patches.end]
rule = "face"
at = [40.0, 5.0, 2.0]
normal = "x"

[[loads.pull]]
kind = "force"
patch = "end"
vector = [100.0, 0.0, 0.0]

[[loads.press]]
kind = "pressure"
patch = "end"
magnitude = 0.1
"""


class Visit:
    """What a browser does to a page: it shows what is sent, and sends what is typed on top of it.

    `late` holds back what is sent to it, `busy` what is done of what it asks for.
    """

    def __init__(self, page, monkeypatch):
        self.page, self.gui = page, page.server.gui
        self.screen, self.seen, self._way, self._late = {}, [], [], False
        queue = self.gui._websock_interface.queue_message

        def sent(message):
            queue(message)
            if "value" in getattr(message, "updates", {}) and message.excluded_self_client != 1:
                self._way.append((message.uuid, message.updates["value"]))
                if not self._late:
                    self.receive()

        monkeypatch.setattr(self.gui._websock_interface, "queue_message", sent)
        monkeypatch.setattr(self.gui, "_resolve_client", lambda client: object())

    def receive(self):
        while self._way:
            uuid, value = self._way.pop(0)
            self.seen.append(uuid)
            self.screen[uuid] = value

    def shown(self, field):
        return self.screen.get(field.handle._impl.uuid, field.handle._impl.value)

    def send(self, handle, value):
        from viser._messages import GuiUpdateMessage

        message = GuiUpdateMessage(handle._impl.uuid, {"value": value})
        update = self.gui._handle_gui_updates(1, message)
        asyncio.run_coroutine_threadsafe(update, self.gui._event_loop).result(10)

    def type(self, field, value, component=None):
        if component is not None:
            value = [value if k == component else x for k, x in enumerate(self.shown(field))]
        value = tuple(value) if isinstance(value, list) else value
        self.screen[field.handle._impl.uuid] = value
        self.send(field.handle, value)

    def click(self, name, place=0):
        handles = self.gui._gui_input_handle_from_uuid.values()
        named = [h for h in handles if getattr(h, "label", "") == name]
        self.send(named[place], True)

    @contextmanager
    def busy(self):
        going = threading.Event()
        self.page.act(going.wait)
        yield
        going.set()
        self.settle()

    @contextmanager
    def late(self):
        self._late = True
        yield
        self._late = False
        self.receive()

    def settle(self):
        self.page.act(lambda: None).result(10)


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    pytest.importorskip("viser", reason="viser is not installed: pip install ccfem[ui]")
    from ccfem.workbench.page import Page

    folder = tmp_path_factory.mktemp("typed")
    write_mesh(box_mesh((40.0, 10.0, 4.0), (2, 1, 1)), folder / "bar.npz")
    (folder / "bar.toml").write_text(HELD)
    page = Page(Bench(folder))
    yield page
    page.close()


@pytest.fixture
def page(served):
    served._newest.ask = lambda text: None  # the check is drawn where a test says so
    served.act(served.open, "bar.toml").result()
    return served


@pytest.fixture
def visit(page, monkeypatch):
    return Visit(page, monkeypatch)


def face(page, along):
    pairs = zip(page.bench.listing.numbers, page.bench.listing.faces, strict=True)
    return next(number for number, face in pairs if face.along == along)


def vectors(page, case):
    return [load["vector"] for load in page.bench.content["loads"][case]]


def row(page, title):
    return next(field for name, (_, field, _) in page.loads._rows.items() if name[0] == title)


def test_a_typed_force_survives_what_is_shown_before_it_is_added(page, visit):
    loads = page.loads
    page.act(page.loads.choose, face(page, "x"), False).result()
    assert loads.vector.value == (100.0, 0.0, 0.0)
    visit.type(loads.vector, 200.0, 0)
    visit.type(page.prints.field("layers"), 3)
    page.act(page.loads.choose, face(page, "y"), True)
    page.act(page.loads.choose, face(page, "y"), True)
    visit.settle()
    visit.type(loads.case, "more")
    visit.click("Add load")
    visit.settle()
    assert vectors(page, "more") == [[200.0, 0.0, 0.0]]
    page.act(page.loads.choose, face(page, "z"), False).result()
    assert loads.vector.value == (0.0, 0.0, 100.0)  # of the next load, proposed again


def test_a_force_typed_before_the_choice_was_seen_is_joined_with_its_direction(page, visit):
    visit.type(page.loads.vector, 0.0, 0)
    page.act(page.loads.choose, face(page, "z"), False).result()
    page.loads.vector.typed = False
    with visit.busy():
        page.act(page.loads.choose, face(page, "x"), False)
        for size in (2.0, 20.0, 200.0):
            visit.type(page.loads.vector, size, 0)
        visit.type(page.loads.case, "early")
        visit.click("Add load")
        visit.type(page.loads.vector, 300.0, 0)  # for the next
        visit.type(page.loads.case, "next")
    assert vectors(page, "early") == [[200.0, 0.0, 0.0]]
    assert visit.shown(page.loads.vector) == page.loads.vector.value == (300.0, 0.0, 0.0)


def test_digits_that_come_fast_are_never_overwritten_by_older_ones(page, visit):
    field = row(page, "pull: force on end")
    with visit.busy():
        for size in (7.0, 70.0, 70.5):
            visit.type(field, size, 0)
        page.act(page.show)
    assert vectors(page, "pull") == [[70.5, 0.0, 0.0]]
    assert visit.shown(field) == (70.5, 0.0, 0.0)
    assert field.handle._impl.uuid not in visit.seen
    assert field.handle.precision == 6  # or the point is not taken, and 70.5 is 705
    page.act(page.step, -1).result()
    assert vectors(page, "pull") == [[100.0, 0.0, 0.0]]


def test_what_crosses_on_the_way_ends_as_it_was_typed(page, visit):
    field = row(page, "press: pressure on end")
    visit.type(field, 0.7)
    visit.settle()
    with visit.late():
        page.act(page.step, -1).result()
        visit.type(field, 0.75)
        visit.settle()
    assert visit.shown(field) == 0.1  # the undone one came last ...
    page.act(page._heed, page.bench.text, (None, ())).result()
    assert visit.shown(field) == 0.75  # ... until all is quiet
    assert page.bench.content["loads"]["press"][0]["magnitude"] == 0.75


def test_rows_are_known_whatever_comes_and_goes(page, visit):
    field = row(page, "press: pressure on end")
    with visit.busy():
        visit.click("Remove")
        visit.click("Remove")
        visit.type(field, 0.5)
    assert page.bench.content["loads"] == {
        "press": [{"kind": "pressure", "patch": "end", "magnitude": 0.5}]
    }
    assert row(page, "press: pressure on end") is field
    with visit.busy():
        page.act(page.open, "bar.toml")
        visit.type(field, 0.9)  # in the part before
    assert page.bench.text == HELD


def test_a_value_that_is_refused_or_undone_is_shown_no_more(page, visit):
    layers = page.prints.field("layers")
    visit.type(layers, 5)
    visit.settle()
    page.act(page.step, -1).result()
    assert visit.shown(layers) == 12
    page.act(page.bench.edit, HELD.replace("material", "heights = [1.0]\nmaterial")).result()
    visit.type(layers, 5)
    visit.settle()
    assert "gives its layers by heights" in page.message.content
    assert visit.shown(layers) == 12
    assert page.bench.content["heights"] == [1.0]


def test_a_whole_number_is_whole_and_no_copies_are_one(page, visit):
    layers, copies = page.prints.field("layers"), page.prints.field("bed", "copies")
    visit.type(layers, 3.5)
    visit.settle()
    assert "Layers of fibre must be a whole number; got 3.5" in page.message.content
    assert visit.shown(layers) == 12
    for text, wanted in (("4", {"copies": 4}), ("", None), ("2x3", {"copies": "2x3"})):
        visit.type(copies, text)
        visit.settle()
        assert page.bench.content.get("bed") == wanted
    page.act(page.bench.edit, "layers = inf\n" + HELD).result()
    page.act(page.show).result()
    assert "layers = inf" in page.prints._said.content


def test_plastic_and_bed_are_set_beside_what_the_page_cannot_show(page, visit):
    by_hand = """
[plastic]
walls = 2.5      # a slip
seam = "corner"  # by hand

[bed]
turn = ["x=90", "z=30"]
copies = "2x3"
"""
    page.act(page.bench.edit, HELD + by_hand).result()
    page.act(page.show).result()
    fields = {row.keys[-1]: field for row, field in page.prints.fields.items()}
    assert not fields["walls"].handle.visible
    assert not fields["turn"].handle.visible
    assert "plastic.walls = 2.5; bed.turn = " in page.prints._said.content
    assert (fields["seam"].value, fields["copies"].value) == ("corner", "2x3")
    assert not fields["density"].handle.visible  # of a solid part
    steps = [
        ("infill", "gyroid", {"infill": "gyroid"}, {}),
        ("density", 0.35, {"density": 0.35}, {}),
        ("seam", "any", {"seam": None}, {}),
        ("copies", "4", {}, {"copies": 4}),
        ("centre", (120.0, 150.0), {}, {"centre": [120.0, 150.0]}),
        ("centre", (150.0, 150.0), {}, {"centre": None}),
    ]
    plastic = {"walls": 2.5, "seam": "corner"}
    bed = {"turn": ["x=90", "z=30"], "copies": "2x3"}
    for name, value, of_plastic, of_bed in steps:
        visit.type(fields[name], value)
        visit.settle()
        plastic = {k: v for k, v in (plastic | of_plastic).items() if v is not None}
        bed = {k: v for k, v in (bed | of_bed).items() if v is not None}
        assert page.bench.content["plastic"] == plastic
        assert page.bench.content["bed"] == bed
    assert fields["density"].handle.visible
    assert "# a slip" in page.bench.text
    for _ in steps[1:]:  # a field that is typed in twice is one step
        page.act(page.step, -1).result()
    assert page.bench.text == HELD + by_hand
    assert (fields["seam"].value, visit.shown(fields["copies"])) == ("corner", "2x3")


def test_a_turn_leaves_no_empty_table(page, visit):
    turn = page.prints.field("bed", "turn")
    visit.type(turn, 37.5)
    visit.settle()
    assert page.bench.content["bed"] == {"turn": "z=37.5"}
    visit.type(turn, 0.0)
    visit.settle()
    assert "bed" not in page.bench.content
    assert page.bench.content.keys() == {"mesh", "material", "patches", "loads"}


def test_a_face_that_is_clicked_lies_on_the_bed(page, visit):
    visit.click("Chosen face on the bed")
    visit.settle()
    assert "choose one plane face" in page.message.content
    page.act(page.loads.choose, face(page, "y"), False).result()
    visit.click("Chosen face on the bed")
    visit.settle()
    assert page.bench.content["build"] == "-y"
    assert page.prints.field("build").value == "-y"
    page.act(page.prints.lay, np.array([0.6, 0.0, 0.8])).result()
    assert page.bench.content["build"] == [0.6, 0.0, 0.8]
    page.act(page.bench.edit, HELD + '[bed]\nturn = "x=90"').result()
    page.act(page.show).result()
    page.act(page.prints.lay, np.array([0.0, 0.0, 1.0])).result()
    assert "take bed.turn out" in page.message.content


def test_a_check_that_ends_leaves_what_is_dragged_alone(page, monkeypatch):
    monkeypatch.setattr(page.server, "get_clients", lambda: {7: None})
    page._dragging, drawn = 7, page._drawn
    page.act(page._heed, page.bench.text, (None, ())).result()
    assert page._drawn is drawn
    page._dragging = 8  # one who has left
    page.act(page._heed, page.bench.text, (None, ())).result()
    assert page._drawn is not drawn


def dragged(page, visit, name, to, phase, start=(0.0, 0.0, 0.0)):
    handle = next(h for h in page._drawn if h.name == name)
    event = SimpleNamespace(start_position=start, end_position=to, phase=phase, client_id=7)
    asyncio.run(handle._impl.drag_cb[0].callback(event))
    visit.settle()
    return handle


def test_fibre_lies_in_a_box_that_is_dragged(page, visit):
    page.act(page.prints._regions, "In a box").result()
    region = {"rule": "box", "lower": [0.0, 0.0, 0.0], "upper": [40.0, 10.0, 2.0]}
    assert page.bench.content["fibre"] == {"regions": [region]}

    drag = partial(dragged, page, visit, "/body/box_0_1_ball")
    assert drag((30.0, 10.2, 3.0), "update").position == pytest.approx((30.0, 10.0, 3.0))
    assert page.bench.content["fibre"] == {"regions": [region]}
    drag((30.0, 10.2, 3.0), "end")
    assert page.bench.content["fibre"]["regions"][0]["upper"] == [30.0, 10.0, 3.0]
    lines = page.server.scene.get_handle_by_name("/body/box_0").points
    assert lines.max(axis=(0, 1)) == pytest.approx([30.0, 10.0, 3.0])
    page.act(page.step, -1).result()
    assert page.bench.content["fibre"] == {"regions": [region]}


def test_the_bed_is_dragged_round_the_part_by_its_rim(page, visit):
    drag = partial(dragged, page, visit, "/body/bed_rim", start=(20.0, 5.0, -40.0))
    drag((80.0, 5.0, 2.0), "update")
    assert "build" not in page.bench.content
    (x,) = set(page.server.scene.get_handle_by_name("/body/bed").points[..., 0].ravel().tolist())
    assert x == pytest.approx(40.0)
    # From below the part to its right: it is built to the left, on its right end.
    drag((80.0, 5.0, 2.0), "end")
    assert page.bench.content["build"] == "-x"


def test_weight_has_an_arrow_that_turns_it(page, visit):
    page.act(page.loads.kind.put, "weight of the whole part").result()
    page.act(page.loads.case.put, "load").result()
    page.act(page.loads._load).result()
    said = [h.text for h in page._drawn if h.name.endswith("_said")]
    assert "9.81 m/s²" in said
    name = next(h.name for h in page._drawn if getattr(h, "text", "") == "9.81 m/s²")
    ball = name.replace("_said", "_ball")
    # Its free end is dragged to the left of the middle of the part.
    dragged(page, visit, ball, (-60.0, 5.0, 2.0), "end")
    (weight,) = page.bench.content["loads"]["load"]
    assert weight == {"kind": "gravity", "acceleration": [-9.81, 0.0, 0.0]}
    visit.type(row(page, "load: gravity"), -1.62, 2)
    visit.settle()
    assert page.bench.content["loads"]["load"][0]["acceleration"] == [-9.81, 0.0, -1.62]


WHOLE = """
[[supports]]
patch = "end"

[[loads.spin]]
kind = "centrifugal"
speed = 20.0
point = [0.0, 5.0, 0.0]
axis = [0.0, 0.0, 1.0]

[[loads.heat]]
kind = "temperature"
change = 40.0
"""


def test_what_is_written_by_hand_has_a_symbol_and_so_has_support(page, visit):
    """A bar of 40 x 10 x 4 mm, of which all but a stem of 10 x 10 x 2 mm is 2 mm thick."""
    box = box_mesh((40.0, 10.0, 4.0), (8, 2, 2))
    middles = box.points[box.corners].mean(axis=1)
    kept = (middles[:, 2] > 2.0) | (middles[:, 0] < 10.0)
    write_mesh(TetMesh(box.points, box.cells[kept]), page.bench.folder / "bent.npz")
    text = HELD.replace("bar.npz", "bent.npz").replace('"force"', '"moment"') + WHOLE
    (page.bench.folder / "bent.toml").write_text(text)
    page.act(page.open, "bent.toml").result()
    drawn = {h.name: h for h in page._drawn}
    said = [h.text for h in page._drawn if h.name.endswith("_said")]
    assert said == ["100 N mm", "20 rad/s", "40 K", "build direction"]
    assert [name for name in drawn if name.endswith("_ball")] == ["/body/build_ball"]
    # The support, the moment, the pressure, the spin on its axis, and the heat.
    turning = [k for k in range(5) if f"/body/symbol_{k}_head" in drawn]
    assert turning == [1, 3]
    assert drawn["/body/symbol_3_said"].position[:2] == pytest.approx((0.0, 5.0))
    visit.type(row(page, "spin: centrifugal"), 30.0)
    visit.settle()
    assert page.bench.content["loads"]["spin"][0]["speed"] == 30.0
    # Support is drawn when the part as it is now has been checked: 30 x 10 x 2 mm.
    visit.type(page.compare.support, True)
    visit.settle()
    assert "/body/support" not in {h.name for h in page._drawn}
    page.act(page._heed, page.bench.text, page.bench.check(page.bench.text)).result()
    (support,) = [h for h in page._drawn if h.name == "/body/support"]
    low, high = support.vertices.min(axis=0), support.vertices.max(axis=0)
    np.testing.assert_allclose([low, high], [[10, 0, 0], [40, 10, 2]], atol=1e-6)
    # Below curved layers it is drawn when a run has found it, of the part as it is.
    page.act(page.edit, valued(("slicing",), {"method": "spatial"})).result()
    page.act(page._heed, page.bench.text, page.bench.check(page.bench.text)).result()
    assert "/body/support" not in {h.name for h in page._drawn}
    body = page.bench.results / "bent-support.stl"
    write_stl(body, box.points, box.boundary)
    ended = (RunState(code=0), body, "Part", page.bench.opened, page.bench.text)
    page.act(page.compare._heed, *ended).result()
    (support,) = [h for h in page._drawn if h.name == "/body/support"]
    np.testing.assert_allclose(np.ptp(support.vertices, axis=0), [40, 10, 4], atol=1e-6)
    visit.type(page.compare.support, False)
    visit.settle()
    assert "/body/support" not in {h.name for h in page._drawn}


def test_load_cases_are_tabs_and_lines_stand_beside_what_they_mean(page):
    assert set(page.loads._tabs) == {"pull", "press"}
    said = (("warning", "patch 'end' is <odd>"), ("not printable", "the part is larger"))
    page.act(page._heed, page.bench.text, (None, said)).result()
    beside = [html.content for _, _, html in page.loads._rows.values()]
    assert len(beside) == 2
    assert all("is &lt;odd&gt;" in text and "larger" not in text for text in beside)
    assert "larger" in page.prints._lines.content
    page.act(page.edit, removed(("loads", "press", 0))).result()
    assert list(page.loads._tabs) == ["pull"]


def test_a_print_is_shown_up_to_a_layer(page, visit, monkeypatch):
    """Three layers, each with a contour, what fills it, and travel."""
    kinds = np.array([KINDS.index("contour"), FILLS, MOVES])
    ends = np.arange(18.0).reshape(3, 2, 3)
    layers = [PrintLayer(f"Layer {k + 1} of 3", ends + k, kinds) for k in range(3)]
    results = SimpleNamespace(print_layers=lambda name: layers, layers=layers)
    monkeypatch.setattr(page.compare, "results", results)
    scene, compare = page.server.scene, page.compare

    def shown():
        seen = [scene.get_handle_by_name(f"/print_{k}").visible for k in range(3)]
        return seen, len(scene.get_handle_by_name("/print_top").points)

    page.act(page.show_view, "Print").result()
    assert shown() == ([True] * 3, 1)  # of the top one also what fills it
    visit.send(compare.top, 1)
    visit.settle()
    assert shown() == ([True, True, False], 1)
    visit.send(compare.alone, True)
    visit.send(compare.travel, True)
    visit.settle()
    assert shown() == ([False, True, False], 2)
    assert "Layer 2 of 3" in compare._layer_said.content
    assert not compare.layer.visible
    page.act(page.show_view, "Part").result()
    assert scene.get_handle_by_name("/print_0") is None


def test_each_button_runs_the_command_that_it_shows(page, visit, monkeypatch):
    compare, ran = page.compare, []

    class Run:
        state = RunState(code=1)

        def __init__(self, arguments, *more):
            ran.append(["ccfem", *arguments])

        def stop(self):
            pass

    monkeypatch.setattr(compare_tab, "ChildRun", Run)
    for name, tick in compare.ticks.items():
        visit.type(tick, name == "zigzag")
    visit.type(compare.support, True)
    (page.bench.folder / "two parts.toml").write_text(HELD)
    page.act(compare._add_part, "two parts.toml").result()
    page.act(compare._add_part, "bar.toml").result()
    shown = re.findall("<p>(.*?): <code>(.*?)</code></p>", compare._command.content)
    assert [name for name, _ in shown] == list(compare.starts)
    shutil.rmtree(page.bench.results, ignore_errors=True)  # as before anything was changed
    for name, _ in shown:
        visit.click(name)
        visit.settle()
    assert page.bench.results.is_dir()
    assert ran == [shlex.split(unescape(command)) for _, command in shown]
    solve, comparison, plan, bed, support = ran
    assert solve[1:] == [
        *("solve", "bar.toml", "--load-case", "pull", "--out", "results/bar-solved.vtu")
    ]
    assert comparison[1:] == ["compare", "bar.toml", "--strategies", "zigzag"]
    assert plan[1:] == ["plan", "bar.toml", "--strategy", "zigzag", "--gcode", "--support"]
    assert bed[1:5] == ["bed", "bar.toml", "two parts.toml", "bar.toml"]
    assert bed[5:] == ["--strategy", "zigzag", "--support", "--out", "results/bar-bed"]
    assert support[1:] == ["support", "bar.toml", "--out", "results/bar-support.stl"]
    # Nothing outside the folder is printed beside it, or written.
    page.act(page.edit, f'name = "../../x"\n{HELD}').result()
    visit.click("Solve")
    visit.settle()
    assert "lies outside" in page.message.content
    page.act(page.step, -1).result()
    visit.type(compare.others, "../else.toml")
    visit.click("G-code of all parts in one file")
    visit.settle()
    assert "../else.toml" in page.message.content
    assert len(ran) == 5
