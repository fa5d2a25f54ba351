import numpy as np
import pytest

import ccfem
from ccfem.base.errors import InputError
from ccfem.comparison.front import on_front
from ccfem.comparison.studies.fingerprint import fingerprint
from ccfem.comparison.studies.jobs import jobs_of, variants
from ccfem.comparison.studies.transport import packed, unpacked


def write(folder, text):
    path = folder / "sweep.toml"
    path.write_text(text)
    return path


def test_a_grid_is_every_combination_and_a_list_each_of_its_tables():
    grid = {"name": "zigzag", "turn": 45.0, "sweep": {"spacing": [1.0, 2.0], "angle": [0.0, 9.0]}}
    found = [each.parameters for each in variants(grid, "strategies")]
    assert found == [
        {"turn": 45.0, "spacing": s, "angle": a} for s in (1.0, 2.0) for a in (0.0, 9.0)
    ]
    some = {"name": "pruned", "sweep": [{"coverage": 0.2}, {"base.floor": 0.1}]}
    assert [each.parameters for each in variants(some, "strategies")] == [
        {"coverage": 0.2},
        {"base": {"floor": 0.1}},
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "is empty: give it parts and strategies"),
        ("parts = [", "is not a TOML file"),
        ("parts = ['bar']", "needs the key 'strategies'"),
        ("parts = ['bar']\nstrategies = ['zigzag']\nstrategy = 1", "has no key 'strategy'"),
        ("parts = []\nstrategies = ['zigzag']", "at least one of its parts"),
        ("parts = ['barr']\nstrategies = ['zigzag']", "no case named 'barr'.*'bar'"),
        ("parts = ['gone.toml']\nstrategies = ['zigzag']", "gone.toml does not exist"),
        ("parts = ['bar']\nstrategies = ['zagzig']", "no strategy named 'zagzig'"),
        ("parts = ['bar']\nstrategies = ['zigzag']\nload_cases = ['push']", "no load case of bar"),
        ("parts = ['bar']\nstrategies = ['zigzag']\nslicings = ['cubes']", "no slicer named"),
        ("parts = ['bar']\nstrategies = ['zigzag']\nfibre_per_layer = -1", "above 0"),
        ("parts = ['bar']\nstrategies = [{name='zigzag', pitch=2.0}]", "no parameter 'pitch'"),
        ("parts = ['bar']\nstrategies = [{name='zigzag', sweep={}}]", "write sweep.NAME"),
        ("parts = ['bar']\nstrategies = [{name='zigzag', sweep.spacing=[]}]", "at least one value"),
        ("parts = ['bar']\nstrategies = [{name='zigzag', sweep.spacing=2.0}]", "must be a list"),
        ("parts = ['bar']\nstrategies = [{name='zigzag', sweep=[]}]", "a list of tables"),
        ("parts = ['bar']\nstrategies = [{spacing=2.0}]", "give its name"),
        ("parts = ['bar']\nstrategies = [{name='zigzag', sweep.spacing=[0.1]}]", "at least 1"),
        (
            "parts = ['bar']\nstrategies = [{name='zigzag', angle=0.0, sweep.angle=[1.0]}]",
            "a value and a sweep of 'angle'",
        ),
    ],
)
def test_a_bad_study_is_one_line_and_writes_nothing(tmp_path, text, said):
    with pytest.raises(InputError, match=said) as error:
        ccfem.study(write(tmp_path, text), tmp_path / "out")
    assert "\n" not in str(error.value)
    assert not (tmp_path / "out").exists()


SOME = """
parts = [{ name = "bar", sweep.element_size = [12.5, 20] }, { name = "cantilever" }]
strategies = ["concentric", { name = "zigzag", sweep.spacing = [2.0, 3.0, 2.0] }]
slicings = ["planar:count=1", "planar:count=2"]
fibre_per_layer = [300.0, 400.0]
"""


def keys(path):
    return [job.key for job in jobs_of(ccfem.comparison.studies.read_study(path)).jobs]


def test_all_combinations_each_once_under_a_hash_that_says_what_they_depend_on(tmp_path):
    path = write(tmp_path, SOME)
    found = jobs_of(ccfem.comparison.studies.read_study(path))
    assert len(found.parts) == 3
    assert len(found.jobs) == len({job.key for job in found.jobs}) == 3 * 2 * 3 * 2
    assert found.repeated == 3 * 2 * 2
    before = {job.key for job in found.jobs}
    assert set(keys(path)) == before
    more = set(keys(write(tmp_path, SOME.replace("3.0, 2.0]", "3.0, 5.0]"))))
    assert before < more
    assert len(more - before) == 3 * 2 * 2
    # Another mesh, another length, and another test each change the runs they are of, and no other.
    other = set(keys(write(tmp_path, SOME.replace("12.5", "10.0"))))
    assert len(before - other) == 2 * 3 * 2
    assert len(before - set(keys(write(tmp_path, SOME.replace("400.0", "500.0"))))) == 18
    untested = write(tmp_path, SOME + "virtual_test = false")
    assert not before & set(keys(untested))


def test_another_version_makes_all_runs_anew(tmp_path, monkeypatch):
    path = write(tmp_path, SOME)
    before = keys(path)
    monkeypatch.setattr("ccfem.comparison.studies.jobs.version", lambda name: "99.0")
    assert not set(before) & set(keys(path))


def test_fingerprints_see_content_and_nothing_else():
    zigzag = ccfem.strategies.Zigzag
    assert fingerprint(zigzag(spacing=2.0)) == fingerprint(zigzag(spacing=2.0))
    assert fingerprint(zigzag(spacing=2.0)) != fingerprint(zigzag(spacing=2.5))
    a = np.arange(6.0).reshape(2, 3)
    assert fingerprint(a) == fingerprint(np.asfortranarray(a))
    assert fingerprint(a) != fingerprint(a.reshape(3, 2))
    assert fingerprint(("ab", "c")) != fingerprint(("a", "bc"))
    assert fingerprint(()) != fingerprint(((),))
    with pytest.raises(InputError, match="cannot look into a generator"):
        fingerprint(x for x in ())


def test_the_code_of_a_strategy_of_ones_own_counts():
    def made(factor):
        own = "class Own:\n    def __call__(self, x):\n        return helper(x)\n"
        text = f"def helper(x):\n    return {factor} * x\n\n\n{own}"
        space = {"__name__": "somewhere"}
        exec(text, space)
        return space["Own"]

    assert fingerprint(made(2)) == fingerprint(made(2))
    assert fingerprint(made(2)) != fingerprint(made(3))


def test_what_goes_to_other_processes_stays_read_only():
    case = ccfem.read("bar", element_size=12.5)
    there = unpacked(packed(case))
    assert fingerprint(there) == fingerprint(case)
    assert not there.problem.mesh.points.flags.writeable
    assert type(there.parameters) is type(case.parameters)
    empty = np.zeros((0, 3))
    empty.flags.writeable = False
    assert unpacked(packed(empty)).shape == (0, 3)


def test_a_front_is_what_nothing_dominates():
    rng = np.random.default_rng(3)
    x, y = rng.integers(0, 9, (2, 60)).astype(float)
    x[5] = np.nan
    found = on_front(x, y)
    for k in range(60):
        beaten = any(
            x[j] <= x[k] and y[j] >= y[k] and (x[j], y[j]) != (x[k], y[k]) for j in range(60)
        )
        assert found[k] == (not beaten and k != 5)
    assert (on_front(-x, y, "high") == found).all()
