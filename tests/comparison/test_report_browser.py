"""The report in a browser: headless Chromium, driven by Playwright."""

import io
from dataclasses import replace

import numpy as np
import pytest
from browsers import NAMELESS, started

from ccfem.body.mesh.box import box_mesh
from ccfem.cases.case import Case
from ccfem.comparison.engine import compare
from ccfem.comparison.files import write_results
from ccfem.fem.elasticity.problem import Force, Problem, Support
from ccfem.fem.materials import isotropic
from ccfem.judging.virtual_testing.progressive_failure import BreakingCurve, BreakingLoad
from ccfem.judging.virtual_testing.strand import Limits
from ccfem.judging.virtual_testing.strands import Strands
from ccfem.machine import Machine
from ccfem.slicing.slicers import Planar
from ccfem.strategies import Concentric, Zigzag

EVIL = "<script>window.broken = 1</script>"


def broken(cells: int) -> BreakingLoad:
    """Break a part at two steps: two cells crack at the first, one more at the second."""
    cracked = np.full(cells, -1)
    cracked[:3] = [1, 1, 2]
    columns = [0.0, 900.0, 1000.0, 600.0], [0.0, 0.1, 0.2, 0.2], [0, 0, 2, 3], *np.zeros((2, 4))
    rows = cracked, np.zeros(0), np.full(cells, -1)
    curve = BreakingCurve(*columns, *rows, "matrix", np.zeros(3), 0.0, 3)
    return BreakingLoad(curve, None, None, Strands.none(), Limits(105.0, 50.0), 13.4)


@pytest.fixture(scope="session")
def report(tmp_path_factory):
    """Report of a strip, three layers by two strategies, one named to do harm, one that failed."""
    mesh = box_mesh((60.0, 24.0, 4.0), (10, 4, 2))
    supports = (Support("x_min"),)
    loads = {"pull": (Force("x_max", (1000.0, 0.0, 0.0)),)}
    problem = Problem(mesh, isotropic(3500.0, 0.35), supports, loads)
    machine = Machine(minimum_length=20.0, cutter_distance=20.0)
    case = Case("strip", f"Strip {EVIL}", problem, slicing=Planar(count=3), machine=machine)
    strategies = {EVIL: Zigzag(spacing=3.0), "rings": Concentric(spacing=3.0)}
    result = compare(case, strategies, natural=True, print_plans=True)
    failed = replace(result.runs[0], name="late", evaluation=None, tested=None, failure=EVIL)
    first = replace(result.runs[0], broken=broken(len(mesh.cells)))
    folder = tmp_path_factory.mktemp("report")
    runs = (first, *result.runs[1:], failed)
    write_results(replace(result, runs=runs), folder, f"ccfem {EVIL}", {},
                  part_file=f'title = "{EVIL}"')  # fmt: skip
    return folder / "report.html"


@pytest.fixture(scope="module")
def page(report):
    """The report, open; what it said and asked for is kept in ``said`` and ``asked``."""
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with sync_api.sync_playwright() as program:
        browser = started(program)
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
    return len(image.convert("RGB").getcolors(image.width * image.height))


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

    page.locator("#all-columns").check()
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
    page.locator("#all-columns").uncheck()


def test_the_part_is_drawn_in_space(page):
    page.wait_for_selector("#part-view canvas", state="attached", timeout=60_000)
    page.locator("#part-view").scroll_into_view_if_needed()
    assert shades(page, "#part-view") > 30


def test_a_phone_cuts_nothing(page):
    page.set_viewport_size({"width": 390, "height": 700})
    page.evaluate("document.querySelectorAll('details').forEach((each) => (each.open = true))")
    wide = "document.documentElement.scrollWidth - 390"
    over = """[...document.querySelectorAll("td, th, p, pre, li, dd, label, select, canvas")]
        .filter((each) => each.getBoundingClientRect().right > 390.5 && each.offsetParent)
        .map((each) => each.outerHTML.slice(0, 80))"""
    for _ in range(100):  # plotly draws the scenes anew a moment after the page narrows
        if not page.evaluate(wide) and not page.evaluate(over):
            break
        page.wait_for_timeout(100)
    assert page.evaluate(wide) == 0
    assert page.evaluate(over) == []
    assert page.locator(".sorter select").is_visible()
    assert page.said == []


@pytest.mark.parametrize("size", [(1280, 800), (390, 844)])
def test_verdict_and_table_are_on_the_first_screen(page, size):
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.evaluate("scrollTo(0, 0)")
    for what in ("p.verdict >> nth=0", ".headline table"):
        box = page.locator(what).bounding_box()
        assert box["y"] + box["height"] <= size[1]
    ratio = page.locator(".headline tbody td[data-title='stiffness ratio']").first
    bonded = page.locator(".headline tbody td[data-title='stiffness ratio, bonded']").first
    assert ratio.is_visible()
    assert not bonded.is_visible()
    page.locator("#all-columns").check()
    try:
        assert bonded.is_visible()
    finally:
        page.locator("#all-columns").uncheck()


