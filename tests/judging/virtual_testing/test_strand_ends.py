"""Ends of strands, and the load at which strands come loose from the matrix."""

import numpy as np
import pytest

from ccfem.judging.virtual_testing.anchorage import StrandEnds
from ccfem.judging.virtual_testing.progressive_failure import breaking_load
from ccfem.judging.virtual_testing.strand import Strand
from ccfem.judging.virtual_testing.strands import Strands

from .test_progressive_failure import AREA, LENGTH, MODULUS, bar, strands


def row(share, path):
    """Pieces of 2 mm along x, of some paths."""
    count = len(path)
    arc = 2.0 * np.arange(count) + 1.0
    middle = np.column_stack([arc, np.zeros((count, 2))])
    along = np.broadcast_to([1.0, 0.0, 0.0], (count, 3))
    pieces = np.zeros(count, dtype=int), np.full(count, 2.0), along, np.array(path), arc
    return Strands(*pieces, middle, 0.0, np.array(share, dtype=float))


def test_a_strand_ends_at_its_path_at_folds_and_where_it_has_broken():
    folded, broken = 4, 11
    given = row([float(k != folded) for k in range(14)], [0] * 9 + [1] * 5)
    pull, intact = np.arange(14.0), np.array([float(k != broken) for k in range(14)])
    ends = StrandEnds(given, length=4.0).at(pull, intact)
    found = sorted(zip(ends.first.tolist(), ends.stop.tolist(), ends.force.tolist(), strict=True))
    stretches = [(0, 4), (5, 9), (9, 11), (12, 14)]
    # Of a strand no longer than that, both ends are all of it.
    expected = [pair for a, b in stretches for pair in ((a, a + 2), (b - 2, b))]
    assert found == [(a, b, (a + b - 1) / 2.0) for a, b in sorted(expected)]


def test_strands_come_loose_at_the_analytic_load_and_leave_the_matrix_to_itself():
    """At the strain at which their ends pass on the force of the bond: along their whole length."""
    axial, bond = Strand().stiffness(MODULUS), 20.0
    paths, part = strands((1.3, 2.0), (2.7, 2.0)), bar(matrix=30.0)
    curve = breaking_load(paths, part, bond=bond, softening=30.0, band=False).curve
    assert curve.first == "bond"
    assert curve.force[1] == pytest.approx(bond / axial * (MODULUS * AREA + 2 * axial), rel=1e-6)
    assert curve.broken[-1] == pytest.approx(2 * LENGTH)
    assert curve.load == pytest.approx(30.0 * AREA, rel=1e-3)  # the matrix alone
    held = breaking_load(paths, part, bond=1e3, softening=30.0, band=False).curve
    never = breaking_load(paths, part, softening=30.0, band=False).curve
    np.testing.assert_array_equal(held.force, never.force)
