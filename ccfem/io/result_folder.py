"""Writing a folder of results whole or not at all, without touching what others wrote there."""

import hashlib
import json
import os
import platform
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ccfem.errors import InputError
from ccfem.io.whole import reason_and_cure

__all__ = ["whole_folder"]

_MARKER = ".ccfem.json"
"""File in a folder of results: the files that ccfem wrote there, each with its SHA-256."""
_TEMPORARY = re.compile(r"\.ccfem-(?P<host>[^-]*)-(?P<pid>\d+)-(?P<rest>.+)")
_OLD = "old-"
"""What the rest of a temporary name begins with where it holds the results before these."""


@contextmanager
def whole_folder(directory: Path, force: bool = False) -> Iterator[Path]:
    """Yield a temporary folder that takes the place of `directory` when the block ends well.

    Of what is in `directory`, only files that ccfem wrote there itself, and that nobody changed
    since, are replaced or removed; everything else stays. A folder that may not be written to, or
    whose files ccfem would have to replace without knowing them, is refused before the block runs.
    When the block raises, `directory` is as it was. What a run that was killed left behind is
    removed.

    Parameters
    ----------
    directory : Path
    force : bool, default False
        Replace files of the same names whoever wrote them; others stay even so.

    Raises
    ------
    InputError
        When `directory` cannot be written to, or holds files that ccfem did not write.
    """
    directory = Path(directory)
    try:
        parent = _existing_parent(directory)
        with _alone(parent):
            _sweep(parent)
            if not force:
                _refuse_foreign(directory)
        folder = Path(tempfile.mkdtemp(prefix=_prefix(), dir=parent))
    except OSError as error:
        raise _unwritable(directory, error) from error
    try:
        yield folder
        _mark(folder)
        with _alone(parent):
            _keep_foreign(directory, folder, force)
            _take_place(folder, directory)
    except OSError as error:
        raise _unwritable(directory, error) from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _existing_parent(directory: Path) -> Path:
    """Return the nearest folder above that exists."""
    if directory.exists() and not directory.is_dir():
        raise InputError(f"cannot write results to {directory}: it is a file: name a folder")
    parent = directory.absolute().parent
    while not parent.exists() and parent != parent.parent:
        parent = parent.parent
    return parent


@contextmanager
def _alone(parent: Path) -> Iterator[None]:
    """Keep other runs from changing places in the same parent folder meanwhile.

    Without it a run could fill its folder while another one has the old results set aside, and so
    miss what others put there. Where a system or file system has no such locks, do without.
    """
    handle = None
    try:
        import fcntl

        handle = os.open(parent, os.O_RDONLY)
        fcntl.flock(handle, fcntl.LOCK_EX)
    except (ImportError, OSError):
        pass
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _prefix() -> str:
    host = re.sub(r"\W", "", platform.node())
    return f".ccfem-{host}-{os.getpid()}-"


def _sweep(parent: Path) -> None:
    """Remove what killed runs of this machine left, and bring back results that they set aside."""
    for path in parent.glob(".ccfem-*"):
        found = _TEMPORARY.fullmatch(path.name)
        if found is None or not path.name.startswith(f".ccfem-{_prefix().split('-')[1]}-"):
            continue
        if _is_running(int(found["pid"])):
            continue
        rest = found["rest"]
        if rest.startswith(_OLD) and not (parent / rest.removeprefix(_OLD)).exists():
            path.rename(parent / rest.removeprefix(_OLD))
        else:
            shutil.rmtree(path, ignore_errors=True)


def _is_running(pid: int) -> bool:
    """Whether there is a process of this number, as far as the system says so safely."""
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _refuse_foreign(directory: Path) -> None:
    """Refuse a folder with files that ccfem did not write, unless it also holds its results."""
    if not directory.exists():
        return
    there = sorted(path.name for path in directory.iterdir() if path.name != _MARKER)
    if not there:
        return
    written = _written(directory)
    if written is None:
        raise InputError(
            f"{directory} holds files that ccfem did not write, such as {there[0]}: choose another "
            "folder with --out, or replace files of the same names with --force"
        )
    changed = [name for name in written if not _is_ours(directory, name, written)]
    if changed:
        raise InputError(
            f"{directory / changed[0]} was changed since ccfem wrote it: move it, choose another "
            "folder with --out, or replace it with --force"
        )


