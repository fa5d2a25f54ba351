"""Writing a file whole or not at all."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ccfem.errors import InputError

__all__ = ["check_writable", "existing_file", "reason_and_cure", "whole_file"]


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
        Name of a file in the same folder, with the same suffix, to write to. When the block
        raises, it is removed and `path` stays as it was.

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
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(f"cannot write {path}: {reason_and_cure(error)}") from error
    finally:
        if temporary.exists():
            temporary.unlink()


def reason_and_cure(error: OSError, folder: str = "a folder you may write to") -> str:
    """Say why the system did not write, and what helps.

    Examples
    --------
    >>> reason_and_cure(OSError(errno.ENOSPC, "No space left on device"))
    'No space left on device: free some space there, or choose another disk'
    """
    full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    cure = "free some space there, or choose another disk" if full else f"choose {folder}"
    return f"{error.strerror or error}: {cure}"


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
