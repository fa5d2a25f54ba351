"""Where a print halts, and from which layer a file goes on with one that was broken off."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ccfem.base.checks import check_number
from ccfem.base.errors import InputError, shown
from ccfem.machine.machine import Machine
from ccfem.printing.print_plan import PrintPlan

_PAUSE = re.compile(r"\s*(\d{1,9}(?:\.\d*)?|\.\d+)\s*(mm)?\s*")
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Course:
    """How the file of a print is run.

    Attributes
    ----------
    pauses : tuple of str
        Layers before which the print halts, as ``12``, counted from 0 as ``;LAYER:`` counts them;
        or heights, as ``3.4mm``: it halts when what lies up to there is printed.
    from_layer : int >= 0
        Layer with which the file begins; what lies below is printed already.
    """

    pauses: tuple[str, ...] = ()
    from_layer: int = 0

    def __post_init__(self) -> None:
        check_number("--from-layer", self.from_layer, at_least=0)
        for text in self.pauses:
            match = _PAUSE.fullmatch(text)
            if match is None or (match[2] is None and "." in match[1]):
                raise InputError(
                    f"a pause must be a layer, as 12, or a height, as 3.4mm; got {shown(text)}: "
                    "write one of these"
                )

    def __bool__(self) -> bool:
        return bool(self.pauses) or self.from_layer > 0


WITHOUT_HALT = Course()
"""A print from its first layer to its last."""


def on_course(plan: PrintPlan, course: Course, machine: Machine) -> PrintPlan:
    """Plan with the layers at which its file begins and halts.

    Raises
    ------
    InputError
        For layers and heights that the print does not have, a file of curved layers that begins
        above the lowest one, and pauses on a machine without lines for them.
    """
    if not course:
        return plan
    first, last = course.from_layer, len(plan.top) - 1
    if first > last:
        raise InputError(
            f"--from-layer must be a layer of the print, 0 to {last}; got {first}: give one of them"
        )
    if first and (plan.paths.normals[:, 2] < 1.0 - 1e-9).any():
        raise InputError(
            "--from-layer needs flat layers: of curved ones no height says what is printed; leave "
            "it out"
        )
    if course.pauses and not machine.gcode.pause:
        raise InputError("machine.gcode.pause has no lines to halt this machine: give them")
    pauses = sorted({_layer_of(text, plan.top.tolist(), first) for text in course.pauses})
    remarks = [
        f"pause before layer {number}, when {plan.top[number - 1]:.3f} mm are printed"
        for number in pauses
    ]
    if first:
        remarks.insert(
            0,
            f"begins at layer {first}, on {plan.top[first - 1]:.3f} mm that are printed; time and "
            "mass are of the rest. Z is not homed: before the start, let the nozzle of T0 touch "
            "the top of what is printed",
        )
    return replace(plan, pauses=tuple(pauses), first=first, warnings=(*remarks, *plan.warnings))


def _layer_of(text: str, tops: Sequence[float], first: int) -> int:
    """Layer before which a pause comes."""
    match = _PAUSE.fullmatch(text)
    assert match is not None
    if match[2] is None:
        number = int(match[1])
        words = f"layer {first + 1} to {len(tops) - 1}"
    else:
        number = int(np.searchsorted(tops, float(match[1]) + _ROUNDING, side="right"))
        words = f"from {tops[first]:.3g} to below {tops[-1]:.3g} mm"
    if not first < number < len(tops):
        raise InputError(
            f"a pause must lie within the print, {words}; got {text.strip()}: give one of these"
        )
    return number
