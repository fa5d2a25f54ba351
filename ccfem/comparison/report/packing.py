"""Numbers packed into a text that a page holds: small, and unpacked by the page itself.

A tree of mappings, lists, texts, numbers and arrays becomes JSON with the arrays behind it, all
compressed (gzip) and written in base64. ``report.js`` reads it again.
"""

import base64
import gzip
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ccfem.base.arrays import FloatArray
from ccfem.base.row_blocks import RowBlocks

_STEPS = 65535
"""Largest whole number of 16 bits."""


@dataclass(frozen=True)
class Rounded:
    """Coordinates kept to a step, and finer or coarser by 16 bits for each."""

    values: FloatArray  # (n, d): finite
    # What they are rounded to, where 65,535 steps reach from the lowest to the highest; else the
    # smallest step with which they do.
    step: float


def as_bytes(values: FloatArray, limit: float) -> NDArray[np.uint8]:
    """Values from 0 to `limit` in 254 steps, what is above at the end; 255 where there is none."""
    share = np.clip(np.asarray(values, dtype=np.float64) / max(limit, 1e-300), 0.0, 1.0)
    return np.where(np.isnan(share), 255, np.round(254.0 * np.nan_to_num(share))).astype(np.uint8)


def compressed(data: bytes) -> str:
    """Bytes as gzip in base64; the same text for the same bytes."""
    return base64.b64encode(gzip.compress(data, 6, mtime=0)).decode("ascii")


def pack(tree: Any) -> str:
    """Write a tree with arrays as one text.

    Parameters
    ----------
    tree : mapping, list, tuple, str, number, None, array or Rounded
        Arrays of bytes, of integers from 0 to 2^32 - 1, or of floats, which are kept in 32 bits.
        NaN and infinity outside arrays become null.
    """
    parts: list[bytes] = []
    head = json.dumps(_taken(tree, parts), separators=(",", ":"), allow_nan=False).encode()
    return compressed(len(head).to_bytes(4, "little") + head + b"".join(parts))


def _taken(value: Any, parts: list[bytes]) -> Any:
    """Return a tree for JSON whose arrays are places among the `parts`."""
    if isinstance(value, Mapping):
        return {str(key): _taken(item, parts) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_taken(item, parts) for item in value]
    if isinstance(value, np.generic):
        return _taken(value.item(), parts)
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, Rounded):
        return _rounded(value, parts)
    if isinstance(value, RowBlocks):
        value = np.asarray(value)
    if not isinstance(value, np.ndarray):
        return value
    if value.dtype == np.uint8:
        return _placed(value, "u1", parts)
    if value.dtype.kind in "iu":
        return _placed(value, "u2" if value.max(initial=0) <= _STEPS else "u4", parts)
    return _placed(value, "f4", parts)


def _placed(values: NDArray[Any], kind: str, parts: list[bytes]) -> dict[str, Any]:
    """Add an array to the parts, byte by byte of its numbers: equal bytes stand together."""
    flat = np.ascontiguousarray(values, dtype=f"<{kind}").reshape(-1)
    data = flat.view(np.uint8).reshape(-1, flat.itemsize).T.tobytes()
    start = sum(map(len, parts))
    parts.append(data)
    return {"$": kind, "at": start, "n": flat.size}


def _rounded(given: Rounded, parts: list[bytes]) -> dict[str, Any]:
    """Add coordinates to the parts: the step from each to the next, a column after the other."""
    values = np.asarray(given.values, dtype=np.float64)
    low = values.min(axis=0, initial=np.inf) if len(values) else np.zeros(values.shape[1])
    reach = float((values - low).max(initial=0.0))
    step = max(given.step, reach / _STEPS)
    whole = np.round((values - low) / step).astype(np.int64).T
    steps = np.diff(whole, axis=1, prepend=0) % (_STEPS + 1)
    placed = _placed(steps.astype(np.uint16), "u2", parts)
    return {**placed, "low": low.tolist(), "step": step}


def unpack(text: str) -> Any:
    """Read what `pack` wrote; coordinates as (n, d) arrays, others as flat ones."""
    data = gzip.decompress(base64.b64decode(text))
    start = 4 + int.from_bytes(data[:4], "little")
    return _given_back(json.loads(data[4:start]), data[start:])


def _given_back(value: Any, data: bytes) -> Any:
    if isinstance(value, list):
        return [_given_back(item, data) for item in value]
    if not isinstance(value, dict):
        return value
    if "$" not in value:
        return {key: _given_back(item, data) for key, item in value.items()}
    kind = np.dtype(f"<{value['$']}")
    raw = np.frombuffer(data, np.uint8, value["n"] * kind.itemsize, value["at"])
    flat = np.ascontiguousarray(raw.reshape(kind.itemsize, -1).T).view(kind).reshape(-1)
    if "low" not in value:
        return flat
    columns = np.cumsum(flat.reshape(len(value["low"]), -1), axis=1, dtype=np.uint16)
    return columns.T * value["step"] + value["low"]
