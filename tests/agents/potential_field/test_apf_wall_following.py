"""APF with wall following: angles, closed forms, the map of Oni and Wang, what each part is worth, drift, movers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from episodes import (
    CANONICAL_POLYGONS,
    CLOSED_FORM_SENSORS,
    OTHER,
    RING_ROUND_THE_START,
    Disc,
    Ring,
    Slab,
    UTrap,
    canonical_world,
    run_episode,
    tolerance,
)

from bug_gym.agents import make_policy
from bug_gym.agents.potential_field.apf_wall_following import lap_verdict
from bug_gym.agents.potential_field.field import FieldParameters
from bug_gym.agents.potential_field.turning import Turning
from bug_gym.agents.potential_field.wall_follower import expected_bearing
from bug_gym.simulation import Simulation
from bug_gym.view import View
from bug_gym.worlds.oni_wang import ONI_WANG_PLACES, ONI_WANG_POLYGON

POLICY = "apf_wall_following"
STRAIGHT: dict[str, Any] = {"approach": "straight"}
SIDES = [1, -1]


def decisions(scenario: Any, overrides: dict[str, Any] | None = None, **parameters: Any) -> Iterator[tuple[Any, Any]]:
    """Memory and true pose (3,) after each decision of an episode."""
    simulation = Simulation(scenario, 1, overrides=overrides)
    agent = make_policy(POLICY, simulation, **parameters)
    observation, state = simulation.reset(seeds=[0]), None
    while True:
        action, state = agent.predict(observation[:, 0], state)
        assert state is not None
        yield state[0], simulation.world.pose[0, 0].copy()
        step = simulation.step(action[:, None])
        observation = step.observation
        if state[0].verdict or step.terminated.any() or step.truncated.any():
            return


# ---------------------------------------------------------------------------------------------- the wall follower


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("heading", [0.0, 0.4, -2.0])
def test_at_the_clearance_the_expected_direction_is_that_of_the_wall(side: int, heading: float) -> None:
    """The wall lies at its side, so its nearest point at -90 or +90 degrees of the wall's direction."""
    along = -heading
    wall = along - side * 0.5 * math.pi
    settings: Any = {"gain": math.radians(60.0), "clearance": 0.5}
    expected = expected_bearing(wall, 0.5, side, alpha=math.radians(91.0), **settings)
    assert abs(math.remainder(expected - along, 2.0 * math.pi)) < math.radians(2.0)
    plain = expected_bearing(wall, 0.5, side, alpha=math.radians(90.0), **settings)
    assert math.remainder(plain - along, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("side", SIDES)
def test_too_far_it_leans_to_the_wall_and_too_near_away_from_it(side: int) -> None:
    wall = -side * 0.5 * math.pi
    alpha, gain = math.radians(90.0), math.radians(60.0)
    for distance, lean in ((0.6, 6.0), (0.4, -6.0), (5.0, 30.0), (0.0, -30.0)):
        expected = expected_bearing(wall, distance, side, alpha=alpha, gain=gain, clearance=0.5)
        assert -side * math.degrees(expected) == pytest.approx(lean)


def long_wall() -> dict[str, Any]:
    """A wall 40 m long across the way, met near one end."""
    world = {"family": "explicit", "bounds": [-10, -30, 20, 30], "start": [0, -15, 0], "goal": [15, -15]}
    return {"world": {**world, "polygons": [[[5, -20], [6, -20], [6, 20], [5, 20]]]}, "lidar": {"beams": 360}}


def test_a_constant_alpha_of_92_degrees_hugs_the_wall_and_one_of_90_does_not() -> None:
    """The paper's Fig. 6, without the feedback of the distance."""
    mean = {}
    for alpha in (90.0, 92.0):
        settings = {"turn": "left", "alpha": alpha, "alpha_gain": 0.0, "clearance": 0.5, **STRAIGHT}
        episode = run_episode(POLICY, long_wall(), max_steps=300, **settings)
        beside = episode.path[(episode.path[:, 1] > -5.0) & (episode.path[:, 0] < 5.0)]
        assert len(beside) > 50
        mean[alpha] = float(np.mean(5.0 - beside[:, 0]))
    assert mean[92.0] < mean[90.0] - 0.01


# ---------------------------------------------------------------------------------------------- the angles


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("angle", [0.0, 0.83])
@pytest.mark.parametrize("approach", ["field", "straight"])
def test_at_a_wall_across_the_way_the_target_lies_at_90_degrees(kinematics: str, angle: float, approach: str) -> None:
    scenario = canonical_world("slab", angle=angle)
    episode = run_episode(
        POLICY, scenario, {"robot.kinematics": kinematics}, clearance=0.5, approach=approach, max_steps=150
    )
    assert math.degrees(episode.memory.phi[0]) == pytest.approx(90.0, abs=3.0)


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_the_cumulative_angle_is_the_true_change_of_heading(turn: str, kinematics: str) -> None:
    """Resets set it to zero; `total` goes on. What it began with stands to the wall where it was met."""
    overrides = {**CLOSED_FORM_SENSORS, "robot.kinematics": kinematics}
    course, begun, since_reset, resets = 0.0, None, 0.0, 0
    last: Any = None
    checked = 0
    for memory, pose in decisions("hook", overrides, clearance=0.4, turn=turn, **STRAIGHT):
        if last is not None and kinematics == "holonomic" and np.hypot(*(pose[:2] - last[:2])) > 1e-6:
            direction = math.atan2(pose[1] - last[1], pose[0] - last[0])
        else:
            direction = pose[2] if kinematics == "differential" else course
        # Half a turn at a time at most: the hook has no dead end so narrow that a step turns further.
        course += math.remainder(direction - course, 2.0 * math.pi)
        last = pose
        turning = memory.turning
        if turning is None or not turning.is_aligned:
            begun = None
            continue
        if begun is None:
            begun, since_reset, resets = course + turning.side * turning.total, course, turning.resets
            since_reset += turning.side * turning.cumulative
        if turning.resets > resets:
            since_reset, resets = course, turning.resets
        assert turning.total == pytest.approx(-turning.side * (course - begun), abs=1e-3)
        assert turning.cumulative == pytest.approx(-turning.side * (course - since_reset), abs=1e-3)
        checked += 1
    assert checked > 100


@pytest.mark.parametrize("turn", ["left", "right"])
def test_a_convex_corner_adds_90_degrees_and_a_concave_one_takes_them(turn: str) -> None:
    angles = [
        math.degrees(memory.turning.total)
        for memory, _ in decisions(canonical_world("u_trap"), clearance=0.5, turn=turn, **STRAIGHT)
        if memory.turning is not None and memory.turning.is_aligned
    ]
    # Along the base, the arm, its tip, its other side: each level is kept for a while.
    for level in (0.0, -90.0, 0.0, 90.0):
        near = [abs(angle - level) <= 3.0 for angle in angles]
        assert sum(near) >= 5, level
        angles = angles[near.index(True) :]


def turning(**changes: Any) -> Turning:
    """A robot at a wall on its right that runs along y, the target straight behind the wall."""
    settings: dict[str, Any] = {"side": 1, "along": 0.5 * math.pi, "place": (0.0, 0.0), "course": 0.0, "target": 0.0}
    return Turning(**{**settings, **changes})


def go(one: Turning, *courses: float, place: tuple[float, float] = (0.0, 0.0), resets: bool = True) -> None:
    """Let it travel along courses [degrees], a decision each."""
    for degrees in courses:
        course = math.radians(degrees)
        one.advance(place, 0.0, course, math.remainder(course - one.course, 2.0 * math.pi), resets=resets)


def test_nothing_counts_until_the_robot_goes_along_the_wall() -> None:
    one = turning()
    go(one, 10.0, -30.0, -80.0)
    assert not one.is_aligned and one.cumulative == 0.0 and not one.faces_target(unwrapped=False)
    go(one, 85.0)
    assert one.is_aligned and math.degrees(one.cumulative) == pytest.approx(5.0)


def test_inner_and_outer_angles_are_summed_apart() -> None:
    one = turning()
    go(one, 90.0, 130.0, 110.0, 120.0)
    assert math.degrees(one.outer) == pytest.approx(50.0) and math.degrees(one.inner) == pytest.approx(20.0)
    assert math.degrees(one.cumulative) == pytest.approx(-30.0)


def test_condition_1_resets_after_an_outward_excursion_and_not_after_a_ripple() -> None:
    one = turning()
    go(one, 90.0, 115.0, 90.0)
    assert one.resets == 0
    go(one, 180.0, 90.0, place=(-3.0, 4.0))
    assert one.resets == 1 and one.place == (-3.0, 4.0)
    assert one.cumulative == 0.0 and math.degrees(one.first) == pytest.approx(90.0)
    without = turning()
    go(without, 90.0, 180.0, 90.0, place=(-3.0, 4.0), resets=False)
    assert without.resets == 0 and without.place == (0.0, 0.0)


def test_conditions_2_and_3_ask_for_the_angle_of_the_entry_and_for_progress() -> None:
    one = turning()
    go(one, 90.0, 45.0)
    assert not one.faces_target(unwrapped=False) and not one.faces_target(unwrapped=True)
    go(one, 0.0)
    assert one.faces_target(unwrapped=False) and one.faces_target(unwrapped=True)
    assert one.has_come_nearer((0.5, 7.0), 0.0) and not one.has_come_nearer((-0.5, 7.0), 0.0)


@pytest.mark.parametrize(("short", "faces"), [(0.0, True), (5.0, True), (10.5, False)])
def test_the_gyroscope_may_have_lost_five_degrees_and_no_more_than_ten(short: float, faces: bool) -> None:
    one = turning()
    go(one, 90.0, short)
    assert one.faces_target(unwrapped=False) == one.faces_target(unwrapped=True) == faces
    other = turning()
    go(other, 90.0, 180.0, 90.0 + short)
    assert (other.resets == 1) == faces


def test_facing_the_target_after_a_full_turn_away_is_not_facing_it() -> None:
    one = turning()
    go(one, 90.0, 180.0, 270.0, 360.0)
    assert math.degrees(one.cumulative) == pytest.approx(-270.0)
    assert not one.faces_target(unwrapped=False) and not one.faces_target(unwrapped=True)


def test_the_unwrapped_angle_follows_a_target_that_moves() -> None:
    one = turning()
    go(one, 90.0)
    for target in (20.0, 40.0, 60.0, 80.0):
        one.advance((0.0, 0.0), math.radians(target), math.radians(90.0), 0.0, resets=True)
    assert math.degrees(one.unwrapped) == pytest.approx(10.0) and not one.faces_target(unwrapped=True)
    one.advance((0.0, 0.0), math.radians(90.0), math.radians(90.0), 0.0, resets=True)
    assert one.faces_target(unwrapped=True) and not one.faces_target(unwrapped=False)


@pytest.mark.parametrize(
    ("total", "target_turned", "verdict"),
    [(1.0, 1.0, "unreachable"), (1.0, 0.0, "looping"), (-1.0, 0.0, "unreachable"), (-1.0, -1.0, "looping")],
)
def test_a_lap_proves_something_by_its_two_turnings(total: float, target_turned: float, verdict: str) -> None:
    turned = 2.0 * math.pi * total, 2.0 * math.pi * target_turned
    assert lap_verdict(*turned, 2) == verdict
    assert lap_verdict(*turned, 1) == ("" if verdict == "looping" else verdict)


# ---------------------------------------------------------------------------------------------- closed forms

CASES = [
    ("slab", Slab().until_free),
    ("disc", lambda turn: Disc().until_free()),
    ("u_trap", lambda turn: UTrap().until_free()),
]


@pytest.mark.parametrize("approach", ["field", "straight"])
@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("world", "length"), CASES, ids=lambda case: case if isinstance(case, str) else "")
def test_straight_until_contact_or_in_the_field_the_way_has_the_length_of_bug0s_closed_form(
    world: str, length: Any, turn: str, mirrored: bool, approach: str
) -> None:
    """37.26 m in the U. The field is caught before the wall straight ahead, and goes on from there to the same contour."""
    scenario = canonical_world(world, angle=0.83, mirrored=mirrored)
    episode = run_episode(POLICY, scenario, turn=turn, clearance=0.5, approach=approach)
    expected = length(OTHER[turn] if mirrored else turn)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


