"""Groups of cells that share their variables, such as the columns of a plate of tetrahedra."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ccfem.arrays import IntArray
from ccfem.errors import InputError
from ccfem.topopt.design import Design

__all__ = ["CellGroups"]


@dataclass(frozen=True)
class CellGroups:
    """Groups of cells, numbered from 0 without gaps.

    Attributes
    ----------
    member : (m,) int array
        Group of each cell.
    first : (g,) int array
        A cell of each group.
    """

    member: IntArray
    first: IntArray

    @classmethod
    def of_cells(cls, groups: ArrayLike, m: int) -> "CellGroups":
        """Gather m cells by their number, which may be any."""
        given = np.asarray(groups)
        if given.shape != (m,) or not np.issubdtype(given.dtype, np.integer):
            raise InputError(f"groups must be {m} integers, one a cell; got shape {given.shape}")
        _, first, member = np.unique(given, return_index=True, return_inverse=True)
        return cls(member.reshape(-1), first)

    def reduced(self, name: str, values: ArrayLike | None) -> Any:
        """Values of each group from values (m,) of the cells, named in errors; None stays."""
        if values is None:
            return None
        if np.shape(values) != self.member.shape:
            raise InputError(
                f"{name} must have one entry a cell ({len(self.member)}); got shape "
                f"{np.shape(values)}"
            )
        found = np.asarray(values)[self.first]
        if (found[self.member] != np.asarray(values)).any():
            raise InputError(f"{name} must be the same in all cells of a group: correct it")
        return found

    def expanded(self, design: Design) -> Design:
        """Return the design of the cells from that of the groups."""
        return replace(
            design,
            density=design.density[self.member],
            variables=design.variables[self.member],
            factor=design.factor[self.member],
        )
