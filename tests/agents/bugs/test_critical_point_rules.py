"""OperativeCriticalPointBug rule by rule, in scenes in which one rule decides."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from episodes import RING_ROUND_THE_START, in_world, run_episode, scene, with_mover

from bug_gym.agents import make_policy
from bug_gym.agents.bugs.operative_critical_point_bug import ONWARD, Candidate, Sight
from bug_gym.agents.critical_points.circle import leg_along, leg_to
from bug_gym.agents.critical_points.cost import Cost
from bug_gym.agents.critical_points.meeting import Mover
from bug_gym.agents.critical_points.memory import CriticalPoint, LastEnd
from bug_gym.agents.critical_points.sub_goals import perpendicular_sub_goal
from bug_gym.agents.walls.boundary import WAIT
from bug_gym.agents.walls.contour import TARGET_MOVED
from bug_gym.simulation import Simulation
from bug_gym.view import View

C = 0.5
"""Radius of the virtual circle [m]."""
RADIUS = 0.4
"""Of the movers [m]."""
BOX = {"polygons": [[[4, -1], [6, -1], [6, 2], [4, 2]]]}
"""Across the way, with the right end nearer to it."""


class Choice(NamedTuple):
    """What one choice rests on and comes to."""

    policy: Any
    view: View
    memory: Any


def chosen(scenario: dict[str, Any], remembered: dict[str, Any] | None = None, **parameters: Any) -> Choice:
    """After the two looks from the start that a choice takes."""
    simulation = Simulation(scenario, 1)
    policy: Any = make_policy("ocpb", simulation, **{"clearance": C, **parameters})
    view, memory = View(simulation.reset(seeds=[0])[0, 0], policy.sensors), policy.start()
    for name, value in (remembered or {}).items():
        setattr(memory, name, value)
    for _ in range(2):
        policy.act(view, memory)
    return Choice(policy, view, memory)


# ------------------------------------------------------------------------------------------------ what was visited

REMEMBERED = ["traversed", "refused", "used"]
"""Sub-goals reached, sub-goals given up on the way, open points whose sub-goals were reached."""


@pytest.mark.parametrize("what", REMEMBERED)
def test_what_was_visited_or_given_up_is_not_chosen_again_until_the_target_is_elsewhere(what: str) -> None:
    first = chosen(scene(**BOX)).memory.critical
    kept = {what: [first.open_point if what == "used" else first.place]}
    same = chosen(scene(**BOX), {**kept, "goal": (10.0, 0.9 * TARGET_MOVED)}).memory
    assert math.dist(same.critical.place, first.place) > 0.1
    assert getattr(same, what) == kept[what]
    elsewhere = chosen(scene(**BOX), {what: [*kept[what]], "goal": (10.0, 1.1 * TARGET_MOVED)}).memory
    assert elsewhere.critical == first


def test_the_way_that_makes_a_robot_roam_counts_from_where_the_target_is_now() -> None:
    far = Cost(length=100.0)
    assert chosen(scene(**BOX), {"goal": (10.0, 0.9 * TARGET_MOVED), "cost": far}).memory.verdict == "looping"
    assert chosen(scene(**BOX), {"goal": (10.0, 1.1 * TARGET_MOVED), "cost": far}).memory.verdict == ""


# ------------------------------------------------------------------------------------------------ which is the nearest


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(
    "policy", ["critical_point_bug", "modified_critical_point_bug", "operative_critical_point_bug"]
)
def test_of_two_ends_counts_whose_sub_goal_is_nearer_to_the_goal_not_whose_open_point(
    policy: str, mirrored: bool
) -> None:
    ends, goal, r = [(10.0, 3.0), (9.4, -0.7)], (20.0, 0.0), 1.0
    sub_goals = [
        perpendicular_sub_goal(end, math.atan2(end[1], end[0]), side, r)
        for end, side in zip(ends, (1, -1), strict=True)
    ]
    left, right = (math.dist(end, goal) for end in ends)
    assert left < right - 0.15
    left, right = (math.dist(place, goal) for place in sub_goals)
    assert left > right + 0.2
    sign = -1.0 if mirrored else 1.0
    wall = [[x, sign * y] for x, y in (*ends, (9.7, -0.65), (10.3, 2.95))]
    world = {"polygons": [wall], "bounds": [-8, -8, 28, 8], "goal": [*goal]}
    episode = run_episode(policy, scene(**world), {"lidar.beams": 720, "lidar.range": 60.0}, clearance=r, max_steps=3)
    assert sign * in_world(episode, episode.memory.sub_goals[0])[0, 1] < 0.0


def test_what_stands_behind_the_goal_or_in_its_disc_is_not_in_the_way() -> None:
    """The robot is there before it touches the pole in the goal's disc, and 3 m before the wall."""
    scenario = scene(circles=[[10.1, 0.0, 0.05]]) | {"goal": {"radius": 0.5}, "robot": {"kinematics": "holonomic"}}
    episode = run_episode("ocpb", scenario, {"lidar.range": 20.0}, clearance=C)
    assert episode.outcome == "success"
    assert set(episode.modes) == {"motion_to_goal"}


