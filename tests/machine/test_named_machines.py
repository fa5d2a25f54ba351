"""Machines by name and from files: what wins over what, and that a printout is the machine."""

import re
import tomllib
from dataclasses import replace

import pytest

from ccfem.base.errors import InputError
from ccfem.base.toml import from_table
from ccfem.cases.reading import read
from ccfem.cli.machines import machine_choice, machine_file, machines
from ccfem.machine import (
    Machine,
    SpeedTable,
    machine_from,
    machine_names,
    machine_table,
    named_machines,
    updated,
)

NAMES = ("aura_like", "chen2021", "klipper", "marlin_two_tools", "reprap_duet")


def test_the_five_machines_hold_what_is_published():
    assert machine_names() == NAMES
    aura, chen = (machine_from({"profile": name}) for name in ("aura_like", "chen2021"))
    # Session of Aura 2.4.8: sizes; 1 mm of the cell's matrix is .95 of what the fibre leaves.
    assert (aura.filament_area, aura.fibre_width, aura.tail) == (0.0616, 0.78, 46.0)
    matrix = (aura.strand_area - aura.filament_area) / (0.25 * 3.14159 * 1.75**2)
    assert matrix == pytest.approx(0.0373, abs=1e-4)
    # Chen et al. 2021, table 3: strands pressed into .05 mm at a width of 1.2 mm.
    assert (chen.strand_height, chen.fibre_width, chen.tail) == (0.05, 1.2, 42.0)
    assert replace(chen, pressed=False).strand_height == pytest.approx(0.1075 / 1.2)
    assert "M280" not in " ".join(machine_from({"profile": "klipper"}).gcode.cut)


@pytest.mark.parametrize("name", NAMES)
def test_a_printout_is_the_machine(name, tmp_path):
    text = machine_file(name)
    again = from_table(Machine, tomllib.loads(text)["machine"], "machine")
    assert again == updated(Machine(), machine_table(name))
    assert max(map(len, (line for line in text.splitlines() if line.startswith("#")))) <= 100
    # With one value changed, it is a machine of the user's own.
    (tmp_path / "mine.toml").write_text(text.replace("start_speed = 2.0", "start_speed = 3.5"))
    mine = updated(Machine(), machine_table(tmp_path / "mine.toml"))
    assert mine.process.start_speed == 3.5
    assert 'last_table = "end"\n\n[machine]\n' in machine_file(str(tmp_path / "mine.toml"))


def test_a_printout_that_is_cut_off_is_refused(tmp_path):
    """Wherever it is cut off, though what is left may be a whole machine in TOML."""
    text, file = machine_file("klipper"), tmp_path / "mine.toml"
    valid = 0
    for end in range(text.index("[machine]") + len("[machine]"), len(text) - 1, 97):
        file.write_text(text[:end])
        with pytest.raises(InputError, match=r"is cut off|is not a TOML file"):
            machine_table(file)
    for end in [k for k, letter in enumerate(text) if letter == "\n"][10:-1:20]:
        file.write_text(text[:end])
        with pytest.raises(InputError, match="last_table 'end' is missing") as caught:
            machine_table(file)
        valid += "\n" not in str(caught.value)
    assert valid > 3


def test_the_later_one_wins(tmp_path):
    case = Machine(fibre_width=0.9, minimum_length=10.0, speeds=SpeedTable())
    # A machine leaves of the case what it does not set ...
    found = machine_choice("klipper", None)(case)
    assert (found.fibre_width, found.speeds, found.gcode.longest_feed) == (0.9, SpeedTable(), 45.0)
    # ... sets what it does, and single values win over all.
    texts = ["fibre_width=0.8", "process.start_speed=3", "gcode.cut=['M42 P4 S255']"]
    found = machine_choice("aura_like", texts)(case)
    assert (found.fibre_width, found.minimum_length) == (0.8, 46.0)
    assert (found.process.start_speed, found.process.finish_speed) == (3.0, 8.0)
    assert found.gcode.cut == ("M42 P4 S255",)
    # A file builds on a profile, and a part file's table is one, too.
    (tmp_path / "own.toml").write_text('[machine]\nprofile = "klipper"\nfibre_width = 1.4\n')
    found = machine_choice(str(tmp_path / "own.toml"), None)(case)
    assert (found.fibre_width, found.minimum_length, found.gcode.longest_feed) == (1.4, 10.0, 45.0)
    assert machine_choice(None, None) is machine_choice(None, []) is None


