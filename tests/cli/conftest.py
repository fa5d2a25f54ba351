"""The command line, called in the test's own process."""

from functools import partial

import pytest
from command_line import run_command

from ccfem.comparison import effort


@pytest.fixture(scope="session")
def pace():
    """CPU seconds that the work takes here by which machines differ, measured once."""
    measured = effort.pace()
    assert 0.0 < measured < 10.0  # seconds
    return measured


@pytest.fixture
def ccfem(monkeypatch, capsys, tmp_path, pace):
    """Call the command line in a folder of its own: exit code, stdout, stderr."""
    monkeypatch.setattr(effort, "pace", lambda: pace)

    return partial(run_command, monkeypatch, capsys, tmp_path)
