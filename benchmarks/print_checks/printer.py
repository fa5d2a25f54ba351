"""A printer on paper: follows the file of a print as its firmware would, and notes what happens.

It knows the words of four firmwares from their documents and nothing of who wrote the file; a word
that a firmware does not know is an error.
"""

import cmath
import math
import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np

__all__ = ["Change", "Halt", "Run", "Step", "follow"]

COMMON = {"G0", "G1", "G4", "G21", "G28", "G90", "G91", "G92"}
COMMON |= {"M73", "M83", "M84", "M106", "M140", "M190", "M400"}
HEATERS = {"M104", "M109", "M107"}
ARCS = {"G2", "G3"}
"""Not in the list of codes of Aura's printer."""
KNOWN = {
    "marlin_two_tools": COMMON | ARCS | HEATERS | {"M280", "M0", "T0", "T1"},
    "chen2021": COMMON | ARCS | HEATERS | {"M280", "M0", "T0", "T1"},
    # No M280 and no M218: servos by name, offsets in the macros T0 and T1.
    "klipper": COMMON
    | ARCS
    | HEATERS
    | {
        "SET_SERVO",
        "SET_PRESSURE_ADVANCE",
        "SET_KINEMATIC_POSITION",
        "SET_IDLE_TIMEOUT",
        "PAUSE",
        "T0",
        "T1",
    },
    "reprap_duet": COMMON | ARCS | {"M280", "G10", "M116", "M568", "M572", "M226", "T0", "T1"},
    "aura_like": COMMON | HEATERS | {"M280", "M1001", "M1002", "M530", "M532", "M0", "T0", "T1"},
}
PAUSES = {"M0", "M226", "PAUSE"}
LONGEST = {"klipper": 50.0}
"""max_extrude_only_distance of Klipper; EXTRUDE_MAXLENGTH of Marlin is 200."""
_VALUE = re.compile(r"[A-Z][-+.\d]+")
COLD = 170.0
"""EXTRUDE_MINTEMP of Marlin."""


Place = tuple[float, float, float]


@dataclass(slots=True)
class Step:
    """A move of the nozzle, or of filament alone."""

    start: Place
    end: Place
    fed: float
    beside: float
    speed: float
    rapid: bool
    tool: int
    heat: float
    waited: bool
    kind: str
    width: float
    height: float
    strand: str
    number: int
    changed: int
    cut: bool
    length: float = field(init=False)
    lays: bool = field(init=False)

    def __post_init__(self) -> None:
        self.length = math.dist(self.start, self.end)
        self.lays = not self.rapid and self.length > 0.0


@dataclass
class Change:
    """A change of tools: what stood where before it, and what the old tool was told."""

    old: int
    new: int
    z: float
    highest: float
    at: int
    told: float = np.inf


@dataclass
class Halt:
    """A pause: after how many steps, where the nozzle stands, and the highest that is laid."""

    at: int
    place: Place
    highest: float
    tool: int


@dataclass
class Run:
    """All that the printer did."""

    steps: list = field(default_factory=list)
    cuts: list = field(default_factory=list)
    changes: list = field(default_factory=list)
    wrong: list = field(default_factory=list)
    arcs: int = 0
    halts: list = field(default_factory=list)
    waited: float = 0.0
    head: dict = field(default_factory=dict)
    lines: Any = None
    measured: Any = None

    def strands(self) -> dict[str, list]:
        """List the steps of each strand by its name; those beside the part come last."""
        found: dict[str, list] = {}
        for step in self.steps:
            if step.tool == 1 and step.strand and not step.rapid:
                found.setdefault(step.strand, []).append(step)
        return found


def _values(words: list[str]) -> dict[str, float]:
    """Numbers of a line by their letters; other words are left out."""
    try:
        return {word[0]: float(word[1:]) for word in words[1:]}
    except ValueError:
        return {word[0]: float(word[1:]) for word in words[1:] if _VALUE.fullmatch(word)}


def _moved(place: Place, shift: Place) -> Place:
    return (place[0] + shift[0], place[1] + shift[1], place[2] + shift[2])


