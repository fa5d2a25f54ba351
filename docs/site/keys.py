"""What a table of a TOML file takes: the parameters of the class that reads it."""

import inspect
import typing
from collections.abc import Callable, Mapping
from typing import Any

from table import table

from ccfem.base.toml import described
from ccfem.cli.docstring import Attribute, about, attributes

__all__ = ["keys", "kinds"]


def keys(make: Callable[..., Any], meanings: Mapping[str, Attribute] | None = None) -> str:
    """Table of the keys: what each takes, its default, and what it means.

    The meanings are those of the docstring where none are given.
    """
    hints, said = typing.get_type_hints(make), meanings or attributes(make)
    rows = []
    for name, parameter in inspect.signature(make).parameters.items():
        kind, meaning = said.get(name, Attribute("", ""))
        _, comma, unit = kind.partition(", ")
        needed = parameter.default is inspect.Parameter.empty
        default = "needed" if needed else _written(parameter.default)
        rows.append((f"`{name}`", f"{described(hints[name])}{comma}{unit}", default, meaning))
    head = ("key", "takes", "default", "meaning")
    if not any(row[-1] for row in rows):
        head, rows = head[:-1], [row[:-1] for row in rows]
    return table(head, rows)


def kinds(key: str, known: Mapping[str, Callable[..., Any]]) -> str:
    """Write a section for each kind of a table: what it is, and its keys."""
    return "".join(
        f'### `{key} = "{name}"` {{ #{key}-{name} }}\n\n'
        + "\n\n".join(about(make))
        + f"\n\n{keys(make)}"
        for name, make in known.items()
    )


def _written(default: object) -> str:
    """Write a default as it stands in a TOML file; a part of the program is told by its name."""
    if default is None:
        return "none"
    if isinstance(default, bool):
        return f"`{str(default).lower()}`"
    if isinstance(default, tuple):
        return f"`{list(default)}`" if default else "none"
    if isinstance(default, int | float | str):
        return f"`{default!r}`".replace("'", '"')
    return f"as of `{type(default).__name__}`"
