"""A part by its name or its file."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ccfem.base import plugins
from ccfem.base.errors import InputError
from ccfem.body.files.deck import has_steps
from ccfem.cases.case import Case
from ccfem.cases.part_file import deck_part, read_part
from ccfem.cases.shipped import shipped_cases


def named_cases() -> Mapping[str, Callable[..., Case]]:
    """Every case by name: those that come with ccfem, and entry points ``ccfem.cases``.

    Each is a function that returns a `Case`, whose parameters have defaults.
    """
    others = {entry.name: entry.load() for entry in plugins.entries("ccfem.cases")}
    return {**shipped_cases(), **others}


def create_case(name: str, **parameters: Any) -> Case:
    """Make a case from its name and parameters.

    Raises
    ------
    InputError
        For an unknown case or parameter, the known ones listed; for a value of a wrong type.
    """
    cure = "or name a part file, .toml"
    return plugins.create("case", named_cases(), name, parameters, cure)


def read(part: str | os.PathLike[str] | Case, **parameters: Any) -> Case:
    """Read a part file, or make a case that comes with ccfem.

    Parameters
    ----------
    part : str, path or Case
        A part file (``hook.toml``), a deck with its analysis (``hook.inp``), the name of a case
        (``"loop"``), or a case, returned as it is.
    **parameters
        Parameters of a case by name, as ``element_size=3.0``.

    Raises
    ------
    InputError
        For an unknown name or parameter, and for a part file that cannot be read.

    Examples
    --------
    >>> read("bar", element_size=4.0)
    Case bar: Tensile bar, 125 x 25 x 5 mm, pulled at its ends
    """
    deck = not isinstance(part, Case) and is_analysis(part)
    path = isinstance(part, str) and (part.endswith(".toml") or {"/", "\\"} & set(part))
    if isinstance(part, str) and not path and not deck:
        return create_case(part, **parameters)
    if parameters:
        raise InputError(
            f"parameters are for cases by name; '{part}' is a part file: change the file"
        )
    if isinstance(part, Case):
        return part
    return deck_part(part) if deck else read_part(part)


def is_analysis(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a deck (.inp) with a step, which is a part by itself."""
    path = Path(path)
    return path.suffix.lower() == ".inp" and path.is_file() and has_steps(path)
