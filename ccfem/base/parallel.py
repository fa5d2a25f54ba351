"""Work on many things side by side, on at most CCFEM_THREADS processors.

Results are the same, to the last bit, for any number of them.
"""

import ctypes
import gc
import io
import multiprocessing
import os
import pickle
import signal
import sys
import threading
import traceback
import warnings
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from multiprocessing.connection import Connection, wait
from types import BuiltinFunctionType, FunctionType, MappingProxyType, ModuleType
from typing import IO, Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ccfem.base.arrays import is_shared
from ccfem.base.errors import InputError

_MOST = 4
"""Threads at a time; much of the work waits for the interpreter's lock."""

_CODE = (type, ModuleType, FunctionType, BuiltinFunctionType)
_PLAIN = (str, bytes, int, float, type(None))

Result = TypeVar("Result")
FunctionT = TypeVar("FunctionT", bound=Callable[..., Any])


def processors() -> int:
    """Processors that the program may use: CCFEM_THREADS, by default all that the system grants.

    CCFEM_THREADS is a whole number from 1 on.
    """
    wanted = os.environ.get("CCFEM_THREADS", "")
    if not wanted:
        return _granted()
    if not wanted.isdecimal() or int(wanted) < 1:
        raise InputError(f"CCFEM_THREADS is a whole number, 1 or more; got '{wanted}'")
    return int(wanted)


def _granted() -> int:
    """Processors that the system grants."""
    granted = getattr(os, "sched_getaffinity", None)
    return len(granted(0)) if granted is not None else os.cpu_count() or 1


def one_blas_thread(function: FunctionT) -> FunctionT:
    """Make a function, and all that it calls, compute with one thread of BLAS.

    Their number changes the last digits, and with them paths. On matrices of the size that occurs
    they cost more than they save.
    """
    return cast(FunctionT, threadpool_limits.wrap(limits=1, user_api="blas")(function))


def in_threads(
    work: Callable[..., Result], *items: Sequence[Any], most: int | None = _MOST
) -> list[Result]:
    """Results of a function for each of some items, in their order, several at a time.

    Parameters
    ----------
    work : callable
        Called from several threads at once, with one item of each sequence.
    *items : sequences of one length
    most : int, optional
        Threads at a time, default 4; None for as many as there are processors, where the work
        frees the interpreter.

    Raises
    ------
    Exception
        The first that `work` raises, in the order of the items.
    """
    count = max(min(_left(), _left() if most is None else most, len(items[0])), 1)
    if count == 1:
        return [work(*arguments) for arguments in zip(*items, strict=True)]
    with ThreadPoolExecutor(count) as pool:
        return list(pool.map(work, *items))


Elsewhere = Callable[[Callable[..., Any], Sequence[tuple[Any, ...]]], Iterator[Any] | None]
"""Does work for the arguments of each of its calls; None where it cannot."""

_ELSEWHERE: ContextVar[Elsewhere | None] = ContextVar("elsewhere", default=None)


@contextmanager
def done_elsewhere(results: Elsewhere) -> Iterator[None]:
    """Let something else than processes of this machine do what `in_processes` shares out."""
    token = _ELSEWHERE.set(results)
    try:
        yield
    finally:
        _ELSEWHERE.reset(token)


def in_processes(
    work: Callable[..., Result],
    *items: Sequence[Any],
    shared: Sequence[Any] = (),
    writes: bool = False,
) -> Iterator[Result]:
    """Yield results of a function for each of some items, in their order, several at a time.

    The processes are copies of this one (fork), so that `work` may be any function; only results
    are sent. What `work` changes elsewhere is lost. On other systems than Linux, where there is one
    processor, in threads, and within such a process it is done here, one after the other.

    Parameters
    ----------
    work : callable
        Called with one item of each sequence.
    *items : sequences of one length
    shared : sequence, optional
        Where a result refers to these, to the items, or to what they refer to, it refers to the
        same objects here: they are not sent.
    writes : bool, default False
        The work writes files, so that it is not done elsewhere.

    Raises
    ------
    Exception
        The first that `work` raises, in the order of the items.
    InputError
        When a process ends before its work, as where memory runs out.
    """
    arguments = list(zip(*items, strict=True))
    elsewhere = None if writes or len(arguments) < 2 else _ELSEWHERE.get()
    if elsewhere is not None and (results := elsewhere(work, arguments)) is not None:
        yield from results
        return
    count = min(_left(), len(arguments))
    if count < 2 or not _may_fork():
        for some in arguments:
            yield work(*some)
        return
    forks = _Forks(work, arguments, shared, count)
    try:
        yield from forks.results()
    finally:
        forks.end()


