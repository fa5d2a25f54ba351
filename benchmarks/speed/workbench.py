"""How fast the page of the workbench is, in a real browser that draws by software alone.

    python -m benchmarks.speed.workbench [frames] [picks] [layers]

- frames: those a second while the L bracket is turned by the mouse, by the clock and by the
  processor time that all processes of the browser take for one (two processors draw at most twice
  as many as that says);
- picks: from the click on a face until the panel names it, in the browser, for 50 clicks each on a
  hook and on a ball with holes, of 100,000 triangles (a ball's can all be seen);
- layers: what the server takes to draw a layer of the loop (12 layers, four strategies, two of them
  side by side), until the browser has been sent it.

It needs the extras cad and ui, Playwright and a Chromium (CCFEM_CHROMIUM, or one on the path).
"""

import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.clicking import View, launched, pixel_of_face
from benchmarks.studies.own_parts import crane_hook, l_bracket, shapes, write
from ccfem.cases.part_editing import valued
from ccfem.workbench.bench import Bench
from ccfem.workbench.page import Page

_SECONDS, _CLICKS, _TRIANGLES = 10.0, 50, 100_000
_COUNTED = """
window.frames = 0; window.drawing = false;
for (const name of ["drawElements", "drawArrays", "drawElementsInstanced", "drawArraysInstanced"]) {
  const draw = WebGL2RenderingContext.prototype[name];
  WebGL2RenderingContext.prototype[name] = function (...how) {
    window.drawing = true;
    return draw.apply(this, how);
  };
}
const count = () => {
  window.frames += window.drawing; window.drawing = false; requestAnimationFrame(count);
};
requestAnimationFrame(count);
"""
"""Counts the frames in which something was drawn."""
_TIMED = """
window.clicked = 0; window.named = 0;
const clicked = () => { window.clicked = performance.now(); window.named = 0; };
addEventListener("pointerup", clicked, true);
new MutationObserver(() => {
  const said = document.querySelector(".ccfem b")?.textContent;
  if (said !== window.said) { window.said = said; window.named = performance.now(); }
}).observe(document, { childList: true, subtree: true, characterData: true });
"""
"""Times the clicks, and when the panel names other faces."""


@contextmanager
def _visit(work: Path, what: str, script: str = "") -> Iterator[View]:
    """Page of a part in a browser."""
    from playwright.sync_api import sync_playwright

    bench = Bench(work)
    bench.open(what)
    page = Page(bench)
    with sync_playwright() as program:
        browser = launched(program)
        tab = browser.new_page(viewport={"width": 1180, "height": 760})
        tab.add_init_script(script)
        tab.goto(page.link)
        tab.get_by_role("heading", name="Check").wait_for(timeout=60_000)
        page.drawn.wait(60)
        tab.wait_for_timeout(2000)
        try:
            yield View(page, tab)
        finally:
            browser.close()
            page.close()


def frames(work: Path) -> None:
    """Turn the bracket, loaded and held, by the mouse."""
    l_bracket(work / "l_bracket.step")
    with _visit(work, "l_bracket.step", _COUNTED) as view:
        loads = view.page.loads
        holes = [k for k in view.page.bench.listing.numbers if _face(view, k).hollow]
        eye = max(holes, key=lambda k: _face(view, k).radius)
        view.page.act(loads.choose_all, [k for k in holes if k != eye])
        view.button("Hold")
        view.page.act(loads.choose, eye, False)
        view.button("Add load")
        view.page.drawn.wait(60)
        box = view.canvas_box
        x, y = box["x"] + 0.3 * box["width"], box["y"] + 0.9 * box["height"]
        mouse = view.tab.mouse
        mouse.move(x, y)
        mouse.down()
        begun, spent, drawn = time.perf_counter(), _processor(), _count(view)
        while time.perf_counter() - begun < _SECONDS:
            turn = time.perf_counter() - begun
            mouse.move(x + 150.0 * np.sin(turn), y - 60.0 * (1.0 - np.cos(turn)))
        seconds, drawn = time.perf_counter() - begun, _count(view) - drawn
        spent = _processor() - spent
        mouse.up()
    print(
        f"frames of the bracket: {drawn / seconds:.1f} a second by the clock, "
        f"{1e3 * spent / drawn:.0f} ms of processor time each ({drawn / spent:.1f} a second of it)"
    )