def test_words_stand_out_and_everything_has_a_name_and_a_place(page):
    """What axe asks for: contrast of 4.5, one main landmark, a name for every choice."""
    assert page.locator("main").count() == 1
    assert page.locator("main section").count() == page.locator("section").count()
    assert page.evaluate(NAMELESS) == 0
    page.locator("details").evaluate_all("all => all.forEach(each => { each.open = true; })")
    low = [ratio for ratio in page.evaluate(CONTRASTS) if ratio < 4.5]
    assert low == []


CONTRASTS = """(() => {
  const parts = (css) => css.match(/[\\d.]+/g).map(Number);
  const light = (css) => parts(css).slice(0, 3).map((v) => v / 255)
    .map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
    .reduce((sum, v, k) => sum + [0.2126, 0.7152, 0.0722][k] * v, 0);
  const behind = (each) => {
    for (let at = each; at; at = at.parentElement) {
      const css = getComputedStyle(at).backgroundColor, alpha = parts(css)[3];
      if (alpha === undefined || alpha > 0.9) return css;
    }
    return 'rgb(255, 255, 255)';
  };
  return [...document.querySelectorAll('h1, h2, p, b, li, th, td, td span, small, dt, dd, label')]
    .filter((each) => each.textContent.trim() && each.getClientRects().length)
    .map((each) => [light(getComputedStyle(each).color), light(behind(each))])
    .map(([a, b]) => (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05));
})()"""
"""WCAG 2 contrast of the words of the page against what lies behind them."""


def test_paper_shows_the_views(page):
    page.wait_for_selector("body[data-printable]", state="attached", timeout=60_000)
    assert page.locator("img.printed").count() == 4 + page.locator(".chart").count() > 4
    page.emulate_media(media="print")
    try:
        assert page.locator(".scene:visible, .chart:visible, .controls:visible").count() == 0
        # What is behind a click on the screen is there, for paper cannot be clicked.
        folded = page.locator("details table, details dl, details pre")
        assert folded.count() > 3
        assert all(each.is_visible() for each in folded.all())
        for picture in range(page.locator("img.printed").count()):
            assert shades(page, f"img.printed >> nth={picture}") > 20
    finally:
        page.emulate_media(media="screen")


FITTED = """(() => {
  const view = document.getElementById("part-view"), drawn = view._fullLayout;
  const off = [drawn.width - view.offsetWidth, drawn.height - view.offsetHeight];
  return Math.max(...off.map(Math.abs)) < 1;
})()"""
"""Whether the scene of the part is as large as the page has room for."""


@pytest.mark.parametrize("size", [(390, 844), (1200, 500), (800, 1200)])
def test_the_part_lies_in_its_view_whatever_its_shape(page, size):
    """No pixel of the part or its loads touches the border of the view."""
    from PIL import Image

    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.wait_for_function(FITTED, timeout=60_000)
    view = page.locator("#part-view")
    view.scroll_into_view_if_needed()
    before, shown = b"", view.screenshot(timeout=60_000)
    while shown != before:  # it is drawn a moment after it has its size
        page.wait_for_timeout(150)
        before, shown = shown, view.screenshot(timeout=60_000)
    image = Image.open(io.BytesIO(shown)).convert("L")
    dark = np.asarray(image)[4:-4, 4:-4] < 240
    rows, columns = np.flatnonzero(dark.any(axis=1)), np.flatnonzero(dark.any(axis=0))
    assert rows[0] > 0
    assert rows[-1] < dark.shape[0] - 1
    assert columns[0] > 0
    assert columns[-1] < dark.shape[1] - 1
    share = max(np.ptp(rows) / dark.shape[0], np.ptp(columns) / dark.shape[1])
    assert share > 0.4  # and it is not lost in it


def test_the_print_is_drawn_layer_by_layer(page):
    drawn = "document.getElementById('print-view').data.map((trace) => trace.name)"
    page.locator("#print-view").scroll_into_view_if_needed()
    page.wait_for_function("document.getElementById('print-view').data", timeout=60_000)
    assert {"contour", "matrix", "fibre"} <= set(page.evaluate(drawn))
    assert "travel" not in page.evaluate(drawn)
    page.locator("#print-travel").check()
    assert "travel" in page.evaluate(drawn)
    page.locator("#print-top").fill("0")
    page.locator("#print-alone").check()
    assert "fibre" not in page.evaluate(drawn)  # the lowest layer is matrix
    assert page.locator("#print-top-said").inner_text().startswith("1 of ")
    assert page.said == []


def test_a_slider_goes_through_the_steps_of_the_breaking_load(page):
    drawn = (
        "document.getElementById('breaking-view').data.map((trace) => [trace.name, trace.x.length])"
    )
    page.locator("#breaking-view").scroll_into_view_if_needed()
    page.wait_for_function("document.getElementById('breaking-view').data", timeout=60_000)
    said = page.locator("#breaking-step-said")
    assert said.inner_text().startswith("2 of 3: 1000 N at 0.2 mm; before it 2 cells")
    assert page.evaluate(drawn)[1:] == [["cracked before", 2], ["cracks now", 1]]
    page.locator("#breaking-step").fill("1")
    assert page.evaluate(drawn)[1:] == [["cracks now", 2]]
    row = page.locator("#breaking tbody tr").first.inner_text()
    assert "matrix, 900 N" in row
    assert page.said == []
