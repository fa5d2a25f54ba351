"""The views of a report read back from its folder: table, layers, strands, part and whole print."""

import json
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.base.tensor import from_voigt, von_mises
from ccfem.body.files.mesh_file import read_mesh
from ccfem.comparison.plot.colours import LINK, rgb, scale
from ccfem.comparison.report.deformed_view import deformed
from ccfem.comparison.report.packing import Rounded, pack, unpack
from ccfem.comparison.report.print_view import COLOURS
from ccfem.comparison.table import Cell, Head, Table
from ccfem.fem.stress_files.stress_arrays import COMPONENTS
from ccfem.fem.stress_files.stress_file import VTK_COMPONENTS

_DATA = re.compile(r'<script type="application/octet-stream" id="data">([^<]*)</script>')
_TAKEN = ("report.html", "results.csv", "results.json", "paths.vtp", "parts.csv")
_SUFFIXES = (".gcode", ".vtu", "_waypoints.txt", "_waypoints.csv", "_cell.csv", "_trim.csv")
_NOT_KNOWN = 255
"""Byte of a value that is not known (`packing.as_bytes`)."""


@dataclass(frozen=True)
class Pieces:
    """Straight pieces of fibre of one strategy on one layer."""

    ends: FloatArray  # (s, 2, 3), mm
    # (s,) in [0, 1]: force in each over `RunResults.most_force`; 0 where it is not known
    share: FloatArray
    link: BoolArray  # (s,): whether a piece only joins strands

    @property
    def colours(self) -> FloatArray:
        """Colours (s, 3), 0 to 1, by force; links have their own."""
        return np.where(self.link[:, None], np.array(rgb(LINK)) / 255.0, _shades(self.share))


@dataclass(frozen=True)
class Surface:
    """Surface of the part, coloured by a value at its points."""

    points: FloatArray  # (n, 3), mm
    triangles: IntArray  # (t, 3)
    share: FloatArray  # (n,) in [0, 1]: of the largest value
    said: str  # what is drawn, and the largest value

    @property
    def colours(self) -> FloatArray:
        """Colours (n, 3), 0 to 1, by value."""
        return _shades(self.share)


@dataclass(frozen=True)
class PrintLayer:
    """Lines of a layer of the whole print, in straight pieces."""

    said: str  # which layer it is, and up to where
    ends: FloatArray  # (s, 2, 3), mm
    kind: IntArray  # (s,): place in `ccfem.comparison.report.print_view.KINDS`

    @property
    def colours(self) -> FloatArray:
        """Colours (s, 3), 0 to 1, by kind."""
        return np.array([rgb(colour) for colour in COLOURS])[self.kind] / 255.0


@dataclass(frozen=True)
class RunResults:
    """Results in a folder: what ``results.json`` records, and what ``report.html`` draws."""

    folder: Path
    record: dict[str, Any]
    # What `ccfem.comparison.report.html_report.report_html` packs: the ``table``, the ``part`` with
    # displacement and stress, ``layers`` with paths, the ``print``; empty where it has none.
    views: dict[str, Any]

    @property
    def table(self) -> Table:
        """Columns that are shown first, the best run on top."""
        tree = self.views.get("table") or {"heads": [], "rows": []}
        rows = ((name, tuple(Cell(**c) for c in cells), why) for name, cells, why in tree["rows"])
        return Table(tuple(Head(**head) for head in tree["heads"]), tuple(rows))

    @property
    def part_file(self) -> str:
        """Text of the part file when it was run; empty where there was none."""
        return str(self.views.get("part_file", ""))

    @property
    def names(self) -> list[str]:
        """Strategies whose paths can be shown, the best first, or else prints."""
        runs = self._stack["runs"] or (self.views.get("print") or {}).get("runs", ())
        return [str(run["name"]) for run in runs]

    @property
    def layers(self) -> list[dict[str, Any]]:
        """Layers that can be shown."""
        return list(self._stack["layers"])

    @property
    def first(self) -> int:
        """Layer that shows most."""
        return int(self._stack["first"])

    @property
    def most_force(self) -> float:
        """End of the scale of forces, N."""
        return float(self.views["layers"]["scales"]["force"])

    @property
    def width(self) -> float:
        """Width of a strand, mm."""
        return float(self.views["layers"]["width"])

    @cached_property
    def _stack(self) -> dict[str, Any]:
        stacks = (self.views.get("layers") or {}).get("stacks") or [
            {"runs": [], "layers": [], "first": 0}
        ]
        return dict(stacks[0])

    def surface(self, view: str) -> Surface | None:
        """Surface of the part without fibre, as "stress" or "moved"; None where it is not known."""
        part = self.views.get("part") or {}
        if "moved" not in part:
            return None
        triangles = np.asarray(part["triangles"], dtype=np.int64).reshape(-1, 3)
        if view == "stress":
            most = float(part["most_stress"])
            caption = f"von Mises stress, up to {most:.3g} MPa"
            return Surface(part["points"], triangles, np.asarray(part["stress"]) / 254.0, caption)
        times, most = float(part["scale"]), float(part["most"])
        caption = f"displacement, up to {most:.3g} mm, drawn {times:g} times as large"
        points = part["points"] + times * part["moved"]
        return Surface(points, triangles, np.asarray(part["moved_size"]) / 254.0, caption)

    @property
    def files(self) -> dict[str, Path]:
        """Files that can be taken away, by name, the report first."""
        taken = [n for n in self.record["files"] if n in _TAKEN or n.endswith(_SUFFIXES)]
        return {name: self.folder / name for name in sorted(taken, key=lambda n: n != _TAKEN[0])}

    def why_not(self, name: str) -> str:
        """Why the paths of a strategy cannot be printed; empty where they can."""
        return next((str(r["why_not"]) for r in self.record["strategies"] if r["name"] == name), "")

    def pieces(self, name: str, layer: int) -> Pieces:
        """Pieces of fibre of a strategy on the layer at a place of `layers`."""
        view, strands = self.layers[layer], self._laid(name, layer)
        points = _in_space(
            strands["space"] if "space" in strands else strands["points"], view["space"]
        )
        last = np.zeros(len(points), dtype=bool)
        last[np.asarray(strands["offsets"], dtype=int)[1:] - 1] = True
        start = np.flatnonzero(~last)
        force = np.asarray(strands["force"], dtype=float)
        share = np.where(force == _NOT_KNOWN, 0.0, force / 254.0)
        link = np.zeros(len(points)) if strands["link"] is None else np.asarray(strands["link"])
        ends = np.stack([points[start], points[np.minimum(start + 1, len(points) - 1)]], axis=1)
        return Pieces(ends.reshape(-1, 2, 3), share[start], link[start] > 0)

    def caption(self, name: str, layer: int) -> str:
        """Words of the report below a layer of a strategy."""
        return str(self._laid(name, layer)["caption"])

    def print_layers(self, name: str) -> list[PrintLayer]:
        """Layers of the whole print of a strategy; empty where it has none."""
        prints = (self.views.get("print") or {}).get("runs", ())
        runs = [run for run in prints if run["name"] == name]
        return [_print_layer(view, run["count"]) for run in runs for view in run["layers"]]

    def _laid(self, name: str, layer: int) -> dict[str, Any]:
        return dict(self._stack["runs"][self.names.index(name)]["layers"][layer])

    def rims(self, layer: int) -> FloatArray:
        """Border of a layer in pieces, (s, 2, 3), mm."""
        view = self.layers[layer]
        flat = isinstance(view["space"], list)
        points = _in_space(view["rims"] if flat else view["space"], view["space"])
        offsets = np.asarray(view["rim_offsets"], dtype=int)
        inner = np.setdiff1d(np.arange(len(points)), offsets[1:] - 1)
        return np.stack([points[inner], points[inner + 1]], axis=1).reshape(-1, 2, 3)


