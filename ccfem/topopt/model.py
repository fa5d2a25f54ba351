"""What an optimisation asks of the compliance of a part, and what it is told."""

from collections.abc import Mapping
from typing import NamedTuple, Protocol

from ccfem.arrays import FloatArray

__all__ = ["ComplianceModel", "OrientableModel", "Response"]


class Response(NamedTuple):
    """Response of a part to its load cases.

    Attributes
    ----------
    cases : dict of load case name to float, N mm
        Compliance under each: the work of its loads, ``f . u``.
    compliance : float, N mm
        Their weighted sum.
    energy : (m,) array, N mm
        Weighted ``u^T k u`` of each cell at full density.
    displacement : dict of load case name to (n, d) array, mm
    """

    cases: dict[str, float]
    compliance: float
    energy: FloatArray
    displacement: dict[str, FloatArray]


class ComplianceModel(Protocol):
    """Compliance of a part by a factor on the stiffness of each of m cells, or groups of cells."""

    @property
    def centres(self) -> FloatArray:
        """Centre of each cell, (m, d), mm."""
        ...

    @property
    def volumes(self) -> FloatArray:
        """Volume of each cell, (m,), mm^3."""
        ...

    def __call__(self, factor: FloatArray) -> Response:
        """Response with a factor (m,) in (0, 1] on the stiffness of each cell."""
        ...


class OrientableModel(ComplianceModel, Protocol):
    """A compliance whose cells may take another stiffness, such as that of a turned material.

    A stiffness is a (m, k, k) array, MPa, of full density in the global axes: k is 3 for plates, 6
    for tetrahedra.
    """

    @property
    def weights(self) -> Mapping[str, float]:
        """Weight of each load case in the compliance."""
        ...

    def __call__(self, factor: FloatArray, stiffness: FloatArray | None = None) -> Response:
        """Response with factors (m,), and where given with another stiffness than the problem's."""
        ...

    def energy(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Energy ``u^T k u`` of each cell, (m,), N mm, at a displacement (n, d)."""
        ...

    def stress(self, displacement: FloatArray, stiffness: FloatArray) -> FloatArray:
        """Mean stress [s11, s22, s12] of each cell in the x-y plane, (m, 3), MPa."""
        ...
