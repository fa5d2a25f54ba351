"""Compact files, against plain ones, by the printer on paper that follows both."""

import numpy as np
import pytest

from benchmarks.print_checks.all_checks import CHECKS
from benchmarks.print_checks.job import FILAMENT, Lines
from ccfem.printing.export.gcode import _shorter
from ccfem.printing.laid_layer import _MISPLACED, _evened

COMPACT = {"gcode": {"compact": True}}
ROUND = {"gcode": {"compact": True, "arcs": True, "arc_tolerance": 0.05}}


def laid(job):
    """Volume of matrix and length of fibre on each layer, mm^3 and mm."""
    lines = Lines.of(job.done)
    mine = lines.lays & lines.in_part
    tops = job.plan.top
    at = np.abs(lines.end[mine][:, 2, None] - tops).argmin(axis=1)
    matrix = FILAMENT * np.where(lines.tool == 1, lines.beside, lines.fed)[mine]
    fibre = lines.length[mine] * (lines.tool[mine] == 1)
    return [np.bincount(at, values, len(tops)) for values in (matrix, fibre)]


@pytest.mark.parametrize(
    ("machine", "values", "size"),
    [("marlin_two_tools", COMPACT, 0.75), ("aura_like", COMPACT, 0.75), ("klipper", ROUND, 0.5)],
)
def test_a_compact_file_lays_the_same(small_part, machine, values, size):
    plain, compact = small_part(machine), small_part(machine, values)
    assert len(compact.text) < size * len(plain.text)
    for mine, other in zip(laid(compact), laid(plain), strict=True):
        np.testing.assert_allclose(mine, other, rtol=1e-3)
    assert {check.__name__: check(compact, compact.done) for check in CHECKS} == {
        check.__name__: [] for check in CHECKS
    }
    longer = float(compact.done.head["TIME"]) / float(plain.done.head["TIME"])
    assert 1.0 <= longer < 1.15
    assert ";WIDTH" not in compact.text


def test_what_is_laid_elsewhere_along_a_line_is_bounded():
    rng = np.random.default_rng(0)
    share, length = rng.uniform(0.2, 1.0, 400), rng.uniform(0.5, 2.0, 400)
    share[200:300] = 0.9
    last = np.array([149, 249, 399])
    evened = _evened(share, length, last)
    off = np.cumsum((evened - share) * length)
    np.testing.assert_allclose(off[last], 0.0, atol=1e-9)
    assert abs(off).max() <= _MISPLACED * (1.0 + 1e-6)
    assert len(np.unique(evened.round(9))) < 100


@pytest.mark.parametrize(
    ("plain", "short"),
    [
        ("X200.000 Y20.500", "X200 Y20.5"),
        ("X-0.250 Z0.000", "X-.25 Z0"),
        (" E0.0300 V10.0000", " E.03 V10"),
    ],
)
def test_zeros_that_say_nothing_are_left_out(plain, short):
    assert _shorter(plain) == short
