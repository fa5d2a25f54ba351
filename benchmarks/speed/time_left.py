"""How true the remaining time is that a run tells.

    python -m benchmarks.speed.time_left [loop] [bracket] [front] [plate] [layers]

Runs commands on one processor, and prints for each line of progress the time that is left by its
share of the work, that which was left, and their ratio: ``ccfem compare`` of two cases, ``front``
of one, and ``plan --gcode`` of plates of 400 x 300 mm with 16 layers and of 200 x 150 mm with 72.
All are processor time, so that other load does not count. The last line is the largest factor
between them after the first tenth of the run.
"""

import math
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.speed.size import plate

_LINE = re.compile(r"ccfem: \d+ s, (\d+) %(?:, about .* left)?: (.*)")

_WORTH = 2.0
"""Seconds left from which a line counts: shares are told in whole hundredths."""

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


def spent(process: int) -> float:
    """Processor time of a process so far, s."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def watch(words: list[str], folder: Path) -> None:
    """Run a command, and print what it told and what was true."""
    given = [word.format(folder=folder) for word in words]
    child = subprocess.Popen(
        [sys.executable, "-m", "ccfem", *given, "--out", str(folder / "out")],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "CCFEM_THREADS": "1"},
    )
    assert child.stderr is not None
    found = [(spent(child.pid), line) for text in child.stderr if (line := _LINE.match(text))]
    _, _, used = os.wait4(child.pid, 0)
    first = found[0][0]
    whole = used.ru_utime + used.ru_stime - first
    print(f"ccfem {' '.join(words)}: {whole:.0f} s")
    print(f"{'after':>7} {'share':>6} {'told':>7} {'true':>7} {'ratio':>6}")
    largest = 1.0
    for at, line in found:
        after, share = at - first, int(line[1])
        left, told = whole - after, after * (100.0 / max(share, 1) - 1.0)
        if after > 0.1 * whole and left > _WORTH:
            largest = max(largest, math.exp(abs(math.log(told / left))))
        print(f"{after:7.1f} {share:5d}% {told:7.1f} {left:7.1f} {told / left:6.2f}  {line[2]}")
    print(f"largest factor after a tenth, with {_WORTH:g} s left or more: {largest:.2f}\n")


def main() -> None:
    """Watch the runs that are named, by default all."""
    for name in sys.argv[1:] or RUNS:
        with tempfile.TemporaryDirectory() as folder:
            for part, about in PLATES.items():
                (Path(folder) / f"{part}.toml").write_text(plate(*about))
            watch(RUNS[name], Path(folder))


if __name__ == "__main__":
    main()
