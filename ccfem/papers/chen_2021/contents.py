"""What of Chen et al. 2021 can be made again."""

from ccfem.papers.chen_2021.claims import quantities, verdicts
from ccfem.papers.chen_2021.figures import figures
from ccfem.papers.chen_2021.study import run_study
from ccfem.papers.chen_2021.tables import length_table, time_table
from ccfem.papers.chen_2021.whole import write_all
from ccfem.papers.contents import Contents
from ccfem.papers.verdicts import claim_table

CONTENTS = Contents(
    title="Chen et al. 2021, field-based toolpaths",
    seconds=90.0,
    run=lambda progress: run_study(progress=progress),
    whole=write_all,
    tables={
        "claims": lambda study: claim_table(verdicts(quantities(study()))),
        "table1": lambda study: time_table(study()),
        "table2": lambda study: length_table(study(), quantities(study())),
    },
    figures=figures,
    numbers=(4, 5, 6, 7, 8, 9, 10, 14),
)
