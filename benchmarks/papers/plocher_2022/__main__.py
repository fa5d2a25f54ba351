"""Run the study, and write its figures, tables and the claims beside ours.

python -m benchmarks.papers.plocher_2022 FOLDER
"""

import csv
import sys
from pathlib import Path
from time import perf_counter

from benchmarks.papers.plocher_2022.claims import claim_table, quantities, verdicts
from benchmarks.papers.plocher_2022.figures import draw_all
from benchmarks.papers.plocher_2022.study import run_study
from benchmarks.papers.plocher_2022.tables import (
    case_table,
    index_table,
    material_table,
    rank_table,
    result_table,
)
from benchmarks.papers.plocher_2022.variants import try_variants, variant_quantities, variant_table


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    begun = perf_counter()
    study = run_study()
    tried = try_variants()
    found = quantities(study) | variant_quantities(tried, study)
    checks = verdicts(found)
    computed = perf_counter() - begun
    drawn = draw_all(study, folder)
    with (folder / "results.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["case", "pattern", "index", "value"])
        for name, case in study.items():
            for pattern, one in case.patterns.items():
                writer.writerows([name, pattern, k, f"{v:.8g}"] for k, v in one.values.items())
    parts = [
        "# Infill patterns of Plocher, Wioland and Panesar (2022): ours beside theirs\n",
        "Written by `python -m benchmarks.papers.plocher_2022`.\n",
        f"Study {computed:.1f} s, figures {perf_counter() - begun - computed:.1f} s.\n",
        "## Claims\n",
        claim_table(checks),
        *(f"## Case {name}\n\n{result_table(case)}" for name, case in study.items()),
        f"## Ranks of PI\n\n{rank_table(found)}",
        f"## Variants tried\n\n{variant_table(tried)}",
        f"## Table 2: indices\n\n{index_table()}",
        f"## Table 3: cases\n\n{case_table(study)}",
        f"## Table 5: materials\n\n{material_table()}",
        "## Figures\n",
        *(f"![{name}]({name})\n" for name in drawn),
    ]
    (folder / "report.md").write_text("\n".join(parts))
    print(claim_table(checks))
    print(f"{folder / 'report.md'}: {perf_counter() - begun:.1f} s")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m benchmarks.papers.plocher_2022 FOLDER")
    main(Path(sys.argv[1]))
