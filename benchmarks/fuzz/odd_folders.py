"""Let commands write into folders that hold links, forged records and files of others.

Run ``python -m benchmarks.fuzz.odd_folders [COUNT] [SEED] [COMMANDS,...]``: by default 300 folders
over all commands. Each command ends well or refuses in one line; nothing outside its folder
changes, and nothing in it that has not the name of a result.
"""

import contextlib
import hashlib
import io
import json
import os
import platform
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

from benchmarks.fuzz.__main__ import verdict
from ccfem.base.errors import InputError

__all__ = ["COMMANDS", "MINE", "damage", "ended_process", "entries", "odd_folder", "prepare", "see"]

BAR = ("bar", "--set-case", "element_size=12.5")
QUICK = ("--layers", "1", "--no-virtual-test")
RESULTS = ("results.csv", "results.json", "report.html", "paths.vtp", "zigzag_waypoints.txt")
COMMANDS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "compare": (
        ("compare", *BAR, *QUICK, "--strategies", "zigzag", "--natural", "--no-curve"),
        RESULTS,
    ),
    "plan": (
        ("plan", *BAR, *QUICK, "--strategy", "zigzag", "--drawings", "svg"),
        (*RESULTS, "zigzag_layer_00.svg"),
    ),
    "front": (
        ("front", *BAR, "--strategy", "zigzag", "--layers", "1", "--points", "2"),
        ("front.csv", "front.png", "command.txt"),
    ),
    "study": (
        ("study", "study.toml", "--workers", "0"),
        ("study.json", "results.csv", "results.parquet", "times.csv", "study.html"),
    ),
    "solve": (("solve", *BAR), ("out.vtu",)),
    "mesh": (("mesh", "body.stl", "--size", "5"), ("out.npz",)),
    "new": (("new", "body.stl"), ("out.toml",)),
    "example": (("example", "bracket_plate"), ("out.toml",)),
    "check": (("check", *BAR), ("out.png", "out.html")),
    "faces": (("faces", "body.stl"), ("out.png",)),
    "optimise": (
        (
            *("optimise", "cantilever", "--volume-fraction", "0.5", "--iterations", "2"),
            *("--element-size", "4", "--keep", ""),
        ),
        ("out.toml", "out.npz", "out.png", "out.csv"),
    ),
}
"""Words of each command, and names of the files that it writes."""

FOLDERS = ("compare", "plan", "front", "study")
"""Commands that write a folder of results."""
FORCED = (*FOLDERS, "new", "example", "optimise")
STUDY = """name = "odd"
[[parts]]
name = "bar"
element_size = 12.5
[[strategies]]
name = "zigzag"
"""
MINE = "three years"


def prepare(folder: Path) -> None:
    """Write what commands read."""
    from benchmarks.fuzz.mutants import good_files

    bodies = folder / "bodies"
    bodies.mkdir()
    good_files(bodies)
    (bodies / "box.stl").rename(folder / "body.stl")
    (folder / "study.toml").write_text(STUDY)


def _box(box: Path, shared: Path) -> Path:
    """Make a folder to work in, with what commands read."""
    box.mkdir()
    for name in ("body.stl", "study.toml"):
        os.link(shared / name, box / name)
    return box


def _out(command: str) -> tuple[str, str]:
    """Words that say where a command writes."""
    name = "" if command in FOLDERS else COMMANDS[command][1][0]
    return "-o" if command in ("solve", "mesh") else "--out", str(Path("out") / name)