# Start, goal, and the lengths [m] of a point that follows the rounded contour at 0.4 m, turning left and right.
HOOK = [
    ((7.0, 0.0), (30.0, 0.0), 40.45, 80.1),
    ((7.0, 0.0), (-10.0, 0.0), 78.11, 30.4),
    ((7.0, 3.0), (9.0, 20.0), 96.75, 18.0),
    ((30.0, 0.0), (7.0, 0.0), 56.31, 33.3),
]


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize(("start", "goal", "left", "right"), HOOK)
def test_the_hook_is_left_by_either_side(start: Any, goal: Any, left: float, right: float, turn: str) -> None:
    """The field meets its wall within its influence of where straight motion does, and leaves it in the same place."""
    places = {"world.start": [*start, 0.0], "world.goal": list(goal), "world.bounds": [-15, -15, 35, 25]}
    straight, field = (
        run_episode(POLICY, "hook", {**CLOSED_FORM_SENSORS, **places}, turn=turn, clearance=0.4, approach=approach)
        for approach in ("straight", "field")
    )
    expected = left if turn == "left" else right
    for episode in (straight, field):
        assert episode.outcome == "success"
        assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))
    ((hit, field_hit),) = zip(straight.memory.hits, field.memory.hits, strict=True)
    ((leave, field_leave),) = zip(straight.memory.leaves, field.memory.leaves, strict=True)
    assert math.dist(hit, field_hit) < FieldParameters().influence
    assert math.dist(leave, field_leave) < 3.0 * 0.1  # three steps


