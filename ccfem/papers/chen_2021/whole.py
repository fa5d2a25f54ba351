"""The whole of the paper: its study, figures, tables and claims beside ours."""

from pathlib import Path

from ccfem.base.csv_table import write_csv
from ccfem.base.progress import Progress, silent
from ccfem.papers.chen_2021.claims import quantities, verdicts
from ccfem.papers.chen_2021.figures import draw_all
from ccfem.papers.chen_2021.study import PARTS_AT_HAND, Study, run_study
from ccfem.papers.chen_2021.tables import length_table, time_table
from ccfem.papers.verdicts import claim_table


def write(study: Study, folder: Path) -> str:
    """Write everything into a folder; returns the table of claims."""
    folder.mkdir(parents=True, exist_ok=True)
    found = quantities(study)
    claims = claim_table(verdicts(found))
    drawn = draw_all(study, folder)
    write_csv(folder / "quantities.csv", ("quantity", "value"), found.items())
    parts = [
        "# Field-based toolpaths of Chen et al. (2021): ours beside theirs\n",
        "Written by `ccfem reproduce chen_2021`. The algorithm is the published one. "
        f"Part: {study.loop.case.title}. {PARTS_AT_HAND}\n",
        f"## Claims\n\n{claims}",
        f"## Table 1: times\n\n{time_table(study)}",
        f"## Table 2: fibre and stiffness\n\n{length_table(study, found)}",
        "## Figures\n",
        *(f"![{name}]({name})\n" for name in drawn),
    ]
    (folder / "report.md").write_text("\n".join(parts))
    return claims


def write_all(folder: Path, progress: Progress = silent) -> None:
    """Run the study, and write figures, tables and claims into a folder."""
    print(write(run_study(progress=progress), folder))
