"""Runs of a study in processes of this machine."""

import json
import os
import queue
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, cast

from ccfem.comparison.studies.jobs import Job
from ccfem.comparison.studies.transport import packed, unpacked
from ccfem.comparison.studies.work import crashed, job_bytes
from ccfem.comparison.studies.worker import receive, send

_PACKAGES = Path(__file__).resolve().parents[3]
"""Folder from which ccfem is imported."""

_Done = queue.SimpleQueue[tuple["_Worker", bytes | None]]


def in_processes(
    parts: Mapping[int, bytes], jobs: Sequence[Job], workers: int, folder: Path
) -> Iterator[tuple[Job, dict[str, Any]]]:
    """Run jobs, each part solved once, and yield each with its outcome as soon as it is there.

    Parameters
    ----------
    parts : mapping of number to bytes
        Task of each part that jobs need, from `part_bytes`.
    jobs : sequence of Job
    workers : int
        Processes; each has its share of the processors for its threads.
    folder : Path
        Where the stress of parts is kept meanwhile, as arrays; nobody else may write there.
    """
    done: _Done = queue.SimpleQueue()
    board = _Board(parts, jobs)
    crew = [_Worker(done, workers) for _ in range(max(min(workers, len(jobs)), 1))]
    left = len(jobs)
    try:
        while left:
            for worker in crew:
                if worker.task is None:
                    worker.take(board, folder)
            worker, answer = done.get()
            if answer is None:
                task = worker.task
                crew[crew.index(worker)] = _Worker(done, workers)
                if task is None:
                    continue
                failed = crashed(f"the process that ran it ended: {worker.ending()}")
                for job in board.lost(task):
                    left -= 1
                    yield job, failed
                continue
            task, worker.task = worker.task, None
            if isinstance(task, Job):
                left -= 1
                yield task, unpacked(answer)
            else:
                board.solved[cast(int, task)] = unpacked(answer)
    finally:
        for worker in crew:
            worker.end()


@dataclass
class _Board:
    """What there is to do."""

    parts: Mapping[int, bytes]
    jobs: Sequence[Job]
    waiting: dict[int, deque[Job]] = field(init=False)
    unsolved: deque[int] = field(init=False)
    solved: dict[int, bytes] = field(default_factory=dict)
    """Of each solved part what stands in no array: see `transport.parted`."""

    def __post_init__(self) -> None:
        self.waiting = {number: deque() for number in self.parts}
        for job in self.jobs:
            self.waiting[job.part].append(job)
        self.unsolved = deque(self.parts)

    def next(self, held: int | None) -> Job | int | None:
        """Give a run on the part that a worker holds, else a part to solve, else any run."""
        if held in self.solved and self.waiting[held]:
            return self.waiting[held].popleft()
        if self.unsolved:
            return self.unsolved.popleft()
        ready = [number for number in self.solved if self.waiting[number]]
        if not ready:
            return None
        return self.waiting[max(ready, key=lambda number: len(self.waiting[number]))].popleft()

    def lost(self, task: Job | int) -> list[Job]:
        """Give up what a process that ended was doing: a run, or all runs of a part."""
        if isinstance(task, Job):
            return [task]
        jobs = list(self.waiting[task])
        self.waiting[task].clear()
        return jobs


class _Worker:
    """A process, and what it is doing."""

    def __init__(self, done: _Done, workers: int) -> None:
        self.task: Job | int | None = None
        self._held: int | None = None
        command = [sys.executable, "-P", "-m", "ccfem.comparison.studies.worker"]
        self._process = subprocess.Popen(
            command,
            env=_environment(workers),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self._given = cast(BinaryIO, self._process.stdin)
        self._out = cast(BinaryIO, self._process.stdout)
        self._tell(json.dumps([os.path.abspath(path) for path in sys.path]).encode())
        threading.Thread(target=self._listen, args=(done,), daemon=True).start()

    def _listen(self, done: _Done) -> None:
        while True:
            answer = receive(self._out)
            done.put((self, answer))
            if answer is None:
                return

    def _tell(self, data: bytes) -> None:
        with suppress(BrokenPipeError):  # where it has ended, which its listener tells
            send(self._given, data)

    def take(self, board: _Board, folder: Path) -> None:
        """Begin what is next to do, if anything is."""
        task = self.task = board.next(self._held)
        if task is None:
            return
        if isinstance(task, Job):
            part, what, data, rest = task.part, "run", job_bytes(task), board.solved[task.part]
        else:
            part, what, data, rest = task, "solve", board.parts[task], b""
        self._held = part
        self._tell(packed((what, str(part), str(folder / f"{part}.npz"), data, rest)))

    def ending(self) -> str:
        """Say how the process ended."""
        code = self._process.wait()
        return f"signal {-code}" if code < 0 else f"exit code {code}"

    def end(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()


def _environment(workers: int) -> dict[str, str]:
    """Environment in which the threads of all workers together are as many as processors.

    Libraries take one thread each: how they share sums among more would change the last digits, and
    so the table with the number of workers.
    """
    environment = dict(os.environ)
    before = environment.get("PYTHONPATH")
    environment["PYTHONPATH"] = os.pathsep.join([str(_PACKAGES), *([before] if before else [])])
    for library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
        environment[f"{library}_NUM_THREADS"] = "1"
    environment["CCFEM_NUM_THREADS"] = str(max((os.cpu_count() or 1) // workers, 1))
    return environment
