"""A folder held open: its entries by bare name, never through a link, and private folders in it.

Everything is done relative to the open folder, so that nobody can put a link in its place between
a look and a deed; where a system has no such calls (Windows), by path.
"""

import errno
import hashlib
import os
import platform
import re
import secrets
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

_RELATIVE = {os.open, os.stat, os.unlink, os.rename, os.mkdir, os.rmdir} <= os.supports_dir_fd
_REAL = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
"""How files are opened: no link is followed, and no pipe waited for."""
_TEMPORARY = re.compile(r"\.ccfem-(?P<host>[^-]*)-(?P<pid>\d+)-(?P<rest>\w{8}|[0-9a-f]{16})")
_RANDOM = 8
"""Random bytes in the name of a temporary file; a private folder has as many letters."""
PARTS = UNREADY, READY = "new", "ready"
"""Folders in a private folder: with files that are being written, and with whole ones."""
_PRIVATE: set[str] = set()
"""Private folders that there are now."""


class Folder:
    """A folder held open; made by `Folder.opened` and `Folder.inner`; its path is for messages."""

    def __init__(self, path: Path, handle: int | None) -> None:
        self.path, self._handle = path, handle

    @classmethod
    @contextmanager
    def opened(cls, path: Path) -> Iterator["Folder"]:
        """Hold a folder open; it may be a link itself, since the user named it."""
        if not _RELATIVE:
            yield cls(path.resolve(strict=True), None)
            return
        handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
        try:
            yield cls(path, handle)
        finally:
            os.close(handle)

    @contextmanager
    def inner(self, name: str) -> Iterator["Folder"]:
        """Hold a folder in this one open, made where there is none; a link is an OSError."""
        with suppress(FileExistsError):
            os.mkdir(**self._at(name))
        if not self.is_folder(name):
            raise NotADirectoryError(
                errno.ENOTDIR, "it is no folder but a link or a file", str(self.path / name)
            )
        if not _RELATIVE:
            yield Folder(self.path / name, None)
            return
        handle = os.open(**self._at(name), flags=os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        try:
            yield Folder(self.path / name, handle)
        finally:
            os.close(handle)

    def _at(self, name: str) -> dict[str, Any]:
        """Place of an entry, as functions of `os` take it."""
        if name in ("", ".", "..") or Path(name).name != name:
            raise ValueError(f"{name!r} is no name of an entry of a folder")
        if self._handle is None:
            return {"path": self.path / name}
        return {"path": name, "dir_fd": self._handle}

    def check_place(self) -> None:
        """Raise an OSError where another folder, or a link to one, has come into its place."""
        held = None if self._handle is None else os.fstat(self._handle)
        if held is not None and not os.path.samestat(held, os.stat(self.path)):
            raise OSError(errno.ESTALE, "another folder has come into its place", str(self.path))

    def names(self) -> list[str]:
        """Names of all entries, sorted."""
        return sorted(os.listdir(self.path if self._handle is None else self._handle))

    def entry(self, name: str) -> os.stat_result | None:
        """Return what an entry is itself, links not followed; None where there is none."""
        try:
            return os.stat(**self._at(name), follow_symlinks=False)
        except FileNotFoundError:
            return None

    def is_file(self, name: str) -> bool:
        """Whether an entry is a regular file, and no link to one."""
        entry = self.entry(name)
        return entry is not None and stat.S_ISREG(entry.st_mode)

    def is_folder(self, name: str) -> bool:
        """Whether an entry is a folder, and no link to one."""
        entry = self.entry(name)
        return entry is not None and stat.S_ISDIR(entry.st_mode)

    def open(self, name: str, flags: int) -> int:
        """Open a regular file, for the flags of `os.open`; anything else is an OSError."""
        refusal = OSError(
            errno.EINVAL, "it is no file but a link or a folder", str(self.path / name)
        )
        if self.entry(name) is not None and not self.is_file(name):
            raise refusal
        handle = os.open(**self._at(name), flags=flags | _REAL, mode=0o666)
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            os.close(handle)
            raise refusal
        return handle

    def read(self, name: str) -> bytes:
        """Content of a regular file; anything else is an OSError."""
        with os.fdopen(self.open(name, os.O_RDONLY), "rb") as file:
            return file.read()

    def digest(self, name: str) -> str:
        """SHA-256 of a regular file; empty for anything else."""
        try:
            with os.fdopen(self.open(name, os.O_RDONLY), "rb") as file:
                return hashlib.file_digest(file, "sha256").hexdigest()
        except OSError:
            return ""

    def write(self, name: str, content: bytes) -> None:
        """Write a file whole; what has its name, be it a link, is replaced and never followed."""
        temporary = f"{_prefix()}{secrets.token_hex(_RANDOM)}"
        handle = self.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
            self.take(self, temporary, name)
        except BaseException:
            self.remove(temporary)
            raise

    def take(self, source: "Folder", name: str, new: str | None = None) -> None:
        """Move a file of another folder here, by another name if wanted, replacing what has it."""
        there, here = source._at(name), self._at(name if new is None else new)
        if self._handle is None:
            os.replace(there["path"], here["path"])
        else:
            fds = {"src_dir_fd": there["dir_fd"], "dst_dir_fd": here["dir_fd"]}
            os.replace(there["path"], here["path"], **fds)

    def remove(self, name: str) -> None:
        """Remove a file or a link, where there is one."""
        with suppress(FileNotFoundError):
            os.unlink(**self._at(name))

    def remove_empty(self, name: str) -> None:
        """Remove a folder if there is nothing in it."""
        with suppress(OSError):
            os.rmdir(**self._at(name))


@contextmanager
def private_folder(parent: Path | None = None) -> Iterator[Path]:
    """Yield a new folder that no other user may enter; it is removed at the end, with all in it.

    It is made in `parent`, by default the system's folder for temporary files.
    """
    name = tempfile.mkdtemp(prefix=_prefix(), dir=parent)
    _PRIVATE.add(name)
    try:
        yield Path(name)
    finally:
        shutil.rmtree(name, ignore_errors=True)
        _PRIVATE.discard(name)


def remove_private_folders() -> None:
    """Remove all private folders of this process, which is about to end at once."""
    for name in tuple(_PRIVATE):
        shutil.rmtree(name, ignore_errors=True)


def _prefix() -> str:
    """Beginning of temporary names of this process."""
    return f".ccfem-{_host()}-{os.getpid()}-"


def _host() -> str:
    return re.sub(r"\W", "", platform.node())


def sweep(
    folder: Folder, names: Sequence[str], mend: Callable[[Folder], None] | None = None
) -> None:
    """Remove what killed programs of this user on this machine left in a folder.

    That is files with the temporary name of a process that is no more, and private folders that
    hold nothing but such files and ones of known names, in themselves or in their folders `PARTS`.

    Parameters
    ----------
    names : sequence of str
        Patterns, as of `fnmatch`, of these files; others stay, and so does their folder.
    mend : callable, optional
        Called with each private folder, held open, before it is emptied.
    """
    for name in folder.names():
        known = _TEMPORARY.fullmatch(name)
        if known is None or known["host"] != _host() or _is_running(int(known["pid"])):
            continue
        entry = folder.entry(name)
        if entry is None or (hasattr(os, "getuid") and entry.st_uid != os.getuid()):
            continue
        if stat.S_ISREG(entry.st_mode):
            if _is_temporary_file(name):
                folder.remove(name)
        elif stat.S_ISDIR(entry.st_mode) and (os.name != "posix" or not entry.st_mode & 0o077):
            with folder.inner(name) as private:
                if mend is not None:
                    mend(private)
                for part in filter(private.is_folder, PARTS):
                    _empty(private, part, names)
            _empty(folder, name, names)


def _empty(folder: Folder, name: str, names: Sequence[str]) -> None:
    """Remove files of known names from an inner folder, and the folder if it is then empty."""
    with folder.inner(name) as inner:
        for file in filter(inner.is_file, inner.names()):
            if _is_temporary_file(file) or any(fnmatchcase(file, known) for known in names):
                inner.remove(file)
    folder.remove_empty(name)


def _is_temporary_file(name: str) -> bool:
    """Whether `Folder.write` gives a file this name until it is whole."""
    known = _TEMPORARY.fullmatch(name)
    return known is not None and len(known["rest"]) == 2 * _RANDOM


def _is_running(pid: int) -> bool:
    """Whether there is a process of this number, as far as the system says so safely."""
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True
