"""A folder of results: replaced as a whole, and nothing of others lost."""

import ast
import hashlib
import json
import multiprocessing
import os
import platform
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from fnmatch import fnmatchcase
from pathlib import Path

import pytest

from ccfem.base.errors import InputError
from ccfem.base.folder import Folder
from ccfem.base.result_folder import whole_folder
from ccfem.base.whole import whole_file
from ccfem.comparison import files as files_of_comparisons
from ccfem.comparison.files import BED_FILES, RESULT_FILES

NAMES = ("report.html", "paths.vtp", "notes.txt", "*_waypoints.txt", "[abc]")
"""Files that ccfem writes, in these tests."""


def write(directory, force=False, **files):
    with whole_folder(directory, NAMES, force) as folder:
        for name, text in files.items():
            (folder / name.replace("_", ".")).write_text(text)


def contents(directory):
    return {
        path.name: path.read_text() for path in directory.iterdir() if path.name != ".ccfem.json"
    }


def leftovers(folder):
    return [path.name for path in folder.rglob(".ccfem-*")]


def test_a_new_run_replaces_the_one_before(tmp_path):
    where = tmp_path / "deep" / "results"
    write(where, report_html="first", paths_vtp="first")
    write(where, report_html="second")
    assert contents(where) == {"report.html": "second"}
    assert leftovers(tmp_path) == []


def test_files_of_others_stay(tmp_path):
    write(tmp_path / "results", report_html="first")
    (tmp_path / "results" / "thesis.docx").write_text("three years")
    (tmp_path / "results" / "data").mkdir()
    (tmp_path / "results" / "data" / "raw.csv").write_text("1, 2")
    write(tmp_path / "results", report_html="second", paths_vtp="second")
    assert (tmp_path / "results" / "data" / "raw.csv").read_text() == "1, 2"
    (tmp_path / "results" / "data" / "raw.csv").unlink()
    (tmp_path / "results" / "data").rmdir()
    expected = {"report.html": "second", "paths.vtp": "second", "thesis.docx": "three years"}
    assert contents(tmp_path / "results") == expected


def test_a_folder_of_others_is_refused_before_any_work(tmp_path):
    (tmp_path / "report.html").write_text("mine")
    with pytest.raises(InputError, match=r"did not write, such as report.html: .*--force"):
        write(tmp_path, report_html="new")
    (tmp_path / "thesis.docx").write_text("three years")
    write(tmp_path, force=True, report_html="new")
    assert contents(tmp_path) == {"report.html": "new", "thesis.docx": "three years"}


def test_a_result_that_was_changed_is_refused(tmp_path):
    where = tmp_path / "results"
    write(where, report_html="first", notes_txt="as written")
    (where / "notes.txt").write_text("with remarks of mine")
    with pytest.raises(InputError, match=r"notes.txt was changed since ccfem wrote it.*--force"):
        write(where, report_html="second")
    write(where, force=True, report_html="second")
    assert contents(where) == {"report.html": "second", "notes.txt": "with remarks of mine"}


def test_a_file_of_another_that_gets_a_results_name_is_found(tmp_path):
    where = tmp_path / "results"
    write(where, report_html="first")
    (where / "paths.vtp").write_text("mine")
    with pytest.raises(InputError, match="is not by ccfem and has the name of a result"):
        write(where, report_html="second", paths_vtp="second")
    assert contents(where) == {"report.html": "first", "paths.vtp": "mine"}
    assert leftovers(tmp_path) == []


@pytest.mark.parametrize("names", [["../kept.txt"], ["thesis.docx"], [3], "kept.txt", None])
def test_a_marker_from_elsewhere_removes_nothing(tmp_path, names):
    where = tmp_path / "results"
    write(where, report_html="first")
    for path in (tmp_path / "kept.txt", where / "thesis.docx"):
        path.write_text("kept")
    marker = json.loads((where / ".ccfem.json").read_text())
    listed = {name: hashlib.sha256(b"other").hexdigest() for name in names or ()}
    marker["files"] = {**marker["files"], **listed} if names else names
    (where / ".ccfem.json").write_text(json.dumps(marker))
    with suppress(InputError):
        write(where, report_html="second")
    assert (tmp_path / "kept.txt").read_text() == "kept"
    assert (where / "thesis.docx").read_text() == "kept"


