"""What to cite: the papers whose methods a result used, as BibTeX."""

import json
import re
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import metadata
from importlib.resources import files
from pathlib import Path
from typing import Any

from ccfem.base.errors import InputError

METHODS: dict[str, tuple[str, ...]] = {
    "concentric": (),
    "contour_zigzag": (),
    "eqs": ("papapetrou_2020", "wang_2021"),
    "fiso": ("kipping_2023",),
    "grid": ("plocher_2022",),
    "isocurve": ("chen_2021",),
    "mat": ("plocher_2022",),
    "mps": ("plocher_2022",),
    "offset": ("papapetrou_2020", "wang_2021"),
    "pruned": (),
    "stream_function": (),
    "streamline": ("jobard_1997", "papapetrou_2020", "wang_2021"),
    "stripes": ("zhang_2025", "knoeppel_2015"),
    "svt": ("wang_2021",),
    "winding": ("fang_2024",),
    "zigzag": (),
    "load_oriented": ("kipping_2023",),
    "planar": (),
    "spatial": ("fang_2024",),
    "through_strands": (),
    "surfaces": (),
    "amg": ("vanek_1996",),
    "two-level": ("vanek_1996",),
    "error": ("zienkiewicz_1987", "zienkiewicz_1992"),
}
"""Papers of each strategy, slicer and solver by its name, and of the estimated error of the cells;
none for what is common practice or ours."""


def methods_of(record: Mapping[str, Any]) -> list[str]:
    """Return the strategies, slicers, solver and error estimate that a comparison used.

    Parameters
    ----------
    record : mapping
        As in ``results.json``.
    """
    stacks = record.get("slicings") or {"": record}
    runs = [run for stack in stacks.values() for run in stack["strategies"]]
    methods = [method for run in runs for method in run.get("methods", [run["name"]])]
    methods += [stack["slicer"] for stack in stacks.values() if stack.get("slicer")]
    solver = record.get("solver", {})
    methods += [str(solver.get("backend", "")), "error" if solver.get("error") is not None else ""]
    return [method for method in dict.fromkeys(methods) if method]


def methods_of_results(file: Path) -> list[str]:
    """Return the methods that a file ``results.json`` names."""
    try:
        return methods_of(json.loads(file.read_text(encoding="utf-8")))
    except OSError:
        raise InputError(
            f"{file.parent} holds no results.json: name a folder that ccfem compare wrote"
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InputError(
            f"{file} is no record of ccfem compare: name a folder that it wrote"
        ) from None


def cited(methods: Iterable[str]) -> list[str]:
    """Keys of ccfem and of the papers of some methods; a method of another package has none."""
    keys = [key for method in methods for key in METHODS.get(method, ())]
    return ["ccfem", *dict.fromkeys(keys)]


def bibtex(keys: Iterable[str]) -> str:
    """Entries of some keys, one after the other."""
    return "\n\n".join(_entries()[key] for key in keys)


def sentence(key: str) -> str:
    """One entry as a line of a list of references."""
    fields = dict(re.findall(r"^  (\w+) = \{(.*)\},$", _entries()[key], flags=re.MULTILINE))
    names = re.sub(r" and ", "; ", fields["author"])
    where = ", ".join(
        fields[name] for name in ("journal", "booktitle", "publisher") if name in fields
    )
    place = " ".join(fields[name] for name in ("volume", "pages") if name in fields)
    parts = [names, fields["title"], f"{where} {place}".strip(), fields.get("year", "")]
    parts += [f"doi:{fields['doi']}"] if "doi" in fields else []
    text = ". ".join(part.rstrip(".") for part in parts if part)
    return re.sub(r"[{}]", "", text).replace("--", "–") + "."


@cache
def _entries() -> dict[str, str]:
    text = files("ccfem.comparison").joinpath("references.bib").read_text(encoding="utf-8")
    text = text.replace("{the version installed}", f"{{{metadata.version('ccfem')}}}")
    entries = [entry.strip() for entry in re.split(r"\n(?=@)", text)]
    return {entry[entry.index("{") + 1 : entry.index(",")]: entry for entry in entries}
