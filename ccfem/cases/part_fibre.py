"""The table [fibre] of a part file: which layers and regions get fibre."""

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Literal

from ccfem.base.errors import InputError, Mistakes, shown
from ccfem.base.toml import from_table
from ccfem.base.whole import existing_file
from ccfem.body.files.surface import read_surface
from ccfem.cases.part_tables import named_table
from ccfem.paths.placement import fibre_places

FIBRE_REGIONS: dict[str, Callable[..., fibre_places.Shape]] = {
    "patch": fibre_places.NearPatch,
    "box": fibre_places.InBox,
    "cylinder": fibre_places.InCylinder,
    "body": fibre_places.InBody,
}
"""Shapes of regions by their rule."""

_KEYS = {"from": "from_height", "to": "to_height"}
"""Keys that are words of Python, and the fields that they mean."""


def fibre_of(
    table: object, folder: Path | None = None, base: fibre_places.FibrePlaces | None = None
) -> fibre_places.FibrePlaces:
    """Read a table [fibre].

    Parameters
    ----------
    table : object
        What stands in the file; its regions are of files relative to `folder`.
    folder : Path, optional
        Without one there are no regions.
    base : FibrePlaces, optional
        What the table changes.
    """
    if not isinstance(table, Mapping):
        raise InputError(f"fibre must be a table; got {shown(table)}: write [fibre] and its keys")
    mistakes = Mistakes()
    wrong = [key for key in table if key in _KEYS.values()]
    for key in wrong:
        mistakes.lines.append(f"fibre has no key '{key}': write {key.removesuffix('_height')}")
    given = {_KEYS.get(str(k), str(k)): v for k, v in table.items() if k not in ("regions", *wrong)}
    regions = list(() if base is None else base.regions)
    if "regions" in table:
        if folder is None:
            mistakes.lines.append(
                "fibre.regions belong in a part file: write [[fibre.regions]] there"
            )
        elif not isinstance(table["regions"], list):
            mistakes.lines.append("fibre.regions must be a list of tables: write [[fibre.regions]]")
        else:
            regions = []
            for k, region in enumerate(table["regions"]):
                with mistakes.noted():
                    regions.append(_region(region, f"fibre.regions[{k}]", folder))
    places = None
    with mistakes.noted():
        read = from_table(fibre_places.FibrePlaces, given, "fibre")
        names = {name: getattr(read, name) for name in given}
        places = replace(base or fibre_places.FibrePlaces(), **names)
    for key, name in _KEYS.items():
        mistakes.lines = [
            line.replace("fibre: fibre_places.", "fibre.").replace(name, key)
            for line in mistakes.lines
        ]
    mistakes.complain()
    assert places is not None
    return replace(places, regions=tuple(regions))


def _region(table: object, where: str, folder: Path) -> fibre_places.FibreRegion:
    """Read a region."""
    rule, rest = named_table(table, "rule", FIBRE_REGIONS, where)
    common = {key: rest.pop(key) for key in ("mode", "priority") if key in rest}
    if rule == "body":
        file = from_table(_file, rest, where)
        path = existing_file(folder / file, f"{where}.file")
        shape: fibre_places.Shape = fibre_places.InBody(read_surface(path), file)
    else:
        shape = from_table(FIBRE_REGIONS[rule], rest, where, infinite=rule == "box")
    return replace(from_table(_region_of_rules, common, where), shape=shape)


def _file(file: str) -> str:
    """Key of a region that a surface bounds."""
    return file


def _region_of_rules(
    mode: Literal["only", "exclude"] = "only", priority: int = 1
) -> fibre_places.FibreRegion:
    """Keys that all regions have; their shape comes after."""
    return fibre_places.FibreRegion(fibre_places.NearPatch("", 1.0), mode, priority)


def patches_of_fibre(places: fibre_places.FibrePlaces | None) -> tuple[str, ...]:
    """Patches that regions lie near."""
    if places is None:
        return ()
    shapes = [region.shape for region in places.regions]
    return tuple(shape.patch for shape in shapes if isinstance(shape, fibre_places.NearPatch))


def fibre_table(places: fibre_places.FibrePlaces | None) -> dict[str, Any]:
    """Table [fibre] that reads as some places; empty without any.

    The inside of a surface, whose file is not known, is an error.
    """
    if places is None:
        return {}
    keys = {name: key for key, name in _KEYS.items()}
    given = {field.name: getattr(places, field.name) for field in fields(places)}
    table = {keys.get(k, k): v for k, v in given.items() if v is not None and k != "regions"}
    regions = []
    for region in places.regions:
        shape = region.shape
        rule = next((name for name, make in FIBRE_REGIONS.items() if make is type(shape)), "body")
        if rule == "body":
            raise InputError(
                "fibre.regions of a surface cannot be written to a part file: leave them out"
            )
        keys_of_shape = {field.name: getattr(shape, field.name) for field in fields(shape)}  # type: ignore[arg-type]
        regions.append(
            {"rule": rule, **keys_of_shape, "mode": region.mode, "priority": region.priority}
        )
    return {**table, **({"regions": regions} if regions else {})}