def follow(text: str, machine: str, offset=(0.0, 0.0, 0.0)) -> Run:
    """Follow a file to its end; the offset is one that the firmware does not know of."""
    x, y, z = map(float, offset)
    printer = _Printer(machine, (x, y, z))
    for line in text.splitlines():
        printer.read(line)
    return printer.run


class _Printer:
    """What a firmware keeps in mind between the lines of a file."""

    def __init__(self, machine: str, shift: Place) -> None:
        self.machine, self.shift, self.run = machine, shift, Run()
        aura = machine == "aura_like"
        self.letters = set("XYZFEUV" if aura else "XYZFE")
        self.feeds = {0: "E", 1: "U" if aura else "E"}
        self.cutting = 30 if aura else 90
        self.longest = LONGEST.get(machine, 200.0)
        self.place, self.tool, self.speed, self.highest = (0.0, 0.0, 0.0), -1, 0.0, 0.0
        self.kind, self.strand, self.ends = "", "", 0
        self.line = {"WIDTH": np.nan, "HEIGHT": np.nan}
        self.changed, self.cut, self.relative = -1, False, False
        self.active: dict[int, float] = {}
        self.standby: dict[int, float] = {}
        self.heat, self.waited = {0: 20.0, 1: 20.0}, {0: False, 1: False}

    def read(self, line: str) -> None:
        """Follow a line: its comment, then its command."""
        code, _, comment = line.partition(";")
        self._comment(comment)
        words = code.split()
        if not words:
            return
        word, given = words[0], _values(words)
        moves = word in ("G0", "G1", "G2", "G3")
        letters = self.letters | (set("IJ") if word in ARCS else set())
        if word not in KNOWN[self.machine] or (moves and not letters.issuperset(given)):
            self.run.wrong.append(f"no {self.machine} knows {line}")
        if word not in KNOWN[self.machine]:
            return
        if word in ARCS:
            self._arc(word == "G3", given, line)
        elif moves:
            self._move(word == "G0", given, line)
        elif word == "G4":
            self.run.waited += given["P"] / 1000.0
        elif word in ("G90", "G91"):
            self.relative = word == "G91"
        elif word in ("G92", "SET_KINEMATIC_POSITION"):
            x, y, z = self.place
            given |= {name: float(value) for name, value in re.findall(r"([XYZ])=([-+.\d]+)", line)}
            self.place = (given.get("X", x), given.get("Y", y), given.get("Z", z))
        elif word in PAUSES:
            halt = Halt(len(self.run.steps), self.place, self.highest, self.tool)
            self.run.halts.append(halt)
        elif word == "G28" and "X" in words:
            self.place = (0.0, 0.0, self.place[2])
        elif word == "G28":
            self.place = (0.0, 0.0, 0.0)
        elif word in ("T0", "T1"):
            self._change(int(word[1]))
        elif word in ("M104", "M109", "G10", "M116"):
            self._warm(word, given)
        elif (word == "M280" and given["S"] == self.cutting) or (
            word == "SET_SERVO" and "ANGLE=90" in words
        ):
            self.run.cuts.append(len(self.run.steps))
            self.cut = True

    def _comment(self, comment: str) -> None:
        """Note what kind of thing follows, the strand, or a line of the head."""
        if comment.startswith("TYPE:"):
            self.kind = comment[5:]
        elif comment.startswith(("WIDTH:", "HEIGHT:")):
            name, _, value = comment.partition(":")
            self.line[name] = float(value)
        elif comment.startswith("CCFEM:strand="):
            (self.strand,) = re.findall(r"^CCFEM:strand=(\w+)", comment)
            self.strand += f"-{self.ends}" if self.strand == "beside" else ""
        elif ":" in comment or "=" in comment:
            name, _, value = comment.replace("=", ":", 1).partition(":")
            self.run.head.setdefault(name.strip(), value.strip())

    def _move(self, rapid: bool, given: dict[str, float], line: str) -> None:
        """Move the nozzle, or filament alone; a rapid move ends the strand."""
        self.speed = given.get("F", 60.0 * self.speed) / 60.0
        x, y, z = start = self.place
        if self.relative:
            way = (given.get(letter, 0.0) for letter in "XYZ")
            there = (a + b for a, b in zip(start, way, strict=True))
            given = given | dict(zip("XYZ", there, strict=True))
        self.place = end = (given.get("X", x), given.get("Y", y), given.get("Z", z))
        if self.tool == 1 and any(self.shift):
            start, end = _moved(start, self.shift), _moved(end, self.shift)
        step = Step(
            start=start,
            end=end,
            fed=given.get(self.feeds.get(self.tool, "E"), 0.0),
            beside=given.get("V", 0.0),
            speed=self.speed,
            rapid=rapid,
            tool=self.tool,
            heat=self.heat.get(self.tool, 0.0),
            waited=self.waited.get(self.tool, False),
            kind=self.kind,
            width=self.line["WIDTH"],
            height=self.line["HEIGHT"],
            strand=self.strand,
            number=len(self.run.steps),
            changed=self.changed,
            cut=self.cut,
        )
        if not step.length and abs(step.fed) > self.longest:
            refused = f"{self.machine} refuses more than {self.longest:g} mm alone: {line}"
            self.run.wrong.append(refused)
        self.run.steps.append(step)
        if step.lays:
            self.highest = max(self.highest, step.end[2])
        if rapid:
            self.strand, self.cut = "", False
            self.ends += 1

    def _arc(self, counter_clockwise: bool, given: dict[str, float], line: str) -> None:
        """Go along an arc as firmware does, in chords that leave it by a thousandth of a mm."""
        x, y = self.place[:2]
        centre = complex(x + given["I"], y + given["J"])
        start, end = complex(x, y) - centre, complex(given["X"], given["Y"]) - centre
        if abs(abs(start) - abs(end)) > 0.05:
            self.run.wrong.append(f"an arc that does not end on its circle: {line}")
        turn = (cmath.phase(end / start)) % (2.0 * math.pi)
        turn -= 0.0 if counter_clockwise else 2.0 * math.pi
        count = max(math.ceil(abs(turn) / math.sqrt(8e-3 / abs(start))), 2)
        fed = {letter: given[letter] / count for letter in "EUV" if letter in given}
        rate = {"F": given["F"]} if "F" in given else {}
        for k in range(1, count + 1):
            ray = start * cmath.exp(1j * turn * k / count) + centre
            place = (ray.real, ray.imag) if k < count else (given["X"], given["Y"])
            self._move(False, {"X": place[0], "Y": place[1], **fed, **rate}, line)
        self.run.arcs += 1

    def _change(self, new: int) -> None:
        """Change tools; a Duet sets the old one to its standby temperature by itself."""
        told = self.active.get(self.tool, np.inf)
        if self.tool >= 0 and self.machine == "reprap_duet":
            told = self.standby[self.tool]
        if new != self.tool:
            count = len(self.run.steps)
            change = Change(self.tool, new, self.place[2], self.highest, count, told)
            self.run.changes.append(change)
            self.waited[new], self.changed = False, count
        self.tool = new

    def _warm(self, word: str, given: dict[str, float]) -> None:
        """Set a tool to a temperature, or wait for it; what is not waited for is not yet warm."""
        tool = int(given.get("T" if word.startswith("M10") else "P", self.tool))
        active, heat = self.active, self.heat
        if word in ("M104", "M109"):
            active[tool] = given["S"]
            heat[tool] = given["S"] if word == "M109" else min(heat[tool], given["S"])
            ready = self.waited[tool] and heat[tool] == given["S"]
            self.waited[tool] = word == "M109" or ready
        elif word == "M116":
            heat[tool], self.waited[tool] = active[tool], True
        else:
            active[tool] = given.get("S", active.get(tool, 0.0))
            self.standby[tool] = given.get("R", self.standby.get(tool, 0.0))
            if tool == self.tool:
                heat[tool] = min(heat[tool], active[tool])
