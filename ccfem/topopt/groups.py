"""Groups of cells that share their variables, such as the columns of a plate of tetrahedra."""

from dataclasses import dataclass, replace
from typing import TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ccfem.arrays import FloatArray, IntArray
from ccfem.errors import InputError
from ccfem.topopt.design import Design
from ccfem.topopt.model import OrientableModel, Response

__all__ = ["CellGroups", "GroupedCompliance"]

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
        if groups is None:
            return cls(np.arange(m), np.arange(m))
        given = np.asarray(groups)
        if given.shape != (m,) or not np.issubdtype(given.dtype, np.integer):
            raise InputError(f"groups must be {m} integers, one a cell; got shape {given.shape}")
        _, first, member = np.unique(given, return_index=True, return_inverse=True)
        return cls(member.reshape(-1), first)

    def of(self, model: OrientableModel) -> OrientableModel:
        """Return the compliance of the groups from that of the cells."""
        alone = np.array_equal(self.member, np.arange(len(self.member)))
        return model if alone else GroupedCompliance(model, self.member)

    @overload
    def reduced(self, name: str, values: NDArray[EntryT]) -> NDArray[EntryT]: ...

    @overload
    def reduced(self, name: str, values: NDArray[EntryT] | None) -> NDArray[EntryT] | None: ...

    def reduced(self, name: str, values: NDArray[EntryT] | None) -> NDArray[EntryT] | None:
        """Values of each group from values (m,) of the cells, named in errors; None stays."""
        if values is None:
            return None
        given = np.asarray(values)
        if given.shape != self.member.shape:
            raise InputError(
                f"{name} must have shape {self.member.shape}, one entry a cell; got {given.shape}"
            )
        found = given[self.first]
        if (found[self.member] != given).any():
            raise InputError(f"{name} must be the same in all cells of a group: correct it")
        return found

    def expanded(self, design: Design) -> Design:
        """Return the design of the cells from that of the groups."""
        return replace(
            design,
            density=design.density[self.member],
            variables=design.variables[self.member],
            factor=design.factor[self.member],
            angle=None if design.angle is None else design.angle[self.member],
        )


class GroupedCompliance:
    """Compliance of a part with one density for each group of its cells: an `OrientableModel`.

    Parameters
    ----------
    model : OrientableModel
        Of m cells.
    groups : (m,) int array
        Group of each cell, 0 to g - 1, none empty.
    """

    def __init__(self, model: OrientableModel, groups: IntArray) -> None:
        self._model, self._groups, self.weights = model, groups, model.weights
        self.volumes: FloatArray = np.bincount(groups, model.volumes).astype(np.float64)
        self.centres = self._mean(model.centres)

    def _sum(self, values: FloatArray) -> FloatArray:
        """Sum values (m,) over each group, (g,)."""
        return np.bincount(self._groups, values, len(self.volumes)).astype(np.float64)

    def _mean(self, values: FloatArray) -> FloatArray:
        """Mean of values (m, k) over each group by volume, (g, k)."""
        sums = [self._sum(self._model.volumes * column) for column in values.T]
        return np.stack(sums, axis=1) / self.volumes[:, None]

    def __call__(self, factor: FloatArray, stiffness: FloatArray | None = None) -> Response:
        """Response with a factor (g,), and where given a stiffness (g, k, k), of each group.

        Its energy is per group.
        """
        own = None if stiffness is None else stiffness[self._groups]
        response = self._model(factor[self._groups], own)
        return response._replace(energy=self._sum(response.energy))

    def energy(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Energy (g,), N mm, of a displacement (n, d) and a stiffness (g, k, k)."""
        return self._sum(self._model.energy(displacement, stiffness[self._groups]))

    def stress(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Mean stress (g, 3), MPa, in the x-y plane of each group."""
        return self._mean(self._model.stress(displacement, stiffness[self._groups]))
