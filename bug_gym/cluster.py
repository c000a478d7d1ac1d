"""Who does the jobs of a command on more than one machine: the nodes of a Ray cluster, in place of worker processes.

Of Ray only the core is used: a remote task a job, its result taken as it comes. A task whose process or node is lost is
done again elsewhere, and each job gives one result. What a job gives is a function of the job, so where it was done does
not matter. Each node needs this package, of the same source, and what jobs name by path (models, maps) at the same place.
"""

from __future__ import annotations

import logging
import os
import pickle
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import islice
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, TypeVar

from bug_gym.checks import needed_from, shortened
from bug_gym.references import edits, source_digest
from bug_gym.workers import WorkerLostError, add_to_path

if TYPE_CHECKING:
    import ray

J = TypeVar("J")
R = TypeVar("R")

RETRIES = 5
"""How often a job is tried again whose process or node was lost: nodes may go, but a job that ends its process must end."""
MEMORY_RETRIES, TOLD_RAY = 10, "RAY_task_oom_retries"
"""How often one is that was ended for want of memory, after a longer pause each time, and what tells Ray so, which would go on
for ever."""
AHEAD = 2
"""Jobs handed in for each core: one that runs, and one that waits for its end."""
GLANCE = 2.0
"""How often the cores of the cluster are counted [s]; nodes come and go."""
PATIENCE = 60.0
"""How long a cluster may be without any core [s]: one that grows on demand takes a while."""
GRACE = 2.0
"""Time that jobs have to end by themselves when nobody waits for them any more, before they are cancelled [s]."""
REACHABLE = 5.0
"""Time in which the head of a cluster has to answer [s]."""
EDITED = "BUG_GYM_EDITED"
"""Says to processes of nodes how often callers' files were found changed: others have imported what these were."""
GREETING = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes([0, 0, 0, 4, 0, 0, 0, 0, 0])
"""How a client of HTTP/2 begins (RFC 9113, section 3.4), which the head of a cluster speaks: then come settings, here none."""
ANSWER, KIND, SETTINGS = 9, 3, 4
"""How many bytes a server of HTTP/2 begins with, which of them tells what comes, and how it says that they are settings."""


class OtherSourceError(ValueError):
    """A node has this package of another source."""


class Cluster:
    """The cores of the Ray cluster that this process is connected to, as workers; made by `connected`.

    Args:
        lasts: whether the connection outlasts this: jobs that nobody waits for are cancelled at once then, else they end with
            it, or where more is asked.
    """

    def __init__(self, *, lasts: bool = True) -> None:
        self._lasts = lasts
        self._left: list[ray.ObjectRef[Any]] = []
        """Jobs that nobody waits for any more."""
        self._warm: set[str] = set()
        """Nodes on which a job has ended, so that what jobs compile lies on their disks."""
        self._cores = 0
        self._counted = -GLANCE

    @property
    def size(self) -> int:
        """How many jobs are done at a time."""
        import ray

        if monotonic() >= self._counted + GLANCE:
            resources: dict[str, float] = ray.cluster_resources()  # type: ignore[no-untyped-call]
            self._cores, self._counted = int(resources.get("CPU", 0.0)), monotonic()
        return self._cores

    def each(self, function: Callable[[J], R], jobs: Sequence[J], *, in_order: bool = False) -> Iterator[R]:
        """What a function makes of each job, as `bug_gym.workers.each` has it.

        A node that is new here gets one job at first, and more when that has ended: what jobs compile is compiled once a
        node then, and not by all of its processes at the same time.

        Raises:
            WorkerLostError: there is no node any more, or a job has lost its process again and again.
            OtherSourceError: a node has another source of this package.
            ImportError: a node has none.
        """
        arriving = self._arriving(function, jobs)
        if not in_order:
            yield from (result for _, result in arriving)
            return
        held: dict[int, R] = {}
        due = 0
        for number, result in arriving:
            held[number] = result
            while due in held:
                yield held.pop(due)
                due += 1

    def _arriving(self, function: Callable[[J], R], jobs: Sequence[J]) -> Iterator[tuple[int, R]]:
        """The number and the result of each job, in order of arrival."""
        import ray
        from ray import cloudpickle
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        edited: dict[str, Any] = {"runtime_env": {"env_vars": {EDITED: str(count)}}} if (count := edits()) else {}
        task: Any = ray.remote(num_cpus=1, max_retries=RETRIES, **edited)(_do)
        written: Callable[[Any], bytes] = cloudpickle.dumps
        given = (source_digest(), tuple(sys.path), str(Path.cwd()))
        waiting = iter(enumerate(jobs))
        running: dict[ray.ObjectRef[Any], int] = {}
        try:
            cold = self._nodes() - self._warm
            self._give_up()
            for node, (number, job) in zip(sorted(cold), waiting, strict=False):
                there = task.options(scheduling_strategy=NodeAffinitySchedulingStrategy(node, soft=True))
                running[there.remote(*given, written((function, job)))] = number
            while running:
                yield self._next(running)
            self._warm |= cold
            while True:
                room = max(AHEAD * self.size, 1) - len(running)
                for number, job in islice(waiting, max(room, 0)):
                    running[task.remote(*given, written((function, job)))] = number
                if not running:
                    return
                yield self._next(running)
        finally:
            self._left += running
            if self._lasts:
                self._give_up()

    def _next(self, running: dict[ray.ObjectRef[Any], int]) -> tuple[int, Any]:
        """Wait for one of the running jobs, and take it out."""
        import ray

        since = monotonic()
        while True:
            ended, _ = ray.wait(list(running), num_returns=1, timeout=GLANCE)
            if ended:
                return running.pop(ended[0]), _result(ended[0])
            if self.size:
                since = monotonic()
            elif monotonic() > since + PATIENCE:
                raise WorkerLostError(f"the cluster has had no core for {PATIENCE:.0f} s")

    def _give_up(self) -> None:
        """Cancel the jobs that nobody waits for any more.

        Ray 2.60 aborts the process that asks where the answer of a job comes in at the moment that it is cancelled ("Tried to
        complete task that was not pending"). So short jobs are left to end, and what is cancelled has long to go.
        """
        import ray

        left, self._left = self._left, []
        if not left:
            return
        _, still = ray.wait(left, num_returns=len(left), timeout=GRACE)
        for asked in still:
            ray.cancel(asked, force=True)

    @staticmethod
    def _nodes() -> set[str]:
        """The nodes that are there and have cores, by their numbers."""
        import ray

        nodes = ray.nodes()  # type: ignore[no-untyped-call]
        return {node["NodeID"] for node in nodes if node["Alive"] and node["Resources"].get("CPU", 0.0) >= 1.0}


