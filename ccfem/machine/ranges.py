"""Range and unit of every value of a machine, and what a value outside was probably meant as."""

from dataclasses import dataclass
from typing import Any, get_args, get_type_hints

from ccfem.base.checks import check_number, member_name
from ccfem.base.errors import InputError


@dataclass(frozen=True)
class Range:
    """Values that a machine may have: from `least` to `most`, and 0 where that means "none"."""

    least: float
    most: float
    unit: str = ""
    zero: bool = False


_LENGTH = Range(0.1, 10000.0, "mm", zero=True)
_MOVE = Range(0.01, 1000.0, "mm", zero=True)
_HEIGHT = Range(0.01, 20.0, "mm", zero=True)
_WIDTH = Range(0.05, 50.0, "mm")
_PLACE = Range(-10000.0, 10000.0, "mm")
_SPEED = Range(0.5, 2000.0, "mm/s")
_SPEED_OR_NONE = Range(0.5, 2000.0, "mm/s", zero=True)
_WAIT = Range(0.0, 600.0, "s")
_HEAT = Range(0.0, 450.0, "degrees Celsius")
_HEATING = Range(0.001, 10000.0, "K/s")
_DENSITY = Range(0.05, 30.0, "g/cm^3")
_TURN = Range(-360.0, 360.0, "degrees")
_SHARE = Range(0.0, 1.0)

RANGES = {
    "machine": {
        "fibre_width": _WIDTH,
        "fibre_height": _HEIGHT,
        "matrix_height": _HEIGHT,
        "filament_area": Range(0.0001, 100.0, "mm^2"),
        "minimum_length": _LENGTH,
        "held_length": _LENGTH,
        "minimum_radius": _MOVE,
        "fibre_speed": _SPEED_OR_NONE,
        "matrix_speed": _SPEED_OR_NONE,
        "travel_speed": _SPEED_OR_NONE,
        "fibre_temperature": _HEAT,
        "matrix_temperature": _HEAT,
        "cutter_distance": _LENGTH,
        "cut_wait": _WAIT,
        "matrix_width": _WIDTH,
        "matrix_nozzle": Range(0.05, 20.0, "mm"),
        "line_shape": Range(0.05, 1.0),
        "least_line": Range(0.01, 20.0, "mm"),
        "matrix_diameter": Range(0.1, 20.0, "mm"),
        "fibre_density": _DENSITY,
        "matrix_density": _DENSITY,
        "fibre_tex": Range(0.1, 100000.0, "g/km"),
        "coextrusion": _SHARE,
        "bed_temperature": Range(0.0, 200.0, "degrees Celsius"),
        "matrix_standby": _HEAT,
        "fibre_standby": _HEAT,
        "matrix_heating": _HEATING,
        "fibre_heating": _HEATING,
        "head_angle": Range(1.0, 89.0, "degrees"),
        "head_length": Range(0.1, 10000.0, "mm", zero=True),
    },
    "speed_table": {
        "speed": _SPEED,
        "curvature": Range(0.0, 100.0, "1/mm"),
        "length": _LENGTH,
        "angle": Range(0.0, 180.0, "degrees"),
    },
    "gcode_profile": {
        "offset": Range(-1000.0, 1000.0, "mm"),
        "bed": Range(10.0, 100000.0, "mm"),
        "lift": _MOVE,
        "lift_speed": _SPEED,
        "retract": _MOVE,
        "fibre_retract": _MOVE,
        "retract_speed": _SPEED,
        "feed_speed": _SPEED,
        "matrix_angle": _TURN,
        "matrix_turn": _TURN,
        "park": _PLACE,
        "arc_tolerance": Range(0.001, 1.0, "mm"),
        "longest_feed": Range(1.0, 100000.0, "mm"),
    },
    "process": {
        "restart_extra": _MOVE,
        "feed_ratio": Range(0.1, 10.0),
        "start_speed": _SPEED,
        "start_length": _LENGTH,
        "ramp_length": _LENGTH,
        "start_wait": _WAIT,
        "bend_radius": _LENGTH,
        "speed_limit": _SPEED,
        "corner_angle": Range(0.0, 180.0, "degrees"),
        "corner_length": _MOVE,
        "finish_speed": _SPEED,
        "ironing_length": _MOVE,
        "strand_lift": _MOVE,
        "tool_lift": _MOVE,
        "tool_retract": _MOVE,
        "tool_fibre_retract": _MOVE,
        "cover": _HEIGHT,
        "prime_volume": Range(0.01, 100000.0, "mm^3", zero=True),
        "prime_size": Range(1.0, 1000.0, "mm"),
        "skirt_loops": Range(0, 100),
        "skirt_gap": _MOVE,
        "brim_loops": Range(0, 100),
        "support_interface": Range(1, 100),
        "support_gap": _MOVE,
        "support_clearance": _MOVE,
        "first_layer_height": _HEIGHT,
        "first_layer_speed": Range(0.01, 10.0),
        "warm_height": _MOVE,
        "warm_matrix": Range(0.0, 200.0, "K"),
        "warm_bed": Range(0.0, 100.0, "K"),
        "matrix_fan": _SHARE,
        "fibre_fan": _SHARE,
        "acceleration": Range(1.0, 1e6, "mm/s^2"),
        "junction": Range(0.00001, 10.0, "mm"),
    },
    "kinematics": {"centre": _PLACE, "pivot": _LENGTH, "tilt_limit": Range(0.0, 179.0, "degrees")},
    "spools": dict.fromkeys(
        [f"{name}{rest}" for name in ("fibre", "matrix", "coextruded") for rest in ("", "_left")],
        Range(0.01, 1e6, "m", zero=True),
    ),
    "costs": dict.fromkeys(("matrix", "fibre", "hour"), Range(0.0, 1e9)),
    "limits": {
        "short": _SHARE,
        "tight": _SHARE,
        "on_fibre": _SHARE,
        "across_fibre": _SHARE,
        "outside": _SHARE,
        "outside_height": _SHARE,
        "free_span": Range(0.01, 10000.0, "mm", zero=True),
        "links": _SHARE,
        "fraction": Range(0.0, 10.0),
        "overhang": Range(0.0, 90.0, "degrees"),
    },
}
"""Every value, by the class that holds it. Wider than any printer that we know of: what is outside
is a slip of the unit or of the decimal point."""

