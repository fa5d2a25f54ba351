"""What of Plocher et al. 2022 can be made again."""

from collections.abc import Mapping

from ccfem.base.progress import Progress
from ccfem.papers.contents import Contents
from ccfem.papers.plocher_2022.claims import quantities, raster_quantities, verdicts
from ccfem.papers.plocher_2022.figures import figures
from ccfem.papers.plocher_2022.study import RASTER, CaseStudy, run_study
from ccfem.papers.plocher_2022.tables import case_table, index_table, material_table
from ccfem.papers.plocher_2022.whole import write_all
from ccfem.papers.verdicts import claim_table

_Both = tuple[Mapping[str, CaseStudy], Mapping[str, CaseStudy]]


def _run(progress: Progress) -> _Both:
    """Study on polylines, and on pixels."""
    study = run_study(progress=progress)
    return study, run_study(patterns=RASTER, known=study, progress=progress)


def _claims(study: _Both) -> str:
    """Claims, but for those that need the variants, which take as long again."""
    return claim_table(verdicts(quantities(study[0]) | raster_quantities(study[1])))


CONTENTS = Contents(
    title="Plocher et al. 2022, infill patterns",
    seconds=60.0,
    run=_run,
    whole=write_all,
    tables={
        "claims": lambda study: _claims(study()),
        "table2": lambda study: index_table(),
        "table3": lambda study: case_table(study()[0]),
        "table5": lambda study: material_table(),
    },
    figures=lambda study, number: figures(study[0], study[1], number),
    numbers=(2, 3, 4, 6, 7, 8, 9, 10, 11, 12, 13, 14),
)
