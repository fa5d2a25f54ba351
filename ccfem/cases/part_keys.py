"""The keys at the top of a part file."""

from dataclasses import dataclass, field
from typing import Any

from ccfem.body.mesh.patches import Vector
from ccfem.cases.part_body import Body


@dataclass(frozen=True, kw_only=True)
class Part(Body):
    """The keys of a part file.

    Attributes
    ----------
    material : str or table
        A name of the table of materials, or moduli.
    supports : tuple of tables
        What holds the part; at least one. With ``case`` one holds in these load cases alone.
    loads : dict
        The load cases by name, each a list of loads; at least one.
    alternative_supports : tuple of tables
        Another model of how the part is held. Strategies are tested under both, and no ranking is
        stated on which the two disagree.
    combinations : dict
        Load cases that are sums of others times factors.
    weights : dict
        Weight of each load case when all are planned for together (``--load-case all``). Cases
        that are not named do not count. Without weights all cases but combinations count equally.
    regions : dict
        Cells of another material.
    name : str
        Name of the part; by default that of the file.
    title : str
        One line for tables and reports; by default the name.
    source : str
        Where the part comes from.
    build : str or tuple of 3 floats
        Build direction.
    layers : int
        Number of flat layers of fibre, spread evenly over the height.
    heights : tuple of floats, mm
        Heights of flat layers along the build direction, in place of their number.
    slicing : table
        A slicer with its parameters, in place of layers and heights; without any of the three,
        12 flat layers.
    fibre : table
        Which of the layers, and which regions of them, get fibre; by default all.
    patches : dict
        Patches of the boundary, each by a rule. Groups of a mesh file are patches already.
    machine : table
        Values that differ from the default printer.
    strategies : dict
        Parameters of strategies on this part.
    """

    material: str | dict[str, Any] | None = None
    supports: tuple[dict[str, Any], ...] = ()
    loads: dict[str, Any] = field(default_factory=dict)
    alternative_supports: tuple[dict[str, Any], ...] = ()
    combinations: dict[str, Any] = field(default_factory=dict)
    weights: dict[str, Any] = field(default_factory=dict)
    regions: dict[str, Any] = field(default_factory=dict)
    name: str = ""
    title: str = ""
    source: str = ""
    build: str | Vector = "z"
    layers: int | None = None
    heights: tuple[float, ...] | None = None
    slicing: dict[str, Any] | None = None
    fibre: dict[str, Any] | None = None
    patches: dict[str, Any] = field(default_factory=dict)
    machine: dict[str, Any] = field(default_factory=dict)
    strategies: dict[str, Any] = field(default_factory=dict)
