"""Machines by name or from a file: tables of differing values, merged in order.

Later values override earlier ones: the defaults of `Machine`, the built-in machine that a table
names as its ``profile``, that table, the machine of a case, a table named for it, single values.
"""

import dataclasses
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from ccfem.base.checks import check_known
from ccfem.base.errors import InputError, shown
from ccfem.base.plugins import entries
from ccfem.base.toml import TomlTable, from_table, read_toml
from ccfem.machine.machine import Machine

_FOLDER = resources.files("ccfem.machine") / "built_in"


@cache
def _files() -> Mapping[str, Traversable]:
    """File of each machine by name: those of the folder, and entry points of other packages."""
    files = {
        entry.name.removesuffix(".toml"): entry
        for entry in _FOLDER.iterdir()
        if entry.name.endswith(".toml")
    }
    return files | {entry.name: Path(entry.load()) for entry in entries("ccfem.machines")}


def machine_names() -> tuple[str, ...]:
    """Names of the machines that come with ccfem, and with other packages."""
    return tuple(sorted(_files()))


def machine_about(name: str | Path) -> str:
    """Comment at the head of the file of a machine that has a name; empty for other files."""
    if str(name) not in _files():
        return ""
    lines = _files()[str(name)].read_text(encoding="utf-8").splitlines()
    return " ".join(line.removeprefix("#").strip() for line in lines[: lines.index("[machine]")])


def machine_table(name: str | Path) -> dict[str, Any]:
    """Find the values that a machine sets, with those of machines that it builds on.

    Parameters
    ----------
    name : str or Path
        Of a machine (`machine_names`), or of a TOML file with a table ``[machine]``, as in part
        files. A file that names its ``last_table`` must end with it; otherwise it is cut off.
    """
    text = str(name)
    if not text.endswith(".toml") and not {"/", "\\"} & set(text):
        check_known("machine", text, machine_names(), "or name a file, .toml")
        content = tomllib.loads(_files()[text].read_text(encoding="utf-8"))
        return _whole_table(content["machine"])
    file = Path(text)
    content = read_toml(file, "machine file")
    last = content.get("last_table")
    if last is not None and not (isinstance(last, str) and last in content):
        raise InputError(
            f"{file} is cut off: its last_table {shown(last)} is missing: copy or print it again"
        )
    if not isinstance(content.get("machine"), Mapping):
        raise InputError(f"{file} is no machine file: it has no table [machine]: write one")
    try:
        return _whole_table(content["machine"])
    except InputError as error:
        raise InputError(*(f"{file}: {line}" for line in error.mistakes)) from None


def _whole_table(table: TomlTable) -> dict[str, Any]:
    """Merge a table over the built-in machine that it names as its profile."""
    rest = {key: value for key, value in table.items() if key != "profile"}
    if "profile" not in table:
        return rest
    name = table["profile"]
    if not isinstance(name, str) or name not in machine_names():
        raise InputError(
            f"machine.profile must be one of {', '.join(machine_names())}; got {shown(name)}: "
            "name one of them"
        )
    return _merged(machine_table(name), rest)


def machine_from(table: object, where: str = "machine") -> Machine:
    """Make a machine of a table as in part files, with a ``profile`` or none."""
    whole = _whole_table(table) if isinstance(table, Mapping) else table
    return from_table(Machine, whole, where)


def updated(machine: Machine, *tables: TomlTable, where: str = "machine") -> Machine:
    """Merge tables over a machine, one after the other.

    Parameters
    ----------
    *tables : mapping
        As returned by `machine_table`; values that they do not name stay.
    where : str
        Where the values came from, for messages.

    Examples
    --------
    >>> updated(Machine(), machine_table("aura_like"), {"process": {"start_speed": 3.0}}).tail
    46.0
    """
    merged = _as_table(machine)
    for table in tables:
        merged = _merged(merged, _whole_table(table))
    return from_table(Machine, merged, where)


def _merged(under: TomlTable, over: TomlTable) -> dict[str, Any]:
    """Merge two tables; the second one wins, and tables in both are merged in turn."""
    merged = dict(under)
    for key, value in over.items():
        both = isinstance(value, Mapping) and isinstance(merged.get(key), Mapping)
        merged[key] = _merged(merged[key], value) if both else value
    return merged


def _as_table(value: object) -> dict[str, Any]:
    """Fields of a machine as a TOML file would hold them; those that are None are left out."""
    return {
        key: _entry(entry)
        for key, entry in dataclasses.asdict(value).items()  # type: ignore[call-overload]
        if entry is not None
    }


def _entry(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _entry(entry) for key, entry in value.items() if entry is not None}
    return list(value) if isinstance(value, tuple) else value