def ended_process() -> int:
    """Return the number of a process that is no more."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def odd_folder(
    box: Path, command: str, earlier: Path, chance: random.Random, ended: int
) -> tuple[str, ...]:
    """Fill ``out`` with a few odd things and ``outside`` with files of a user.

    Parameters
    ----------
    box : Path
    command : str
    earlier : Path
        What the command writes into an empty folder; now and then ``out`` holds it too.
    chance : random.Random
    ended : int
        Number of a process that is no more.

    Returns
    -------
    tuple of str
        Words to call the command with.
    """
    words, results = COMMANDS[command]
    out, outside = box / "out", box / "outside"
    (outside / "folder").mkdir(parents=True)
    if chance.random() < 0.5:
        shutil.copytree(earlier, out)
    else:
        out.mkdir()
    for name in (*results, "thesis.docx", "folder/notes.txt"):
        (outside / name).write_text(MINE)
    host = re.sub(r"\W", "", platform.node())
    killed = f".ccfem-{host}-{ended}-abcdefg"
    names = [*results, ".ccfem.json", ".lock", ".stress", "runs", f"{killed}1", f"{killed}2"]
    names += ["notes.txt", "stale_waypoints.txt", "stale_layer_01.png", "trade.png", "curve.csv"]
    for name in chance.sample(names, chance.randint(1, 5)):
        with contextlib.suppress(FileNotFoundError):
            (shutil.rmtree if (out / name).is_dir() else os.unlink)(out / name)
        _plant(out / name, outside, chance)
    if chance.random() < 0.4 and not os.path.lexists(out / ".ccfem.json"):
        _forge(out)
    for name, text in (("study.json", "{}"), (".lock", "")):  # once taken for a proof
        if command == "study" and chance.random() < 0.3 and not os.path.lexists(out / name):
            (out / name).write_text(text)
    if command in FORCED and chance.random() < 0.4:
        words = (*words, "--force")
    return (*words, *_out(command))


def _plant(path: Path, outside: Path, chance: random.Random) -> None:
    """Put one odd thing into the place of a file."""
    kind = chance.choice(("file", "folder", "pipe", *("link",) * 6))
    if kind == "file":
        path.write_text(chance.choice((MINE, "", "{}", "[" * 9999)))
    elif kind == "folder":
        path.mkdir(mode=0o700)
        (path / "new").symlink_to(outside)
        (path / "ready").symlink_to(outside)
        (path / "thesis.docx").write_text(MINE)
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        inside = [name.name for name in outside.iterdir()]
        target = outside / chance.choice([*inside, "none.txt", "."])
        path.symlink_to(target if chance.random() < 0.5 else Path("..") / "outside" / target.name)


def _forge(out: Path) -> None:
    """Write a marker that names all there is, with the right hashes, and files above."""
    digest = hashlib.sha256(MINE.encode()).hexdigest()
    names = [*(path.name for path in out.iterdir()), "../outside/thesis.docx", "../outside"]
    about = {"written by": "ccfem", "files": dict.fromkeys([*names, "\0"], digest)}
    (out / ".ccfem.json").write_text(json.dumps(about))


def entries(folder: Path) -> dict[str, object]:
    """Everything in a folder: files with their content, links with their targets."""
    found: dict[str, object] = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_symlink():
            found[name] = f"link to {os.readlink(path)}"
        elif path.is_file():
            found[name] = path.read_bytes()
        else:
            found[name] = path.stat().st_mode
    return found


def damage(box: Path, command: str, forced: bool, before: Mapping[str, object]) -> Iterator[str]:
    """Say what a command has changed that is not its own.

    Parameters
    ----------
    box : Path
    command : str
    forced : bool
    before : mapping
        What was in the box, from `see`.
    """
    after = entries(box)
    known = re.compile(
        r".*_(waypoints|layer_\d+)\.\w+|trade.png|curve.csv|\.ccfem-\S*|\.ccfem.json"
    )
    for name in sorted(before.keys() | after.keys()):
        if before.get(name) == after.get(name):
            continue
        inner = name.removeprefix("out/")
        written = inner in COMMANDS[command][1] or known.fullmatch(inner)
        if command == "study":
            written = written or inner in (".lock", "runs") or re.match(r"runs/\w{40}.json", inner)
        if not name.startswith("out/") or not written:
            yield f"{name} was changed"
        elif command in FOLDERS and before.get(name) == MINE.encode() and not forced:
            marker = before.get("out/.ccfem.json")
            if not (isinstance(marker, bytes) and inner.encode() in marker):
                yield f"{name} was lost without --force"
    for name in after.keys() - before.keys():
        if "/.ccfem-" in name:
            yield f"{name} was left behind"


def see(box: Path, words: tuple[str, ...]) -> None:
    """Call a command in a box, and look at what it has done.

    Raises
    ------
    InputError
        Where the command refuses, with what it said.
    """
    from ccfem.cli.main import main

    command, forced = words[0], "--force" in words
    os.chdir(box)
    before, code = entries(box), None
    said, printed = io.StringIO(), io.StringIO()
    sys.argv = ["ccfem", *words]
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(printed):
        try:
            main()
        except SystemExit as ended:
            code = ended.code
    wrong = "; ".join(damage(box, command, forced, before))
    if wrong:
        raise RuntimeError(f"{' '.join(words)}: {wrong}")
    lines = [line for line in said.getvalue().splitlines() if not re.match(r"ccfem: \d", line)]
    if code == 2:
        raise InputError("\n".join(lines))
    if code != 0:
        raise RuntimeError(f"{' '.join(words)}: exit code {code}: {' '.join(lines)}")


def main(count: int = 300, seed: str = "1", wanted: tuple[str, ...] = ()) -> int:
    """Try `count` folders over all commands; return how many are not met as they should be."""
    tally: Counter[str] = Counter()
    wrong, ended = 0, ended_process()
    commands = wanted or tuple(COMMANDS)
    with tempfile.TemporaryDirectory() as name:
        shared = Path(name) / "shared"
        shared.mkdir()
        prepare(shared)
        for command in commands:  # imported and compiled once for all
            box = _box(Path(name) / command, shared)
            (box / "out").mkdir()
            see(box, (*COMMANDS[command][0], *_out(command)))
        for k in range(count):
            command = commands[k % len(commands)]
            box = _box(Path(name) / str(k), shared)
            earlier = Path(name) / command / "out"
            words = odd_folder(box, command, earlier, random.Random(f"{seed} {k}"), ended)
            found = verdict(box, partial(see, words=words))
            tally[f"{command} {found if found in ('read', 'refused') else 'WRONG'}"] += 1
            if found not in ("read", "refused"):
                wrong += 1
                print(f"{k}: {' '.join(words)}: {found}", flush=True)
    print(dict(sorted(tally.items())))
    print(f"{sum(tally.values())} odd folders, {wrong} not met as they should be")
    return wrong


if __name__ == "__main__":
    given = sys.argv[1:]
    count, seed, commands, *_ = *given, *("300", "1", "")[len(given) :]
    sys.exit(bool(main(int(count), seed, tuple(filter(None, commands.split(","))))))
