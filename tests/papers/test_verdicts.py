"""Claims are judged by their ranges, and by the resolution of what measured them."""

import pytest

from ccfem.papers.contents import claim_table, judged

CLAIMS = """
[[claim]]
id = "1"
text = "stiffer"
source = "section 1"
tolerance = "none"
resolution = {resolution}
checks = [{{ quantity = "ratio", paper = "above 1", low = 1.0, high = 100.0 }}]
why = "because"
"""


@pytest.mark.parametrize(
    ("ratio", "resolution", "verdict"),
    [
        (1.10, 0.02, "reproduced"),
        (1.01, 0.02, "undecided"),
        (0.99, 0.02, "undecided"),
        (0.90, 0.02, "differs"),
        (1.01, 0.0, "reproduced"),
        (None, 0.02, "not tried"),
    ],
)
def test_a_number_nearer_than_the_resolution_decides_nothing(ratio, resolution, verdict, tmp_path):
    (tmp_path / "claims.toml").write_text(CLAIMS.format(resolution=resolution))
    found = {} if ratio is None else {"ratio": ratio}
    checks = judged(found, tmp_path / "claims.toml")
    assert [check.verdict for check in checks] == [verdict]
    assert ("- 1: because" in claim_table(checks)) == (verdict != "reproduced")
