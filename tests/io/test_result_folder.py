"""A folder of results: replaced as a whole, and nothing of others lost."""

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

import pytest

from ccfem.errors import InputError
from ccfem.io.result_folder import whole_folder


def write(directory, force=False, **files):
    with whole_folder(directory, force) as folder:
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
    with pytest.raises(InputError, match="No such file"), whole_folder(where) as folder:
        (folder / "missing" / "report.html").write_text("half")
    assert contents(where) == {"report.html": "first"}
    assert leftovers(tmp_path) == []


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "results").write_text("a file")
    with pytest.raises(InputError, match="it is a file: name a folder"):
        write(tmp_path / "results", report_html="new")


def test_what_a_killed_run_left_is_removed_and_what_it_set_aside_comes_back(tmp_path):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    host = re.sub(r"\W", "", platform.node())
    (tmp_path / f".ccfem-{host}-{ended.pid}-abc").mkdir()
    (tmp_path / f".ccfem-{host}-{os.getpid()}-abc").mkdir()
    (tmp_path / f".ccfem-elsewhere{host}-{ended.pid}-abc").mkdir()
    old = tmp_path / f".ccfem-{host}-{ended.pid}-old-results"
    write(old, report_html="first")
    write(tmp_path / "other", report_html="new")
    assert contents(tmp_path / "results") == {"report.html": "first"}
    kept = {f".ccfem-{host}-{os.getpid()}-abc", f".ccfem-elsewhere{host}-{ended.pid}-abc"}
    assert set(leftovers(tmp_path)) == kept


RUNS = """
from ccfem.io.result_folder import whole_folder
started.set()
for k in range(count):
    with whole_folder(where) as folder:
        for name in "abc":
            (folder / name).write_text(str(k))
"""


@pytest.fixture(scope="module")
def runs():
    """Begin a process that writes a folder a number of times, and an event that it has begun."""
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload(["ccfem.io.result_folder"])  # imported once for all

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
    write(tmp_path / "another", a="new")  # the next run mends
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
    where = tmp_path / "results"
    write(where, a="first", b="first")
    chmod = type(where).chmod

    def late(path, mode):
        (where / "thesis.docx").write_text("three years")
        chmod(path, mode)

    monkeypatch.setattr(type(where), "chmod", late)
    write(where, a="second")
    assert contents(where) == {"a": "second", "thesis.docx": "three years"}
