"""Groups of cells that share their variables, such as the columns of a plate of tetrahedra."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.base.errors import InputError

EntryT = TypeVar("EntryT", bound=np.generic)


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
    def of_cells(cls, groups: ArrayLike | None, m: int) -> "CellGroups":
        """Gather m cells by their number, which may be any; None leaves each by itself."""
        given = np.arange(m) if groups is None else np.asarray(groups)
        if given.shape != (m,) or not np.issubdtype(given.dtype, np.integer):
            raise InputError(f"groups must be {m} integers, one a cell; got shape {given.shape}")
        _, first, member = np.unique(given, return_index=True, return_inverse=True)
        return cls(member.reshape(-1), first)

    def sum(self, values: FloatArray) -> FloatArray:
        """Sum values (m,) of the cells over each group, (g,)."""
        return np.bincount(self.member, values).astype(np.float64)

    def mean(self, values: FloatArray, volumes: FloatArray) -> FloatArray:
        """Mean of values (m, k) of the cells over each group by volume, (g, k)."""
        if len(self.first) == len(self.member):
            return values[self.first]
        sums = [self.sum(volumes * column) for column in values.T]
        return np.stack(sums, axis=1) / self.sum(volumes)[:, None]

    def reduced(self, name: str, values: NDArray[EntryT]) -> NDArray[EntryT]:
        """Values (g,) of the groups from values (m,) of the cells, which are named in errors."""
        values = np.asarray(values)
        if values.shape != self.member.shape:
            raise InputError(
                f"{name} must have shape {self.member.shape}, one entry a cell; got {values.shape}"
            )
        reduced = values[self.first]
        if (reduced[self.member] != values).any():
            raise InputError(
                f"{name} must be the same in all cells of a group: give each group one value"
            )
        return reduced
