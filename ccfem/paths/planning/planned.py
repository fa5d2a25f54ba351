"""Toolpaths of a part planned to a length of fibre."""

from dataclasses import dataclass

from ccfem.base.arrays import in_brief
from ccfem.paths.planning.strategy import Strategy
from ccfem.paths.toolpaths import Toolpaths


@dataclass(frozen=True)
class Planned:
    """Toolpaths of a part, and the strategy that made them.

    Attributes
    ----------
    strategy : Strategy
        With the values found (for most layers, see `note`).
    length_per_layer : float, mm
        Fibre length divided by the number of layers.
    note : str
        Empty, or one line: which layers have another value, or why the wanted length was missed.
    reached : bool
        Whether the plan lays the wanted length within the tolerance
        (`ccfem.paths.planning.equal_fibre`).
    """

    strategy: Strategy
    toolpaths: Toolpaths
    length_per_layer: float
    note: str = ""
    reached: bool = True

    __repr__ = in_brief