@pytest.mark.parametrize(
    ("name", "texts", "message"),
    [
        ("kliper", [], "no machine named 'kliper'; there are: aura_like, .*did you mean 'klipper'"),
        ("none.toml", [], "machine file none.toml does not exist"),
        (None, ["lift"], "expected NAME=VALUE; got 'lift'"),
        (None, [".lift=2"], "--set-machine expects KEY=VALUE; got '.lift=2'"),
        (None, ["lift=2"], "machine has no key 'lift'"),
        (None, ["process.start_sped=2"], "machine.process has no key .*did you mean 'start_speed'"),
        (None, ["process.short=melt"], "machine.process.short must be one of 'matrix', 'drop'"),
        (
            None,
            ["process.start_speed=0"],
            "start_speed must be from 0.5 to 2000 mm/s; got 0",
        ),
        (None, ["process=3"], "machine.process must be a table; got 3"),
        (None, ["gcode.axes.fibre=X"], "axes.fibre must be one capital letter .* got 'X'"),
        (None, ["gcode.axes.fibre=V"], "axes need two letters; both are 'V'"),
        (None, ["gcode.fan=['M106 S{temperature}']"], r"fan has no field '\{temperature\}'"),
        (None, ["coextrusion=1.2"], "machine.coextrusion must be from 0 to 1; got 1.2"),
        (None, ["profile=prusa"], "machine.profile must be one of aura_like"),
    ],
)
def test_wrong_machines_are_one_line(name, texts, message):
    with pytest.raises(InputError, match=message):
        machine_choice(name, texts)(Machine())


def test_files_that_hold_no_machine(tmp_path):
    (tmp_path / "text.toml").write_text("= 3")
    with pytest.raises(InputError, match="is not a TOML file"):
        machine_table(tmp_path / "text.toml")
    (tmp_path / "part.toml").write_text("layers = 3")
    with pytest.raises(InputError, match=r"has no table \[machine\]: write one"):
        machine_table(tmp_path / "part.toml")


def test_the_list_names_all(capsys):
    machines()
    said = capsys.readouterr().out
    assert [line for line in said.splitlines() if line in NAMES] == list(NAMES)
    assert "cutter 46 mm before the nozzle" in said


def test_a_case_is_printed_by_another_machine():
    case = read("bar", element_size=12.0)
    assert machine_choice("chen2021", ["fibre_speed=4"])(case.machine).fibre_speed == 4.0


def test_an_a4_is_spoken_to_as_its_own_slicer_does():
    """Words and sizes of brace.gcode, a session of Aura 2.4.8, in pyGCodeDecode 1.5.1."""
    machine = machine_from({"profile": "aura_like"})
    profile, fill = machine.gcode, machine.gcode.fill
    assert fill(profile.fan, {"tool": 0, "fan": 255}) == ["M106 P1 S255"]
    assert fill(profile.fan, {"tool": 1, "fan": 128}) == ["M106 P1 S128"]
    assert fill(profile.layer, {"layer": 0, "number": 1}) == ["M532 L1"]
    values = dict.fromkeys(("bed_temperature", "matrix_temperature", "fibre_standby"), 45.0)
    start = fill(profile.start, {"layers": 99, **values})
    assert start[0] == "M530 L99"
    assert start.index("M530 S1") == start.index("G28") + 1
    assert profile.end[-1] == "M530 S0"
    # Retraction of its two heads on travel, and before a change of tools, mm of filament.
    assert (profile.retract, profile.fibre_retract) == (4.5, 5.0)
    assert (machine.process.tool_retract, machine.process.tool_fibre_retract) == (15.0, 12.0)
    # EntitySizes: .4 wide and .1 or .2 high, by a nozzle of .4; fibre .78 wide.
    assert (machine.matrix_nozzle, machine.matrix_width, machine.fibre_width) == (0.4, 0.4, 0.78)
    assert machine.least_line == 0.1 <= 0.2 <= machine.highest_line


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"matrix_nozzle": 0.4}, "matrix_width must be from 0.32 to 1 mm, 0.8 to 2.5 bores of"),
        ({"least_line": 0.9}, "least_line must be at most the 0.8 mm that line_shape allows"),
        ({"line_shape": 1.2}, "line_shape must be from 0.05 to 1; got 1.2"),
    ],
)
def test_lines_that_no_nozzle_lays_are_refused(table, message):
    with pytest.raises(InputError, match=re.escape(message)):
        updated(Machine(**({"matrix_width": 1.2} if "matrix_nozzle" in table else {})), table)


def test_a_machine_of_another_package_has_a_name_too(tmp_path, monkeypatch):
    file = tmp_path / "ours.toml"
    file.write_text(
        '# Ours.\n[machine]\nprofile = "chen2021"\nfibre_width = 0.7\n', encoding="utf-8"
    )

    class Entry:
        name = "ours"

        @staticmethod
        def load():
            return str(file)

    monkeypatch.setattr(
        named_machines, "entries", lambda group: (Entry,) if group == "ccfem.machines" else ()
    )
    named_machines._files.cache_clear()
    try:
        assert "ours" in named_machines.machine_names()
        assert named_machines.machine_about("ours") == "Ours."
        made = named_machines.machine_from({"profile": "ours"})
        assert made == replace(
            named_machines.machine_from({"profile": "chen2021"}), fibre_width=0.7
        )
    finally:
        named_machines._files.cache_clear()
