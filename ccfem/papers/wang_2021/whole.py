"""The whole of the paper: its study, figures, tables and claims beside ours."""

from pathlib import Path
from time import perf_counter

from ccfem.base.csv_table import write_csv
from ccfem.base.progress import Progress, silent
from ccfem.judging.evaluation.indices.matching import READINGS, THRESHOLDS
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


def write_all(folder: Path, progress: Progress = silent) -> None:
    """Run the study, and write figures, tables and claims into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    begun = perf_counter()
    study = run_study(progress=progress)
    tried = try_radii(study)
    found = quantities(study) | variant_quantities(tried, try_hole())
    checks = verdicts(found)
    computed = perf_counter() - begun
    drawn = draw_all(study, folder)
    rates = [
        [name, which, pattern, reading, *(f"{v:.6g}" for v in one.rates[reading])]
        for name, plate in study.items()
        for which, part in (("optimised", plate.optimised), ("full", plate.original))
        for pattern, one in part.patterns.items()
        for reading in READINGS
    ]
    columns = ["plate", "part", "pattern", "reading", *(f"{t:g}" for t in THRESHOLDS)]
    write_csv(folder / "rates.csv", columns, rates)
    write_csv(folder / "quantities.csv", ("quantity", "value"), found.items())
    parts = [
        "# Load-dependent paths of Wang et al. (2021): ours beside theirs\n",
        "Written by `ccfem reproduce wang_2021`. lpp is strategy `svt`; lpp uncrossed "
        "ends its strands in the middle of a joint. The slicer's patterns and lpp uncrossed are "
        "laid by this project too.\n",
        "The cantilever, the M-shape and the L-shape are optimised here under loads as in the "
        "paper, which gives no measures: their outlines are ours. The M-shape hangs its load "
        "between its feet, so that members are in tension and in compression, as the paper's are. "
        "`eqs` is our reading of a method that the paper shows in pictures alone.\n",
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
    print(f"report.md: {perf_counter() - begun:.1f} s")
