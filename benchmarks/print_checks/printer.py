"""A printer on paper: follows the file of a print as its firmware would, and notes what happens.

It knows the words of four firmwares from their documents and nothing of who wrote the file; a word
that a firmware does not know is an error.
"""

import math
import re
from dataclasses import dataclass, field

import numpy as np

__all__ = ["Change", "Run", "Step", "follow"]

COMMON = {"G0", "G1", "G4", "G21", "G28", "G90", "M83", "M84", "M140", "M190", "M400", "M106"}
HEATERS = {"M104", "M109", "M107"}
KNOWN = {
    "marlin_two_tools": COMMON | HEATERS | {"M280", "T0", "T1"},
    "chen2021": COMMON | HEATERS | {"M280", "T0", "T1"},
    # No M280 and no M218: servos by name, offsets in the macros T0 and T1.
    "klipper": COMMON | HEATERS | {"SET_SERVO", "SET_PRESSURE_ADVANCE", "T0", "T1"},
    "reprap_duet": COMMON | {"M280", "G10", "M116", "M568", "M572", "T0", "T1"},
    "aura_like": COMMON | HEATERS | {"M280", "M1001", "M1002", "M530", "M532", "T0", "T1"},
}
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
class Run:
    """All that the printer did."""

    steps: list = field(default_factory=list)
    cuts: list = field(default_factory=list)
    changes: list = field(default_factory=list)
    wrong: list = field(default_factory=list)
    waited: float = 0.0
    head: dict = field(default_factory=dict)
    lines: object = None
    measured: object = None

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
    run, known = Run(), KNOWN[machine]
    feeds = {0: "E", 1: "U" if machine == "aura_like" else "E"}
    place, tool, speed, kind, strand = (0.0, 0.0, 0.0), -1, 0.0, "", ""
    shift = tuple(float(one) for one in offset)
    longest = LONGEST.get(machine, 200.0)
    letters = set("XYZFEUV" if machine == "aura_like" else "XYZFE")
    highest, changed, cut, ends = 0.0, -1, False, 0
    active, standby, heat, waited = {}, {}, {0: 20.0, 1: 20.0}, {0: False, 1: False}
    for raw in text.splitlines():
        code, _, comment = raw.partition(";")
        if comment.startswith("TYPE:"):
            kind = comment[5:]
        elif comment.startswith("CCFEM:strand="):
            strand = re.match(r"CCFEM:strand=(\w+)", comment)[1]
            strand += f"-{ends}" if strand == "beside" else ""
        elif ":" in comment or "=" in comment:
            name, _, value = comment.replace("=", ":", 1).partition(":")
            run.head.setdefault(name.strip(), value.strip())
        words = code.split()
        if not words:
            continue
        word = words[0]
        if word not in known:
            run.wrong.append(f"no {machine} knows {raw}")
            continue
        given = _values(words)
        if word in ("G0", "G1"):
            if not letters.issuperset(given):
                run.wrong.append(f"no {machine} knows {raw}")
            speed = given.get("F", 60.0 * speed) / 60.0
            x, y, z = place
            end = (given.get("X", x), given.get("Y", y), given.get("Z", z))
            start, stop = place, end
            if tool == 1 and any(shift):
                start, stop = _moved(place, shift), _moved(end, shift)
            step = Step(
                start=start,
                end=stop,
                fed=given.get(feeds.get(tool, "E"), 0.0),
                beside=given.get("V", 0.0),
                speed=speed,
                rapid=word == "G0",
                tool=tool,
                heat=heat.get(tool, 0.0),
                waited=waited.get(tool, False),
                kind=kind,
                strand=strand,
                number=len(run.steps),
                changed=changed,
                cut=cut,
            )
            if not step.length and abs(step.fed) > longest:
                run.wrong.append(f"{machine} refuses more than {longest:g} mm alone: {raw}")
            run.steps.append(step)
            place = end
            if step.lays:
                highest = max(highest, step.end[2])
            if step.rapid:
                strand, cut = "", False
                ends += 1
        elif word == "G4":
            run.waited += given["P"] / 1000.0
        elif word == "G28" and "X" not in words:
            place = (0.0, 0.0, 0.0)
        elif word in ("T0", "T1"):
            new = int(word[1])
            if tool >= 0 and machine == "reprap_duet":
                told = standby[tool]
            else:
                told = active.get(tool, np.inf)
            if new != tool:
                run.changes.append(Change(tool, new, place[2], highest, len(run.steps), told))
                waited[new] = False
                changed = len(run.steps)
            tool = new
        elif word in ("M104", "M109"):
            one = int(given.get("T", tool))
            active[one] = given["S"]
            heat[one] = given["S"] if word == "M109" else min(heat[one], given["S"])
            waited[one] = word == "M109" or (waited[one] and heat[one] == given["S"])
        elif word == "G10":
            one = int(given["P"])
            active[one] = given.get("S", active.get(one, 0.0))
            standby[one] = given.get("R", standby.get(one, 0.0))
            if one == tool:
                heat[one] = min(heat[one], active[one])
        elif word == "M116":
            one = int(given["P"])
            heat[one], waited[one] = active[one], True
        elif (word == "M280" and given["S"] == (30 if machine == "aura_like" else 90)) or (
            word == "SET_SERVO" and "ANGLE=90" in words
        ):
            run.cuts.append(len(run.steps))
            cut = True
    return run
