"""Meshing by fTetWild."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def fill(points: NDArray[Any], triangles: NDArray[Any], size: float) -> dict[str, Any]:
    """Tetrahedra in a surface; ``points`` and ``cells``."""
    import pytetwild

    points, cells = pytetwild.tetrahedralize(
        np.array(points),
        triangles.astype(np.int32),
        edge_length_abs=float(size),
        optimize=True,
        vtk_ordering=True,
        quiet=True,
    )
    return {"points": points, "cells": np.asarray(cells, dtype=np.int64)}
