"""Read-only arrays and mappings in frozen dataclasses."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from ccfem.base.arrays import FloatArray, IntArray, freeze, read_only, repeated


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
