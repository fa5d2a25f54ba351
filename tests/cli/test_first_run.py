"""What a first run needs later is compiled in a process beside it."""

import importlib
import multiprocessing
import time

import numba
import pytest
from numba.core.dispatcher import Dispatcher

from ccfem.cli import first_run
from ccfem.cli.first_run import LATE, compiling_beside, is_stored, rehearse


@pytest.fixture
def nothing_stored(monkeypatch, tmp_path):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("CCFEM_THREADS", "2")
    return tmp_path


def test_a_process_rehearses_while_nothing_is_stored(nothing_stored, monkeypatch, capsys):
    done = nothing_stored / "done"

    def rehearsed():
        done.touch()
        time.sleep(60.0)

    monkeypatch.setattr(first_run, "rehearse", rehearsed)
    with compiling_beside():
        (process,) = multiprocessing.active_children()
        until = time.monotonic() + 20.0
        while not done.exists() and time.monotonic() < until:
            time.sleep(0.01)
        assert process.is_alive()
    assert done.exists()
    assert "first run: compiling" in capsys.readouterr().err
    assert multiprocessing.active_children() == []  # it ends with the block


def test_no_process_rehearses_what_is_stored(nothing_stored, capsys):
    module, name = LATE
    folder = nothing_stored / "judging"
    folder.mkdir()
    (folder / f"{module.rpartition('.')[2]}.{name}-72.py311.nbi").touch()
    with compiling_beside():
        assert multiprocessing.active_children() == []
    assert capsys.readouterr().err == ""


def test_no_process_rehearses_on_one_processor(nothing_stored, monkeypatch):
    monkeypatch.setenv("CCFEM_THREADS", "1")
    with compiling_beside():
        assert multiprocessing.active_children() == []


def test_a_rehearsal_compiles_what_is_looked_for():
    late = getattr(importlib.import_module(LATE[0]), LATE[1])
    assert isinstance(late, Dispatcher)
    rehearse()
    assert late.signatures
    assert is_stored()
