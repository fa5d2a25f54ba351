import logging
import time

import pytest

from ccfem.base.progress import progress_bar, time_left


def test_nobody_is_told_where_nobody_watches(capsys):
    with progress_bar() as progress:
        progress("half of it", 0.5)
    assert capsys.readouterr() == ("", "")


def test_a_terminal_shows_what_is_done(monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich takes it for a terminal
    with progress_bar() as progress:
        progress("half of it", 0.5)
    assert "half of it" in capsys.readouterr().err


def test_on_a_terminal_the_time_left_runs_down(monkeypatch, capsys):
    """Half of the work took 50 s, so 50 are left; 20 s later 30 are, though nothing was said."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    now = [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    with progress_bar() as progress:
        now[0] = 50.0
        progress("half of it", 0.5)
        now[0] = 70.0
    assert "about 30 s left" in capsys.readouterr().err


def test_without_a_terminal_each_step_is_one_line(capsys):
    with progress_bar(lines=True) as progress:
        for what, share in (("slicing", 0.0), ("planning", 0.25), ("planning", 0.4), ("x", 1.0)):
            progress(what, share)
    first, second, third = capsys.readouterr().err.splitlines()
    assert first == "ccfem: 0 s, 0 %: slicing"
    assert second == "ccfem: 0 s, 25 %, about 0 s left: planning"
    assert third == "ccfem: 0 s, 100 %: x"


def test_steps_are_logged(caplog):
    with caplog.at_level(logging.INFO, "ccfem"), progress_bar() as progress:
        progress("half of it", 0.5)
    assert [record.getMessage() for record in caplog.records] == ["0.0 s, 50 %: half of it"]


@pytest.mark.parametrize(
    ("spent", "share", "said"),
    [
        (1.0, 0.01, ""),
        (10.0, 0.1, "about 90 s left"),
        (60.0, 0.25, "about 3 min left"),
        (9.0, 1.0, ""),
    ],
)
def test_time_left_is_that_of_the_work_left(spent, share, said):
    assert time_left(spent, share) == said
