"""Page of the cases: a picture of each, what it is, and its parameters."""

import inspect
import re
from collections.abc import Callable

from keys import keys

from ccfem.cases import named_cases
from ccfem.cases.case import Case

__all__ = ["cases_page"]

_HEAD = """# Cases

Parts that come with ccfem: `ccfem compare NAME`, or `ccfem.read("NAME")` in Python. A parameter is
set by `--set-case NAME=VALUE`. The coloured facets are the patches that hold or load the part;
arrows are the resultants of the loads, triangles mark what is held. Most are part files, in the
folder `data` of the repository: examples for your own.

"""


def cases_page() -> str:
    """Write a section for each case; the pictures are drawn by `python -m benchmarks.gallery`."""
    return _HEAD + "".join(_section(name, make) for name, make in sorted(named_cases().items()))


def _section(name: str, make: Callable[..., Case]) -> str:
    first, _, rest = (inspect.getdoc(make) or "").partition("\n")
    said = re.split(r"^Parameters$", rest, maxsplit=1, flags=re.M)[0].strip()
    return (
        f"## {name}\n\n{first}\n\n![The part, its patches and loads](pictures/cases/{name}.png)"
        f"{{ loading=lazy }}\n\n{said}\n\n{keys(make)}"
    )
