"""Array types, and the read-only arrays that the frozen values of ccfem hold."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["BoolArray", "FloatArray", "IntArray", "read_only"]

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def read_only(values: ArrayLike, dtype: Any = np.float64) -> NDArray[Any]:
    """Return `values` as a contiguous array that nobody can write to.

    Parameters
    ----------
    values : array_like
        Anything numpy understands; copied unless it is already read-only and of the right type.
    dtype : data type, default float64
        The type of the result.

    Returns
    -------
    array
        C-contiguous, with ``flags.writeable`` false.
    """
    array = np.asarray(values)
    if array.dtype == dtype and array.flags.c_contiguous and not array.flags.writeable:
        return array
    array = np.array(array, dtype=dtype, order="C")
    array.flags.writeable = False
    return array
