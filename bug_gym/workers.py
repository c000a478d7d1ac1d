"""Who does the jobs of a command: this process, several processes of this machine (joblib's loky), or a crew elsewhere.

A worker ends with its parent, however that ends. Otherwise it would wait some minutes for jobs that nobody sends, or go on
with its last one for nobody.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Protocol, TypeAlias, TypeVar, runtime_checkable

from bug_gym.checks import checked_count
from bug_gym.limits import MOST_WORKERS
from bug_gym.references import edits

J = TypeVar("J")
R = TypeVar("R")


class WorkerLostError(OSError):
    """A worker is gone, and nobody knows why."""


GLANCE = 0.5
"""How often a worker looks whether its parent is still there [s]."""


@runtime_checkable
class Crew(Protocol):
    """Those who do jobs somewhere else, such as a `bug_gym.cluster.Cluster`."""

    @property
    def size(self) -> int:
        """How many jobs are done at a time."""

    def each(self, function: Callable[[J], R], jobs: Sequence[J], *, in_order: bool = False) -> Iterator[R]:
        """As `each` here."""


Workers: TypeAlias = int | Crew
"""So many processes of this machine, or a crew."""


def checked_workers(value: object) -> Workers:
    """Workers that callers hand in.

    Raises:
        ValueError: neither an integer from 1 to MOST_WORKERS nor a crew.
    """
    return value if isinstance(value, Crew) else checked_count("workers", value, most=MOST_WORKERS)


def are_several(workers: Workers) -> bool:
    """Whether jobs are done in other processes than this one."""
    return not isinstance(workers, int) or workers > 1


def on_this_machine(workers: Workers) -> int:
    """How many processes do jobs that write files here: a crew may have other disks."""
    return workers if isinstance(workers, int) else 1


def each(function: Callable[[J], R], jobs: Sequence[J], workers: Workers, *, in_order: bool = False) -> Iterator[R]:
    """What a function makes of each job.

    Args:
        function: importable from a module.
        jobs: its arguments.
        workers: how many processes; with one, this process does them, each when its result is asked for. Or a crew.
        in_order: whether results come in the order of their jobs, else in order of arrival.

    Raises:
        WorkerLostError: a worker was ended from outside; the results before it have been given.
    """
    if not isinstance(workers, int):
        yield from workers.each(function, jobs, in_order=in_order)
        return
    checked_workers(workers)
    if workers == 1 or len(jobs) < 2:
        yield from map(function, jobs)
        return
    from joblib import Parallel, delayed, parallel_config
    from joblib.externals.loky.backend import resource_tracker
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    with _no_hangup():  # else a terminal that closes ends it first, and another one says that it knows nothing
        resource_tracker.ensure_running()
    settings = {"initializer": begin_worker, "initargs": (os.getpid(), tuple(sys.path), edits())}
    with parallel_config(backend="loky", inner_max_num_threads=1, **settings):
        processes = min(workers, max(len(jobs), os.cpu_count() or 1))  # more would only wait
        parallel = Parallel(n_jobs=processes, return_as="generator" if in_order else "generator_unordered")
        try:
            yield from parallel(delayed(function)(job) for job in jobs)
        except TerminatedWorkerError:
            reason = "a worker was ended from outside, as systems do that run out of memory"
            raise WorkerLostError(f"{reason}; with fewer than {workers} workers less is needed") from None


@contextmanager
def _no_hangup() -> Iterator[None]:
    """Have processes that are started meanwhile not hear SIGHUP, where there is one; this one hears it after that."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def starred(function: Callable[..., R], arguments: Sequence[Any]) -> R:
    """A function of several arguments as one of a sequence of them; with `functools.partial`, for `each`."""
    return function(*arguments)


def add_to_path(path: Sequence[str]) -> None:
    """Import also from where another process does, after this one's own places."""
    sys.path.extend(place for place in path if place not in sys.path)


def begin_worker(parent: int, path: Sequence[str], edited: int) -> None:
    """Ready this process for jobs of its parent: it imports from where that does, and ends with it.

    Args:
        parent: its number.
        path: its `sys.path`, with what callers named since; where it is another one, waiting workers are started anew.
        edited: how often it has found files of theirs changed; likewise, as waiting workers have imported what these were.
    """
    sys.path[:] = path
    end_with(parent)


def end_with(parent: int) -> None:
    """Have this process end as soon as its parent, by its number, is no longer there.

    Linux can signal a child when its parent dies, but there "parent" is the thread that started it, which may end early.
    """
    if not hasattr(os, "getppid") or os.name == "nt":  # Windows tells the number of a parent that is gone, too
        return
    threading.Thread(target=_watch, args=(parent,), daemon=True, name="bug_gym parent watch").start()


def _watch(parent: int) -> None:
    pause = threading.Event()
    while os.getppid() == parent:
        pause.wait(GLANCE)
    os._exit(1)  # at once: nobody is left to clean up for, and the main thread may be in compiled code
