"""Trains the network by which a tracker tells movers from still things, on recorded drives whose truth is known.

python docs/train_tracker.py --work FOLDER [--data FOLDER] [--share 0.01] [--out FOLDER]

Drives are recorded first (`--work` keeps them, and a stopped script goes on there), then replayed to trackers. In the first
round the truth tells half of these what moves, which the others never hear; in each later one the network of the round
before tells it, so that it learns from what its own decisions lead to. Each trains anew on the updates of the last two.
`--data` is the folder whose `ros_maps` holds two real maps; without it there is less to learn from. `--share` records a
share of the drives, for a try. It takes about an hour on two cores. Half of the drives are those of a planner that has
a tracker itself, so that they depend a little on the weights that are there.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from bug_gym.agents.prediction.samples import street
from bug_gym.agents.tracking.layout import BEAMS, CLUES, EVIDENCE, HITS, ID, TRACKS, VX, VY
from bug_gym.agents.tracking.motion import (
    FORGOTTEN_IN,
    LEAST_FORGOTTEN,
    LEAST_SPEED,
    MOST_ADDED,
    MOST_EVIDENCE,
    OF_SLOW,
    WEIGHTS,
    Network,
)
from bug_gym.agents.tracking.tracker import Tracker
from bug_gym.config import dump, load
from bug_gym.evaluation.progress import progress_bar
from bug_gym.files import replaced_when_done
from bug_gym.held_out import TRAINING_SEEDS
from bug_gym.reproductions.tracking_runs import DRIVERS, Frame, frames, hits_on_movers
from bug_gym.view import Sensors, View
from bug_gym.workers import each, starred

WORLDS = {
    "dynamic": 1200,
    "rush": 800,
    "crowd": 150,
    "maze": 1000,
    "rooms": 800,
    "static": 800,
    "depot": 2000,
    "tb3_sandbox": 160,
    "racks": 400,
    "street": 500,
    "fast": 400,
}
"""Drives of each family."""
SEPARATIONS = {"depot": 12.0, "tb3_sandbox": 3.0}
"""Of the real maps: how far from one another start and goal lie [m]."""
BEAM_COUNTS, NOISES, STEPS = (48, 64, 96, 120, 180, 360), (0.0, 0.01, 0.03, 0.05), (0.05, 0.1, 0.1, 0.2)
"""Of a drive's scanner: beams, standard deviation of a range [m], time between two scans [s]; drawn for each."""
NARROW = 0.15
"""Share of the scanners that look 270 degrees about."""
SECONDS = 30.0
"""How long a drive is watched [s]."""


MOVES = 0.15
"""Speed from which on what is said to move is to be known [m/s]; slower ones are not asked."""
TOLD_AFTER, SURE_ODDS = 0.3, 60.0
"""How long a mover is tracked until the truth tells it [s], and log odds that leave no doubt."""
ROUNDS = ((6, 40), (8, 40), (16, 40), (24, 64), (18, 64))
"""Of each round, the passes of its training and the units of a layer."""
ROWS, RATE = 60_000, 3e-3
"""Updates of a batch, and what the rate of learning begins with."""


class Drive(NamedTuple):
    """What one drive saw in T scans, and what moved there, M of it."""

    family: str
    scenario: dict[str, Any]
    observations: NDArray[np.float32]
    """(T, D)."""
    places: NDArray[np.float32]
    """Of the movers, by odometry (T, M, 2) [m]; NaN where one isn't there."""
    radii: NDArray[np.float64]
    """Their outer radii (M,) [m]."""
    inner: NDArray[np.float64]
    """Their inner radii (M,) [m]."""

    @classmethod
    def read(cls, path: Path) -> Drive:
        """Of a file that `record` wrote."""
        with np.load(path) as found:
            told, *arrays = (found[name] for name in found.files)
        return cls(*json.loads(str(told)), *arrays)

    def frames(self) -> Iterator[Frame]:
        """As the tracker's judge takes them."""
        scenario = load(self.scenario)
        sensors, step = Sensors.of(scenario), scenario.time.step
        for number, (flat, places) in enumerate(zip(self.observations, self.places, strict=True)):
            yield Frame(number * step, View(flat, sensors), places.astype(float), self.radii, self.inner)