def test_with_a_wide_clearance_the_field_goes_farther_than_straight_motion() -> None:
    """It is caught nearer to a wall ahead than the 1 m of the map, and has to go back: the lengths there are no bound to it."""
    places = {**CLOSED_FORM_SENSORS, "world.start": "A", "world.goal": "B"}
    straight, field = (
        run_episode(POLICY, "oni_wang", places, turn="left", clearance=1.0, approach=approach)
        for approach in ("straight", "field")
    )
    farther = field.memory.hits[0][0] - straight.memory.hits[0][0]
    assert 0.1 < farther < field.full_length - straight.full_length


# Lengths [m] on the map of Oni and Wang at a clearance of 1 m, rounded contour, straight motion until contact.
ROUTES = {
    "left": {"AB": 17.10, "AC": 225.97, "AD": 42.82, "BA": 130.18, "BC": 106.83, "BD": 31.68}
    | {"CA": 138.28, "CB": 10.90, "CD": 59.82, "DA": 44.90, "DB": 57.24, "DC": 266.11},
    "right": {"AB": 74.52, "AC": 83.19, "AD": 45.57, "BA": 16.73, "BC": 10.90, "BD": 96.07}
    | {"CA": 139.41, "CB": 132.66, "CD": 87.72, "DA": 39.13, "DB": 32.38, "DC": 41.04},
}
BOTH_SIDES = [(turn, route) for turn, routes in ROUTES.items() for route in routes]


