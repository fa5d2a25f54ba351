"""The newest of what is asked is worked on; a run says how far it is, and leaves nothing."""

import os
import signal
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from ccfem.workbench.child_run import ChildRun, RunState
from ccfem.workbench.page import Newest


def test_only_the_newest_is_worked_on():
    worked, came = [], threading.Event()

    def work(item):
        worked.append(item)
        return item + 1

    def done(item, result):
        assert (item, result) == (5, 6)
        came.set()

    newest = Newest(work, done)
    for item in range(6):
        newest.ask(item)
    assert came.wait(10.0)
    assert worked == [5]
    newest.ask(7)
    newest.close()
    threading.Event().wait(0.4)  # longer than it is to be quiet
    assert worked == [5]


def test_what_came_of_an_older_item_is_dropped(monkeypatch):
    monkeypatch.setattr("ccfem.workbench.page._QUIET", 0.0)
    going, newer, done = threading.Event(), threading.Event(), []

    def work(item):
        going.set()
        assert newer.wait(10.0)
        return item

    def came(*what):
        done.append(what)
        ended.set()

    ended, newest = threading.Event(), Newest(work, came)
    newest.ask("old")
    assert going.wait(10.0)
    newest.ask("new")
    newer.set()
    assert ended.wait(10.0)
    assert done == [("new", "new")]


def alive(process):
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return "\nState:\tZ" not in Path(f"/proc/{process}/status").read_text()


SLEEPER = """
import os, signal, subprocess, sys, time
signal.signal(signal.SIGTERM, signal.SIG_IGN) if sys.argv[1] == "deaf" else None
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
print(f"ccfem: 2 s, 40 %, about 3 s left: solving {child.pid}", file=sys.stderr, flush=True)
time.sleep(60)
"""


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="process groups are of Unix")
@pytest.mark.parametrize("manner", ["heeds", "deaf"])
def test_a_stopped_run_leaves_no_process(tmp_path, monkeypatch, manner):
    (tmp_path / "sleeper.py").write_text(SLEEPER)
    program = (sys.executable, str(tmp_path / "sleeper.py"))
    monkeypatch.setattr("ccfem.workbench.child_run._PROGRAM", program)
    monkeypatch.setattr("ccfem.workbench.child_run._PATIENCE", 0.3)
    states, begun = [], threading.Event()

    def changed(state):
        states.append(state)
        begun.set()

    run = ChildRun([manner], tmp_path, changed)
    assert begun.wait(20.0)
    assert states[0].share == 0.4
    assert states[0].step.startswith("solving")
    assert states[0].step.endswith("(about 3 s left)")
    child = int(states[0].step.split()[1])
    assert alive(child)
    run.stop()
    assert not alive(run._process.pid)
    for _ in range(500):  # until the system has taken it away
        if not alive(child):
            break
        threading.Event().wait(0.01)
    assert not alive(child)
    assert run.state.complaint == "stopped"
    assert run.state.code in (-signal.SIGTERM, -signal.SIGKILL)


@pytest.mark.slow
def test_a_run_is_stopped_at_ten_moments(tmp_path):
    """Whatever it does then, reading to writing: nothing is left of it, and no results."""
    for share in np.linspace(0.0, 0.95, 10):
        reached = threading.Event()

        def changed(state, share=share, reached=reached):
            if state.share >= share:
                reached.set()

        run = ChildRun(["compare", "bar", "--strategies", "zigzag"], tmp_path, changed)
        assert reached.wait(120.0)
        run.stop()
        assert not alive(run._process.pid)
        assert run.state.complaint == "stopped"
        assert not [path for path in tmp_path.rglob("*") if path.is_file()]


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="process groups are of Unix")
def test_a_run_that_takes_too_long_is_stopped(tmp_path, monkeypatch):
    (tmp_path / "sleeper.py").write_text(SLEEPER)
    program = (sys.executable, str(tmp_path / "sleeper.py"))
    monkeypatch.setattr("ccfem.workbench.child_run._PROGRAM", program)
    state = ChildRun(["heeds"], tmp_path, lambda state: None, minutes=0.01).wait(20.0)
    assert state.complaint == "stopped after 0.01 min: allow a longer run, or ask for less"
    assert state.code == -signal.SIGTERM
    assert not state.written


def test_no_module_in_the_folder_of_a_run_is_executed(tmp_path):
    for name in ("ccfem", "numpy"):
        (tmp_path / f"{name}.py").write_text('open("executed", "w").close()')
    state = ChildRun(["machines"], tmp_path, lambda state: None).wait(60.0)
    assert state.code == 0
    assert not (tmp_path / "executed").exists()


@pytest.mark.parametrize(
    ("state", "complaint"),
    [
        (RunState(), ""),
        (RunState(code=0), ""),
        (RunState(code=3), ""),
        (RunState(code=2, lines=("a", "ccfem: error: no load")), "no load"),
        (RunState(code=-9, lines=("a",)), "the run ended with exit code -9: a"),
    ],
)
def test_the_end_of_a_run_is_one_line(state, complaint):
    assert state.complaint == complaint
    assert state.written == (state.code in (0, 3))
