"""A signal at any moment: one line, the exit code of the signal, and nothing left behind."""

import os
import signal
import subprocess
import sys
import time

import pytest
import typer

from ccfem.cli.main import main

IMPORTING = """
import os, signal, sys
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "typer": os.kill(os.getpid(), signal.{name})
signal.signal(signal.{name}, signal.SIG_DFL)
sys.meta_path.insert(0, Finder())
from ccfem.cli.start import start
start()
"""
IMPORTED_IN_PART = """
import os, signal, sys, types
from ccfem.cli import stopping
sys.modules["ccfem.base.folder"] = types.ModuleType("ccfem.base.folder")
stopping.end_at_once()
os.kill(os.getpid(), signal.SIGTERM)
"""
RUNNING = """
import os, signal, time
signal.signal(signal.SIGINT, signal.default_int_handler)
from pathlib import Path
import typer
from ccfem.cli.start import start
from ccfem.base.folder import private_folder
from ccfem.base.result_folder import whole_folder

def stop():
    os.kill(os.getpid(), signal.{name})
    time.sleep(5.0)

class Command:
    def __call__(self, standalone_mode):
        {moment}

typer.main.get_command = lambda app: Command()
start()
"""
COMPILING = """
        import numba
        from numba.core import compiler
        compile_extra = compiler.compile_extra
        def stopping(*args, **options):
            stop()
        compiler.compile_extra = stopping
        numba.njit(lambda x: x + 1)(1)
"""
WRITING = """
        with whole_folder(Path("out"), ("a",)) as folder:
            (folder / "a").write_text("half")
            stop()
"""
SWALLOWED = """
        class Late:
            def __del__(self):
                stop()
        with private_folder(Path(".")):
            Late()
            time.sleep(5.0)
"""
CHANGED = """
        try:
            stop()
        except BaseException:
            raise OSError(5, "a library failed")
"""
KEPT = """
        try:
            stop()
        except BaseException:
            pass
"""
TWICE = """
        with private_folder(Path(".")):
            try:
                stop()
            finally:
                stop()
"""
MOMENTS = {
    "compiling": COMPILING,
    "writing": WRITING,
    "swallowed": SWALLOWED,
    "changed": CHANGED,
    "kept": KEPT,
    "twice": TWICE,
}


def check(code, name, tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env={**os.environ, "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    said = f"ccfem: stopped by {name}\n"
    assert (done.returncode, done.stdout, done.stderr) == (128 + getattr(signal, name), "", said)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_stop_while_importing(name, tmp_path):
    """The signal comes from within the import of the commands."""
    check(IMPORTING.format(name=name), name, tmp_path)


def test_a_stop_while_the_module_of_folders_is_imported(tmp_path):
    """It stands among the modules, but cannot remove folders yet."""
    check(IMPORTED_IN_PART, "SIGTERM", tmp_path)


@pytest.mark.parametrize("moment", MOMENTS)
def test_a_stop_while_running(moment, tmp_path):
    name = "SIGINT" if moment in ("writing", "kept") else "SIGTERM"
    check(RUNNING.format(name=name, moment=MOMENTS[moment].strip()), name, tmp_path)


def test_a_fault_of_the_program_is_no_stop(monkeypatch):
    """Nobody asked for an end: the fault shows as it is, and no line takes its place."""

    def faulty(standalone_mode):
        raise ZeroDivisionError("a fault")

    monkeypatch.setattr(typer.main, "get_command", lambda app: faulty)
    with pytest.raises(ZeroDivisionError, match="a fault"):
        main()


def test_a_study_is_stopped(tmp_path):
    """Its workers end, its lock is free, and no scratch folder is left."""
    (tmp_path / "st.toml").write_text(
        'name = "st"\n[[parts]]\nname = "bar"\n[[strategies]]\nname = "zigzag"\n'
    )
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    command = [sys.executable, "-m", "ccfem", "study", "st.toml", "--out", "out", "--workers", "1"]
    process = subprocess.Popen(
        command,
        cwd=tmp_path,
        env={**os.environ, "TMPDIR": str(scratch)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    until = time.monotonic() + 60.0
    while not list(scratch.glob(".ccfem-*")) and process.poll() is None:
        assert time.monotonic() < until
        time.sleep(0.01)
    process.terminate()
    out, err = process.communicate(timeout=60.0)
    assert (process.returncode, out, err) == (143, "", "ccfem: stopped by SIGTERM\n")
    assert list(scratch.iterdir()) == []
    assert {path.name for path in (tmp_path / "out").iterdir()} <= {
        *(".lock", ".ccfem.json", "study.json", "runs"),
        *("results.csv", "results.parquet", "times.csv", "study.html"),
    }
