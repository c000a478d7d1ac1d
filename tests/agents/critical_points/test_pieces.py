"""What critical points are made of: circle and legs, sub-goals, gaps, tracks that meet, what moves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from compiled import for_python
from numpy.typing import NDArray

from bug_gym import kernels
from bug_gym.agents.critical_points.circle import leg_along, leg_to, virtual_circle
from bug_gym.agents.critical_points.cost import Cost
from bug_gym.agents.critical_points.looks import INTERVAL, LOOK, SHIFTS, THRESHOLD, TIME, is_due, look_again, recall
from bug_gym.agents.critical_points.meeting import (
    Mover,
    is_behind,
    least_distance,
    meeting_times,
    printed_times,
    virtual_obstacle,
)
from bug_gym.agents.critical_points.moving import LEAST_LOOK, SAME_WAY, OpenPointSets, rules_of_looks
from bug_gym.agents.critical_points.scan_kernels import bridge_dropouts, can_turn, cast_capsule, sweep_leg
from bug_gym.agents.critical_points.sub_goals import perpendicular_sub_goal, printed_sub_goal
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

R = 0.5
"""Radius of the circle in the paper's numbers [m]."""

# ------------------------------------------------------------------------------------------------ sub-goals


def towards(origin: tuple[float, float], place: tuple[float, float]) -> float:
    """Bearing from one place to another [rad]."""
    return math.atan2(place[1] - origin[1], place[0] - origin[0])


def test_the_way_round_the_slab_over_two_sub_goals_has_the_computed_numbers() -> None:
    start, goal, first, second = (0.0, 0.0), (20.0, 0.0), (8.0, -3.0), (12.0, -3.0)
    q1 = perpendicular_sub_goal(first, towards(start, first), -1, R)
    q2 = perpendicular_sub_goal(second, towards(q1, second), -1, R)
    assert q1 == pytest.approx((7.8244, -3.4682), abs=1e-4)
    assert q2 == pytest.approx((12.0557, -3.4969), abs=1e-4)
    legs = [math.dist(start, q1), math.dist(q1, q2), math.dist(q2, goal)]
    assert legs == pytest.approx([8.5586, 4.2314, 8.6799], abs=1e-4)
    assert sum(legs) == pytest.approx(21.4699, abs=1e-4)
    # Below r already: r cos(angle from the line of sight to the leg that leaves).
    nearest = kernels.point_wall_distance(*first, *q1, *q2)
    assert nearest == pytest.approx(R * math.cos(towards(q1, q2) - towards(start, first)), abs=1e-9)
    assert nearest == pytest.approx(0.4693, abs=1e-4)


def test_as_printed_the_first_sub_goal_lies_inside_the_slab() -> None:
    x, y = printed_sub_goal((8.0, -3.0), math.atan2(-3.0, 8.0), -1, R)
    assert (x, y) == pytest.approx((8.1756, -2.8244), abs=1e-4)
    assert 8.0 < x < 12.0 and -3.0 < y < 5.0


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("degrees", range(0, 360, 15))
def test_a_sub_goal_lies_square_to_the_line_of_sight_away_from_the_obstacle_for_all_bearings(
    degrees: int, side: int
) -> None:
    bearing = math.radians(degrees)
    x, y = perpendicular_sub_goal((3.0, -2.0), bearing, side, R)
    dx, dy = x - 3.0, y + 2.0
    assert dx * math.cos(bearing) + dy * math.sin(bearing) == pytest.approx(0.0, abs=1e-12)
    # The obstacle lies clockwise of its left end: the sub-goal counter-clockwise.
    assert math.cos(bearing) * dy - math.sin(bearing) * dx == pytest.approx(side * R)


