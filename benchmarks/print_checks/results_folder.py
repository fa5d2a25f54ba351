"""Hold what a folder of results says against its G-code, and every strand against the rules.

    python -m benchmarks.print_checks.results_folder FOLDER PART.vtu [...] [--pictures DIR]

A folder is one of ``ccfem plan ... --gcode --out FOLDER``, with flat layers; PART.vtu is the part's
mesh, as of ``ccfem solve PART -o PART.vtu``. Only files are read: the strands of the G-code by a
printer on paper, those of the waypoints, the numbers of ``results.csv``, ``results.json`` and
``report.html``. The strands of the two are paired by length and place.
"""

import csv
import json
import re
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import shapely

from benchmarks.print_checks.printer import KNOWN, Run, follow
from benchmarks.print_checks.sections import Sections
from benchmarks.print_checks.strand_checks import cut_of, measured, rules_of, strands_of
from benchmarks.print_checks.strand_rules import Measured, Rules, broken, measure

__all__ = ["Folder", "agreement", "figures", "read_waypoints", "tally"]

FRAMES = {
    (1, 0, 0): ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    (0, 1, 0): ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    (0, 0, 1): ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
}
"""Axes of the printer's tool in those of the mesh, by the build direction."""
_NEAR = 0.1
"""Largest distance, mm, of strands that are the same, and of their lengths."""
_QUADRATIC = (
    *((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3)),
    *((4, 5, 6, 8), (6, 5, 9, 8), (6, 9, 7, 8), (4, 6, 7, 8)),
)
"""Corners of the eight tetrahedra in one with midside nodes, in VTK's order."""


def read_waypoints(path: Path) -> list[np.ndarray]:
    """Strands (n, 3) of a file of waypoints, in the frame of the tool."""
    strands: list[list[list[float]]] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if line == "S":
            strands.append([])
        elif line.startswith("X"):
            strands[-1].append([float(word[1:]) for word in line.split()])
    return [np.array(points) for points in strands]


@dataclass(frozen=True)
class Said:
    """Strands, cuts, s of laying and of the print, g of fibre, mm of fibre."""

    strands: float
    cuts: float
    seconds: float
    mass: float
    length: float


