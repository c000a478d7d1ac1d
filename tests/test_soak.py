"""The soak sees what it is there to see: rows lost and doubled, processes left behind, memory that grows."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

if sys.platform == "win32":
    pytest.skip("the soak kills by signals, which Windows does not have", allow_module_level=True)

import soak

PARENT = """
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", {child!r}], stdin=subprocess.PIPE)
print("ready", flush=True)
time.sleep(600)
"""
STAYS = "import time; time.sleep(600)"
LEAVES = "import sys; sys.stdin.read()"


def row(seed: int, **changes: Any) -> dict[str, Any]:
    """A row of a results folder, as far as the soak looks at it."""
    return {"policy": "bug2", "scenario": "static", "seed": seed, "time": 3.5, "decision_time_mean": 0.1, **changes}


def task_with(folder: Path, rows: list[dict[str, Any]], whole: list[dict[str, Any]]) -> soak.Task:
    """A task whose folder holds some rows, where others were due."""
    task = soak.Task("evaluate", soak.evaluation, soak.rows_and_paths)
    for name, some in (("whole", whole), ("found", rows)):
        (folder / name).mkdir()
        (folder / name / "rows.jsonl").write_text("".join(json.dumps(one) + "\n" for one in some), encoding="utf-8")
    task.whole = soak.rows_and_paths(folder / "whole")
    return task


WHOLE = [row(0), row(1), row(2)]


@pytest.mark.parametrize(
    ("rows", "lost", "extra"),
    [
        ([row(2), row(0, decision_time_mean=0.7), row(1)], 0, 0),
        ([row(0), row(1)], 1, 0),
        ([row(0), row(1), row(1), row(2)], 0, 1),
        ([row(0), row(1, time=3.6), row(2)], 1, 1),
    ],
)
def test_rows_that_are_lost_doubled_or_changed_are_counted(
    rows: list[dict[str, Any]], lost: int, extra: int, tmp_path: Path
) -> None:
    task = task_with(tmp_path, rows, WHOLE)
    task.compare(tmp_path / "found")
    assert (task.finished, task.compared, task.lost, task.extra) == (1, 3, lost, extra)


def test_a_row_that_was_driven_again_is_counted(tmp_path: Path) -> None:
    task = task_with(tmp_path, [row(0), row(1, decision_time_mean=0.2), row(2)], WHOLE)
    task.kept = {json.dumps(row(0)), json.dumps(row(1))}
    task.compare(tmp_path / "found")
    assert (task.lost, task.extra, task.forgotten) == (0, 0, 1)


def test_a_line_that_a_kill_cut_short_is_no_row(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    path.write_bytes(b'{"seed": 0}\n{"se')
    assert soak.lines_of(path) == ['{"seed": 0}']
    assert soak.lines_of(tmp_path / "missing") == []


@pytest.mark.parametrize(("child", "left"), [(STAYS, 1), (LEAVES, 0)])
@pytest.mark.parametrize("sign", soak.SIGNALS)
def test_processes_that_outlive_their_command_are_counted_and_killed(
    child: str, left: int, sign: signal.Signals
) -> None:
    command = [sys.executable, "-c", PARENT.format(child=child)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True) as process:
        assert process.stdout is not None and process.stdout.readline() == b"ready\n"
        assert len(soak.members(process.pid)) == 2
        # One that leaves gets all the time it may need, one that stays none that would be waited for in vain.
        assert soak.stop(process, sign, grace=0.1 if left else 60.0) == left
        assert process.returncode == -sign
        assert soak.members(process.pid) == []
    assert soak.members(os.getpgid(0))  # this one is still there


def test_a_command_that_ends_by_itself_is_not_killed() -> None:
    end = soak.run(["evaluate", "--suite", "smokey"], math.inf, signal.SIGKILL)
    assert (end.killed, end.code, end.left_behind) == (False, 2, 0)
    assert "smoke" in end.said


def samples(*, growth: float) -> list[soak.Sample]:
    """Samples of a process of 100 MiB that begins with a jump, then grows by some bytes a second."""
    calm = [soak.Sample(float(second), 512 * second, 100 * 2**20 + int(growth * second)) for second in range(21, 141)]
    return [soak.Sample(1.0, 512, 20 * 2**20), *calm]


def test_the_line_through_memory_has_its_slope_and_leaves_out_the_warm_up() -> None:
    found = soak.memory(samples(growth=1024.0))
    assert found["slope_kib_per_minute"] == pytest.approx(60.0, abs=0.01)
    assert found["samples"] == 120 and found["seconds"] == 140.0
    assert found["rise"] == pytest.approx(119 / (100 * 1024), rel=0.01)


def record(**changes: Any) -> dict[str, Any]:
    """What a soak found in which everything held, but for some changes of its evaluation."""
    task = soak.Task("evaluate", soak.evaluation, soak.rows_and_paths, finished=1).record()
    return {"evaluate": task | changes, "train": task, "vector_env": soak.memory(samples(growth=0.0))}


def test_a_soak_holds_where_nothing_went_wrong() -> None:
    assert soak.holds(record())


@pytest.mark.parametrize(
    "changes",
    [{"lost": 1}, {"extra": 1}, {"forgotten": 1}, {"left_behind": 1}, {"failures": ["exit code 2"]}, {"finished": 0}],
)
def test_a_soak_does_not_hold_where_something_did(changes: dict[str, Any]) -> None:
    assert not soak.holds(record(**changes))


def test_a_soak_does_not_hold_where_memory_grows() -> None:
    assert not soak.holds(record() | {"vector_env": soak.memory(samples(growth=2**15))})