@pytest.mark.parametrize(("turn", "route"), BOTH_SIDES)
def test_the_24_routes_of_the_map_have_their_lengths(turn: str, route: str) -> None:
    places = {"world.start": route[0], "world.goal": route[1]}
    episode = run_episode(POLICY, "oni_wang", {**CLOSED_FORM_SENSORS, **places}, turn=turn, clearance=1.0, **STRAIGHT)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(ROUTES[turn][route], abs=tolerance(ROUTES[turn][route]))


def moved_map(route: str) -> dict[str, Any]:
    """The map mirrored, turned by 0.7 rad and shifted by (3, -5)."""
    cos, sin = math.cos(0.7), math.sin(0.7)
    move = np.array([[cos, sin], [sin, -cos]])

    def place(point: Any) -> Any:
        return (np.asarray(point, dtype=float) @ move + (3.0, -5.0)).tolist()

    start, goal = place(ONI_WANG_PLACES[route[0]]), place(ONI_WANG_PLACES[route[1]])
    heading = math.atan2(goal[1] - start[1], goal[0] - start[0])
    world = {"family": "explicit", "bounds": [-45, -45, 60, 60], "polygons": [place(ONI_WANG_POLYGON)]}
    return {"world": {**world, "start": [*start, heading], "goal": goal}}


