"""A printer on paper: follows a G-code file as Marlin would, and records what it does.

It knows the language only, nothing of who wrote the file. A command that it does not know is an
error.
"""

from dataclasses import dataclass, field

import numpy as np
import pytest
from gcodeparser import parse_gcode_lines

SILENT = {("G", 21), ("M", 84), ("M", 106), ("M", 400)}


@dataclass
class Move:
    """A move of the nozzle, or of the extruder alone."""

    start: np.ndarray
    end: np.ndarray
    fed: float
    speed: float
    rapid: bool
    tool: int
    hot: bool

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.end - self.start))

    @property
    def seconds(self) -> float:
        return (self.length or abs(self.fed)) / self.speed


@dataclass
class Run:
    """What the printer did, in order: moves, and names of other events."""

    events: list = field(default_factory=list)
    waited: float = 0.0

    @property
    def moves(self) -> list[Move]:
        return [event for event in self.events if isinstance(event, Move)]

    def lines(self, tool: int) -> list["Line"]:
        """Strands of one tool: G1 moves in the plane without a G0 between them."""
        found, current, before = [], None, []
        for event in self.events:
            if isinstance(event, str):
                if current is not None and event == "cut":
                    current.cuts.append(len(current.moves))
                elif event == "cut":
                    before.append(event)
            elif event.rapid:
                current, before = None, []
            elif event.tool == tool and event.length > 0.0:
                if current is None:
                    current = Line(fed_before=sum(m.fed for m in before if isinstance(m, Move)))
                    current.cuts += [0 for event in before if event == "cut"]
                    found.append(current)
                current.moves.append(event)
            elif event.tool == tool and current is None:
                before.append(event)
        return found


@dataclass
class Line:
    """A strand: moves from one travel to the next, what was fed before it, where it was cut."""

    fed_before: float
    moves: list[Move] = field(default_factory=list)
    cuts: list[int] = field(default_factory=list)

    @property
    def points(self) -> np.ndarray:
        return np.array([self.moves[0].start, *(move.end for move in self.moves)])

    @property
    def length(self) -> float:
        return sum(move.length for move in self.moves)

    @property
    def fed(self) -> float:
        return sum(move.fed for move in self.moves)


@pytest.fixture(name="follow", scope="session")
def follow_fixture():
    return follow


def follow(text: str) -> Run:
    """Follow a file from its first to its last line."""
    run = Run()
    place, extruded = np.full(3, np.nan), 0.0
    absolute, absolute_feed, speed, tool = True, True, 0.0, 0
    wanted: dict[object, float] = {}
    reached: dict[object, float] = {}
    for line in parse_gcode_lines(text):
        word, given = line.command, line.params
        if word in (("G", 0), ("G", 1)):
            assert set(given) <= set("XYZEF"), given
            speed = given.get("F", 60.0 * speed) / 60.0
            end = place.copy()
            for k, axis in enumerate("XYZ"):
                if axis in given:
                    end[k] = given[axis] if absolute else place[k] + given[axis]
            fed = given.get("E", 0.0)
            if absolute_feed and "E" in given:
                fed, extruded = given["E"] - extruded, given["E"]
            hot = wanted.get(tool, 0.0) == reached.get(tool) and reached.get(tool, 0.0) > 150.0
            run.events.append(Move(place, end, fed, speed, word == ("G", 0), tool, hot))
            place = end
        elif word == ("G", 4):
            run.waited += given.get("P", 0.0) / 1000.0 + given.get("S", 0.0)
        elif word == ("G", 28):
            homed = [not given or axis in given for axis in "XYZ"]
            place = np.where(homed, 0.0, place)
        elif word in (("G", 90), ("G", 91)):
            absolute = word[1] == 90
        elif word in (("M", 82), ("M", 83)):
            absolute_feed = word[1] == 82
        elif word[0] == "T":
            tool = word[1]
            run.events.append(f"tool {tool}")
        elif word in (("M", 104), ("M", 109)):
            wanted[given.get("T", tool)] = given["S"]
            if word[1] == 109:
                reached[given.get("T", tool)] = given["S"]
        elif word in (("M", 140), ("M", 190)):
            wanted["bed"] = given["S"]
        elif word == ("M", 280):
            if given["S"] == 90:
                run.events.append("cut")
        elif word not in SILENT:
            raise ValueError(f"no printer knows {line.gcode_str}")
    return run
