"""How ``ccfem`` is stopped, by SIGINT (Ctrl-C), SIGTERM or SIGHUP: one line, and the exit code.

While libraries are imported a signal ends the process at once. Later it raises `Stopped`, so that
what is begun is put in order on the way out; a second signal does not wait for that.
"""

import os
import signal
import sys
from types import FrameType, TracebackType
from typing import Any, NoReturn

_HEEDED = [
    each
    for name in ("SIGINT", "SIGTERM", "SIGHUP")
    if (each := getattr(signal, name, None)) is not None
    and signal.getsignal(each) is not signal.SIG_IGN  # as behind nohup
]
_asked: int | None = None
"""Signal that this process is ending by."""
_AGAIN = 0.01
"""Seconds after which a stop that a library has swallowed is repeated."""


class Stopped(BaseException):
    """Raised by a signal, from wherever the program is."""


def asked() -> int | None:
    """Return the signal that this process is ending by, or None."""
    return _asked


def say(number: int) -> int:
    """Print that the program was stopped; returns the exit code."""
    os.write(2, f"ccfem: stopped by {signal.Signals(number).name}\n".encode())
    return 128 + number


def end() -> NoReturn:
    """End a process that is stopped, whatever its threads do."""
    _end(_asked or signal.SIGINT, None)


def end_at_once() -> None:
    """Let signals end the process where it stands, from now on."""
    for signal_number in _HEEDED:
        signal.signal(signal_number, _end)


def unwind() -> None:
    """Let signals raise `Stopped`, from now on."""
    for signal_number in _HEEDED:
        signal.signal(signal_number, _raise)
    sys.unraisablehook = _unraisable
    sys.excepthook = _uncaught


def _end(number: int, frame: FrameType | None) -> NoReturn:
    # The module may not be imported yet, or only in part: then it has made no folder.
    remove = getattr(sys.modules.get("ccfem.base.folder"), "remove_private_folders", None)
    if remove is not None:
        remove()
    os._exit(say(number))


def _raise(number: int, frame: FrameType | None) -> None:
    global _asked
    if _asked is not None:
        _end(number, frame)
    _asked = number
    raise Stopped


def _unraisable(unraisable: "sys.UnraisableHookArgs") -> None:
    """Repeat a stop that came where no exception gets out, as in a callback of a library."""
    if issubclass(unraisable.exc_type, Stopped):
        _repeat()
    else:
        sys.__unraisablehook__(unraisable)


def _uncaught(
    kind: type[BaseException], error: BaseException, traceback: TracebackType | None
) -> Any:
    """Repeat a stop that a library only printed."""
    if issubclass(kind, Stopped):
        _repeat()
    else:
        sys.__excepthook__(kind, error, traceback)


def _repeat() -> None:
    global _asked
    number, _asked = _asked, None
    if number is not None:
        import threading

        timer = threading.Timer(_AGAIN, os.kill, (os.getpid(), number))
        timer.daemon = True
        timer.start()