@pytest.mark.parametrize(("turn", "route"), BOTH_SIDES)
def test_with_the_field_all_24_arrive_on_the_map_mirrored_turned_and_shifted(turn: str, route: str) -> None:
    episode = run_episode(POLICY, moved_map(route), CLOSED_FORM_SENSORS, turn=turn, clearance=1.0)
    assert episode.outcome == "success"


# ---------------------------------------------------------------------------------------------- what parts are worth


@pytest.mark.parametrize("route", ["AC", "BC", "DC"])
def test_without_the_projection_the_routes_into_the_pocket_are_cycles(route: str) -> None:
    places = {"world.start": route[0], "world.goal": route[1]}
    settings = {"turn": "left", "clearance": 1.0, "projection": False, **STRAIGHT}
    assert run_episode(POLICY, "oni_wang", {**CLOSED_FORM_SENSORS, **places}, **settings).verdict == "looping"


@pytest.mark.parametrize("approach", ["field", "straight"])
@pytest.mark.parametrize("world", ["u_trap", "hook"])
def test_leaving_as_soon_as_the_way_is_free_stays_in_the_trap(world: str, approach: str) -> None:
    scenario, overrides = (canonical_world(world), {}) if world == "u_trap" else (world, CLOSED_FORM_SENSORS)
    settings: dict[str, Any] = {"clearance": 0.4, "projection": False, "approach": approach}
    assert run_episode(POLICY, scenario, overrides, leave="free", **settings).verdict == "looping"
    assert run_episode(POLICY, scenario, overrides, **settings).outcome == "success"


@pytest.mark.parametrize("leave", ["distance", "heading"])
@pytest.mark.parametrize("route", ["AC", "BC"])
def test_the_rules_that_the_paper_calls_too_simple_cycle_on_the_map(route: str, leave: str) -> None:
    places = {"world.start": route[0], "world.goal": route[1]}
    settings = {"turn": "left", "clearance": 1.0, "projection": False, "leave": leave, **STRAIGHT}
    assert run_episode(POLICY, "oni_wang", {**CLOSED_FORM_SENSORS, **places}, **settings).verdict == "looping"


def test_the_angle_of_a_reset_is_that_of_the_place() -> None:
    """In front of the tip of the U's arm, where the outward turn of the corner is undone."""
    episode = run_episode(POLICY, canonical_world("u_trap"), clearance=0.5, turn="left", **STRAIGHT)
    (place,) = episode.memory.reset_places
    assert place[0] == pytest.approx(4.5, abs=0.7) and 2.0 < place[1] < 4.8
    assert not run_episode(
        POLICY, canonical_world("u_trap"), clearance=0.5, reset=False, **STRAIGHT
    ).memory.reset_places


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("turn", ["left", "right"])
def test_it_shows_forces_reset_points_and_the_cumulative_angle(turn: str, kinematics: str) -> None:
    """All the way out of the U."""
    scenario, robot = canonical_world("u_trap"), {"robot.kinematics": kinematics}
    policy: Any = make_policy(POLICY, Simulation(scenario, overrides=robot), clearance=0.5, turn=turn)
    turned: list[float] = []
    for memory, pose in decisions(scenario, robot, clearance=0.5, turn=turn):
        turning, drawing = memory.turning, policy.draw(memory)
        shown = {name: (x1 - x0, y1 - y0) for x0, y0, x1, y1, name in drawing.segments}
        total, attraction = memory.felt.forces.total, memory.felt.forces.attraction
        push = (total[0] - attraction[0], total[1] - attraction[1])
        for name, force in {"force": total, "attraction": attraction, "repulsion": push}.items():
            assert shown[name] == pytest.approx(as_drawn(force, pose[2]), abs=1e-5)
        assert [point[:2] for point in drawing.points if point[2] == "reset"] == memory.reset_places
        if turning is None:
            assert shown.keys() == {"force", "attraction", "repulsion"}
            continue
        entry, angle, target = (math.atan2(*shown[name][::-1]) for name in ("entry", "angle", "target"))
        assert math.remainder(target - turning.first_target, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)
        toward_wall = turning.side * math.remainder(entry - angle, 2.0 * math.pi)
        assert math.remainder(toward_wall - turning.cumulative, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-6)
        turned.append(turning.cumulative)
    assert memory.reset_places and min(turned) < math.radians(-80.0) and max(turned) > math.radians(80.0)


