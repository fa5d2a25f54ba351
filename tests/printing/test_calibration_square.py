"""The square that calibrates a printer: printed on paper by one that is off, and measured."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from benchmarks.print_checks.printer import follow
from ccfem.base.errors import InputError
from ccfem.cli.machines import machines
from ccfem.machine import Machine, machine_names, machine_table, updated
from ccfem.printing.calibration_square import (
    ALONG,
    Measured,
    calibration_square,
    corrected,
    corrections,
)
from ccfem.printing.export.gcode import gcode

EXACT = {"front": 5.0, "back": 5.0, "left": 5.0, "right": 5.0, "start": 15.0, "end": 15.0}


def named(name):
    return updated(Machine(), machine_table(name))


@cache
def square_of(name):
    """Square of a printer as its profile says."""
    return calibration_square(named(name))


def measured(name, offset=(0.0, 0.0), cutter=0.0, late=0.0):
    """Measure a square that a printer of other values than its profile has printed.

    Its fibre nozzle stands aside by an offset, mm, its cutter is farther from the nozzle, and each
    strand begins late.
    """
    machine = named(name)
    square = square_of(name)
    run = follow(gcode(square.plan, square.machine), name, (*offset, 0.0))
    assert not run.wrong
    low = 0.5 * (np.array(machine.gcode.bed[:2]) - square.side)
    found = {}
    for strand, steps in run.strands().items():
        if strand.startswith("beside"):
            continue
        laid = np.array([[*step.start[:2], *step.end[:2]] for step in steps if step.lays])
        at = 0.5 * (laid[:, :2] + laid[:, 2:]).mean(axis=0) - low
        axis = int(np.argmax(np.ptp(laid[:, 2:], axis=0)))
        aside = at[1 - axis]
        side = (("front", "back"), ("left", "right"))[axis][int(aside > 0.5 * square.side)]
        found[side] = min(aside, square.side - aside)
        if side != "front":
            continue
        sign = np.sign(laid[-1, 2] - laid[0, 0])
        cut = next(k for k, step in enumerate(steps) if step.cut)
        start = laid[0, 0] + sign * late - low[0]
        end = steps[cut].start[0] + sign * (machine.tail + cutter) - low[0]
        found["start"] = start if sign > 0 else square.side - start
        found["end"] = square.side - end if sign > 0 else end
    return found


@pytest.mark.parametrize("name", machine_names())
def test_a_printer_as_its_profile_says_needs_no_correction(name):
    found = measured(name)
    assert found == pytest.approx(EXACT, abs=0.01)
    machine = named(name)
    same = corrected(machine, Measured.of(EXACT | {"mass": square_of(name).mass}))
    assert same == replace(machine, cutter_distance=machine.tail)


@pytest.mark.parametrize("name", ["chen2021", "aura_like"])
def test_what_is_off_is_told_apart(name):
    machine = named(name)
    found = measured(name, offset=(0.4, -0.7), cutter=1.3, late=0.6)
    off = corrections(machine, Measured.of(found))
    wanted = {"x": 0.4, "y": -0.7, "start": 0.6, "end": 1.3, "flow": 1.0}
    assert off == pytest.approx(wanted, abs=0.01)
    better = corrected(machine, Measured.of(found))
    shift = np.subtract(better.gcode.offset, machine.gcode.offset)
    np.testing.assert_allclose(shift, [0.4, -0.7, 0.0], atol=0.01)
    assert better.tail == pytest.approx(machine.tail + 1.3, abs=0.01)
    assert better.minimum_length >= better.tail
    extra = better.process.restart_extra - machine.process.restart_extra
    assert extra == pytest.approx(0.6, abs=0.01)
    assert better.matrix_diameter == machine.matrix_diameter
    calibration_square(better)  # can be printed again, to check it


def test_matrix_in_excess_is_a_thicker_filament():
    machine = named("klipper")
    fibre = 4.0 * machine.fibre_mass_per_length * (calibration_square(machine).side - 2.0 * ALONG)
    mass = fibre + 1.1 * (calibration_square(machine).mass - fibre)
    thick = corrected(machine, Measured.of(EXACT | {"mass": mass}))
    assert (thick.matrix_diameter / machine.matrix_diameter) ** 2 == pytest.approx(1.1, rel=1e-3)


def test_the_mass_is_that_of_the_square():
    """A plate of 80 x 80 x 2 mm, and four strands of 50 mm that lie on it."""
    mass = 1e-3 * (1.24 * 80.0**2 * 2.0 + 1.4 * 200.0 * 0.1075)
    assert calibration_square(Machine()).mass == pytest.approx(mass, rel=0.002)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"front": 50.0}, "front must be about 5 mm, by up to 10 off; got 50"),
        ({"end": float("nan")}, "end must be a finite number"),
        ({"mass": 0.0}, "mass must be above 0 g"),
        ({"mass": 500.0}, "mass must be about 15.9 g; got 500: weigh the square alone"),
        ({"width": 1.0}, "no measure named 'width'; there are: front, back"),
        ({"left": None}, "left is missing: measure it"),
    ],
)
def test_bad_measures_are_one_line(change, said):
    values = {name: value for name, value in (EXACT | change).items() if value is not None}
    with pytest.raises(InputError, match=said):
        corrections(Machine(), Measured.of(values))


def test_from_the_file_to_the_better_profile(tmp_path, capsys):
    """The commands of the page, one after the other; the second square is planned with the file."""
    machines("klipper", square=tmp_path / "square.gcode")
    assert (tmp_path / "square.gcode").read_text().count("SET_SERVO SERVO=cutter ANGLE=90") == 5
    assert "mass   of the square alone: 15.90 g" in capsys.readouterr().out
    text = "front=5.3,back=4.9,left=5,right=5.2,start=15.4,end=13.7,mass=16.4"
    machines("klipper", measured=text)
    written = capsys.readouterr().out
    assert "ended\n# +1.40 mm too late" in written
    (tmp_path / "mine.toml").write_text(written)
    again = updated(Machine(), machine_table(str(tmp_path / "mine.toml")))
    assert again == corrected(named("klipper"), Measured(5.3, 4.9, 5.0, 5.2, 15.4, 13.7, 16.4))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"name": None, "square": Path("a.gcode")}, "need a machine"),
        ({"name": "klipper", "square": Path("a.txt")}, "end it in .gcode"),
        ({"name": "klipper", "measured": "front"}, "expected NAME=VALUE"),
        ({"name": "klipper", "measured": "front=5,front=6"}, "names a measure twice"),
        ({"name": "klipper", "square": Path("a.gcode"), "measured": "front=5"}, "one of them"),
    ],
)
def test_bad_options_are_one_line(options, said):
    with pytest.raises(InputError, match=said):
        machines(**options)
