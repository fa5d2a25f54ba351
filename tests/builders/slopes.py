"""Slopes of an objective along a smooth random direction: by its gradient, and by differences."""

import numpy as np


def slopes(objective, field, solutions, rng, step=1e-5):
    """Return both, for a field of splines and the solutions of its cases."""
    smooth = np.linalg.inv(np.eye(len(field)) + 4.0 * objective.laplacian.toarray())
    direction = smooth @ rng.standard_normal(len(field))
    above, here, below = (
        objective.evaluate(field + way * step * direction, solutions, 1e-12) for way in (1, 0, -1)
    )
    return here.gradient @ direction, (above.value - below.value) / (2.0 * step)
