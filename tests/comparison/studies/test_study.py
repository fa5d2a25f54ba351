"""A study run by processes, killed and resumed, and by Dask: always the same table."""

import multiprocessing
import os
import pickle
import signal
import time
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pandas as pd
import pytest

import ccfem
from ccfem.base.errors import InputError
from ccfem.base.result_folder import whole_folder
from ccfem.comparison.files import RESULT_FILES
from ccfem.comparison.studies.jobs import Part, jobs_of
from ccfem.comparison.studies.running import TABLES, opened
from ccfem.comparison.studies.transport import unpacked
from ccfem.comparison.studies.work import part_bytes, solve_part
from ccfem.comparison.studies.worker import _stress
from ccfem.paths.planning import Amount
from ccfem.slicing.slicers import Planar

CELL = """
from dataclasses import dataclass
from typing import ClassVar
import ccfem
from ccfem.paths.planning import Amount

@dataclass(frozen=True)
class Rows:
    spacing: float = 5.0
    folds: ClassVar[bool] = True
    amount: ClassVar[Amount] = Amount("spacing", 1.0, 20.0)

    def __call__(self, layer, stress, machine):
        return lines(self.spacing)(layer, stress, machine)

def lines(spacing):
    return ccfem.strategies.Zigzag(spacing, angle=0.0)

@dataclass(frozen=True)
class Middle:
    def __call__(self, stress, build, machine):
        return ccfem.slicing.slicers.Planar(count=1)(stress, build, machine)
"""
NOTEBOOK = {"__name__": "__main__"}
exec(CELL, NOTEBOOK)

STUDY = ccfem.Study(
    name="tiny",
    parts=({"name": "bar", "element_size": 12.5},),
    slicings=(NOTEBOOK["Middle"](),),
    strategies=(
        NOTEBOOK["Rows"](),
        {"name": "zigzag", "sweep": {"spacing": [3.0, 4.0, 5.0, 6.0], "angle": [0.0, 45.0]}},
    ),
)


@dataclass(frozen=True)
class Raising:
    """Raises what no strategy should."""

    spacing: float = 1.0
    amount: ClassVar[Amount] = Amount("spacing", 1.0, 20.0)

    def __call__(self, layer, stress, machine):
        raise RuntimeError("no paths <today>")


def count(folder):
    return len(list(folder.glob("runs/[!.]*.json")))


@pytest.fixture(scope="module")
def disturbed(tmp_path_factory):
    """The study, killed after its first run was stored, and resumed; with what was told."""
    folder, told = tmp_path_factory.mktemp("study") / "out", []
    started = multiprocessing.get_context("fork").Process(
        target=ccfem.study, args=(STUDY, folder), kwargs={"workers": 1}
    )
    started.start()
    until = time.monotonic() + 120.0
    while not count(folder) and started.is_alive() and time.monotonic() < until:
        time.sleep(0.002)
    os.kill(started.pid, signal.SIGKILL)
    started.join()
    before = count(folder)
    result = ccfem.study(STUDY, folder, workers=0, progress=lambda *said: told.append(said))
    return result, before, told


def test_a_killed_study_goes_on_where_it_was(disturbed):
    result, before, told = disturbed
    assert before >= 1
    assert result.computed == 9 - before
    assert count(result.folder) == 9
    assert not list(result.folder.glob("**/.ccfem-*"))
    assert not (result.folder / ".stress").exists()
    if before < 9:
        assert told[-1][0].startswith("9 of 9 runs, about 0 s left: ")
    assert told[-1][1] == 1.0


def test_dask_gives_the_same_table_to_the_last_digit(disturbed, cluster, tmp_path):
    result, *_ = disturbed
    other = ccfem.study(STUDY, tmp_path / "out", scheduler=cluster)
    pd.testing.assert_frame_equal(result.frame, other.frame, check_exact=True)
    assert other.computed == 9
    for name in ("results.csv", "results.parquet"):
        assert (tmp_path / "out" / name).read_bytes() == (result.folder / name).read_bytes()


def test_a_strategy_and_a_slicer_of_a_notebook_run_in_other_processes(disturbed):
    result, *_ = disturbed
    assert not result.frame["failure"].any()
    assert result.frame["slicing"].unique().tolist() == ["middle"]
    row = result.frame.iloc[0]
    assert row["strategy"] == "rows"
    case = ccfem.read("bar", element_size=12.5)
    zigzag = ccfem.strategies.Zigzag(5.0, angle=0.0)
    own = ccfem.compare(case, [zigzag], layers=1, natural=True, strand=None).runs[0]
    assert row["fibre_length"] == pytest.approx(own.evaluation.total["fibre_length"], rel=1e-12)


def test_the_numbers_are_those_of_a_comparison(disturbed):
    result, *_ = disturbed
    case = ccfem.read("bar", element_size=12.5)
    zigzag = ccfem.strategies.Zigzag(spacing=4.0)
    own = ccfem.compare(case, [zigzag], layers=1, natural=True, curve=False).frame.iloc[0]
    row = result.frame[result.frame["strategy"] == "zigzag"].iloc[3]  # 4 mm, 45 degrees
    for name in ("stiffness", "first_failure_load", "fibre_length", "efficiency"):
        assert row[name] == pytest.approx(own[name], rel=1e-9)


