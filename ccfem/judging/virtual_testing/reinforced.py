"""Stiffness of a part with its carrying fibres, applied without assembling a matrix."""

from dataclasses import dataclass

import scipy.sparse as sp

from ccfem.base.arrays import FloatArray
from ccfem.fem.elasticity.held import Held
from ccfem.judging.virtual_testing.bars import Bars


@dataclass(frozen=True)
class Reinforced:
    """Stiffness of a part and its fibres; ``@`` gives the forces of a displacement.

    Attributes
    ----------
    part : bsr_array (3n, 3n), N/mm
        Without fibres.
    stiffness : (s,) array, N
        EA of each piece of fibre that carries; zero of the others.
    """

    part: sp.bsr_array
    bars: Bars
    stiffness: FloatArray

    def __matmul__(self, displacement: FloatArray) -> FloatArray:
        """Return the forces (3n,), N, of a displacement (3n,), mm."""
        fibres = self.bars.forces(self.stiffness, displacement.reshape(-1, 3))
        fibres += (self.part @ displacement).reshape(-1, 3)
        return fibres.reshape(-1)


@dataclass(frozen=True)
class Reduced:
    """The same stiffness on the components that the supports leave free.

    Attributes
    ----------
    part : bsr_array (3k, 3k), N/mm
        Reduced matrix of the part without fibres.
    """

    part: sp.bsr_array
    whole: Reinforced
    held: Held

    def __matmul__(self, x: FloatArray) -> FloatArray:
        """Return the forces (3k,), N, of a solution (3k,), mm."""
        fibres = self.whole.bars.forces(self.whole.stiffness, self.held.motion(x))
        return self.part @ x + self.held.project(fibres)
