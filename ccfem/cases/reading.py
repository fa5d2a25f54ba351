"""A part by its name or its file."""

import os
from pathlib import Path
from typing import Any

from ccfem.base.errors import InputError
from ccfem.cases.case import Case
from ccfem.cases.named import create_case
from ccfem.cases.part_file import read_part


def read(part: str | os.PathLike[str] | Case, **parameters: Any) -> Case:
    """Read a part file, or make a case that comes with ccfem.

    Parameters
    ----------
    part : str, path or Case
        A part file (``hook.toml``), the name of a case (``"loop"``), or a case, returned as it is.
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
    if isinstance(part, str) and not part.endswith(".toml") and not {"/", "\\"} & set(part):
        return create_case(part, **parameters)
    if parameters:
        raise InputError(
            f"parameters are for cases by name; '{part}' is a part file: change the file"
        )
    return part if isinstance(part, Case) else read_part(Path(part))