def test_the_printed_cases_with_a_sine_are_the_formula_below_180_degrees_and_its_negative_above() -> None:
    for degrees in (10, 45, 80, 100, 135, 170, 190, 225, 260, 280, 315, 350):
        bearing = math.radians(degrees)
        for side in (-1, 1):
            x, y = printed_sub_goal((0.0, 0.0), bearing, side, R)
            u, v = perpendicular_sub_goal((0.0, 0.0), bearing, side, R)
            sign = 1.0 if degrees < 180 else -1.0
            assert x == pytest.approx(sign * u)
            # cos gamma stands for sin gamma: the sign is right, the size that of x.
            assert abs(y) == pytest.approx(abs(u)) and y * sign * v > 0.0


# ------------------------------------------------------------------------------------------------ circle and legs


def test_the_virtual_circle_lies_midway_between_the_two_farthest_points() -> None:
    assert virtual_circle([(0.0, 0.0, 0.2)], 0.1) == pytest.approx((0.0, 0.0, 0.2, 0.3))
    # From -0.2 to 0.9 along the axis.
    assert virtual_circle([(0.0, 0.0, 0.2), (0.6, 0.0, 0.3)], 0.1) == pytest.approx((0.35, 0.0, 0.55, 0.65))


@pytest.mark.parametrize("seed", range(20))
def test_of_circles_in_a_row_it_holds_all_and_no_more(seed: int) -> None:
    """Not always do the farthest centres bear the farthest points."""
    draw = np.random.default_rng(seed)
    x, radii = draw.uniform(-0.6, 0.6, 4), draw.uniform(0.05, 0.6, 4)
    angle = draw.uniform(-3.0, 3.0)
    circle = virtual_circle([(a * math.cos(angle), a * math.sin(angle), r) for a, r in zip(x, radii, strict=True)], 0.1)
    low, high = (x - radii).min(), (x + radii).max()
    assert circle.body == pytest.approx(0.5 * (high - low))
    middle = 0.5 * (low + high)
    assert (circle.ahead, circle.left) == pytest.approx((middle * math.cos(angle), middle * math.sin(angle)))


@pytest.mark.parametrize("seed", range(20))
def test_a_leg_brings_the_centre_of_the_circle_to_its_place(seed: int) -> None:
    draw = np.random.default_rng(seed)
    ahead, left = draw.uniform(-0.4, 0.6), draw.uniform(-0.2, 0.2)
    circle = virtual_circle([(ahead, left, 0.25)], 0.1)
    place = (draw.uniform(-5.0, 5.0), draw.uniform(1.0, 5.0))
    leg = leg_to(circle, place, turns=True)
    assert leg is not None
    # Drive it: turn on the spot, then go straight; where is the body's centre then?
    cos, sin = math.cos(leg.turn), math.sin(leg.turn)
    x, y = leg.length * cos, leg.length * sin
    centre = (x + cos * ahead - sin * left, y + sin * ahead + cos * left)
    assert centre == pytest.approx(place, abs=1e-9)
    assert leg.end == pytest.approx(place, abs=1e-9)
    if left == 0.0:
        assert math.dist((x, y), place) == pytest.approx(circle.offset)


def test_with_the_centre_ahead_the_axle_stops_short_by_as_much_on_the_line_to_the_place() -> None:
    circle = virtual_circle([(0.3, 0.0, 0.2)], 0.1)
    leg = leg_to(circle, (3.0, 4.0), turns=True)
    assert leg is not None
    assert leg.heading == pytest.approx(math.atan2(4.0, 3.0))
    assert leg.length == pytest.approx(5.0 - 0.3)
    assert leg_to(circle, (0.1, 0.1), turns=True) is None


def test_a_holonomic_robot_goes_to_it_without_a_turn() -> None:
    circle = virtual_circle([(0.3, 0.0, 0.2)], 0.1)
    leg = leg_to(circle, (1.3, 1.0), turns=False)
    assert leg is not None and leg.turn == 0.0
    assert (leg.heading, leg.length) == pytest.approx((math.pi / 4.0, math.sqrt(2.0)))
    straight = leg_along(circle, math.pi / 2.0, 2.0, turns=False)
    assert straight.end == pytest.approx((0.3, 2.0)) and straight.turn == 0.0