class Folder:
    """A folder of results with G-code.

    Parameters
    ----------
    path : Path
    part : Path
        Mesh of the part.
    strategy : str, optional
        Default: that of the G-code.
    """

    def __init__(self, path: Path, part: Path, strategy: str | None = None) -> None:
        self.path = path
        self.json = json.loads((path / "results.json").read_text(encoding="utf-8"))
        self.strategy = strategy or next(path.glob("*.gcode")).stem
        self.machine = _machine(self.json["machine"])
        build = tuple(round(x) for x in self.json["case"]["build"])
        self.frame = np.array(FRAMES[build], dtype=float)
        points, cells = _tetrahedra(part)
        corners = points @ self.frame.T
        low, high = corners.min(axis=0), corners.max(axis=0)
        middle = 0.5 * (low + high)[:2] - 0.5 * np.array(self.machine.gcode.bed[:2])
        self.shift = np.append(middle, low[2])
        mesh: Any = SimpleNamespace(points=points, cells=cells, corners=cells)
        self.section = Sections(mesh, self.frame, self.shift).region

    @property
    def rules(self) -> Rules:
        """Rules with the values of the machine."""
        return rules_of(self.machine)

    @cached_property
    def run(self) -> Run:
        """What a printer does with the file."""
        text = (self.path / f"{self.strategy}.gcode").read_text(encoding="utf-8")
        profile = self.machine.gcode
        offset = profile.offset if profile.offset_by == "gcode" else (0.0, 0.0, 0.0)
        return follow(text, self.firmware, offset)

    @property
    def firmware(self) -> str:
        """Name by which `printer` knows the machine: the one whose words the file has."""
        words = str(vars(self.machine.gcode))
        marks = {"M1001": "aura_like", "SET_SERVO": "klipper", "M568": "reprap_duet"}
        marks |= {"M116": "reprap_duet", "M532": "aura_like"}
        name = next((name for mark, name in marks.items() if mark in words), "marlin_two_tools")
        assert name in KNOWN
        return name

    @cached_property
    def printed(self) -> list[Measured]:
        """Strands of the G-code."""
        return measured(self, self.run)

    @cached_property
    def planned(self) -> list[Measured]:
        """Strands of the waypoints, on the bed."""
        file = self.path / f"{self.strategy}_waypoints.txt"
        lines = [points - self.shift for points in read_waypoints(file)]
        return measure(lines, self.rules, self.section)

    def file(self) -> Said:
        """Count what is in the G-code; laying is with the travel of tool 1, as in the table."""
        strands = strands_of(self.run)
        length = sum(step.length for steps in strands for step in steps)
        seconds = sum(step.length / step.speed for steps in strands for step in steps)
        seconds += sum(s.length / s.speed for s in self.run.steps if s.tool == 1 and s.rapid)
        cuts = sum(not np.isnan(cut_of(steps)) for steps in strands)
        return Said(len(strands), cuts, seconds, self.grams * length, length)

    @property
    def grams(self) -> float:
        """Mass of a mm of fibre, g."""
        machine = self.machine
        if machine.fibre_tex:
            return 1e-6 * float(machine.fibre_tex)
        return 1e-3 * float(machine.filament_area * machine.fibre_density)

    def fibre_tool(self) -> float:
        """All the time of tool 1, s: with feeds, strands beside the part and waits for cuts."""
        mine = (step for step in self.run.steps if step.tool == 1 and step.speed)
        return self.run.waited + sum((s.length or abs(s.fed)) / s.speed for s in mine)

    def head(self) -> tuple[float, float]:
        """Time of the print, s, and mass of fibre, g, that the head of the file says."""
        head = self.run.head
        return float(head["TIME"]), float(head["filament used [g]"].split(",")[1])

    def table(self) -> Said:
        """Read what results.csv says."""
        with (self.path / "results.csv").open(encoding="utf-8", newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["layer"] == "total"]
        (row,) = (row for row in rows if row["strategy"] == self.strategy)
        return _said(row, "print_time_nearest")

    def record(self) -> Said:
        """Read what results.json says."""
        return _said(self.verdict["total"], "print_time_nearest")

    @property
    def verdict(self) -> dict[str, Any]:
        """Record of the strategy in results.json."""
        runs: list[dict[str, Any]] = self.json["strategies"]
        return next(run for run in runs if run["name"] == self.strategy)

    def page(self) -> Said:
        """Read what the table of the report says; NaN for what it does not show."""
        text = (self.path / "report.html").read_text(encoding="utf-8")
        rows = re.findall(
            r"<tr[^>]*>\s*<td class=\"name\" data-value=\"([^\"]*)\"(.*?)</tr>", text, re.S
        )
        cells: dict[str, str] = {}
        for name, rest in rows:
            if name == self.strategy and not cells:
                cells = dict(re.findall(r'data-title="([^"]*)" data-value="([^"]*)"', rest))
        layers = len(self.json["case"]["heights"])
        strands = float(cells.get("paths a layer", "nan")) * layers
        return Said(
            float(cells.get("strands", strands)),
            float(cells.get("cuts", "nan")),
            float(cells.get("laying fibre, min", "nan")),
            float(cells.get("fibre, g", "nan")),
            float(cells.get("fibre, mm a layer", "nan")) * layers,
        )

    def pairs(self) -> list[tuple[int, int]]:
        """Strands of the G-code and of the waypoints that are the same."""
        planned = [_Line(strand.points) for strand in self.planned]
        free = set(range(len(planned)))
        pairs = []
        for number, strand in enumerate(self.printed):
            line = _Line(strand.points)
            same = next((k for k in sorted(free) if line.same(planned[k])), None)
            if same is not None:
                free.discard(same)
                pairs.append((number, same))
        return pairs


