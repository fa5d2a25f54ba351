"""A plugin of pytest that writes which functions of the project each test reaches.

Run ``REACHED=FOLDER python -m pytest -p benchmarks.reached``: every process writes a file of rows,
``test: [seconds, ["ccfem/geometry/offsets.py:offset", ...]]``, of the tests that pass. Compiled
functions are not seen, nor what runs in a process of its own.
"""

import collections
import functools
import inspect
import json
import os
import sys
import threading
import time
from pathlib import Path

import pytest

_reached: set = set()
_of_fixture: dict[str, set] = collections.defaultdict(set)
_of_test: dict[str, tuple[float, set]] = {}
_not_passed: set[str] = set()


def _note(frame, event, argument):
    _reached.add(frame.f_code)


def pytest_sessionstart():
    threading.settrace(_note)


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef):
    """Count what a fixture reaches for every test that asks for it, not for the first alone."""
    before = set(_reached)
    _reached.clear()
    try:
        return (yield)
    finally:
        _of_fixture[fixturedef.argname] |= _reached
        _reached.update(before)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    _reached.clear()
    start = time.perf_counter()
    sys.settrace(_note)
    try:
        return (yield)
    finally:
        sys.settrace(None)
        codes = _reached.union(*(_of_fixture[name] for name in getattr(item, "fixturenames", ())))
        _of_test[item.nodeid] = time.perf_counter() - start, codes


def pytest_runtest_logreport(report):
    if report.outcome != "passed":
        _not_passed.add(report.nodeid)


def pytest_sessionfinish(session):
    root = f"{session.config.rootpath}/"

    @functools.cache
    def key(code):
        """Name of a function, an inner one under its outermost one's; None if it is not ours."""
        inside = code.co_filename.startswith(root) and code.co_flags & inspect.CO_OPTIMIZED
        name = code.co_qualname.split(".<locals>")[0]
        return f"{code.co_filename.removeprefix(root)}:{name}" if inside else None

    rows = {
        test: [seconds, sorted({key(code) for code in codes} - {None})]
        for test, (seconds, codes) in _of_test.items()
        if test not in _not_passed
    }
    file = Path(os.environ["REACHED"], f"reached-{time.time_ns()}-{os.getpid()}.json")
    file.write_text(json.dumps(rows), encoding="utf-8")
