"""Print parts on paper with every machine: a table of what holds, and pictures to look at.

Run ``python -m benchmarks.print_checks [PART,...] [MACHINE,...] [--pictures FOLDER]``. Section 8 of
the specification of the print has twelve checks; each is a column, with its first failure below the
table, and so are what lines of matrix are said to measure (shapes) and whether they are laid on
something (air); parts that hang over are printed on support. All numbers are those of a
printer that reads the file (`printer`), and of VTK's sections of the part; s are seconds of CPU to
write, follow and check a file. The twelfth, spoiled files, is
`tests/printing/test_spoiled_files.py`. The columns behind the bar count the strands that break each
of the rules for strands (`strand_rules`), of as many as the last column says.
"""

import argparse
import time
from pathlib import Path

from benchmarks.print_checks.all_checks import CHECKS
from benchmarks.print_checks.filling import fullness
from benchmarks.print_checks.motion import free_fibre
from benchmarks.print_checks.parts import PARTS, Part, job_of
from benchmarks.print_checks.strand_checks import STRAND_RULES, measured
from ccfem.base.errors import InputError
from ccfem.machine import machine_names


def main() -> int:
    """Print the table; the number of checks that failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="?", default=",".join(PARTS))
    parser.add_argument("machines", nargs="?", default=",".join(machine_names()))
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--files", type=Path, help="folder for the files that are followed")
    given = parser.parse_args()
    names = "".join(f"{check.__name__[:7]:>8}" for check in CHECKS)
    names += " |" + "".join(f"{check.__name__[:7]:>8}" for check in STRAND_RULES) + " strands"
    print(
        f"{'part':8} {'machine':17} {'full':>6} {'layers':>11} {'free':>6} {'span':>5} "
        f"{'time':>7} {'s':>5}{names}"
    )
    failed, said = 0, []
    for name in given.parts.split(","):
        part = Part.named(name)
        for machine in given.machines.split(","):
            lines = row(part, name, machine, given.pictures, given.files)
            failed += len(lines)
            said += [f"{name}, {machine}: {line}" for line in lines]
    print("\n".join(said))
    return failed


def row(
    part: Part, name: str, machine: str, pictures: Path | None, files: Path | None
) -> list[str]:
    """Print a row; what is wrong, a line a check."""
    try:
        job, spent = job_of(part, machine)
    except InputError as error:
        print(f"{name:8} {machine:17} refused")
        return [f"refused: {error}"]
    began = time.process_time()
    found = {check.__name__: check(job, job.done) for check in CHECKS}
    rules = {check.__name__: check(job, job.done) for check in STRAND_RULES}
    seconds = spent["write"] + spent["follow"] + time.process_time() - began
    whole, layers = fullness(job, job.done)
    shares = [share for _, share in layers]
    free, spans = free_fibre(job, job.done)
    marks, broken = (
        "".join(f"{len(wrong) or '-':>8}" for wrong in group.values()) for group in (found, rules)
    )
    print(
        f"{name:8} {machine:17} {whole:6.1%} {min(shares):5.1%}-{max(shares):.1%} {free:6.2%} "
        f"{max((length for length, _ in spans), default=0.0):5.1f} "
        f"{float(job.done.head['TIME']) / 60:5.0f}m {seconds:5.1f}{marks} |"
        f"{broken}{len(measured(job, job.done)):8d}",
        flush=True,
    )
    if files is not None:
        files.mkdir(parents=True, exist_ok=True)
        (files / f"{name}_{machine}.gcode").write_text(job.text, encoding="utf-8")
    if pictures is not None:
        from benchmarks.print_checks.pictures import draw

        pictures.mkdir(parents=True, exist_ok=True)
        draw(job, f"{name}, {machine}", pictures / f"{name}_{machine}.png")
    wrong = [
        f"{name}: {lines[0]}" + (f" ({len(lines)} such)" if lines[1:] else "")
        for name, lines in {**found, **rules}.items()
        if lines
    ]
    return wrong


if __name__ == "__main__":
    raise SystemExit(min(main(), 1))