def _count(view: View) -> int:
    return int(view.tab.evaluate("window.frames"))


def _face(view: View, number: int) -> Any:
    return view.page.bench.listing.face(number)


def _processor() -> float:
    """Processor time of all processes that this one has started, and of theirs, s."""
    parents, times = {}, {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            about = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:  # it has ended
            continue
        parents[int(folder.name)] = int(about[1])
        times[int(folder.name)] = int(about[11]) + int(about[12])

    def ours(process: int) -> bool:
        parent = parents.get(process, 0)
        return parent == os.getpid() or (parent > 1 and ours(parent))

    return sum(spent for k, spent in times.items() if ours(k)) / os.sysconf("SC_CLK_TCK")


def _ball(path: Path, size: float = 1.0) -> None:
    """Make a ball of radius 30 with three holes through its middle."""
    with shapes() as (gmsh, occ):
        holes = [(3, occ.addCylinder(*(-40.0 * a), *(80.0 * a), 5 + k)) for k, a in _AXES]
        occ.cut([(3, occ.addSphere(0, 0, 0, 30))], holes)
        write(gmsh, path, size)


_AXES = tuple(enumerate(np.eye(3)))


def picks(work: Path) -> None:
    """Click faces of two bodies of many triangles."""
    makers: dict[str, Callable[..., None]] = {"hook.stl": crane_hook, "ball.stl": _ball}
    for name, make in makers.items():
        size = 1.0
        make(work / name, size)
        count = (work / name).stat().st_size / 50
        make(work / name, size * np.sqrt(count / _TRIANGLES))
        with _visit(work, name, _TIMED) as view:
            _pick(view, name)


def _pick(view: View, name: str) -> None:
    listing = view.page.bench.listing
    places = {number: pixel_of_face(view, number) for number in listing.numbers}
    seen = [(number, at) for number, at in places.items() if at is not None]
    taken, lost = [], 0
    for k in range(_CLICKS):
        number, at = seen[k % len(seen)]
        view.tab.mouse.click(*at)
        for _ in range(100):
            view.tab.wait_for_timeout(50)
            between = view.tab.evaluate("window.named - window.clicked")
            if view.page.chosen == [number] and between > 0:
                break
        else:
            lost += 1
            continue
        taken.append(between)
        view.tab.wait_for_timeout(300)
    print(
        f"picks on {name}, {len(listing.triangles)} triangles, {len(seen)} faces in sight: median "
        f"{np.median(taken):.0f} ms of {len(taken)}, the slowest {max(taken):.0f} ms; {lost} lost"
    )


def layers(work: Path) -> None:
    """Go through the layers of the loop."""
    with _visit(work, "loop") as view:
        page, compare = view.page, view.page.compare
        page.act(page.edit, valued(("layers",), 12)).result()
        page.act(compare._begin, compare._compare).result()
        compare.run.wait()
        view.settle()
        places = [*range(len(compare.results.layers))] * 4
        taken = []

        def change(place: int) -> None:
            compare.layer.value = place
            begun = time.perf_counter()
            with page.server.atomic():
                compare._draw()
            page.server.flush()
            taken.append(time.perf_counter() - begun)

        for place in places:
            page.act(change, place).result()
            view.tab.wait_for_timeout(100)
        names = ", ".join(compare.results.names)
    print(
        f"layer changes on the loop ({len(set(places))} layers; {names}): median "
        f"{1e3 * np.median(taken):.1f} ms of the server, the slowest {1e3 * max(taken):.1f} ms"
    )


def main(wanted: list[str]) -> None:
    """Measure what is wanted, or all."""
    for measure in (frames, picks, layers):
        if not wanted or measure.__name__ in wanted:
            with tempfile.TemporaryDirectory() as work:
                measure(Path(work))


if __name__ == "__main__":
    main(sys.argv[1:])