def as_drawn(force: tuple[float, float], heading: float) -> tuple[float, float]:
    """A force of the robot's frame in the world, shortened to 1 where it is longer."""
    size, bearing = min(math.hypot(*force), 1.0), math.atan2(force[1], force[0]) + heading
    return size * math.cos(bearing), size * math.sin(bearing)


# ---------------------------------------------------------------------------------------------- no way

RING = Ring()


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("approach", ["field", "straight"])
def test_a_goal_shut_in_is_unreachable_after_a_lap_and_one_with_a_closer_hand(
    turn: str, kinematics: str, approach: str
) -> None:
    settings = {**CLOSED_FORM_SENSORS, "robot.kinematics": kinematics}
    episode = run_episode(POLICY, "ring", settings, clearance=0.5, turn=turn, approach=approach)
    assert episode.verdict == "unreachable"
    assert episode.length == pytest.approx(RING.first + 2.0 * RING.lap, rel=0.1)


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_lap_begins_at_the_wall_and_not_where_the_field_was_left(kinematics: str) -> None:
    """With its own, small clearance the way into the wall following passes no place of the lap."""
    episode = run_episode(POLICY, "ring", {"robot.kinematics": kinematics})
    assert episode.verdict == "unreachable"
    assert episode.length < 1.1 * (RING.first + 2.0 * RING.lap)


@pytest.mark.parametrize("approach", ["field", "straight"])
@pytest.mark.parametrize("lean", [2.0, -2.0])
def test_met_head_on_a_wall_is_followed_where_it_leads_on_toward_the_target(lean: float, approach: str) -> None:
    """Its upper end leans away from the robot or toward it: the way along it goes on to the left or to the right."""
    wall = [[6.0 - lean, -6.0], [6.4 - lean, -6.0], [6.4 + lean, 6.0], [6.0 + lean, 6.0]]
    world = {
        "family": "explicit",
        "bounds": [-10, -15, 30, 15],
        "start": [0, 0, 0],
        "goal": [16, 0],
        "polygons": [wall],
    }
    settings = {"lidar.beams": 360, "lidar.range": 10.0}
    episode = run_episode(POLICY, {"world": world}, settings, approach=approach, clearance=0.5)
    assert episode.outcome == "success"
    assert all(side == (1 if lean > 0.0 else -1) for side in episode.memory.hit_sides)
    # The field may slide past the end by itself; straight until contact the wall must be followed.
    assert episode.memory.hit_sides or approach == "field"


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("approach", ["field", "straight"])
def test_shut_in_itself_it_says_so_after_a_lap_and_one_with_a_closer_hand(turn: str, approach: str) -> None:
    settings = {**CLOSED_FORM_SENSORS, "world": RING_ROUND_THE_START}
    episode = run_episode(POLICY, "ring", settings, clearance=0.5, turn=turn, approach=approach)
    assert episode.verdict == "unreachable"
    assert episode.length == pytest.approx(RING.first_inside + 2.0 * RING.lap_inside, rel=0.15)


def before_a_wall(x: float) -> tuple[Any, View, Any]:
    """A policy, what it sees from (x, 0) of a wall at 5 m across the way to the goal, and its memory."""
    scenario = long_wall()
    scenario["world"] |= {"start": [x, 0, 0], "goal": [15, 0]}
    simulation = Simulation(scenario)
    policy: Any = make_policy(POLICY, simulation, clearance=0.5)
    return policy, View(simulation.reset(seeds=[0])[0, 0], policy.sensors), policy.start()


QUARTER = 0.5 * math.pi
BACK: dict[str, Any] = {"inner": QUARTER, "first": QUARTER, "unwrapped": QUARTER}
"""As far turned to the wall as the target lay to that side, and by the angle that follows the target not facing it."""
ON: dict[str, Any] = {"first": QUARTER, "unwrapped": 0.0}
"""The other way round."""
TOWARD: dict[str, dict[str, Any]] = {"nearer": {"first_target": 0.0}, "farther": {"first_target": math.pi}}
"""The direction of the target at the entry, of a robot that has gone along x since, where the target is now."""