# ------------------------------------------------------------------------------------------------ two looks


def test_an_open_point_that_only_the_second_look_shows_gives_no_sub_goal() -> None:
    """Beams without a return, more than are bridged, open a wall for once."""
    wall = scene(polygons=[[[5, -8], [5.4, -8], [5.4, 5], [5, 5]]])
    policy, view, _ = chosen(wall)
    torn = view.ranges.copy()
    torn[np.abs(np.angle(np.exp(1j * (policy.sensors.angles + 0.5)))) < 0.15] = policy.sensors.range
    memory = policy.start()
    for ranges in (view.ranges, torn):
        policy.act(view.with_ranges(ranges), memory)
    assert memory.critical.place[1] > 4.0
    # Where both look so it is a gap.
    memory = policy.start()
    for ranges in (torn, torn):
        policy.act(view.with_ranges(ranges), memory)
    assert -5.0 < memory.critical.place[1] < 0.0


def test_the_other_end_of_what_was_seen_there_is_another_open_point() -> None:
    policy, view, _ = chosen(scene(**BOX))
    sight, memory = Sight([], None, *view.points), policy.start()
    ends = policy.scanner.read(view, None, ()).ends
    for sign, count in ((1, len(ends)), (-1, 0)):
        memory.last_ends = [LastEnd(view.to_odometry(*end.point), sign * end.side) for end in ends]
        memory.looked_at = memory.time
        assert len(policy._look(view, memory, sight).ends) == count
    assert ends


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.2])
def test_noise_makes_no_open_points_on_a_wall(noise: float) -> None:
    simulation = Simulation(scene(), overrides={"lidar.noise": noise})
    policy: Any = make_policy("ocpb", simulation, clearance=C)
    assert policy.scanner.lookout.jump >= 6.0 * noise


# ------------------------------------------------------------------------------------------------ SAFE_POINT as printed


def row(low: float, high: float) -> dict[str, Any]:
    """Three boxes in a row across the way, with gaps of these widths to the right and to the left of the middle one [m]."""
    spans = [(-2.5 - low, -0.5 - low), (-0.5, 1.0), (1.0 + high, 3.0 + high)]
    boxes = [[[5.0, a], [5.2, a], [5.2, b], [5.0, b]] for a, b in spans]
    return scene(polygons=boxes, goal=[10, 0.2]) | {"lidar": {"beams": 1440, "range": 30.0}}


def test_the_printed_gap_is_that_to_the_facing_end_of_the_neighbour_all_round() -> None:
    policy, view, _ = chosen(row(0.8, 1.2), gap_rule="two_nearest")
    ends = policy.scanner.read(view, None, ()).ends
    sight, leg = Sight([], None, *view.points), leg_along(policy.circle, 0.0, 1.0, turns=False)
    found = {}
    for number, end in enumerate(ends):
        gap = policy._printed_gap(view, sight, leg, Candidate(end, end.point, number))
        found[round(end.point[1], 1)] = gap
    # From the right: the outer ends face one another round the robot's back.
    expected = {-3.3: 7.5, -1.3: 0.8, -0.5: 0.8, 1.0: 1.2, 2.2: 1.2, 4.2: 7.5}
    assert found == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize("sub_goal", ["perpendicular", "validated"])