_MEANT = {
    "mm": (("metres", 1e3), ("micrometres", 1e-3)),
    "mm^2": (("m^2", 1e6), ("square micrometres", 1e-6)),
    "mm^3": (("cm^3", 1e3),),
    "mm/s": (("mm/min", 1.0 / 60.0), ("m/s", 1e3)),
    "mm/s^2": (("m/s^2", 1e3),),
    "g/cm^3": (("kg/m^3", 1e-3),),
    "1/mm": (("1/m", 1e-3),),
    "degrees": (("radians", 57.29577951308232),),
    "s": (("milliseconds", 1e-3),),
    "": (("percent", 1e-2),),
}
"""By unit: others that a number may have been given in, and the factor from these."""


def check_ranges(value: object) -> None:
    """Refuse a table of a machine with a number outside its range.

    A field that is None passes; of a tuple every number is checked.
    """
    table, hints = member_name(value), get_type_hints(type(value))
    for name, allowed in RANGES[table].items():
        given = getattr(value, name)
        if isinstance(given, tuple):
            for number in given:
                _check_range(f"each number of {table}.{name}", number, allowed)
        elif given is not None or type(None) not in get_args(hints[name]):
            _check_range(f"{table}.{name}", given, allowed)


def _check_range(what: str, value: Any, allowed: Range) -> None:
    check_number(what, value, unit=allowed.unit)
    if _within(value, allowed):
        return
    unit = allowed.unit and f" {allowed.unit}"
    words = f"{'0 or ' if allowed.zero else ''}from {allowed.least:g} to {allowed.most:g}{unit}"
    raise InputError(f"{what} must be {words}; got {value:g}: {_cure(value, allowed)}")


def _within(value: float, allowed: Range) -> bool:
    return (allowed.zero and value == 0.0) or allowed.least <= value <= allowed.most


def _cure(value: float, allowed: Range) -> str:
    """Say what to write, where the value lies in range in another unit."""
    if allowed.unit == "degrees Celsius" and _within(value - 273.15, allowed):
        return f"{value:g} kelvin would be {value - 273.15:.4g} {allowed.unit}: write that"
    for unit, factor in _MEANT.get(allowed.unit, ()):
        if value and _within(value * factor, allowed):
            meant = f"{value * factor:.4g} {allowed.unit}".strip()
            return f"{value:g} {unit} would be {meant}: write {value * factor:.4g}"
    return "give less" if value > allowed.most else "give more"
