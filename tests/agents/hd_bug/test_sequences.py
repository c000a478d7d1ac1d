"""Two velocities, one held after the other, in sampled futures: a plain oracle, closed forms, laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.futures import Futures, sample_futures
from bug_gym.agents.hd_bug.roll_out import Velocities
from bug_gym.agents.hd_bug.sequences import FADING, NEAR_MISS, Sequences, Surroundings, judge_sequences
from bug_gym.kinematics import Drive, turning

F64 = NDArray[np.float64]

RADIUS, MARGIN, SPACING, TIMES, HELD = 0.2, 0.3, 0.1, 30, 4
HOLONOMIC = Drive("holonomic", 1.0, 0.3, 1.5, SPACING)
DIFFERENTIAL = Drive("differential", 1.0, 0.3, 1.5, SPACING)
DRIVES = {"holonomic": HOLONOMIC, "differential": DIFFERENTIAL}
NOWHERE = (1e3, 1e3)
OPEN = np.zeros((1, 1), dtype=np.int16)
HERE = (0.0, 0.0, 0.0)
FAR = 99.0


def around(
    points: list[tuple[float, float]] | None = None,
    *,
    node: tuple[float, float] = (1e6, 0.0),
    nodes: list[tuple[float, float]] | None = None,
    goal: tuple[float, float] = NOWHERE,
    blocked: NDArray[np.int16] = OPEN,
    corner: tuple[float, float] = NOWHERE,
) -> Surroundings:
    """What stands about the robot; the node is so far ahead that second headings are counted from the x axis."""
    x, y = np.array(points or [], dtype=np.float64).reshape(-1, 2).T
    return Surroundings(x.copy(), y.copy(), RADIUS, np.array(nodes or [node]), goal, 0.3, corner, 0.1, blocked)


def nobody() -> Futures:
    """The futures of no mover."""
    empty = np.empty((0, 2)), np.empty((0, 2)), np.empty((0, TIMES, 2)), np.empty((0, TIMES))
    return sample_futures(np.empty(0, dtype=np.int64), *empty, SPACING, 1.0)


def movers(seed: int, rate: float = 0.7, many: int = 5) -> Futures:
    """Futures of movers about the robot."""
    rng = np.random.default_rng(seed)
    side, away = rng.uniform(-math.pi, math.pi, many), rng.uniform(0.7, 2.5, many)
    position = away[:, None] * np.column_stack([np.cos(side), np.sin(side)])
    velocity = rng.uniform(-0.8, 0.8, (many, 2))
    predicted = position[:, None] + SPACING * np.arange(1, TIMES + 1)[None, :, None] * velocity[:, None]
    radii = rng.uniform(0.1, 0.5, (many, 1)) + 0.01 * np.arange(TIMES)[None]
    return sample_futures(np.arange(many), position, velocity, predicted, radii, SPACING, rate)


def velocities(*pairs: tuple[float, float], free: float = FAR) -> Velocities:
    """Velocities of directions [rad] and speeds [m/s]."""
    directions, speeds = np.array(pairs, dtype=np.float64).T
    return Velocities(directions.copy(), speeds.copy(), np.full(len(pairs), free))


def judge(
    drive: Drive,
    first: Velocities,
    second: Velocities,
    futures: Futures,
    surroundings: Surroundings | None = None,
    *,
    backs: bool = False,
    pose: tuple[float, float, float] = HERE,
) -> Sequences:
    """Judges sequences."""
    what = around() if surroundings is None else surroundings
    return judge_sequences(drive, pose, RADIUS, first, backs, HELD, second, what, futures, MARGIN, SPACING)


def driven(drive: Drive, pose: F64, direction: float, speed: float, steps: int) -> F64:
    """Poses (steps, 3) of a robot that is steered toward a velocity, as it is moved."""
    poses = []
    for _ in range(steps):
        bearing = direction - pose[2]
        if drive.kinematics == "holonomic":
            turn, along, way = 0.0, direction, speed * SPACING
        else:
            wish = max(speed, 1e-9)  # who stands turns toward where it would go
            ahead, rate = turning(drive, (wish * math.cos(bearing), wish * math.sin(bearing)))
            turn, way = rate * SPACING, ahead * SPACING
            along = pose[2] + 0.5 * turn
        pose = pose + np.array([way * math.cos(along), way * math.sin(along), turn])
        poses.append(pose)
    return np.array(poses)


def plain_risk(futures: Futures, path: F64) -> float:
    """The mean over the futures of the worst hit or near miss of a path (N, 2)."""
    gap = np.hypot(futures.x - path[None, :, :1], futures.y - path[None, :, 1:]) - RADIUS - futures.radii[:, :, None]
    missed = NEAR_MISS * np.clip(1.0 - gap / MARGIN, 0.0, None) ** 2
    cost = np.where(gap > 0.0, missed, 1.0 - gap)
    fade = np.exp(-SPACING * np.arange(1, TIMES + 1) / FADING)
    return float((fade[None, :, None] * cost).max(axis=(0, 1)).mean())


@pytest.mark.parametrize("kinematics", DRIVES)
@pytest.mark.parametrize("seed", range(6))
def test_risks_and_ends_are_those_of_a_plain_roll_out(kinematics: str, seed: int) -> None:
    drive, futures = DRIVES[kinematics], movers(seed)
    first = velocities((0.0, 1.0), (0.3, 0.5), (-1.2, 1.0), (3.0, 1.0), (0.7, 0.0))
    second = velocities((0.0, 1.0), (2.2, 1.0), (-0.4, 1.0), (0.0, 0.0))
    found = judge(drive, first, second, futures)
    for i in range(5):
        for j in range(4):
            before = driven(drive, np.zeros(3), float(first.directions[i]), float(first.speeds[i]), HELD)
            after = driven(drive, before[-1], float(second.directions[j]), float(second.speeds[j]), TIMES - HELD)
            path = np.concatenate([before, after])[:, :2]
            np.testing.assert_allclose(found.end[i, j], path[-1], atol=2e-6)
            assert found.risk[i, j] == pytest.approx(plain_risk(futures, path), abs=2e-5)
    assert 0.0 < found.risk.min() < found.risk.max() and not found.early.any()


@pytest.mark.parametrize("kinematics", DRIVES)
def test_the_last_of_the_second_follows_the_way(kinematics: str) -> None:
    drive, nodes = DRIVES[kinematics], [(1.0, 0.0), (1.0, 0.8), (9.0, 0.8)]
    found = judge(drive, velocities((0.0, 1.0)), velocities((0.0, 1.0)), nobody(), around(nodes=nodes))
    # In 3 s: 1 m to the first bend, 0.8 m to the next, and the rest on; who turns on the spot loses time.
    x, y = found.end[0, -1]
    if kinematics == "holonomic":
        assert (x, y) == pytest.approx((2.2, 0.8), abs=0.15)  # it turns when a node is nearer than a step
    else:
        assert 0.8 < x < 1.6
    assert y == pytest.approx(0.8, abs=0.25)
    np.testing.assert_allclose(found.end[0, 0], (3.0, 0.0), atol=1e-9)  # straight on it had gone past both


def test_the_way_is_followed_no_farther_than_to_what_stands_before_its_first_node() -> None:
    wall = [(1.5, 0.05 * i) for i in range(-20, 21)]
    moving = velocities((0.0, 1.0))
    shut = judge(HOLONOMIC, moving, moving, nobody(), around(wall, nodes=[(3.0, 0.0)]))
    np.testing.assert_allclose(shut.end[0, -1], (1.5 - RADIUS, 0.0), atol=1e-6)
    beyond = judge(HOLONOMIC, moving, moving, nobody(), around(wall, nodes=[(1.1, 0.0), (1.1, 9.0)]))
    x, y = beyond.end[0, -1]
    assert 1.0 <= x <= 1.1
    assert y > 1.5  # the wall stands beyond the node, where it turns


def test_a_curve_to_the_first_node_may_be_longer_than_the_straight_way() -> None:
    drive, moving = DIFFERENTIAL, velocities((0.0, 1.0))
    found = judge(drive, moving, moving, nobody(), around(nodes=[(0.9, 0.25), (0.9, 9.0)]))
    assert found.end[0, -1][1] > 0.6


def test_the_way_ends_at_its_last_place_or_at_the_goal() -> None:
    moving = velocities((0.0, 1.0))
    ends = judge(HOLONOMIC, moving, moving, nobody(), around(nodes=[(1.0, 0.0), (1.0, 0.5)]))
    np.testing.assert_allclose(ends.end[0, -1], (1.0, 0.5), atol=1e-9)
    assert ends.early[0, -1] == 0.0
    there = judge(HOLONOMIC, moving, moving, nobody(), around(nodes=[(1.0, 0.0), (1.0, 0.8)], goal=(1.0, 0.8)))
    assert there.early[0, -1] == pytest.approx(3.0 - 1.5, abs=0.2)  # the goal's radius is 0.3 m


def test_movers_on_the_way_are_met_on_it() -> None:
    """The risk of following is that of the bent path, not of going straight on."""
    position, still = np.array([[1.0, 1.5]]), np.zeros((1, 2))
    predicted, radii = np.repeat(position[:, None], TIMES, axis=1), np.full((1, TIMES), 0.3)
    futures = sample_futures(np.array([1]), position, still, predicted, radii, SPACING, 0.0)
    moving = velocities((0.0, 1.0))
    found = judge(HOLONOMIC, moving, moving, futures, around(nodes=[(1.0, 0.0), (1.0, 4.0)]))
    assert found.risk[0, 0] == 0.0
    assert found.risk[0, -1] > 0.2
    # From the first velocity's end it goes toward the node, wherever that has led.
    beside = judge(HOLONOMIC, velocities((0.5 * math.pi, 1.0)), moving, nobody(), around(nodes=[(0.0, 3.0)]))
    np.testing.assert_allclose(beside.end[0, -1], (0.0, 3.0), atol=1e-9)


def test_without_movers_nothing_is_risky() -> None:
    found = judge(HOLONOMIC, velocities((0.0, 1.0)), velocities((1.0, 1.0), (0.0, 0.0)), nobody())
    assert not found.risk.any()


def test_the_more_certain_and_the_sooner_a_hit_the_dearer_it_is() -> None:
    def risk(distance: float, rate: float) -> float:
        position, velocity = np.array([[distance, 0.0]]), np.array([[-0.5, 0.0]])
        predicted = position[:, None] + SPACING * np.arange(1, TIMES + 1)[None, :, None] * velocity[:, None]
        futures = sample_futures(np.array([3]), position, velocity, predicted, np.full((1, TIMES), 0.3), SPACING, rate)
        return float(judge(HOLONOMIC, velocities((0.0, 1.0)), velocities((0.0, 1.0)), futures).risk[0, 0])

    assert risk(2.0, 0.0) > risk(2.0, 1.0) > risk(3.5, 1.0) > 0.0
    assert risk(1.5, 0.0) > risk(3.0, 0.0)


def test_each_velocity_ends_where_something_stands() -> None:
    wall = [(1.0, 0.05 * i) for i in range(-20, 21)]
    # The second way is looked for from where the first has led: 0.4 m on, 0.4 m before the wall's disc.
    found = judge(
        HOLONOMIC, velocities((0.0, 1.0)), velocities((0.0, 1.0), (math.pi / 2.0, 1.0)), nobody(), around(wall)
    )
    np.testing.assert_allclose(found.end[0, :2], [[0.8, 0.0], [0.4, 2.6]], atol=1e-6)
    # The first one by what is free there.
    found = judge(HOLONOMIC, velocities((0.0, 1.0), free=0.25), velocities((0.0, 0.0)), nobody(), around(wall))
    np.testing.assert_allclose(found.end[0, 0], [0.25, 0.0], atol=1e-12)


def test_second_headings_are_counted_from_where_the_way_then_leads() -> None:
    found = judge(
        HOLONOMIC, velocities((math.pi / 2.0, 1.0)), velocities((0.0, 1.0)), nobody(), around(node=(3.0, 0.0))
    )
    way = np.array([3.0, -0.4]) / math.hypot(3.0, 0.4)
    np.testing.assert_allclose(found.end[0, 0], np.array([0.0, 0.4]) + 2.6 * way)


@pytest.mark.parametrize(("goal", "after"), [((0.5, 0.0), 2), ((1.35, 0.0), 11)])
def test_at_the_goal_it_is_there_and_nothing_later_counts(goal: tuple[float, float], after: int) -> None:
    position, velocity = np.array([[2.4, 0.0]]), np.zeros((1, 2))
    predicted = np.tile(position[:, None], (1, TIMES, 1))
    futures = sample_futures(np.array([0]), position, velocity, predicted, np.full((1, TIMES), 0.3), SPACING, 0.0)
    straight = velocities((0.0, 1.0)), velocities((0.0, 1.0))
    found = judge(HOLONOMIC, *straight, futures, around(goal=goal))
    assert found.early[0, 0] == pytest.approx(SPACING * (TIMES - after)) and found.risk[0, 0] == 0.0
    assert judge(HOLONOMIC, *straight, futures).risk[0, 0] > 0.0


def test_an_end_in_a_blocked_cell_is_the_last_place_before_it() -> None:
    blocked = np.zeros((10, 40), dtype=np.int16)
    blocked[:, 16:] = 1  # from 1.55 m on
    straight = velocities((0.0, 1.0)), velocities((0.0, 1.0))
    found = judge(HOLONOMIC, *straight, nobody(), around(blocked=blocked, corner=(-0.05, -0.5)))
    np.testing.assert_allclose(found.end[0, 0], [1.5, 0.0], atol=1e-9)
    everywhere = np.ones((100, 100), dtype=np.int16)
    found = judge(HOLONOMIC, *straight, nobody(), around(blocked=everywhere, corner=(-5.0, -5.0)))
    np.testing.assert_array_equal(found.end[0, 0], [0.0, 0.0])


def test_who_backs_does_not_turn_round_first() -> None:
    behind = velocities((math.pi, 0.3))
    stands = velocities((0.0, 0.0))
    backing = judge(DIFFERENTIAL, behind, stands, nobody(), backs=True)
    np.testing.assert_allclose(backing.end[0, 0], [-0.12, 0.0], atol=1e-12)
    np.testing.assert_allclose(judge(DIFFERENTIAL, behind, stands, nobody()).end[0, 0], [0.0, 0.0])


@pytest.mark.parametrize("kinematics", DRIVES)
@pytest.mark.parametrize("seed", range(3))
def test_a_turned_world_is_judged_alike(kinematics: str, seed: int) -> None:
    drive, futures, angle = DRIVES[kinematics], movers(seed), 0.9
    cos, sin = math.cos(angle), math.sin(angle)
    first, second = velocities((0.2, 1.0), (-1.0, 0.5)), velocities((0.5, 1.0), (2.0, 1.0))
    found = judge(drive, first, second, futures, around(node=(4.0, 1.0)))
    turn = np.array([[cos, sin], [-sin, cos]])
    other = futures._replace(
        position=futures.position @ turn, x=cos * futures.x - sin * futures.y, y=sin * futures.x + cos * futures.y
    )
    there = around(node=(4.0 * cos - sin, 4.0 * sin + cos))
    turned = judge(
        drive, first._replace(directions=first.directions + angle), second, other, there, pose=(0.0, 0.0, angle)
    )
    np.testing.assert_allclose(turned.risk, found.risk, atol=1e-9)
    np.testing.assert_allclose(turned.end, found.end @ turn, atol=1e-9)
