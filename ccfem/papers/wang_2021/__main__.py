"""Run the study, and write its figures, tables and the claims beside ours.

python -m ccfem.papers.wang_2021 FOLDER
"""

import csv
import sys
from pathlib import Path
from time import perf_counter

from ccfem.evaluation.matching import READINGS, THRESHOLDS
from ccfem.papers.verdicts import claim_table
from ccfem.papers.wang_2021.claims import quantities, verdicts
from ccfem.papers.wang_2021.figures import draw_all
from ccfem.papers.wang_2021.study import run_study
from ccfem.papers.wang_2021.tables import plate_table, result_table, speed_table
from ccfem.papers.wang_2021.variants import (
    try_hole,
    try_radii,
    variant_quantities,
    variant_table,
)


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    begun = perf_counter()
    study = run_study()
    tried = try_radii(study)
    found = quantities(study) | variant_quantities(tried, try_hole())
    checks = verdicts(found)
    computed = perf_counter() - begun
    drawn = draw_all(study, folder)
    with (folder / "rates.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["plate", "part", "pattern", "reading", *(f"{t:g}" for t in THRESHOLDS)])
        for name, plate in study.items():
            for which, part in (("optimised", plate.optimised), ("full", plate.original)):
                for pattern, one in part.patterns.items():
                    for reading in READINGS:
                        values = [f"{v:.6g}" for v in one.rates[reading]]
                        writer.writerow([name, which, pattern, reading, *values])
    with (folder / "quantities.csv").open("w", newline="") as file:
        csv.writer(file).writerows([("quantity", "value"), *found.items()])
    parts = [
        "# Load-dependent paths of Wang et al. (2021): ours beside theirs\n",
        "Written by `python -m ccfem.papers.wang_2021`. lpp is strategy `svt`; lpp uncrossed "
        "ends its strands in the middle of a joint. The slicer's patterns and lpp uncrossed are "
        "laid by this project too.\n",
        f"Study {computed:.1f} s, figures {perf_counter() - begun - computed:.1f} s.\n",
        "## Claims\n",
        claim_table(checks),
        f"## Plates\n\n{plate_table(study)}",
        *(f"## {name}\n\n{result_table(plate)}" for name, plate in study.items()),
        f"## Radius of the turns\n\n{variant_table(tried)}",
        f"## Table 2: speeds\n\n{speed_table()}",
        "## Figures\n",
        *(f"![{name}]({name})\n" for name in drawn),
    ]
    (folder / "report.md").write_text("\n".join(parts))
    print(claim_table(checks))
    print(f"{folder / 'report.md'}: {perf_counter() - begun:.1f} s")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m ccfem.papers.wang_2021 FOLDER")
    main(Path(sys.argv[1]))
