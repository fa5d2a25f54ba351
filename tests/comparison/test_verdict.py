"""The verdict is true of the table that it stands beside: a test reads both."""

import itertools
import re
from dataclasses import replace

import pytest

import ccfem
from ccfem.comparison.ranking import best_values
from ccfem.virtual_testing.stiffer import RESOLUTION

_NUMBER = r"(\d+\.\d\d)"


def candidates(comparison, frame):
    """Rows of the table that the verdict may speak of."""
    table = frame[frame["printable"]]
    wanted = comparison.fibre_per_layer
    if wanted is not None:
        table = table[abs(table["fibre_per_layer"] / wanted - 1.0) <= 0.01]
    return table.set_index("strategy")


def gains(table, one, other):
    """Stiffness of one over another less 1, tension only and bonded."""
    columns = ("stiffness_ratio_tension", "stiffness_ratio_bonded")
    return [table.loc[one, c] / table.loc[other, c] - 1.0 for c in columns]


def check(comparison):
    """Hold every word of the verdict against the table; return which kind it was."""
    said, frame = comparison.verdict, comparison.frame
    table = candidates(comparison, frame)
    left = re.search(r" Not printable as planned: (.*)\.$", said)
    unprintable = list(frame[frame["why_not"] != ""]["strategy"])
    assert (left[1].split(", ") if left else []) == unprintable
    sentence = said[: left.start()] if left else said
    off = re.search(r" Not at that length: (.*)\.$", sentence)
    printable = frame[frame["printable"]]
    elsewhere = [name for name in printable["strategy"] if name not in table.index]
    found = re.findall(r"(\w+) \(lays (\d+) mm\)", off[1]) if off else []
    assert [name for name, _ in found] == elsewhere
    for name, length in found:
        laid = printable.set_index("strategy").loc[name, "fibre_per_layer"]
        assert laid == pytest.approx(float(length), abs=0.51)
    sentence = sentence[: off.start()] if off else sentence
    names = list(table.index)
    amount = re.search(r"at (\d+) mm of fibre per layer", sentence)
    if amount:
        named = [name for name in names if re.search(rf"\b{name}\b", sentence)]
        for name in named:
            assert table.loc[name, "fibre_per_layer"] == pytest.approx(float(amount[1]), rel=0.03)
    if " makes the stiffest part" in sentence:
        winner = sentence.split(" makes ")[0]
        second = re.search(rf"and {_NUMBER} times (\w+) ", sentence)
        assert winner == names[0]
        assert second[2] == names[1]
        for other in names[1:]:
            tension, bonded = gains(table, winner, other)
            assert tension > RESOLUTION
            assert bonded >= -RESOLUTION
        ratio = re.search(rf"{_NUMBER} times the unreinforced one", sentence)[1]
        assert float(ratio) == pytest.approx(
            table.loc[winner, "stiffness_ratio_tension"], abs=0.0051
        )
        assert float(second[1]) == pytest.approx(1.0 + gains(table, winner, second[2])[0], abs=6e-3)
        assert float(second[1]) > 1.0
        return "winner"
    group = re.split(r", | and ", re.search(r"between (.*?), (?:at|with|each)", sentence)[1])
    assert group[0] == names[0]
    ratios = re.search(r": ([\d., and]+) times the unreinforced stiffness", sentence)[1]
    for name, ratio in zip(group, re.findall(_NUMBER, ratios), strict=True):
        value = table.loc[name, "stiffness_ratio_tension"]
        assert float(ratio) == pytest.approx(value, abs=0.0051)
    others = [gains(table, group[0], name) for name in group[1:]]
    if sentence.startswith("No difference"):
        assert all(abs(gain) <= RESOLUTION for pair in others for gain in pair)
        return "no difference"
    assert sentence.startswith("Undecided")
    assert any(b < -RESOLUTION or (t <= RESOLUTION < b) for t, b in others)
    # Whoever is not named is neither undecided against the first nor level with it.
    for name in set(names) - set(group):
        tension, bonded = gains(table, group[0], name)
        assert tension > RESOLUTION
        assert bonded >= -RESOLUTION
    return "undecided"


@pytest.fixture(scope="module", params=["bar", "open_hole", "loop", "m_shape"])
def compared(request):
    size = {"bar": 4.0, "open_hole": 4.0, "loop": 6.0, "m_shape": 6.0}[request.param]
    case = ccfem.read(request.param, element_size=size)
    return ccfem.compare(case, layers=2, curve=False)


def with_stiffness(run, tension, bonded):
    """A run whose stiffnesses are those of the part without fibre times two numbers."""
    bracket = run.tested.bracket
    tests = {
        name: replace(test, stiffness=ratio * test.unreinforced_stiffness)
        for name, test, ratio in (
            ("tension", bracket.tension, tension),
            ("bonded", bracket.bonded, bonded),
        )
    }
    return replace(run, tested=replace(run.tested, bracket=replace(bracket, **tests)))


def test_verdicts_of_the_cases_are_true(compared):
    assert check(compared)


@pytest.mark.parametrize("compared", ["bar"], indirect=True)
def test_verdicts_of_made_up_tables_are_true(compared):
    """All orders of three runs by stiffness, tension only and bonded, far and near."""
    runs = [run for run in compared.runs if run.tested is not None][:3]
    assert len(runs) == 3
    runs = [replace(run, why_not="") for run in runs]
    kinds = set()
    for tension, bonded in itertools.product(
        itertools.product((1.5, 1.51, 2.0), repeat=3), itertools.product((1.5, 2.0), repeat=3)
    ):
        changed = [
            with_stiffness(run, t, b) for run, t, b in zip(runs, tension, bonded, strict=True)
        ]
        made = replace(compared, runs=tuple(changed), wanted=None)
        kind = check(made)
        kinds.add(kind)
        marked = best_values(made.runs, made.fibre_per_layer)
        if not any(run.empty_layers for run in made.runs):
            assert ("stiffness" in marked) == (kind == "winner")
    assert kinds == {"winner", "no difference", "undecided"}


