"""Writing a file whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ccfem.errors import InputError
from ccfem.io.folder import Folder, private_folder

__all__ = ["check_writable", "existing_file", "whole_file"]


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Write to a temporary file that takes the place of `path` when the block ends well.

    Parameters
    ----------
    path : path
        The file to write; its folder must exist.

    Yields
    ------
    Path
        File of the same name to write to, in a private folder beside it, which is then removed.
        When the block raises, `path` stays as it was. A link in its place is replaced, not
        followed.

    Raises
    ------
    InputError
        When the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> with whole_file(folder / "note.txt") as temporary:
    ...     _ = temporary.write_text("all of it")
    >>> (folder / "note.txt").read_text()
    'all of it'
    """
    path = check_writable(path)
    try:
        with private_folder(path.parent) as folder:
            yield folder / path.name
            with Folder.opened(folder) as private, Folder.opened(path.parent) as target:
                target.take(private, path.name)
    except OSError as error:
        raise InputError(
            f"cannot write {path}: {error.strerror or error}: choose a folder you may write to"
        ) from error


def check_writable(path: str | os.PathLike[str]) -> Path:
    """Return `path` when a file of that name can be written: to be checked before long work.

    Raises
    ------
    InputError
        When its folder does not exist or may not be written to, or `path` is a folder itself.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"cannot write {path}: it is a folder: name the file in it")
    if not path.parent.is_dir():
        raise InputError(f"cannot write {path}: there is no folder {path.parent}: make it first")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"cannot write {path}: choose a folder you may write to")
    return path


def existing_file(path: str | os.PathLike[str], what: str) -> Path:
    """Return `path` when it is a file that can be read.

    Raises
    ------
    InputError
        When it is not; the message begins with `what`.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{what} {path} is a folder: name the file in it")
    if not path.exists():
        raise InputError(f"{what} {path} does not exist: check its name and folder")
    if not os.access(path, os.R_OK):
        raise InputError(f"{what} {path} cannot be read: check its permissions")
    return path