def test_tables_fronts_and_the_page(disturbed):
    result, *_ = disturbed
    for name, read in (("results.csv", pd.read_csv), ("results.parquet", pd.read_parquet)):
        table = read(result.folder / name)
        assert table["stiffness"].tolist() == pytest.approx(result.frame["stiffness"].tolist())
    front = result.front()
    assert 1 <= len(front) < 9
    best = result.frame.loc[result.frame["stiffness"].idxmax()]
    assert best["run"] in set(front["run"])
    page = (result.folder / "study.html").read_text()
    assert page.count("<tr>") == 10
    assert page.count("data:image/png;base64,") == 3
    assert "http" not in page
    assert "<table" in result._repr_html_()
    assert len(repr(result)) < 200
    with pytest.raises(InputError, match="choose one"):
        result.front("colour")


def test_failures_stay_and_what_changed_is_run_alone(disturbed, cluster):
    result, *_ = disturbed
    strategies = (
        *STUDY.strategies,
        Raising(),
        {"name": "zigzag", "sweep": {"spacing": [3.0, 19.0]}},
    )
    more = ccfem.Study(
        **{
            **{name: getattr(STUDY, name) for name in ("name", "parts", "slicings")},
            "strategies": strategies,
        }
    )
    again = ccfem.study(more, result.folder, scheduler=cluster)
    assert len(again.frame) == 11
    assert again.repeated == 1  # spacing 3 at the default angle
    assert again.computed == 2
    failed = again.frame[again.frame["failure"] != ""]
    assert failed["failure"].iloc[0] == "RuntimeError: no paths <today>"
    assert "no paths &lt;today&gt;" in (result.folder / "study.html").read_text()
    assert any("raising on bar" in line for line in again.remarks)
    # A crash is tried again, a refusal is not.
    assert ccfem.study(more, result.folder, scheduler=cluster).computed == 1


def test_one_program_at_a_time_and_no_folder_of_others(tmp_path):
    with opened(tmp_path / "a"), pytest.raises(InputError, match="another program runs a study"):
        ccfem.study(STUDY, tmp_path / "a")
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "thesis.tex").write_text("mine")
    with pytest.raises(
        InputError, match=r"holds files that ccfem did not write, such as thesis.tex"
    ):
        ccfem.study(STUDY, tmp_path / "b")
    assert [path.name for path in (tmp_path / "b").iterdir()] == ["thesis.tex"]


