"""What robots see through one another, beside a slow plain loop, and who is near whom."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

import bug_gym
from bug_gym.agents import make_policy
from bug_gym.agents.teams.partners import (
    AS_TOLD,
    BODY_MARGIN,
    ROOM,
    SAME_WALL,
    SeeThrough,
    are_linked,
    closes,
    gap,
    gap_on_ways,
    least_gap,
    now_of,
    place_after,
    who_goes,
)
from bug_gym.config import load
from bug_gym.geometry import F64, wrap
from bug_gym.observation import width
from bug_gym.team_policy import Frame, TeamMemory, word_of
from bug_gym.view import Sensors, View

BEAMS, FAR = 48, 5.0
SENSORS = Sensors.of(load("empty", {"lidar.beams": BEAMS, "lidar.range": FAR, "lidar.noise": 0.01}))
REACH = SENSORS.radius + BODY_MARGIN + 3.0 * SENSORS.range_noise


def robot(place: tuple[float, float], ranges: F64, rng: np.random.Generator) -> TeamMemory:
    """A robot that stands at a place of the team's frame, in an odometry frame of its own."""
    frame = Frame(*rng.uniform(-3.0, 3.0, 3).tolist())
    flat = np.zeros(width(SENSORS.fields), dtype=np.float32)
    here, parts = frame.to_odometry(place), {field.name: field for field in SENSORS.fields}
    flat[parts["ranges"].begin : parts["ranges"].end] = ranges
    flat[parts["pose"].begin : parts["pose"].end] = *here, rng.uniform(-3.0, 3.0)
    view = View(flat, SENSORS)
    return TeamMemory(frame=frame, view=view, word=word_of(view, frame), is_heard=True)


