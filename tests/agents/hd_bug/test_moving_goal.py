"""A goal that moves: its velocity, how far ahead that is trusted, and when it can be met."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bug_gym.agents.hd_bug.moving_goal import LEADS, LONGEST_LEAD, LOOK_BACK, MovingGoal, meeting_time

STEP = 0.1


def followed(places: list[tuple[float, float]]) -> MovingGoal:
    """What is known after a goal was seen at these places, a step apart."""
    goal = MovingGoal()
    for place in places:
        goal.update(place, STEP)
    return goal


def straight(velocity: tuple[float, float], steps: int) -> list[tuple[float, float]]:
    return [(3.0 + velocity[0] * STEP * k, -1.0 + velocity[1] * STEP * k) for k in range(steps)]


@pytest.mark.parametrize("velocity", [(0.0, 0.0), (0.5, 0.0), (-0.3, 0.8)])
@pytest.mark.parametrize("steps", [2, 5, 6, 200])
def test_a_straight_way_gives_its_velocity(velocity: tuple[float, float], steps: int) -> None:
    assert followed(straight(velocity, steps)).velocity == pytest.approx(velocity, abs=1e-12)


def test_one_place_gives_no_velocity() -> None:
    assert followed([(1.0, 2.0)]).velocity == (0.0, 0.0)


def test_the_velocity_is_that_of_the_last_half_second() -> None:
    places = [(0.0, 0.0)] * 20 + [(0.04 * k, 0.0) for k in range(1, 6)]
    assert followed(places).velocity == pytest.approx((0.4, 0.0))


def test_a_goal_that_keeps_its_velocity_is_trusted_for_long() -> None:
    assert followed(straight((0.4, 0.3), 300)).trusted_lead() == LONGEST_LEAD


def test_leads_not_yet_tried_are_trusted() -> None:
    assert followed(straight((0.4, 0.3), 2)).trusted_lead() == LONGEST_LEAD


@pytest.mark.parametrize("period", [1.0, 3.0, 6.0])
def test_a_goal_that_goes_to_and_fro_is_trusted_for_less_than_it_takes_to_turn(period: float) -> None:
    there_and_back = [abs((STEP * k) % period - 0.5 * period) for k in range(600)]
    lead = followed([(distance, 0.0) for distance in there_and_back]).trusted_lead()
    assert lead < 0.5 * period


@pytest.mark.parametrize("steps", [*range(2, 20), 30, 100])
def test_a_goal_that_keeps_its_velocity_is_never_mistrusted(steps: int) -> None:
    """Nor while its first velocities rest on less than half a second."""
    assert followed(straight((0.4, 0.3), steps)).trusted_lead() == LONGEST_LEAD


def test_a_goal_that_stands_has_shown_nothing_whatever_the_noise_of_its_place() -> None:
    noise = np.random.default_rng(0).uniform(-0.005, 0.005, (300, 2))
    assert followed([(3.0 + x, -1.0 + y) for x, y in noise.tolist()]).trusted_lead() == LONGEST_LEAD


@pytest.mark.parametrize("rate", [0.05, 0.09, 0.2, 0.4, 0.7, 1.6, 4.0])
def test_on_a_circle_it_is_trusted_as_long_as_that_fails_by_less_than_half_of_its_way(rate: float) -> None:
    """The chord of the last half second foretells a place on the tangent of its middle: all of it in closed form."""
    chord = 2.0 * math.sin(0.5 * rate * LOOK_BACK) / LOOK_BACK  # speed on a circle of 1 m [m/s]
    shares = []
    for ahead in LEADS:
        went = np.array([math.cos(rate * ahead) - 1.0, math.sin(rate * ahead)])
        behind = 0.5 * math.pi - 0.5 * rate * LOOK_BACK  # direction of the chord
        told = chord * ahead * np.array([math.cos(behind), math.sin(behind)])
        shares.append(math.dist(told, went) / math.hypot(*went))
    failing = [number for number, share in enumerate(shares) if share > 0.5]
    lead = (0.5 * LEADS[0], *LEADS)[failing[0]] if failing else LONGEST_LEAD
    turns = [rate * STEP * number for number in range(400)]
    assert followed([(math.cos(turn), math.sin(turn)) for turn in turns]).trusted_lead() == lead


def test_its_memory_does_not_grow() -> None:
    assert len(followed(straight((0.4, 0.3), 1000)).places) == len(followed(straight((0.4, 0.3), 200)).places)


@pytest.mark.parametrize(
    ("velocity", "time"),
    [
        ((0.0, 0.5), 10.0 / math.sqrt(0.75)),
        ((0.5, 0.0), 20.0),
        ((-0.5, 0.0), 20.0 / 3.0),
        ((0.0, 1.0), math.inf),
        ((1.0, 0.0), math.inf),
        ((-1.0, 0.0), 5.0),
    ],
)
def test_a_goal_is_met_at_the_time_of_the_closed_form(velocity: tuple[float, float], time: float) -> None:
    assert meeting_time((0.0, 0.0), (10.0, 0.0), velocity, 1.0, 0.0) == pytest.approx(time)


@pytest.mark.parametrize("seed", range(3))
def test_at_the_meeting_time_the_goal_is_as_far_as_the_robot_comes_and_never_before(seed: int) -> None:
    rng = np.random.default_rng(seed)
    met = 0
    for _ in range(300):
        robot, goal = rng.uniform(-10.0, 10.0, (2, 2))
        velocity = rng.uniform(-1.2, 1.2, 2)
        radius = float(rng.choice([0.0, 0.3, 1.0]))
        time = meeting_time(tuple(robot), tuple(goal), tuple(velocity), 0.8, radius)
        moments = np.linspace(0.0, min(time, 200.0), 2000, endpoint=False)
        gaps = np.hypot(*(goal + moments[:, None] * velocity - robot).T) - 0.8 * moments - radius
        assert time == 0.0 or (gaps > -1e-6).all()
        if math.isfinite(time) and time > 0.0:
            met += 1
            assert math.dist(goal + time * velocity, robot) == pytest.approx(0.8 * time + radius)
    assert met > 100


def test_a_goal_within_the_radius_is_met_at_once() -> None:
    assert meeting_time((1.0, 1.0), (1.2, 1.0), (5.0, 0.0), 0.1, 0.3) == 0.0


@pytest.mark.parametrize("difference", [1e-4, 1e-7, 1e-10, -1e-7, -1e-10])
def test_a_goal_nearly_as_fast_as_the_robot_is_met_when_one_as_fast_is(difference: float) -> None:
    equal = meeting_time((0.0, 0.0), (10.0, 0.0), (-0.6, 0.8), 1.0, 0.2)
    near = meeting_time((0.0, 0.0), (10.0, 0.0), (-0.6, 0.8), 1.0 + difference, 0.2)
    assert near == pytest.approx(equal, rel=1e-3)
