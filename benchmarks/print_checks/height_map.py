"""How high what is laid stands, on cells of half a millimetre."""

import numpy as np

__all__ = ["HeightMap", "sampled"]

_STEP = 0.25
"""Longest way between samples of a move, mm."""


def sampled(start: np.ndarray, end: np.ndarray, step: float = _STEP) -> tuple:
    """Places (k, 3) along moves (n, 3), from their start to their end, and the move of each."""
    count = np.maximum(np.ceil(np.linalg.norm(end - start, axis=1) / step).astype(int), 1) + 1
    move = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(move)) - np.repeat(np.cumsum(count) - count, count)
    share = number / np.repeat(count - 1, count)
    return start[move] + share[:, None] * (end - start)[move], move


class HeightMap:
    """Tops of what is laid."""

    def __init__(self, bed: tuple) -> None:
        self.top = np.zeros(tuple(int(2 * size) + 2 for size in bed[:2]))

    def _cells(self, place: np.ndarray, half: float) -> tuple:
        side = np.array([[x, y] for x in (-half, 0.0, half) for y in (-half, 0.0, half)])
        at = np.floor(2.0 * (place[:, None, :2] + side)).astype(int)
        at = np.clip(at, 0, np.array(self.top.shape) - 1)
        return at[..., 0], at[..., 1]

    def lay(self, start: np.ndarray, end: np.ndarray, width: float) -> None:
        """Lay lines of a width from some places (n, 3) to others."""
        place, _ = sampled(start, end)
        at = self._cells(place, 0.4 * width)
        np.maximum.at(self.top, at, np.broadcast_to(place[:, 2:], at[0].shape))

    def highest(self, place: np.ndarray, half: float = 0.0) -> np.ndarray:
        """Highest top within half a width of places (k, 3)."""
        return np.asarray(self.top[self._cells(place, half)].max(axis=1))
