"""Where the knife comes behind a print: places at which strands cross the border of the part."""

from pathlib import Path

from ccfem.base.whole import whole_file
from ccfem.printing.print_plan import PrintPlan


def write_trims(path: str | Path, plan: PrintPlan) -> None:
    """Write the places as CSV: ``layer, x, y, z``, on the bed of the printer, mm.

    Raises
    ------
    InputError
        When the file cannot be written.
    """
    with whole_file(path) as temporary, temporary.open("w", encoding="ascii") as file:
        file.write("layer,x,y,z\n")
        for layer, x, y in plan.trims.tolist():
            file.write(f"{layer:.0f},{x:.3f},{y:.3f},{plan.top[int(layer)]:.3f}\n")
