"""Worlds to learn prediction in, and what a tracker makes of them: tracks with the places where the movers then were.

One family of worlds a motion law. A scripted robot drives through them, and what its tracker takes for a mover is
matched with the true one. An episode goes on after the robot has stopped, until the future of all tracks is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.agents import make_policy
from bug_gym.agents.prediction.features import (
    ANSWERS,
    HORIZONS,
    WIDTH,
    answers_for,
    encode,
    mirrored_answers,
    mirrored_features,
)
from bug_gym.agents.tracking.tracker import Tracker, Tracks
from bug_gym.checks import shortened
from bug_gym.config import Scenario, dump, load
from bug_gym.geometry import F32, F64
from bug_gym.scenarios import as_explicit
from bug_gym.schema.robot import Odometry
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

Rng = np.random.Generator

LAWS = ("bounce", "waypoints", "random_walk", "crowd", "evade")
"""Motion laws that are learnt."""
STREET = "street"
"""Family of worlds of people who walk straight on, as fast as people do; it makes a learner sure of what goes straight."""
DRIVER = "bug2"
"""The policy that drives the robot."""
SPEEDS = (0.2, 1.0)
"""Of the movers [m/s]."""
SCANNERS: tuple[dict[str, Any], ...] = ({"beams": 64, "range": 5.0}, {"beams": 180, "range": 10.0})
"""A world has one or the other."""
SECONDS = 20.0
"""How long tracks are taken from an episode [s]."""
NEAR = 0.4
"""A track within this of a mover's outline is a track of it [m]."""


class Moment(NamedTuple):
    """The movers tracked at one time of an episode, and where they then were."""

    tracks: Tracks
    """Tracks of true movers (T,)."""
    places: F64
    """Where these were at K later times (T, K, 2), in the odometry frame as it then lay [m]."""


class Samples(NamedTuple):
    """What a predictor was told n times, and the answers that would have been right."""

    features: F32
    """(n, WIDTH)."""
    answers: F32
    """(n, ANSWERS), which may lie outside [-1, 1]."""


def law_world(law: str, seed: int) -> Scenario:
    """A world of movers under one law among still things, or a STREET.

    Raises:
        ValueError: an unknown law.
    """
    if law == STREET:
        return street(seed)
    if law not in LAWS:
        raise ValueError(f"unknown motion law {shortened(law)} (known: {', '.join(LAWS)}, {STREET})")
    rng = np.random.default_rng([seed, LAWS.index(law)])
    count = int(rng.integers(12, 29))
    world: dict[str, Any] = {"family": "field", "obstacles": count, "moving": 0.5, "speeds": SPEEDS, "solvable": 0.3}
    world["laws"] = [law if law in ("bounce", "random_walk", "crowd") else "bounce"]
    if law == "crowd" and rng.random() < 0.7:
        pedestrians = int(rng.integers(8, 25))
        world |= {"obstacles": 8, "moving": 0.0, "pedestrians": pedestrians, "pedestrian_speeds": (0.4, 1.2)}
    scenario = load(
        {
            "name": f"{law}-{seed}",
            "lidar": {**SCANNERS[int(rng.integers(len(SCANNERS)))], "noise": 0.01},
            "time": {"limit": SECONDS},
            "world": world,
        }
    )
    if law in ("waypoints", "evade"):
        return _with_law(scenario, law, seed, rng)
    return scenario


