"""The command line, called in the test's own process."""

import sys

import pytest

from ccfem.cli.main import main
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

    def call(*arguments):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["ccfem", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr()
        return ended.value.code, said.out, said.err

    return call
