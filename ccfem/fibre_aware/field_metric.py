"""Unknowns in which a descent on fields takes even steps: those of a positive definite matrix."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ccfem.arrays import FloatArray
from ccfem.errors import SolveError

__all__ = ["FieldMetric"]


@dataclass(frozen=True)
class FieldMetric:
    """Unknowns x of a field s, with ``x.x = s.A s`` for a positive definite matrix A.

    A descent that knows nothing of its objective takes all directions of its unknowns for alike.
    Where A is about the second derivative of the objective, they are. With ``A = C C^T`` the field
    is ``A^-1 C x``.

    Attributes
    ----------
    factor : SuperLU
        Of A, (c, c).
    root : sparse (c, c) array
        C.
    """

    factor: Any
    root: Any

    @classmethod
    def of(cls, matrix: Any) -> "FieldMetric":
        """Metric of a symmetric positive definite sparse matrix (c, c).

        Raises
        ------
        SolveError
            When the matrix is not positive definite.
        """
        options = {"SymmetricMode": True}
        order = "MMD_AT_PLUS_A"
        factor = splu(sp.csc_array(matrix), order, diag_pivot_thresh=0.0, options=options)
        pivot = factor.U.diagonal()
        if pivot.min() <= 0.0 or (factor.perm_r != factor.perm_c).any():
            raise SolveError("metric of fields: the matrix is not positive definite")
        root = (factor.L @ sp.diags_array(np.sqrt(pivot))).tocsr()
        return cls(factor, root[factor.perm_r].tocsc())

    def unknowns(self, field: FloatArray) -> FloatArray:
        """Unknowns (c,) of a field (c,)."""
        return np.asarray(self.root.T @ field)

    def field(self, unknowns: FloatArray) -> FloatArray:
        """Field (c,) of unknowns (c,)."""
        return np.asarray(self.factor.solve(self.root @ unknowns))

    def pulled(self, gradient: FloatArray) -> FloatArray:
        """Turn a derivative (c,) by the field into that by the unknowns."""
        return np.asarray(self.root.T @ self.factor.solve(gradient))
