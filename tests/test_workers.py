"""Workers end with their parent, however that ends; results are those of one process, and what is finished is kept."""

from __future__ import annotations

import importlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil
import pytest
from signals import as_from_a_terminal

from bug_gym.evaluation import evaluate
from bug_gym.workers import each

ROOT = Path(__file__).resolve().parents[1]


def half(number: int) -> float:
    """A job."""
    return number / 2


@pytest.mark.parametrize("workers", [1, 2])
def test_results_in_order_are_those_of_a_loop(workers: int) -> None:
    assert list(each(half, range(20), workers, in_order=True)) == [number / 2 for number in range(20)]
    assert sorted(each(half, range(20), workers)) == [number / 2 for number in range(20)]


def test_workers_follow_a_module_that_was_edited_and_reloaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "my_edited_job.py").write_text("def speed(_): return 1\n")
    mine = importlib.import_module("my_edited_job")
    assert list(each(mine.speed, range(4), 2)) == [1] * 4
    (tmp_path / "my_edited_job.py").write_text("def speed(_): return 22\n")
    importlib.reload(mine)
    assert list(each(mine.speed, range(4), 2)) == [22] * 4


SLOW = ["--scenario", "moving_target", "--policies", "bug2", "--episodes", "4000", "--workers", "2"]
"""An evaluation of minutes, without shortest paths to look for before its first row."""


def started(out: Path) -> subprocess.Popen[str]:
    """An evaluation with two workers that has finished some rows."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "bug_gym", "evaluate", *SLOW, "--out", str(out)]
    process = subprocess.Popen(
        command, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True, preexec_fn=as_from_a_terminal
    )
    rows = out / "rows.jsonl"
    until(lambda: process.poll() is not None or (rows.exists() and rows.stat().st_size > 0), 240.0)
    assert process.poll() is None, process.communicate()[1]
    return process


def until(is_so: Any, seconds: float) -> bool:
    """Wait until something is so, or the time is over."""
    end = time.monotonic() + seconds
    while not is_so() and time.monotonic() < end:
        time.sleep(0.05)
    return bool(is_so())


def alive(processes: list[psutil.Process]) -> list[psutil.Process]:
    """Those that are still there; a process that nobody has waited for is not."""
    return [one for one in processes if one.is_running() and one.status() != psutil.STATUS_ZOMBIE]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
@pytest.mark.parametrize(
    ("name", "to_all"), [("SIGKILL", False), ("SIGTERM", False), ("SIGHUP", False), ("SIGTERM", True), ("SIGHUP", True)]
)
def test_no_process_is_left_of_an_evaluation_that_a_signal_ended(name: str, to_all: bool, tmp_path: Path) -> None:
    number = getattr(signal, name)
    process = started(tmp_path / "out")
    family = psutil.Process(process.pid).children(recursive=True)
    assert len(family) >= 2
    process.send_signal(number)
    for child in family if to_all else ():  # as a terminal that closes and the queue of a cluster do
        child.send_signal(number)
    _, said = process.communicate(timeout=30)
    assert until(lambda: not alive(family), 5.0), alive(family)
    if name == "SIGKILL":
        assert process.returncode == -number
    else:
        assert process.returncode == 128 + number
        assert "keeps what is done, the same command goes on" in said and "Traceback" not in said
    rows = [json.loads(line) for line in (tmp_path / "out" / "rows.jsonl").read_text().splitlines()]
    kept = {row["seed"]: row["path_length"] for row in rows}
    assert len(kept) == len(rows) > 0
    first = min(kept)
    (again,) = evaluate("bug2", "moving_target", episodes=1, seed=first)
    assert again.path_length == kept[first]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows has no such signals")
def test_a_worker_that_the_system_ends_is_told_in_one_line_and_its_rows_are_kept(tmp_path: Path) -> None:
    process = started(tmp_path / "out")
    workers = [
        child for child in psutil.Process(process.pid).children(recursive=True) if "loky" in " ".join(child.cmdline())
    ]
    busiest = max(workers, key=lambda child: sum(child.cpu_times()[:2]))
    busiest.kill()
    _, said = process.communicate(timeout=60)
    assert process.returncode == 2 and "Traceback" not in said
    errors = [line for line in said.splitlines() if "error" in line]
    assert len(errors) == 1 and "a worker was ended from outside" in errors[0]
    rows = (tmp_path / "out" / "rows.jsonl").read_text().splitlines()
    assert rows and all(json.loads(line)["policy"] == "bug2" for line in rows)
    assert until(lambda: not alive(workers), 5.0)
