"""What of Kipping and Schueppstuhl 2023 can be made again."""

from collections.abc import Mapping

from ccfem.base.progress import Progress
from ccfem.papers.contents import Contents, WhenAsked
from ccfem.papers.kipping_2023.chain import PARTS, Chain, chain, table_1, table_2
from ccfem.papers.kipping_2023.claims import support_table
from ccfem.papers.kipping_2023.fiso_shapes import shapes_table
from ccfem.papers.kipping_2023.strength import failure_loads, on_pressing_supports, strength_table
from ccfem.papers.kipping_2023.whole import write_all


def _run(progress: Progress) -> Mapping[str, Chain]:
    """Both parts, from stress to paths."""
    return WhenAsked(tuple(PARTS), lambda part: chain(PARTS[part]), progress, "planning part")


def _strength(chains: Mapping[str, Chain]) -> str:
    loads = {part: failure_loads(run) for part, run in chains.items()}
    loads["B, pressed"] = failure_loads(chains["B"], on_pressing_supports(chains["B"]))
    return strength_table(loads)


CONTENTS = Contents(
    title="Kipping and Schueppstuhl 2023, layers square to the least stress",
    seconds=600.0,
    run=_run,
    whole=write_all,
    tables={
        "table1": lambda study: table_1(study()),
        "table2": lambda study: table_2(study()),
        "support": lambda study: support_table(study()),
        "strength": lambda study: _strength(study()),
        "fiso": lambda study: shapes_table()[0],
    },
)
