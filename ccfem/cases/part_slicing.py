"""The slicer of a part file."""

from ccfem.base.errors import InputError
from ccfem.cases.part_keys import Part
from ccfem.cases.part_tables import named_table
from ccfem.slicing import slicers as slicers
from ccfem.slicing.layers.slicer import Slicer
from ccfem.slicing.slicers.planar import Planar


def slicing_of(part: Part) -> Slicer:
    """Slicer of a part file: of its number of layers, their heights, or the table slicing.

    Raises
    ------
    InputError
    """
    given = [key for key in ("layers", "heights", "slicing") if getattr(part, key) is not None]
    if len(given) > 1:
        raise InputError(
            f"a part needs one of layers, heights and slicing; got {' and '.join(given)}: choose "
            "one"
        )
    if part.slicing is not None:
        return slicers.create(*named_table(part.slicing, "method", slicers.named(), "slicing"))
    return Planar(count=part.layers, heights=part.heights)