@pytest.mark.parametrize(
    ("low", "high", "radius", "side"), [(0.8, 1.2, 0.35, -1), (0.8, 1.2, 0.45, 1), (1.2, 0.8, 0.45, -1)]
)
def test_by_the_printed_rule_the_next_nearest_sub_goal_follows_one_at_a_gap_below_two_radii(
    low: float, high: float, radius: float, side: int, sub_goal: str
) -> None:
    """Those in the right gap are nearer to the goal."""
    memory = chosen(row(low, high), clearance=radius, gap_rule="two_nearest", sub_goal=sub_goal).memory
    assert math.copysign(1.0, memory.critical.place[1]) == side


def test_the_printed_gap_of_a_step_ahead_is_that_of_the_two_open_points_nearest_to_its_end() -> None:
    """Both are ends of one pole, which is nearer to the end of the step than the other pole; not so to the robot."""
    fast = {"robot": {"max_speed": 2.0, "max_reverse": 0.0}, "time": {"step": 0.5}}
    poles = scene(circles=[[0.0, 1.2, 0.3], [1.5, -0.7, 0.1]]) | fast | {"lidar": {"beams": 1440, "range": 30.0}}
    policy, view, _ = chosen(poles)
    sight, leg = Sight([], None, *view.points), leg_along(policy.circle, 0.0, 5.0, turns=False)
    assert policy._printed_gap(view, sight, leg, None) == pytest.approx(0.2, abs=0.03)


# ------------------------------------------------------------------------------------------------ legs


@pytest.mark.parametrize("beside", [-0.1, 0.0, 0.2])
def test_a_pole_too_thin_to_be_seen_from_afar_is_gone_round_once_it_is_seen(beside: float) -> None:
    """Poles alone are no gap: that a leg is looked at again with a swept disc is what keeps the robot from them."""
    x, y = chosen(scene(**BOX)).memory.critical.place
    away = math.hypot(x, y)
    pole = [(2.5 * x - beside * y) / away, (2.5 * y + beside * x) / away, 0.04]
    scenario = scene(**BOX, circles=[pole]) | {"robot": {"kinematics": "holonomic"}}
    episode = run_episode("ocpb", scenario, {"lidar.beams": 40}, clearance=C)
    assert episode.outcome == "success" and episode.min_clearance > 0.0
    assert len(episode.memory.refused) == 1


def test_a_robot_on_its_way_to_the_goal_needs_less_room_than_one_that_would_set_out() -> None:
    policy, _, memory = chosen(scene())
    assert policy.keep < policy.take
    beside = 0.5 * (policy.keep + policy.take)
    view = chosen(scene(circles=[[3.0, 1.0 + beside, 1.0]]) | {"lidar": {"beams": 720, "range": 10.0}}).view
    sight = Sight([], None, *view.points)
    for mode, is_open in (("motion_to_goal", True), ("motion_to_critical_point", False)):
        memory.mode = mode
        assert policy._is_open(view, memory, sight) == is_open


def test_no_leg_is_gone_faster_than_the_robot_can_stop_at_its_end() -> None:
    policy, view, memory = chosen(scene() | {"robot": {"kinematics": "holonomic", "max_acceleration": 0.5}})
    for length in (0.02, 0.2, 0.5, 5.0):
        velocity = policy._drive(
            view, memory, leg_along(policy.circle, 0.0, length, turns=False), "motion_to_critical_point"
        )
        assert velocity[0] <= min(math.sqrt(2.0 * 0.5 * length), policy.sensors.drive.max_speed) + 1e-9


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_what_must_pass_along_a_leg_holds_the_body_and_twice_the_noise(noise: float) -> None:
    policy: Any = make_policy("ocpb", Simulation(scene(), overrides={"lidar.noise": noise}), clearance=C)
    assert policy.circle.body + 2.0 * noise < policy.keep < policy.take < C


LONG = {"kinematics": "differential", "circles": [[0.0, 0.0, 0.2], [0.25, 0.0, 0.2], [0.5, 0.0, 0.2]]}
"""A robot whose circle lies 0.25 m ahead of its axle."""


