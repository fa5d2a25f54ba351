"""G-code of a whole part: matrix by tool 0, fibre by tool 1 with its cuts, moves between them.

Conventions of the file: mm and mm/min; X, Y, Z absolute, E relative (M83). G1 lays material, G0
only travels. E of the matrix is length of filament, so that a line has the volume of its length,
its width and the height that it lays (`ccfem.printing.laid_layer`). E of the fibre is length of
fibre: before a path, the distance from the cutter to the nozzle and a little more (G1 with E
alone), then the distance that the nozzle moves. The cut comes that first distance before the end of
the path; the rest is dragged out and laid by G1 without E.

All that happens is decided before, in `ccfem.printing`; here it is only written.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.parallel import in_processes
from ccfem.base.whole import whole_file
from ccfem.geometry.polylines import extent
from ccfem.machine.kinematics import axis_values
from ccfem.machine.machine import Machine
from ccfem.paths.toolpaths import FIBRE
from ccfem.printing.export.thumbnail import thumbnail_lines
from ccfem.printing.laid_layer import COORDINATE_DIGITS
from ccfem.printing.moves import (
    CUT,
    EVENTS,
    FAN,
    FEED,
    LAY,
    LAYER,
    PATH_END,
    PATH_START,
    PAUSE,
    ROLES,
    TOOL,
    TRAVEL,
    WAIT,
    Arcs,
    Moves,
    is_any,
)
from ccfem.printing.part_moves import part_moves
from ccfem.printing.print_plan import PrintPlan
from ccfem.printing.print_totals import PrintTotals, print_totals
from ccfem.printing.recorder import feed_digits

_ZEROS = re.compile(r"\.?0+(?= |$)")
"""Zeros at the end of a number with a point, and that point."""
_AHEAD = re.compile(r"(?<=[A-Z])(-?)0(?=\.)")
"""The zero ahead of a point."""

TYPES = {
    "prusa": {
        "contour": "External perimeter",
        "infill": "Solid infill",
        "fibre": "Internal infill",
        "tail": "Internal infill",
        "short": "Internal infill",
        "sparse": "Internal infill",
        "pad": "Support material",
        "block": "Wipe tower",
        "skirt": "Skirt/Brim",
    },
    "cura": {
        "contour": "WALL-OUTER",
        "infill": "SKIN",
        "fibre": "FILL",
        "tail": "FILL",
        "short": "FILL",
        "sparse": "FILL",
        "pad": "SUPPORT",
        "block": "PRIME-TOWER",
        "skirt": "SKIRT",
    },
}
"""Words of ``;TYPE:`` by what viewers read."""


def write_gcode(path: str | Path, plan: PrintPlan, machine: Machine, title: str = "") -> None:
    """Write the G-code of a part, whole or not at all, with a title at the head of the file.

    Raises
    ------
    InputError
        When the file cannot be written, or a nozzle would leave the bed.
    """
    pieces = gcode_pieces(part_moves(plan, machine), plan, machine, title)
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(pieces)


def gcode(plan: PrintPlan, machine: Machine, title: str = "") -> str:
    """G-code of a part, as `write_gcode` writes it."""
    return gcode_of_moves(part_moves(plan, machine), plan, machine, title)


def gcode_of_moves(moves: Moves, plan: PrintPlan, machine: Machine, title: str = "") -> str:
    """G-code of moves that were made of a plan; title as of `gcode_head`."""
    return "".join(gcode_pieces(moves, plan, machine, title))


def gcode_pieces(
    moves: Moves,
    plan: PrintPlan,
    machine: Machine,
    title: str = "",
    doubts: Sequence[str] = (),
    totals: PrintTotals | None = None,
) -> Iterator[str]:
    """Yield the text of `gcode_of_moves` layer by layer: that of a large print fills memory.

    The totals of the moves may be counted already.
    """
    totals = print_totals(moves, machine) if totals is None else totals
    progress = _progress(totals, machine)
    rows = _Rows.of(moves, machine)
    yield "\n".join(gcode_head(moves, plan, machine, totals, title, doubts)) + "\n"
    lines = _Lines(machine, plan, progress)
    below = float(plan.top[plan.first - 1]) if plan.first else 0.0
    warm = machine.process if machine.process.warm_height > below else None
    values = {**lines.values}
    values["bed_temperature"] += warm.warm_bed if warm else 0.0
    values["matrix_temperature"] += warm.warm_matrix if warm else 0.0
    values |= {"layers": len(plan.top), "layer": plan.first, "height": below}
    lines.fill("resume" if plan.first else "start", **values)
    yield "\n".join([*lines.lines, ""])
    # All that is said once is said anew on each layer, so that layers can be written side by side.
    begins = np.flatnonzero(moves.event == LAYER).tolist()
    edges = [0, *(row for row in begins if row), len(moves)]

    def of_layer(*piece: int) -> str:
        return rows.text(_Lines(machine, plan, progress), slice(*piece))

    yield from in_processes(of_layer, edges[:-1], edges[1:])
    lines.lines.clear()
    lines.fill("end", layers=len(plan.top))
    yield "\n".join(lines.lines) + "\n"


@dataclass(frozen=True)
class _Rows:
    """Moves with what their lines say: the axes after each row, speeds, and arcs that end there.

    Columns are those of `Moves`; those of `feeds` are, at the end of an arc, of all its rows.
    """

    moves: Moves
    axes: FloatArray
    speeds: FloatArray
    feeds: tuple[FloatArray, FloatArray]
    first: int
    arc_of: IntArray | None = None
    centres: Sequence[str] = ()

    @classmethod
    def of(cls, moves: Moves, machine: Machine) -> "_Rows":
        """Rows of the moves of a machine."""
        axes = _axes(moves, machine)
        first = int(is_any(moves.event, TRAVEL, LAY).argmax()) if len(moves) else 0
        feeds = (moves.feed, moves.beside)
        if moves.arcs is None:
            return cls(moves, axes, _speeds(moves, axes), feeds, first)
        digits = feed_digits(machine)
        feeds = (_summed(feeds[0], moves.arcs, digits), _summed(feeds[1], moves.arcs, digits))
        centres = _centres(moves.arcs, moves, machine.gcode.compact)
        return cls(moves, axes, _speeds(moves, axes), feeds, first, _arcs_of(moves), centres)

    def text(self, lines: "_Lines", some: slice) -> str:
        """Text of some rows."""
        moves, axes = self.moves, self.axes[some]
        before = max(some.start - 1, 0)
        moved = np.diff(
            self.axes[before : some.stop], axis=0, prepend=self.axes[before : before + 1]
        )
        moved = (moved != 0.0)[some.start - before :]
        if some.start <= self.first < some.stop:
            moved[self.first - some.start] = True  # the first move names all axes
        arc_of = np.full(len(axes), _NO_ARC) if self.arc_of is None else self.arc_of[some]
        moved[arc_of >= 0, :2] = True
        places = lines.places(axes, moved, moves.tool[some])
        numbers = (moves.event, moves.tool, *self.feeds, self.speeds, moves.amount)
        of_lines = (moves.role, moves.width, moves.height, moves.strand)
        columns = (column[some].tolist() for column in (*numbers, *of_lines))
        first = self.first - some.start
        for row, (
            (event, tool, feed, beside, speed, value, role, width, height, strand),
            arc,
            place,
        ) in enumerate(zip(zip(*columns, strict=True), arc_of.tolist(), places, strict=True)):
            if arc == _IN_ARC:
                continue
            if event in (TRAVEL, LAY):
                if event == LAY:
                    lines.say(role, width, height)
                if arc >= 0:
                    lines.arc(self.centres[arc], tool, place, feed, beside, speed)
                else:
                    lines.move(event, tool, place, feed, beside, speed, row == first)
            elif event == FEED:
                lines.feed(tool, feed, beside, speed)
            else:
                lines.happen(event, tool, value, strand)
        return "\n".join([*lines.lines, ""])


_IN_ARC, _NO_ARC = -2, -1
"""A row that its arc stands for, and one of no arc; others have the number of the arc they end."""


def _arcs_of(moves: Moves) -> IntArray:
    """Find the number of the arc that ends with each row (n,), `_IN_ARC` or `_NO_ARC`."""
    arc_of = np.full(len(moves), _NO_ARC)
    if moves.arcs is not None:
        first, last = moves.arcs.first, moves.arcs.last
        # Arcs do not overlap: rows within one are those that began and did not end.
        change = np.zeros(len(moves) + 1, dtype=np.int64)
        change[first] += 1
        change[last] -= 1
        arc_of[np.cumsum(change[:-1]) > 0] = _IN_ARC
        arc_of[last] = np.arange(len(last))
    return arc_of


def _summed(column: FloatArray, arcs: Arcs, digits: int) -> FloatArray:
    """Values of rows, at the end of each arc that of all its rows."""
    until = np.append(0.0, np.cumsum(column))
    summed = np.array(column)
    summed[arcs.last] = until[arcs.last + 1] - until[arcs.first]
    return summed.round(digits)


def _centres(arcs: Arcs, moves: Moves, compact: bool) -> list[str]:
    """Command of each arc with its centre from its start, {} for the place where it ends."""
    off = (arcs.centre - moves.start[arcs.first, :2]).round(COORDINATE_DIGITS) + 0.0
    words = f"I%.{COORDINATE_DIGITS}f J%.{COORDINATE_DIGITS}f"
    places = [words % (x, y) for x, y in off.tolist()]
    places = [_shorter(place) for place in places] if compact else places
    return [
        f"G{3 if sweep > 0.0 else 2} {{}} {place}" if sweep else "G1 {}"
        for sweep, place in zip(arcs.sweep.tolist(), places, strict=True)
    ]


def _axes(moves: Moves, machine: Machine) -> FloatArray:
    """Values of X, Y and Z, and of axes that turn, after each row (n, 3) or (n, 5)."""
    if not machine.kinematics.letters:
        return moves.place
    linear, turning = axis_values(machine.kinematics, moves.place, moves.normal)
    return np.column_stack([linear, turning]).round(COORDINATE_DIGITS)


def _speeds(moves: Moves, axes: FloatArray) -> FloatArray:
    """Speed that F tells: along X, Y and Z, while the nozzle goes along the part as it should.

    Firmware takes F for the way of X, Y and Z alone where these move, else for degrees.
    """
    if axes.shape[1] == 3:
        return moves.speed
    step = np.abs(np.diff(axes, axis=0, prepend=axes[:1]))
    way = np.linalg.norm(step[:, :3], axis=1)
    way = np.where(way > 0.0, way, step[:, 3:].max(axis=1))
    length = np.where(moves.length > 0.0, moves.length, way)
    share = np.divide(way, length, out=np.ones(len(way)), where=(length > 0.0) & (way > 0.0))
    return np.asarray((moves.speed * share).round(4))


def _progress(totals: PrintTotals, machine: Machine) -> dict[int, dict[str, float]]:
    """Time and share of the print until each layer begins; nothing where no line shows them."""
    shown = ("{elapsed}", "{percent}", "{minutes}")
    if not any(field in line for line in machine.gcode.layer for field in shown):
        return {}
    seconds = totals.by_layer
    total, elapsed, progress = sum(seconds.values()), 0.0, {}
    for number, taken in seconds.items():
        left = total - elapsed
        progress[number] = {
            "elapsed": round(elapsed, 1),
            "percent": float(100.0 * elapsed // max(total, 1.0)),
            "minutes": float(round(left / 60.0)),
        }
        elapsed += taken
    return progress


class _Lines:
    """Lines of the file so far, and what was said last."""

    def __init__(
        self, machine: Machine, plan: PrintPlan, progress: Mapping[int, Mapping[str, float]]
    ) -> None:
        self.machine, self.profile, self.plan = machine, machine.gcode, plan
        self.progress = progress
        self.values: dict[str, float] = {
            "bed_temperature": machine.bed_temperature,
            "matrix_temperature": machine.matrix_temperature,
            "fibre_temperature": machine.fibre_temperature,
            "matrix_standby": machine.matrix_standby,
            "fibre_standby": machine.fibre_standby,
            "wait": 1000.0 * machine.cut_wait,
            "tool": 0,
        }
        self.lines: list[str] = []
        types = TYPES[self.profile.comments]
        self._types = [f";TYPE:{types[name]}" if name in types else "" for name in ROLES]
        self._forget()
        self._letters = "".join(("X", "Y", "Z", *machine.kinematics.letters))
        self._rate, self._speed = "", -1.0
        self._digits = feed_digits(machine)
        by_file = self.profile.offset_by == "gcode"
        self._offset = self.profile.offset if by_file else (0.0, 0.0, 0.0)

    def fill(self, kind: str, **values: float) -> None:
        """Add the lines of the profile for something."""
        self.lines += self.profile.fill(getattr(self.profile, kind), {**self.values, **values})
        self._rate = ""

    def _forget(self) -> None:
        """Say all anew that is said where it changes."""
        self._type = self._wide = self._high = ""
        self._width = self._height = float("nan")

    def say(self, role: int, width: float, height: float) -> None:
        """Comments for viewers, where they change."""
        kind = self._types[role]
        if not kind:
            return
        if kind != self._type:
            self._type = kind
            self.lines.append(kind)
        if self.profile.compact:
            return
        if width != self._width:
            self._width, line = width, f";WIDTH:{width:.4f}"
            if line != self._wide:
                self._wide = line
                self.lines.append(line)
        if height != self._height:
            self._height, line = height, f";HEIGHT:{height:.4f}"
            if line != self._high:
                self._high = line
                self.lines.append(line)

    def places(self, axes: FloatArray, moved: BoolArray, tool: IntArray) -> list[str]:
        """Words of the axes that each row moves (n, k), by their values (n, k)."""
        offset = np.zeros(axes.shape[1])
        offset[:3] = self._offset
        axes = axes - (tool == 1)[:, None] * offset
        # Rows that move the same axes share one format.
        words = np.full(len(axes), "", dtype=object)
        kind = moved @ (1 << np.arange(axes.shape[1]))
        for number in np.unique(kind[kind > 0]).tolist():
            rows = np.flatnonzero(kind == number)
            changed = [k for k in range(axes.shape[1]) if number >> k & 1]
            text = " ".join(f"{self._letters[k]}%.{COORDINATE_DIGITS}f" for k in changed)
            words[rows] = [text % at for at in zip(*axes[rows][:, changed].T.tolist(), strict=True)]
        if self.profile.compact:
            return [_shorter(place) for place in words]
        return words.tolist()

    def move(
        self,
        event: int,
        tool: int,
        place: str,
        feed: float,
        beside: float,
        speed: float,
        first: bool,
    ) -> None:
        """Add a move to a place; the first one goes up before it goes sideways."""
        if first:
            words = place.split(" ")
            self.lines.append(f"G0 {words[2]}{self._at(self.profile.lift_speed)}")
            place = " ".join(words[:2] + words[3:])
        axes = self._fed(tool, feed, beside) if event == LAY else ""
        rapid = "G0" if event == TRAVEL else "G1"
        self.lines.append(f"{rapid} {place}{axes}{self._at(speed)}")

    def arc(
        self, words: str, tool: int, place: str, feed: float, beside: float, speed: float
    ) -> None:
        """Add an arc to a place."""
        fed = self._fed(tool, feed, beside)
        self.lines.append(f"{words.format(place)}{fed}{self._at(speed)}")

    def feed(self, tool: int, feed: float, beside: float, speed: float) -> None:
        """Add a feed without a move."""
        self.lines.append(f"G1{self._fed(tool, feed, beside)}{self._at(speed)}")

    def _fed(self, tool: int, feed: float, beside: float) -> str:
        """Words of what is fed; nothing where nothing is."""
        letter = self.profile.axes.fibre if tool == 1 else "E"
        word = f" {letter}{feed:.{self._digits}f}" if feed else ""
        word += f" {self.profile.axes.matrix}{beside:.{self._digits}f}" if beside else ""
        return _shorter(word) if self.profile.compact else word

    def _at(self, speed: float) -> str:
        """Feed rate of a move, where it differs from that of the move before."""
        if speed == self._speed and self._rate:
            return ""
        rate = f" F{60.0 * speed:.6g}"
        rate_before, self._rate, self._speed = self._rate, rate, speed
        return "" if rate == rate_before else rate

    def happen(self, event: int, tool: int, value: float, strand: int) -> None:
        """Add what happens where the nozzle stands."""
        if event == LAYER:
            self._layer(int(value))
        elif event == PATH_START:
            cut = value - self.machine.tail
            number = strand if strand >= 0 else "beside"
            sizes = "" if self.profile.compact else f" length={value:.3f} cut={cut:.3f}"
            self.lines.append(f";CCFEM:strand={number}{sizes}")
            self.fill("path_start", length=value)
        elif event == PATH_END:
            self.fill("path_end", length=value)
        elif event == CUT:
            self.fill("cut")
        elif event == WAIT:
            self.lines.append(f"G4 P{1000.0 * value:.10g}")
        elif event == PAUSE:
            self.fill("pause", layer=value, number=value + 1.0)
        elif event == TOOL:
            self.fill("tool", tool=tool)
        elif event == FAN:
            self.fill("fan", tool=tool, fan=float(np.round(255.0 * value)))
        else:
            self.fill(EVENTS[event].replace(" ", "_"), tool=tool, temperature=value)

    def _layer(self, number: int) -> None:
        top, thickness = self.plan.top[number], self.plan.thickness[number]
        self.lines += [
            ";LAYER_CHANGE",
            f";Z:{top:.3f}",
            f";HEIGHT:{thickness:.4f}",
            f";LAYER:{number}",
        ]
        self._forget()
        self.fill("layer", layer=number, number=number + 1, **self.progress.get(number, {}))


def _shorter(words: str) -> str:
    """Words without zeros that say nothing: X20.500 is X20.5, and E0.0300 is E.03."""
    return _AHEAD.sub(r"\1", _ZEROS.sub("", words))


# The head of a G-code file: how long it takes, how much it needs, where it lies.


def gcode_head(
    moves: Moves,
    plan: PrintPlan,
    machine: Machine,
    total: PrintTotals,
    title: str,
    doubts: Sequence[str] = (),
) -> list[str]:
    """Lines at the head of a file, as slicers write and printers read them.

    Parameters
    ----------
    total : PrintTotals
        Of the moves.
    title : str
        Case, strategy and machine; left out where empty.
    doubts : sequence of str
        What keeps the plan from being printed as it is, one line each; they come first.
    """
    lengths = plan.paths.lengths[(plan.paths.kind == FIBRE) & (plan.paths.layer >= plan.first)]
    printed = moves.event == LAY
    low, high = (end.tolist() for end in extent(moves.place, among=printed))
    lines = [
        f"; generated by ccfem {version('ccfem')}",
        *thumbnail_lines(plan, machine),
        *([f"; {title}"] if title else []),
        *(f"; NOT PRINTABLE as planned: {line}" for line in doubts),
        "; mm, mm/min; X Y Z absolute, E relative; T0 matrix, T1 fibre (E in mm of fibre)",
        f";TIME:{total.seconds:.0f}",
        f"; estimated printing time (normal mode) = {clock(total.seconds)}",
        f"; of it waiting for tools to heat, first heating left out = {total.heating:.0f} s",
        f"; filament used [mm] = {total.matrix_fed:.2f}, {total.fibre_fed:.2f}",
        f"; filament used [g] = {total.matrix_mass:.3f}, {total.fibre_mass:.3f}",
        f";LAYER_COUNT:{len(plan.top)}",
    ]
    lines += [
        f";{end}{axis}:{at:.3f}"
        for end, values in (("MIN", low), ("MAX", high))
        for axis, at in zip("XYZ", values, strict=True)
    ]
    if len(lengths):
        lines.append(
            f"; {lengths.sum():.1f} mm of fibre in {len(lengths)} strands, the shortest "
            f"{lengths.min():.1f} mm, each cut {machine.tail:g} mm before its end"
        )
    lines += [f"; {line}" for line in plan.warnings]
    return lines


def clock(seconds: float) -> str:
    """Hours, minutes and seconds: ``1h 2m 3s``."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return " ".join(
        f"{number}{unit}"
        for number, unit in ((hours, "h"), (minutes, "m"), (rest, "s"))
        if number or unit == "s"
    )