def _machine(table: dict[str, Any]) -> Any:
    """Values of a machine, with the height of its strands and the tail behind its cuts."""
    tables = {k: SimpleNamespace(**v) for k, v in table.items() if isinstance(v, dict)}
    machine = SimpleNamespace(**{**table, **tables})
    least = 0.0 if machine.pressed else machine.filament_area / machine.fibre_width
    machine.strand_height = max(machine.fibre_height, least)
    tail = machine.cutter_distance
    machine.tail = min(42.0, machine.minimum_length) if tail is None else tail
    return machine


def _said(row: dict[str, Any], seconds: str) -> Said:
    """Numbers of a row of a table."""
    return Said(*(float(row[k]) for k in ("paths", "cuts", seconds, "fibre_mass", "fibre_length")))


class _Line:
    """A strand, for comparison with others."""

    def __init__(self, points: np.ndarray) -> None:
        self.height = float(points[:, 2].mean())
        self.line = shapely.linestrings(points[:, :2])
        self.length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        self.ends = points[[0, -1]]

    def same(self, other: "_Line") -> bool:
        """Whether another strand has the same place, length and ends, in either direction."""
        if abs(self.height - other.height) > 0.01 or abs(self.length - other.length) > _NEAR:
            return False
        closed = np.linalg.norm(np.subtract(*other.ends)) < _NEAR
        off = min(
            np.linalg.norm(self.ends - other.ends, axis=1).max(),
            np.linalg.norm(self.ends - other.ends[::-1], axis=1).max(),
        )
        if off > _NEAR and not closed:
            return False
        return bool(shapely.hausdorff_distance(self.line, other.line) < _NEAR)


