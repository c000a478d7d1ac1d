"""Work that is killed again and again: is anything lost or doubled, is anything left behind, does memory grow?

Three kinds of work take turns. `bug-gym evaluate --workers 2` and `bug-gym train` (a small PPO) are killed at a random
moment of each turn of at most a minute, by SIGKILL or by SIGTERM, and go on in the same folder in the next; what they end
with is compared with what runs that nobody disturbed have made. The native vector env is stepped by one process that lives
from the first turn to the last, as memory that grows shows only over time.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
import psutil

import bug_gym
from bug_gym.files import machine

ROOT = Path(__file__).resolve().parents[1]

TURN = (5.0, 60.0)
"""When in a turn the kill comes: anywhere between these [s]."""
STEPPING = 20.0
"""A turn of the vector env [s]."""
WARM_UP = 20.0
"""Stepping that does not count for memory [s]: rows still grow to the largest world that they meet."""
GRACE = 5.0
"""Time in which the processes of a command have to end with it [s]."""
FLAT = 0.01
"""Share of its memory that the vector env may grow by, along the fitted line from the first sample to the last."""
WORLDS = 512
"""Rows of the vector env."""
SIGNALS = (signal.SIGKILL, signal.SIGTERM)

EPISODES = 40
POLICIES = ("bug2", "tangent_bug", "hd_bug")
SCENARIOS = ("static", "dynamic", "crossing_robots")
MOST_ROBOTS = 2
"""Robots of a world, whose rows are written at once: so many lines a kill may cost."""
TRAINING = {
    "algo": "ppo",
    "scenarios": ["dynamic"],
    "n_envs": 128,
    "n_steps": 32,
    "batch_size": 1024,
    "n_timesteps": 1_000_000,
    "eval_freq": 200_000,
    "eval_episodes": 100,
    "test_episodes": 100,
    "save_freq": 40_000,
}

Contents = Counter[str]
"""What a folder holds, piece by piece, and how often."""

# --------------------------------------------------------------------------------------------------- what has to come out


def rows_and_paths(folder: Path) -> Contents:
    """The rows of a results folder without what a clock has measured, and its shortest paths."""
    rows = [json.loads(line) for line in lines_of(folder / "rows.jsonl")]
    kept = [{name: value for name, value in row.items() if not name.startswith("decision_time")} for row in rows]
    return Counter([*map(json.dumps, kept), *lines_of(folder / "shortest_paths.jsonl")])


def model_and_curve(folder: Path) -> Contents:
    """The checksums of a trained model, its validations without what a clock has measured, and its test."""
    record = json.loads((folder / "config.json").read_text(encoding="utf-8"))
    (run,) = record["runs"].values()
    points = [{name: value for name, value in point.items() if "seconds" not in name} for point in run["curve"]]
    return Counter(map(json.dumps, [record["sha256"], *points, run["held_out"]]))


def lines_of(path: Path) -> list[str]:
    """The whole lines of a file; none where it is not there yet."""
    if not path.exists():
        return []
    *whole, _ = path.read_bytes().split(b"\n")
    return [line.decode() for line in whole]


def evaluation(folder: Path) -> list[str]:
    """Arguments of the evaluation."""
    scenarios = [word for name in SCENARIOS for word in ("--scenario", name)]
    policies = ("--policies", ",".join(POLICIES), "--episodes", str(EPISODES))
    return ["evaluate", *scenarios, *policies, "--workers", "2", "--out", str(folder)]


def training(folder: Path) -> list[str]:
    """Arguments of the training, whose YAML lies beside its folder."""
    settings = folder.parent / "soak.yaml"
    settings.write_text(json.dumps(TRAINING), encoding="utf-8")
    return ["train", str(settings), "--threads", "1", "--out", str(folder)]


@dataclass
class Task:
    """A command that is killed and goes on, and what came of it."""

    name: str
    arguments: Callable[[Path], list[str]]
    """Arguments of `bug-gym` that work in a folder."""
    contents: Callable[[Path], Contents]
    """What a finished folder holds that has to be the same each time."""
    whole: Contents = field(default_factory=Counter)
    """What it holds after a run that nobody disturbed."""
    seconds: float = 0.0
    """How long that run took."""
    kept: set[str] = field(default_factory=set)
    """Rows that were on the disk when the present run was killed."""
    starts: int = 0
    """Starts of the command, the undisturbed one not counted."""
    kills: Counter[str] = field(default_factory=Counter)
    """How often it was killed, by signal."""
    finished: int = 0
    """Runs that came to their end."""
    compared: int = 0
    """Pieces that their folders had to hold."""
    lost: int = 0
    """Pieces that were missing there."""
    extra: int = 0
    """Pieces that were there twice, or differed."""
    forgotten: int = 0
    """Rows that were on the disk at a kill and not at the end: work that was done twice."""
    left_behind: int = 0
    """Processes that outlived their command."""
    failures: list[str] = field(default_factory=list)
    """What was said by starts that neither ended well nor were killed."""

    def begin(self, work: Path) -> None:
        """Find out what has to come out.

        Raises:
            RuntimeError: the command fails even if nobody disturbs it.
        """
        folder, began = work / f"{self.name}-whole", time.monotonic()
        end = run(self.arguments(folder), math.inf, signal.SIGKILL)
        if end.code != 0:
            raise RuntimeError(f"{self.name} fails undisturbed: {end.said}")
        self.seconds = time.monotonic() - began
        self.whole = self.contents(folder)

    def folder(self, work: Path) -> Path:
        """Of the present run."""
        return work / f"{self.name}-{self.finished + len(self.failures)}"

    def take_turn(self, work: Path, seconds: float, sign: signal.Signals) -> None:
        """Go on until a kill, or until the run is done and compared."""
        folder = self.folder(work)
        end = run(self.arguments(folder), seconds, sign)
        self.starts += 1
        self.left_behind += end.left_behind
        if end.killed:
            self.kills[sign.name] += 1
            self.kept.update(lines_of(folder / "rows.jsonl")[:-MOST_ROBOTS])
            return
        if end.code == 0:
            self.compare(folder)
        else:
            self.failures.append(f"exit code {end.code}: {end.said}".replace(f"{work}/", ""))
        self.kept.clear()

    def compare(self, folder: Path) -> None:
        """Count what a finished folder lacks and what it has too much of."""
        found = self.contents(folder)
        self.finished += 1
        self.compared += len(self.whole)
        self.lost += (self.whole - found).total()
        self.extra += (found - self.whole).total()
        self.forgotten += len(self.kept - set(lines_of(folder / "rows.jsonl")))

    def record(self) -> dict[str, Any]:
        """What came of it, for JSON."""
        counts = ("starts", "finished", "compared", "lost", "extra", "forgotten", "left_behind", "failures")
        told = {name: getattr(self, name) for name in counts}
        return {"undisturbed_seconds": round(self.seconds, 1), "kills": dict(self.kills), **told}


# ------------------------------------------------------------------------------------------------------------- processes


class End(NamedTuple):
    """How a command ended."""

    killed: bool
    code: int
    left_behind: int
    """Processes of its own that lived on for longer than GRACE."""
    said: str
    """The last line that it wrote as an error."""


def run(arguments: Sequence[str], seconds: float, sign: signal.Signals) -> End:
    """Run `bug-gym`, killed after some seconds if it is not over by then."""
    with tempfile.TemporaryFile() as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "bug_gym", *arguments],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            start_new_session=True,
        )
        try:
            process.wait(None if math.isinf(seconds) else seconds)
            killed = False
        except subprocess.TimeoutExpired:
            killed = True
        finally:
            left_behind = stop(process, sign)
        errors.seek(0)
        said = errors.read().decode(errors="replace").strip().splitlines()
    return End(killed, process.returncode, left_behind, said[-1] if said else "")


def stop(process: subprocess.Popen[bytes], sign: signal.Signals, grace: float = GRACE) -> int:
    """Kill the leader of a group of processes, and tell how many of the group outlive it; then those are killed too."""
    group = process.pid
    if process.poll() is None:
        process.send_signal(sign)
    until = time.monotonic() + grace
    while (left := members(group)) and time.monotonic() < until:
        process.poll()  # which takes note of its end
        time.sleep(0.05)
    for one in left:
        one.kill()
    psutil.wait_procs(left, timeout=grace)
    process.wait()
    return len(left)


def members(group: int) -> list[psutil.Process]:
    """The living processes of a group."""
    return [process for process in psutil.process_iter() if is_member(process, group)]


def is_member(process: psutil.Process, group: int) -> bool:
    """Whether a process lives and is of a group."""
    try:
        return os.getpgid(process.pid) == group and process.status() != psutil.STATUS_ZOMBIE
    except (ProcessLookupError, PermissionError, psutil.NoSuchProcess):
        return False


# ---------------------------------------------------------------------------------------------------------------- memory


class Sample(NamedTuple):
    """Memory of the process that steps the vector env."""

    seconds: float
    """Stepping so far [s]."""
    steps: int
    """Steps of all rows so far."""
    rss: int
    """Resident memory [bytes]."""


def step_worlds(orders: Connection) -> None:
    """Step the native vector env for as many seconds as are ordered; answers a sample a second."""
    env = gym.make_vec("BugGym/Dynamic-v0", num_envs=WORLDS, observation="flat")
    env.action_space.seed(0)
    env.reset(seed=0)
    process, seconds, steps = psutil.Process(), 0.0, 0
    for ordered in iter(orders.recv, None):
        samples: list[Sample] = []
        until = seconds + ordered
        while seconds < until:
            began = time.monotonic()
            while time.monotonic() < began + 1.0:
                env.step(env.action_space.sample())
                steps += WORLDS
            seconds += time.monotonic() - began
            samples.append(Sample(seconds, steps, process.memory_info().rss))
        orders.send(samples)


@contextmanager
def stepping() -> Iterator[Callable[[float], list[Sample]]]:
    """A process of its own that steps the vector env for as many seconds as it is told to."""
    context = get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=step_worlds, args=(theirs,), daemon=True)
    process.start()
    theirs.close()  # so that the end of the process is seen here

    def go_on(seconds: float) -> list[Sample]:
        ours.send(seconds)
        samples: list[Sample] = ours.recv()
        return samples

    try:
        yield go_on
        ours.send(None)
    finally:
        process.join(GRACE)
        process.kill()


def memory(samples: Sequence[Sample]) -> dict[str, Any]:
    """The line through the memory that was sampled, and the share that it rises by.

    Raises:
        ValueError: there are no two samples after the warm-up.
    """
    counted = [sample for sample in samples if sample.seconds > WARM_UP]
    if len(counted) < 2:
        raise ValueError(f"got {len(counted)} samples after {WARM_UP:.0f} s of stepping, expected 2: soak for longer")
    seconds = np.array([sample.seconds for sample in counted])
    rss = np.array([sample.rss for sample in counted], dtype=np.float64)
    slope = float(np.polyfit(seconds - seconds[0], rss, 1)[0])
    return {
        "worlds": WORLDS,
        "seconds": round(counted[-1].seconds, 1),
        "steps": counted[-1].steps,
        "samples": len(counted),
        "rss_mib": {"mean": mib(rss.mean()), "least": mib(rss.min()), "most": mib(rss.max())},
        "slope_kib_per_minute": round(60.0 * slope / 2**10, 2),
        "rise": round(slope * float(seconds[-1] - seconds[0]) / float(rss.mean()), 6),
    }


def mib(size: float) -> float:
    """Bytes as MiB."""
    return round(float(size) / 2**20, 2)


# -------------------------------------------------------------------------------------------------------------- the soak


def soak(minutes: float, seed: int, work: Path) -> dict[str, Any]:
    """Let the tasks take turns for some minutes, then finish what was begun.

    Args:
        minutes: time for the turns; the undisturbed runs before and the last ones after come on top.
        seed: of the moments and kinds of the kills.
        work: an empty folder.

    Returns:
        What came of it, for JSON.
    """
    tasks = (Task("evaluate", evaluation, rows_and_paths), Task("train", training, model_and_curve))
    for task in tasks:
        task.begin(work)
        tell(f"{task.name}: {task.seconds:.0f} s undisturbed, {len(task.whole)} things to compare")
    random = np.random.default_rng(seed)
    samples: list[Sample] = []
    began = time.monotonic()
    with stepping() as step:
        while time.monotonic() < began + 60.0 * minutes:
            for task in tasks:
                task.take_turn(work, random.uniform(*TURN), SIGNALS[random.integers(len(SIGNALS))])
                tell(f"{(time.monotonic() - began) / 60.0:.1f} min: {task.name} {task.record()}")
            samples += step(STEPPING)
    took = time.monotonic() - began
    for task in tasks:
        if task.folder(work).exists():
            task.take_turn(work, math.inf, signal.SIGKILL)
    found = {task.name: task.record() for task in tasks} | {"vector_env": memory(samples)}
    return {"minutes": round(took / 60.0, 1), "seed": seed, "turn_seconds": TURN, "most_rise": FLAT, **found}


def holds(found: Mapping[str, Any]) -> bool:
    """Whether nothing was lost, doubled or left behind, and memory is flat."""
    wrong = ("lost", "extra", "forgotten", "left_behind", "failures")
    tasks = [found["evaluate"], found["train"]]
    return (
        found["vector_env"]["rise"] <= FLAT
        and all(task["finished"] > 0 for task in tasks)
        and not any(task[name] for task in tasks for name in wrong)
    )


def tell(text: str) -> None:
    """Say how far it is."""
    print(text, file=sys.stderr, flush=True)


def commit() -> str:
    """The commit that is soaked."""
    told = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=False)
    return told.stdout.strip() if told.returncode == 0 else "unknown"


def main(arguments: Sequence[str] | None = None) -> int:
    """Soak, and write what came of it."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=60.0, help="time of the turns (default: 60)")
    parser.add_argument("--seed", type=int, default=0, help="of the kills (default: 0)")
    parser.add_argument("--out", type=Path, help="JSON to write (default: on the terminal only)")
    options = parser.parse_args(arguments)
    made_by = {"bug_gym": bug_gym.__version__, "commit": commit(), "python": platform.python_version()}
    with tempfile.TemporaryDirectory() as work:
        found = soak(options.minutes, options.seed, Path(work))
    record = {"name": "soak", "holds": holds(found), **made_by, "machine": machine(), **found}
    text = json.dumps(record, indent=1, allow_nan=False) + "\n"
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    print(text, end="")
    return 0 if record["holds"] else 1


if __name__ == "__main__":
    sys.exit(main())