def street(seed: int) -> Scenario:
    """People who walk from one side of a wide place to the other, and a robot that crosses their ways."""
    rng = np.random.default_rng([seed, len(LAWS)])
    walkers = []
    for _ in range(rng.integers(8, 25)):
        ends = np.array([[-24.0, rng.uniform(-9.0, 9.0)], [24.0, rng.uniform(-9.0, 9.0)]])[:: rng.choice([-1, 1])]
        at = ends[0] + rng.uniform(0.0, 0.7) * (ends[1] - ends[0])
        if np.hypot(at[0], abs(at[1]) - 8.0) < 2.0:
            continue  # there the robot starts and ends
        motion = {"law": "waypoints", "points": ends[::-1].tolist(), "speed": float(rng.uniform(0.6, 1.8))}
        walkers.append({"shape": {"circle": float(rng.uniform(0.2, 0.4))}, "at": at.tolist(), "motion": motion})
    return load(
        {
            "name": f"{STREET}-{seed}",
            "robot": {"kinematics": "holonomic"},
            "lidar": {**SCANNERS[int(rng.integers(len(SCANNERS)))], "noise": 0.01},
            "time": {"limit": SECONDS},
            "world": {
                "family": "explicit",
                "bounds": [-25.0, -10.0, 25.0, 10.0],
                "movers": walkers,
                "start": [0.0, -8.0, 0.5 * math.pi],
                "goal": [0.0, 8.0],
            },
        }
    )


def crossing(path: Path) -> Scenario:
    """A street of recorded pedestrians that a robot has to cross."""
    return load(
        {
            "name": path.stem,
            "robot": {"kinematics": "holonomic", "radius": 0.25, "max_speed": 1.5},
            "lidar": {"beams": 180, "range": 10.0, "noise": 0.01},
            "world": {"family": "replay", "path": str(path.absolute())},
        }
    )


def world_of(source: str | Path, seed: int) -> Scenario:
    """A world of a law or STREET, or a crossing of the pedestrians of a file."""
    return crossing(source) if isinstance(source, Path) else law_world(source, seed)


def _with_law(scenario: Scenario, law: str, seed: int, rng: Rng) -> Scenario:
    """The scenario as its seed draws it, with its movers under another law."""
    simulation = Simulation(scenario)
    simulation.reset(seeds=[seed])
    data = dump(as_explicit(simulation.scenario, simulation.world.layout(0)))
    xmin, ymin, xmax, ymax = scenario.world.box
    low, high = np.array([xmin, ymin]) + 1.0, np.array([xmax, ymax]) - 1.0
    for mover in data["world"]["movers"]:
        speed = float(rng.uniform(*SPEEDS))
        if law == "evade":
            mover["motion"] = {"law": law, "speed": speed, "sight": float(rng.uniform(2.0, 5.0)), "wander": 0.5 * speed}
            continue
        points = [
            np.clip(np.array(mover["at"]) + rng.uniform(-5.0, 5.0, 2), low, high) for _ in range(rng.integers(2, 6))
        ]
        mover["motion"] = {"law": law, "speed": speed, "points": [point.tolist() for point in points]}
    return load(data)


def moments(
    scenario: Scenario, seed: int, *, every: int = 1, seconds: float = SECONDS, times: F64 = HORIZONS
) -> Iterator[Moment]:
    """What is tracked in one episode, each `every` steps; moments without a mover are left out.

    Args:
        scenario: the world.
        seed: of the episode.
        every: steps between two moments.
        seconds: how long tracks are taken [s].
        times: when the movers' places are asked (K,) [s], multiples of the step.
    """
    simulation = Simulation(scenario)
    step = scenario.time.step
    sensors = Sensors.of(scenario)
    driver, state = make_policy(DRIVER, simulation), None
    observation = simulation.reset(seeds=[seed])[:, 0]
    tracker = Tracker(sensors)
    memory = tracker.start()
    to_start = frame_of(*simulation.world.pose[0, 0].tolist())
    is_exact = scenario.odometry == Odometry()
    ahead = np.rint(times / step).astype(int)
    limit, running = round(seconds / step), True
    waiting: list[tuple[int, Tracks, NDArray[np.int64], Callable[[F64], F64]]] = []
    courses: list[F64] = []
    number = 0
    while running or number <= (waiting[-1][0] + ahead[-1] if waiting else 0):
        centres, radii = movers_of(simulation)
        courses.append(centres)
        if running:
            tracks = tracker.update(memory, View(observation[0], sensors), number * step)
            if number % every == 0:
                to_odometry = to_start if is_exact else estimated_frame(simulation)
                chosen, movers = match(tracks, to_odometry(centres), radii)
                if len(chosen):
                    waiting.append((number, tracks.select(chosen), movers, to_odometry))
            action, state = driver.predict(observation, state)
            transition = simulation.step(action[:, None])
            observation = transition.observation[:, 0]
            ended = transition.terminated.any() or transition.truncated.any()
            running = not ended and number + 1 < limit
        else:
            simulation.step(np.zeros((1, 1, 2)))
        number += 1
    for begin, tracks, movers, to_odometry in waiting:
        places = np.stack([to_odometry(courses[begin + later])[movers] for later in ahead], axis=1)
        there = np.isfinite(places).all(axis=(1, 2))
        if there.any():
            yield Moment(tracks.select(np.flatnonzero(there)), places[there])


