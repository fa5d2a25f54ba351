import re
from dataclasses import fields

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.base.toml import from_table
from ccfem.machine import Machine, machine_from, machine_names
from ccfem.machine.gcode_profile import GcodeProfile
from ccfem.machine.kinematics import Kinematics
from ccfem.machine.limits import Limits
from ccfem.machine.print_process import Process
from ccfem.machine.ranges import RANGES
from ccfem.machine.speeds import SpeedTable
from ccfem.machine.supplies import Costs, Spools

TABLES = {
    "machine": Machine,
    "speed_table": SpeedTable,
    "gcode_profile": GcodeProfile,
    "process": Process,
    "kinematics": Kinematics,
    "limits": Limits,
    "spools": Spools,
    "costs": Costs,
}


def test_every_number_of_a_machine_has_a_range():
    assert set(RANGES) == set(TABLES)
    for table, kind in TABLES.items():
        numbers = {
            field.name
            for field in fields(kind)
            if set(re.findall(r"\w+", str(field.type))) & {"float", "int"}
        }
        assert set(RANGES[table]) == numbers


def test_machines_that_come_with_ccfem_are_in_range():
    for name in machine_names():
        machine_from({"profile": name})


@pytest.mark.parametrize(
    ("table", "said"),
    [
        (
            {"matrix_height": 0.001},
            "machine.matrix_height must be 0 or from 0.01 to 20 mm; got 0.001: "
            "0.001 metres would be 1 mm: write 1",
        ),
        (
            {"matrix_diameter": 0.001},
            "machine.matrix_diameter must be from 0.1 to 20 mm; got 0.001: "
            "0.001 metres would be 1 mm: write 1",
        ),
        ({"minimum_length": 0.042}, "got 0.042: 0.042 metres would be 42 mm: write 42"),
        ({"cutter_distance": 0.042}, "got 0.042: 0.042 metres would be 42 mm: write 42"),
        ({"travel_speed": 0.08}, "got 0.08: 0.08 m/s would be 80 mm/s: write 80"),
        ({"gcode": {"feed_speed": 0.01}}, "got 0.01: 0.01 m/s would be 10 mm/s: write 10"),
        ({"gcode": {"lift_speed": 0.01}}, "got 0.01: 0.01 m/s would be 10 mm/s: write 10"),
        ({"process": {"start_length": 0.02}}, "0.02 metres would be 20 mm: write 20"),
        ({"process": {"ramp_length": 0.01}}, "0.01 metres would be 10 mm: write 10"),
        ({"process": {"bend_radius": 0.02}}, "0.02 metres would be 20 mm: write 20"),
        ({"matrix_width": 800}, "0.05 to 50 mm; got 800: 800 micrometres would be 0.8 mm: wri"),
        ({"fibre_density": 1400}, "got 1400: 1400 kg/m^3 would be 1.4 g/cm^3: write 1.4"),
        ({"bed_temperature": 333.15}, "333.15 kelvin would be 60 degrees Celsius: write that"),
        ({"travel_speed": 4800}, "got 4800: 4800 mm/min would be 80 mm/s: write 80"),
        ({"head_angle": 0.61}, "0.61 radians would be 34.95 degrees: write 34.95"),
        ({"coextrusion": 95}, "from 0 to 1; got 95: 95 percent would be 0.95: write 0.95"),
        ({"fibre_width": -1}, "machine.fibre_width must be from 0.05 to 50 mm; got -1: give more"),
        ({"gcode": {"longest_feed": 1e-6}}, "longest_feed must be from 1 to 100000 mm; got 1e-06"),
        ({"gcode": {"bed": [0.3, 0.3, 0.3]}}, "0.3 metres would be 300 mm: write 300"),
        (
            {"process": {"skirt_loops": 10**9}},
            "process.skirt_loops must be from 0 to 100; got 1e",
        ),
        ({"process": {"start_wait": 2000}}, "2000 milliseconds would be 2 s: write 2"),
        ({"limits": {"links": 30}}, "30 percent would be 0.3: write 0.3"),
        ({"speeds": {"speed": [0.001, 15, 35]}}, "0.001 m/s would be 1 mm/s: write 1"),
        ({"filament_area": np.inf}, "machine.filament_area must be a number; got inf"),
    ],
)
def test_a_value_out_of_range_names_what_was_probably_meant(table, said):
    with pytest.raises(InputError) as caught:
        from_table(Machine, table, "machine")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("M140 S{bed-temperature}", "{bed-temperature}"),
        ("M104 S{ matrix_temperature }", "{ matrix_temperature }"),
        ("M104 S{matrix_temperature:.0f}", "{matrix_temperature:.0f}"),
        ("M104 S{length}", "{length}"),
        ("M104 S{}", "{}"),
        ("M104 S{tool", "{"),
        ("M104 Stool}", "}"),
        ("M104 S{{tool}}", "{"),
    ],
)
def test_what_stands_in_braces_is_a_known_field(line, text):
    with pytest.raises(InputError) as caught:
        GcodeProfile(start=(line,))
    assert str(caught.value).startswith(
        f"gcode.start has no field {text!r} to fill in; there are: "
    )
    assert "{bed_temperature}, {matrix_temperature}, {fibre_temperature}" in str(caught.value)
