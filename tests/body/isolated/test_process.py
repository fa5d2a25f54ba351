"""A crash, a hang and a flood of memory in a child are exceptions of the parent."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.files import read_mesh, read_surface
from ccfem.body.isolated import process
from ccfem.body.isolated.process import ChildError, in_own_process

pytestmark = pytest.mark.usefixtures("started_children")

CHILD = """
import os, signal, time
import numpy as np
from ccfem.base.errors import InputError

def double(values, word):
    print("chatter")
    return {"values": 2 * values, "word": word + "!"}

def crash():
    os.kill(os.getpid(), signal.SIGSEGV)

def hang():
    time.sleep(60)

def spin():
    while True:
        pass

def flood():
    return {"size": len(bytearray(4_000_000_000))}

def refuse():
    raise InputError("no such thing: name another")

def fail():
    raise KeyError("a\\nb")
"""


@pytest.fixture(scope="module")
def stranger(tmp_path_factory):
    """A module of `ccfem.body.isolated` as a child finds it, in a folder of the test."""
    import ccfem.body.isolated

    folder = tmp_path_factory.mktemp("stranger")
    (folder / "sitecustomize.py").write_text(
        f"import ccfem.body.isolated; ccfem.body.isolated.__path__.append({str(folder)!r})\n"
    )
    (folder / "stranger.py").write_text(CHILD)
    assert ccfem.body.isolated
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(folder))
        yield


def test_values_go_there_and_back(stranger, capfd):
    found = in_own_process("stranger:double", values=np.arange(3.0), word="so")
    assert found["values"].tolist() == [0.0, 2.0, 4.0]
    assert str(found["word"]) == "so!"
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("name", "kind", "message"),
    [
        ("crash", ChildError, r"the library crashed \(SIGSEGV\)"),
        ("hang", ChildError, "more than 1 s"),
        ("flood", ChildError, "too much memory"),
        ("refuse", InputError, "no such thing: name another"),
        ("fail", ChildError, r"^'a\\nb'$"),
    ],
)
def test_ends_of_children(stranger, name, kind, message, capfd):
    seconds = 1.0 if name == "hang" else 60.0
    with pytest.raises(kind, match=message):
        in_own_process(f"stranger:{name}", seconds=seconds, memory=2e9)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("read", [read_surface, read_mesh])
def test_a_reader_that_crashes_is_one_line(monkeypatch, tmp_path, read):
    def crash(*_, **__):
        raise ChildError("the library crashed (SIGSEGV)")

    monkeypatch.setattr("ccfem.body.isolated.process.in_own_process", crash)
    path = tmp_path / ("a.stl" if read is read_surface else "a.msh")
    path.write_text("$MeshFormat\n")
    with pytest.raises(InputError, match="can be read") as caught:
        read(path)
    assert "\n" not in str(caught.value)
    assert process._ending(-11) == "SIGSEGV"


def test_a_call_that_never_ends_is_ended_by_the_work_it_does(stranger):
    with pytest.raises(ChildError, match="takes more than 1 s"):
        in_own_process("stranger:spin", seconds=50.0, work=1.0)
