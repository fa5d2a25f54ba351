from dataclasses import dataclass, field
from typing import Any, Literal

import pytest
from hypothesis import given, strategies as st

from ccfem.base.errors import InputError
from ccfem.base.toml import assignment, from_table, read_toml
from ccfem.base.whole import existing_file


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
        ({"number": "1"}, "sample.number must be a number; got '1': write 1 without quotes$"),
        ({"number": float("nan")}, "sample.number must be a number; got nan"),
        ({"number": float("inf")}, "sample.number must be a number; got inf"),
        (
            {"number": 1, "count": 1.0},
            "sample.count must be a whole number; got 1.0: write a whole number",
        ),
        ({"number": 1, "count": False}, "sample.count must be a whole number"),
        (
            {"number": 1, "flag": 1},
            "flag must be true or false; got 1: write true or false without",
        ),
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


@pytest.mark.parametrize(
    ("value", "cure"),
    [
        ("2.5 mm", "write 2.5 without quotes and unit, in mm"),
        ("2,5mm", "write 2.5 without quotes and unit, in mm"),
        ("3 cm", "write 30 without quotes and unit, in mm"),
        ("-1.5e-2 m", "write -15 without quotes and unit, in mm"),
        ("2 in", "write 50.8 without quotes and unit, in mm"),
        ("0.2 kN", "write 200 without quotes and unit, in N"),
        ("3.5 GPa", "write 3500 without quotes and unit, in MPa"),
        ("5 stone", "write 5 without quotes and unit"),
        ("1e3", "write 1000 without quotes"),
        ("thick", "write the bare number, as 2.5"),
        ("1,000 mm", "write the bare number, as 2.5"),
        ("1.2.3", "write the bare number, as 2.5"),
        ([], "write the bare number, as 2.5"),
        (float("inf"), "give a finite number"),
    ],
)
def test_a_number_with_its_unit_gets_the_number_to_write(value, cure):
    with pytest.raises(InputError, match=rf"sample\.number must be a number; .*: {cure}$"):
        from_table(Sample, {"number": value}, "sample")


def test_one_wrong_item_of_a_list_gets_its_cure():
    with pytest.raises(InputError, match=r"a number; got \[0, '2 cm'\]: write 20 without quotes"):
        from_table(Sample, {"number": 1, "some": [0, "2 cm"]}, "sample")
    with pytest.raises(InputError, match=r"each a number; got .*: give it 3 items"):
        from_table(Sample, {"number": 1, "way": [1, 2]}, "sample")


GOOD = 'title = "Halter für Öl"\nsurface = "x.stl"\n'


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_a_byte_order_mark_is_read_over(tmp_path, encoding):
    (tmp_path / "part.toml").write_bytes(GOOD.encode(encoding))
    assert read_toml(tmp_path / "part.toml", "part file")["title"] == "Halter für Öl"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (GOOD.encode("utf-16"), "must be text in UTF-8; got UTF-16: save it as UTF-8"),
        (GOOD.encode("utf-16-be"), "must be text in UTF-8; got UTF-16: save it as UTF-8"),
        (GOOD.encode("cp1252"), "line 1 has the byte 0xfc, which is none: save it as UTF-8"),
        ('a = 1\nb = "C:\\parts\\x.stl"', r"line 2, column \d+\), 'b = .*: write paths with / or"),
        ('b = "C:\\Users\\x.stl"', "Invalid hex value .*: write paths with / or in single quotes"),
        ("a = pla", "Invalid value .*'a = pla': write text in quotes"),
        ("a = 2.5 mm", "'a = 2.5 mm': write KEY = VALUE, a line each; numbers have .* no unit"),
        ("a = 2,5", "'a = 2,5': write KEY = VALUE, a line each; numbers have a point"),
        ('a = "pla', "close the quotes"),
        ("a = [1, 2", "close the bracket"),
        ("a = 1\na = 2\n", "'a = 2': keep one of the two"),
        ("a 1", "'a 1': write KEY = VALUE"),
        ("a = " + "9" * 5000, "write shorter numbers"),
        ("a = " + "[" * 100_000, "fewer brackets"),
    ],
)
def test_what_is_no_toml_is_one_line_with_its_cure(tmp_path, content, said):
    path = tmp_path / "part.toml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=said) as refused:
        read_toml(path, "part file")
    assert str(refused.value).startswith(f"part file {path} ")
    assert "\n" not in str(refused.value)
    assert "correct it" not in str(refused.value)


def test_a_path_of_windows_whose_escapes_are_valid(tmp_path):
    with pytest.raises(InputError, match=r"has a tab, a line break .* in single quotes") as refused:
        existing_file(tmp_path / "C:\temp\new.stl", "surface file")
    assert "\n" not in str(refused.value)
