"""A cluster of two nodes on this machine does what one process does, and loses nothing when a node goes."""

from __future__ import annotations

import importlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from signals import as_from_a_terminal

from bug_gym import cluster as cluster_module
from bug_gym.cli import main
from bug_gym.cluster import Cluster, OtherSourceError, connected
from bug_gym.evaluation import evaluate
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.workers import Crew, WorkerLostError, each

ray = pytest.importorskip("ray", reason="of the extra `cluster`")
pytestmark = pytest.mark.skipif(os.name == "nt", reason="Ray's local clusters are of POSIX systems")


ASKED_HOW_THEY_ARE = {"health_check_initial_delay_ms": 500, "health_check_period_ms": 500}
"""How soon Ray notices that a node has gone; each may be as slow to answer as ever. Otherwise it takes some 15 s."""


class Nodes:
    """A cluster whose head has no core, and whose nodes have one each."""

    def __init__(self) -> None:
        from ray.cluster_utils import Cluster as LocalCluster

        head = {"num_cpus": 0, "include_dashboard": False, "_system_config": ASKED_HOW_THEY_ARE}
        self.local = LocalCluster(initialize_head=True, head_node_args=head)
        self.nodes = [self.local.add_node(num_cpus=1) for _ in range(2)]

    @property
    def address(self) -> str:
        """Of its head."""
        return str(self.local.address)

    def kill(self) -> None:
        """End a node as a power cut does."""
        self.local.remove_node(self.nodes.pop(), allow_graceful=False)

    def mend(self) -> None:
        """Have two nodes again."""
        while len(self.nodes) < 2:
            self.nodes.append(self.local.add_node(num_cpus=1))


@pytest.fixture(scope="module")
def nodes() -> Iterator[Nodes]:
    made = Nodes()
    yield made
    made.local.shutdown()  # type: ignore[no-untyped-call]


@pytest.fixture(scope="module")
def connection(nodes: Nodes) -> Iterator[Cluster]:
    with connected(nodes.address) as made:
        yield made


@pytest.fixture
def cluster(connection: Cluster, nodes: Nodes) -> Cluster:
    nodes.mend()
    return connection


def half(number: int) -> float:
    """A job."""
    return number / 2


def slowly(number: int) -> int:
    """A job of some time."""
    time.sleep(0.05)
    return number


def refuse(number: int) -> int:
    """A job that is asked for nonsense."""
    raise ValueError(f"got {number}, expected better")


def die(number: int) -> int:
    """A job that ends its process."""
    os._exit(1)


def test_results_are_those_of_a_loop(cluster: Cluster) -> None:
    assert isinstance(cluster, Crew) and cluster.size == 2
    assert list(each(half, range(30), cluster, in_order=True)) == [number / 2 for number in range(30)]
    assert sorted(each(half, range(30), cluster)) == [number / 2 for number in range(30)]
    assert list(each(half, [], cluster)) == []


def test_a_job_says_itself_what_is_wrong(cluster: Cluster) -> None:
    with pytest.raises(ValueError, match=r"^got 0, expected better$"):
        list(each(refuse, [0], cluster))
    assert list(each(half, [3], cluster)) == [1.5]


def where(_: int) -> str:
    """A job."""
    return str(Path.cwd())