@pytest.mark.parametrize(("side", "is_free"), [(1.0, False), (-1.0, True)])
def test_a_long_body_does_not_turn_where_it_would_swing_against_something(side: float, is_free: bool) -> None:
    """The pole is beside the axle on the left, off the leg that leads back."""
    policy, _, memory = chosen(scene() | {"robot": LONG}, clearance=None, safety=0.15)
    assert memory.circle == pytest.approx((0.25, 0.0, 0.6))
    leg = leg_to(policy.circle, (-3.0, 0.5 * side), turns=True)
    assert leg is not None
    x, y = np.array([0.0]), np.array([0.55])
    ux, uy = math.cos(leg.heading), math.sin(leg.heading)
    assert abs(ux * (y[0] - leg.begin[1]) - uy * (x[0] - leg.begin[0])) > policy.keep
    assert policy._is_swept(leg, x, y, policy.keep) == is_free


@pytest.mark.parametrize("beams", [180, 720])
def test_a_long_body_swings_against_no_corner_that_lies_between_two_beams(beams: int) -> None:
    """What is nearest of a box is its corner; the beams beside that end on its faces, farther off."""
    rng, taken = np.random.default_rng(0), 0
    for _ in range(60):
        far, bearing, askew = rng.uniform(0.65, 0.74), rng.uniform(0.8, 2.4), rng.uniform(-0.7, 0.7)
        corner = far * np.exp(1j * bearing)
        sides = 0.6 * np.exp(1j * (bearing + askew + np.array([-0.25, 0.25]) * math.pi))
        ring = np.array([corner, corner + sides[0], corner + sides.sum(), corner + sides[1]])
        box = [[float(x), float(y)] for x, y in zip(ring.real, ring.imag, strict=True)]
        world = scene(polygons=[box]) | {"robot": LONG, "lidar": {"beams": beams}}
        policy, view, _ = chosen(world, clearance=None, safety=0.15)
        leg = leg_along(policy.circle, bearing + 0.6, 0.0, turns=True)
        if policy._is_swept(leg, *view.points, policy.keep):
            taken += 1
            foremost = 0.5 * np.exp(1j * np.linspace(0.0, leg.heading, 400))
            assert np.abs(foremost - corner).min() > 0.2
    assert 5 < taken < 55


BEHIND = (8.0, -0.5)
"""A place behind BOX."""


@pytest.mark.parametrize(
    ("place", "deadline", "is_kept"),
    [((3.0, -1.5), math.inf, True), ((3.0, -1.5), -1.0, False), (BEHIND, math.inf, False)],
    ids=["free", "too late", "blocked"],
)
def test_a_critical_point_is_kept_until_it_is_out_of_reach_and_then_stays_visited(
    place: tuple[float, float], deadline: float, is_kept: bool
) -> None:
    critical = CriticalPoint(place, LastEnd((4.0, -1.0), -1), deadline)
    memory = chosen(scene(**BOX), {"critical": critical, "goal": (10.0, 0.0)}).memory
    assert memory.refused == ([] if is_kept else [place])
    assert (memory.critical == critical) == is_kept


# ------------------------------------------------------------------------------------------------ tracks that meet


def is_avoided(scenario: dict[str, Any], steps: int = 15) -> bool:
    """Whether a mover has had a virtual obstacle so far."""
    return bool(run_episode("ocpb", scenario, clearance=C, max_steps=steps).memory.avoided)


@pytest.mark.parametrize(("x", "is_met"), [(9.5, True), (10.3, True), (11.5, False)])
def test_what_is_met_counts_where_the_discs_begin_to_touch_before_the_goal(x: float, is_met: bool) -> None:
    """The mover comes to the robot's line when the robot would, were it to go on behind the goal too."""
    closing = math.hypot(1.0, 0.4)
    assert (x - (C + RADIUS) / closing < 10.0) == is_met
    scenario = with_mover([x, -0.4 * x], [0.0, 0.4], RADIUS)
    scenario["lidar"]["range"] = 20.0
    assert is_avoided(scenario) == is_met