def test_what_cannot_be_printed_is_left_out(compared):
    best = compared.ranking[0]
    broken = replace(best, why_not="62% of the fibre lies on other fibre")
    runs = [broken if run is best else run for run in compared.runs]
    made = replace(compared, runs=tuple(runs))
    assert made.ranking[0] is not broken
    printable = [run for run in made.ranking if run.evaluation is not None]
    assert printable[-1] is broken or not printable[-1].printable
    if made.verdict:
        check(made)
    row = made.frame.set_index("strategy").loc[best.name]
    assert not row["printable"]
    assert row["why_not"] == broken.why_not
    assert any(broken.why_not in line for line in made.remarks)
    page = str(made)
    assert f"{best.name}" in page
    assert " no" in next(line for line in page.splitlines() if line.startswith(best.name))


def test_the_table_has_every_index_in_order_of_rank(compared):
    table = compared.frame
    assert list(table["rank"]) == list(range(1, len(compared.runs) + 1))
    assert list(table["strategy"]) == [run.name for run in compared.ranking]
    for run in compared.ranking:
        row = table.set_index("strategy").loc[run.name]
        if run.evaluation is not None:
            for name, value in run.evaluation.total.items():
                assert row[name] == value or (row[name] != row[name] and value != value), name
            assert row["stiffness"] == run.tested.bracket.tension.stiffness
            assert row["displacement"] * row["stiffness"] == pytest.approx(
                run.tested.bracket.tension.force
            )


def test_no_verdict_is_a_number_that_there_is_none_of(compared):
    """Without a test and without tension there is nothing to go by, and that is said."""
    runs = []
    for run in compared.runs:
        if run.evaluation is not None:
            values = {name: column.copy() for name, column in run.evaluation.values.items()}
            values["efficiency"][:] = float("nan")
            evaluation = replace(run.evaluation, values=values)
            runs.append(replace(run, tested=None, evaluation=evaluation, why_not=""))
    made = replace(compared, runs=tuple(runs), bounds={}, wanted=None)
    assert made.verdict == "No verdict: there is no virtual test, and no fibre lies in tension."
    assert "nan" not in str(made)


def with_alternative(run, tension, bonded):
    """A run with a second test, of such stiffnesses, under other supports."""
    other = with_stiffness(run, tension, bonded).tested
    return replace(run, tested=replace(run.tested, alternative=other))


@pytest.mark.parametrize(
    ("own", "other", "said"),
    [
        ((2.0, 1.5), (1.8, 1.5), "makes the stiffest part"),
        ((2.0, 1.5), (1.5, 1.505), "makes the stiffest part"),
        ((2.0, 1.5), (1.5, 1.8), "Undecided between"),
        ((1.5, 1.49), (1.8, 1.5), "Undecided between"),
        ((1.5, 1.49), (1.5, 1.8), "Undecided between"),
        ((1.5, 1.49), (1.5, 1.505), "No difference between"),
    ],
)
def test_an_order_that_other_supports_turn_round_is_undecided(compared, own, other, said):
    first, second = [replace(run, why_not="") for run in compared.ranking[:2]]
    first, second = (
        with_alternative(with_stiffness(run, k, k), again, again)
        for run, k, again in zip((first, second), own, other, strict=True)
    )
    made = replace(compared, runs=(first, second), wanted=None, bounds={})
    table = made.frame.set_index("strategy")
    for name, k, again in zip((first.name, second.name), own, other, strict=True):
        assert table.loc[name, "stiffness_ratio_tension"] == pytest.approx(k)
        for column in ("stiffness_ratio_tension_alternative", "stiffness_ratio_bonded_alternative"):
            assert table.loc[name, column] == pytest.approx(again)
    assert said in made.verdict
    ends = {
        "makes": "or under the alternative supports).",
        "No": "under both models of the supports.",
        "Undecided": f"; under the alternative supports {other[0]:.2f} and {other[1]:.2f} (tension "
        f"only), {other[0]:.2f} and {other[1]:.2f} (bonded).",
    }
    assert made.verdict.endswith(ends[said.split()[0]])
    undecided = any("undecided against" in line for line in made.remarks)
    assert undecided == (said == "Undecided between")
    if undecided:
        assert any("or both models of the supports, do not agree" in line for line in made.remarks)


def test_the_strongest_is_marked_where_it_is_so_under_both_supports(compared):
    runs = [replace(run, why_not="") for run in compared.ranking[:2]]
    if any(run.empty_layers for run in runs):
        pytest.skip("layers without fibre have no best value")

    def marked(own, other):
        made = []
        for run, load, again in zip(runs, own, other, strict=True):
            failure = replace(run.tested.failure, load=load)
            second = replace(run.tested, failure=replace(failure, load=again))
            made.append(
                replace(run, tested=replace(run.tested, failure=failure, alternative=second))
            )
        return best_values(made, None).get("first_failure_load")

    assert marked((5000.0, 4000.0), (3000.0, 2000.0)) == 5000.0
    assert marked((5000.0, 4000.0), (2000.0, 3000.0)) is None
    assert marked((5000.0, 4990.0), (3000.0, 2000.0)) is None
