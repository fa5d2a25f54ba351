"""A worker process: it takes tasks from its input and gives outcomes on its output, one by one.

It ends at once when its input ends, as it does when the study that started it is killed.
"""

import json
import os
import queue
import signal
import sys
import threading
from functools import partial
from typing import TYPE_CHECKING, Any, BinaryIO

if TYPE_CHECKING:
    from ccfem.comparison.studies.transport import Parted


def send(stream: BinaryIO, data: bytes) -> None:
    """Write one message."""
    stream.write(len(data).to_bytes(8, "little") + data)
    stream.flush()


def receive(stream: BinaryIO) -> bytes | None:
    """Read one message; None where the stream has ended."""
    size = stream.read(8)
    if len(size) < 8:
        return None
    length = int.from_bytes(size, "little")
    data = stream.read(length)
    return data if len(data) == length else None


def _tasks(stream: BinaryIO, queued: "queue.SimpleQueue[bytes]") -> None:
    """Read tasks until there is nobody left to give any."""
    while True:
        task = receive(stream)
        if task is None:
            os._exit(0)
        queued.put(task)


def main() -> None:
    """Work until the input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever started it stops it
    given, out = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print does not get among the messages
    queued: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    first = receive(given)
    if first is None:
        return
    sys.path += [path for path in json.loads(first) if path not in sys.path]
    threading.Thread(target=_tasks, args=(given, queued), daemon=True).start()
    import numpy as np

    from ccfem.comparison.studies.transport import packed, unpacked
    from ccfem.comparison.studies.work import run_job, solve_part

    while True:
        what, name, file, task, rest = unpacked(queued.get())
        if what == "solve":
            rest, arrays = solve_part(task)
            np.savez(file, **arrays)  # type: ignore[arg-type]  # none is named allow_pickle
            done: Any = rest
        else:
            done = run_job(partial(_stress, rest, file), name, task)
        send(out, packed(done))


def _stress(rest: bytes, file: str) -> "Parted":
    """Stress of a part: arrays of a file, and what came with the task."""
    import numpy as np

    with np.load(file, allow_pickle=False) as arrays:
        return rest, dict(arrays)


if __name__ == "__main__":
    main()
