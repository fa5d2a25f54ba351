"""Run the study, and write its figures, tables and the claims beside ours.

python -m benchmarks.papers.chen_2021 FOLDER
"""

import csv
import sys
from pathlib import Path
from time import perf_counter

from benchmarks.papers.chen_2021.claims import quantities, verdicts
from benchmarks.papers.chen_2021.figures import draw_all
from benchmarks.papers.chen_2021.study import Study, run_study
from benchmarks.papers.chen_2021.tables import length_table, time_table
from benchmarks.papers.verdicts import claim_table


def write(study: Study, folder: Path) -> str:
    """Write everything into a folder; returns the table of claims."""
    folder.mkdir(parents=True, exist_ok=True)
    found = quantities(study)
    claims = claim_table(verdicts(found))
    drawn = draw_all(study, folder)
    with (folder / "quantities.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("quantity", "value"), *found.items()])
    parts = [
        "# Field-based toolpaths of Chen et al. (2021): ours beside theirs\n",
        "Written by `python -m benchmarks.papers.chen_2021`. The algorithm is the one that the "
        f"paper prints. Part: {study.loop.case.title}. The paper's Shell, Wrench and Piston are "
        "not published; `open_hole` and `lifting_eye` stand in.\n",
        f"## Claims\n\n{claims}",
        f"## Table 1: times\n\n{time_table(study)}",
        f"## Table 2: fibre and stiffness\n\n{length_table(study, found)}",
        "## Figures\n",
        *(f"![{name}]({name})\n" for name in drawn),
    ]
    (folder / "report.md").write_text("\n".join(parts))
    return claims


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m benchmarks.papers.chen_2021 FOLDER")
    begun = perf_counter()
    print(write(run_study(), Path(sys.argv[1])))
    print(f"{Path(sys.argv[1]) / 'report.md'}: {perf_counter() - begun:.1f} s")
