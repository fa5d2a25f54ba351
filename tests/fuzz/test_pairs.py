"""A few slicings by a few strategies, as far as the report. More: benchmarks.fuzz.pairs."""

import pytest

from benchmarks.fuzz.pairs import see, slicings, write_surfaces


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("surfaces")
    write_surfaces(folder)
    return slicings(folder)


@pytest.mark.parametrize("slicing", ["planar, scrap", "surfaces"])
def test_layers_on_which_strategies_lay_nothing(made, slicing, tmp_path):
    """Rings, streamlines and strands round the holes: none has room on the scrap."""
    strategies = ["concentric", "streamline", "stripes", "winding"]
    found = see(made[slicing], strategies, None, False, tmp_path, strand=None)
    empty = 1 if slicing == "surfaces" else 0
    assert [run.empty_layers for run in found.succeeded] == [1] * len(found.succeeded)
    assert len(found.succeeded) >= 2
    for run in found.succeeded:
        assert empty not in run.toolpaths.layer


def test_all_slicings_in_one_report(made, tmp_path):
    few = {
        name: made[name] for name in ("planar along x", "spatial", "surfaces", "through_strands")
    }
    found = see(few, ["concentric", "winding"], 150.0, False, tmp_path, strand=None)
    wanted = {"concentric on surfaces", "concentric on through_strands", "winding on spatial"}
    assert wanted <= {run.name for run in found.succeeded}