def scenario_of(family: str, rng: np.random.Generator, data: Path | None) -> dict[str, Any]:
    """A world of a family with a scanner drawn for it."""
    if family == "racks":
        world: dict[str, Any] = {"world": racks(rng)}
    elif family == "street":
        world = dump(street(int(rng.integers(2**31))))
    elif family == "fast":
        world = dump(load("rush", {"world.speeds": [0.5, 3.0]}))
    elif family in SEPARATIONS:
        assert data is not None
        path = (data / "ros_maps" / f"{family}.yaml").absolute()
        world = {"world": {"family": "ros_map", "path": str(path), "separation": SEPARATIONS[family]}}
    else:
        world = dump(load(family))
    drawn = {
        "robot.kinematics": str(rng.choice(["holonomic", "differential"])),
        "lidar.beams": int(rng.choice(BEAM_COUNTS)),
        "lidar.noise": float(rng.choice(NOISES)),
        "lidar.range": float(rng.choice([5.0, 10.0])),
        "time.step": float(rng.choice(STEPS)),
    }
    if rng.random() < NARROW:
        drawn |= {
            "lidar.fov": 1.5 * math.pi,
            "robot.kinematics": "differential",
        }  # one that does not turn would be blind
    return dump(load(world, overrides=drawn))


def racks(rng: np.random.Generator) -> dict[str, Any]:
    """A hall of racks: square posts, dense at the outline of each and sparse inside, so that beams slip in between."""
    posts = []
    for x, y in product((-7.0, -3.0, 1.0, 5.0), repeat=2):
        x, y = x + rng.random(), y + rng.random()
        spacing, thick = rng.uniform(0.2, 0.5), rng.uniform(0.02, 0.1)
        for i, j in product(range(6), repeat=2):
            if rng.random() < (0.75 if {i, j} & {0, 5} else 0.25):
                a, b, r = x + spacing * i, y + spacing * j, thick * rng.uniform(0.5, 1.5)
                posts.append([[a - r, b - r], [a + r, b - r], [a + r, b + r], [a - r, b + r]])
    return {
        "family": "explicit",
        "bounds": [-12.0, -12.0, 12.0, 12.0],
        "start": [-9.0, -9.0, float(rng.uniform(-math.pi, math.pi))],
        "goal": [9.0, 9.0],
        "polygons": posts,
    }


def record(family: str, number: int, seed: int, data: Path | None, path: Path) -> Path:
    """Drive through a world and keep in a file what was seen, unless it is there."""
    if path.is_file():
        return path
    scenario = scenario_of(family, np.random.default_rng([seed, list(WORLDS).index(family)]), data)
    seen = list(frames(scenario, seed, DRIVERS[number % len(DRIVERS)], seconds=SECONDS))
    observations = np.array([frame.view.flat for frame in seen])
    places = np.array([frame.places for frame in seen], dtype=np.float32)
    radii, inner = seen[0].radii, seen[0].inner
    with replaced_when_done(path) as partial_file, partial_file.open("wb") as file:
        np.savez(file, json.dumps([family, scenario]), observations, places, radii, inner)
    return path


def record_all(work: Path, data: Path | None, share: float, workers: int, first: int = TRAINING_SEEDS) -> list[Path]:
    """Files of the drives of all families."""
    jobs = [
        (family, number, first + number, data, work / f"{family}-{number}.npz")
        for family, count in WORLDS.items()
        if data is not None or family not in SEPARATIONS
        for number in range(math.ceil(share * count))
    ]
    with progress_bar(shown=True) as track:
        return list(track(each(partial(starred, record), jobs, workers, in_order=True), "drives", len(jobs)))


class Updates(NamedTuple):
    """Updates of tracks, in the order of time one track after another, n of them."""

    clues: NDArray[np.float32]
    """(n, CLUES), of those that hardly have a speed whatever."""
    is_weighed: NDArray[np.bool_]
    """Whether it has a speed (n,)."""
    label: NDArray[np.int8]
    """Whether it follows what moves: 1, 0, or -1 where that is not asked (n,)."""
    track: NDArray[np.int64]
    """Number of its track (n,)."""
    passed: NDArray[np.float32]
    """Time since the update before (n,) [s]."""


