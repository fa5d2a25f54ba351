"""Modules that are imported when they are first asked for."""

import subprocess
import sys

import pytest

import ccfem

TOGETHER = """
import sys, threading
sys.setswitchinterval(1e-6)
import ccfem

def first(name):
    try:
        getattr(ccfem, name)
    except BaseException as error:
        print(name, repr(error))

threads = [threading.Thread(target=first, args=(name,)) for name in ccfem.__all__]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
"""


def test_threads_may_ask_for_everything_at_once():
    """Each in its own, all for the first time: they met half of what others had begun."""
    done = subprocess.run(
        [sys.executable, "-c", TOGETHER], capture_output=True, text=True, timeout=120, check=True
    )
    assert (done.stdout, done.stderr) == ("", "")


def test_what_is_not_there_is_named():
    with pytest.raises(AttributeError, match=r"module 'ccfem.fem' has no attribute 'nothing'"):
        ccfem.fem.nothing  # noqa: B018
