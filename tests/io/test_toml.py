from dataclasses import dataclass, field
from typing import Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ccfem.errors import InputError
from ccfem.io.toml import assignment, from_table


@dataclass(frozen=True)
class Sample:
    number: float
    count: int = 1
    flag: bool = False
    word: str = ""
    way: str | tuple[float, float, float] = "z"
    choice: Literal["a", "b", 1] = "a"
    some: tuple[float, ...] = ()
    pair: tuple[int, str] | None = None
    rest: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self):
        if self.number == 13.0:
            raise InputError("not 13: choose another")


def test_every_kind_of_value():
    table = {
        "number": 2,
        "count": 3,
        "flag": True,
        "word": "w",
        "way": [1, 0.5, 0],
        "choice": 1,
        "some": [1, 2.5],
        "pair": [1, "x"],
        "rest": {"deep": [1]},
    }
    found = from_table(Sample, table, "sample")
    assert found == Sample(
        2.0, 3, True, "w", (1.0, 0.5, 0.0), 1, (1.0, 2.5), (1, "x"), {"deep": [1]}
    )
    assert isinstance(found.number, float)
    assert from_table(Sample, {"number": float("inf")}, "s", infinite=True).number == float("inf")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (3, "sample must be a table; got 3"),
        ({}, "sample needs the key 'number'; its keys are: number, count"),
        ({"number": 1, "size": 2}, "sample has no key 'size'; it has: number, count"),
        ({"number": True}, "sample.number must be a number; got True"),
        ({"number": "1"}, "sample.number must be a number; got '1'"),
        ({"number": float("nan")}, "sample.number must be a number; got nan"),
        ({"number": float("inf")}, "sample.number must be a number; got inf"),
        ({"number": 1, "count": 1.0}, "sample.count must be a whole number"),
        ({"number": 1, "count": False}, "sample.count must be a whole number"),
        ({"number": 1, "flag": 1}, "sample.flag must be true or false"),
        ({"number": 1, "way": [1, 2]}, "must be a string or a list of 3, each a number"),
        ({"number": 1, "choice": True}, "must be one of 'a', 'b', 1; got True"),
        ({"number": 1, "some": 1.0}, "must be a list, each item a number"),
        ({"number": 1, "some": [1, "x"]}, "must be a list, each item a number"),
        ({"number": 1, "rest": []}, "must be a table"),
        ({"number": 13}, "sample: not 13: choose another"),
    ],
)
def test_what_does_not_fit(table, message):
    with pytest.raises(InputError, match=message):
        from_table(Sample, table, "sample")


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text("xyz", max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("xyz", max_size=2), inner),
    max_leaves=5,
)


@given(st.dictionaries(st.sampled_from([*Sample.__dataclass_fields__, "other"]), VALUES))
def test_any_table_gives_a_value_or_an_input_error(table):
    try:
        found = from_table(Sample, table, "sample")
    except InputError:
        return
    assert set(table) <= set(Sample.__dataclass_fields__)
    assert isinstance(found.number, float)
    assert type(found.count) is int


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("a=0.5", 0.5), ("a=.5", 0.5), ("a=-.5e-2", -0.005), ("a=5.", 5.0), ("a= 5 ", 5),
        ("a=.", "."), ("a=..5", "..5"), ("a=x.5", "x.5"), ("a=1.2.3", "1.2.3"),
    ],
)  # fmt: skip
def test_assignments_take_numbers_as_people_write_them(text, value):
    name, found = assignment(text)
    assert name == "a"
    assert type(found) is type(value)
    assert found == value