def snapshot(folder):
    """Every entry of a folder, with its content or what it links to."""
    return {
        path.relative_to(folder).as_posix(): os.readlink(path)
        if path.is_symlink()
        else path.read_bytes()
        if path.is_file()
        else None
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture
def beside(tmp_path):
    """A folder for a study, and one of a user beside it, which has to stay as it is."""
    out, docs = tmp_path / "out", tmp_path / "docs"
    out.mkdir()
    docs.mkdir()
    (docs / "t.docx").write_text("three years")
    yield out, docs
    assert snapshot(docs) == {"t.docx": b"three years"}


def begun(out):
    """Write what a study writes first."""
    with opened(out) as store, store.writing("study.json") as files:
        (files / "study.json").write_text("{}")


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("marker", ["study.json", ".lock"])
def test_a_link_in_place_of_the_old_scratch_folder_is_left_alone(beside, marker, force):
    out, _ = beside
    (out / marker).write_text("{}" if marker == "study.json" else "")
    (out / ".stress").symlink_to("../docs")
    before = snapshot(out)
    if force:
        with opened(out, force=True) as store:
            store["a" * 40] = {"failure": "none"}
        assert (out / ".stress").is_symlink()
        assert (out / "runs" / f"{'a' * 40}.json").is_file()
    else:
        with pytest.raises(InputError, match=r"holds files that ccfem did not write"):
            ccfem.study(STUDY, out)
        assert snapshot(out) == before


def test_force_keeps_what_is_no_result(beside):
    out, _ = beside
    (out / ".stress").mkdir()
    (out / ".stress" / "notes.txt").write_text("mine")
    (out / "results.csv").write_text("mine")
    with opened(out, force=True) as store, store.writing("results.csv") as files:
        (files / "results.csv").write_text("new")
    assert (out / ".stress" / "notes.txt").read_text() == "mine"
    assert (out / "results.csv").read_text() == "new"


def test_runs_are_not_stored_through_a_link(beside):
    out, docs = beside
    begun(out)
    (out / "runs").symlink_to(docs)
    with pytest.raises(InputError, match=r"out/runs: it is no folder but a link"), opened(out) as s:
        s["a" * 40] = {"failure": ""}
    (out / "runs").unlink()
    (out / "runs").mkdir()
    (out / "runs" / f"{'a' * 40}.json").symlink_to(docs / "t.docx")
    with pytest.raises(InputError, match=r"is not a run that ccfem stored: move"), opened(out) as s:
        s["a" * 40]
    with opened(out, force=True) as store:
        assert store["a" * 40] is None
        store["a" * 40] = {"failure": "solved"}
        assert store["a" * 40] == {"failure": "solved"}


def test_a_link_that_comes_into_the_place_of_the_folder_is_not_followed(beside, tmp_path):
    out, docs = beside
    with opened(out) as store:
        out.rename(tmp_path / "moved")
        out.symlink_to(docs)
        store["a" * 40] = {"failure": ""}
        with pytest.raises(OSError, match="another folder has come"), store.writing("study.json"):
            pass
    assert (tmp_path / "moved" / "runs" / f"{'a' * 40}.json").is_file()


@pytest.mark.parametrize(
    "text",
    [
        *("[]", "[" * 10**5, '{"failure": 3}', '{"failure": "", "values": 3}'),
        '{"failure": "", "values": {"stiffness": "=1"}}',
    ],
)
def test_what_is_no_run_is_not_taken_for_one(beside, text):
    out, _ = beside
    begun(out)
    (out / "runs").mkdir()
    (out / "runs" / f"{'a' * 40}.json").write_text(text)
    with pytest.raises(InputError, match="is not a run that ccfem stored"), opened(out) as store:
        store["a" * 40]


def test_the_lock_and_the_tables_are_not_written_through_links(beside):
    out, docs = beside
    (out / ".lock").symlink_to(docs / "new")
    with pytest.raises(InputError, match=r"out/\.lock: it is no file but a link"), opened(out):
        pass
    (out / ".lock").unlink()
    begun(out)
    (out / "results.csv").symlink_to(docs / "t.docx")
    with pytest.raises(InputError, match=r"results.csv is not by ccfem .*--force"), opened(out):
        pass


def test_stress_is_kept_as_plain_arrays_where_nobody_else_writes(tmp_path):
    case = ccfem.read("bar", element_size=12.5)
    task = part_bytes(Part(case, ("pull",)), None, "auto")
    rest, arrays = solve_part(task)
    # 6 kB of words, on any mesh: no array of a cell or a node is left among them.
    finer = solve_part(
        part_bytes(Part(ccfem.read("bar", element_size=5.0), ("pull",)), None, "auto")
    )
    assert abs(len(finer[0]) - len(rest)) < 100
    assert len(rest) < 0.1 * sum(array.nbytes for array in arrays.values())
    np.savez(tmp_path / "0.npz", **arrays)
    known, kept = _stress(rest, str(tmp_path / "0.npz"))
    stress = unpacked(known, kept)
    field, solved = stress.fields["pull"], ccfem.solve(case.problem)["pull"]
    assert np.array_equal(field.stress, solved.stress)
    assert not field.stress.flags.writeable
    assert field.problem.mesh.points is stress.fields["pull"].mesh.points


def test_a_pickle_in_place_of_the_stress_is_not_opened(tmp_path):
    class Foreign:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "foreign"),)

    for name, write in (
        ("plain", lambda file: file.write_bytes(pickle.dumps(Foreign()))),
        ("array", lambda file: np.savez(file, a=np.array([Foreign()], dtype=object))),
    ):
        file = tmp_path / f"{name}.npz"
        write(file)
        with pytest.raises(ValueError, match="allow_pickle"):
            _stress(b"", str(file))
    assert not (tmp_path / "foreign").exists()


def write_beside(out, record, names):
    """Write what a command leaves in a folder."""
    with whole_folder(out, names) as files:
        for name in (record, "results.csv"):
            (files / name).write_text(record)


def test_a_study_and_a_comparison_do_not_mix_in_one_folder(tmp_path):
    """Both write results.csv: the second of them is refused, and nothing is replaced."""
    write_beside(tmp_path / "compared", "results.json", RESULT_FILES)
    begun(tmp_path / "study")
    with opened(tmp_path / "study") as store, store.writing(*TABLES) as files:
        (files / "results.csv").write_text("study")
    before = snapshot(tmp_path)
    with pytest.raises(InputError, match=r"results of another command, with results\.json, some"):
        ccfem.study(STUDY, tmp_path / "compared")
    with pytest.raises(InputError, match=r"results of another command, with study\.json, some of"):
        write_beside(tmp_path / "study", "results.json", RESULT_FILES)
    assert snapshot(tmp_path) == before
    with opened(tmp_path / "study") as store, store.writing(*TABLES) as files:  # its own go on
        (files / "results.csv").write_text("again")
    assert (tmp_path / "study" / "results.csv").read_text() == "again"


def test_a_slicing_that_cannot_be_cut_leaves_the_others_as_in_a_comparison():
    thin = Planar(thickness=0.05)
    case = ccfem.read("bar", element_size=10.0)
    study = replace(STUDY, parts=(case,), strategies=("zigzag",), slicings=(Planar(count=2), thin))
    assert len(jobs_of(study).jobs) == 2
    with pytest.raises(InputError, match="layers must lie at least"):
        jobs_of(replace(study, slicings=(thin,)))
