"""How true the remaining time is that a run tells.

    python -m benchmarks.speed.time_left [loop] [bracket] [front] [plate] [layers]

Runs commands on one processor, and prints for each line of progress the time that is told to be
left, that which was left, and their ratio: ``ccfem compare`` of two cases, ``front`` of one, and
``plan --gcode`` of plates of 400 x 300 mm with 16 layers and of 200 x 150 mm with 72. All are
processor time, so that other load does not count. The last line is the largest factor between them
after the first tenth of the run.
"""

import math
import sys
import tempfile
from pathlib import Path

from benchmarks.speed.effort import WORTH, watch
from benchmarks.speed.size import plate

PLATES = {"plate": (400.0, 300.0, 16), "layers": (200.0, 150.0, 72)}
"""Sides, mm, and layers."""

_LAYERED = ["--strategy", "isocurve", "--gcode", "--layers"]

RUNS = {
    "loop": ["compare", "loop"],
    "bracket": ["compare", "bracket"],
    "front": ["front", "loop"],
} | {
    name: ["plan", f"{{folder}}/{name}.toml", *_LAYERED, str(layers)]
    for name, (_, _, layers) in PLATES.items()
}


def show(words: list[str], folder: Path) -> None:
    """Run a command, and print what it told and what was true."""
    (_, _, _), (first, _, _), *steps, (end, _, _) = watch(
        [word.format(folder=folder) for word in words], folder
    )["steps"]
    print(f"ccfem {' '.join(words)}: {end:.0f} s, {first:.1f} of them before the first line")
    print(f"{'after':>7} {'told':>7} {'true':>7} {'ratio':>6}")
    largest = 1.0
    for at, expected, what in steps:
        left = end - at
        if at > 0.1 * end and left > WORTH:
            largest = max(largest, math.exp(abs(math.log(expected / left))))
        print(f"{at:7.1f} {expected:7.1f} {left:7.1f} {expected / left:6.2f}  {what}")
    print(f"largest factor after a tenth, with {WORTH:g} s left or more: {largest:.2f}\n")


def main() -> None:
    """Watch the runs that are named, by default all."""
    for name in sys.argv[1:] or RUNS:
        with tempfile.TemporaryDirectory() as folder:
            for part, about in PLATES.items():
                (Path(folder) / f"{part}.toml").write_text(plate(*about))
            show(RUNS[name], Path(folder))


if __name__ == "__main__":
    main()
