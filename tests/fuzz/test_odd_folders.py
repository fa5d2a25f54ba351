"""A few folders with links and forged records. More: python -m benchmarks.fuzz.odd_folders."""

import random

import pytest

from benchmarks.fuzz.odd_folders import (
    MINE,
    damage,
    ended_process,
    entries,
    odd_folder,
    prepare,
    see,
)
from ccfem.base.errors import InputError


@pytest.fixture(scope="module")
def ended():
    return ended_process()


@pytest.mark.parametrize("command", ["example", "new", "solve"])
def test_nothing_outside_its_folder_changes(command, tmp_path, monkeypatch, ended):
    prepare(tmp_path)
    (tmp_path / "earlier").mkdir()
    monkeypatch.chdir(tmp_path)
    said = []
    for k in range(4):
        box = tmp_path / str(k)
        box.mkdir()
        (box / "body.stl").write_bytes((tmp_path / "body.stl").read_bytes())
        words = odd_folder(box, command, tmp_path / "earlier", random.Random(k), ended)
        try:
            see(box, words)
        except InputError as error:
            said.append(str(error))
    assert not [line for line in said if "\n" in line]


def test_damage_is_seen(tmp_path):
    """A file outside is gone, one of another name too, and one of a result without --force."""
    (tmp_path / "out").mkdir()
    (tmp_path / "outside").mkdir()
    for name in ("outside/thesis.docx", "out/notes.txt", "out/results.csv"):
        (tmp_path / name).write_text(MINE)
    before = entries(tmp_path)
    for name in before:
        if (tmp_path / name).is_file():
            (tmp_path / name).unlink()
    (tmp_path / "out" / ".ccfem-vm-1-abcdefgh").mkdir()
    assert list(damage(tmp_path, "study", False, before)) == [
        "out/notes.txt was changed",
        "out/results.csv was lost without --force",
        "outside/thesis.docx was changed",
        "out/.ccfem-vm-1-abcdefgh was left behind",
    ]
