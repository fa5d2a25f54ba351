"""The whole of the paper: its study, figures, tables and claims beside ours."""

from pathlib import Path
from time import perf_counter

from ccfem.base.csv_table import write_csv
from ccfem.base.progress import Progress, silent
from ccfem.papers.plocher_2022.claims import quantities, raster_quantities, verdicts
from ccfem.papers.plocher_2022.figures import draw_all
from ccfem.papers.plocher_2022.study import RASTER, run_study
from ccfem.papers.plocher_2022.tables import (
    case_table,
    index_table,
    material_table,
    prototype_table,
    rank_table,
    result_table,
)
from ccfem.papers.plocher_2022.variants import (
    metric_table,
    try_variants,
    variant_quantities,
    variant_table,
)
from ccfem.papers.verdicts import claim_table

PROTOTYPE_NOTE = """\
Both chains follow the same rules; they share no code. Where they differ:

- The bitmap: here a pixel is solid where its centre lies in the section, with ties outside. The
  holes of I and II differ from the prototype's by a few pixels, which may be what moves the peak
  stress of 0/90 on case I; the outline of III is smoothed here.
- MAT: the medial axis is symmetric here; MAT of case II, which has most of it, agrees better.
- Paths over 40 mm and SI of raw pixels depend on the tracer. Here a ring stays one path where it
  can, so that concentric has more long paths; pixels at its sharp tips stay isolated, and diagonal
  steps cut its corners, so that raw chains wind less.
"""


def write_all(folder: Path, progress: Progress = silent) -> None:
    """Run the study, and write figures, tables and claims into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    begun = perf_counter()
    study = run_study(progress=progress)
    raster = run_study(patterns=RASTER, known=study, progress=progress)
    tried = try_variants()
    found = quantities(study) | raster_quantities(raster) | variant_quantities(tried)
    checks = verdicts(found)
    computed = perf_counter() - begun
    drawn = draw_all(study, raster, folder)
    rows = [
        [name, mode, pattern, k, f"{v:.8g}"]
        for mode, cases in (("polyline", study), ("raster", raster))
        for name, case in cases.items()
        for pattern, one in case.patterns.items()
        for k, v in one.values.items()
    ]
    write_csv(folder / "results.csv", ("case", "mode", "pattern", "index", "value"), rows)
    parts = [
        "# Infill patterns of Plocher, Wioland and Panesar (2022): ours beside theirs\n",
        "Written by `ccfem reproduce plocher_2022`.\n",
        f"Study {computed:.1f} s, figures {perf_counter() - begun - computed:.1f} s.\n",
        "## Claims\n",
        claim_table(checks),
        *(
            f"## Case {name}, polylines\n\n{result_table(study[name])}\n"
            f"## Case {name}, pixels\n\n{result_table(raster[name])}"
            for name in study
        ),
        f"## Pixels beside a prototype (in brackets)\n\n{prototype_table(raster)}",
        PROTOTYPE_NOTE,
        f"## Rings of pixels by metric: SI of raw pixels\n\n{metric_table(raster)}",
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
    print(f"report.md: {perf_counter() - begun:.1f} s")
