import os
from pathlib import Path

import pytest

from ccfem.judging.virtual_testing.virtual_test import HONEST_PROMISE
from ccfem.papers.chen_2021.study import PARTS_AT_HAND
from ccfem.papers.chen_2021.virtual_test import PHYSICAL

ROOT = Path(__file__).parents[2]


def test_every_page_says_that_one_printed_part_was_compared():
    """Two fibre plans of the Loop, each over the Loop without fibre: one part, three prints."""
    zigzag, ours, between = PHYSICAL
    assert between == pytest.approx(ours / zigzag, abs=0.005)
    assert "published prints of Chen et al. 2021" in HONEST_PROMISE
    assert "one specimen each" in HONEST_PROMISE
    for page in ("README.md", "docs/concepts/judging.md"):
        text = " ".join((ROOT / page).read_text(encoding="utf-8").split())
        assert "compared with one printed part, the Loop of Chen et al. 2021: without fibre" in text
        assert "three printed parts" not in text
        assert "three published parts" not in text
    assert PARTS_AT_HAND in (ROOT / "docs/papers/chen_2021.md").read_text(encoding="utf-8")


@pytest.mark.skipif("CCFEM_CHEN2021" not in os.environ, reason="needs the authors' data")
def test_parts_said_to_be_published_are_in_the_authors_folder():
    there = {folder.name for folder in Path(os.environ["CCFEM_CHEN2021"]).iterdir()}
    assert {"Loop", "Shell", "bar"} <= there
    assert "Loop, Shell, bar and Wrench, not the Piston" in PARTS_AT_HAND
