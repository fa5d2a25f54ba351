"""What of Fang et al. 2024 can be made again."""

from ccfem.papers.contents import Contents
from ccfem.papers.fang_2024.whole import write_all

CONTENTS = Contents(
    title="Fang et al. 2024, curved layers and winding strands",
    seconds=1800.0,
    whole=write_all,
    needs="CCFEM_FANG2024",
)