def _written(directory: Path) -> dict[str, str] | None:
    """Names and hashes of the files that ccfem wrote in a folder; None where no marker says so."""
    try:
        files = json.loads((directory / _MARKER).read_text(encoding="utf-8"))["files"]
        return {
            str(name): str(digest)
            for name, digest in files.items()
            if Path(name).name == name and (directory / name).is_file()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _is_ours(directory: Path, name: str, written: dict[str, str]) -> bool:
    """Whether a file is one that ccfem wrote, as it wrote it."""
    return name in written and written[name] == _digest(directory / name)


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _mark(folder: Path) -> None:
    """Write down what the folder holds."""
    files = {path.name: _digest(path) for path in sorted(folder.iterdir())}
    text = json.dumps({"written by": "ccfem", "files": files}, indent=1)
    (folder / _MARKER).write_text(text + "\n", encoding="utf-8")


def _keep_foreign(directory: Path, folder: Path, force: bool) -> None:
    """Give the new folder what others have put into the old one."""
    if not directory.exists():
        return
    written = _written(directory) or {}
    for path in sorted(directory.iterdir()):
        if path.name == _MARKER or (path.is_file() and _is_ours(directory, path.name, written)):
            continue
        new = folder / path.name
        if new.exists():
            if force:
                continue
            raise InputError(
                f"{path} is not by ccfem and has the name of a result: move it, choose another "
                "folder with --out, or replace it with --force"
            )
        if path.is_dir() and not path.is_symlink():
            shutil.copytree(path, new, symlinks=True, copy_function=_linked)
        else:
            _linked(path, new)


def _linked(source: str | Path, target: str | Path) -> None:
    """Give a file a second name, or copy it where the file system cannot."""
    try:
        os.link(source, target, follow_symlinks=False)
    except OSError:
        shutil.copy2(source, target, follow_symlinks=False)


def _take_place(folder: Path, directory: Path) -> None:
    """Put a folder in the place of another, as a whole."""
    mask = os.umask(0)
    os.umask(mask)
    folder.chmod(0o777 & ~mask)
    directory.parent.mkdir(parents=True, exist_ok=True)
    if not directory.exists():
        folder.rename(directory)
        return
    if directory.is_symlink() or os.path.ismount(directory) or _holds_us(directory):
        _file_by_file(folder, directory)
        return
    folder.chmod(directory.stat().st_mode & 0o7777)
    old = directory.parent / f"{_prefix()}{_OLD}{directory.name}"
    directory.rename(old)
    try:
        folder.rename(directory)
    except OSError:
        old.rename(directory)
        raise
    written = _written(old) or {}
    for late in sorted(old.iterdir()):  # what others put there in the last moment
        if late.name == _MARKER or (late.is_file() and _is_ours(old, late.name, written)):
            continue
        if not (directory / late.name).exists():
            late.rename(directory / late.name)
    shutil.rmtree(old, ignore_errors=True)


def _holds_us(directory: Path) -> bool:
    """Whether this process works in a folder, which then must stay where it is."""
    return Path.cwd().is_relative_to(directory.resolve())


def _file_by_file(folder: Path, directory: Path) -> None:
    """Replace the files of a folder that cannot be replaced itself; the marker goes first."""
    written = _written(directory) or {}
    (directory / _MARKER).unlink(missing_ok=True)
    earlier = {name for name in written if _is_ours(directory, name, written)}
    names = sorted((path.name for path in folder.iterdir()), key=lambda name: name == _MARKER)
    for name in names:
        if not (directory / name).is_dir():
            os.replace(folder / name, directory / name)
    for name in earlier.difference(names):
        (directory / name).unlink(missing_ok=True)


def _unwritable(directory: Path, error: OSError) -> InputError:
    why = reason_and_cure(error, "another folder with --out")
    return InputError(f"cannot write results to {directory}: {why}")