def replay(path: Path, network: Network | None, is_told: bool) -> Updates:
    """Updates of the tracks of a recorded drive.

    Args:
        path: of the drive.
        network: what tells movers; None: the truth does, or nothing.
        is_told: in that case, which of both.
    """
    drive = Drive.read(path)
    tracker = memory = None
    before = drive.places[0]
    found: list[tuple[Any, ...]] = []
    moved_for = np.zeros(TRACKS)
    for frame in drive.frames():
        if tracker is None or memory is None:
            tracker = Tracker(frame.view.sensors, network or network_of_nothing())
            memory = tracker.start()
        tracker.update(memory, frame.view, frame.time)
        step = frame.view.sensors.drive.step
        label = labels(frame, np.hypot(*(frame.places - before).T) / step, tracker.owner)
        before = frame.places
        numbers = memory.numbers
        is_seen = (numbers[:, ID] > 0) & ((numbers[:, HITS] & 3) == 3)
        speed = np.hypot(memory.state[:, VX], memory.state[:, VY])
        (places,) = np.nonzero(is_seen)
        found.append((tracker.clues[places].astype(np.float32), speed[places] > LEAST_SPEED, label[places], numbers[places, ID],
                      np.full(len(places), step, dtype=np.float32)))  # fmt: skip
        if network is None:
            moved_for = np.where(label == 1, moved_for + step, 0.0)
            is_mover = is_told & (moved_for > TOLD_AFTER)
            seen = numbers[:, BEAMS] > 0
            memory.state[:, EVIDENCE] = np.where(
                seen, np.where(is_mover, SURE_ODDS, -SURE_ODDS), memory.state[:, EVIDENCE]
            )
    columns = [np.concatenate(column) for column in zip(*found, strict=True)]
    order = np.argsort(columns[3], kind="stable")
    clues, is_weighed, label, track, passed = (column[order] for column in columns)
    asked = np.isin(track, np.unique(track[is_weighed]))
    return Updates(*(column[asked] for column in (clues, is_weighed, label.astype(np.int8), track, passed)))


def labels(frame: Frame, speeds: NDArray[np.float64], owner: NDArray[np.int64]) -> NDArray[np.int64]:
    """For each place of a track: 1 where most of its hits are on something that moves, 0 where none is on a mover, else -1."""
    on_mover = hits_on_movers(frame)
    owned = owner >= 0
    total, on_any, on_moving = (
        np.bincount(owner[owned & which], minlength=TRACKS)
        for which in (owned, on_mover.any(axis=1), (on_mover & (speeds >= MOVES)).any(axis=1))
    )
    return np.where(2 * on_moving > total, 1, np.where(on_any > 0, -1, 0))


def network_of_nothing() -> Network:
    """One that says of everything that nothing is known."""
    shapes = ((CLUES, 1), (1,), (1, 1), (1,), (1, 2), (2,))
    return Network(*(np.zeros(shape) for shape in shapes))