def _do(source: str, path: Sequence[str], place: str, asked: bytes) -> Any:
    """Do a job on a node, in the folder of the machine that asks where there is such a one: a function and its argument."""
    if source != source_digest():
        raise OtherSourceError(f"node {socket.gethostname()} has another source of bug_gym than the machine that asks")
    with suppress(OSError):  # models are named from there
        os.chdir(place)
    add_to_path(path)  # what jobs are made of is read when it can be imported
    function, job = pickle.loads(asked)
    return function(job)


def _result(asked: ray.ObjectRef[R]) -> R:
    """The result of a job that has ended.

    Raises:
        WorkerLostError: it lost its process too often, or memory has never been enough for it.
        ImportError: this package is not to be imported on the node.
        Exception: what the job itself has raised.
    """
    import ray
    from ray.exceptions import OutOfMemoryError, RayError, RaySystemError, RayTaskError

    try:
        return ray.get(asked)
    except RayTaskError as error:
        if isinstance(error.cause, RaySystemError):  # before the job began
            reason = str(error.cause).partition("\n")[0]
            raise ImportError(f"a node cannot begin a job: {reason}") from None
        raise error.cause from None
    except OutOfMemoryError:
        less = "with fewer cores a node (ray start --num-cpus) less is needed"
        raise WorkerLostError(f"a job was ended again and again, as its node had too little memory; {less}") from None
    except RayError as error:
        lost = f"a job lost its process or node {RETRIES + 1} times"
        raise WorkerLostError(f"{lost}, last by {type(error).__name__}; is there memory enough?") from None


@contextmanager
def connected(address: str) -> Iterator[Cluster]:
    """Be connected to a Ray cluster; a connection that was there before is used, and stays.

    Args:
        address: `host:port` of its head, or "auto": the one that this machine is a node of, or RAY_ADDRESS names.

    Raises:
        ImportError: Ray is not installed; the message names the extra.
        ValueError: no cluster is there, or one of another version of Ray or Python.
    """
    with needed_from("cluster", "a cluster"):
        import ray
    if ray.is_initialized():
        yield Cluster()
        return
    if address != "auto":
        _require_answer(address)
    elif _is_place(named := os.environ.get("RAY_ADDRESS", "")):
        _require_answer(named, ", which RAY_ADDRESS names")
    os.environ.setdefault(TOLD_RAY, str(MEMORY_RETRIES))
    try:
        with _own_ending():
            ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
    except (ConnectionError, RuntimeError, ValueError) as error:
        reason = str(error).strip().partition("\n")[0]
        if address != "auto" and "RAY_AUTH_MODE" not in os.environ:  # with "auto" Ray sets it itself
            reason += " (if it asks for a token, as those of `ray start` since Ray 2.59: export RAY_AUTH_MODE=token)"
        raise ValueError(f"no cluster to be used at {shortened(address)}: {reason}") from None
    try:
        yield Cluster(lasts=False)
    finally:
        ray.shutdown()


@contextmanager
def _own_ending() -> Iterator[None]:
    """Keep what a SIGTERM was to do, where somebody has said it: Ray ends the process with a report of its own instead."""
    asked = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        if callable(asked) and threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, asked)


def _is_place(address: str) -> bool:
    """Whether an address is HOST:PORT."""
    host, _, port = address.rpartition(":")
    return bool(host) and port.isdecimal() and "/" not in host


def _require_answer(address: str, whence: str = "") -> None:
    """Refuse at once what Ray itself would wait for some minutes, in which it hears no signal.

    Args:
        address: of the head.
        whence: who has named it, as an error says it; "": the caller.

    Raises:
        ValueError: it is no address, or no head answers there.
    """
    if not _is_place(address):
        raise ValueError(f"got {shortened(address)} as the address of a cluster, expected auto or HOST:PORT")
    host, _, port = address.rpartition(":")
    try:
        with socket.create_connection((host, int(port)), REACHABLE) as line:
            if os.environ.get("RAY_USE_TLS", "0").lower() in ("1", "true"):  # whose answer only Ray can read
                return
            line.sendall(GREETING)
            with line.makefile("rb") as stream:
                answer = stream.read(ANSWER)
    except (OSError, OverflowError) as error:
        raise ValueError(f"no cluster answers at {address}{whence}: {error}") from None
    if len(answer) < ANSWER or answer[KIND] != SETTINGS:
        raise ValueError(f"no cluster answers at {address}{whence}: what does is no head of one, is it another port?")
