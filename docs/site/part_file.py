"""Page of the part file: its keys, from the code that reads them."""

from keys import keys, kinds

from ccfem.cases import part_file as reader
from ccfem.cases.part_fibre import FIBRE_REGIONS
from ccfem.cases.part_file import REGIONS
from ccfem.cases.part_keys import Part
from ccfem.cases.part_loads import LOADS, SUPPORTS
from ccfem.cases.part_tables import RULES
from ccfem.fem.materials import isotropic, material_names, transversely_isotropic
from ccfem.judging.virtual_testing.scatter import Scatter
from ccfem.machine import (
    Costs,
    GcodeProfile,
    Kinematics,
    Limits,
    Machine,
    Process,
    SpeedTable,
    Spools,
)
from ccfem.paths.placement import FibrePlaces, FibreRegion
from ccfem.paths.plastic import Plastic
from ccfem.printing.bed_layout import BedTable

__all__ = ["part_file_page"]


def part_file_page() -> str:
    """Write the page: the example of the reader's documentation, then every table."""
    about = (reader.__doc__ or "").rpartition(" All keys stand in")[0]
    names = ", ".join(f"`{name}`" for name in material_names())
    parts = (
        f"# Part file\n\n{about}\n\n",
        f"## Keys at the top\n\n{keys(Part)}",
        f"## Bed `[bed]`\n\n{keys(BedTable)}",
        f"## Material\n\n`material` is one of {names}, or a table.\n\n",
        f"### Isotropic\n\n{keys(isotropic)}",
        f"### Transversely isotropic\n\n{keys(transversely_isotropic)}",
        f"## Patches `[patches.NAME]`\n\n{kinds('rule', RULES)}",
        f"## Supports `[[supports]]`\n\n{kinds('kind', SUPPORTS)}",
        f"## Loads `[[loads.CASE]]`\n\n{kinds('kind', LOADS)}",
        f"## Regions `[regions.NAME]`\n\n{kinds('rule', REGIONS)}",
        f"## Fibre `[fibre]`\n\n{_fibre()}",
        f"## Plastic `[plastic]`\n\n{keys(Plastic)}",
        f"## Scatter `[scatter]`\n\n{keys(Scatter)}",
        f"## Machine `[machine]`\n\n{keys(Machine)}",
        f"### Limits `[machine.limits]`\n\n{keys(Limits)}",
        f"### Speeds `[machine.speeds]`\n\n{keys(SpeedTable)}",
        f"### Process `[machine.process]`\n\n{keys(Process)}",
        f"### Kinematics `[machine.kinematics]`\n\n{keys(Kinematics)}",
        f"### G-code `[machine.gcode]`\n\n{keys(GcodeProfile)}",
        f"### Spools `[machine.spools]`\n\n{keys(Spools)}",
        f"### Costs `[machine.costs]`\n\n{keys(Costs)}",
        "## Strategies `[strategies.NAME]`\n\nThe parameters of a [strategy](strategies.md) on "
        "this part.\n\n## Slicing `[slicing]`\n\n`method`, the name of a [slicer](slicers.md), and "
        "its parameters.\n\n",
        f"## All of it in one example\n\n```toml\n{reader.ALL_KEYS.strip()}\n```\n",
    )
    return "".join(parts)


def _fibre() -> str:
    """Write the tables of which layers and regions get fibre; `from` and `to` are their keys."""
    own, rules = (
        "".join(
            line
            for line in keys(make).splitlines(keepends=True)
            if not line.startswith(("| `regions`", "| `shape`"))
        )
        for make in (FibrePlaces, FibreRegion)
    )
    own = own.replace("from_height", "from").replace("to_height", "to")
    shapes = "".join(
        f'#### `rule = "{name}"` {{ #fibre-rule-{name} }}\n\n'
        + ("`file`, a closed surface.\n\n" if name == "body" else keys(make))
        for name, make in FIBRE_REGIONS.items()
    )
    return f"{own}### Regions `[[fibre.regions]]`\n\n{rules}{shapes}"
