"""What of Wang et al. 2021 can be made again."""

from ccfem.papers.contents import Contents
from ccfem.papers.verdicts import claim_table
from ccfem.papers.wang_2021.claims import quantities, verdicts
from ccfem.papers.wang_2021.figures import figures
from ccfem.papers.wang_2021.study import run_study
from ccfem.papers.wang_2021.tables import plate_table, speed_table
from ccfem.papers.wang_2021.whole import write_all

CONTENTS = Contents(
    title="Wang et al. 2021, load-dependent path planning",
    seconds=120.0,
    run=lambda progress: run_study(progress=progress),
    whole=write_all,
    tables={
        "claims": lambda study: claim_table(verdicts(quantities(study()))),
        "table2": lambda study: speed_table(),
        "plates": lambda study: plate_table(study()),
    },
    figures=figures,
    numbers=(3, *range(5, 18)),
)