def team(count: int, spread: float, rng: np.random.Generator) -> list[TeamMemory]:
    """Robots in a square, each with a scan of pieces of wall, gaps, and the bodies of the others."""
    places = rng.uniform(-spread, spread, (count, 2))
    robots = []
    for place in places:
        ranges = np.repeat(rng.uniform(0.8, 2.0 * FAR, BEAMS // 4), 4) + rng.uniform(0.0, 0.05, BEAMS)
        robots.append(robot((float(place[0]), float(place[1])), ranges.clip(max=FAR), rng))
    for one in robots:  # each sees the others' bodies where they are before all else
        assert one.view is not None
        ranges = one.view.ranges.copy()
        for x, y in bodies_before(one, [other for other in robots if other is not one]):
            angle = np.abs((SENSORS.angles - math.atan2(y, x) + math.pi) % (2.0 * math.pi) - math.pi)
            ranges[angle < math.asin(min(SENSORS.radius / math.hypot(x, y), 1.0))] = math.hypot(x, y) - SENSORS.radius
        one.view = one.view.with_ranges(ranges.clip(0.05, FAR))
    return robots


def bodies_before(one: TeamMemory, others: list[TeamMemory]) -> list[tuple[float, float]]:
    """Places of other robots in the frame of one [m]."""
    assert one.view is not None and one.frame is not None
    return [one.view.to_robot(*one.frame.to_odometry(other.word.place)) for other in others if other.word is not None]


def slow_look(one: TeamMemory, partners: list[TeamMemory]) -> tuple[F64, np.ndarray]:
    """The ranges of a robot without the bodies of partners, and which beams they stopped, in plain loops."""
    assert one.view is not None and one.frame is not None
    ux, uy = SENSORS.beam_directions.tolist()
    ranges, bodies = one.view.ranges.tolist(), bodies_before(one, partners)

    def is_body(x: float, y: float, places: list[tuple[float, float]]) -> bool:
        return any((x - a) * (x - a) + (y - b) * (y - b) <= REACH * REACH for a, b in places)

    hidden = [far < FAR and is_body(ux[i] * far, uy[i] * far, bodies) for i, far in enumerate(ranges)]
    clean = [FAR if is_hidden else far for far, is_hidden in zip(ranges, hidden, strict=True)]
    for other, (x, y) in zip(partners, bodies, strict=True):
        assert other.view is not None and other.word is not None
        turn = other.word.heading - one.frame.heading - one.view.heading
        cos, sin = math.cos(turn), math.sin(turn)
        theirs = other.view.ranges.tolist()
        points = [
            (x + r * (cos * a - sin * b), y + r * (sin * a + cos * b)) for r, a, b in zip(theirs, ux, uy, strict=True)
        ]
        for i, (px, py) in enumerate(points):
            j = (i + 1) % BEAMS
            qx, qy = points[j]
            nearest = SAME_WALL * 2.0 * math.pi / BEAMS * min(theirs[i], theirs[j])
            if max(theirs[i], theirs[j]) >= FAR or (qx - px) ** 2 + (qy - py) ** 2 > nearest * nearest:
                continue
            if is_body(px, py, [*bodies, (0.0, 0.0)]) or is_body(qx, qy, [*bodies, (0.0, 0.0)]):
                continue
            for k in np.flatnonzero(hidden).tolist():
                aside, aside_end = ux[k] * py - uy[k] * px, ux[k] * qy - uy[k] * qx
                if aside * aside_end > 0.0 or aside == aside_end:
                    continue
                share = aside / (aside - aside_end)
                along = (1.0 - share) * (ux[k] * px + uy[k] * py) + share * (ux[k] * qx + uy[k] * qy)
                if 0.0 < along < clean[k]:
                    clean[k] = along
    return np.array(clean).astype(np.float32).astype(np.float64), np.array(hidden)


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_bodies_of_partners_are_taken_out_as_a_slow_plain_loop_does(count: int) -> None:
    rng = np.random.default_rng(count)
    hidden, filled = 0, 0
    for _ in range(60):
        robots = team(count, 3.0, rng)
        looks, partners = rng.random(count) < 0.8, rng.random(count) < 0.8
        for number, seen in enumerate(SeeThrough(SENSORS, count).seen(robots, looks.tolist(), partners.tolist())):
            view = robots[number].view
            assert view is not None
            told = [other for k, other in enumerate(robots) if k != number and partners[k]]
            ranges, expected = slow_look(robots[number], told if looks[number] else [])
            np.testing.assert_array_equal(seen.view.ranges, ranges)
            assert (seen.hidden is None) == (not expected.any()) == (seen.view is view)
            if seen.hidden is not None:
                np.testing.assert_array_equal(seen.hidden, expected)
                np.testing.assert_array_equal(seen.still().ranges, np.where(expected, 0.0, ranges))
            hidden, filled = hidden + expected.sum(), filled + (ranges[expected] < FAR).sum()
    assert count == 1 or (hidden > 50 and filled > 5)


@pytest.mark.parametrize(("distance", "is_same"), [(FAR + 1.1 * REACH, True), (FAR - REACH, False)])
def test_who_has_no_partner_within_range_of_a_beam_sees_what_its_scanner_sees(distance: float, is_same: bool) -> None:
    rng = np.random.default_rng(1)
    ranges = np.full(BEAMS, FAR - 0.8 * REACH)
    robots = [robot(place, ranges, rng) for place in ((1.0, -2.0), (1.0, -2.0 + distance))]
    seen = SeeThrough(SENSORS, 2).seen(robots, [True, True], [True, True])
    assert [one.view is memory.view for one, memory in zip(seen, robots, strict=True)] == [is_same, is_same]
    assert all((one.hidden is None) == is_same for one in seen)
    assert not is_same or all(one.still() is one.view for one in seen)


def test_scans_that_were_read_at_once_are_looked_through_as_others_are() -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        robots = team(4, 2.0, rng)
        views = [one.view for one in robots if one.view is not None]
        rows = np.zeros((4, width(SENSORS.fields)), dtype=np.float32)
        for row, view in zip(rows, views, strict=True):
            row[SENSORS.always_seen[0]] = view.ranges
            row[next(field.begin for field in SENSORS.fields if field.name == "pose") :][:3] = view.pose
        expected = SeeThrough(SENSORS, 4).seen(robots, [True] * 4, [True] * 4)
        for one, view in zip(robots, View.of_rows(rows, SENSORS, 0.3), strict=True):
            one.view = view
        for now, alone in zip(SeeThrough(SENSORS, 4).seen(robots, [True] * 4, [True] * 4), expected, strict=True):
            np.testing.assert_array_equal(now.view.ranges, alone.view.ranges)
            np.testing.assert_array_equal(now.view.points, alone.view.with_ranges(alone.view.ranges).points)
            np.testing.assert_equal(now.hidden, alone.hidden)


@pytest.mark.parametrize(("door", "is_one"), [(0.4, True), (0.6, False)])
def test_two_places_of_a_wall_are_linked_but_across_a_gap_that_is_wider_than_a_link(door: float, is_one: bool) -> None:
    along = np.concatenate([np.arange(-2.0, -0.5 * door + 1e-9, 0.02), np.arange(0.5 * door, 2.0, 0.02)])
    wall = np.stack([along, np.zeros_like(along)], axis=-1)
    assert are_linked((-1.0, 0.0), (1.0, 0.0), wall, link=0.5, aside=0.7) is is_one
    # A way round through the rest of the room is none.
    turn = np.linspace(0.0, math.pi, 200)
    room = np.concatenate([wall, 2.0 * np.stack([np.cos(turn), -np.sin(turn)], axis=-1)])
    assert are_linked((-1.0, 0.0), (1.0, 0.0), room, link=0.5, aside=0.7) is is_one
    assert are_linked((-1.0, 0.0), (1.0, 0.0), room, link=0.5, aside=20.0)


def ways(count: int, rng: np.random.Generator) -> list[F64]:
    """Where some robots are step by step, from the same places on whenever they are drawn."""
    return [rng.normal(0.0, 0.2, (int(rng.integers(1, 6)), 2)).cumsum(axis=0) for _ in range(count)]


def test_the_gap_on_two_ways_is_the_least_of_many_instants() -> None:
    rng = np.random.default_rng(5)
    for _ in range(100):
        one, other = ways(2, rng)
        instants = np.linspace(0.0, 5.0, 2001)
        apart = [
            np.stack([np.interp(instants, np.arange(len(way)), way[:, axis]) for axis in (0, 1)])
            for way in (one, other)
        ]
        assert gap_on_ways(one, other) == pytest.approx(np.hypot(*(apart[0] - apart[1])).min(), abs=5e-3)


def test_who_goes_comes_no_nearer_to_another_than_is_allowed_or_than_if_both_brake() -> None:
    rng, went = np.random.default_rng(6), 0
    for _ in range(100):
        begins = rng.uniform(-1.5, 1.5, (4, 2))
        wished, braked = (
            [begin + np.concatenate([np.zeros((1, 2)), way]) for begin, way in zip(begins, ways(4, rng), strict=True)]
            for _ in range(2)
        )
        goes = who_goes(wished, braked, reach=20.0, least=0.6)
        driven = [wished[robot] if does_go else braked[robot] for robot, does_go in enumerate(goes)]
        for one in range(4):
            for other in range(one):
                allowed = min(0.6, gap_on_ways(braked[one], braked[other])) - 1e-5
                assert gap_on_ways(driven[one], driven[other]) >= allowed
        went += sum(goes)
    assert 0 < went < 400
    apart = [[np.array([[x, 0.0], [x + 0.1, 0.0]]) for x in (0.0, 3.0)], [np.array([[x, 0.0]]) for x in (0.0, 3.0)]]
    assert who_goes(*apart, reach=4.0, least=0.6) == [True, True]


def test_robots_are_as_near_as_they_see_however_far_their_odometry_has_drifted() -> None:
    drift = {"odometry.translation_noise": 0.1, "odometry.rotation_noise": 0.1}
    env = bug_gym.parallel_env("circle_swap", robots=3, overrides=drift)
    driver: Any = make_policy("swarm_com", env)
    seen, _ = env.reset(seed=0)
    state, told_wrong = None, 0.0
    for _ in range(30):
        actions, state = driver.predict(seen, state)
        poses = env.simulation.world.pose[0]
        for one, other in itertools.combinations(range(3), 2):
            is_apart = math.dist(poses[one, :2], poses[other, :2])
            assert gap(state[one], state[other]) == pytest.approx(is_apart, abs=2.0 * AS_TOLD)
            turn = now_of(state[one]).heading - now_of(state[other]).heading - poses[one, 2] + poses[other, 2]
            assert wrap(turn) == pytest.approx(0.0, abs=2.0 * AS_TOLD)
            told = math.dist(state[one].word.place, state[other].word.place)
            told_wrong = max(told_wrong, abs(told - is_apart))
        seen, *_ = env.step(actions)
        assert len(env.agents) == 3
    assert told_wrong > ROOM


def test_robots_whose_odometry_is_right_are_where_they_tell_to_the_last_bit() -> None:
    env = bug_gym.parallel_env("circle_swap", robots=3)
    driver: Any = make_policy("swarm_com", env)
    seen, _ = env.reset(seed=0)
    state = None
    for _ in range(30):
        actions, state = driver.predict(seen, state)
        assert all(now_of(memory) is memory.word for memory in state)
        seen, *_ = env.step(actions)


def test_bodies_that_touch_on_the_way_of_a_step_close_however_wide_the_gap_is_at_its_end() -> None:
    rng = np.random.default_rng(8)
    touching = 2.0 * SENSORS.radius
    spared = 0
    for _ in range(300):
        bearing, apart = rng.uniform(-math.pi, math.pi), touching + rng.uniform(0.0, 0.2)
        places = (0.0, 0.0), (apart * math.cos(bearing), apart * math.sin(bearing))
        one, other = (robot(place, np.full(BEAMS, FAR), rng) for place in places)
        (vx, vy), (ux, uy) = rng.uniform(-4.0, 4.0, (2, 2)).tolist()
        ends = place_after(one, (vx, vy)), place_after(other, (ux, uy))
        shares = np.linspace(0.0, 1.0, 201)[:, None]
        between = (1.0 - shares) * np.subtract(*places) + shares * np.subtract(*ends)
        nearest = float(np.hypot(*between.T).min())
        if not closes(one, (vx, vy), other, (ux, uy), apart, least_gap(SENSORS)):
            assert nearest >= min(touching, apart - 1e-4)
        spared += nearest < touching - 1e-3 and math.dist(*ends) > least_gap(SENSORS)
    assert spared > 5, "no way was drawn along which bodies touch that lie apart at its end"
