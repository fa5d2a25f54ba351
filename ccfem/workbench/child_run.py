"""A command of ccfem in a process of its own: its progress, its end, and how it is stopped."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ccfem.base.progress import step_of

_PATIENCE = 5.0
"""Seconds in which a process that was asked to stop may put things in order."""
_LEAST_MEMORY = 8e9
"""Address space, bytes, that a run may take on any machine; else as much as there is memory."""
_PROGRAM = (sys.executable, "-P", "-m", "ccfem")
"""What runs: without the folder of the run on the path, so that no module in it is taken for ours.
"""
_KEPT = 40
"""Last lines of what it said that are kept."""


@dataclass(frozen=True)
class RunState:
    """Where a run stands."""

    share: float = 0.0  # of the work that is done
    step: str = "starting"  # what it is doing, and how long it will still take
    lines: tuple[str, ...] = ()  # the last that it said
    code: int | None = None  # exit code, when it has ended
    stopped: str = ""  # why it was stopped; empty where it was not

    @property
    def running(self) -> bool:
        """Whether it has not ended."""
        return self.code is None

    @property
    def written(self) -> bool:
        """Whether results were written: also those of a plan that cannot be printed."""
        return self.code in (0, 3) and not self.stopped

    @property
    def complaint(self) -> str:
        """Why it wrote nothing; empty where it did, or is not at its end."""
        if self.running or self.written:
            return ""
        if self.stopped:
            return self.stopped
        complaints = [line for line in self.lines if line.startswith("ccfem: error: ")]
        if complaints:
            return complaints[-1].removeprefix("ccfem: error: ")
        last = f": {self.lines[-1]}" if self.lines else ""
        return f"the run ended with exit code {self.code}{last}"


class ChildRun:
    """A command of ccfem that runs, whoever looks at it.

    Parameters
    ----------
    arguments : sequence of str
        Behind ``ccfem``.
    folder : Path
        Where it runs.
    changed : callable
        Called in a thread of its own with each `RunState`, the last one when the process has ended.
    minutes : float, optional
        After which it is stopped; default: never.
    """

    def __init__(
        self,
        arguments: Sequence[str],
        folder: Path,
        changed: Callable[[RunState], object],
        minutes: float | None = None,
    ) -> None:
        self.state = RunState()
        self._changed = changed
        self._process = subprocess.Popen(
            [*_PROGRAM, *arguments],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            text=True,
            encoding="utf-8",
            errors="replace",
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        _limit_memory(self._process.pid)
        self._thread = threading.Thread(target=self._follow, name="run", daemon=True)
        self._thread.start()
        if minutes is not None:
            why = f"stopped after {minutes:g} min: allow a longer run, or ask for less"
            threading.Thread(target=self._limit, args=(60.0 * minutes, why), daemon=True).start()

    def _follow(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            step = step_of(line)
            if step is None:
                lines = (*self.state.lines, line.rstrip())[-_KEPT:]
                self.state = replace(self.state, lines=lines)
            else:
                self.state = replace(self.state, share=step[0], step=step[1])
                self._changed(self.state)
        code = self._process.wait()
        self.state = replace(self.state, code=code, share=1.0, step="")
        self._changed(self.state)

    def _limit(self, seconds: float, why: str) -> None:
        self._thread.join(seconds)
        if self._thread.is_alive():
            self.stop(why)

    def stop(self, why: str = "stopped") -> None:
        """End the process and all that it started, and wait for that."""
        if self._process.poll() is None:
            self.state = replace(self.state, stopped=why)
            self._signal(signal.SIGTERM)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_PATIENCE)
        self._signal(getattr(signal, "SIGKILL", signal.SIGTERM))
        self._thread.join(_PATIENCE)

    def wait(self, seconds: float | None = None) -> RunState:
        """Wait for its end, or some time; where it stands then."""
        self._thread.join(seconds)
        return self.state

    def _signal(self, number: int) -> None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            if hasattr(os, "killpg"):
                os.killpg(self._process.pid, number)
            elif self._process.poll() is None:
                self._process.terminate()


def _limit_memory(process: int) -> None:
    """Let a process take no more address space than the machine has memory."""
    try:
        import resource

        memory = float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
        limit = int(max(memory, _LEAST_MEMORY))
        resource.prlimit(process, resource.RLIMIT_AS, (limit, limit))
    except (ImportError, AttributeError, ValueError, OSError):  # not on this system
        return