def frame_of(x: float, y: float, heading: float) -> Callable[[F64], F64]:
    """Takes places (n, 2) of the world into the frame of a pose."""
    cos, sin = math.cos(heading), math.sin(heading)
    turn = np.array([[cos, -sin], [sin, cos]])
    return lambda places: (places - [x, y]) @ turn


def estimated_frame(simulation: Simulation) -> Callable[[F64], F64]:
    """Takes places (n, 2) of the world into the odometry frame, as the robot now takes it to lie.

    In play this is where predictions stand: nobody knows there what odometry has got wrong, nor how it will.
    """
    to_robot = frame_of(*simulation.world.pose[0, 0].tolist())
    ahead, left, turned = simulation.world.odometry[0, 0].tolist()
    to_start = frame_of(0.0, 0.0, -turned)
    return lambda places: to_start(to_robot(places)) + [ahead, left]


def movers_of(simulation: Simulation) -> tuple[F64, F64]:
    """True places (M, 2), NaN where one isn't there, and outer radii (M,) of what moves in the first row [m]."""
    world = simulation.world
    discs = np.arange(int(world.array("moving_disc_count")[0, 0]))
    polygons = np.arange(int(world.array("moving_polygon_count")[0, 0])) + int(world.spec["discs"][0])
    moving = np.concatenate([discs, polygons])
    places = np.stack([world.array(name)[0, moving] for name in ("body_x", "body_y")], axis=1)
    radii: F64 = world.array("body_radius")[0, moving].copy()
    return np.where(places < kernels.AWAY, places, np.nan), radii


def match(tracks: Tracks, centres: F64, radii: F64) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices of the tracks that are movers' (T,), and of these movers (T,); a mover has at most one, the nearest."""
    chosen = np.flatnonzero(tracks.moving & (tracks.unseen < 0.5))
    if len(chosen) == 0 or len(centres) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    gaps = np.hypot(*(tracks.position[chosen, None] - centres).transpose(2, 0, 1))
    gaps = np.where(np.isfinite(gaps), gaps, np.inf)
    movers = gaps.argmin(axis=1)
    rows = np.arange(len(chosen))
    is_nearest = gaps.argmin(axis=0)[movers] == rows
    is_near = gaps[rows, movers] < np.maximum(NEAR, 0.5 * radii[movers])
    kept = is_nearest & is_near
    return chosen[kept], movers[kept]


def samples_of(scenario: Scenario, seed: int, *, every: int = 2) -> Samples:
    """All that one episode teaches."""
    sensors = Sensors.of(scenario)
    features, answers = [np.zeros((0, WIDTH), dtype=np.float32)], [np.zeros((0, ANSWERS))]
    for tracks, places in moments(scenario, seed, every=every):
        features.append(encode(tracks, sensors.angles, sensors.range))
        answers.append(answers_for(places, tracks))
    return Samples(np.concatenate(features), np.concatenate(answers).astype(np.float32))


def with_mirrored(samples: Samples) -> Samples:
    """The samples and their mirror images."""
    return Samples(
        np.concatenate([samples.features, mirrored_features(samples.features)]),
        np.concatenate([samples.answers, mirrored_answers(samples.answers)]),
    )


def displacement_errors(places: F64, truth: F64) -> F64:
    """Distances (T, K) of predicted from true places (T, K, 2) [m]."""
    errors: F64 = np.hypot(*(places - truth).transpose(2, 0, 1))
    return errors
