"""Writing a folder of results whole or not at all, without touching what others wrote there.

What ccfem may replace or remove in a folder has to satisfy three things: its name is one that the
command at hand writes; the marker in the folder lists it with its SHA-256; and it is a regular file
with that content. A marker can be forged, so it alone gives nothing away: it never makes ccfem
touch a file of another name. Links are never followed.
"""

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from fnmatch import fnmatchcase
from pathlib import Path

from ccfem.base.errors import InputError
from ccfem.base.folder import READY, UNREADY, Folder, private_folder, sweep
from ccfem.base.whole import reason_and_cure

_MARKER = ".ccfem.json"
"""File in a folder of results: the files that ccfem wrote there, each with its SHA-256."""
RESERVED = (_MARKER, ".lock")
"""Names in a folder of results that stand for nothing by themselves."""
_LARGEST_MARKER = 10_000_000
"""Bytes."""


@contextmanager
def whole_folder(
    directory: Path, names: Sequence[str], force: bool = False, beside: Sequence[str] = ()
) -> Iterator[Path]:
    """Yield a temporary folder whose files all go into `directory` when the block ends well.

    Of what is in `directory`, only files that ccfem wrote there itself, and that nobody changed
    since, are replaced or removed; everything else stays. A folder that may not be written to, or
    whose files ccfem would have to replace without knowing them, is refused before the block runs.
    When the block raises, `directory` is as it was. What a run that was killed left behind is
    removed; had it already begun to replace files, this is finished.

    Parameters
    ----------
    names : sequence of str
        Patterns, as of `fnmatch`, of the files that the command writes: nothing else is ever
        removed.
    force : bool, default False
        Replace files of the same names whoever wrote them; others, and folders, stay even so.
    beside : sequence of str
        Patterns of files that the same command writes at other times.

    Raises
    ------
    InputError
        When `directory` cannot be written to, or holds files that ccfem did not write.
    """
    directory = Path(directory)
    try:
        parent = _existing_parent(directory)
        with _alone(parent):
            _mend(parent, directory, names)
            if directory.exists():
                with Folder.opened(directory) as target:
                    refuse_foreign(target, names, force, beside)
        # On one file system with the folder, which may be a link or have one of its own.
        with private_folder(directory if directory.exists() else parent) as private:
            (private / UNREADY).mkdir()
            yield private / UNREADY
            with _alone(parent), Folder.opened(private) as folder:
                _publish(folder, directory, names, force)
    except OSError as error:
        why = reason_and_cure(error, "another folder with --out")
        raise InputError(f"cannot write results to {directory}: {why}") from error


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
    """Keep other runs from changing the same folder meanwhile.

    Where a system or file system has no such locks, do without.
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


def _mend(parent: Path, directory: Path, names: Sequence[str]) -> None:
    """Remove what killed runs left, and finish what they had begun to put into the folder."""
    with Folder.opened(parent) as above:
        sweep(above, (*names, _MARKER))
    if not directory.is_dir():
        return
    with Folder.opened(directory) as target:

        def finish(private: Folder) -> None:
            if not private.is_folder(READY):
                return
            # What has come into the way since then stays.
            with private.inner(READY) as new, suppress(InputError):
                _refuse_in_the_way(new, target, _ours(target, names), force=False)
                if _marked(new) is not None:  # the last that is moved
                    _replace(new, target, names)

        sweep(target, (*names, _MARKER), finish)


def refuse_foreign(
    target: Folder, names: Sequence[str], force: bool, beside: Sequence[str] = ()
) -> None:
    """Refuse a folder with files that ccfem did not write, unless it also holds its results.

    In that one, entries of others are refused that have the names of results: see `whole_folder`.
    So are results of another command, known by its record, of which some would be replaced.
    """
    there = [name for name in target.names() if name not in RESERVED]
    marked, ours = _marked(target), _ours(target, names)
    if marked is None and (there or target.entry(_MARKER) is not None) and not force:
        raise InputError(
            f"{target.path} holds files that ccfem did not write, such as "
            f"{(there or [_MARKER])[0]}: choose another folder with --out, or replace files of the "
            "same names with --force"
        )
    shared = any(_is_known(name, names) for name in marked or {})
    record = next((k for k in marked or {} if _is_record(k, target, (*names, *beside))), None)
    if record is not None and shared and not force:
        raise InputError(
            f"{target.path} holds the results of another command, with {record}, some of which "
            "would be replaced: choose another folder with --out"
        )
    changed = {name for name in there if name in (marked or {}) and _is_known(name, names)}
    for name in sorted(changed.difference(ours)):
        if not force:
            raise InputError(
                f"{target.path / name} was changed since ccfem wrote it: move it, choose another "
                "folder with --out, or replace it with --force"
            )
    for name in {*names, _MARKER}.intersection(target.names()):
        _refuse_entry(target, name, ours, force)


def _refuse_entry(target: Folder, name: str, ours: Mapping[str, str], force: bool) -> None:
    """Refuse to replace an entry that is not by ccfem; a folder even where replacing is wanted."""
    marker = name == _MARKER and _marked(target) is not None
    if target.entry(name) is None or name in ours or marker:
        return
    if not force or target.is_folder(name):
        cure = "" if target.is_folder(name) else ", or replace it with --force"
        raise InputError(
            f"{target.path / name} is not by ccfem and has the name of a result: move it"
            f"{',' if cure else ' or'} choose another folder with --out{cure}"
        )


def _is_record(name: str, target: Folder, names: Sequence[str]) -> bool:
    """Whether a file is there that is the record of a command that writes other names."""
    return name.endswith(".json") and not _is_known(name, names) and target.is_file(name)


def _is_known(name: str, names: Sequence[str]) -> bool:
    """Whether the command writes files of this name."""
    return any(fnmatchcase(name, pattern) for pattern in names)


def _marked(target: Folder) -> dict[str, tuple[str, ...]] | None:
    """Hashes by name of the files that the marker lists; None where there is no marker.

    While files are being replaced, one has two hashes: that of before and that of after.
    """
    entry = target.entry(_MARKER)
    if entry is None or entry.st_size > _LARGEST_MARKER:
        return None
    try:
        files = json.loads(target.read(_MARKER).decode("utf-8"))["files"]
        return {
            str(name): tuple(map(str, hashes if isinstance(hashes, list) else [hashes]))
            for name, hashes in files.items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def _ours(target: Folder, names: Sequence[str]) -> dict[str, str]:
    """Hash by name of the files that ccfem may replace or remove: see the top of this module."""
    marked = _marked(target) or {}
    known = [name for name in target.names() if name in marked and _is_known(name, names)]
    hashes = {name: target.digest(name) for name in known}
    return {name: digest for name, digest in hashes.items() if digest in marked[name]}


def _refuse_in_the_way(new: Folder, target: Folder, ours: Mapping[str, str], force: bool) -> None:
    """Refuse to go on where something that is not by ccfem has the place of a new file."""
    for name in {*new.names(), _MARKER}:
        if new.is_folder(name) and target.is_folder(name):
            with new.inner(name) as inner, target.inner(name) as old:
                _refuse_in_the_way(inner, old, {}, force)
        else:
            _refuse_entry(target, name, ours, force and not new.is_folder(name))


def _publish(private: Folder, directory: Path, names: Sequence[str], force: bool) -> None:
    """Put the new files of a private folder into the folder of results."""
    with private.inner(UNREADY) as new:
        files = {name: [new.digest(name)] for name in new.names() if new.is_file(name)}
        if not os.path.lexists(directory):
            _mark(new, files)
            directory.parent.mkdir(parents=True, exist_ok=True)
            with Folder.opened(directory.parent) as above:
                above.take(private, UNREADY, directory.name)
            return
        with Folder.opened(directory) as target:
            before = _ours(target, names)
            _refuse_in_the_way(new, target, before, force)
            marked = (_marked(target) or {}).items()
            others = {name: list(hashes) for name, hashes in marked if not _is_known(name, names)}
            _mark(new, others | files)
            # Both lists until all is done: a kill at any moment leaves nothing that is unknown.
            both = {name: [digest, *files.get(name, [])] for name, digest in before.items()}
            _mark(target, others | files | both)
            private.take(private, UNREADY, READY)
            with private.inner(READY) as ready:
                _replace(ready, target, names)


def _mark(target: Folder, files: Mapping[str, Sequence[str]]) -> None:
    """Write down files with their hashes."""
    listed = {name: hashes[0] if len(hashes) == 1 else hashes for name, hashes in files.items()}
    text = json.dumps({"written by": "ccfem", "files": listed}, indent=1)
    target.write(_MARKER, (text + "\n").encode())


def _replace(new: Folder, target: Folder, names: Sequence[str]) -> None:
    """Put all files of a new folder into the old one, remove those of before, the marker last."""
    latest, before = _marked(new) or {}, _ours(target, names)
    _move(new, target)
    for name in before:
        if name not in latest:
            target.remove(name)
    target.take(new, _MARKER)


def _move(new: Folder, target: Folder) -> None:
    """Move all but the marker, into folders that are there already too."""
    for name in new.names():
        if name == _MARKER:
            continue
        if target.is_folder(name):
            with new.inner(name) as inner, target.inner(name) as old:
                _move(inner, old)
        else:
            target.take(new, name)
