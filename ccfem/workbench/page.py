"""The page: the part in space, a panel of tabs, and lines of what the check says.

All that a visit does is done by one thread, `Page.act`, one thing after the other: what is shown
is a function of the part file and of the run.
"""

import contextlib
import io
import threading
from collections.abc import Callable
from functools import partial
from typing import Any, Generic, TypeVar

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError
from ccfem.cases.inspection import Check
from ccfem.cases.inspection.acting import Entry, Name, entries
from ccfem.cases.inspection.patch_places import PatchPlace, patch_places
from ccfem.cases.part_editing import valued
from ccfem.comparison.plot.symbols import (
    arrow_outside,
    bed_under,
    borders,
    box_edges,
    face_meshes,
    heat_waves,
    pressing,
    swung,
    turning,
)
from ccfem.workbench.bench import Bench, Said
from ccfem.workbench.compare_tab import CompareTab
from ccfem.workbench.drawing import (
    MATT,
    boxes,
    draw_arrows,
    draw_label,
    draw_lines,
    draw_mesh,
    snapped,
    stretched,
    upward,
)
from ccfem.workbench.guard import Guard, Served, escaped, limit_uploads
from ccfem.workbench.loads_tab import LoadsTab
from ccfem.workbench.print_tab import PrintTab
from ccfem.workbench.tab import PART, VIEWS, FileTab, Tabbed, lines_of

_FACE, _CHOSEN = (203, 210, 216), (245, 190, 65)
_HELD, _LOADED, _BOTH = (120, 168, 214), (226, 142, 120), (170, 140, 190)
_EDGE, _LOAD, _SUPPORT, _BED = (70, 80, 92), (179, 38, 30), (0, 98, 155), (110, 120, 130)
_PRINTED = (214, 178, 94)
_RIM = 0.05
"""Width of the rim of the bed over its own half."""
Dragged = Callable[[FloatArray, FloatArray], None]
_MARKS = 10
"""Symbols on a patch."""


def _closed(corners: FloatArray) -> FloatArray:
    """Sides (k, 2, 3) of the loop of some corners."""
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