@pytest.mark.parametrize(
    ("angles", "toward", "has_moved", "leaves"),
    [
        (BACK, "nearer", False, True),
        (BACK, "nearer", True, False),
        (ON, "nearer", False, False),
        (ON, "nearer", True, True),
        (BACK, "farther", False, False),
        (ON, "farther", True, True),
    ],
)
def test_after_a_target_that_moved_the_angle_that_followed_it_counts_and_progress_to_where_it_is(
    angles: dict[str, Any], toward: str, has_moved: bool, leaves: bool
) -> None:
    policy, view, memory = before_a_wall(1.0)
    memory.has_target_moved = has_moved
    one = turning(is_aligned=True, place=(-1.0, 0.0))
    for name, value in {**angles, **TOWARD[toward]}.items():
        setattr(one, name, value)
    contour = policy.boundary.lay_hand(view, 1, 0.0)
    assert policy._may_leave(view, memory, contour, one) == leaves


@pytest.mark.parametrize("degrees", [180.0, 190.0])
@pytest.mark.parametrize("seed", [2, 5])
def test_a_lap_whose_corners_are_out_of_sight_proves_nothing(seed: int, degrees: float) -> None:
    """All these rooms have a way to the goal; past corners just passed the hand went by their doors."""
    overrides = {"robot.kinematics": "differential", "lidar.beams": 360, "time.limit": 400.0}
    episode = run_episode(POLICY, "rooms", {**overrides, "lidar.fov": math.radians(degrees)}, seed=seed)
    assert episode.outcome == "success" or episode.verdict in ("", "looping")


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize(("turns", "verdict"), [(4.9, ""), (5.1, "looping")])
def test_who_has_turned_five_times_along_one_wall_and_passed_no_gate_again_goes_in_circles(
    turns: float, verdict: str, side: int
) -> None:
    policy, view, memory = before_a_wall(4.5)
    contour = policy.boundary.lay_hand(view, 1, 0.0)
    policy._watch(view, memory, contour, turning(total=side * turns * 2.0 * math.pi))
    assert memory.verdict == verdict and memory.mode == "potential_field"


@pytest.mark.parametrize(
    ("x", "away", "why", "waits"),
    [(0.0, 0.9, "force", True), (0.0, 1.1, "force", False), (0.0, 0.9, "swing", False), (4.75, 0.9, "away", False)],
    ids=["just left", "farther on", "for long", "blocked at once"],
)
def test_who_has_just_left_a_wall_takes_nothing_for_a_minimum_within_two_clearances(
    x: float, away: float, why: str, waits: bool
) -> None:
    """The forces of that wall still hold it; but for what blocks the way at once, or holds it for three seconds."""
    policy, view, memory = before_a_wall(x)
    assert not policy._has_just_left(view, memory)
    memory.leaves, memory.minimum.why = [view.to_odometry(-away, 0.0)], why
    assert policy._has_just_left(view, memory) == waits


# ---------------------------------------------------------------------------------------------- drift and movers


@pytest.mark.parametrize("bias", [-1.0, 1.0])
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_gyroscope_that_drifts_by_half_a_degree_a_second_is_survived(bias: float, kinematics: str) -> None:
    """At the 1 m/s of the robot as many degrees a metre; the goal is a beacon."""
    drift: dict[str, Any] = {"odometry.rotation_bias": math.radians(bias * 0.5), "odometry.rotation_noise": 0.01}
    drift |= {"odometry.translation_noise": 0.05, "goal.sensing": "beacon", "robot.kinematics": kinematics}
    for seed in range(2):
        assert run_episode(POLICY, canonical_world("u_trap"), drift, seed=seed, clearance=0.5).outcome == "success"


def target_world(points: list[list[float]], speed: float, *, stop: bool) -> dict[str, Any]:
    """The U with a target behind it that goes along way points."""
    scenario = canonical_world("u_trap")
    del scenario["world"]["goal"]
    motion = {"law": "waypoints", "points": points, "speed": speed, "stop": stop}
    scenario["world"] |= {"target": {"at": points[0], "motion": motion}}
    return scenario


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("up", [5.0, -5.0])
def test_a_target_that_goes_ten_seconds_and_stops_is_reached(kinematics: str, up: float) -> None:
    scenario = target_world([[20.0, 0.0], [20.0, up]], 0.5, stop=True)
    episode = run_episode(POLICY, scenario, {"robot.kinematics": kinematics, "robot.max_speed": 0.5})
    assert (episode.outcome, episode.verdict) == ("success", "")


