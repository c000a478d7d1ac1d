"""What movers that turn all of a sudden cost: a plain oracle of many directions, laws, and what the planner makes of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.roll_out import Velocities
from bug_gym.agents.hd_bug.sudden_turns import AHEAD, FADING, Turning, turn_risks, turning
from bug_gym.kinematics import Drive

F64 = NDArray[np.float64]

RADIUS, SPACING = 0.2, 0.1
COUNT = round(AHEAD / (2.0 * SPACING))
TIMES = SPACING * np.arange(1, 31)
HOLONOMIC = Drive("holonomic", 1.0, 0.3, 1.5, SPACING)
DIRECTIONS = np.linspace(0.0, 2.0 * math.pi, 7200, endpoint=False)


def velocities(directions: F64, speeds: F64, free: float = 99.0) -> Velocities:
    """Desired velocities with the same free way."""
    return Velocities(directions, speeds, np.full(len(directions), free))


def straight_on(positions: F64, heading: F64, radii: F64, speeds: F64, rate: float = 1.0) -> Turning:
    """Movers that go straight on until they turn."""
    steps = speeds[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return turning(positions, radii, speeds, positions[:, None] + TIMES[None, :, None] * steps[:, None], SPACING, rate)


def some_movers(seed: int, many: int = 4) -> tuple[F64, F64, F64, F64]:
    """Places, headings, radii and speeds of movers about the robot."""
    rng = np.random.default_rng(seed)
    away, side = rng.uniform(0.8, 2.0, many), rng.uniform(-math.pi, math.pi, many)
    places = away[:, None] * np.stack([np.cos(side), np.sin(side)], axis=-1)
    return places, rng.uniform(-math.pi, math.pi, many), rng.uniform(0.2, 0.6, many), rng.uniform(0.2, 1.0, many)


def plain(direction: float, speed: float, places: F64, heading: F64, radii: F64, speeds: F64, rate: float) -> float:
    """The risk of one velocity of a holonomic robot, by trying many directions at each time of a turn."""
    risk, every = 0.0, 2.0 * SPACING
    when = every * np.arange(1, COUNT + 1)
    robot = speed * when[:, None] * np.array([math.cos(direction), math.sin(direction)])
    for place, course, radius, pace in zip(places, heading, radii, speeds, strict=True):
        for n in range(COUNT):
            corner = place + pace * n * every * np.array([math.cos(course), math.sin(course)])
            gone = pace * (when[n:] - n * every)
            at = corner + gone[:, None, None] * np.stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)], axis=-1)
            hit = (np.hypot(*(at - robot[n:, None]).transpose(2, 0, 1)) < RADIUS + radius).mean(axis=1)
            risk += rate * every * math.exp(-rate * n * every) * float((hit * np.exp(-when[n:] / FADING)).max())
    return risk


@pytest.mark.parametrize("seed", range(4))
def test_risks_are_those_of_many_directions(seed: int) -> None:
    movers = some_movers(seed)
    rng = np.random.default_rng(100 + seed)
    directions, speeds = rng.uniform(-math.pi, math.pi, 12), rng.uniform(0.0, 1.0, 12)
    found = turn_risks(HOLONOMIC, (0.0, 0.0, 0.0), RADIUS, velocities(directions, speeds), straight_on(*movers, 0.7))
    expected = [plain(d, s, *movers, 0.7) for d, s in zip(directions, speeds, strict=True)]
    # Each share is known to within two of the directions that are tried.
    np.testing.assert_allclose(found, expected, atol=4 * COUNT * 0.2 * 2.0 / len(DIRECTIONS))
    assert max(expected) > 0.1


def test_who_cannot_be_reached_is_no_risk() -> None:
    speeds = np.array([1.0])
    for beyond, is_risky in ((0.01, False), (-0.01, True)):
        away = RADIUS + 0.3 + 2.0 * SPACING * COUNT + beyond
        movers = straight_on(np.array([[away, 0.0]]), np.array([math.pi / 2]), np.array([0.3]), speeds)
        risks = turn_risks(HOLONOMIC, (0.0, 0.0, 0.0), RADIUS, velocities(np.zeros(1), np.zeros(1)), movers)
        assert (risks[0] > 0.0) == is_risky


def test_a_mover_that_stands_over_the_robot_is_certain() -> None:
    movers = straight_on(np.zeros((1, 2)), np.zeros(1), np.array([0.5]), np.array([1e-9]), rate=0.5)
    risk = turn_risks(HOLONOMIC, (0.0, 0.0, 0.0), RADIUS, velocities(np.zeros(1), np.zeros(1)), movers)[0]
    every = 2.0 * SPACING
    turns = every * np.arange(COUNT)
    assert risk == pytest.approx((0.5 * every * np.exp(-0.5 * turns) * np.exp(-(turns + every) / FADING)).sum())


def test_movers_add_up_and_nobody_who_never_turns_is_feared() -> None:
    movers = some_movers(7)
    places, heading, radii, speeds = movers
    wanted = velocities(np.linspace(0.0, 6.0, 9), np.full(9, 0.8))
    pose = (0.0, 0.0, 0.0)
    together = turn_risks(HOLONOMIC, pose, RADIUS, wanted, straight_on(*movers))
    each = [straight_on(places[[t]], heading[[t]], radii[[t]], speeds[[t]]) for t in range(4)]
    alone = [turn_risks(HOLONOMIC, pose, RADIUS, wanted, mover) for mover in each]
    np.testing.assert_allclose(together, np.sum(alone, axis=0))
    assert not turn_risks(HOLONOMIC, pose, RADIUS, wanted, straight_on(*movers, rate=0.0)).any()


def test_a_robot_held_by_a_wall_stays_where_its_way_ends() -> None:
    movers = straight_on(*some_movers(3))
    short, long = velocities(np.zeros(1), np.ones(1), free=0.25), velocities(np.zeros(1), np.ones(1))
    stopped = velocities(np.zeros(1), np.zeros(1))
    found = [
        turn_risks(HOLONOMIC, (x, 0.0, 0.0), RADIUS, v, movers)[0] for x, v in ((0, short), (0, long), (0, stopped))
    ]
    assert len(set(found)) == 3
    ended = turn_risks(HOLONOMIC, (0.0, 0.0, 0.0), RADIUS, velocities(np.zeros(1), np.full(1, 1e-9), free=1e-9), movers)
    assert ended[0] == pytest.approx(found[2], abs=1e-6)


def test_few_predicted_times_are_enough() -> None:
    predicted = np.zeros((1, 2, 2))
    assert turning(np.zeros((1, 2)), np.ones(1), np.ones(1), predicted, SPACING, 1.0).places.shape == (1, 1, 2)
    long = np.arange(60, dtype=float).reshape(1, 30, 2)
    places = turning(np.full((1, 2), -1.0), np.ones(1), np.ones(1), long, SPACING, 1.0).places
    # Where it is now, and then at each second predicted time: 0.2 s, 0.4 s and so on.
    np.testing.assert_array_equal(places[0], np.concatenate([[[-1.0, -1.0]], long[0, 1 : 2 * COUNT - 2 : 2]]))
