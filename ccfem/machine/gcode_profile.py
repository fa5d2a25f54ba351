"""Commands for a printer's firmware, as lines to fill in, and its small moves."""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from ccfem.checks import check_fields, check_number
from ccfem.errors import InputError

__all__ = ["GcodeProfile"]

_FIELDS = ("bed_temperature", "matrix_temperature", "fibre_temperature", "tool", "wait")
_FIELD = re.compile(r"\{(\w*)\}")


@dataclass(frozen=True)
class GcodeProfile:
    """Commands and small moves of a printer with two tools: T0 lays matrix, T1 fibre.

    The defaults are for Marlin, with a cutter on its first servo. All of them are our choice. The
    firmware applies the offset between the nozzles (M218).

    Attributes
    ----------
    start, end : tuple of str
        Lines at the start and the end of the file. Coordinates must be absolute and extrusion
        relative (G90, M83) after the start.
    tool : tuple of str
        Lines that select a tool; {tool} is its number.
    cut : tuple of str
        Lines that cut the fibre and wait; {wait} is `Machine.cut_wait` in milliseconds.
    bed : tuple of 3 floats, mm
        Width, depth and height of the space to print in; its corner is the origin. The default is
        the working space of Chen et al. 2021, section 5.2.
    lift, lift_speed : float, mm and mm/s
        How far the nozzle rises before it travels.
    retract, retract_speed : float, mm and mm/s
        Matrix filament drawn back before travel.
    feed_speed : float, mm/s
        Speed at which new fibre is fed from the cutter to the tip of the nozzle.
    matrix_angle, matrix_turn : float, degrees
        Direction of the zigzag of the lowest matrix layer, and its turn from one matrix layer to
        the next.
    longest_feed : float, mm
        Longest feed in one move. Marlin refuses more than EXTRUDE_MAXLENGTH, by default 200.
    """

    start: tuple[str, ...] = (
        "G21 ; mm",
        "G90 ; absolute coordinates",
        "M83 ; relative extrusion",
        "M140 S{bed_temperature}",
        "M104 T0 S{matrix_temperature}",
        "M104 T1 S{fibre_temperature}",
        "M190 S{bed_temperature}",
        "M109 T0 S{matrix_temperature}",
        "M109 T1 S{fibre_temperature}",
        "G28 ; home",
    )
    tool: tuple[str, ...] = ("T{tool}",)
    cut: tuple[str, ...] = (
        "M400 ; finish all moves",
        "M280 P0 S90 ; cut",
        "G4 P{wait}",
        "M280 P0 S0 ; open the cutter",
    )
    end: tuple[str, ...] = (
        "M104 T0 S0",
        "M104 T1 S0",
        "M140 S0",
        "G28 X Y ; out of the way",
        "M84 ; motors off",
    )
    bed: tuple[float, float, float] = (300.0, 300.0, 300.0)
    lift: float = 1.0
    lift_speed: float = 10.0
    retract: float = 1.0
    retract_speed: float = 30.0
    feed_speed: float = 10.0
    matrix_angle: float = 45.0
    matrix_turn: float = 45.0
    longest_feed: float = 190.0

    def __post_init__(self) -> None:
        for name in ("start", "tool", "cut", "end"):
            for line in getattr(self, name):
                self._check(name, line)
        check_fields(self, "lift", "retract", at_least=0.0, unit="mm")
        check_fields(self, "lift_speed", "retract_speed", "feed_speed", above=0.0, unit="mm/s")
        check_fields(self, "longest_feed", above=0.0, unit="mm")
        check_fields(self, "matrix_angle", "matrix_turn", unit="degrees")
        for size in self.bed:
            check_number("each size of gcode_profile.bed", size, above=0.0, unit="mm")

    @staticmethod
    def _check(name: str, line: str) -> None:
        if not line.isprintable():
            raise InputError(f"{name} must be a list of single lines; got {line!r}: split it")
        for field in _FIELD.findall(line):
            if field not in _FIELDS:
                raise InputError(
                    f"{name} has no field '{{{field}}}' to fill in; there are: {', '.join(_FIELDS)}"
                )

    @staticmethod
    def fill(lines: tuple[str, ...], values: Mapping[str, float]) -> list[str]:
        """Lines with every name in braces replaced by its number."""
        return [_FIELD.sub(lambda found: f"{values[found[1]]:.10g}", line) for line in lines]