def _tetrahedra(part: Path) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 3) and tetrahedra (m, 4) of a mesh; those with midside nodes in eight."""
    import pyvista

    grid = pyvista.read(part)
    cells = np.asarray(next(iter(grid.cells_dict.values())))
    if cells.shape[1] == 10:
        cells = np.concatenate([cells[:, corners] for corners in _QUADRATIC])
    return np.asarray(grid.points, dtype=float), cells


def tally(strands: Sequence[Measured], rules: Rules) -> Counter[str]:
    """Strands that break each rule."""
    return Counter(rule for strand in strands for rule in broken(strand, rules))


def figures(strands: Sequence[Measured], rules: Rules) -> str:
    """Say how many strands break each rule, and by how much."""
    count, total = tally(strands, rules), sum(s.length for s in strands)
    share = sum(s.length for s in strands if s.free < rules.length - 0.01) / max(total, 1e-9)
    places = {tuple(np.round(p, 2)) for s in strands for p in s.crossings}
    return (
        f"{len(strands):4d} strands: {count['folds']} fold, {count['run']} have no free run "
        f"({share:.1%} of the length), {count['outside']} outside "
        f"(most {max((s.outside for s in strands), default=0.0):.0%}), {count['crossings']} cross "
        f"({len(places)} places), {count['over']} over ({sum(s.over for s in strands):.0f} mm; "
        f"{sum(s.close for s in strands) / max(total, 1e-9):.1%} close), "
        f"{count['cut']} cut and {count['start']} begun with less than {rules.held:g} mm held"
    )


def agreement(folder: Folder) -> list[tuple[str, str, bool]]:
    """Rows of what table, record, page and file say: name, numbers, whether they agree.

    The table's time is all that of the fibre tool, with feeds and the strand beside the part; its
    mass is all the fibre that the print takes, as in the head of the file.
    """
    file, (whole, used) = folder.file(), folder.head()
    rows = []
    for name in ("table", "record", "page"):
        said: Said = getattr(folder, name)()
        good = all(
            np.isnan(a) or abs(a - b) <= most * b
            for a, b, most in (
                (said.strands, file.strands, 0.0),
                (said.cuts, file.cuts, 0.0),
                (said.seconds, folder.fibre_tool(), 0.02),
                (said.mass, used, 0.01),
            )
        )
        rows.append((name, _numbers(said), good))
    rows.append(("file", _numbers(file), True))
    rows.append(("tool 1", f"{'':25}{folder.fibre_tool() / 60:7.1f} min", True))
    rows.append(("head", f"{'':25}{whole / 60:7.1f} min {used:8.3f} g", True))
    return rows


def _numbers(said: Said) -> str:
    return (
        f"{said.strands:6.0f} strands {said.cuts:6.0f} cuts {said.seconds / 60:7.1f} min "
        f"{said.mass:8.3f} g {said.length:9.0f} mm"
    )


def draw(folder: Folder, file: Path) -> None:
    """Draw the layer with the most folds: red what folds, magenta crossings, blue what is outside.

    Beside it, the four folds that turn most, with the strand of each.
    """
    from matplotlib.figure import Figure

    layers: dict[float, list[Measured]] = {}
    for strand in folder.printed:
        layers.setdefault(round(float(strand.points[0, 2]), 3), []).append(strand)
    level = max(layers, key=lambda z: sum(len(s.folds) + len(s.crossings) for s in layers[z]))
    strands = layers[level]
    worst = sorted((s for s in strands if len(s.folds)), key=lambda s: -s.turn)[:4]
    figure = Figure(figsize=(20, 10), layout="constrained")
    grid = figure.add_gridspec(2, 4)
    axes = [figure.add_subplot(grid[:, :2])]
    axes += [figure.add_subplot(grid[k // 2, 2 + k % 2]) for k in range(len(worst))]
    for axis, shown in zip(axes, [None, *worst], strict=True):
        for ring in shapely.get_rings(shapely.get_parts(folder.section(round(level, 4)))):
            axis.plot(*shapely.get_coordinates(ring).T, color="black", linewidth=0.8)
        for strand in strands:
            outside = strand.outside > folder.rules.outside
            axis.plot(*strand.points[:, :2].T, color="#3070c0" if outside else "#a0a0a0", lw=0.8)
        for strand in strands if shown is None else [shown]:
            if shown is not None:
                axis.plot(*strand.points[:, :2].T, ".-", color="black", lw=1.0, ms=2.0)
            for begin, end in strand.folds:
                part = strand.at(np.linspace(begin, end, 30))
                axis.plot(*part[:, :2].T, "o-", color="#d01020", lw=2.0, ms=3.0)
            axis.plot(*strand.crossings.T, "x", color="#c000c0")
        if shown is not None:
            x, y, _ = shown.at([shown.folds[0].mean()])[0]
            axis.set(xlim=(x - 8.0, x + 8.0), ylim=(y - 8.0, y + 8.0))
            axis.set_title(
                f"{shown.turn:.0f} degrees, free {shown.free:.1f} of {shown.length:.1f} mm"
            )
        axis.set_aspect("equal")
    axes[0].set_title(f"{folder.path.name}: {level:g} mm")
    figure.savefig(file, dpi=70)


def main(arguments: Iterable[str]) -> int:
    """Print what is found of each folder; how many say other than their file."""
    names, wrong, pictures = list(arguments), 0, None
    if "--pictures" in names:
        at = names.index("--pictures")
        pictures = Path(names[at + 1])
        pictures.mkdir(parents=True, exist_ok=True)
        names = names[:at] + names[at + 2 :]
    for path, part in zip(names[::2], names[1::2], strict=True):
        folder = Folder(Path(path), Path(part))
        run = folder.verdict
        verdict = "printable" if run["printable"] else f"not printable: {run['why_not']}"
        print(f"{path}: {folder.strategy}, {verdict}")
        for name, numbers, good in agreement(folder):
            print(f"  {name:7}{numbers}{'' if good else '   differs from the file'}")
            wrong += not good
        pairs = folder.pairs()
        print(
            f"  {len(pairs)} strands are the same in both; {len(folder.printed) - len(pairs)} are "
            f"in the file alone, {len(folder.planned) - len(pairs)} in the waypoints alone"
        )
        for name, strands in (("file", folder.printed), ("paths", folder.planned)):
            print(f"  {name:6}{figures(strands, folder.rules)}", flush=True)
        if pictures is not None:
            draw(folder, pictures / f"{Path(path).name}.png")
    return wrong


if __name__ == "__main__":
    raise SystemExit(min(main(sys.argv[1:]), 1))
