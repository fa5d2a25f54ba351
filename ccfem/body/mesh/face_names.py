"""Names of the groups that hold the numbered faces of the surface that a mesh was made from."""

import re

from ccfem.base.errors import InputError

_NAME = re.compile("face_([0-9]+)")


def face_name(number: int) -> str:
    """Name of the group of a face: ``face_1``, ``face_2``, ..."""
    return f"face_{number}"


def number_of_face(name: str) -> int | None:
    """Return the number of the face whose group has this name; None for another name."""
    match = _NAME.fullmatch(name)
    return None if match is None else int(match[1])


def check_free(name: str) -> None:
    """Raise for a patch that would have the name of a numbered face, and be taken for it."""
    if number_of_face(name) is not None:
        raise InputError(
            f"patch '{name}' has a name that is kept for the numbered faces of a surface: choose "
            "another"
        )
