"""Strands that come loose from the matrix, from their ends on.

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

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.judging.virtual_testing.strands import AVERAGING_LENGTH, Strands


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
    """Ends of the strands of a part, and the force that they pass on.

    Attributes
    ----------
    strands : Strands
        Pieces whose `share` is 0, as in folds, are no part of a strand.
    length : float, mm
        Length from the end over which a force is averaged, and comes loose. Of shorter strands all.
    """

    strands: Strands
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
