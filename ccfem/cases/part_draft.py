"""A part file while it is being written: what it says, as far as it reads."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ccfem.body.mesh.smooth_faces import FEATURE_ANGLE

Keys = tuple[str | int, ...]
"""Where a value stands: names of tables, and places in lists."""


def _table(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _tables(value: object) -> dict[int, Mapping[str, Any]]:
    """Tables of a list by their places; none where it is something else."""
    items = value if isinstance(value, list) else ()
    return {k: table for k, table in enumerate(items) if isinstance(table, Mapping)}


@dataclass(frozen=True)
class PartDraft:
    """What a part file says. What is of another kind than it should be counts as not there."""

    content: Mapping[str, Any]  # as it stands in the file

    @property
    def patches(self) -> Mapping[str, Any]:
        """Rules of the patches by their names."""
        return _table(self.content.get("patches"))

    @property
    def regions(self) -> dict[int, Mapping[str, Any]]:
        """Regions of fibre by their places in the list."""
        return _tables(_table(self.content.get("fibre")).get("regions"))

    @property
    def acting(self) -> dict[Keys, Mapping[str, Any]]:
        """Supports and loads by where they stand: ("supports", 0) or ("loads", name, 0)."""
        lists: dict[Keys, object] = {("supports",): self.content.get("supports")}
        lists |= {("loads", k): v for k, v in _table(self.content.get("loads")).items()}
        return {(*keys, k): t for keys, items in lists.items() for k, t in _tables(items).items()}

    @property
    def files(self) -> dict[Keys, str]:
        """Files that it names, by where they stand in it."""
        named: dict[Keys, object] = {(key,): self.content.get(key) for key in ("mesh", "surface")}
        named |= {("fibre", "regions", k, "file"): t.get("file") for k, t in self.regions.items()}
        return {keys: name for keys, name in named.items() if isinstance(name, str)}

    @property
    def feature_angle(self) -> float:
        """Angle that separates faces, degrees: that of the first rule that has one."""
        angles = [_table(rule).get("angle") for rule in self.patches.values()]
        given = [float(angle) for angle in angles if isinstance(angle, int | float)]
        return (given or [FEATURE_ANGLE])[0]

    @property
    def body(self) -> tuple[object, ...]:
        """What its faces depend on."""
        keys = ("mesh", "surface", "planform", "scale", "merge_nodes")
        return (*(self.content.get(key) for key in keys), self.feature_angle)