@pytest.mark.parametrize("share", [-1.4, -0.6, 0.6, 1.4])
def test_they_meet_where_circle_and_obstacle_would_touch(share: float) -> None:
    """At 1 m/s each, at right angles, they pass at the offset of the mover's start over the root of 2."""
    apart = share * (C + RADIUS)
    scenario = with_mover([5.0, -5.0 + math.sqrt(2.0) * apart], [0.0, 1.0], RADIUS)
    assert is_avoided(scenario) == (abs(share) < 1.0)


def test_what_is_avoided_may_come_as_near_as_along_a_leg() -> None:
    """Beside it the robot would turn back else: what would come within its circle is still beside its body."""
    policy, view, memory = chosen(scene())
    apart = 0.5 * (policy.near + C) + RADIUS
    passing = Sight([Mover(7, (5.0, -5.0 + math.sqrt(2.0) * apart), (0.0, 1.0), RADIUS)], None, *view.points)
    assert policy._meetings(view, memory, passing) and 7 in memory.virtual
    assert not policy._meetings(view, memory, passing) and not memory.virtual


@pytest.mark.parametrize("robot", [LONG, {"kinematics": "holonomic"}], ids=["differential", "holonomic"])
def test_in_time_it_turns_goes_and_then_turns_and_goes_on_or_stands(robot: dict[str, Any]) -> None:
    """What `_meets_nobody` says of legs and movers at random, asked of finely sampled times."""
    policy, view, _ = chosen(scene() | {"robot": robot}, clearance=None, safety=0.15)
    drive, near = policy.sensors.drive, 0.5
    draw = np.random.default_rng(5)
    told: list[bool] = []
    for _ in range(400):
        place = (float(draw.uniform(-3.0, 3.0)), float(draw.choice([-1.0, 1.0]) * draw.uniform(0.6, 2.0)))
        leg = leg_to(policy.circle, place, turns=policy.turns)
        assert leg is not None
        at = (float(draw.uniform(-2.0, 2.0)), float(draw.uniform(-2.0, 2.0)))
        mover = Mover(1, at, (float(draw.uniform(-1.0, 1.0)), float(draw.uniform(-1.0, 1.0))), 0.2)
        onward = math.atan2(-place[1], 10.0 - place[0])
        back = abs((onward - leg.heading + math.pi) % (2.0 * math.pi) - math.pi)
        turning, turning_on = (
            (abs(leg.turn) / drive.max_turn_rate, back / drive.max_turn_rate) if policy.turns else (0.0, 0.0)
        )
        arrival = turning + leg.length / drive.max_speed
        times = np.arange(0.0, arrival + turning_on + ONWARD, 0.01)
        along = np.clip(times - turning, 0.0, leg.length / drive.max_speed) * drive.max_speed
        beyond = np.maximum(times - arrival - turning_on, 0.0) * drive.max_speed
        own = np.column_stack(
            [leg.begin[0] + along * math.cos(leg.heading), leg.begin[1] + along * math.sin(leg.heading)]
        )
        theirs = np.array(mover.place) + times[:, None] * np.array(mover.velocity)
        goes_on = own + beyond[:, None] * np.array([math.cos(onward), math.sin(onward)])
        is_standing = times <= arrival + ONWARD
        gap_on = np.hypot(*(goes_on - theirs).T).min() - near - 0.2
        gap_stood = np.hypot(*(own - theirs)[is_standing].T).min() - near - 0.2
        gap = max(gap_on, gap_stood)
        if abs(gap) > 0.02:
            told.append(bool(gap > 0.0))
            assert policy._meets_nobody(view, leg, [mover], near) == told[-1]
    assert 20 < sum(told) < len(told) - 20


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("speed", "degrees"), [(0.7, 60.0), (1.0, 60.0), (1.0, 90.0)])
def test_the_side_behind_the_mover_comes_first_though_the_one_ahead_is_free_in_time_too(
    speed: float, degrees: float, sign: float, turn: str
) -> None:
    """They would meet at (5, 0) after 5 s; who goes toward the goal makes the side ahead the nearer one to it."""
    u, v = speed * math.cos(math.radians(degrees)), sign * speed * math.sin(math.radians(degrees))
    scenario = with_mover([5.0 - 5.0 * u, -5.0 * v], [u, v], RADIUS)
    x, y = run_episode("ocpb", scenario, clearance=C, turn=turn, max_steps=20).memory.critical_points[0]
    assert (x - 5.0) * u + y * v < 0.0


