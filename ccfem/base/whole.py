"""Writing a file whole or not at all."""

import codecs
import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ccfem.base.errors import InputError
from ccfem.base.folder import Folder, private_folder


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
        raise InputError(f"cannot write {path}: {reason_and_cure(error)}") from error


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
    """Return `path` when a file of that name can be written: to be checked before long work."""
    path = Path(path)
    if path.is_dir():
        raise InputError(f"cannot write {path}: it is a folder: name the file in it")
    if not path.parent.is_dir():
        raise InputError(f"cannot write {path}: there is no folder {path.parent}: make it first")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"cannot write {path}: choose a folder you may write to")
    return path


def existing_file(path: str | os.PathLike[str], what: str) -> Path:
    """Return `path` when it is a file that can be read; else an error begins with `what` it is."""
    path = Path(path)
    if not str(path).isprintable():  # a path of Windows whose \\t and \\n were read as escapes
        raise InputError(
            f"{what} {str(path)!r} has a tab, a line break or the like in its name: write paths "
            "with / or, in a TOML file, in single quotes"
        )
    if path.is_dir():
        raise InputError(f"{what} {path} is a folder: name the file in it")
    if not path.exists():
        raise InputError(f"{what} {path} does not exist: check its name and folder")
    if not os.access(path, os.R_OK):
        raise InputError(f"{what} {path} cannot be read: check its permissions")
    return path


def text_of(path: str | os.PathLike[str], what: str) -> str:
    """Text of a file in UTF-8, with or without a byte order mark.

    Where it cannot be read, or is in another encoding, an error begins with `what` it is.
    """
    path = existing_file(path, what)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{what} {path} cannot be read: {error.strerror or error}: copy it to another disk"
        ) from None
    came = "got UTF-16"
    if not data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) and b"\0" not in data[:2]:
        try:
            return data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = data[: error.start].count(b"\n") + 1
            came = f"line {line} has the byte 0x{data[error.start]:02x}, which is none"
    raise InputError(
        f"{what} {path} must be text in UTF-8; {came}: save it as UTF-8, or check its name"
    )
