"""Fibre that leaves the part: on pads, cut at the border, or refused."""

import numpy as np
import pytest
import shapely

from benchmarks.print_checks.filling import amount, volume
from benchmarks.print_checks.job import own
from benchmarks.print_checks.motion import bed, support, travel
from benchmarks.print_checks.tooling import cuts, heat
from ccfem.base.errors import InputError
from ccfem.comparison.files import write_trims

# Two strands joined by a loop 11 mm outside the part; a span of 30 mm over nothing.
LOOP = np.concatenate(
    [
        [[40.0, 8.0]],
        [85.0, 13.0] + 5.0 * np.array([[np.sin(a), -np.cos(a)] for a in np.linspace(0, np.pi, 25)]),
        [[40.0, 18.0]],
    ]
)
LOOP[1:-1, 0] += 6.0


@pytest.fixture(scope="module")
def outside(small_part):
    return small_part("marlin_two_tools", lines=[LOOP])


def test_loops_outside_lie_on_pads(outside, tmp_path):
    assert support(outside, outside.done) == []
    assert [check(outside, outside.done) for check in (travel, cuts, heat, bed, volume)] == [[]] * 5
    pads = [s for s in outside.done.steps if s.lays and s.kind == "Support material"]
    corner = outside.corner
    place = np.array([step.end for step in pads])
    assert {round(z, 3) for z in place[:, 2]} == {0.2, 0.646, 1.246}
    # Clear of the part by .7 mm, a line's middle .4 more; round the loop by half a strand and 1 mm.
    assert place[:, 0].min() - corner[0] > outside.size[0] + 1.1 - 0.05
    assert place[:, 0].max() - corner[0] == pytest.approx(85.0 + 6.0 + 5.0 + 1.5 - 0.4, abs=0.1)
    # The knife's places: four, where the strands cross the border at x = 85.
    trims = outside.plan.trims
    np.testing.assert_allclose(trims[:, 1] - corner[0], 85.0, atol=1e-3)
    np.testing.assert_allclose(np.sort(trims[:, 2] - corner[1]), [8, 8, 18, 18], atol=0.01)

    write_trims(tmp_path / "trim.csv", outside.plan)
    rows = np.loadtxt(tmp_path / "trim.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(rows[:, 1:3], trims[:, 1:], atol=1e-3)
    tops = outside.heights + 0.5 * outside.machine.strand_height
    np.testing.assert_allclose(np.unique(rows[:, 3]), tops, atol=1e-3)


def test_a_strand_along_the_border_has_a_pad_that_touches(small_part):
    # Half a millimetre outside, in the gap that pads leave elsewhere: nothing would hold it.
    line = np.array([[20.0, -0.5], [75.0, -0.5]])
    job = small_part("marlin_two_tools", lines=[line])
    assert support(job, job.done) == []
    edge = job.corner[1]
    pads = np.array([s.end for s in job.done.steps if s.lays and s.kind == "Support material"])
    for z in np.unique(pads[:, 2]):
        gap = edge - pads[pads[:, 2] == z][:, 1].max() - 0.4
        assert gap == pytest.approx(0.0 if z > 0.3 else 0.7, abs=0.05)


def test_without_pads_the_loops_hang(outside):
    found, kind = [], ""
    for line in outside.text.splitlines():
        kind = line if line.startswith(";TYPE") else kind
        pad = kind == ";TYPE:Support material" and line.startswith("G1 X")
        found.append("G0" + line[2:].split(" E")[0] if pad else line)
    hanging = support(outside, outside.run("\n".join(found)))
    assert any("a span of" in line for line in hanging)


def test_loops_outside_are_cut_or_refused(small_part):
    cut = small_part("marlin_two_tools", {"process": {"turns": "cut"}}, [LOOP])
    assert support(cut, cut.done) == cuts(cut, cut.done) == amount(cut, cut.done) == []
    assert len(own(cut.done)) == 4
    assert all(
        cut.whole.buffer(1e-3).covers(shapely.Point(s.end))
        for s in cut.done.steps
        if s.lays and s.tool == 1 and not s.strand.startswith("beside")
    )
    with pytest.raises(InputError, match=r"leave fibre layer 0 in 2 places, but process\.turns"):
        small_part("marlin_two_tools", {"process": {"turns": "inside"}}, [LOOP])
