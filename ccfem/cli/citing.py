"""What ``ccfem cite`` does: BibTeX of the methods that a result used."""

import json
from collections.abc import Sequence
from pathlib import Path

from ccfem.base.checks import check_known
from ccfem.base.errors import InputError
from ccfem.comparison.citations import METHODS, bibtex, cited, methods_of


def cite(whats: Sequence[str]) -> None:
    """Print BibTeX of ccfem and of the methods behind results.

    Parameters
    ----------
    whats : sequence of str
        Folders of results, ``results.json`` files, or names of strategies and slicers.

    Raises
    ------
    InputError
        For what is neither.
    """
    methods: list[str] = []
    for what in whats:
        path = Path(what)
        file = path / "results.json" if path.is_dir() else path
        if file.suffix == ".json" or path.is_dir():
            methods += _of_results(file)
        else:
            check_known("method or folder of results", what, sorted(METHODS))
            methods.append(what)
    print(bibtex(cited(methods)))


def _of_results(file: Path) -> list[str]:
    """Methods that a record of a comparison names."""
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
        return methods_of(record)
    except OSError:
        raise InputError(
            f"{file.parent} holds no results.json: name a folder that ccfem compare wrote"
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InputError(
            f"{file} is no record of ccfem compare: name a folder that it wrote"
        ) from None
