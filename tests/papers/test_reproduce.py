"""Papers by name: what they offer is there, and a part is made alone."""

import importlib
import re
from pathlib import Path

import pytest

import ccfem.papers
from ccfem.errors import InputError
from ccfem.papers.reproduce import named_papers, reproduce


def test_every_figure_that_is_offered_is_drawn():
    """The numbers that a paper offers are those of the figures that its code names."""
    for name, contents in named_papers().items():
        if not contents.numbers:
            continue
        source = Path(importlib.import_module(f"ccfem.papers.{name}.figures").__file__).read_text()
        drawn = {int(number) for number in re.findall(r'"figure_(\d\d)', source)}
        drawn |= {int(number) for number in re.findall(r'"\w+", "(\d\d)b?"', source)}
        drawn |= {int(number) for number in re.findall(r', "(\d\d)"\)', source)}
        pairs = re.findall(r'\("\w+", (\d\d), (\d\d)\)', source)
        drawn |= {int(number) for pair in pairs for number in pair}
        assert set(contents.numbers) == drawn, name


def test_every_folder_of_a_paper_is_offered():
    folders = {path.parent.name for path in Path(ccfem.papers.__path__[0]).glob("*/claims.py")}
    assert set(named_papers()) == folders


def test_a_table_is_made_alone(tmp_path):
    path = reproduce("wang_2021", "table2", tmp_path)
    assert path == tmp_path / "table2.md"
    # Table 2 of the paper: 7 mm/s above a curvature of 0.2 / mm.
    assert "| 7" in path.read_text()
    assert [each.name for each in tmp_path.iterdir()] == ["table2.md"]


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (("wang_2012", ""), "no paper named 'wang_2012'"),
        (("wang_2021", "figure99"), "no part of wang_2021 named 'figure99'"),
    ],
)
def test_an_unknown_name_is_one_line_and_writes_nothing(asked, said, tmp_path):
    with pytest.raises(InputError, match=said) as caught:
        reproduce(*asked, tmp_path / "out")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()