def test_the_folder_that_one_works_in_stays(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, report_html="first", paths_vtp="first")
    inode = tmp_path.stat().st_ino
    write(tmp_path, report_html="second")
    assert contents(tmp_path) == {"report.html": "second"}
    assert tmp_path.stat().st_ino == inode
    assert (os.getcwd(), leftovers(tmp_path)) == (str(tmp_path), [])


def test_a_block_that_raises_leaves_the_folder_as_it_was(tmp_path):
    where = tmp_path / "results"
    write(where, report_html="first")
    with pytest.raises(InputError, match="No such file"), whole_folder(where, NAMES) as folder:
        (folder / "missing" / "report.html").write_text("half")
    assert contents(where) == {"report.html": "first"}
    assert leftovers(tmp_path) == []


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "results").write_text("a file")
    with pytest.raises(InputError, match="it is a file: name a folder"):
        write(tmp_path / "results", report_html="new")


def killed_folder(parent, pid, host=None, mode=0o700, rest="abcdefgh"):
    """Make what a killed run leaves: a private folder with results that were not yet moved."""
    host = re.sub(r"\W", "", platform.node()) if host is None else host
    path = parent / f".ccfem-{host}-{pid}-{rest}"
    (path / "new").mkdir(parents=True)
    (path / "new" / "report.html").write_text("half")
    path.chmod(mode)
    return path


@pytest.fixture(scope="module")
def ended():
    """Number of a process that has ended."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_what_a_killed_run_left_is_removed_and_nothing_else(tmp_path, ended):
    where = tmp_path / "results"
    write(where, report_html="first")
    for parent in (tmp_path, where):
        left = killed_folder(parent, ended)
        half_written = left.name.replace("abcdefgh", "0a" * 8)
        (left / "new" / half_written).write_text("half")
    kept = [killed_folder(where, os.getpid()), killed_folder(where, ended, "elsewhere")]
    public = killed_folder(tmp_path, ended, mode=0o755, rest="publics_")  # as none of ccfem's
    mine = killed_folder(where, ended, rest="has_mine") / "new" / "thesis.docx"
    mine.write_text("three years")
    kept.append(mine.parent.parent)
    link = tmp_path / public.name.replace("publics_", "links_to")
    link.symlink_to(where)
    write(where, report_html="second")
    assert sorted(leftovers(tmp_path)) == sorted(p.name for p in [*kept, public, link])
    assert (where / "report.html").read_text() == "second"
    assert [path.name for path in mine.parent.iterdir()] == ["thesis.docx"]


def test_a_run_that_was_killed_while_it_replaced_files_is_finished(tmp_path, ended, monkeypatch):
    """Of two files one was replaced; a third is to go. A foreign one has come into the way of none.

    The kill is an error that nothing cleans up behind.
    """
    where, take = tmp_path / "results", Folder.take
    write(where, a="first", b="first", c="first")
    (where / "thesis.docx").write_text("three years")
    taken = []

    def second_fails(self, source, name, new=None):
        if name in ("a", "b"):
            taken.append(name)
        if taken == ["a", "b"]:
            raise KeyboardInterrupt
        take(self, source, name, new)

    with monkeypatch.context() as patch:
        patch.setattr(Folder, "take", second_fails)
        patch.setattr("shutil.rmtree", lambda *_, **__: None)
        patch.setattr("os.getpid", lambda: ended)
        with pytest.raises(KeyboardInterrupt):
            write(where, a="second", b="second")
    half = {"a": "second", "b": "first", "c": "first", "thesis.docx": "three years"}
    assert len(leftovers(tmp_path)) == 1
    held = {path.name: path.read_text() for path in where.iterdir() if path.is_file()}
    del held[".ccfem.json"]
    assert held == half
    with pytest.raises(ZeroDivisionError), whole_folder(where, NAMES):
        raise ZeroDivisionError
    assert contents(where) == {"a": "second", "b": "second", "thesis.docx": "three years"}
    write(where, c="third")
    assert contents(where) == {"c": "third", "thesis.docx": "three years"}


RUNS = """
from ccfem.base.result_folder import whole_folder
started.set()
for k in range(count):
    with whole_folder(where, 'abc') as folder:
        for name in "abc":
            (folder / name).write_text(str(k))
