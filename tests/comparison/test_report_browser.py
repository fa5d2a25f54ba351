"""The report in a browser: headless Chromium, driven by Playwright."""

import io
import os
import shutil
from dataclasses import replace

import numpy as np
import pytest

from ccfem.cases.case import Case
from ccfem.comparison.engine import compare
from ccfem.comparison.files import write_results
from ccfem.elasticity.problem import Force, Problem, Support
from ccfem.layers.slicing import Planar
from ccfem.machine import Machine
from ccfem.materials import isotropic
from ccfem.mesh.box import box_mesh
from ccfem.strategies import Concentric, Zigzag

EVIL = "<script>window.broken = 1</script>"


def browser_path() -> str:
    """Where a Chromium is; empty where none is."""
    names = ("chromium", "chromium-browser", "google-chrome")
    found = [os.environ.get("CCFEM_CHROMIUM", ""), *(shutil.which(name) or "" for name in names)]
    return next((path for path in found if path), "")


@pytest.fixture(scope="session")
def report(tmp_path_factory):
    """Report of a strip, three layers by two strategies, one named to do harm, one that failed."""
    mesh = box_mesh((60.0, 24.0, 4.0), (10, 4, 2))
    supports = (Support("x_min"),)
    loads = {"pull": (Force("x_max", (1000.0, 0.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), supports, loads)
    machine = Machine(minimum_length=20.0)
    case = Case("strip", f"Strip {EVIL}", problem, slicing=Planar(count=3), machine=machine)
    strategies = {EVIL: Zigzag(spacing=3.0), "rings": Concentric(spacing=3.0)}
    result = compare(case, strategies, natural=True)
    failed = replace(result.runs[0], name="late", evaluation=None, tested=None, failure=EVIL)
    folder = tmp_path_factory.mktemp("report")
    write_results(replace(result, runs=(*result.runs, failed)), folder, f"ccfem {EVIL}", {},
                  part_file=f'title = "{EVIL}"')  # fmt: skip
    return folder / "report.html"


@pytest.fixture(scope="module")
def page(report):
    """The report, open; what it said and asked for is kept in ``said`` and ``asked``."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = browser_path()
    if not path:
        pytest.skip("there is no browser: install chromium, or name one by CCFEM_CHROMIUM")
    options = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with sync_api.sync_playwright() as program:
        browser = program.chromium.launch(executable_path=path, args=options)
        page = browser.new_page(viewport={"width": 1200, "height": 500})
        page.said, page.asked = [], []
        page.on("pageerror", lambda error: page.said.append(str(error)))
        page.on("console", lambda one: one.type == "error" and page.said.append(one.text))
        page.on("request", lambda one: page.asked.append(one.url))
        page.goto(report.as_uri())
        page.wait_for_selector("body[data-ready]", state="attached", timeout=60_000)
        yield page
        browser.close()


def shades(page, selector: str) -> int:
    """Count the colours that a part of the page shows."""
    from PIL import Image

    image = Image.open(io.BytesIO(page.locator(selector).first.screenshot(timeout=60_000)))
    return len(np.unique(np.asarray(image.convert("RGB")).reshape(-1, 3), axis=0))


def test_nothing_goes_wrong_and_nothing_is_fetched(page, report):
    assert page.said == []
    assert [url for url in page.asked if not url.startswith(("blob:", "data:"))] == [
        report.as_uri()
    ]
    assert page.evaluate("window.broken") is None
    assert EVIL in page.inner_text("h1")
    assert page.locator("figcaption b").all_inner_texts().count(EVIL) == 1


def test_the_slider_changes_the_layer(page):
    assert shades(page, "#layer-views canvas") > 30
    seen = []
    for layer in ("0", "2"):
        page.locator("#layer").fill(layer)
        page.wait_for_function(f"document.getElementById('layer-said').textContent[0] == '{layer}'")
        seen.append(page.evaluate("document.querySelector('#layer-views canvas').toDataURL()"))
    assert seen[0] != seen[1]
    page.locator("#closer").click()
    page.locator("#colour").select_option("angle")
    page.wait_for_function("document.getElementById('path-legend').textContent.includes('90°')")
    assert page.evaluate("document.querySelector('#layer-views canvas').toDataURL()") != seen[1]


def test_the_table_sorts(page):
    def column(k):
        cells = page.locator(f".headline tbody tr td:nth-child({k + 1})")
        return [float(cell.get_attribute("data-value")) for cell in cells.all()
                if cell.get_attribute("data-value")]  # fmt: skip

    head = page.locator(".headline th").nth(2)  # stiffness
    values = sorted(column(2))
    assert len(set(values)) == 2
    head.click()
    assert column(2) == values[::-1]
    assert page.locator(".headline tbody tr").last.inner_text().startswith("late")  # it failed
    head.click()
    assert column(2) == values
    assert page.locator(".headline tbody tr").last.inner_text().startswith("late")
    head.hover()
    assert "load squared over its work" in page.inner_text("#tip")


def test_the_part_is_drawn_in_space(page):
    page.wait_for_selector("#part-view canvas", state="attached", timeout=60_000)
    page.locator("#part-view").scroll_into_view_if_needed()
    assert shades(page, "#part-view") > 30


def test_a_phone_cuts_nothing(page):
    page.set_viewport_size({"width": 390, "height": 700})
    page.evaluate("document.querySelectorAll('details').forEach((each) => (each.open = true))")
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    over = """[...document.querySelectorAll("td, th, p, pre, li, dd, label, select, canvas")]
        .filter((each) => each.getBoundingClientRect().right > 390.5 && each.offsetParent)
        .map((each) => each.outerHTML.slice(0, 80))"""
    for _ in range(100):  # plotly draws the scenes anew a moment after the page narrows
        if not page.evaluate(over):
            break
        page.wait_for_timeout(100)
    assert page.evaluate(over) == []
    assert page.locator(".sorter select").is_visible()
    assert page.said == []