def repeating(
    work: Callable[[int], Result],
    what: Sequence[Hashable],
    again: Callable[[Result, int], Result],
    shared: Sequence[Any] = (),
) -> Iterator[Result]:
    """Yield results of a function for the numbers 0, 1 and so on, like ones made once.

    Parameters
    ----------
    work : callable
        Called with a number, as by `in_processes`.
    what : sequence of hashable
        Of each number; the work is the same where it is equal.
    again : callable
        Makes the result for a later number of that for the first.
    shared : sequence, optional
        As of `in_processes`.
    """
    first: dict[Hashable, int] = {}
    source = [first.setdefault(one, number) for number, one in enumerate(what)]
    last = {at: number for number, at in enumerate(source)}
    made = in_processes(work, list(first.values()), shared=shared)
    kept: dict[int, Result] = {}
    for number, at in enumerate(source):
        if at == number:
            kept[at] = next(made)
        result = kept[at] if last[at] > number else kept.pop(at)
        yield result if at == number else again(result, number)


@contextmanager
def beside(
    work: Callable[[], Result], shared: Sequence[Any] = ()
) -> Iterator[Callable[[], Result]]:
    """Work in another process while the block runs, with what waits for the result.

    It takes what time other work of this process leaves: where that may use every processor of the
    system, the process has a low priority, else one processor less is left until it is done. Where
    there is no room for it (`has_room_beside`), it is done here when its result is asked for. It is
    called at most once; `shared` is as of `in_processes`.
    """
    if not has_room_beside():
        yield work
        return
    forks = _Forks(partial(_with_low_priority, work), [()], shared, 1)
    _besides.append(forks)
    try:
        yield lambda: next(forks.results())
    finally:
        _besides.remove(forks)
        forks.end()


_LOW = 5
"""What is added to the niceness of a process beside. On one processor it then gets a third of the
time of what it gives way to, and also of other people's work: less would hold it up behind that."""


def _with_low_priority(work: Callable[[], Result]) -> Result:
    global _siblings
    # Not where work whose result cannot be sent is done again by the user's own process.
    if multiprocessing.current_process().daemon:
        if processors() >= _granted():
            os.nice(_LOW)
        else:  # it counts as one processor
            _siblings = processors()
    return work()


def has_room_beside() -> bool:
    """Whether a second processor is left here, and work is not shared out elsewhere."""
    return processors() - _undone() > 1 and _may_fork() and _ELSEWHERE.get() is None


