"""The command line, called in the process of the tests."""

import re
import sys

import pytest

from ccfem.cli.main import main


def run_command(monkeypatch, capsys, folder, *arguments):
    """Call ``ccfem`` in a folder: exit code, stdout, stderr."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "argv", ["ccfem", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr()
    return ended.value.code, said.out, said.err


def without_progress(err):
    """Text of stderr without the lines of progress that a call without a terminal prints."""
    return re.sub(r"(?m)^ccfem: \d+ s, \d+ %.*: .*\n", "", err)
