"""Read-only arrays and mappings in frozen dataclasses."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from ccfem.base import arrays
from ccfem.base.arrays import (
    FloatArray,
    IntArray,
    RowBuffer,
    freeze,
    is_shared,
    read_only,
    repeated,
    shared_rows,
)


@dataclass(frozen=True)
class Held:
    points: FloatArray
    number: IntArray | None = None
    patches: Mapping[str, IntArray] = field(default_factory=dict)
    loads: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        freeze(self, points=float, number=int, patches=int, loads=tuple, options=dict)


def test_a_read_only_array_is_taken_as_it_is_and_any_other_is_copied():
    given = np.arange(3.0)
    fixed = read_only(given)
    given[0] = 7.0
    assert fixed[0] == 0.0
    assert not fixed.flags.writeable
    assert read_only(fixed) is fixed
    assert read_only(fixed, int).dtype == np.int64


def test_a_frozen_value_cannot_be_changed_from_outside():
    patch, options = np.array([1, 2]), {"grid": {"angle": 3.0}}
    held = Held([[0, 1]], patches={"a": patch}, loads={"pull": ["x", "y"]}, options=options)
    patch[0] = 9
    options["grid"]["angle"] = 9.0
    assert held.points.dtype == np.float64
    assert held.number is None
    assert held.patches["a"].tolist() == [1, 2]
    assert held.patches["a"].dtype == np.int64
    assert held.loads["pull"] == ("x", "y")
    assert held.options["grid"]["angle"] == 3.0
    for change in (
        lambda: held.points.__setitem__(0, 1.0),
        lambda: held.patches["a"].__setitem__(0, 1),
        lambda: held.options["grid"].__setitem__("angle", 1.0),
        lambda: held.loads.__setitem__("push", ()),
    ):
        with pytest.raises((ValueError, TypeError, AttributeError)):
            change()


def test_repeated_counts_up_for_each_owner():
    counts = np.array([2, 0, 3, 1])
    owner, number = repeated(counts)
    wanted = [(k, i) for k, count in enumerate(counts) for i in range(count)]
    assert list(zip(owner.tolist(), number.tolist(), strict=True)) == wanted
    assert repeated(np.zeros(3, dtype=np.int64))[0].shape == (0,)


def test_equal_rows_share_one_in_memory_unless_a_zero_has_another_sign():
    up = shared_rows(np.tile([0.0, 0.0, 1.0], (5, 1)))
    assert is_shared(up)
    assert up.tolist() == 5 * [[0.0, 0.0, 1.0]]
    assert not up.flags.writeable
    for other in ([0.0, 0.0, 0.9], [-0.0, 0.0, 1.0], [np.nan, 0.0, 1.0]):
        assert not is_shared(shared_rows(np.array([*up, other])))
    assert shared_rows(np.zeros((0, 3))).shape == (0, 3)


@pytest.mark.parametrize("last", [1.0, 2.0])
def test_rows_that_come_block_by_block_are_as_joined(last):
    blocks = [np.ones((3, 2)), np.zeros((0, 2)), np.ones((4, 2)), np.full((2, 2), last)]
    buffer = RowBuffer(float, 2)
    for block in blocks:
        buffer.append(block)
    joined = np.concatenate(blocks)
    np.testing.assert_array_equal(buffer.rows(), joined)
    assert len(buffer) == 0


def test_a_buffer_of_megabytes_holds_what_came(monkeypatch):
    monkeypatch.setattr(arrays, "_SMALL", 100)
    monkeypatch.setattr(arrays, "_ALONE", 1000)
    buffer, block = RowBuffer(np.int32), np.arange(40)
    for _ in range(12):
        buffer.append(block)
    np.testing.assert_array_equal(buffer.rows(), np.tile(block, 12))
