"""A browser that draws by software, and clicks of a person on the page of the workbench in it.

    python -m benchmarks.clicking

takes three parts from their STEP and STL files to G-code, and prints the clicks and keys that this
takes, with an estimate of a person's time by the keystroke-level model of Card, Moran and Newell
1980, beside what the machine takes.
"""

import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

OPTIONS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
"""How Chromium is started."""


def browser_path() -> str:
    """Path of the Chromium of this machine; empty where there is none."""
    names = ("chromium", "chromium-browser", "google-chrome")
    found = [os.environ.get("CCFEM_CHROMIUM", ""), *(shutil.which(name) or "" for name in names)]
    return next((path for path in found if path), "")


def launched(program: Any) -> Any:
    """Start it; ends the program where there is none."""
    path = browser_path()
    if not path:
        raise SystemExit("there is no browser: install chromium, or name one by CCFEM_CHROMIUM")
    return program.chromium.launch(executable_path=path, args=OPTIONS)


def rotation(wxyz):
    """Matrix of a unit quaternion."""
    w, x, y, z = wxyz
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def first_hit(origin, along, corners):
    """Row of the triangle (t, 3, 3) that a ray meets first; -1 for none."""
    a, b, c = np.moveaxis(corners, 1, 0)
    u, v = b - a, c - a
    p = np.cross(along, v)
    det = np.einsum("ij,ij->i", u, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = origin - a
        x = np.einsum("ij,ij->i", s, p) / det
        q = np.cross(s, u)
        y = q @ along / det
        far = np.einsum("ij,ij->i", v, q) / det
    hit = (x >= 0) & (y >= 0) & (x + y <= 1) & (far > 1e-9) & np.isfinite(far)
    return int(np.argmin(np.where(hit, far, np.inf))) if hit.any() else -1


def pixel(view, point):
    """Pixel of a point in space in the picture that a visit sees."""
    camera = next(iter(view.page.server.get_clients().values())).camera
    x, y, z = rotation(camera.wxyz).T @ (np.asarray(point) - camera.position)
    box = view.canvas_box
    scale = 0.5 * box["height"] / np.tan(0.5 * camera.fov) / z
    return (
        box["x"] + 0.5 * box["width"] + scale * x,
        box["y"] + 0.5 * box["height"] + scale * y,
    )


def pixel_of_face(view, number):
    """Pixel at which a face is seen, well inside; None where it is hidden."""
    listing = view.page.bench.listing
    camera = next(iter(view.page.server.get_clients().values())).camera
    origin = np.asarray(camera.position)
    corners = listing.points[listing.triangles]
    rows = listing.face(number).facets
    middles = corners[rows].mean(axis=1)
    sizes = np.linalg.norm(np.cross(*np.moveaxis(np.diff(corners[rows], axis=1), 1, 0)), axis=1)
    centre = middles.mean(axis=0)
    order = np.argsort(np.linalg.norm(middles - centre, axis=1) - 1e-3 * sizes)
    for k in order[:: max(1, len(order) // 20)].tolist():
        if first_hit(origin, middles[k] - origin, corners) == rows[k]:
            return pixel(view, middles[k])
    return None


class View:
    """A page in a browser, and the workbench's side of it."""

    def __init__(self, page, tab):
        self.page, self.tab = page, tab

    @property
    def canvas_box(self):
        """Place of the picture in the window."""
        return self.tab.locator("canvas").first.bounding_box()

    def settle(self):
        """Wait until all that was asked for is done and the newest check is drawn."""
        self.tab.wait_for_timeout(150)
        self.page.act(lambda: None).result(30)

    def click_face(self, number, *modifiers):
        """Click a face in the picture, and wait until that has come to the server."""
        at = pixel_of_face(self, number)
        assert at is not None, f"face {number} is hidden"
        before = list(self.page.chosen)
        self.tab.mouse.move(*at)
        self.tab.wait_for_timeout(60)
        for key in modifiers:
            self.tab.keyboard.down(key)
        self.tab.mouse.click(*at)
        for key in modifiers:
            self.tab.keyboard.up(key)
        for _ in range(200):
            if self.page.chosen != before:
                return
            self.tab.wait_for_timeout(10)
        raise AssertionError(f"the click on face {number} at {at} was lost")

    def button(self, name):
        """Press a button."""
        self.tab.get_by_role("button", name=name, exact=True).first.click()
        self.settle()

    def choose_tab(self, name):
        """Show a tab."""
        self.tab.get_by_role("tab", name=name, exact=True).click()
        self.tab.wait_for_timeout(100)


OPERATORS = {"K": 0.28, "P": 1.1, "B": 0.1, "H": 0.4, "M": 1.35}
"""Seconds of a key of one who types 40 words a minute, of pointing with a mouse, of pressing or
releasing its button, of moving the hand between mouse and keyboard, and of making up one's mind: S.
Card, T. Moran, A. Newell, The keystroke-level model for user performance time with interactive
systems, Communications of the ACM 23 (1980) 396-410; the button after D. Kieras, 1993."""


def seconds(operators: str, **others: float) -> float:
    """Time of a person who does these operators, some of which may take others' seconds."""
    return sum((OPERATORS | others)[operator] for operator in operators)


class Person(View):
    """A visit that records what a person would do, as operators of the keystroke-level model.

    By the model's rules one makes up one's mind (M) before each command, as a button, a tab or a
    field to be filled, but not before what it is given: a face, an option that is seen, a number.
    """

    operators = ""
    clicks = 0

    def _clicked(self, operators: str) -> None:
        self.clicks += operators.count("BB")
        self.operators += operators

    def face(self, number, *modifiers):
        """Click a face."""
        self._clicked("K" * len(modifiers) + "PBB")
        self.click_face(number, *modifiers)

    def press(self, name):
        """Press a button."""
        self._clicked("MPBB")
        self.button(name)

    def go_to(self, tab):
        """Show a tab."""
        self._clicked("MPBB")
        self.choose_tab(tab)

    def choose(self, label, option):
        """Choose from a list: open it, and click an option."""
        self._clicked("MPBB" + "PBB")
        self.tab.get_by_label(label, exact=True).click()
        self.tab.get_by_role("option", name=option, exact=True).click()
        self.settle()

    def type(self, label, text, place=0):
        """Type in a field, whose text a double click has chosen."""
        self._clicked("MPBBBB" + "H" + "K" * len(text) + "H")
        self.tab.get_by_label(label, exact=True).nth(place).fill(text)
        self.settle()

    def tick_alone(self, name):
        """Tick one strategy alone."""
        for other, tick in self.page.compare.ticks.items():
            if tick.value != (other == name):
                self._clicked("MPBB")
                self.tab.get_by_label(other, exact=True).click()
                self.settle()

    def hole(self, radius, more=True):
        """Choose a hole of a radius, mm, from the list of faces; returns its number."""
        listing = self.page.bench.listing
        pairs = zip(listing.numbers, listing.faces, strict=True)
        number = next(k for k, face in pairs if face.hollow and abs(face.radius - radius) < 0.1)
        if more:
            self.choose("Face", f"{number}: {listing.face(number).shape}")
        return number


def bracket(person):
    """Bolted down at four holes, an eye pulled upwards."""
    person.hole(2.75)
    person.press("Same radius")
    person.press("Hold")
    person.face(person.hole(5.0, more=False))


def hook(person):
    """Hung from its eye, the bowl pulled down."""
    person.hole(6.0)
    person.press("Hold")
    person.hole(18.0)
    person.type("Force, N y", "-500")


def lever(person):
    """Held at pivot and cable, a finger on its long side."""
    for radius in (4.0, 2.5):
        person.hole(radius)
    person.press("Hold")
    listing = person.page.bench.listing
    pairs = zip(listing.numbers, listing.faces, strict=True)
    sides = [
        (face.area, k) for k, face in pairs if face.kind == "plane" and face.direction[1] > 0.9
    ]
    number = max(sides)[1]
    person.choose("Face", f"{number}: {listing.face(number).shape}")
    person.type("Force, N", "0")
    person.type("Force, N y", "-60")


SET_UPS = {"l_bracket.step": bracket, "crane_hook.stl": hook, "brake_lever.stl": lever}
"""How each of the three parts is set up."""


def to_gcode(person: Person, file: str) -> None:
    """Take a part from its file in the folder to G-code, by clicks alone."""
    person.clicks, person.operators = 0, ""
    page = person.page
    person.go_to("Part file")
    person.choose("In this folder", file)
    page.act(lambda: None).result(30)
    person.tab.wait_for_timeout(1500)
    person.go_to("Loads")
    SET_UPS[file](person)
    person.press("Add load")
    person.go_to("Print")
    person.type("Layers of fibre", "1")
    person.type("Edge of cells, mm", "6")
    person.go_to("Compare")
    person.tick_alone("zigzag")
    person.press("G-code of the ticked strategy")
    assert page.compare.run.wait(120).written, page.compare.run.state
    person.settle()


def visited(program: Any, folder: Path) -> tuple[Any, Person]:
    """Open the workbench of a folder in a browser; returns that and the visit."""
    from ccfem.workbench.bench import Bench
    from ccfem.workbench.page import Page

    browser, page = launched(program), Page(Bench(folder))
    tab = browser.new_page(viewport={"width": 1100, "height": 700})
    tab.goto(page.link)
    tab.get_by_role("tab", name="Part file").wait_for(timeout=60_000)
    return browser, Person(page, tab)


def main() -> None:
    """Print clicks, keys and an estimate of a person's time for each part."""
    from playwright.sync_api import sync_playwright

    from benchmarks.studies.own_parts import main as make_parts

    with tempfile.TemporaryDirectory() as folder, sync_playwright() as program:
        make_parts(Path(folder))
        browser, person = visited(program, Path(folder))
        print("part               clicks  keys  seconds of a person, estimated")
        for file in SET_UPS:
            to_gcode(person, file)
            keys = person.operators.count("K")
            time = seconds(person.operators)
            print(f"{file:<18} {person.clicks:6d} {keys:5d} {time:8.0f}", flush=True)
        person.page.close()
        browser.close()


if __name__ == "__main__":
    main()
