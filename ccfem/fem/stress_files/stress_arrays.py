"""Stress as a file of another program holds it, before it is mapped to a mesh."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from ccfem.base.arrays import FloatArray, IntArray, freeze
from ccfem.base.errors import InputError

COMPONENTS = ("xx", "yy", "zz", "yz", "xz", "xy")
"""Voigt components in their order."""


@dataclass(frozen=True)
class StressData:
    """Stress at nodes, in cells, or both.

    Attributes
    ----------
    points : (n, 3) array, or None
        Nodes, mm; None where the file has numbers only, and these are those of the mesh.
    corners : tuple of (c, k) int arrays, or None
        Corner nodes of the cells, 4, 5, 6 or 8 each, in blocks.
    nodal : (n, 6) array, or None
        Voigt.
    cell : (c, 6) array, or None
        Voigt, of all blocks of cells.
    unit : str
        Of the stress, as the file says; empty where it does not.
    nodes, cells : (n,) and (c,) int array, or None
        Numbers by which the file calls its nodes and cells; None where it counts them from 0.
    chosen : str
        Which of several results of the file it is.
    usual : (unit, reason)
        Unit that the program which wrote the file takes, where the file does not say it.
    """

    points: FloatArray | None
    corners: tuple[IntArray, ...] | None
    nodal: FloatArray | None
    cell: FloatArray | None
    unit: str = ""
    nodes: IntArray | None = None
    cells: IntArray | None = None
    chosen: str = ""
    usual: tuple[str, str] = ("", "")

    def __post_init__(self) -> None:
        freeze(self, points=float, corners=tuple, nodal=float, cell=float, nodes=int, cells=int)


def component_of(name: str) -> int:
    """Voigt component that xx, Sxx, sigma_xz, S11, SZX or Stress xx component is; -1 for none."""
    letters = re.sub(r"[^a-z0-9]", "", name.lower())
    match = re.fullmatch(r"(?:s|sig|sigma|stress|t)?([xyz123]{2})(?:component)?", letters)
    if match is None:
        return -1
    pair = "".join(sorted(match[1].translate(str.maketrans("123", "xyz"))))
    return COMPONENTS.index(pair)


def component_order(names: Sequence[str], what: str) -> list[int]:
    """Column of each Voigt component by the names of the columns."""
    components = [component_of(name) for name in names]
    if sorted(k for k in components if k >= 0) != list(range(6)):
        given = ", ".join(repr(name) for name in names)
        raise InputError(
            f"{what} must name the components xx, yy, zz, yz, xz and xy, each once (as Sxx or S11 "
            f"too); got {given}: name them"
        )
    return [components.index(k) for k in range(6)]
