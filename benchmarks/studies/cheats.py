"""Paths that gain on paper what no print gives: what the verdict says, beside a judge of its own.

    python -m benchmarks.studies.cheats [cantilever|bracket ...] [--files FOLDER]

A cantilever of 100 x 14 x 6 mm, held at its root, with 20 N down at its tip, is given fifteen sets
of paths of 588 mm a layer that should not win, and six honest straight rows, by ``ccfem compare
--paths``. Beside what the command says of each stand the rules for strands of
`benchmarks.print_checks.strand_rules`, which share nothing with ccfem. A set that is ranked as
printable *wins* where it is stiffer than the honest rows, or as stiff though it breaks a rule; the
number of those is the exit code. An L bracket held at two faces follows, with straight rows beside
the strategies at equal fibre.
"""

import csv
import json
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from benchmarks.print_checks.strand_rules import Rules, broken, measure

__all__ = ["BRACKET", "CANTILEVER", "TOP", "Posed", "judged", "sets"]

LAYERS, HEIGHT, LENGTH = 6, 6.0, 98.0
"""Layers of the parts, their height, and the length of each of six strands a layer, mm."""
TOP = 14.0
"""Upper side of the cantilever, in tension, mm."""


@dataclass(frozen=True)
class Posed:
    """A flat part: its outline, mm, where it is held and loaded, and the strategies beside it.

    Faces are the planes at the part's ends along a direction.
    """

    name: str
    outline: tuple[tuple[float, float], ...]
    held: tuple[str, ...]
    loaded: str
    force: tuple[float, float, float]
    strategies: tuple[str, ...]

    @property
    def section(self) -> shapely.Polygon:
        """Section of the part at any height."""
        return shapely.Polygon(self.outline)

    def text(self) -> str:
        """Part file."""
        faces = (*self.held, self.loaded)
        patches = (
            f'[patches.side_{k}]\nrule = "plane"\nnormal = "{face}"\noffset = "max"\n'
            for k, face in enumerate(faces)
        )
        supports = (f'[[supports]]\npatch = "side_{k}"\n' for k in range(len(self.held)))
        return "\n".join(
            [
                f"layers = {LAYERS}",
                f"[planform]\noutline = {[list(corner) for corner in self.outline]}",
                f"height = {HEIGHT}\nedge_length = 2.0",
                "[material]\nmodulus = 3500.0\npoisson = 0.35",
                *patches,
                *supports,
                f'[[loads.down]]\nkind = "force"\npatch = "side_{len(self.held)}"',
                f"vector = {list(self.force)}",
            ]
        )


CANTILEVER = Posed(
    "cantilever",
    ((0.0, 0.0), (100.0, 0.0), (100.0, TOP), (0.0, TOP)),
    ("-x",),
    "x",
    (0.0, -20.0, 0.0),
    ("stream_function", "isocurve", "pruned"),
)
ARM = 66.0
"""Length of both arms of the bracket, mm."""
BRACKET = Posed(
    "bracket",
    ((0.0, 0.0), (ARM, 0.0), (ARM, 14.0), (14.0, 14.0), (14.0, ARM), (0.0, ARM)),
    ("-y", "x"),
    "y",
    (20.0, 0.0, 0.0),
    ("stream_function", "isocurve", "pruned", "contour_zigzag", "concentric"),
)
"""An L held at the underside and the end of its foot, with 20 N aside at the top of its wall."""

Line = np.ndarray


def _cut(points: Sequence[Sequence[float]] | Line, length: float = LENGTH) -> Line:
    """Beginning of a polyline, of a length."""
    line = np.array(points, dtype=float)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    assert along[-1] > length - 1e-9, f"{along[-1]:.1f} mm are too short"
    last = np.array([np.interp(length, along, column) for column in line.T])
    return np.vstack([line[along < length - 1e-9], last])


def _rows(heights: Iterable[float]) -> list[Line]:
    """Straight rows from the root on."""
    return [_cut([(0.0, y), (LENGTH, y)]) for y in heights]