# ------------------------------------------------------------------------------------------------ the scan


def points_about(seed: int, count: int = 60) -> Any:
    """Points (count, 2) at random within 4 m."""
    return np.random.default_rng(seed).uniform(-4.0, 4.0, (count, 2))


def swept(points: Any, begin: Any, heading: float, length: float, radius: float, width: float) -> Any:
    """`sweep_leg` over points (k, 2)."""
    scratch = np.empty(len(points), dtype=np.int64)
    x, y = np.ascontiguousarray(points.T)
    x0, y0 = begin
    return sweep_leg(x, y, x0, y0, heading, length, radius, width, scratch, scratch.copy())


@pytest.mark.parametrize("seed", range(8))
def test_the_gap_across_a_leg_is_that_of_all_pairs_whose_chord_crosses_it(seed: int) -> None:
    points = points_about(seed)
    draw = np.random.default_rng(100 + seed)
    begin, heading, length = draw.uniform(-1.0, 1.0, 2), draw.uniform(-3.0, 3.0), draw.uniform(0.5, 4.0)
    end = begin + length * np.array([math.cos(heading), math.sin(heading)])

    def across(p: Any, q: Any, o: Any) -> float:
        return float((q[0] - p[0]) * (o[1] - p[1]) - (q[1] - p[1]) * (o[0] - p[0]))

    expected = math.inf
    for i, p in enumerate(points):
        for q in points[:i]:
            is_crossed = across(begin, end, p) * across(begin, end, q) < 0.0
            is_crossed = is_crossed and across(p, q, begin) * across(p, q, end) < 0.0
            if is_crossed:
                expected = min(expected, math.dist(p, q))
    _, gap, _ = swept(points, begin, heading, length, 0.1, 9.0)
    assert gap == pytest.approx(expected)
    _, narrow, _ = swept(points, begin, heading, length, 0.1, expected * (1.0 - 1e-9))
    assert math.isinf(narrow)


@pytest.mark.parametrize("seed", range(8))
def test_the_free_way_of_a_leg_is_that_of_the_swept_disc_and_ends_at_the_point_it_names(seed: int) -> None:
    points = points_about(seed, 30)
    begin = np.array([0.3, -0.2])
    x, y = np.ascontiguousarray((points - begin).T)
    for heading in np.linspace(-3.0, 3.0, 7).tolist():
        free, _, touched = swept(points, begin, heading, 9.0, 0.25, 0.0)
        expected = kernels.free_distance(x, y, heading, 0.25, math.inf)
        assert free == pytest.approx(expected) or (math.isinf(free) and math.isinf(expected))
        if touched >= 0:
            at = begin + free * np.array([math.cos(heading), math.sin(heading)])
            assert math.dist(at, points[touched]) == pytest.approx(0.25)


@pytest.mark.parametrize("seed", range(10))
def test_a_turn_is_free_where_the_body_sweeps_over_no_point(seed: int) -> None:
    points = points_about(seed, 6) * 0.25
    ahead, left, radius = 0.4, 0.1, 0.3
    points = points[np.hypot(points[:, 0] - ahead, points[:, 1] - left) > radius + 0.01]
    x, y = np.ascontiguousarray(points.T)
    for heading in (-3.0, -1.2, 0.4, 2.5):
        turned = np.linspace(0.0, heading, 2000)
        centre_x = np.cos(turned) * ahead - np.sin(turned) * left
        centre_y = np.sin(turned) * ahead + np.cos(turned) * left
        least = np.hypot(centre_x[:, None] - x, centre_y[:, None] - y).min(initial=math.inf)
        assert can_turn(x, y, ahead, left, heading, radius) == (least >= radius) or abs(least - radius) < 1e-3


@pytest.mark.parametrize(("heading", "is_free"), [(-1.0, True), (1.0, False)])
def test_what_is_too_near_already_does_not_bar_a_turn_away_from_it(heading: float, is_free: bool) -> None:
    assert can_turn(np.array([0.4]), np.array([0.25]), 0.4, 0.0, heading, 0.3) == is_free


