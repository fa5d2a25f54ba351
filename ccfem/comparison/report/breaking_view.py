"""How parts break, step by step, as the report draws it: what has failed at each row of a curve."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray, IntArray
from ccfem.comparison.report.packing import Rounded
from ccfem.judging.virtual_testing.progressive_failure import BreakingLoad

_MOST = 6000
"""Cracked cells, and pieces of broken strand, that are drawn of a part; of more, an even share."""


def breaking_views(broken: Mapping[str, BreakingLoad], centres: FloatArray) -> list[dict[str, Any]]:
    """Return what the page draws of breaking loads.

    Parameters
    ----------
    broken : mapping of name to BreakingLoad
    centres : (m, 3) array, mm
        Of the cells of the part.

    Returns
    -------
    list of dict
        Of each part its ``name``, the columns of its curve, and the places of ``cells`` that crack,
        of pieces of ``strands`` that break and of ``layers`` that part, with the rows at which they
        do.
    """
    return [
        {
            "name": name,
            "force": load.curve.force,
            "displacement": load.curve.displacement,
            "cracks": load.curve.cracks,
            "broken": load.curve.broken,
            "parted": load.curve.parted,
            "cells": _failed(centres, load.curve.cracked_at),
            "strands": _failed(load.strands.middle, load.curve.broken_at),
            "layers": _failed(centres, load.curve.parted_at),
        }
        for name, load in broken.items()
    ]


def _failed(places: FloatArray, row: IntArray) -> dict[str, Any]:
    """Places (k, 3) of what fails, in the order of its rows."""
    failed = np.flatnonzero(row >= 0)
    failed = failed[np.argsort(row[failed], kind="stable")]
    failed = failed[:: max(1, -(-len(failed) // _MOST))]
    size = float(np.linalg.norm(np.ptp(places, axis=0))) if len(places) else 1.0
    return {"points": Rounded(places[failed], 1e-4 * size), "row": row[failed]}
