"""Second stage of a predictor's training: by how the map planner gets along with it.

An episode is a run of `hd_bug_map` among movers, its return the share of the way to the goal that it came nearer, less one if
it touched something. Errors of prediction count here only as far as they change what the robot does. What is learnt is
how far the answers are to be trusted: a gain of each number, and an offset of each velocity ahead. The gradient comes
from evolution strategies (Salimans et al. 2017): two changes to either side of the present one drive through the same
world, and the difference of their returns counts, over its deviation as in Mania et al. 2018.

    python -m bug_gym.agents.prediction.second_stage results/rl_predictor --out results/navigation.json --worlds rush
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents import make_policy
from bug_gym.agents.prediction.features import ANSWERS, HORIZONS
from bug_gym.agents.prediction.learned import LearnedPredictor
from bug_gym.checks import checked_count, checked_seed, checked_time
from bug_gym.config import Scenario, load
from bug_gym.files import replaced_when_done, writable
from bug_gym.geometry import F64
from bug_gym.held_out import TRAINING_SEEDS, VALIDATION_SEEDS
from bug_gym.limits import MOST_EPISODES, MOST_TRAININGS
from bug_gym.references import told_of
from bug_gym.simulation import Simulation
from bug_gym.spaces import require_one_robot
from bug_gym.view import Sensors
from bug_gym.workers import Workers, checked_workers, each, starred

LAWS = ("bounce", "random_walk", "crowd")
"""Of the movers in the worlds that it drives in, unless it is told others."""
NUMBERS = ANSWERS + len(HORIZONS)
"""Of a change: a gain of each number of an answer, less 1, and an offset of each velocity ahead."""
BAD_INPUT = 2
"""Exit code where an argument is wrong, or a file cannot be read or written."""


@dataclass(frozen=True)
class NavigationSettings:
    """How the second stage is trained."""

    worlds: tuple[str, ...] = LAWS
    """Motion laws, each of which stands for its `crowded` worlds, and names of scenarios; they take turns."""
    rounds: int = 12
    """Steps of the gradient."""
    pairs: int = 15
    """Pairs of changes tried in a round, each in a world of its own."""
    noise: float = 0.3
    """Standard deviation of the numbers of a change that is tried."""
    rate: float = 0.1
    """Length of a step, for a gradient of one deviation."""
    validation_worlds: int = 20
    """Of each kind, in which the result is compared with the predictor as it was."""
    seed: int = 0
    """Of the changes that are tried."""

    def __post_init__(self) -> None:
        checked_count("rounds", self.rounds, most=MOST_TRAININGS)
        for name in ("pairs", "validation_worlds"):
            checked_count(name, getattr(self, name), most=MOST_EPISODES)
        for name in ("noise", "rate"):
            checked_time(name, getattr(self, name))
        checked_seed(self.seed)
        if self.validation_worlds * len(self.worlds) < 2:
            came = f"{self.validation_worlds} of each of {len(self.worlds)} kinds"
            raise ValueError(f"validation_worlds: got {came}, expected two in all, as one alone tells no interval")


def crowded(law: str) -> Scenario:
    """Worlds so full of movers under a law that the map planner often touches one."""
    world = {"family": "field", "obstacles": 40, "moving": 0.6, "speeds": [0.3, 1.2], "laws": [law], "solvable": 0.3}
    lidar = {"beams": 180, "range": 10.0, "noise": 0.01}
    return load({"name": f"crowded-{law}", "lidar": lidar, "time": {"limit": 40.0}, "world": world})


class ChangedPredictor(LearnedPredictor):
    """A learned predictor whose answers are scaled and shifted by a change (NUMBERS,)."""

    def __init__(self, sensors: Sensors, folder: Path, change: F64) -> None:
        super().__init__(sensors, folder)
        self.change = change

    def answer(self, features: NDArray[np.float32]) -> NDArray[np.floating]:
        """Answers (n, ANSWERS) as changed."""
        answers = super().answer(features) * (1.0 + self.change[:ANSWERS])
        answers[:, ::2] += self.change[ANSWERS:]
        return np.clip(answers, -1.0, 1.0)


class Run(NamedTuple):
    """How the map planner did in a world."""

    progress: float
    """By how much nearer it came to the goal, over its distance at the start."""
    collided: bool
    """Whether it touched something."""
    time: float
    """Until the end [s]."""

    @property
    def value(self) -> float:
        """The return."""
        return self.progress - float(self.collided)


def driver(folder: Path, change: F64, world: str) -> tuple[Simulation, Any]:
    """The worlds of a motion law, or of a scenario, and the map planner with a changed predictor that drives there.

    Raises:
        ValueError: no such scenario, one with several robots, no such predictor, or its files are damaged.
        ImportError: onnxruntime is not installed.
    """
    simulation = Simulation(crowded(world) if world in LAWS else load(world))
    require_one_robot(simulation)
    policy: Any = make_policy("hd_bug_map", simulation)
    policy.predictor = ChangedPredictor(policy.sensors, folder, change)
    return simulation, policy


def drive(folder: Path, change: F64, world: str, seed: int) -> Run:
    """A run of the map planner with a changed predictor through a crowded world of a motion law, or of a scenario."""
    simulation, policy = driver(folder, change, world)
    observation, state = simulation.reset(seeds=[seed])[:, 0], None
    first = last = simulation.robot_step()
    while not (last.terminated or last.truncated):
        action, state = policy.predict(observation, state)
        observation = simulation.step(action[:, None]).observation[:, 0]
        last = simulation.robot_step()
    left = last.info["goal_distance"] / first.info["goal_distance"]
    is_there = last.info["outcome"] == "success"
    return Run(1.0 if is_there else 1.0 - left, last.info["outcome"] == "collision", last.info["time"])


def search(folder: Path, settings: NavigationSettings, *, workers: Workers = 1) -> tuple[F64, list[float]]:
    """The change (NUMBERS,) that the rounds lead to, and the mean return of each round."""
    rng = np.random.default_rng(settings.seed)
    change, means, worlds = np.zeros(NUMBERS), [], settings.worlds
    for number in range(settings.rounds):
        ways = rng.standard_normal((settings.pairs, NUMBERS))
        first = TRAINING_SEEDS + number * settings.pairs
        asked = [
            (folder, change + side * settings.noise * way, worlds[pair % len(worlds)], first + pair)
            for pair, way in enumerate(ways)
            for side in (1.0, -1.0)
        ]
        runs = each(partial(starred, drive), asked, workers, in_order=True)
        values = np.array([run.value for run in runs]).reshape(-1, 2)
        means.append(float(values.mean()))
        spread = float(values.std())
        if spread > 0.0:
            change = change + settings.rate * (values[:, 0] - values[:, 1]) @ ways / (spread * settings.pairs)
    return change, means


def compare(folder: Path, change: F64, settings: NavigationSettings, *, workers: Workers = 1) -> dict[str, Any]:
    """How the change does in the validation worlds, beside the predictor as it was."""
    seeds = range(VALIDATION_SEEDS, VALIDATION_SEEDS + settings.validation_worlds)
    asked = [(world, seed) for seed in seeds for world in settings.worlds]
    before, after = (
        list(each(partial(starred, drive), [(folder, numbers, *world) for world in asked], workers, in_order=True))
        for numbers in (np.zeros(NUMBERS), change)
    )
    gaps = np.array([now.value - then.value for then, now in zip(before, after, strict=True)])
    error = 1.96 * float(gaps.std(ddof=1)) / math.sqrt(len(gaps))
    return {
        "worlds": len(asked),
        **{name: _summary(runs) for name, runs in (("before", before), ("after", after))},
        "gain": {"value": float(gaps.mean()), "low": float(gaps.mean()) - error, "high": float(gaps.mean()) + error},
        "worlds_that_differ": int(np.count_nonzero(gaps)),
    }


def _summary(runs: Sequence[Run]) -> dict[str, float]:
    names = ("value", "progress", "collided", "time")
    return {name: float(np.mean([getattr(run, name) for run in runs])) for name in names}


def main(arguments: Sequence[str] | None = None) -> None:
    """Train the second stage of a predictor, and tell whether it helps."""
    parser = argparse.ArgumentParser(prog="python -m bug_gym.agents.prediction.second_stage", description=main.__doc__)
    parser.add_argument("folder", type=Path, help="of the predictor")
    parser.add_argument("--out", type=Path, required=True, help="file for what was found, as JSON")
    defaults = asdict(NavigationSettings())
    del defaults["worlds"]
    parser.add_argument(
        "--worlds", nargs="+", default=LAWS, help="motion laws of crowded worlds, or scenarios", metavar="WORLD"
    )
    for name, default in defaults.items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=type(default), default=default)
    parser.add_argument("--workers", type=int, default=1)
    options = vars(parser.parse_args(arguments))
    try:
        _run(**options)
    except (ValueError, OSError, ImportError) as error:
        parser.exit(BAD_INPUT, f"{parser.prog}: error: {told_of(error)}\n")


def _run(*, folder: Path, out: Path, workers: int, worlds: Sequence[str], **options: Any) -> None:
    several = checked_workers(workers)
    settings = NavigationSettings(worlds=tuple(worlds), **options)
    writable(out)
    for world in settings.worlds:  # each can be driven in, which no run has to find out
        driver(folder, np.zeros(NUMBERS), world)
    change, means = search(folder, settings, workers=several)
    found = compare(folder, change, settings, workers=several)
    record = {"settings": asdict(settings), "returns": means, "change": change.tolist(), "validation": found}
    with replaced_when_done(out) as partial:
        partial.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
