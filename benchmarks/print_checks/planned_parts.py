"""Plan parts by the command line, and hold every file against its table and the rules for strands.

    python -m benchmarks.print_checks.planned_parts FOLDER [PART:STRATEGY[:MACHINE[:LAYERS]] ...]

A row a plan; what is in FOLDER already is not planned again. Parts are cases, or the part files of
`docs/how_to/your_part.md`; `LAYERS` says how many layers each has by default. The columns: what
ccfem says of printing it; strands, minutes of the fibre tool and grams of fibre, of the table and
of the file; strands of the file that are none of the written paths; strands that break each rule.
A row is *wrong* where the table says other than the file, or where ccfem calls printable what
breaks a rule.
"""

import re
import subprocess
import sys
from pathlib import Path

from benchmarks.print_checks.results_folder import Folder, agreement, tally
from benchmarks.studies import own_parts

__all__ = ["LAYERS", "PLANS", "main", "part_file", "planned"]

ROOT = Path(__file__).parents[2]
LAYERS = {"loop": 12, "lever": 6, "hook": 6, "bridge": 2}
PLANS = tuple(
    f"{part}:{strategy}"
    for part in LAYERS
    for strategy in ("stream_function", "isocurve", "concentric", "svt")
)
RULES = ("folds", "run", "outside", "crossings", "over", "cut", "start")
_BODIES = {"bracket": "l_bracket.step", "hook": "crane_hook.stl", "lever": "brake_lever.stl"}
_MAKERS = {"bracket": "l_bracket", "hook": "crane_hook", "lever": "brake_lever"}


def part_file(name: str, folder: Path) -> str:
    """Name of a case, or a part file that is made with its body."""
    if name not in _BODIES:
        return name
    file = folder / f"{name}.toml"
    if not file.exists():
        page = (ROOT / "docs" / "how_to" / "your_part.md").read_text(encoding="utf-8")
        texts = re.findall(r"```toml\n(.*?)```", page, flags=re.S)
        text = next(text for text in texts if _BODIES[name] in text)
        getattr(own_parts, _MAKERS[name])(folder / _BODIES[name])
        file.write_text(text, encoding="utf-8")
    return str(file)


def _ccfem(*words: str) -> None:
    """Run a command, and end with what it says where it fails."""
    command = [sys.executable, "-m", "ccfem", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])


def planned(plan: str, folder: Path) -> Folder:
    """Plan a part, where it is not yet planned, and read its folder."""
    name, strategy, machine, layers = (*plan.split(":"), "", "")[:4]
    part, mesh = part_file(name, folder), folder / f"{name}.vtu"
    if not mesh.exists():
        _ccfem("solve", part, "-o", str(mesh))
    results = folder / plan.replace(":", "-")
    if not results.exists():
        count = layers or LAYERS.get(name)
        words: tuple[str, ...] = ("--layers", str(count)) if count else ()
        words += ("--machine", machine or "marlin_two_tools", "--no-virtual-test", "--gcode")
        _ccfem("plan", part, "--strategy", strategy, *words, "--force", "--out", str(results))
    return Folder(results, mesh, strategy)


def _row(plan: str, folder: Folder) -> tuple[str, bool]:
    """Row of a plan, and whether it is wrong."""
    said, done, (_, mass) = folder.table(), folder.file(), folder.head()
    count = tally(folder.printed, folder.rules)
    other = len(folder.printed) - len(folder.pairs())
    alike = all(good for *_, good in agreement(folder))
    printable = bool(folder.verdict["printable"])
    row = (
        f"| {plan} | {'yes' if printable else 'no'} | {said.strands:.0f}/{done.strands} "
        f"| {said.seconds / 60:.1f}/{folder.fibre_tool() / 60:.1f} | {said.mass:.2f}/{mass:.2f} "
        f"| {other} | {' | '.join(str(count[rule]) for rule in RULES)} |"
    )
    return row, not alike or (printable and bool(count))


def main(arguments: list[str]) -> int:
    """Print the table; how many rows are wrong."""
    folder = Path(arguments[0])
    folder.mkdir(parents=True, exist_ok=True)
    print(f"| plan | printable | strands | min | g | others | {' | '.join(RULES)} |")
    print("|" + (6 + len(RULES)) * "---|")
    wrong = 0
    for plan in arguments[1:] or PLANS:
        try:
            row, bad = _row(plan, planned(plan, folder))
        except RuntimeError as error:
            row, bad = f"| {plan} | refused: {error} |", False
        wrong += bad
        print(row, flush=True)
    return wrong


if __name__ == "__main__":
    raise SystemExit(min(main(sys.argv[1:]), 1))
