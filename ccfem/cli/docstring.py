"""What a class says about itself: its numpydoc docstring, for people who do not read code."""

import inspect
import re
from collections.abc import Callable
from typing import Any, NamedTuple

_SECTION = re.compile(r"^(\w[\w ]*)\n-+\n", flags=re.MULTILINE)


class Attribute(NamedTuple):
    """An entry of the section Attributes: its type and unit, and what it means."""

    kind: str
    meaning: str


def about(what: Callable[..., Any]) -> tuple[str, ...]:
    """Paragraphs of the docstring before its first section."""
    text = _SECTION.split(inspect.getdoc(what) or "", maxsplit=1)[0]
    return tuple(" ".join(part.split()) for part in text.split("\n\n") if part.strip())


def attributes(what: Callable[..., Any]) -> dict[str, Attribute]:
    """Entries of the section Attributes, or Parameters, by name, without the defaults.

    An entry of several names (``angle, turn : float, degrees``) stands for each of them.

    Examples
    --------
    >>> from ccfem.strategies.zigzag import Zigzag
    >>> attributes(Zigzag)["spacing"]
    Attribute(kind='float', meaning='Distance between the lines in fibre widths, at least 1.')
    """
    parts = _SECTION.split(inspect.getdoc(what) or "")
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    attributes_by_name = {}
    # An entry begins at the left margin; the lines below it are indented.
    for text in re.split(r"\n(?=\S)", sections.get("Attributes") or sections.get("Parameters", "")):
        head, _, body = text.partition("\n")
        names, _, kind = head.partition(" : ")
        entry = Attribute(re.sub(r",? *(default .*|optional)$", "", kind), " ".join(body.split()))
        attributes_by_name.update(dict.fromkeys((name.strip() for name in names.split(",")), entry))
    return attributes_by_name