def replay_all(drives: list[Path], network: Network | None, workers: int) -> Updates:
    """Updates of all drives."""
    jobs = [(path, network, number // 2 % 2 == 0) for number, path in enumerate(drives)]
    parts, last = [], 0
    with progress_bar(shown=True) as track:
        for updates in track(each(partial(starred, replay), jobs, workers, in_order=True), "replays", len(jobs)):
            parts.append(updates._replace(track=updates.track + last))
            last += int(updates.track.max(initial=0))
    return joined(parts)


def joined(parts: list[Updates]) -> Updates:
    """Updates of several, whose tracks have distinct numbers."""
    return Updates(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def train(updates: Updates, epochs: int, units: int, seed: int) -> Network:
    """A network by which the sums of what updates add are the log odds that their tracks move: least cross entropy."""
    torch.manual_seed(seed)
    weighed = updates.clues[updates.is_weighed]
    mean, spread = weighed.mean(axis=0, dtype=np.float64), weighed.std(axis=0, dtype=np.float64) + 1e-6
    begins = np.flatnonzero(np.diff(updates.track, prepend=-1))
    lengths = np.diff(begins, append=len(updates.track))
    model = new_model(units)
    optimizer = torch.optim.Adam(model.parameters(), lr=RATE)
    rng = np.random.default_rng(seed)
    batches = batches_of(lengths)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, epochs * len(batches), 0.05 * RATE)
    for epoch in range(epochs):
        total = 0.0
        for number in rng.permutation(len(batches)):
            loss = loss_of(model, updates, begins[batches[number]], lengths[batches[number]], mean, spread)
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
            optimizer.step()
            schedule.step()
            total += float(loss.detach())
        print(f"pass {epoch + 1} of {epochs}: cross entropy {total / len(batches):.5f}", flush=True)
    return as_network(model, mean, spread)


def new_model(units: int) -> torch.nn.Sequential:
    """Two hidden layers, of clues that have been brought to mean 0 and spread 1."""
    return torch.nn.Sequential(
        *(torch.nn.Linear(CLUES, units), torch.nn.ReLU(), torch.nn.Linear(units, units), torch.nn.ReLU()),
        torch.nn.Linear(units, 2),
    )


def as_network(model: torch.nn.Sequential, mean: NDArray[np.float64], spread: NDArray[np.float64]) -> Network:
    """The same of clues as they are."""
    first, second, last = (layer for layer in model if isinstance(layer, torch.nn.Linear))
    weights = [layer.weight.detach().double().numpy().T for layer in (first, second, last)]
    offsets = [layer.bias.detach().double().numpy() for layer in (first, second, last)]
    scaled = weights[0] / spread[:, None]
    return Network(scaled, offsets[0] - mean @ scaled, weights[1], offsets[1], weights[2], offsets[2])


def batches_of(lengths: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Tracks of about as many updates, some ROWS of them together."""
    order = np.argsort(lengths, kind="stable")
    batches, begin = [], 0
    while begin < len(order):
        count, end = 0, begin
        while end < len(order) and (end == begin or (end + 1 - begin) * lengths[order[end]] <= ROWS):
            count, end = count + 1, end + 1
        batches.append(order[begin:end])
        begin = end
    return batches


def loss_of(
    model: torch.nn.Module,
    updates: Updates,
    begins: NDArray[np.int64],
    lengths: NDArray[np.int64],
    mean: NDArray[np.float64],
    spread: NDArray[np.float64],
) -> torch.Tensor:
    """Cross entropy of the evidence after each update of some tracks."""
    most = int(lengths.max())
    column = np.arange(most)
    there = column < lengths[:, None]
    rows = (begins[:, None] + np.minimum(column, lengths[:, None] - 1)).ravel()
    tenths = torch.from_numpy(10.0 * updates.passed[rows]).reshape(there.shape)
    is_weighed = updates.is_weighed[rows] & there.ravel()
    clues = ((updates.clues[rows[is_weighed]] - mean) / spread).astype(np.float32)
    told = model(torch.from_numpy(clues))
    spots = torch.from_numpy(is_weighed)
    added = torch.full((len(rows),), OF_SLOW).masked_scatter(spots, MOST_ADDED * torch.tanh(told[:, 0] / MOST_ADDED))
    forgotten = LEAST_FORGOTTEN + (1.0 - LEAST_FORGOTTEN) * torch.sigmoid(told[:, 1])
    forgotten = torch.ones(len(rows)).masked_scatter(spots, forgotten)
    added, forgotten = (values.reshape(there.shape) for values in (added, forgotten))
    added, kept = added * tenths, torch.exp(-0.1 * tenths * forgotten / FORGOTTEN_IN)
    evidence, sums = torch.zeros(len(lengths)), []
    for k in range(most):
        evidence = (evidence * kept[:, k] + added[:, k]).clamp(-MOST_EVIDENCE, MOST_EVIDENCE)
        sums.append(evidence)
    label = torch.from_numpy(updates.label[rows].astype(np.float32)).reshape(there.shape)
    counts = (label >= 0.0) & torch.from_numpy(there)
    entropies = torch.nn.functional.binary_cross_entropy_with_logits(
        torch.stack(sums, dim=1)[counts], label[counts], reduction="sum"
    )
    return entropies / max(len(rows), 1)


def write(network: Network, path: Path) -> None:
    """Write weights to a file that `network_of` reads."""
    told = {name: rounded(array.tolist()) for name, array in network._asdict().items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    with replaced_when_done(path) as partial_file:
        partial_file.write_text(json.dumps(told) + "\n", encoding="utf-8")


def rounded(value: Any) -> Any:
    """Numbers with six digits."""
    return [rounded(one) for one in value] if isinstance(value, list) else float(f"{value:.6g}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=WEIGHTS)
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    recorded = record_all(arguments.work, arguments.data, arguments.share, arguments.workers)
    rounds: list[Updates] = []
    told_by: Network | None = None
    for passes, units in ROUNDS:
        latest = replay_all(recorded, told_by, arguments.workers)
        after = int(rounds[-1].track.max()) if rounds else 0
        rounds = [*rounds[-1:], latest._replace(track=latest.track + after)]
        told_by = train(joined(rounds), passes, units, arguments.seed)
        write(told_by, arguments.out)
