"""How strands hold in the matrix: beside a hole that has cracked, and from their ends on.

A strand that crosses the net section of a hole holds until it breaks, or until the shorter of its
two sides pulls out of the matrix: at a shear stress that is even along it (Kelly and Tyson, J.
Mechanics and Physics of Solids 13, 1965, 329-350), as short pieces are known to do.

A strand that comes loose gives back the energy ``N^2 / (2 EA)`` a length, N the force that it
carried there, and its bond takes the energy of fracture a area times what it touches. So there is a
force at which an end of a strand goes on coming loose, whatever its length: the analysis of a fibre
that is pulled out of its matrix (Gao, Mai and Cotterell, J. Applied Mathematics and Physics 39,
1988, 550-572), without friction. A strand ends where its path does, at a fold and where it has
broken or come loose before.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.judging.virtual_testing.strands import AVERAGING_LENGTH, Strands
from ccfem.machine.machine import Machine

PULL_OUT_STRENGTH = 18.6
"""Shear stress, MPa, at which a strand is pulled out of its matrix: of carbon strands printed in
PETG, 18.6 with a standard deviation of 1.2, pulled out from 1 to 50 mm; from 4.9 mm on they broke
(doi.org/10.1177/08927057251408473). For other matrices no value is known here."""


@dataclass(frozen=True)
class Anchorage:
    """Strands, and how much force a length of them takes up from the matrix."""

    strands: Strands  # where their `share` is 0 they end
    flow: float  # N/mm: largest force a length that the bond passes on

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


# Strands that come loose from the matrix, from their ends on.


class Ends(NamedTuple):
    """Ends of strands: pieces from `first` up to `stop`, and the mean force in them, N; (e,)."""

    first: IntArray
    stop: IntArray
    force: FloatArray

    @classmethod
    def none(cls) -> "Ends":
        """Return no end at all."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))


@dataclass(frozen=True)
class StrandEnds:
    """Ends of the strands of a part, and the force that they pass on."""

    strands: Strands  # pieces whose `share` is 0, as in folds, are no part of a strand
    # mm: length from the end over which a force is averaged, and comes loose. Of shorter strands
    # all.
    length: float = AVERAGING_LENGTH

    def at(self, pull: FloatArray, intact: FloatArray) -> Ends:
        """Find the ends of what is left of the strands.

        Parameters
        ----------
        pull : (s,) array, N
            Axial force in the pieces.
        intact : (s,) array in [0, 1]
            Share of each piece that has not broken or come loose.
        """
        strands = self.strands
        whole = (strands.share > 0.0) & (intact > 0.5)
        bound = np.ones(len(whole) + 1, dtype=bool)
        bound[1:-1] = strands.path[1:] != strands.path[:-1]
        before, after = np.append(False, whole[:-1]), np.append(whole[1:], False)
        first = np.flatnonzero(whole & (bound[:-1] | ~before))
        last = np.flatnonzero(whole & (bound[1:] | ~after))
        reached = np.concatenate([[0.0], np.cumsum(strands.length)])
        stop = np.searchsorted(reached, reached[first] + self.length)
        stop = np.clip(stop, first + 1, last + 1)
        start = np.searchsorted(reached, reached[last + 1] - self.length, side="right") - 1
        start = np.clip(start, first, last)
        begin, end = np.concatenate([first, start]), np.concatenate([stop, last + 1])
        total = np.concatenate([[0.0], np.cumsum(pull * strands.length)])
        size = np.maximum(reached[end] - reached[begin], 1e-300)
        return Ends(begin, end, (total[end] - total[begin]) / size)
