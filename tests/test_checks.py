"""Checks of parameters: what passes, and what the one line says about what does not."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pytest

from ccfem.checks import check_choices, check_fields, check_known, check_number
from ccfem.errors import InputError


@dataclass(frozen=True)
class WideStrand:
    width: float = 1.0
    least: float | None = None
    most: float | None = 9.0
    end: Literal["round", "flat"] = "round"


@pytest.mark.parametrize(
    ("value", "bounds"),
    [
        (0.0, {"at_least": 0.0}),
        (1.0, {"above": 0.0, "at_most": 1.0}),
        (np.float32(0.5), {"above": 0.0, "below": 1.0}),
        (np.int64(3), {"at_least": 1}),
        (-1e300, {}),
    ],
)
def test_numbers_within_bounds_pass(value, bounds):
    check_number("it", value, **bounds)


@pytest.mark.parametrize(
    ("value", "bounds", "message"),
    [
        (
            -1.0,
            {"at_least": 0.0, "unit": "mm"},
            "at least 0 mm; got -1.0: give one in this range",
        ),
        (
            0.0,
            {"above": 0.0, "at_most": 1.0},
            "above 0 and at most 1; got 0.0: give one in this range",
        ),
        (
            1.0,
            {"above": 0.0, "below": 1.0},
            "above 0 and below 1; got 1.0: give one in this range",
        ),
        (1.5, {"at_most": 1.0}, "at most 1; got 1.5: give one in this range"),
        (
            np.inf,
            {"above": 0.0, "unit": "N"},
            "a finite number, above 0 N; got inf: give one in this range",
        ),
        ("a", {}, "a finite number; got 'a': give a number"),
        (np.nan, {"unit": "degrees"}, "a finite number of degrees; got nan: give a number"),
        ("2", {"at_least": 1}, "a finite number, at least 1; got '2': give one in this range"),
        (
            True,
            {"at_least": 1},
            "a finite number, at least 1; got True: give one in this range",
        ),
        (
            None,
            {"at_least": 1},
            "a finite number, at least 1; got None: give one in this range",
        ),
    ],
)
def test_other_values_are_refused_in_one_line(value, bounds, message):
    with pytest.raises(InputError) as caught:
        check_number("it", value, **bounds)
    assert str(caught.value) == f"it must be {message}"


def test_fields_are_named_by_their_class_and_may_be_left_out():
    check_fields(WideStrand(), "width", "least", above=0.0)
    with pytest.raises(InputError, match=r"^wide_strand\.least must be above 0 mm; got 0"):
        check_fields(WideStrand(least=0.0), "width", "least", above=0.0, unit="mm")
    with pytest.raises(InputError, match=r"wide_strand\.width must be a finite number, .*None"):
        check_fields(WideStrand(width=None), "width", above=0.0)
    check_fields(WideStrand(most=None), "most", above=0.0)


def test_fields_with_choices_hold_one_of_them():
    check_choices(WideStrand(end="flat"))
    message = r"^wide_strand\.end must be one of 'round', 'flat'; got 'pointed': name one of them$"
    with pytest.raises(InputError, match=message):
        check_choices(WideStrand(end="pointed"))


def test_unknown_names_are_answered_by_the_known_ones():
    check_known("road", "a", iter("ab"))
    with pytest.raises(InputError, match=r"^no road named 'c'; there are: a, b \(or walk\)$"):
        check_known("road", "c", ["a", "b"], "or walk")
    with pytest.raises(InputError, match=r"there are: none$"):
        check_known("road", "c", [])