@pytest.mark.parametrize(("turn", "up"), [("right", 9.0), ("left", -9.0)])
def test_a_wall_is_left_where_a_target_that_moved_is_faced_and_not_where_it_was(turn: str, up: float) -> None:
    """It goes across behind the U all the while, away from the side that is walked."""
    scenario = target_world([[14.0, 0.0], [14.0, up]], 0.15, stop=True)
    turning: Any = None
    for memory, _ in decisions(scenario, {"robot.max_speed": 0.5}, turn=turn, clearance=0.5):
        if turning is not None and memory.turning is None:
            break
        turning = memory.turning
    assert abs(math.degrees(turning.unwrapped)) < 10.0
    assert abs(math.degrees(turning.target - turning.first_target)) > 30.0


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_target_that_goes_on_is_reached(kinematics: str) -> None:
    scenario = target_world([[20.0, 0.0], [20.0, 9.0], [20.0, -9.0]], 0.3, stop=False)
    episode = run_episode(POLICY, scenario, {"robot.kinematics": kinematics})
    assert (episode.outcome, episode.verdict) == ("success", "")


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_disc_across_the_way_is_avoided_in_the_field_and_the_u_by_one_wall(kinematics: str) -> None:
    """As in the paper's Fig. 12b, robot and obstacle at 0.3 m/s: one wall is followed, and it is that of the U."""
    motion = {"law": "waypoints", "points": [[2.5, -3.0], [2.5, 3.0]], "speed": 0.3, "stop": True}
    world = {"family": "explicit", "bounds": [-15, -15, 35, 15], "start": [0, 0, 0], "goal": [20, 0]}
    world |= {"polygons": [CANONICAL_POLYGONS["u_trap"]]}
    world |= {"movers": [{"shape": {"circle": 0.4}, "at": [2.5, -3.0], "motion": motion}]}
    settings = {"robot.kinematics": kinematics, "robot.max_speed": 0.3, "lidar.beams": 180, "time.limit": 400.0}
    episode = run_episode(POLICY, {"world": world}, settings)
    ((x, y),) = episode.memory.hits
    assert episode.outcome == "success" and 5.0 < x < 11.0 and abs(y) < 3.0


# ---------------------------------------------------------------------------------------------- bad input

BAD: list[tuple[dict[str, Any], str]] = [
    ({"alpha": 30.0}, "alpha must lie between 45 and 135 degrees .*got 30.0"),
    ({"alpha": 136.0}, "alpha must lie between 45 and 135"),
    ({"alpha_gain": -1.0}, "alpha_gain must be 0 or above, got -1.0"),
    ({"turn": "up"}, "turn must be one of"),
    ({"leave": "now"}, "leave must be one of"),
]


@pytest.mark.parametrize(("parameters", "message"), BAD)
def test_bad_parameters_are_refused_in_one_line(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        make_policy(POLICY, Simulation("static"), **parameters)
    assert "\n" not in str(caught.value)


def test_a_scanner_that_does_not_see_beside_the_robot_is_refused() -> None:
    simulation = Simulation("static", overrides={"lidar.fov": math.radians(120.0)})
    with pytest.raises(ValueError, match="field of view of at least 180 degrees, the scanner has 120: set lidar.fov"):
        make_policy(POLICY, simulation)
    make_policy(POLICY, Simulation("static", overrides={"lidar.fov": math.pi}))


def test_what_is_told_of_a_scanner_is_not_rounded_to_what_would_do() -> None:
    with pytest.raises(ValueError, match="the scanner has 179.9: set lidar.fov"):
        make_policy(POLICY, Simulation("static", overrides={"lidar.fov": math.radians(179.9)}))
    with pytest.raises(ValueError, match="expected at least 8 lidar.beams"):
        make_policy(POLICY, Simulation("static", overrides={"lidar.beams": 1}))