def _woven(top: float, count: int = 6, depth: float = 2.0, angle: float = 17.5) -> list[Line]:
    """Pairs of strands, each up and down against the other within a depth."""
    half = depth / np.tan(np.radians(angle))
    x = half * np.arange(40.0)
    strands = []
    for number in range(count):
        down = (np.arange(40) + number) % 2
        strands.append(_cut(np.column_stack([x, top - (number // 2) * depth - depth * down])))
    return strands


def _square() -> Line:
    """Hairpin of a width: two right angles."""
    return np.array([(0.0, 0.0), (0.0, 1.0)])


def _bulb() -> Line:
    """Hairpin of a width as a bulb of short pieces: most of a circle of radius .75 mm."""
    side = np.arccos(-np.sqrt(0.75**2 - 0.5**2) / 0.75)
    turn = np.linspace(side, -side, 41)
    ring = 0.75 * np.stack([np.cos(turn), -np.sin(turn)], axis=1)
    return ring - ring[0]


def _serpentines(piece: float, top: float, bend: Callable[[], Line] = _square) -> list[Line]:
    """Six strands, one behind the other, of pieces along the part joined by hairpins."""
    turn, strands = bend(), []
    ahead = float(np.ptp(turn[:, 0]))
    for number in range(6):
        left = number * (piece + 0.05)
        ends = np.array([left + ahead, left + piece - ahead])
        points: list[tuple[float, float]] = []
        for row in range(12):
            sign = 1.0 if row % 2 == 0 else -1.0
            start, end = ends if sign > 0.0 else ends[::-1]
            points.append((start, top - row))
            points += [(end + sign * x, top - row - y) for x, y in turn.tolist()]
        strands.append(_cut(points))
    return strands


def _two_corners() -> list[Line]:
    """Back along the part by two right angles, 4.5 mm apart and more: three such in each half."""
    strands = []
    for left in (0.0, 50.0):
        for row in range(3):
            y, right, down = TOP - 0.5 - row, left + 49.0 - row, 8.5 - 2.0 * row
            corners = [(left, y), (right, y), (right, y - down), (left - 9.0, y - down)]
            strands.append(_cut(corners))
    return strands


def _short() -> list[Line]:
    """Pieces of 28 mm, under the cutter's length, where the moment is largest."""
    return [
        np.array([(x, TOP - 0.5 - row), (x + 28.0, TOP - 0.5 - row)])
        for row in range(7)
        for x in (0.0, 28.5, 57.0)
    ]


def _with_loops(corners: Sequence[Sequence[float]], radius: float, every: float) -> Line:
    """Polyline with a small loop to its right at even distances."""
    turn = np.linspace(0.0, 2.0 * np.pi, 25)
    points = [np.array(corners[:1], dtype=float)]
    for first, last in pairwise(np.array(corners, dtype=float)):
        size = float(np.linalg.norm(last - first))
        ahead = (last - first) / size
        aside = np.array([ahead[1], -ahead[0]])
        for at in np.arange(every, size - 0.5 * every, every):
            loop = np.outer(at + radius * np.sin(turn), ahead)
            points.append(first + loop + radius * np.outer(1.0 - np.cos(turn), aside))
        points.append(last[None])
    return np.concatenate(points)


def _rings() -> list[Line]:
    """Round the upper half, one in the other, with loops everywhere."""
    strands = []
    for row in range(3):
        top, right, low = TOP - 0.5 - row, 97.5 - row, 7.5 + row
        corners = [(0.0, top), (right, top), (right, low), (row, low), (row, top - 1.0)]
        strands.append(_cut(_with_loops(corners, 0.4, 16.0), 2.0 * LENGTH))
    return strands


def sets() -> dict[str, list[Line]]:
    """Paths of one layer by what they try; honest rows first, then the three of old."""
    half, low = TOP - 0.5, TOP - 0.5 - np.arange(6.0)
    back = [_cut([(0.0, y), (49.0, y), (0.0, y)]) for y in low]
    mixed = [
        *_rows(TOP - np.arange(4.0)),
        _serpentines(47.5, TOP - 4.0)[0],
        _woven(TOP - 4.0)[1],
    ]
    fold = [_cut([(0.0, y), (49.0, y), (0.0, y - 1e-3)]) for y in (TOP - 1.05, TOP - 2.05)]
    rows = [(0.0, y) for y in low]
    return {
        "honest_rows": _rows(low),
        "rows_on_border": _rows(TOP - np.arange(6.0)),
        "woven": _woven(half),
        "hairpins": _serpentines(15.5, half),
        "rows_too_close": _rows(half - 0.6 * np.arange(6.0)),
        "close_and_outside": _rows(TOP - 0.1 - 0.92 * np.arange(6.0)),
        "out_and_back": back,
        "hairpins_on_border": _serpentines(15.5, TOP),
        "woven_and_outside": [*_rows([TOP, TOP - 1.0]), *_woven(TOP - 2.0, 4)],
        "bulbs": _serpentines(15.5, half, _bulb),
        "two_corners": _two_corners(),
        "short_pieces": _short(),
        "bit_of_each": mixed,
        "outside_folded_woven": [*_rows([TOP - 0.05]), *fold, *_woven(TOP - 2.55, 3)],
        "loops": [_cut(_with_loops([row, (LENGTH, row[1])], 0.6, 14.0)) for row in rows],
        "rings_with_loops": _rings(),
    }


def bracket_rows() -> list[Line]:
    """Straight rows along the wall of the bracket, on its side in tension.

    As many as make a length that `contour_zigzag` and `concentric` can lay too.
    """
    return [np.array([(x, 0.5), (x, ARM - 0.5)]) for x in 0.5 + np.arange(10.0)]


def _stacked(lines: Sequence[Line]) -> Iterator[tuple[int, Line]]:
    """Layer and points (n, 3) of the lines on all layers."""
    for layer in range(LAYERS):
        z = HEIGHT * (layer + 0.5) / LAYERS
        for line in lines:
            yield layer, np.column_stack([line, np.full(len(line), z)])


def write(path: Path, lines: Sequence[Line]) -> None:
    """Write the lines, on all layers, as a table of paths."""
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(("x", "y", "z", "path", "layer"))
        for number, (layer, points) in enumerate(_stacked(lines)):
            table.writerows((*map(repr, point), number, layer) for point in points.tolist())


def examined(lines: Sequence[Line], part: Posed, rules: Rules) -> str:
    """Say which rules how many strands of a layer break."""
    layer = [points for number, points in _stacked(lines) if number == 0]
    strands = measure(layer, rules, lambda _: part.section)
    count = Counter(rule for strand in strands for rule in broken(strand, rules))
    return ", ".join(f"{rule} {count[rule]}/{len(strands)}" for rule in count) or "-"


def judged(
    part: Posed, given: dict[str, list[Line]], folder: Path
) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """Compare the sets beside the strategies by the command line: runs by name, lines of text."""
    file = folder / f"{part.name}.toml"
    file.write_text(part.text(), encoding="utf-8")
    for name, lines in given.items():
        write(folder / f"{name}.csv", lines)
    paths = ",".join(str(folder / f"{name}.csv") for name in given)
    command = [sys.executable, "-m", "ccfem", "compare", str(file), "--details", "--force"]
    command += ["--strategies", ",".join(part.strategies), "--paths", paths]
    command += ["--out", str(folder / part.name)]
    env = {**os.environ, "COLUMNS": "1000"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=env)
    record = folder / part.name / "results.json"
    if not record.exists():
        raise SystemExit(f"ccfem compare failed: {done.stderr[-2000:]}")
    runs = json.loads(record.read_text(encoding="utf-8"))["strategies"]
    return {run["name"]: run for run in runs}, done.stdout.splitlines()


def _remarks(name: str, said: Sequence[str], run: dict[str, Any]) -> str:
    """Collect what the command says of a set, the order of runs aside."""
    lines = [line.split(": ", 1)[1] for line in said if line.startswith(f"{name}: ")]
    lines = [line for line in lines if "undecided" not in line and "no difference" not in line]
    reason = run["why_not"] or run["failure"]
    lines = [line for line in lines if not reason or reason not in line]
    return "; ".join([reason] * bool(reason) + lines) or "-"


def study(part: Posed, given: dict[str, list[Line]], folder: Path) -> int:
    """Print the table of a part; how many sets win."""
    runs, said = judged(part, given, folder)
    honest = next(iter(given))
    ratio = {
        name: float(run["total"].get("stiffness_ratio_tension", np.nan))
        for name, run in runs.items()
    }
    print(f"\n| {part.name} | printable | stiffness ratio | N/mm | bound | referee | remarks |")
    print("|---|---|---|---|---|---|---|")
    wins = 0
    for name in sorted(runs, key=lambda name: -ratio[name]):
        run, total = runs[name], runs[name]["total"]
        wrong = examined(given[name], part, Rules()) if name in given else ""
        most = ratio[honest] * (1.001 if wrong == "-" else 0.98)
        won = name in given and name != honest and run["printable"] and ratio[name] > most
        wins += won
        print(
            f"| {name}{' (wins)' if won else ''} | {'yes' if run['printable'] else 'no'} "
            f"| {ratio[name]:.3f} | {total.get('stiffness', np.nan):.1f} "
            f"| {total.get('share_of_gain', np.nan):.0%} | {wrong} | {_remarks(name, said, run)} |"
        )
    verdict = [line for line in said if " makes the " in line or "ndecided between" in line]
    print("\n".join(["", *verdict, *(line for line in said if "the bound" in line)]))
    return wins


def main(arguments: list[str]) -> int:
    """Print both tables; how many sets of paths win that should not."""
    folder = None
    if "--files" in arguments:
        at = arguments.index("--files")
        folder = Path(arguments[at + 1])
        folder.mkdir(parents=True, exist_ok=True)
        arguments = arguments[:at] + arguments[at + 2 :]
    names = arguments or ["cantilever", "bracket"]
    wins = 0
    with tempfile.TemporaryDirectory() as temporary:
        place = folder or Path(temporary)
        if "cantilever" in names:
            wins += study(CANTILEVER, sets(), place)
        if "bracket" in names:
            wins += study(BRACKET, {"straight_rows": bracket_rows()}, place)
    return wins


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
