"""A part, what was planned for it, its file, and what a printer on paper did with that file."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks.print_checks.printer import Run, Step, follow
from ccfem.machine import Machine
from ccfem.printing.print_plan import PrintPlan

__all__ = ["FILAMENT", "PART", "Job", "Lines", "own"]

FILAMENT = 0.25 * np.pi * 1.75**2
"""Section of the filament of matrix, mm^2."""
PART = ("External perimeter", "Solid infill", "Internal infill")
"""What comments call lines of the part itself; fibre, matrix in its place and sparse infill have
the last one."""


@dataclass
class Job:
    """A file and what it has to be.

    Attributes
    ----------
    name : str
        Of the machine, as its firmware is known by.
    machine : Machine
    plan : PrintPlan
        For the heights of layers, the length that was left out, and matrix in each line.
    text : str
        The file.
    strands : sequence of (n, 3) arrays, mm
        What was planned, on the bed; Z is the middle of the fibre layer.
    section : callable
        Section of the part on the bed at a height over it, a shapely geometry.
    area : callable
        Its area, mm^2.
    volume : float, mm^3
        Of the part.
    bent : float
        Factor by which a strand may be faster in a turn than by the radius that the check finds:
        of a polyline it is a matter of how it is taken.
    chords : float, mm
        How far sides of the mesh, whose section this is, are off the round walls that are printed.
    """

    name: str
    machine: Machine
    plan: PrintPlan
    text: str
    strands: list[np.ndarray]
    section: Callable[[float], Any]
    area: Callable[[float], float]
    volume: float
    bent: float = 1.01
    chords: float = 0.0
    done: Run = field(init=False)

    def __post_init__(self) -> None:
        self.done = self.run()

    def run(self, text: str | None = None) -> Run:
        """Follow the file, or a spoiled one."""
        profile = self.machine.gcode
        unknown = profile.offset if profile.offset_by == "gcode" else (0.0, 0.0, 0.0)
        return follow(self.text if text is None else text, self.name, unknown)

    @cached_property
    def planned(self) -> float:
        """Length of all strands, mm."""
        return float(sum(np.linalg.norm(np.diff(x, axis=0), axis=1).sum() for x in self.strands))


class Lines:
    """Steps of a run as arrays, those of them that lay something in `lays`."""

    @classmethod
    def of(cls, run: Run) -> "Lines":
        """Those of a run, made once."""
        if run.lines is None:
            run.lines = cls(run.steps)
        return run.lines

    def __init__(self, steps: list[Step]) -> None:
        self.start = np.array([step.start for step in steps]).reshape(-1, 3)
        self.end = np.array([step.end for step in steps]).reshape(-1, 3)
        self.length = np.linalg.norm(self.end - self.start, axis=1)
        self.rapid = np.array([step.rapid for step in steps], dtype=bool)
        self.tool = np.array([step.tool for step in steps])
        self.fed = np.array([step.fed for step in steps])
        self.beside = np.array([step.beside for step in steps])
        self.speed = np.array([step.speed for step in steps])
        self.width = np.array([step.width for step in steps])
        self.height = np.array([step.height for step in steps])
        self.kind = np.array([step.kind for step in steps])
        self.lays = ~self.rapid & (self.length > 0.0)
        self.in_part = np.isin(self.kind, PART)
        # Sparse infill lies on layers with walls, and what takes the place of fibre does not.
        level = self.end[:, 2].round(3)
        walled = np.isin(level, level[self.lays & (self.kind == PART[0])])
        self.of_fibre = (self.tool == 1) | ((self.kind == PART[2]) & ~walled)
        self.beside_part = np.array([step.strand.startswith("beside") for step in steps])


def own(run: Run) -> dict[str, list[Step]]:
    """Strands of the part, without the one beside it."""
    return {name: steps for name, steps in run.strands().items() if "beside" not in name}