@pytest.mark.parametrize("case", ["across", "along"])
def test_a_leg_on_which_a_mover_will_be_met_is_given_up_as_soon_as_it_is_known_and_not_chosen_again(case: str) -> None:
    """It is at the left sub-goal, or on the leg to it, when the robot would be; the right one is further from the goal.

    That which comes along the leg stays off the straight way to the goal: there is no virtual obstacle to go round.
    """
    disc = [[6.0, -0.2, 1.0]]
    left = chosen(scene(circles=disc)).memory.critical.place
    assert left[1] > 0.0
    away = math.hypot(*left)
    movers = {
        "across": ((left[0] * 3.5 / away, left[1] * 3.5 / away + 0.6 * 3.5), (0.0, -0.6)),
        "along": ((left[0] + away, left[1] + 0.2), (-1.0, 0.0)),
    }
    episode = run_episode("ocpb", with_mover(*movers[case], RADIUS, circles=disc), clearance=C)
    assert episode.outcome == "success" and episode.min_clearance > 0.0
    assert bool(episode.memory.avoided) == (case == "across")
    first, second = episode.memory.critical_points[:2]
    assert first == pytest.approx(left) and second[1] < 0.0
    turned = episode.path[np.flatnonzero(np.diff(episode.path[:, 1]) < 0.0)[0], 0]
    assert turned < 1.5


def test_where_only_a_virtual_obstacle_is_in_the_way_its_own_ends_alone_count() -> None:
    """Those of the pole beside the way are nearer to the goal."""
    scenario = with_mover([5.0, -5.0], [0.0, 1.0], RADIUS, circles=[[8.5, 2.0, 0.3]])
    memory = run_episode("ocpb", scenario, clearance=C, max_steps=12).memory
    assert len(memory.sub_goals) == 2 and memory.critical is not None
    for place in memory.sub_goals:
        assert math.dist(place, (5.0, 0.0)) < 2.5


# ------------------------------------------------------------------------------------------------ waiting and giving up


@pytest.mark.parametrize("world", [scene(), scene(**BOX)], ids=["to the goal", "to a critical point"])
def test_only_waiting_without_a_break_counts_until_it_gives_up(world: dict[str, Any]) -> None:
    world["robot"] = {"kinematics": "differential"}
    assert chosen(world, {"waited": 0.99 * WAIT}).memory.waited == 0.0


@pytest.mark.parametrize(("open_point", "is_used"), [((0.3, 0.4), True), ((4.0, -1.0), False)])
def test_an_open_point_is_used_where_its_own_sub_goal_is_reached_not_one_beside_what_is_before_it(
    open_point: tuple[float, float], is_used: bool
) -> None:
    critical = CriticalPoint((0.0, 0.0), LastEnd(open_point, -1), math.inf)
    memory = chosen(scene(), {"critical": critical, "goal": (10.0, 0.0)}).memory
    assert memory.critical is None and memory.traversed == [(0.0, 0.0)]
    assert memory.used == ([critical.open_point] if is_used else [])


# ------------------------------------------------------------------------------------------------ detection time


def test_what_detection_costs_is_dot_for_each_mover_and_each_wait() -> None:
    episode = run_episode("ocpb", with_mover([8.0, -1.5], [0.0, 0.7]), clearance=C)
    policy: Any = make_policy("ocpb", episode.simulation, clearance=C)
    assert len(episode.memory.movers) == 1 and "waiting" not in episode.modes
    assert episode.memory.cost.detecting == pytest.approx(policy.interval)


def test_waiting_counts_as_detection() -> None:
    shut_in = {"world": RING_ROUND_THE_START, "lidar": {"beams": 360, "range": 60.0}}
    episode = run_episode("ocpb", shut_in, clearance=C, max_steps=40)
    waits = episode.modes.count("waiting")
    assert waits > 10
    assert episode.memory.cost.detecting == pytest.approx(0.1 * waits)
    assert episode.memory.cost.total == pytest.approx(0.1 * waits)