def test_jobs_are_done_in_the_folder_of_who_asks(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert list(each(where, [0], cluster)) == [str(tmp_path)]
    monkeypatch.chdir("/")
    assert list(each(where, [0], cluster)) == ["/"]


def test_nodes_follow_a_module_that_was_edited_and_reloaded(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "my_edited_task.py").write_text("def speed(_): return 1\n")
    mine = importlib.import_module("my_edited_task")
    assert list(each(mine.speed, range(4), cluster)) == [1] * 4
    (tmp_path / "my_edited_task.py").write_text("def speed(_): return 22\n")
    importlib.reload(mine)
    assert list(each(mine.speed, range(4), cluster)) == [22] * 4


def test_a_job_that_ends_its_process_ends(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "RETRIES", 1)
    with pytest.raises(WorkerLostError, match="a job lost its process or node 2 times"):
        list(each(die, [0], cluster))


def nap(seconds: float) -> float:
    """A job that is as long as it is told."""
    time.sleep(seconds)
    return seconds


@pytest.mark.parametrize(
    ("lasts", "seconds", "grace", "count"), [(True, 600.0, 0.1, 3), (True, 0.1, 60.0, 0), (False, 0.5, 0.0, 0)]
)
def test_of_jobs_that_nobody_waits_for_long_ones_are_cancelled_where_the_connection_stays(
    lasts: bool, seconds: float, grace: float, count: int, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    cancel, cancelled = ray.cancel, []

    def noted(asked: Any, *, force: bool) -> None:
        cancelled.append(asked)
        cancel(asked, force=force)

    monkeypatch.setattr(ray, "cancel", noted)
    monkeypatch.setattr(cluster_module, "GRACE", grace)
    arriving = Cluster(lasts=lasts).each(nap, [0.0, 0.0, 0.0, *[seconds] * 40])
    assert [next(arriving) for _ in range(3)] == [0.0] * 3  # one on each node, and one of the four that came then
    assert isinstance(arriving, Generator)
    arriving.close()
    assert len(cancelled) == count
    assert list(each(half, range(4), cluster, in_order=True)) == [0.0, 0.5, 1.0, 1.5]


def test_jobs_that_nobody_waits_for_keep_no_core_from_those_that_are_asked_then(
    cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "GRACE", 0.1)
    mine = Cluster(lasts=False)
    arriving = mine.each(nap, [0.0, 0.0, 0.0, *[90.0] * 40])
    assert [next(arriving) for _ in range(3)] == [0.0] * 3
    time.sleep(3.0)  # both cores are taken
    assert isinstance(arriving, Generator)
    arriving.close()
    began = time.monotonic()
    assert list(each(half, range(4), mine, in_order=True)) == [0.0, 0.5, 1.0, 1.5]
    assert time.monotonic() - began < 60.0


def test_a_node_of_another_source_is_refused(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "source_digest", lambda: "another")
    with pytest.raises(OtherSourceError, match="has another source of bug_gym"):
        list(each(half, [0], cluster))


class Watched:
    """A cluster of which a node is killed once some results have come."""

    def __init__(self, cluster: Cluster, kill: Callable[[], None], after: int) -> None:
        self.cluster, self.kill, self.left = cluster, kill, after

    @property
    def size(self) -> int:
        return self.cluster.size

    def each(self, function: Callable[[Any], Any], jobs: Sequence[Any], *, in_order: bool = False) -> Iterator[Any]:
        for result in self.cluster.each(function, jobs, in_order=in_order):
            yield result
            self.left -= 1
            if not self.left:
                self.kill()


def without_times(rows: Sequence[EpisodeRow]) -> list[str]:
    """What rows say, but for what a clock has measured."""
    names = [name for name in EpisodeRow.__annotations__ if not name.startswith("decision_time")]
    return [repr([getattr(row, name) for name in names]) for row in rows]


def test_nothing_is_lost_and_nothing_comes_twice_when_a_node_goes(cluster: Cluster, nodes: Nodes) -> None:
    watched = Watched(cluster, nodes.kill, after=10)
    assert sorted(each(slowly, range(60), watched)) == list(range(60))


def test_an_evaluation_with_a_lost_node_gives_the_rows_of_one_process(
    cluster: Cluster, nodes: Nodes, tmp_path: Path
) -> None:
    policies, scenarios = ["bug2", "go_to_goal"], ["moving_target", "static"]
    # 2 x 2 x 3 blocks of worlds after the three blocks of shortest paths
    watched = Watched(cluster, nodes.kill, after=3 + 5)
    rows = evaluate(policies, scenarios, episodes=24, workers=watched, out=tmp_path / "out")
    assert watched.left <= 0 and len(nodes.nodes) == 1
    assert without_times(rows) == without_times(evaluate(policies, scenarios, episodes=24))
    assert len((tmp_path / "out" / "rows.jsonl").read_text().splitlines()) == len(rows) == 96


def test_a_cluster_without_cores_is_waited_for_in_vain(
    cluster: Cluster, nodes: Nodes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "PATIENCE", 0.5)
    nodes.kill()
    nodes.kill()
    with pytest.raises(WorkerLostError, match="the cluster has had no core"):
        list(each(half, range(3), cluster))


@pytest.mark.parametrize(
    ("address", "told"),
    [
        ("nowhere", "got 'nowhere' as the address of a cluster, expected auto or HOST:PORT"),
        ("ray://host:1", "got 'ray://host:1' as the address of a cluster, expected auto or HOST:PORT"),
        ("127.0.0.1:1", "no cluster answers at 127.0.0.1:1: "),
        ("127.0.0.1:99999", "no cluster answers at 127.0.0.1:99999: "),
    ],
)
def test_a_cluster_that_is_not_there_is_told_in_one_line(
    address: str, told: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    arguments = ["evaluate", "--scenario", "static", "--policies", "bug2", "--episodes", "1", "--cluster", address]
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"bug-gym: error: {told}") and said.count("\n") == 1


@contextmanager
def listening(greeting: bytes | None) -> Iterator[str]:
    """The address of what takes a connection and says something, then ends it; None: it says nothing and waits."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        over = threading.Event()

        def serve() -> None:
            line, _ = server.accept()
            with line:
                if greeting is None:
                    over.wait(60.0)
                else:
                    line.sendall(greeting)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield f"127.0.0.1:{server.getsockname()[1]}"
        over.set()
        thread.join()


@pytest.mark.parametrize("greeting", [None, b"", b"SSH-2.0-OpenSSH_9.9\r\n", b"HTTP/1.1 400 Bad Request\r\n\r\n"])
@pytest.mark.parametrize("is_named", [False, True])
def test_what_listens_and_is_no_cluster_is_told_at_once(
    greeting: bytes | None, is_named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "REACHABLE", 0.5)
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    monkeypatch.setattr(ray, "init", lambda **_: pytest.fail("Ray would wait for some minutes"))
    with listening(greeting) as address:
        monkeypatch.setenv("RAY_ADDRESS", address)
        told = f"no cluster answers at {address}{', which RAY_ADDRESS names' if is_named else ''}: "
        with pytest.raises(ValueError, match=told), connected("auto" if is_named else address):
            pass


def test_a_cluster_that_encrypts_is_left_to_ray(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAY_USE_TLS", "1")
    with listening(b"") as address:
        cluster_module._require_answer(address)


@pytest.mark.slow
def test_a_signal_ends_an_evaluation_on_a_cluster_as_one_without(nodes: Nodes, tmp_path: Path) -> None:
    nodes.mend()
    root, rows = Path(__file__).resolve().parents[1], tmp_path / "out" / "rows.jsonl"
    asked = ["--scenario", "moving_target", "--policies", "bug2", "--episodes", "4000", "--cluster", nodes.address]
    command = [sys.executable, "-m", "bug_gym", "evaluate", *asked, "--out", str(tmp_path / "out")]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    process = subprocess.Popen(
        command, cwd=root, env=environment, stderr=subprocess.PIPE, text=True, preexec_fn=as_from_a_terminal
    )
    deadline = time.monotonic() + 240.0
    while not (rows.exists() and rows.stat().st_size) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.1)
    process.terminate()
    _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGTERM, said
    assert said.splitlines()[-1].endswith("keeps what is done, the same command goes on") and "SIGTERM" not in said


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(__import__("sys").modules, "ray", None)
    assert main(["reproduce", "oni-wang-table-1", "--cluster", "auto"]) == 2
    assert "a cluster needs ray, of the extra `cluster`" in capsys.readouterr().err


def test_workers_and_a_cluster_exclude_one_another(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["evaluate", "--scenario", "static", "--workers", "2", "--cluster", "auto"])
    assert left.value.code == 2
    assert "not allowed with argument" in capsys.readouterr().err


MEMORY_IS_NEVER_ENOUGH = """
import time
from ray.cluster_utils import Cluster
from bug_gym import cluster
from bug_gym.workers import WorkerLostError, each

cluster.MEMORY_RETRIES = 1
watched = {"memory_usage_threshold": 0.001, "memory_monitor_refresh_ms": 100}
nodes = Cluster(True, head_node_args={"num_cpus": 1, "include_dashboard": False, "_system_config": watched})
with cluster.connected(nodes.address) as crew:
    try:
        list(each(time.sleep, [60.0], crew))
    except WorkerLostError as error:
        print(f"told: {error}")
nodes.shutdown()
"""


def test_a_job_for_which_memory_is_never_enough_is_given_up() -> None:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("RAY_")}
    done = subprocess.run(
        [sys.executable, "-c", MEMORY_IS_NEVER_ENOUGH],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert "told: a job was ended again and again, as its node had too little memory" in done.stdout, done.stderr[
        -2000:
    ]


@pytest.mark.parametrize(("mode", "is_told"), [(None, True), ("token", False), ("disabled", False)])
def test_who_is_not_let_in_is_told_of_tokens(mode: str | None, is_told: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(**_: Any) -> None:
        raise ConnectionError("Failed to connect")

    monkeypatch.delenv("RAY_AUTH_MODE", raising=False)
    if mode is not None:
        monkeypatch.setenv("RAY_AUTH_MODE", mode)
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    monkeypatch.setattr(ray, "init", refused)
    monkeypatch.setattr(cluster_module, "_require_answer", lambda *_: None)
    with (
        pytest.raises(ValueError, match="no cluster to be used at '10.0.0.1:6379': Failed") as told,
        connected("10.0.0.1:6379"),
    ):
        pass
    assert ("RAY_AUTH_MODE=token" in str(told.value)) == is_told