@pytest.mark.parametrize("seed", range(6))
def test_a_capsule_in_the_scan_ends_beams_at_its_outline(seed: int) -> None:
    draw = np.random.default_rng(seed)
    ends = draw.uniform(1.5, 4.0, (2, 2)) * draw.choice([-1.0, 1.0], 2)
    radius = 0.4
    angles = np.linspace(0.0, 2.0 * math.pi, 60, endpoint=False)
    cos, sin = np.cos(angles), np.sin(angles)
    ranges, owner = np.full(60, 9.0), np.full(60, -1, dtype=np.int64)
    (x0, y0), (x1, y1) = ends
    cast_capsule(cos, sin, x0, y0, x1, y1, radius, 7, ranges, owner)
    ways = np.linspace(0.0, 9.0, 600)
    for i in range(60):
        distances = [kernels.point_wall_distance(w * cos[i], w * sin[i], *ends[0], *ends[1]) for w in ways]
        inside = np.flatnonzero(np.array(distances) < radius)
        if len(inside) == 0:
            assert ranges[i] == 9.0 or min(distances) < radius + 0.01
            continue
        assert owner[i] == 7
        assert ranges[i] == pytest.approx(ways[inside[0]], abs=0.03)


@pytest.mark.parametrize(("missing", "is_gap"), [(1, False), (3, False), (4, True)])
def test_up_to_three_beams_without_a_return_are_no_gap(missing: int, is_gap: bool) -> None:
    ranges = np.full(40, 2.0)
    ranges[38 : 38 + missing] = 10.0
    ranges[: max(missing - 2, 0)] = 10.0
    filled = np.empty(40)
    bridge_dropouts(ranges, 10.0, 0.3, 3, True, filled)
    assert (filled.max() >= 10.0) == is_gap


@pytest.mark.parametrize("wraps", [True, False])
def test_only_in_a_full_circle_is_the_first_beam_the_last_ones_neighbour(wraps: bool) -> None:
    ranges, filled = np.full(40, 2.0), np.empty(40)
    ranges[0] = 10.0
    bridge_dropouts(ranges, 10.0, 0.3, 3, wraps, filled)
    assert filled[0] == (2.0 if wraps else 10.0)


def test_no_gap_is_bridged_between_things_at_different_distances() -> None:
    ranges = np.array([2.0] * 10 + [10.0] + [4.0] * 10)
    filled = np.empty(21)
    bridge_dropouts(ranges, 10.0, 0.3, 3, True, filled)
    assert filled[10] == 10.0


# ------------------------------------------------------------------------------------------------ tracks that meet

