"""The time of a file by pyGCodeDecode, where it is installed: within a twentieth."""

import numpy as np
import pytest

from benchmarks.print_checks.estimators import estimate


def test_pygcodedecode_finds_the_same_time(small_part):
    pytest.importorskip("pyGCodeDecode")
    job = small_part("marlin_two_tools", {"matrix_heating": 1e4, "fibre_heating": 1e4})
    found = estimate(job.text)
    assert found.said == ()
    assert float(job.done.head["TIME"]) == pytest.approx(found.seconds, rel=0.05)
    assert (np.array(found.high) <= job.machine.gcode.bed).all()
