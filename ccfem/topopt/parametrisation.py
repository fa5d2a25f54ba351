"""Penalised densities: from the variables of an optimiser to stiffness, and gradients back."""

from dataclasses import dataclass

import numpy as np

from ccfem.arrays import BoolArray, FloatArray
from ccfem.errors import InputError
from ccfem.topopt.compliance import GroupedCompliance, PlaneCompliance, TetCompliance
from ccfem.topopt.filters import ConeFilter

__all__ = ["FILTERS", "Parametrisation", "parametrise", "simp_factor"]

FILTERS = ("sensitivity", "density")


def simp_factor(
    density: FloatArray, penalty: float = 3.0, least: float = 1e-9
) -> tuple[FloatArray, FloatArray]:
    """Factor (m,) on the stiffness, and its derivative by the density (m,).

    ``least + density**penalty * (1 - least)`` (Sigmund, Struct. Multidisc. Optim. 33 (2007) 401).
    """
    factor = least + density**penalty * (1.0 - least)
    return factor, penalty * density ** (penalty - 1.0) * (1.0 - least)


@dataclass(frozen=True)
class Parametrisation:
    """How variables become densities and stiffness, with the gradients back.

    Attributes
    ----------
    cone : ConeFilter
    filter : str
        One of `FILTERS`.
    penalty, least : float
        Of `simp_factor`.
    solid, void : (m,) bool arrays
        Cells whose density stays 1 or 0.
    """

    cone: ConeFilter
    filter: str
    penalty: float
    least: float
    solid: BoolArray
    void: BoolArray

    @property
    def free(self) -> BoolArray:
        """Cells whose density is to be found, (m,)."""
        return ~(self.solid | self.void)

    def density(self, variables: FloatArray) -> FloatArray:
        """Densities (m,) of the variables (m,)."""
        density = self.cone.average(variables) if self.filter == "density" else variables.copy()
        density[self.solid], density[self.void] = 1.0, 0.0
        return density

    def gradient(self, density: FloatArray, energy: FloatArray) -> FloatArray:
        """Differentiate the compliance by the variables, exactly: (m,) array.

        Parameters
        ----------
        density : (m,) array
        energy : (m,) array, N mm
            ``u^T k u`` of each cell at full density.
        """
        _, slope = simp_factor(density, self.penalty, self.least)
        own = np.where(self.free, -slope * energy, 0.0)
        return self.cone.transposed(own) if self.filter == "density" else own

    def volume_gradient(self) -> FloatArray:
        """Differentiate the volume by the variables: (m,) array, mm^3."""
        own = np.where(self.free, self.cone.volumes, 0.0)
        return self.cone.transposed(own) if self.filter == "density" else own


def parametrise(
    model: PlaneCompliance | TetCompliance | GroupedCompliance,
    volume_fraction: float,
    penalty: float,
    radius: float,
    filter: str,
    solid: BoolArray | None,
    void: BoolArray | None,
    least: float,
) -> Parametrisation:
    """Check the parameters of an optimisation and make its filter."""
    m = len(model.volumes)
    if not 0.0 < volume_fraction < 1.0 or not penalty >= 1.0 or not 0.0 < least < 1.0:
        raise InputError(
            f"expected 0 < volume fraction < 1, penalty >= 1 and 0 < least < 1; got "
            f"{volume_fraction}, {penalty} and {least}"
        )
    if filter not in FILTERS:
        raise InputError(f"no filter named '{filter}'; there are: {', '.join(FILTERS)}")
    passive = []
    for name, chosen in (("solid", solid), ("void", void)):
        mask = np.zeros(m, dtype=bool) if chosen is None else np.asarray(chosen)
        if mask.shape != (m,) or mask.dtype != np.bool_:
            raise InputError(f"{name} must be a bool array of shape ({m},); got {mask.shape}")
        passive.append(mask)
    if (passive[0] & passive[1]).any():
        raise InputError("a cell cannot be both solid and void: correct the masks")
    filled, empty = (float(model.volumes[mask].sum()) for mask in passive)
    total = float(model.volumes.sum())
    if not filled < volume_fraction * total < total - empty:
        raise InputError(
            f"volume fraction {volume_fraction} cannot be met: solid cells fill "
            f"{filled / total:.3g} and void cells {empty / total:.3g} of the volume"
        )
    cone = ConeFilter.of_cells(model.centres, model.volumes, radius)
    return Parametrisation(cone, filter, penalty, least, *passive)