CASES = {
    # place, velocity of the obstacle; met by the corrected times, by the printed ones.
    "equal times": ((5.0, -5.0), (0.0, 1.0), True, True),
    "twice as long": ((5.0, -5.0), (0.0, 0.5), False, False),
    "nearer and slower": ((5.0, -2.5), (0.0, 0.5), True, False),
    "gone by then": ((5.0, -2.0), (0.0, 1.0), False, True),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("angle", [0.0, 2.1])
def test_crossing_tracks_meet_where_both_times_are_equal(case: str, angle: float) -> None:
    (x, y), (u, v), corrected, printed = CASES[case]
    cos, sin = math.cos(angle), math.sin(angle)
    mover = Mover(1, (cos * x - sin * y, sin * x + cos * y), (cos * u - sin * v, sin * u + cos * v), 0.4)
    own = (cos, sin)
    assert (meeting_times((0.0, 0.0), own, mover, R + 0.4) is not None) == corrected
    assert (printed_times((0.0, 0.0), own, mover, R + 0.4) is not None) == printed


def test_the_times_of_a_crossing_are_those_of_the_least_distance() -> None:
    times = meeting_times((0.0, 0.0), (1.0, 0.0), Mover(1, (5.0, -5.0), (0.0, 1.0), 0.4), R + 0.4)
    assert times is not None and times.closest == pytest.approx(5.0)
    for time in (times.first, times.last):
        assert math.hypot(5.0 - time, -5.0 + time) == pytest.approx(R + 0.4)


def test_as_printed_the_times_are_equal_up_to_what_the_robot_needs_for_the_distance() -> None:
    assert printed_times((0.0, 0.0), (0.5, 0.0), Mover(1, (5.0, -5.0), (0.0, 0.5), 0.4), 0.9) == pytest.approx(
        (10, 8.2, 11.8)
    )
    near = Mover(1, (0.6, -5.0), (0.0, 1.0), 0.4)
    assert printed_times((0.0, 0.0), (1.0, 0.0), near, 0.9) == pytest.approx((0.6, 0.0, 1.5))


@pytest.mark.parametrize(("speed", "closing"), [(-1.0, 2.0), (-0.3, 1.3), (0.4, 0.6)])
def test_head_on_and_overtaking_follow_from_the_same_formula(speed: float, closing: float) -> None:
    times = meeting_times((0.0, 0.0), (1.0, 0.0), Mover(1, (10.0, 0.0), (speed, 0.0), 0.4), R + 0.4)
    assert times is not None
    assert times == pytest.approx((10.0 / closing, (10.0 - 0.9) / closing, (10.0 + 0.9) / closing))
    assert printed_times((0.0, 0.0), (1.0, 0.0), Mover(1, (10.0, 0.0), (speed, 0.0), 0.4), R + 0.4) is None


@pytest.mark.parametrize(
    ("place", "velocity"), [((3.0, 1.0), (1.0, 0.0)), ((3.0, 0.0), (1.5, 0.0)), ((3.0, 1.0), (0.3, 0.8))]
)
def test_who_goes_away_is_never_met(place: tuple[float, float], velocity: tuple[float, float]) -> None:
    assert meeting_times((0.0, 0.0), (1.0, 0.0), Mover(1, place, velocity, 0.4), R + 0.4) is None


def test_who_is_near_already_is_met_from_now_on() -> None:
    times = meeting_times((0.0, 0.0), (1.0, 0.0), Mover(1, (0.8, 0.1), (0.0, 0.0), 0.4), R + 0.4)
    assert times is not None and times.first == 0.0
    assert times.last == pytest.approx(0.8 + math.sqrt(0.9**2 - 0.1**2))


@pytest.mark.parametrize(
    ("place", "velocity"), [((-5.0, -5.0), (0.0, 1.0)), ((5.0, 5.0), (0.0, 1.0)), ((-5.0, 5.0), (0.0, 1.0))]
)
def test_tracks_that_cross_behind_one_of_them_never_meet_as_printed_either(
    place: tuple[float, float], velocity: tuple[float, float]
) -> None:
    """Their crossing is as far from the robot as the printed times ask."""
    assert printed_times((0.0, 0.0), (1.0, 0.0), Mover(1, place, velocity, 0.4), R + 0.4) is None


def test_a_virtual_obstacle_covers_the_mover_as_long_as_the_tracks_are_near() -> None:
    mover = Mover(1, (5.0, -2.5), (0.1, 0.5), 0.4)
    times = meeting_times((0.0, 0.0), (1.0, 0.0), mover, R + 0.4)
    assert times is not None
    virtual = virtual_obstacle(mover, times)
    for time in np.linspace(times.first, times.last, 9).tolist():
        assert kernels.point_wall_distance(*mover.at(time), *virtual.begin, *virtual.end) < 1e-9
    assert is_behind((5.5, -3.0), virtual) and not is_behind((5.5, 3.0), virtual)


@pytest.mark.parametrize("seed", range(5))
def test_the_least_distance_on_a_leg_is_that_of_finely_sampled_times(seed: int) -> None:
    draw = np.random.default_rng(seed)
    mover = Mover(1, tuple(draw.uniform(-3, 3, 2)), tuple(draw.uniform(-1, 1, 2)), 0.4)
    begin, velocity = draw.uniform(-1, 1, 2), draw.uniform(-1, 1, 2)
    times = np.linspace(0.7, 3.1, 4000)
    expected = min(math.dist(begin + (t - 0.7) * velocity, mover.at(t)) for t in times)
    found = least_distance(tuple(begin), tuple(velocity), 0.7, 3.1, mover)
    assert found == pytest.approx(expected, abs=1e-3)


# ------------------------------------------------------------------------------------------------ what moves


RULES = np.array([0.05, 0.5, LEAST_LOOK, SAME_WAY])


def first_look() -> NDArray[np.float64]:
    """At a thing that nothing is known of, at time 0."""
    look = np.empty(LOOK)
    for_python(recall)(1.0, 0.0, 0.0, 0.0, np.empty((0, LOOK)), look)
    return look


def test_a_thing_is_dynamic_only_when_it_has_shifted_twice_the_same_way() -> None:
    again, once = for_python(look_again), first_look()
    again(once, 0.5, 0.1, 0.0, RULES)
    assert once[SHIFTS] == 1.0 and once[TIME] == 0.5
    for place, shifts in (((0.2, 0.02), 2.0), ((0.0, 0.0), 1.0), ((0.13, 0.0), 0.0)):
        look = once.copy()
        again(look, 1.0, *place, RULES)
        assert look[SHIFTS] == shifts


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
def test_a_shift_is_more_than_noise_and_the_slowest_thing_that_counts_makes_it_between_two_looks(noise: float) -> None:
    sensors = Sensors.of(Simulation("static", overrides={"lidar.noise": noise}).scenario)
    threshold, interval = rules_of_looks(sensors)[[THRESHOLD, INTERVAL]]
    assert threshold > 3.0 * noise + 0.02
    assert interval >= 0.3 and 0.1 * interval >= threshold - 1e-9


def test_the_next_look_comes_after_dot_and_sooner_at_a_fast_thing() -> None:
    is_time, look = for_python(is_due), first_look()
    assert not is_time(look, 0.4, 0.01, 0.0, RULES)
    assert is_time(look, 0.5, 0.01, 0.0, RULES)
    assert is_time(look, 0.3, 0.2, 0.0, RULES)
    assert not is_time(look, 0.2, 0.2, 0.0, RULES)


def test_by_the_printed_rule_an_open_point_is_still_then_shifted_then_dynamic() -> None:
    sets, found = OpenPointSets(), []
    for step in range(12):
        found.append(sets.update([((0.1 * step, 0.0), 0.3), ((5.0, 5.0), 0.3)], 0.1 * step, 0.05))
    assert found[0] == found[1] == []
    moving = [movers for movers in found if movers]
    assert moving and all(len(movers) == 1 for movers in moving)
    assert moving[0][0].velocity == pytest.approx((1.0, 0.0))
    assert sets.still == [(0.0, 0.0), (5.0, 5.0)]


# ------------------------------------------------------------------------------------------------ cost


def test_the_cost_is_moving_rotating_and_detecting_in_seconds() -> None:
    cost = Cost()
    for pose in ((0.0, 0.0, 0.0), (0.0, 0.0, 1.5), (3.0, 4.0, 1.5)):
        cost.go_on(pose, 2.0, 0.5)
    cost.detecting += 0.7
    assert (cost.moving, cost.rotating, cost.detecting) == pytest.approx((2.5, 3.0, 0.7))
    assert cost.total == pytest.approx(6.2)
    cost = Cost()
    for pose in ((0.0, 0.0, 3.0), (0.0, 0.0, -3.0)):
        cost.go_on(pose, 2.0, 0.5)
    assert cost.rotation == pytest.approx(2.0 * math.pi - 6.0)
    cost = Cost()
    for pose in ((0.0, 0.0, 0.0), (1.0, 0.0, 2.0)):
        cost.go_on(pose, 2.0, math.inf)
    assert cost.rotating == 0.0 and cost.rotation == pytest.approx(2.0)