class Page(Tabbed):
    """The page of a bench, served on this machine.

    Parameters
    ----------
    port : int
        0 for any that is free.
    """

    def __init__(self, bench: Bench, port: int = 0) -> None:
        import viser

        super().__init__(bench)
        self.guard = Guard(self._served)
        self._checked_text = ""
        self._faces: dict[int, Any] = {}
        self.body: Any = None
        self._listing: Any = None
        self._drawn: list[Any] = []
        self._acting: dict[Name, tuple[Entry, PatchPlace]] = {}
        self._acts_in: tuple[Any, ...] = (None, None, None)
        self._dragging: int | None = None
        self.drawn = threading.Event()
        """Set whenever a check has been drawn."""
        with self.guard.before_viser():
            self.server = viser.ViserServer("127.0.0.1", port, verbose=False)
        limit_uploads(self.server, lambda why: self.act(self.say, why))
        self._newest = Newest(bench.check, lambda text, came: self.act(self._heed, text, came))
        self.act(self._build).result()

    @property
    def link(self) -> str:
        """Link that opens the page."""
        return self.guard.link(self.server.get_port())

    def close(self) -> None:
        """Stop the run and the server."""
        self.compare.stop()
        self._newest.close()
        self._acts.shutdown(wait=False, cancel_futures=True)
        with contextlib.redirect_stdout(io.StringIO()):
            self.server.stop()

    def step(self, steps: int) -> None:
        """Undo or redo."""
        self.bench.step(steps)
        self.show()

    def open(self, what: str) -> None:
        """Open a part, and look at it."""
        self.say(f"reading {what} ...")
        self.server.flush()
        self.bench.open(what)
        self.say("")
        self.chosen, self.checked, self.said = [], None, ()
        for field in self.fields:
            field.typed = False
        self.compare.forget()
        self.show()
        self.look()

    # Building and showing.

    def _build(self) -> None:
        server, gui = self.server, self.server.gui
        gui.configure_theme(
            control_width="large",
            show_logo=False,
            show_share_button=False,
            brand_color=(0, 98, 155),
        )
        gui.main_panel.dock_right()
        gui.set_panel_label("ccfem")
        server.scene.configure_default_lights(False)
        server.scene.configure_environment_map(None)
        server.scene.add_light_hemisphere(
            "/sky", sky_color=(255, 255, 255), ground_color=(150, 155, 160), intensity=1.9
        )
        server.scene.add_light_directional("/sun", intensity=1.6, position=(-0.5, -0.9, 0.6))
        server.scene.world_axes.visible = False
        self.heading = gui.add_html("")
        self.message = gui.add_html("", visible=False)
        undoing = gui.add_button_group("History", ["Undo", "Redo"])
        undoing.on_click(self.on(lambda how: self.step(-1 if how == "Undo" else 1), value=True))
        for label, key, steps in (("Undo", "Z", -1), ("Redo", "Y", 1)):
            command = gui.add_command(label, hotkey=key, modifier="cmd/ctrl")
            command.on_trigger(self.on(self.step, steps))
        self.view = gui.add_button_group("View", VIEWS)
        self.view.on_click(self.on(self.show_view, value=True))
        tabs = gui.add_tab_group()
        with tabs.add_tab("Loads"):
            self.loads = LoadsTab(self)
        with tabs.add_tab("Print"):
            self.prints = PrintTab(self)
        with tabs.add_tab("Compare"):
            self.compare = CompareTab(self)
        with tabs.add_tab("Part file"):
            self.file = FileTab(self)
        self.lines = gui.add_html("")
        self.show()
        self.look()

    def show(self) -> None:
        """Show what the part file says, and have it checked."""
        opened = self.bench.opened is not None
        if opened:
            listing = self.bench.listing
            if listing is not self._listing:
                self._draw_body(listing)
            self._draw_symbols()
        title = escaped(self.bench.content.get("title") or self.bench.name) if opened else "ccfem"
        self.heading.content = f'<h1 class="ccfem">{title}</h1>'
        for tab in (self.loads, self.prints, self.compare, self.file):
            tab.show()
        if opened and self._checked_text != self.bench.text:
            self._checked_text = self.bench.text
            self.drawn.clear()
            self._tell_lines("checking ...")
            self._newest.ask(self.bench.text)
        elif not opened:
            self.lines.content = (
                '<p class="ccfem">Choose a body or a part under “Part file”, or a case that comes '
                "with ccfem.</p>"
            )

    def _heed(self, text: str, came: tuple[Check | None, Said]) -> None:
        """Show what the check of a text said."""
        if text == self.bench.text:
            self.checked, self.said = came
            self._tell_lines("")
            self._draw_symbols()
            self.loads.show()
            self.prints.show()
            for field in self.fields:
                field.settle()
            self.drawn.set()

    def _tell_lines(self, doing: str) -> None:
        bad = sum(kind not in ("known", "warning") for kind, _ in self.said)
        warned = sum(kind == "warning" for kind, _ in self.said)
        counted = [f"{bad} to mend"] * bool(bad) + [f"{warned} to look at"] * bool(warned)
        head = doing or ("Check: " + (", ".join(counted) or "nothing keeps it from being solved"))
        body = lines_of(self.said)
        self.lines.content = f'<div class="ccfem check"><h2>{escaped(head)}</h2>{body}</div>'

    def _served(self, name: str) -> Served | None:
        """File of a name below ``/files/``."""
        return self.file.served() if name == "part.toml" else self.compare.served(name)

    # The part in space.

    def look(self, box: tuple[FloatArray, FloatArray] | None = None) -> None:
        """Look at a box, or the part, from the front, above."""
        if box is None and self._listing is None:
            return
        low, high = box or self._bounds()
        centre, size = 0.5 * (low + high), float(np.linalg.norm(high - low))
        place = centre + 1.05 * size * np.array([-0.6, -0.7, 0.5])
        cameras = [client.camera for client in self.server.get_clients().values()]
        for camera in (self.server.initial_camera, *cameras):
            camera.position, camera.look_at = tuple(place), tuple(centre)

    def show_view(self, view: str) -> None:
        """Show the part to be set up, or what the last run says of it: one of `VIEWS`."""
        view = view if self.compare.results is not None else PART
        self.view.value = view
        if self.body is not None:
            self.body.visible = view == PART
        try:
            self.look(self.compare.shown(view))
        except InputError:  # nothing of that view is there
            self.show_view(PART)
            raise

    def _bounds(self) -> tuple[FloatArray, FloatArray]:
        corners = self._listing.points[self._listing.triangles]
        return corners.min(axis=(0, 1)), corners.max(axis=(0, 1))

    def _draw_body(self, listing: Any) -> None:
        """Draw the faces, each to be clicked, and their borders."""
        scene = self.server.scene
        scene.remove_by_name("/body")
        self.body = scene.add_frame("/body", show_axes=False)
        self._faces, self._drawn, self._listing = {}, [], listing
        for mesh in face_meshes(listing):
            name = f"/body/face_{mesh.number}"
            handle = draw_mesh(scene, name, mesh.points, mesh.triangles, _FACE)
            handle.on_click(self.on(self.loads.choose, mesh.number, False))
            handle.on_click(modifier="shift")(self.on(self.loads.choose, mesh.number, True))
            self._faces[mesh.number] = handle
        draw_lines(scene, "/body/borders", borders(listing), _EDGE)
        self.loads.list_faces()

    def acting(self) -> dict[Name, tuple[Entry, PatchPlace]]:
        """Say what acts on the part, and where, as far as that is known."""
        now = (self.bench.text, self.bench.listing, self.checked)
        if any(new is not old for new, old in zip(now, self._acts_in, strict=True)):
            draft, listing = self.bench.draft, self.bench.listing
            places, those = patch_places(draft, listing, self.checked), entries(draft).items()
            body = listing.points[listing.triangles]
            found = {k: (one, place) for k, one in those if (place := one.place(places, body))}
            self._acts_in, self._acting = now, found
        return self._acting

    def paint(self) -> None:
        """Colour the faces by what acts on them, and those that are chosen."""
        held, loaded = set[int](), set[int]()
        for entry, place in self.acting().values():
            (held if entry.holds else loaded).update(place.numbers)
        for number, handle in self._faces.items():
            roles = (number in held, number in loaded)
            colour = {(True, False): _HELD, (False, True): _LOADED, (True, True): _BOTH}.get(
                roles, _FACE
            )
            colour = _CHOSEN if number in self.chosen else colour
            if tuple(handle.color) != colour:
                handle.color = colour

    def _draw_symbols(self) -> None:
        """Draw the bed, cones on what is held and pressed, and arrows, to be dragged, for forces.

        Nothing is drawn anew while one is dragged: that would end the drag where it is.
        """
        if self._dragging in self.server.get_clients():
            return
        listing = self.bench.listing
        for handle in self._drawn:
            handle.remove()
        self._drawn = []
        corners = listing.points[listing.triangles]
        for k, (called, (entry, place)) in enumerate(self.acting().items()):
            self._drawn += self._symbol(f"/body/symbol_{k}", called, entry, place, corners)
        self._drawn += self._support()
        bounds = np.array(self._bounds())
        for k, box in boxes(self.bench.draft).items():
            self._drawn += self._box(k, box, bounds)
        up = upward(self.bench.draft)
        if up is not None:
            self._drawn += self._bed(corners.reshape(-1, 3), up, 0.22 * listing.size)
        self.paint()

    def _symbol(
        self, name: str, called: Name, entry: Entry, place: PatchPlace, body: FloatArray
    ) -> list[Any]:
        """Cones, waves of heat, or an arrow of a force, to be dragged, or about an axis."""
        scene, size, along = self.server.scene, self.bench.listing.size, entry.along
        if entry.kind == "temperature":
            low, high = self._bounds()
            waves = heat_waves(np.array([*(0.5 * (low + high))[:2], high[2]]), 0.12 * size)
            lines = draw_lines(scene, name, waves, _LOAD, 3.0)
            return [lines, draw_label(scene, name, entry.said, waves[-1, 1])]
        if along is None:
            if isinstance(entry.amount, tuple):  # of no size
                return []
            marks = pressing(place.corners, _MARKS, 0.035 * size)
            colour = _SUPPORT if entry.holds else _LOAD
            return [draw_arrows(scene, name, marks, colour, 0.035 * size, 0.4)]
        ends, presses = arrow_outside(place.centre, along, 0.22 * size, body)
        if entry.kind not in ("moment", "centrifugal"):
            turned = partial(self._turn_force, called, presses) if entry.amount else None
            return self._arrow(name, ends, presses, place.centre, entry.said, turned)
        pieces = turning(ends, 0.08 * size)
        lines = draw_lines(scene, name, np.concatenate([pieces[:-1], ends[None]]), _LOAD, 3.0)
        head = draw_arrows(scene, f"{name}_head", pieces[-1:], _LOAD, 0.064 * size, 0.41)
        label = draw_label(scene, name, entry.said, ends[0 if presses else 1])
        return [lines, head, label]

    def _support(self) -> list[Any]:
        """Draw the printed support below the part as it was checked, where it is asked for."""
        body = self.compare.support_body() if self._checked_text == self.bench.text else None
        if body is None:
            return []
        scene, name, lowest = self.server.scene, "/body/support", body[0][body[0][:, 2].argmin()]
        drawn = draw_mesh(scene, name, *body, _PRINTED, opacity=0.6, flat_shading=True)
        return [drawn, draw_label(scene, name, "printed support", lowest)]

    def _arrow(
        self,
        name: str,
        ends: FloatArray,
        presses: bool,
        start: FloatArray,
        text: str,
        turned: Callable[[FloatArray], None] | None,
        colour: tuple[int, int, int] = _LOAD,
    ) -> list[Any]:
        """Arrow with its words, and a ball at its free end to drag it by, about a place."""
        scene, long = self.server.scene, float(np.linalg.norm(ends[1] - ends[0]))
        drawn = draw_arrows(scene, name, ends[None], colour, 0.22 * long, 0.41)
        free = ends[0 if presses else 1]
        words = free + 0.12 * (ends[1] - ends[0]) * (-1.0 if presses else 1.0)
        label = draw_label(scene, name, text, words)
        if turned is None:
            return [drawn, label]

        def moved(end: FloatArray) -> FloatArray:
            tip = np.asarray(start + long * snapped(end - start))
            drawn.points = np.array([tip, start] if presses else [start, tip], np.float32)[None]
            return tip

        def dropped(end: FloatArray) -> None:
            turned(snapped(end - start))

        return [drawn, self._ball(name, free, 0.08 * long, colour, moved, dropped), label]

    def _bed(self, points: FloatArray, up: FloatArray, long: float) -> list[Any]:
        """Bed, to be dragged round the part by its rim, and the build direction."""
        lay, scene, outer = self.prints.lay, self.server.scene, bed_under(points, up)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        inner = outer + _RIM * (outer.mean(axis=0) - outer)
        here, there = np.arange(4), (np.arange(4) + 1) % 4
        sides = np.stack([here, there, here + 4, there, there + 4, here + 4], 1).reshape(-1, 3)
        name, both = "/body/bed_rim", np.concatenate([outer, inner])
        rim = draw_mesh(scene, name, both, sides, _BED, side="double")
        lines = draw_lines(scene, "/body/bed", _closed(outer), _BED)

        def turned(start: FloatArray, end: FloatArray) -> FloatArray:
            return snapped(swung(up, start - middle, end - middle))

        def moved(start: FloatArray, end: FloatArray) -> None:
            lines.points = _closed(bed_under(points, turned(start, end))).astype(np.float32)

        self._drag(rim, moved, lambda start, end: lay(turned(start, end)))
        ends = np.array([outer[0], outer[0] + long * up])
        name, text = "/body/build", "build direction"
        return [rim, lines, *self._arrow(name, ends, False, outer[0], text, lay, _BED)]

    def _ball(
        self,
        name: str,
        place: FloatArray,
        radius: float,
        colour: tuple[int, int, int],
        moved: Callable[[FloatArray], FloatArray],
        dropped: Callable[[FloatArray], None],
    ) -> Any:
        """Ball to drag something by; `moved` says where the ball is then."""
        name = f"{name}_ball"
        ball = self.server.scene.add_icosphere(name, radius, colour, position=tuple(place), **MATT)

        def put(_: FloatArray, end: FloatArray) -> None:
            ball.position = tuple(moved(end))

        self._drag(ball, put, lambda _, end: dropped(end))
        return ball

    def _drag(self, handle: Any, moved: Dragged, dropped: Dragged) -> None:
        """Have something dragged: where it was taken, and where it is, mm."""

        async def drag(event: Any) -> None:
            ends = np.array(event.start_position), np.array(event.end_position)
            self.act(dragged, *ends, event.phase, event.client_id)

        def dragged(start: FloatArray, end: FloatArray, phase: str, client: int) -> None:
            self._dragging = None if phase == "end" else client
            if phase == "end":
                self._draw_symbols()
                dropped(start, end)
            else:
                moved(start, end)

        handle.on_drag(drag)

    def _box(self, place: int, corners: FloatArray, body: FloatArray) -> list[Any]:
        """Box of a fibre region, with a ball at its lower and its upper corner."""
        name, size = f"/body/box_{place}", float(np.linalg.norm(body[1] - body[0]))
        drawn = draw_lines(self.server.scene, name, box_edges(corners), _SUPPORT, 2.0)

        def moved(end: int, to: FloatArray) -> FloatArray:
            new = stretched(corners, end, to, body)
            drawn.points = box_edges(new).astype(np.float32)
            return np.asarray(new[end])

        def dropped(end: int, to: FloatArray) -> None:
            if place not in boxes(self.bench.draft):
                raise InputError("this box is not in the part any more")
            new = stretched(corners, end, to, body)[end].round(3).tolist()
            key = "lower" if end == 0 else "upper"
            self.edit(valued(("fibre", "regions", place, key), new))

        def ball(end: int) -> Any:
            acts = (partial(moved, end), partial(dropped, end))
            return self._ball(f"{name}_{end}", corners[end], 0.015 * size, _SUPPORT, *acts)

        return [drawn, ball(0), ball(1)]

    def _turn_force(self, name: Name, presses: bool, along: FloatArray) -> None:
        """Turn a force, with its size as it is by now: somebody may have typed another."""
        now = self.loads.entry(name)
        size = np.linalg.norm(now.amount or 0.0) * (-1.0 if presses else 1.0)
        vector = [round(float(x), 3) + 0.0 for x in size * along]
        self.edit(valued((*now.keys, now.key), vector))


# Work on the newest of what is asked for, as a check while somebody types.


Item = TypeVar("Item")
Result = TypeVar("Result")

_QUIET = 0.25
"""Seconds for which nothing new must come before the work begins."""


class Newest(Generic[Item, Result]):
    """Works on the newest item, once it has been quiet; others are passed over.

    Parameters
    ----------
    work : callable
        Takes an item.
    done : callable
        Takes an item and what came of it, unless a newer one has come meanwhile.
    """

    def __init__(
        self, work: Callable[[Item], Result], done: Callable[[Item, Result], object]
    ) -> None:
        self._work, self._done, self._asked = work, done, 0
        self._busy = threading.Lock()

    def ask(self, item: Item) -> None:
        """Ask for an item; what was asked before and not begun is dropped."""
        self._asked += 1
        timer = threading.Timer(_QUIET, self._run, (item, self._asked))
        timer.daemon = True
        timer.start()

    def close(self) -> None:
        """Begin nothing more."""
        self._asked += 1

    def _run(self, item: Item, number: int) -> None:
        with self._busy:
            if number == self._asked:
                result = self._work(item)
                if number == self._asked:
                    self._done(item, result)