def _shades(share: FloatArray) -> FloatArray:
    """Colours (n, 3), 0 to 1, of shares of the largest value."""
    return np.asarray(scale("size")(np.clip(share, 0.0, 1.0))[:, :3])


def _print_layer(view: dict[str, Any], count: int) -> PrintLayer:
    points, offsets = np.asarray(view["points"]), np.asarray(view["offsets"], dtype=int)
    start = np.setdiff1d(np.arange(len(points)), offsets[1:] - 1)
    kind = np.repeat(np.asarray(view["kind"], dtype=int), np.diff(offsets))[start]
    caption = f"Layer {view['index'] + 1} of {count}, up to {view['top']:.4g} mm"
    return PrintLayer(caption, np.stack([points[start], points[start + 1]], axis=1), kind)


def _in_space(points: FloatArray, space: Any) -> FloatArray:
    """Points (n, 3), mm, of a layer: of a flat one from its plane, whose frame and height follow.

    Those of a curved layer are in space already.
    """
    if not isinstance(space, list):
        return np.asarray(points)
    frame, height = np.reshape(space[:9], (3, 3)), float(space[9])
    return np.asarray(points).reshape(-1, 2) @ frame[:2] + height * frame[2]


def read_results(folder: Path) -> RunResults:
    """Read the results of a comparison, a plan, or a print of several parts."""
    try:
        names = [name for name in ("results.json", "bed.json") if (folder / name).exists()]
        record = json.loads((folder / (names or ["results.json"])[0]).read_text(encoding="utf-8"))
        page = (folder / "report.html").read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise InputError(f"{folder} holds no results that can be shown ({error})") from None
    data = _DATA.search(page)
    record.setdefault("files", [path.name for path in sorted(folder.iterdir())])
    return RunResults(folder, record, unpack(data[1]) if data else {})


def read_solution(file: Path, part_file: str = "") -> RunResults:
    """Read what ``ccfem solve`` has written of one load case."""
    import pyvista

    try:
        mesh, values = read_mesh(file), pyvista.read(file).point_data
        used, triangles = np.unique(mesh.boundary[:, :3], return_inverse=True)
        six = [VTK_COMPONENTS.index(component) for component in COMPONENTS]
        mises = von_mises(from_voigt(np.asarray(values["stress"])[used][:, six]))
        moved = np.asarray(values["displacement"])
    except (KeyError, ValueError, IndexError) as error:
        raise InputError(f"{file} holds no solution that can be shown ({error})") from None
    points, most = mesh.points[used], float(np.linalg.norm(moved, axis=1).max())
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    part = {"points": Rounded(points, 1e-4 * size), "triangles": triangles.reshape(-1, 3)}
    part |= deformed(moved[used], most, mises, np.arange(len(points)), size)
    record = {"files": [file.name], "strategies": []}
    return RunResults(file.parent, record, unpack(pack({"part": part, "part_file": part_file})))