"""


@pytest.fixture(scope="module")
def runs():
    """Begin a process that writes a folder a number of times, and an event that it has begun."""
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload(["ccfem.base.result_folder"])  # imported once for all

    def begin(where, count):
        started = processes.Event()
        known = {"where": where, "count": count, "started": started}
        run = processes.Process(target=exec, args=(RUNS, known))
        run.start()
        return run, started

    return begin


@pytest.mark.parametrize("delay", [0.0, 0.003, 0.011, 0.05, 0.12])
def test_a_kill_at_any_moment_leaves_whole_results(tmp_path, runs, delay):
    where = tmp_path / "results"
    write(where, a="first", b="first", c="first")
    (where / "thesis.docx").write_text("three years")
    run, started = runs(where, 100000)
    assert started.wait(60.0)
    time.sleep(delay)
    run.kill()
    run.join()
    assert run.exitcode == -signal.SIGKILL
    with suppress(ZeroDivisionError), whole_folder(where, "abc"):  # the next run mends
        raise ZeroDivisionError
    found = contents(where)
    assert found.pop("thesis.docx") == "three years"
    assert found.keys() == {"a", "b", "c"}
    assert len(set(found.values())) == 1
    assert leftovers(tmp_path) == []


def test_runs_into_one_folder_at_once_lose_nothing(tmp_path, runs):
    pytest.importorskip("fcntl")
    where = tmp_path / "results"
    write(where, a="first", b="first", c="first")
    (where / "thesis.docx").write_text("three years")
    both = [runs(where, 60) for _ in range(2)]
    for run, _ in both:
        run.join()
    assert [run.exitcode for run, _ in both] == [0, 0]
    assert contents(where) == {"a": "59", "b": "59", "c": "59", "thesis.docx": "three years"}
    assert leftovers(tmp_path) == []


def test_a_file_that_comes_in_the_last_moment_stays(tmp_path, monkeypatch):
    where, take = tmp_path / "results", Folder.take
    write(where, a="first", b="first")

    def late(self, *names):
        (where / "thesis.docx").write_text("three years")
        take(self, *names)

    monkeypatch.setattr(Folder, "take", late)
    write(where, a="second")
    assert contents(where) == {"a": "second", "thesis.docx": "three years"}


def forge(folder, **files):
    """Write a marker that names files with their right hashes."""
    hashes = {name: hashlib.sha256(text.encode()).hexdigest() for name, text in files.items()}
    (folder / ".ccfem.json").write_text(json.dumps({"written by": "ccfem", "files": hashes}))


def test_a_forged_marker_gives_no_file_of_another_name_away(tmp_path):
    where = tmp_path / "results"
    where.mkdir()
    (where / "thesis.docx").write_text("three years")
    (tmp_path / "x_waypoints.txt").write_text("outside")
    forge(where, **{"thesis.docx": "three years", "../x_waypoints.txt": "outside"})
    write(where, report_html="first")
    assert contents(where) == {"thesis.docx": "three years", "report.html": "first"}
    assert (tmp_path / "x_waypoints.txt").read_text() == "outside"


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("name", ["report.html", "paths.vtp", ".ccfem.json", "stale_waypoints.txt"])
def test_links_are_never_followed(tmp_path, name, force):
    """Beside a marker that names the link, with the hash of what it points to."""
    where, outside = tmp_path / "results", tmp_path / "outside"
    where.mkdir()
    outside.mkdir()
    forge(where, **{name: "mine"})
    forge(outside, **{"report.html": "mine"})
    before = contents(outside) | {".ccfem.json": (outside / ".ccfem.json").read_text()}
    target = outside / name
    if name != ".ccfem.json":
        before[name] = "mine"
        target.write_text("mine")
    else:
        (where / name).unlink()
    (where / name).symlink_to(target)
    if force:
        write(where, force=True, report_html="new", paths_vtp="new")
        assert (where / "report.html").read_text() == "new"
        assert not (where / "report.html").is_symlink()
        assert (where / "stale_waypoints.txt").is_symlink() == (name == "stale_waypoints.txt")
    else:
        with pytest.raises(InputError, match=r"did not write|was changed since"):
            write(where, report_html="new", paths_vtp="new")
        assert (where / name).is_symlink()
    assert {path.name: path.read_text() for path in outside.iterdir()} == before


def test_force_takes_no_folder(tmp_path):
    where = tmp_path / "results"
    (where / "report.html").mkdir(parents=True)
    (where / "report.html" / "thesis.docx").write_text("three years")
    with pytest.raises(
        InputError,
        match=r"report.html is not by ccfem .*: move it or choose another folder with --out$",
    ):
        write(where, force=True, report_html="new")
    assert (where / "report.html" / "thesis.docx").read_text() == "three years"
    assert [path.name for path in where.iterdir()] == ["report.html"]


def test_folders_in_folders_are_real_ones(tmp_path):
    where, outside = tmp_path / "results", tmp_path / "outside"
    outside.mkdir()

    def write_inner(text):
        with whole_folder(where, (), force=True) as folder:
            (folder / "pull").mkdir()
            (folder / "pull" / "report.html").write_text(text)

    write_inner("first")
    (where / "pull" / "thesis.docx").write_text("three years")
    write_inner("second")
    assert contents(where / "pull") == {"report.html": "second", "thesis.docx": "three years"}
    (where / "pull").rename(tmp_path / "moved")
    (where / "pull").symlink_to(outside)
    with pytest.raises(InputError, match="pull is not by ccfem"):
        write_inner("third")
    assert list(outside.iterdir()) == []


def test_what_several_commands_write_into_one_folder_stays_known(tmp_path):
    for text in ("first", "second"):
        for name in ("front.csv", "report.html"):
            with whole_folder(tmp_path / "results", (name,)) as folder:
                (folder / name).write_text(text)
    assert contents(tmp_path / "results") == {"front.csv": "second", "report.html": "second"}


def test_a_file_is_written_in_place_of_a_link(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "paths.vtp").symlink_to(tmp_path / "notes.txt")
    with whole_file(tmp_path / "paths.vtp") as temporary:
        assert temporary.parent.stat().st_mode & 0o777 == 0o700
        temporary.write_text("new")
    assert contents(tmp_path) == {"notes.txt": "mine", "paths.vtp": "new"}
    assert not (tmp_path / "paths.vtp").is_symlink()


@pytest.mark.parametrize("name", ["..", ".", "", "a/b", "/etc/passwd"])
def test_a_folder_knows_its_own_entries_alone(tmp_path, name):
    with Folder.opened(tmp_path) as folder, pytest.raises(ValueError, match="no name of an entry"):
        folder.write(name, b"")


def filled(part):
    """Piece of the name of a file, with values for what is not known before."""
    if isinstance(part, ast.Constant):
        return part.value
    return "svg" if ast.unparse(part).strip("'f{}\"") == "suffix" else "07"


def test_all_files_that_comparisons_write_are_known():
    """Every name behind ``folder /`` in the source, numbers and names in it filled in."""
    source = Path(files_of_comparisons.__file__).read_text()
    names = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.BinOp) and ast.unparse(node.left) == "folder":
            parts = getattr(node.right, "values", [node.right])
            names.append("".join(filled(part) for part in parts))
    names = [name for name in names if name != "07"]
    assert len(names) >= 6
    for name in names:
        assert any(fnmatchcase(name, pattern) for pattern in (*RESULT_FILES, *BED_FILES)), name
    assert not any(fnmatchcase("thesis.docx", pattern) for pattern in RESULT_FILES)


def test_where_a_system_has_no_calls_relative_to_a_folder(tmp_path, monkeypatch):
    monkeypatch.setattr("ccfem.base.folder._RELATIVE", False)
    where = tmp_path / "results"
    write(where, report_html="first", notes_txt="first")
    (where / "thesis.docx").write_text("three years")
    write(where, report_html="second")
    assert contents(where) == {"report.html": "second", "thesis.docx": "three years"}
    (where / "notes.txt").symlink_to(where / "thesis.docx")
    with pytest.raises(InputError, match=r"notes.txt is not by ccfem"):
        write(where, notes_txt="third")
    (tmp_path / "link").symlink_to(where)
    with Folder.opened(tmp_path) as folder, pytest.raises(NotADirectoryError), folder.inner("link"):
        pass
