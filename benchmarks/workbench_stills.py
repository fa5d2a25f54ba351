"""Stills of the workbench for its page of the documentation: an L bracket, from STEP to strands.

Run ``python -m benchmarks.workbench_stills``; it needs the extras cad and ui, Playwright, and a
Chromium (CCFEM_CHROMIUM, or ``chromium`` on the path).
"""

import io
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.clicking import launched
from benchmarks.studies.own_parts import l_bracket
from ccfem.cases.part_editing import valued
from ccfem.workbench.bench import Bench
from ccfem.workbench.page import Page

FOLDER = Path(__file__).parent.parent / "docs" / "pictures" / "workbench"

_WITH_GPU = """
const get = WebGL2RenderingContext.prototype.getExtension;
WebGL2RenderingContext.prototype.getExtension = function (name) {
  return name === "WEBGL_debug_renderer_info" ? null : get.call(this, name);
};
"""
"""Lets the page draw as where there is a GPU: with smooth edges."""


def main(folder: Path = FOLDER) -> None:
    """Write the stills into a folder."""
    from playwright.sync_api import sync_playwright

    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as work, sync_playwright() as program:
        l_bracket(Path(work) / "l_bracket.step")
        bench = Bench(Path(work))
        bench.open("l_bracket.step")
        page = Page(bench)
        browser = launched(program)
        tab = browser.new_page(viewport={"width": 1180, "height": 760})
        tab.add_init_script(_WITH_GPU)
        tab.goto(page.link)
        tab.get_by_role("heading", name="Check").wait_for(timeout=60_000)

        def still(name: str) -> None:
            tab.wait_for_timeout(500)
            page.act(lambda: None).result()
            page.drawn.wait(60)
            tab.mouse.move(5, 5)
            tab.wait_for_timeout(2500)
            _write(tab.screenshot(), folder / f"{name}.png")

        holes = [
            number
            for number, face in zip(bench.listing.numbers, bench.listing.faces, strict=True)
            if face.hollow
        ]
        eye = max(holes, key=lambda number: bench.listing.face(number).radius)
        bolts = [number for number in holes if number != eye]
        page.act(page.loads.choose_all, bolts)
        still("faces")
        tab.get_by_role("button", name="Hold").first.click()
        page.act(lambda: None).result()
        page.act(page.loads.choose, eye, False).result()
        tab.get_by_label("Force, N z").first.fill("200")
        tab.get_by_role("button", name="Add load").click()
        still("loads")
        tab.get_by_role("tab", name="Print", exact=True).click()
        for folder_name in ("Plastic", "On the bed"):
            tab.get_by_text(folder_name, exact=True).click()
        still("settings")
        tab.get_by_role("tab", name="Compare").click()
        page.act(page.edit, valued(("build",), "-z")).result()
        tab.get_by_label("Print support").click()
        still("support")
        tab.get_by_label("Print support").click()
        page.act(page.step, -1).result()
        tab.get_by_label("isocurve", exact=True).click()
        tab.get_by_label("contour_zigzag", exact=True).click()
        tab.get_by_role("button", name="Compare", exact=True).click()
        tab.wait_for_timeout(500)
        assert page.compare.run is not None
        page.compare.run.wait()
        tab.get_by_role("slider", name="Layer", exact=True).scroll_into_view_if_needed()
        still("fibre")
        page.act(page.show_view, "Deformed")
        still("deformed")
        tab.get_by_role("button", name="G-code of this strategy").click()
        tab.wait_for_timeout(500)
        page.compare.run.wait()
        page.act(lambda: None).result()
        for _ in range(len(page.compare.printed) // 2):
            tab.get_by_role("slider", name="Printed up to").press("ArrowLeft")
        still("print")
        tab.get_by_role("tab", name="Part file").click()
        page.act(page.show_view, "Part")
        still("part_file")
        browser.close()
        page.close()


def _write(data: bytes, file: Path) -> None:
    """Write a screenshot with few colours, small areas' too, which makes it a third as large."""
    from PIL import Image

    picture: Any = Image.open(io.BytesIO(data)).convert("RGB")
    picture.quantize(256, Image.Quantize.FASTOCTREE).save(file, optimize=True)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
