"""A browser that draws by software, and clicks of a person on the page of the workbench in it."""

import os
import shutil
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
