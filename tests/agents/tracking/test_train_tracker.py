"""How the tracker's network is trained: drives are kept as they were, tracks get their true labels, sums are learnt."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tracked import disc, world_of

from bug_gym.agents.tracking import layout, motion
from bug_gym.agents.tracking.motion import (
    FORGOTTEN_IN,
    LEAST_FORGOTTEN,
    MOST_ADDED,
    MOST_EVIDENCE,
    OF_SLOW,
    Network,
)
from bug_gym.agents.tracking.tracker import Tracker
from bug_gym.config import dump, load
from bug_gym.reproductions.tracking_runs import frames

torch = pytest.importorskip("torch")
learning = pytest.importorskip("docs.train_tracker")


def drawn_updates(rng: np.random.Generator, tracks: int) -> Any:
    """Updates of tracks of which a clue tells, with noise, whether they move; half of them do."""
    parts = []
    for number in range(1, tracks + 1):
        count, moves = int(rng.integers(2, 30)), int(rng.integers(0, 2))
        clues = rng.normal(0.0, 1.0, (count, layout.CLUES)).astype(np.float32)
        clues[:, layout.SPEED] += 2.0 * moves
        label = np.full(count, moves, dtype=np.int8)
        label[rng.random(count) < 0.1] = -1
        step = np.full(count, rng.choice([0.05, 0.1, 0.2]), dtype=np.float32)
        parts.append(learning.Updates(clues, rng.random(count) < 0.9, label, np.full(count, number), step))
    return learning.joined(parts)


def account(network: Network, updates: Any) -> tuple[NDArray[np.float64], float]:
    """Evidence after each update, and the sum of the cross entropies, one update after another."""
    evidence, entropy, sums, before = 0.0, 0.0, [], -1
    for clue, is_weighed, label, track, passed in zip(*updates, strict=True):
        added, forgotten = OF_SLOW, 1.0
        if is_weighed:
            first = np.maximum(clue @ network.first + network.first_offset, 0.0)
            second = np.maximum(first @ network.second + network.second_offset, 0.0)
            odds, gate = second @ network.last + network.last_offset
            added = MOST_ADDED * math.tanh(odds / MOST_ADDED)
            forgotten = LEAST_FORGOTTEN + (1.0 - LEAST_FORGOTTEN) / (1.0 + math.exp(-gate))
        evidence = evidence if track == before else 0.0
        evidence = evidence * math.exp(-forgotten * passed / FORGOTTEN_IN) + 10.0 * passed * added
        evidence, before = min(max(evidence, -MOST_EVIDENCE), MOST_EVIDENCE), track
        sums.append(evidence)
        if label >= 0:
            entropy += math.log1p(math.exp(-evidence if label else evidence))
    return np.array(sums), entropy


def test_what_is_made_least_is_the_cross_entropy_of_the_trackers_own_sums() -> None:
    rng = np.random.default_rng(0)
    updates = drawn_updates(rng, 20)
    model = learning.new_model(8)
    mean, spread = rng.normal(size=layout.CLUES), rng.uniform(0.5, 2.0, layout.CLUES)
    begins = np.flatnonzero(np.diff(updates.track, prepend=-1))
    lengths = np.diff(begins, append=len(updates.track))
    batches = learning.batches_of(lengths)
    assert sorted(np.concatenate(batches).tolist()) == list(range(20))
    found = sum(
        learning.loss_of(model, updates, begins[one], lengths[one], mean, spread).item() * lengths[one].max() * len(one)
        for one in batches
    )
    _, entropy = account(learning.as_network(model, mean, spread), updates)
    assert found == pytest.approx(entropy, rel=1e-4)


def test_a_clue_that_tells_is_learnt() -> None:
    """The longer a track is seen the surer it is, and of new tracks, too."""
    rng = np.random.default_rng(1)
    network = learning.train(drawn_updates(rng, 400), 100, 16, 0)
    updates = drawn_updates(rng, 200)
    sums, _ = account(network, updates)
    is_right = (sums > 0.0) == (updates.label == 1)
    position = np.concatenate([np.arange(n) for n in np.unique(updates.track, return_counts=True)[1]])
    asked = updates.label >= 0
    late, first = (float(is_right[asked & which].mean()) for which in (position > 8, position == 0))
    assert late > 0.9 > 0.85 > first, (late, first)


def test_a_drive_is_read_as_it_was_recorded(tmp_path: Path) -> None:
    path = learning.record("rush", 0, 3, None, tmp_path / "rush.npz")
    drive = learning.Drive.read(path)
    scenario = learning.scenario_of("rush", np.random.default_rng([3, list(learning.WORLDS).index("rush")]), None)
    assert drive.family == "rush" and load(drive.scenario) == load(scenario)
    seen = list(frames(scenario, 3, learning.DRIVERS[0], seconds=learning.SECONDS))
    for one, other in zip(drive.frames(), seen, strict=True):
        assert one.time == pytest.approx(other.time)
        assert np.array_equal(one.view.flat, other.view.flat)
        assert one.places == pytest.approx(other.places, abs=1e-5, nan_ok=True)
        assert np.array_equal(one.radii, other.radii) and np.array_equal(one.inner, other.inner)
    before = path.stat().st_mtime_ns
    learning.record("rush", 0, 3, None, path)
    assert path.stat().st_mtime_ns == before


def test_tracks_of_movers_are_told_from_tracks_of_still_things() -> None:
    """A disc that goes, one that creeps, which is not asked, and a pillar."""
    movers = [disc((3.0, -1.0), (0.0, 0.5)), disc((-3.0, 0.0), (0.0, 0.05))]
    scenario = dump(load(world_of(movers, circles=[[2.0, 3.0, 0.3]])))
    tracker = memory = before = None
    found: dict[int, set[int]] = {1: set(), 0: set(), -1: set()}
    for frame in frames(scenario, 0, "go_to_goal", seconds=1.0):
        tracker = tracker or Tracker(frame.view.sensors)
        memory = memory or tracker.start()
        tracker.update(memory, frame.view, frame.time)
        before = frame.places if before is None else before
        labels = learning.labels(frame, np.hypot(*(frame.places - before).T) / 0.1, tracker.owner)
        before = frame.places
        for place in np.flatnonzero(memory.numbers[:, layout.BEAMS]):
            x, y = memory.state[place, layout.X : layout.Y + 1]
            expected = 0 if math.hypot(x - 2.0, y - 3.0) < 1.0 else 1 if x > 2.0 else -1
            if frame.time > 0.0:
                assert labels[place] == expected, (frame.time, x, y)
                found[expected].add(int(place))
    assert all(found.values())


def test_what_is_written_is_read_to_six_digits(tmp_path: Path) -> None:
    network = motion.shipped()
    learning.write(network, tmp_path / "weights.json")
    for one, other in zip(motion.network_of(tmp_path / "weights.json"), network, strict=True):
        assert one == pytest.approx(other, rel=1e-5)
