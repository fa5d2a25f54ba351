"""Papers by name: what they offer is there, and a part is made alone."""

import re
from pathlib import Path

import pytest

import ccfem.papers
from ccfem.base.errors import InputError
from ccfem.papers.contents import Contents, WhenAsked
from ccfem.papers.reproduce import KEPT, named_papers, reproduce


def test_every_figure_that_is_offered_is_drawn():
    """The numbers that a paper offers are those of the figures that its code names."""
    for name, contents in named_papers().items():
        if not contents.numbers:
            continue
        folder = Path(ccfem.papers.__path__[0]) / name
        source = "".join(path.read_text() for path in folder.glob("*.py"))
        drawn = {int(number) for number in re.findall(r'"figure_(\d\d)', source)}
        drawn |= {int(number) for number in re.findall(r'"\w+", "(\d\d)b?"', source)}
        drawn |= {int(number) for number in re.findall(r', "(\d\d)"\)', source)}
        pairs = re.findall(r'\("\w+", (\d\d), (\d\d)\)', source)
        drawn |= {int(number) for pair in pairs for number in pair}
        assert set(contents.numbers) == drawn, name


def test_every_folder_of_a_paper_is_offered():
    folders = {path.parent.name for path in Path(ccfem.papers.__path__[0]).glob("*/expected.toml")}
    assert set(named_papers()) == folders


def test_a_table_is_made_alone(tmp_path):
    path = reproduce("wang_2021", "table2", tmp_path)
    assert path == tmp_path / "table2.md"
    # Table 2 of the paper: 7 mm/s above a curvature of 0.2 / mm.
    assert "| 7" in path.read_text()
    assert {each.name for each in tmp_path.iterdir()} == {"table2.md", KEPT}


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


def squares(tmp_path, monkeypatch, told):
    """Make a part of a paper that stands for one with a long study."""
    study = []

    def run(progress):
        study.append(WhenAsked((2, 3, 4), lambda k: k * k, progress, "squaring"))
        return study[-1]

    contents = Contents(
        "Squares",
        1.0,
        lambda folder, progress: None,
        run,
        {"table1": lambda asked: f"3 x 3 = {asked()[3]}\n"},
    )
    monkeypatch.setattr("ccfem.papers.reproduce.named_papers", lambda: {"squares": contents})
    path = reproduce("squares", "table1", tmp_path, lambda what, share: told.append(what))
    return path, study


def test_a_part_runs_no_more_than_it_needs_and_is_kept(tmp_path, monkeypatch):
    told = []
    path, (study,) = squares(tmp_path, monkeypatch, told)
    assert path.read_text() == "3 x 3 = 9\n"
    assert study.computed == (3,)
    assert told == ["squaring 3"]
    before = path.stat().st_mtime_ns
    again, none = squares(tmp_path, monkeypatch, told)
    assert (again, none) == (path, [])
    assert path.stat().st_mtime_ns == before
    assert told[1:] == ["table1 is kept from an earlier run"]


def test_what_is_kept_is_made_again_where_inputs_or_the_file_changed(tmp_path, monkeypatch):
    path, _ = squares(tmp_path, monkeypatch, [])
    path.write_text("spoiled")
    assert len(squares(tmp_path, monkeypatch, [])[1]) == 1
    assert path.read_text() == "3 x 3 = 9\n"
    monkeypatch.setenv("CCFEM_FANG2024", str(tmp_path / "data"))
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "mesh.tet").write_text("other data")
    assert len(squares(tmp_path, monkeypatch, [])[1]) == 1
    (tmp_path / KEPT).write_text('{"table1": 3}')
    assert len(squares(tmp_path, monkeypatch, [])[1]) == 1


@pytest.mark.parametrize(
    ("paper", "figure", "needed"),
    [("wang_2021", 16, "l_shape"), ("plocher_2022", 2, "I"), ("chen_2021", 7, "Loop, pushed")],
)
def test_a_figure_asks_for_its_pieces_alone(paper, figure, needed, monkeypatch):
    """Pieces are asked for and not computed: the first one that is missing ends the drawing."""
    asked = set()

    class AskedError(Exception):
        pass

    def piece(name):
        asked.add(name)
        raise AskedError

    contents = named_papers()[paper]
    if paper == "chen_2021":
        from ccfem.papers.chen_2021.study import Study

        study = Study(WhenAsked(("Loop", "Loop, pushed", "bar", "lifting_eye"), piece))
    elif paper == "plocher_2022":
        cases = WhenAsked(("I", "II", "III"), piece)
        study = (cases, cases)
    else:
        study = WhenAsked(("bridge", "suspension", "cantilever", "m_shape", "l_shape"), piece)
    with pytest.raises(AskedError):
        contents.figures(study, figure)
    assert asked == {needed}
