"""Tables of a part file that say by a name what they describe."""

from collections.abc import Mapping
from typing import Any

from ccfem.errors import InputError
from ccfem.io.toml import from_table
from ccfem.materials import Material, isotropic, named_material, transversely_isotropic

__all__ = ["read_material", "split"]


def split(
    table: object, key: str, known: Mapping[str, Any], where: str
) -> tuple[str, dict[str, Any]]:
    """Split a table into the name under a key, which must be known, and the rest.

    Raises
    ------
    InputError
    """
    name = table.get(key) if isinstance(table, Mapping) else None
    if not isinstance(table, Mapping) or not isinstance(name, str) or name not in known:
        raise InputError(
            f"{where} must be a table with {key} one of {', '.join(known)}; got "
            f"{name if name is not None else table!r}: correct it"
        )
    return name, {k: value for k, value in table.items() if k != key}


def read_material(given: str | dict[str, Any], where: str = "material") -> Material:
    """Material by name, or of its moduli.

    Raises
    ------
    InputError
    """
    if isinstance(given, str):
        return named_material(given)
    make = transversely_isotropic if "modulus_fibre" in given else isotropic
    return from_table(make, given, where)
