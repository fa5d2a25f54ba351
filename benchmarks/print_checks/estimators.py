"""Files of a print in other programs' parsers: pyGCodeDecode's time, gcodeparser's words.

Run ``python -m benchmarks.print_checks.estimators FILE.gcode ...`` on files that ccfem wrote, where
``pip install pyGCodeDecode gcodeparser`` was done. pyGCodeDecode knows junction deviation as Marlin
has it, E, and dwell; no tools, no heat, no cutter. What is compared is therefore the time of all
that moves; heat is said beside it.
"""

import re
import sys
import tempfile
import warnings
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Estimate", "estimate", "words_of"]

ACCELERATION, JUNCTION = 1000.0, 0.02
"""Those of `ccfem.machine.Process`, mm/s^2 and mm."""


@dataclass(frozen=True)
class Estimate:
    """Time by another program, s; the least and most of X, Y and Z, mm; what it complained of."""

    seconds: float
    low: tuple[float, ...]
    high: tuple[float, ...]
    said: tuple[str, ...]


def _plain(text: str) -> str:
    """Text with E for every feed: pyGCodeDecode knows no U and V, and takes M82 for granted."""
    found, moved = [], False
    for line in text.splitlines():
        code = line.partition(";")[0].strip()
        word = code.split(" ")[0]
        if word in ("G0", "G1"):
            # The way from home to the first line is not counted: where home is, the file says not.
            moved = moved or " X" in code
            found.append(re.sub(r" V[-.\d]+", "", code).replace(" U", " E"))
        elif word in ("G90", "M83", "G21") or (word == "G4" and moved):
            found.append(code)
    return "\n".join(found) + "\n"


def estimate(text: str) -> Estimate:
    """Time and extent of a file by pyGCodeDecode.

    Raises
    ------
    ImportError
        Where it is not installed.
    """
    from pyGCodeDecode.gcode_interpreter import setup, simulation

    presets = {
        "p_vel": 100.0,
        "p_acc": ACCELERATION,
        "jerk": (JUNCTION * ACCELERATION / 0.414) ** 0.5,
        "vX": 500.0,
        "vY": 500.0,
        "vZ": 500.0,
        "vE": 500.0,
        "nozzle_diam": 0.4,
        "filament_diam": 1.75,
        "firmware": "junction_deviation",
    }
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        machine = Path(folder) / "machine.yaml"
        lines = "\n".join(f"  {key}: {value}" for key, value in presets.items())
        machine.write_text(f"other:\n{lines}\n", encoding="utf-8")
        file = Path(folder) / "print.gcode"
        file.write_text(_plain(text), encoding="utf-8")
        made = setup(presets_file=str(machine), printer="other", verbosity_level=0)
        done = simulation(gcode_path=file, initial_machine_setup=made, verbosity_level=0)
        places = [block.state_B.state_position.get_vec() for block in done.blocklist]
    low, high = (
        tuple(float(pick(each)) for each in zip(*(p[:3] for p in places), strict=True))
        for pick in (min, max)
    )
    seconds = float(done.blocklist[-1].get_segments()[-1].t_end)
    return Estimate(seconds, low, high, tuple(str(one.message) for one in said))


def words_of(text: str) -> tuple[int, tuple[str, ...]]:
    """Lines that gcodeparser reads, and the commands of a file that it does not give back."""
    from gcodeparser import parse_gcode_lines

    read = [line.command_str for line in parse_gcode_lines(text)]
    wanted = [line.partition(";")[0].split(" ")[0].strip() for line in text.splitlines()]
    wanted = [word for word in wanted if re.fullmatch(r"[GMT]\d+", word)]
    return len(read), tuple(sorted(set(wanted) - set(read)))


def main(files: list[str]) -> int:
    """Print a row a file; the number that differ by more than a twentieth."""
    wrong = 0
    print(f"{'file':40} {'ccfem, s':>9} {'moves':>8} {'other':>8} {'ratio':>6} {'lines':>8}  said")
    for name in files:
        text = Path(name).read_text(encoding="utf-8")
        whole = float(re.findall(r"^;TIME:([\d.]+)", text, re.M)[0])
        heating = float(re.findall(r"^; of it waiting for tools .*= ([\d.]+) s", text, re.M)[0])
        found = estimate(text)
        count, lost = words_of(text)
        ours = whole - heating
        ratio = ours / found.seconds
        wrong += not 0.95 < ratio < 1.05
        print(
            f"{Path(name).name:40} {whole:9.0f} {ours:8.0f} {found.seconds:8.0f} "
            f"{ratio:6.3f} {count:8d}  {'; '.join(dict.fromkeys(found.said)) or '-'} {lost or ''}",
            flush=True,
        )
    return wrong


if __name__ == "__main__":
    raise SystemExit(min(main(sys.argv[1:]), 1))
