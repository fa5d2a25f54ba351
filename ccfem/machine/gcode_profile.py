"""Commands for a printer's firmware, as lines to fill in, and its small moves."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from ccfem.base.checks import check_choices
from ccfem.base.errors import InputError, shown
from ccfem.machine.ranges import check_ranges

_ALWAYS = (
    *("bed_temperature", "matrix_temperature", "fibre_temperature"),
    *("matrix_standby", "fibre_standby", "tool", "wait"),
)
_FIELDS = {
    "start": ("layers",),
    "end": ("layers",),
    "tool": (),
    "cut": (),
    "standby": ("temperature",),
    "preheat": ("temperature",),
    "heat": ("temperature",),
    "work": ("temperature",),
    "heat_bed": ("temperature",),
    "fan": ("fan",),
    "path_start": ("length",),
    "path_end": ("length",),
    "layer": ("layer", "number", "elapsed", "percent", "minutes"),
    "pause": ("layer", "number"),
    "resume": ("layers", "layer", "height"),
}
"""Kinds of lines, and the fields that each knows beside those that all know."""
_FIELD = re.compile(r"\{(\w*)\}")
_BRACES = re.compile(r"\{[^{}]*\}|[{}]")
"""What stands in braces, and a brace without its other one."""


_PICTURE = (16, 1024)
"""Least and largest side of a picture at the head of a file, pixels."""


def _check_size(text: str) -> None:
    sides = re.fullmatch(r"(\d{1,4})x(\d{1,4})", text)
    if sides is None or not all(_PICTURE[0] <= int(side) <= _PICTURE[1] for side in sides.groups()):
        raise InputError(
            f"gcode.thumbnails must be sizes as 300x200, each side from {_PICTURE[0]} to "
            f"{_PICTURE[1]} pixels; got {shown(text)}: write that"
        )


@dataclass(frozen=True)
class FeedAxes:
    """Letters of the axes that feed what the fibre's head lays; T0 feeds matrix by E.

    Attributes
    ----------
    fibre : str
        Fibre.
    matrix : str
        Matrix that the same head lays round it.
    """

    fibre: str = "E"
    matrix: str = "V"

    def __post_init__(self) -> None:
        for name, letter in vars(self).items():
            if len(letter) != 1 or letter not in "ABCDEHIJKLNOPQRSUVW":
                raise InputError(
                    f"gcode.axes.{name} must be one capital letter that is no X, Y, Z, F, G, M or "
                    f'T; got {letter!r}: write "E" or so'
                )
        if self.fibre == self.matrix:
            raise InputError(
                f"gcode.axes need two letters; both are {self.fibre!r}: change one of them"
            )


@dataclass(frozen=True)
class GcodeProfile:
    """Commands and small moves of a printer with two tools: T0 lays matrix, T1 fibre.

    The defaults are for Marlin, with a cutter on its first servo. All of them are our choice. Lines
    may hold {bed_temperature}, {matrix_temperature}, {fibre_temperature}, {matrix_standby},
    {fibre_standby}, {tool} and {wait}, and what is said below.

    Attributes
    ----------
    start, end : tuple of str
        Lines at the start and the end of a file of so many {layers}. Coordinates must be absolute
        and extrusion relative (G90, M83) after the start.
    tool : tuple of str
        Lines that select a tool; {tool} is its number.
    cut : tuple of str
        Lines that cut the fibre and wait; {wait} is `Machine.cut_wait` in milliseconds.
    standby, preheat : tuple of str
        Lines that let {tool} cool to {temperature} while the other one prints, and that heat it
        again ahead of its turn, without waiting.
    heat, work : tuple of str
        Lines that set {tool}, while it prints, to {temperature}, and that wait for it after a
        change.
    heat_bed : tuple of str
        Lines that set the bed to {temperature} without waiting.
    fan : tuple of str
        Lines that set the fan of {tool} to {fan}, 0 to 255.
    path_start, path_end : tuple of str
        Lines before and after a strand of {length} mm.
    layer : tuple of str
        Lines at the start of {layer}, counted from 0; {number} is counted from 1. {elapsed} is
        the estimated time until then in s, {percent} its share of the whole print, {minutes} what
        is left: ``M73 P{percent} R{minutes}`` shows it on most printers,
        ``;TIME_ELAPSED:{elapsed}`` in viewers.
    pause : tuple of str
        Lines that halt the print before {layer} until somebody lets it go on; the nozzle is parked.
    resume : tuple of str
        Lines in place of `start` for a file that begins at {layer}, on so much {height} in mm that
        is printed. Before, somebody lets the nozzle of T0 touch that.
    park : tuple of 2 floats, mm
        X and Y of the carriage during a pause, above all that is printed.
    offset : tuple of 3 floats, mm
        Of the fibre nozzle from the matrix nozzle.
    offset_by : {"firmware", "gcode"}
        What takes it into account: the firmware (M218, G10, macros), or the coordinates of the
        file.
    axes : FeedAxes
        Letters of what the fibre's head feeds.
    comments : {"prusa", "cura"}
        Words by which comments name what is laid.
    bed : tuple of 3 floats, mm
        Width, depth and height of the space to print in; its corner is the origin. The default is
        the working space of Chen et al. 2021, section 5.2.
    lift, lift_speed : float, mm and mm/s
        How far the nozzle rises before it travels.
    retract, fibre_retract, retract_speed : float, mm and mm/s
        Matrix filament drawn back before travel, that of the matrix head and that of the fibre head
        (`Machine.coextrusion`).
    feed_speed : float, mm/s
        Speed at which new fibre is fed from the cutter to the tip of the nozzle.
    matrix_angle, matrix_turn : float, degrees
        Direction of the zigzag of the lowest matrix layer, and its turn from one matrix layer to
        the next.
    arcs : bool
        Whether curves are written as arcs, G2 and G3, that the firmware of a machine with three
        axes has to know.
    arc_tolerance : float, mm
        Largest distance between an arc and the lines that it replaces; it is at most 0.1 % longer
        than they are. In a compact file, of straight lines too.
    compact : bool
        Whether the file says no more than the printer needs: no ends of zeros, no width and height
        of lines, flow of matrix over fibre and speed of strands in fewer steps
        (`ccfem.printing.laid_layer`, `ccfem.printing.part_moves`).
    longest_feed : float, mm
        Longest feed in one move. Marlin refuses more than EXTRUDE_MAXLENGTH, by default 200.
    thumbnails : tuple of str
        Sizes in pixels, as ``"300x200"``, of pictures at the head of a file, which displays show.
    """

    start: tuple[str, ...] = (
        "G21 ; mm",
        "G90 ; absolute coordinates",
        "M83 ; relative extrusion",
        "M140 S{bed_temperature}",
        "M104 T0 S{matrix_temperature}",
        "M104 T1 S{fibre_standby}",
        "M190 S{bed_temperature}",
        "G28 ; home",
        "M109 T0 S{matrix_temperature}",
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
    standby: tuple[str, ...] = ("M104 T{tool} S{temperature}",)
    preheat: tuple[str, ...] = ("M104 T{tool} S{temperature}",)
    heat: tuple[str, ...] = ("M104 T{tool} S{temperature}",)
    work: tuple[str, ...] = ("M109 T{tool} S{temperature}",)
    heat_bed: tuple[str, ...] = ("M140 S{temperature}",)
    fan: tuple[str, ...] = ("M106 P{tool} S{fan}",)
    path_start: tuple[str, ...] = ()
    path_end: tuple[str, ...] = ()
    layer: tuple[str, ...] = ()
    pause: tuple[str, ...] = ("M84 S0 ; motors stay on", "M0")
    resume: tuple[str, ...] = (
        "G21 ; mm",
        "G92 Z{height} ; the nozzle touches what is printed",
        "G91",
        "G0 Z10 F300 ; off it",
        "G90 ; absolute coordinates",
        "M83 ; relative extrusion",
        "G28 X Y ; home, but for Z",
        "M140 S{bed_temperature}",
        "M104 T0 S{matrix_temperature}",
        "M104 T1 S{fibre_standby}",
        "M190 S{bed_temperature}",
        "M109 T0 S{matrix_temperature}",
    )
    park: tuple[float, float] = (0.0, 0.0)
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset_by: Literal["firmware", "gcode"] = "firmware"
    axes: FeedAxes = field(default_factory=FeedAxes)
    comments: Literal["prusa", "cura"] = "prusa"
    bed: tuple[float, float, float] = (300.0, 300.0, 300.0)
    lift: float = 1.0
    lift_speed: float = 10.0
    retract: float = 1.0
    fibre_retract: float = 0.0
    retract_speed: float = 30.0
    feed_speed: float = 10.0
    matrix_angle: float = 45.0
    matrix_turn: float = 45.0
    arcs: bool = False
    arc_tolerance: float = 0.02
    compact: bool = False
    longest_feed: float = 190.0
    thumbnails: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_choices(self)
        for name in _FIELDS:
            for line in getattr(self, name):
                self._check_line(name, line)
        for size in self.thumbnails:
            _check_size(size)
        check_ranges(self)

    @staticmethod
    def _check_line(name: str, line: str) -> None:
        if not line.isprintable():
            raise InputError(f"{name} must be a list of single lines; got {line!r}: split it")
        known = _ALWAYS + _FIELDS[name]
        for text in _BRACES.findall(line):
            if text[1:-1] not in known or len(text) < 2:
                raise InputError(
                    f"gcode.{name} has no field {text!r} to fill in; there are: "
                    f"{', '.join(f'{{{word}}}' for word in known)}: write one of them"
                )

    @staticmethod
    def fill(lines: tuple[str, ...], values: Mapping[str, float]) -> list[str]:
        """Lines with every name in braces replaced by its number."""
        return [_FIELD.sub(lambda match: f"{values[match[1]]:.10g}", line) for line in lines]
