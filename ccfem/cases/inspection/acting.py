"""What acts on a part, as far as its part file reads: where, how, and what of it can be typed."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.cases.inspection.patch_places import PatchPlace
from ccfem.cases.part_draft import Keys, PartDraft

_SUPPORTS = {"held": "Hold", "sliding": "Roll"}
_AMOUNTS = {
    "force": ("vector", "N"),
    "bearing": ("vector", "N"),
    "point": ("vector", "N"),
    "traction": ("vector", "MPa"),
    "pressure": ("magnitude", "MPa"),
    "moment": ("vector", "N mm"),
    "gravity": ("acceleration", "m/s²"),
    "body_force": ("vector", "N/mm³"),
    "centrifugal": ("speed", "rad/s"),
    "temperature": ("change", "K"),
    "displacement": ("vector", "mm"),
}
"""Key of what can be typed of a load, and its unit, by the kind of load."""
_WHOLE = ("gravity", "body_force", "temperature")
"""Kinds that act on the whole part."""
Name = tuple[str, type, int]
"""What an entry is known by while others come and go: title, kind of amount, place among alike."""


@dataclass(frozen=True)
class Entry:
    """A load or a support of the part file."""

    keys: Keys  # where it stands: ("supports", 0) or ("loads", name, 0)
    table: Mapping[str, Any]  # what it says

    @property
    def holds(self) -> bool:
        """Whether it is a support."""
        return self.keys[0] == "supports"

    @property
    def kind(self) -> str:
        """Kind of load or support, as the part file names it."""
        return str(self.table.get("kind", "held" if self.holds else "load"))

    @property
    def case(self) -> str:
        """Load case that it stands in."""
        return "Supports" if self.holds else str(self.keys[1])

    @property
    def title(self) -> str:
        """One line."""
        patch = self.table.get("patch") or self.table.get("patches") or ""
        what = _SUPPORTS.get(self.kind, self.kind) if self.holds else f"{self.case}: {self.kind}"
        return f"{what} on {patch}" if patch else what

    @property
    def key(self) -> str:
        """Key of what can be typed, or dragged."""
        return _AMOUNTS.get(self.kind, ("vector", ""))[0]

    @property
    def unit(self) -> str:
        """Unit of that."""
        return _AMOUNTS.get(self.kind, ("vector", ""))[1]

    @property
    def amount(self) -> tuple[float, ...] | float | None:
        """What of it can be typed: a vector, or a number."""
        standard = (0.0, 0.0, -9.81) if self.kind == "gravity" else None
        given = None if self.holds else finite(self.table.get(self.key, standard))
        if given is None or given.shape not in ((), (3,)):
            return None
        return tuple(given.tolist()) if given.ndim else float(given)

    @property
    def said(self) -> str:
        """Its size with its unit, a number with its sign; its kind where it has none."""
        given = self.amount
        size = np.linalg.norm(given) if isinstance(given, tuple) else given
        return self.kind if size is None else f"{size:.4g} {self.unit}"

    @property
    def along(self) -> FloatArray | None:
        """Direction (3,) of a force, or axis of what turns; None where it has none."""
        given: Any = self.amount
        if self.kind == "centrifugal":
            given = self.table.get("axis")
        elif self.kind == "nodes" and not self.holds:
            vectors = finite(self.table.get("vectors"))
            given = vectors.sum(axis=0) if vectors is not None and vectors.ndim == 2 else None
        vector = finite(given)
        return vector if vector is not None and vector.shape == (3,) and vector.any() else None

    def place(self, places: Mapping[str, PatchPlace], body: FloatArray) -> PatchPlace | None:
        """Place where it acts; None where that is not known.

        Parameters
        ----------
        places : mapping of str to PatchPlace
            Of the patches.
        body : (t, 3, 3) array, mm
            Corners of the triangles of the part.
        """
        if self.kind in _WHOLE:
            return PatchPlace(body)
        patches = self.table.get("patches")
        names = (self.table.get("patch"), *(patches if isinstance(patches, list) else ()))
        known = [places[name] for name in names if isinstance(name, str) and name in places]
        if known:
            numbers = tuple(number for place in known for number in place.numbers)
            return PatchPlace(np.concatenate([place.corners for place in known]), numbers)
        points = finite(self.table.get("points", self.table.get("point")))
        if points is None or points.shape[-1:] != (3,):
            return None
        if self.kind == "centrifugal" and self.along is not None:
            middle, axis = body.mean(axis=(0, 1)), self.along / np.linalg.norm(self.along)
            points = points + ((middle - points) @ axis) * axis
        return PatchPlace(np.repeat(points.reshape(-1, 1, 3), 3, axis=1))


def entries(draft: PartDraft) -> dict[Name, Entry]:
    """Supports and loads of a part file, as far as they read."""
    named: dict[Name, Entry] = {}
    for keys, table in draft.acting.items():
        entry = Entry(keys, table)
        alike = (entry.title, type(entry.amount))
        named[*alike, sum(name[:2] == alike for name in named)] = entry
    return named


def finite(given: Any) -> FloatArray | None:
    """Array of finite numbers; None where it is something else."""
    try:
        numbers = np.array(given, dtype=float)
    except (TypeError, ValueError):
        return None
    return numbers if given is not None and np.isfinite(numbers).all() else None