def _left() -> int:
    """Processors for work of this process: what is done beside it gives way, or takes one each."""
    if processors() >= _granted():
        return max(processors() // _siblings, 1)
    return max((processors() - _undone()) // _siblings, 1)


def _undone() -> int:
    """Count the processes beside this one that are at work."""
    return sum(not forks.done for forks in _besides)


def _may_fork() -> bool:
    within = multiprocessing.current_process().daemon
    # Forks of several threads at once disturb each other.
    thread = threading.current_thread() is not threading.main_thread()
    return not within and not thread and sys.platform == "linux"


class _Forks:
    """Copies of this process at work on some items, several at a time."""

    def __init__(
        self,
        work: Callable[..., Any],
        arguments: Sequence[tuple[Any, ...]],
        shared: Sequence[Any],
        count: int,
    ) -> None:
        here, there = zip(*(multiprocessing.Pipe() for _ in range(count)), strict=True)
        self._work, self._arguments = work, arguments
        self._known = _reachable([arguments, shared])
        context, about = multiprocessing.get_context("fork"), (work, arguments, self._known)
        self._processes = [
            context.Process(target=_serve, args=(*about, end, (*here, *there)), daemon=True)
            for end in there
        ]
        # Each end of a pipe, with the number of the item that was asked for through it.
        self._asked: dict[Connection, int] = {}
        try:
            with warnings.catch_warnings():
                # Python 3.12 warns of forks beside threads. The only one here draws a progress bar.
                warnings.simplefilter("ignore", DeprecationWarning)
                for process, end in zip(self._processes, there, strict=True):
                    process.start()
                    end.close()
            for number, end in enumerate(here):
                end.send(number)
                self._asked[end] = number
        except BaseException:
            self.end()
            raise

    @property
    def done(self) -> bool:
        """Whether the outcomes of all that was asked for are there."""
        return all(end.poll() for end in self._asked)

    def results(self) -> Iterator[Any]:
        """Yield the results in the order of the items."""
        outcomes = _in_order(self._asked, len(self._arguments))
        for some, sent in zip(self._arguments, outcomes, strict=True):
            if not sent:  # it cannot be sent, as a value of a class within a function
                yield self._work(*some)
                continue
            result, error = _Unpickler(io.BytesIO(sent), self._known).load()
            if error is not None:
                raise error
            yield result

    def end(self) -> None:
        """End the processes."""
        for process in self._processes:
            if process.pid is not None:
                process.kill()
                process.join()


_siblings = 1
"""Processes that share the processors with this one, itself included."""

_besides: list[_Forks] = []
"""What is being done beside this process."""


def give_back() -> None:
    """Give memory that is free back to the system, where its C library can: arrays leave holes."""
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)


_Known = dict[int, Any]
"""Objects by their identity, which is the same in a copy of this process."""


def _reachable(roots: Sequence[Any]) -> _Known:
    """Objects that some refer to, directly or not; no code, and no numbers and words."""
    known: _Known = {}
    following = list(roots)
    while following:
        value = following.pop()
        if id(value) not in known and not isinstance(value, _CODE + _PLAIN):
            known[id(value)] = value
            following += gc.get_referents(value)
    return known


def _read_only_mapping(content: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(content)


def _shared_rows(row: NDArray[Any], shape: tuple[int, ...]) -> NDArray[Any]:
    return np.broadcast_to(row, shape)


def _read_only_array(content: bytes, dtype: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    return np.frombuffer(content, dtype).reshape(shape)


class ReadOnlyPickler(pickle.Pickler):
    """Keeps what is read-only so; arrays would come back without that."""

    def reducer_override(self, value: Any) -> Any:
        """Reduce mappings and arrays that are read-only, and leave the rest as it is."""
        if isinstance(value, MappingProxyType):
            return _read_only_mapping, (dict(value),)
        if type(value) is np.ndarray and is_shared(value):
            return _shared_rows, (value[0].copy(), value.shape)
        if type(value) is np.ndarray and not (value.flags.writeable or value.dtype.hasobject):
            return _read_only_array, (value.tobytes(), value.dtype, value.shape)
        override = getattr(super(), "reducer_override", None)
        return NotImplemented if override is None else override(value)


class _Pickler(ReadOnlyPickler):
    def __init__(self, file: IO[bytes], known: _Known) -> None:
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._known = known

    def persistent_id(self, value: Any) -> int | None:
        return id(value) if id(value) in self._known else None


class _Unpickler(pickle.Unpickler):
    def __init__(self, file: IO[bytes], known: _Known) -> None:
        super().__init__(file)
        self._known = known

    def persistent_load(self, identity: int) -> Any:
        return self._known[identity]


def _in_order(asked: dict[Connection, int], count: int) -> Iterator[bytes]:
    """Yield each outcome in order, asking for the next where one has come."""
    numbers = iter(range(len(asked), count))
    outcomes: dict[int, bytes] = {}
    for wanted in range(count):
        while wanted not in outcomes:
            for end in cast(list[Connection], wait(list(asked))):
                try:
                    outcomes[asked.pop(end)] = end.recv_bytes()
                except EOFError:
                    raise InputError(
                        "a process ended before its work, as where memory runs out: set "
                        "CCFEM_THREADS=1, which needs less"
                    ) from None
                following = next(numbers, None)
                if following is not None:
                    end.send(following)
                    asked[end] = following
        yield outcomes.pop(wanted)


def _serve(
    work: Callable[..., Any],
    arguments: Sequence[tuple[Any, ...]],
    known: _Known,
    end: Connection,
    inherited: Sequence[Connection],
) -> None:
    """Do what is asked for through a pipe, until its other end is closed or the parent is gone.

    An outcome is a result and an error, pickled; it is empty where it cannot be.
    """
    global _siblings
    _siblings = max(len(inherited) // 2, 1)
    _ELSEWHERE.set(None)  # its connection is that of the parent
    # The parent says that it was stopped.
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    for other in inherited:  # else nobody would see that a process is gone
        if other is not end:
            other.close()
    try:
        while True:
            number = end.recv()
            try:
                outcome: tuple[Any, Exception | None] = work(*arguments[number]), None
            except Exception as error:
                error.add_note(traceback.format_exc())
                outcome = None, error
            content = io.BytesIO()
            try:
                _Pickler(content, known).dump(outcome)
            except Exception:
                content = io.BytesIO()
            end.send_bytes(content.getbuffer())
    except (EOFError, BrokenPipeError):
        pass
