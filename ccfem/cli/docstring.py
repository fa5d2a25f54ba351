"""What a class says of itself: the numpydoc docstring, read for people who see no code."""

import inspect
import re
from collections.abc import Iterator
from typing import NamedTuple

__all__ = ["Attribute", "about", "attributes"]

_SECTION = re.compile(r"^(\w[\w ]*)\n-+\n", flags=re.MULTILINE)


class Attribute(NamedTuple):
    """An entry of the section Attributes: its type and unit, and what it means."""

    kind: str
    meaning: str


def about(what: type) -> tuple[str, ...]:
    """Paragraphs of the docstring before its first section."""
    text = _SECTION.split(inspect.getdoc(what) or "", maxsplit=1)[0]
    return tuple(" ".join(part.split()) for part in text.split("\n\n") if part.strip())


def attributes(what: type) -> dict[str, Attribute]:
    """Entries of the section Attributes by name, without the defaults.

    An entry of several names (``angle, turn : float, degrees``) stands for each of them.

    Examples
    --------
    >>> from ccfem.strategies.zigzag import Zigzag
    >>> attributes(Zigzag)["spacing"]
    Attribute(kind='float', meaning='Distance of the lines in fibre widths, at least 1.')
    """
    parts = _SECTION.split(inspect.getdoc(what) or "")
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    found = {}
    for head, body in _entries(sections.get("Attributes", "")):
        names, _, kind = head.partition(" : ")
        entry = Attribute(re.sub(r",? *(default .*|optional)$", "", kind), " ".join(body))
        found.update(dict.fromkeys((name.strip() for name in names.split(",")), entry))
    return found


def _entries(section: str) -> Iterator[tuple[str, list[str]]]:
    """Heads of the entries of a section, each with the lines below it."""
    head, body = "", list[str]()
    for line in section.splitlines():
        if line[:1].strip():
            if head:
                yield head, body
            head, body = line, []
        elif line.strip():
            body.append(line.strip())
    if head:
        yield head, body
