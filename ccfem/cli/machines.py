"""Machines on the command line: the options that choose one, and what lists and prints them."""

import dataclasses
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from ccfem.base.errors import InputError
from ccfem.base.toml import assignment
from ccfem.cli.arguments import argument, option
from ccfem.cli.docstring import attributes

if TYPE_CHECKING:
    from ccfem.machine.machine import Machine

MachineName = Annotated[
    str | None,
    option(
        "NAME_OR_FILE",
        "Printer: one of ccfem machines, or a TOML file with [machine]; what it does not set stays "
        "as the part has it.",
    ),
]
SetMachine = Annotated[
    list[str] | None,
    option("KEY=VALUE", "Set a value of the machine, as process.start_speed=3; repeatable."),
]

_WIDTH = 100


def machine_choice(
    name: str | None, texts: Sequence[str] | None
) -> "Callable[[Machine], Machine] | None":
    """Turn the two options into what they make of a case's machine; None where neither is given."""
    if name is None and not texts:
        return None
    from ccfem.machine.named_machines import machine_table, updated

    tables = [] if name is None else [machine_table(name)]
    tables += [_table(text) for text in texts or ()]
    return lambda machine: updated(machine, *tables)


def _table(text: str) -> dict[str, Any]:
    """Table of one assignment, ``process.start_speed=3``."""
    path, value = assignment(text)
    *outer, last = path.split(".")
    if not all((*outer, last)):
        raise InputError(
            f"--set-machine expects KEY=VALUE; got '{text}': write for example process.lift=2"
        )
    table: dict[str, Any] = {last: value}
    for key in reversed(outer):
        table = {key: table}
    return table


def machines(
    name: Annotated[
        str | None, argument("NAME_OR_FILE", "Print all values of this one, to edit.")
    ] = None,
    square: Annotated[
        Path | None,
        option(
            "FILE.gcode",
            "Write a square to print that calibrates it, and say what to measure on it.",
        ),
    ] = None,
    measured: Annotated[
        str | None,
        option(
            "NAME=VALUE,..",
            "Print it with the values that the measured square tells, as "
            "front=5.2,back=4.9,left=5,right=5,start=15,end=14.6,mass=15.7.",
        ),
    ] = None,
) -> None:
    """List the printers that come with ccfem, print one as a file to edit, or calibrate it."""
    if name is None:
        if square is not None or measured is not None:
            raise InputError("--square and --measured need a machine: name it, or its file")
        _list()
    elif square is not None:
        if measured is not None:
            raise InputError("--square comes before --measured: give one of them")
        _write_square(name, square)
    elif measured is not None:
        print(calibrated_file(name, measured), end="")
    else:
        print(machine_file(name), end="")


def _write_square(name: str, path: Path) -> None:
    """Write the file of the square, and say what to measure on it."""
    from ccfem.machine.machine import Machine
    from ccfem.machine.named_machines import machine_table, updated
    from ccfem.printing.calibration_square import calibration_square
    from ccfem.printing.export.gcode import write_gcode

    if path.suffix.lower() != ".gcode":
        raise InputError(f"the square is written as G-code; got {path}: end it in .gcode")
    planned = calibration_square(updated(Machine(), machine_table(name)))
    write_gcode(path, planned.plan, planned.machine, "calibration square")
    print(planned.form)
    print(f"then: ccfem machines {name} --measured front=..,back=.. > mine.toml")


def calibrated_file(name: str, text: str) -> str:
    """File of a machine with the values that its measured square tells.

    Parameters
    ----------
    name : str
        Of a machine, or of its file.
    text : str
        Measures, as ``front=5.2,back=4.9``.
    """
    from ccfem.machine.machine import Machine
    from ccfem.machine.named_machines import machine_table, updated
    from ccfem.printing.calibration_square import Measured, corrected, corrections

    pairs = [assignment(part) for part in text.split(",") if part.strip()]
    if len(dict(pairs)) < len(pairs):
        raise InputError(f"--measured names a measure twice: {text}")
    machine, measured = updated(Machine(), machine_table(name)), Measured.of(dict(pairs))
    off = corrections(machine, measured)
    remark = (
        f"Calibrated: fibre lay {off['x']:+.2f} mm to the right and {off['y']:+.2f} mm to the "
        f"back, began {off['start']:+.2f} mm and ended {off['end']:+.2f} mm too late; matrix fed: "
        f"{off['flow']:.3f} of what was asked for."
    )
    if machine.gcode.offset_by == "firmware":
        remark += (
            " The firmware knows the offset of the fibre's nozzle: change it there by as much."
        )
    return _file(corrected(machine, measured), remark)


def _list() -> None:
    """List the machines that come with ccfem, with the first sentence of their files."""
    from ccfem.machine.machine import Machine
    from ccfem.machine.named_machines import machine_about, machine_names, machine_table, updated

    print("--machine NAME, or profile = NAME under [machine] of a part file; a printout to edit:")
    print("ccfem machines NAME > mine.toml\n")
    for name in machine_names():
        machine = updated(Machine(), machine_table(name))
        about = machine_about(name).split(". ")[0].rstrip(".")
        print(f"{name}\n    {about}.")
        print(
            f"    strands {machine.fibre_width:g} x {machine.strand_height:g} mm, cutter "
            f"{machine.tail:g} mm before the nozzle"
        )


def machine_file(name: str) -> str:
    """All values of a machine as a TOML file, with what they mean.

    Parameters
    ----------
    name : str
        Of a machine, or of its file.
    """
    from ccfem.machine.machine import Machine
    from ccfem.machine.named_machines import machine_about, machine_table, updated

    return _file(updated(Machine(), machine_table(name)), machine_about(name))


def _file(machine: "Machine", about: str) -> str:
    """All values of a machine as a TOML file, with a comment about it at its head."""
    head = textwrap.fill(about, _WIDTH, initial_indent="# ", subsequent_indent="# ")
    ends = ["# A file without this table at its end is cut off.", 'last_table = "end"', ""]
    lines = [head] * bool(about) + ends + _lines(machine, "machine")
    return "\n".join([*lines, "", "[end]"]) + "\n"


def _lines(value: Any, where: str) -> list[str]:
    """Lines of a table and of those inside it."""
    about, inner, lines = attributes(type(value)), [], [f"[{where}]"]
    for field in dataclasses.fields(value):
        entry = getattr(value, field.name)
        if dataclasses.is_dataclass(entry):
            inner += ["", *_lines(entry, f"{where}.{field.name}")]
            continue
        kind, meaning = about.get(field.name, ("", ""))
        words = ", ".join(
            word for word in kind.split(", ") if word.startswith(("mm", "deg", "g/", "s", "K/"))
        )
        text = f"{words}: {meaning}" if words else meaning
        if text and text != (lines[-1] if lines else ""):
            lines += textwrap.wrap(text, _WIDTH - 2, initial_indent="# ", subsequent_indent="# ")
        lines.append(
            f"# {field.name} is not set" if entry is None else f"{field.name} = {_text(entry)}"
        )
    return lines + inner


def _text(value: Any) -> str:
    """Value as TOML writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, tuple):
        return "[" + ", ".join(_text(entry) for entry in value) + "]"
    return repr(value)
