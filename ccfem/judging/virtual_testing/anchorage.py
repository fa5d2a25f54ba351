"""Strands beside a hole: what they hold once the matrix there has cracked, until they pull out.

A strand that crosses the net section of a hole holds until it breaks, or until the shorter of its
two sides pulls out of the matrix: at a shear stress that is even along it (Kelly and Tyson, J.
Mechanics and Physics of Solids 13, 1965, 329-350), as short pieces are known to do.
"""

from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.judging.virtual_testing.strands import Strands
from ccfem.machine.machine import Machine

PULL_OUT_STRENGTH = 18.6
"""Shear stress, MPa, at which a strand is pulled out of its matrix: of carbon strands printed in
PETG, 18.6 with a standard deviation of 1.2, pulled out from 1 to 50 mm; from 4.9 mm on they broke
(doi.org/10.1177/08927057251408473). For other matrices no value is known here."""


@dataclass(frozen=True)
class Anchorage:
    """Strands, and how much force a length of them takes up from the matrix.

    Attributes
    ----------
    strands : Strands
        Where their `share` is 0 they end.
    flow : float, N/mm
        Largest force a length that the bond passes on.
    """

    strands: Strands
    flow: float

    @classmethod
    def of(cls, strands: Strands, machine: Machine) -> "Anchorage":
        """Strands as wide and high as a machine lays them, bonded all round."""
        girth = 2.0 * (machine.fibre_width + machine.strand_height)
        return cls(strands, PULL_OUT_STRENGTH * girth)

    def held(
        self, centre: FloatArray, frame: FloatArray, reach: FloatArray, strength: float
    ) -> float:
        """Force, N, that strands hold across a part of a plane.

        Parameters
        ----------
        centre : (3,) array, mm
            In the plane.
        frame : (3, 3) array
            Unit vectors in its rows: the normal of the plane, and two in it.
        reach : (q, 4) array, mm
            Rectangles of the plane: first and last along the one, first and last along the other.
        strength : float, N
            Of a strand.
        """
        strands = self.strands
        at = (strands.middle - centre) @ frame.T
        first, share = self._crossings(at[:, 0])
        if not len(first):
            return 0.0
        step = at[first + 1] - at[first]
        place = (at[first] + share[:, None] * step)[:, None, 1:]
        low, high = reach[None, :, ::2], reach[None, :, 1::2]
        inside = np.any(np.all((place > low) & (place < high), axis=2), axis=1)
        along = np.abs(step[:, 0]) / np.linalg.norm(step, axis=1)
        arc = strands.arc[first] + share * (strands.arc[first + 1] - strands.arc[first])
        begin, end = self._runs(first)
        bedded = np.minimum(arc - begin, end - arc)
        force = np.minimum(strength, self.flow * bedded) * along * strands.share[first]
        return float(force[inside].sum())

    def _crossings(self, height: FloatArray) -> tuple[IntArray, FloatArray]:
        """Pieces after whose middle a strand crosses a plane, and the way there to the next."""
        strands = self.strands
        same = (strands.path[1:] == strands.path[:-1]) & (self._carrying[1:] & self._carrying[:-1])
        first = np.flatnonzero(same & ((height[1:] > 0.0) != (height[:-1] > 0.0)))
        return first, height[first] / (height[first] - height[first + 1])

    @property
    def _carrying(self) -> BoolArray:
        return np.asarray(self.strands.share > 0.0)

    def _runs(self, pieces: IntArray) -> tuple[FloatArray, FloatArray]:
        """Arc lengths at which the stretches of carrying strand begin and end that hold pieces."""
        strands, carrying = self.strands, self._carrying
        new = np.ones(len(carrying), dtype=bool)
        new[1:] = (strands.path[1:] != strands.path[:-1]) | (carrying[1:] != carrying[:-1])
        starts = np.flatnonzero(new)
        run = np.searchsorted(starts, pieces, side="right") - 1
        begin, end = starts[run], np.append(starts[1:], len(carrying))[run] - 1
        half = self._half_lengths()
        return strands.arc[begin] - half[begin], strands.arc[end] + half[end]

    def _half_lengths(self) -> FloatArray:
        """Half the length of strand in which each piece lies, mm: cells share what is in a face."""
        strands = self.strands
        new = np.ones(len(strands.arc), dtype=bool)
        new[1:] = strands.path[1:] != strands.path[:-1]
        new[1:] |= np.abs(np.diff(strands.arc)) > 1e-6 * strands.length[1:]
        starts = np.flatnonzero(new)
        half: FloatArray = 0.5 * np.add.reduceat(strands.length, starts)[np.cumsum(new) - 1]
        return half
