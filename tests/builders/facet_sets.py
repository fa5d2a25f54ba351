"""Facets without an order, to be compared."""

import numpy as np


def facets_as_set(facets):
    return {frozenset(f) for f in np.asarray(facets).tolist()}
