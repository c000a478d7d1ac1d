"""The dynamic window approach: circles, what can be stopped from, and where it gets."""

from __future__ import annotations

import itertools
import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from episodes import run_episode

from bug_gym.agents import make_policy
from bug_gym.agents.local import dwa
from bug_gym.agents.local.dwa import DWA, DWAMemory, smoothed
from bug_gym.agents.local.windows import Window, arc_distance, weigh_window
from bug_gym.compiling import kernel
from bug_gym.geometry import F64
from bug_gym.kernels.layout import Floats
from bug_gym.simulation import Simulation
from bug_gym.view import View

BOX = {"family": "explicit", "bounds": [-6, -6, 14, 6], "start": [0, 0, 0]}


@kernel
def distance_on_arc(px: Floats, py: Floats, speed: float, rate: float, radius: float, look: float) -> float:
    """`arc_distance`, which only kernels call."""
    return arc_distance(px, py, speed, rate, radius, look)


def stepped_distance(points: F64, speed: float, rate: float, radius: float, look: float) -> float:
    """The same by small steps."""
    lap = 2.0 * math.pi * speed / abs(rate) if rate else math.inf
    for way in np.arange(0.0, min(look, lap), 1e-3):
        turned = rate * way / speed
        x, y = (way, 0.0) if rate == 0.0 else (speed / rate * math.sin(turned), speed / rate * (1 - math.cos(turned)))
        if (np.hypot(points[:, 0] - x, points[:, 1] - y) < radius).any():
            return float(way)
    return min(look, lap)


@pytest.mark.parametrize("seed", range(40))
def test_the_way_along_a_circle_is_that_of_small_steps(seed: int) -> None:
    generator = np.random.default_rng(seed)
    away, angle = generator.uniform(0.35, 3.0, 4), generator.uniform(-np.pi, np.pi, 4)
    points = np.stack([away * np.cos(angle), away * np.sin(angle)], axis=1)
    speed, rate = float(generator.uniform(0.1, 1.0)), float(generator.choice([0.0, *generator.uniform(-2.0, 2.0, 5)]))
    found = distance_on_arc(points[:, 0].copy(), points[:, 1].copy(), speed, rate, 0.3, 4.0)
    assert found == pytest.approx(stepped_distance(points, speed, rate, 0.3, 4.0), abs=5e-3)


@pytest.mark.parametrize("rate", [-1.5, 0.7])
def test_what_the_disc_overlaps_is_in_the_way_only_ahead_of_it(rate: float) -> None:
    """Else a robot that has come too near to something could not drive away from it."""
    far = np.array([[1.5, 0.1], [1.2, -0.8]])
    free = distance_on_arc(far[:, 0].copy(), far[:, 1].copy(), 0.5, rate, 0.3, 4.0)
    assert free > 0.0
    for x, y in ((0.2, 0.1), (0.05, -0.25), (0.29, 0.0)):
        for ahead in (True, False):
            px, py = np.append(far[:, 0], x if ahead else -x), np.append(far[:, 1], y)
            assert distance_on_arc(px, py, 0.5, rate, 0.3, 4.0) == (0.0 if ahead else free)


def test_smoothing_leaves_out_what_is_no_velocity() -> None:
    scores = np.array([[1.0, 2.0, 3.0], [4.0, -np.inf, 6.0]])
    found = smoothed(scores, is_round=False)
    assert found[0, 0] == pytest.approx((1 + 2 + 4) / 3) and found[1, 1] == -np.inf
    assert found[0, 1] == pytest.approx((1 + 2 + 3 + 4 + 6) / 5)
    assert smoothed(scores, is_round=True)[0, 0] == pytest.approx((1 + 2 + 3 + 4 + 6) / 5)


def test_the_robot_is_told_the_speed_and_the_turn_rate_that_were_chosen() -> None:
    simulation = Simulation({"world": {**BOX, "goal": [3, 4]}}, overrides={"robot.kinematics": "differential"})
    policy = make_policy("dwa", simulation)
    assert isinstance(policy, DWA)
    observation, state = simulation.reset(seeds=[0]), None
    for _ in range(30):
        action, state = policy.predict(observation[0, 0], state)
        memory = state[0]
        assert isinstance(memory, DWAMemory)
        speed, rate = memory.velocity
        drive = policy.sensors.drive
        span = drive.max_speed + drive.max_reverse
        assert 0.5 * (action[0] + 1.0) * span - drive.max_reverse == pytest.approx(speed, abs=1e-5)
        assert action[1] * drive.max_turn_rate == pytest.approx(rate, abs=1e-5)
        observation = simulation.step(action[None, None]).observation


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("acceleration", [None, 0.5])
def test_it_never_drives_into_what_stands(kinematics: str, acceleration: float | None) -> None:
    overrides: dict[str, Any] = {"robot.kinematics": kinematics, "robot.max_acceleration": acceleration}
    wall = {**BOX, "goal": [11, 0.3], "polygons": [[[4, -5], [4.5, -5], [4.5, 5], [4, 5]]]}
    episode = run_episode("dwa", {"world": wall, "lidar": {"beams": 180}}, overrides, max_steps=250)
    assert episode.outcome != "collision" and episode.min_clearance > 0.0
    reached = [run_episode("dwa", "static", overrides, seed=seed, max_steps=900).outcome for seed in range(4)]
    assert "collision" not in reached and reached.count("success") >= 2


def driven_ahead(world: dict[str, Any], overrides: dict[str, Any], steps: int) -> tuple[Simulation, F64]:
    """A world after so many steps straight ahead at full speed, and what is observed then (D,)."""
    simulation = Simulation(world, overrides=overrides)
    observation = simulation.reset(seeds=[0])
    ahead = np.array([[[1.0, 0.0]]], dtype=np.float32)
    for _ in range(steps):
        observation = simulation.step(ahead).observation
    return simulation, observation[0, 0]


@pytest.mark.parametrize("kinematics", ["holonomic", "differential", "ackermann"])
@pytest.mark.parametrize("away", [0.03, 0.06, 0.09])
def test_a_goal_nearer_than_a_step_is_not_driven_past(kinematics: str, away: float) -> None:
    """Else a differential robot comes round it again and again, until time is up."""
    scenario = {"world": {**BOX, "goal": [away, 0]}, "goal": {"radius": 0.01}, "robot": {"kinematics": kinematics}}
    simulation = Simulation(scenario)
    policy: Any = make_policy("dwa", simulation)
    _, (memory,) = policy.predict(simulation.reset(seeds=[0])[0, 0])
    assert 0.0 < memory.velocity[0] * policy.sensors.drive.step <= away + 1e-6


@pytest.mark.parametrize("goal", [(3.0, 0.2), (2.0, -0.5), (1.0, 0.01)])
@pytest.mark.parametrize("kinematics", ["holonomic", "differential", "ackermann"])
def test_a_window_holds_what_leads_to_the_goal(kinematics: str, goal: tuple[float, float]) -> None:
    """Not only directions, turn rates and curvatures that are evenly spread."""
    policy: Any = make_policy("dwa", Simulation("static", overrides={"robot.kinematics": kinematics}))
    bearing, distance = math.atan2(goal[1], goal[0]), math.hypot(*goal)
    view: Any = SimpleNamespace(own_velocity=(0.5, 0.0), goal=goal, goal_bearing=bearing, goal_distance=distance)
    _, seconds = policy._reachable(view)
    if kinematics == "ackermann":  # on its circle: as far from the centre, (0, 1 / curvature), as the robot is
        off = [abs(math.hypot(goal[0], goal[1] - 1.0 / bend) - 1.0 / abs(bend)) for bend in seconds if abs(bend) > 1e-9]
    elif kinematics == "differential":  # the heading error that it is steered with
        off = [abs(rate / policy.gain - bearing) for rate in seconds]
    else:
        off = [abs(direction - bearing) for direction in seconds]
    assert min(off) < 1e-9
    assert kinematics == "holonomic" or (np.diff(seconds) > 0.0).all()


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("goal", [[2.5, 5.0], [2.5, -5.0], [11.0, 1.0], [-5.0, 1.0]])
@pytest.mark.parametrize("steps", [3, 12, 25])
def test_the_window_holds_the_speeds_that_can_be_reached_in_a_decision(
    kinematics: str, goal: list[float], steps: int
) -> None:
    overrides = {"robot.kinematics": kinematics, "robot.max_acceleration": 0.5}
    simulation, observation = driven_ahead({"world": {**BOX, "goal": goal}}, overrides, steps)
    policy: Any = make_policy("dwa", simulation)
    _, (memory,) = policy.predict(observation)
    drive = policy.sensors.drive
    own, change = float(simulation.world.velocity[0, 0, 0]), 0.5 * drive.step
    assert own == pytest.approx(min(steps * change, drive.max_speed), abs=1e-6)
    speed = memory.velocity[0]
    assert max(own - change, 0.0) - 1e-6 <= speed <= min(own + change, drive.max_speed) + 1e-6
    assert speed > 0.0


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_a_free_goal_is_driven_to_straight_and_as_fast_as_the_robot_may(kinematics: str) -> None:
    overrides: dict[str, Any] = {"robot.kinematics": kinematics, "robot.max_acceleration": 0.5}
    episode = run_episode("dwa", {"world": {**BOX, "goal": [12, 0]}}, overrides)
    assert episode.outcome == "success" and np.abs(episode.path[:, 1]).max() < 1e-6
    step = episode.simulation.scenario.time.step
    speeds = np.diff(episode.path[:, 0]) / step
    most = episode.simulation.scenario.robot.max_speed
    expected = np.minimum(0.5 * step * np.arange(1, len(speeds) + 1), most)
    # Nearer to it, circles beside the straight way look less and less at it, so their mean is worth less at full speed.
    far = episode.path[:-1, 0] < 12.0 - 3.0
    assert speeds[far] == pytest.approx(expected[far], abs=1e-4) and far.sum() > 90


def way_to_line(x: float, heading: float, velocity: tuple[float, float], *, is_holonomic: bool) -> float:
    """How far a place at x drives at a velocity until x is 4 - 0.2, by small steps; 3 where it does not within 3 m."""
    speed, second = velocity
    ways = np.arange(0.0, 3.0, 1e-3)
    turned = np.full_like(ways, heading + second) if is_holonomic else heading + second * ways / max(speed, 1e-9)
    met = x + np.cumsum(1e-3 * np.cos(turned)) >= 4.0 - 0.2
    return float(ways[met.argmax()]) if met.any() else 3.0


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("goal", [[11.0, 0.0], [11.0, 2.5]])
def test_before_a_wall_no_speed_is_above_the_root_of_twice_the_free_way_times_the_brake(
    kinematics: str, goal: list[float]
) -> None:
    overrides = {"robot.kinematics": kinematics, "robot.max_acceleration": 0.5}
    wall = {**BOX, "goal": goal, "polygons": [[[4, -5], [4.5, -5], [4.5, 5], [4, 5]]]}
    simulation = Simulation({"world": wall, "lidar": {"beams": 180}}, overrides=overrides)
    policy: Any = make_policy("dwa", simulation)
    observation, state = simulation.reset(seeds=[0]), None
    assert policy.sensors.radius == 0.2
    chosen = []
    for _ in range(120):
        x, _, heading = simulation.world.pose[0, 0].tolist()
        action, state = policy.predict(observation[0, 0], state)
        speed, second = state[0].velocity
        free = way_to_line(x, heading, (speed, second), is_holonomic=kinematics == "holonomic")
        assert speed <= math.sqrt(2.0 * free * 0.5)
        chosen.append(speed)
        observation = simulation.step(action[None, None]).observation
    assert max(chosen) > 0.9 * policy.sensors.drive.max_speed and chosen[-1] < 0.2  # it came on, and braked


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_who_stands_near_an_obstacle_begins_to_drive_however_little_speed_a_decision_gives(kinematics: str) -> None:
    world = {"world": {**BOX, "goal": [11, 0], "circles": [[2.0, 0.6, 0.5]]}, "lidar": {"beams": 180}}
    overrides = {"robot.kinematics": kinematics, "robot.max_acceleration": 0.3}
    assert run_episode("dwa", world, overrides, max_steps=400).outcome == "success"


@pytest.mark.parametrize(("step", "acceleration"), [(0.02, 0.3), (0.02, 1.0), (0.05, 0.5), (0.1, 0.1), (0.1, 0.3)])
@pytest.mark.parametrize("heading", [0.0, 2.5])
def test_in_the_open_a_robot_that_turns_begins_however_weak_its_drive_is(
    step: float, acceleration: float, heading: float
) -> None:
    """Circles at little speed are short: it had turned toward its goal, and stood there until time was up."""
    world = {"family": "empty", "start": [0, 0, heading], "goal": [1, 2]}
    scenario = {"world": world, "time": {"step": step}, "robot": {"kinematics": "differential"}}
    episode = run_episode("dwa", scenario, {"robot.max_acceleration": acceleration})
    assert episode.outcome == "success"
    assert episode.length <= math.hypot(1.0, 2.0)


@pytest.mark.parametrize("latency", [0.0, 0.3])
@pytest.mark.parametrize("goal", [(0.2, 0.45), (0.2, -0.45), (-0.1, 0.7)])
def test_a_goal_within_the_circle_that_it_drives_is_reached(goal: tuple[float, float], latency: float) -> None:
    """It had gone round it at full speed until time was up; now it does so once."""
    robot = {"kinematics": "differential", "latency": latency}
    scenario = {"world": {"family": "empty", "start": [0, 0, 0], "goal": list(goal)}, "robot": robot}
    episode = run_episode("dwa", scenario)
    assert episode.outcome == "success"
    turned = np.abs(np.diff(np.unwrap(episode.path[:, 2]))).sum()
    assert turned <= 2.0 * math.pi + 2.0 * math.pi  # once round, and to the goal


def test_who_turned_to_either_side_or_passed_the_goal_has_not_gone_round_it() -> None:
    policy: Any = make_policy("dwa", Simulation("static", overrides={"robot.kinematics": "differential"}))

    def gone(round_before: float, heading: float, aside: float) -> float:
        view: Any = SimpleNamespace(heading=heading, goal=(1.0, aside), goal_bearing=math.atan2(aside, 1.0))
        return float(policy._gone_round(view, DWAMemory(round=round_before)))

    for side in (1.0, -1.0):
        assert gone(3.0 * side, 0.1 * side, 0.5 * side) == pytest.approx(3.1 * side)
        assert gone(3.0 * side, 0.0, 0.5 * side) == 3.0 * side
        assert gone(3.0 * side, -0.1 * side, 0.5 * side) == 0.0  # turns the other way
        assert gone(3.0 * side, 0.1 * side, -0.5 * side) == 0.0  # the goal is on the other side
        assert gone(6.3 * side, 0.1 * side, 0.5 * side) == 6.3 * side  # once round: it is to face the goal
        assert gone(6.3 * side, 0.1 * side, 0.05 * side) == 0.0  # it does


def test_who_faces_a_wall_that_it_cannot_drive_up_to_does_not_begin() -> None:
    wall = [[0.32, -5], [1, -5], [1, 5], [0.32, 5]]
    scenario = {"world": {**BOX, "goal": [11, 0], "polygons": [wall]}, "robot": {"kinematics": "differential"}}
    episode = run_episode("dwa", scenario, {"robot.max_acceleration": 0.3}, max_steps=100)
    assert episode.outcome == "running" and episode.min_clearance > 0.0


def test_each_weight_works() -> None:
    discs = [[3.0, 0.4, 0.5], [5.5, -1.2, 0.8], [8.0, 0.9, 0.6]]
    world = {"world": {**BOX, "goal": [11, 0], "circles": discs}, "lidar": {"beams": 180}}
    plain = run_episode("dwa", world, {"robot.kinematics": "differential"}, max_steps=300)
    changes: list[dict[str, Any]] = [
        {"heading_weight": 0.1},
        {"distance_weight": 8.0},
        {"speed_weight": 8.0},
        {"look": 0.6},
    ]
    for change in changes:
        other = run_episode("dwa", world, {"robot.kinematics": "differential"}, max_steps=300, **change)
        assert other.path.shape != plain.path.shape or not np.allclose(other.path, plain.path), change
    assert plain.outcome == "success" and plain.length <= 12.5


def side_of_the_turn(left: list[float], right: list[float], goal: tuple[float, float]) -> int:
    """Where a robot turns that has these free ways [m], the first straight ahead, the others 10 degrees farther round each."""

    def free_distances(bearings: F64, _radius: float) -> F64:
        return np.array([(left if b >= 0.0 else right)[round(abs(b) / math.radians(10.0))] for b in bearings])

    policy: Any = make_policy("dwa", "static", look=3.0)
    view: Any = SimpleNamespace(goal=goal, goal_distance=math.hypot(*goal), free_distances=free_distances)
    return int(policy._freer_side(view))


NOWHERE = [0.1] * 16
NEAR, FAR = [*[0.1] * 4, 3.5, *[0.1] * 11], [*[0.1] * 9, *[6.0] * 7]
"""Room for a look 40 degrees round, and more of it 90 degrees round."""
SHORT, LESS = [*[0.1] * 9, *[2.0] * 7], [0.1, *[1.5] * 15]
"""Room for none, and for less."""


def test_the_side_of_a_turn_is_kept_until_a_velocity_gets_on() -> None:
    policy: Any = make_policy("dwa", Simulation("static", overrides={"robot.kinematics": "differential"}))
    view: Any = SimpleNamespace(goal=(8.0, -1.0), goal_distance=8.1, free_distances=lambda turns, _: 0.1 + 0.0 * turns)
    speeds, none = np.array([0.0, 0.5, 1.0]), np.full((3, 5), -math.inf)
    for kept, side in ((0, -1), (1, 1), (-1, -1)):  # the goal's where there was none yet
        memory = DWAMemory(side=kept)
        assert policy._is_stuck(view, memory, speeds, none) and memory.side == side
    some = none.copy()
    some[2, 1] = 0.3
    assert not policy._is_stuck(view, DWAMemory(side=1), speeds, some)
    # Who comes to next to no speed in a decision has nothing yet to be stuck with.
    assert not policy._is_stuck(view, DWAMemory(), 0.01 * speeds, none)


def test_before_the_end_of_a_trap_it_turns_on_instead_of_to_and_fro() -> None:
    """What it would rather do than turn on is stand, looking at the goal: it had gone to and fro between the two."""
    episode = run_episode("dwa", "u_trap", {"robot.kinematics": "differential"}, max_steps=600)
    turned = np.diff(np.unwrap(episode.path[:, 2]))
    back = np.sign(turned[1:]) * np.sign(turned[:-1]) < 0
    stands = np.hypot(*np.diff(episode.path[:, :2], axis=0).T) < 0.005
    assert (back & stands[1:] & stands[:-1]).sum() <= 10


@pytest.mark.parametrize("kinematics", ["differential", "ackermann"])
def test_who_gets_on_forgets_which_way_it_turned(kinematics: str) -> None:
    simulation = Simulation({"world": {**BOX, "goal": [11, 0]}}, overrides={"robot.kinematics": kinematics})
    policy: Any = make_policy("dwa", simulation)
    memory = DWAMemory(mode="turning", side=-1)
    policy.act(View(simulation.reset(seeds=[0])[0, 0], policy.sensors), memory)
    assert (memory.mode, memory.side) == ("driving", 0)


@pytest.mark.parametrize(("room", "side", "turns"), [(0.5, 0, False), (0.5, 1, True), (0.5, -1, True), (4.0, 1, False)])
def test_a_turn_of_several_moves_is_not_broken_off_for_an_arc_that_soon_ends(
    room: float, side: int, turns: bool
) -> None:
    """Shorter than twice the radius of the sharpest arc, it leads to the next such turn."""
    wall = [[0.2 + room, -3], [3.0 + room, -3], [3.0 + room, 3], [0.2 + room, 3]]
    described = {"world": {**BOX, "polygons": [wall], "goal": [11, 0]}, "lidar": {"beams": 180}}
    simulation = Simulation(described, overrides={"robot.kinematics": "ackermann"})
    policy: Any = make_policy("dwa", simulation)
    assert 0.5 < 2.0 * policy.sensors.drive.least_bend < 4.0
    view, memory = View(simulation.reset(seeds=[0])[0, 0], policy.sensors), DWAMemory(side=side)
    toward = policy._steered(view, memory, np.array([0.0, 0.3]), np.zeros((2, 1)), (0.3, 0.0))
    assert (memory.mode == "turning", memory.is_free) == (turns, not turns)
    assert not turns or math.atan2(toward[1], toward[0]) == pytest.approx(side * 0.5 * math.pi)


@pytest.mark.parametrize("turn", range(0, 36, 5))
def test_the_first_and_the_last_direction_lie_beside_one_another(turn: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whichever direction is counted first, the same one is chosen."""
    table = np.random.default_rng(4).uniform(0.0, 1.0, (9, 36))
    monkeypatch.setattr(dwa, "weigh_window", lambda *told: np.copyto(told[-1], np.roll(table, turn, axis=1)))
    simulation = Simulation({"world": {**BOX, "goal": [11, 0]}}, overrides={"robot.kinematics": "holonomic"})
    policy: Any = make_policy("dwa", simulation)
    _, (memory,) = policy.predict(simulation.reset(seeds=[0])[0, 0])
    around = np.stack([np.roll(np.pad(table, ((1, 1), (0, 0))), by, axis=1) for by in (-1, 0, 1)])
    sums = (around[:, :9] + around[:, 1:10] + around[:, 2:]).sum(axis=0)
    counts = 3.0 * np.array([2, *[3] * 7, 2])
    best = int((sums / counts[:, None]).argmax())
    assert round(memory.velocity[1] / math.radians(10.0)) % 36 == (best + turn) % 36


def test_no_way_counts_as_free_beyond_the_scan() -> None:
    for scan, look in ((1.5, 1.5), (9.0, 3.0)):
        policy: Any = make_policy("dwa", Simulation("static", overrides={"lidar.range": scan}), look=3.0)
        assert policy.window.look == look


@pytest.mark.parametrize("mirror", [1, -1])
@pytest.mark.parametrize("goal", [(8.0, 2.0), (8.0, -2.0)])
@pytest.mark.parametrize(("more", "less"), [(NEAR, FAR), (NEAR, NOWHERE), (FAR, SHORT), (SHORT, LESS), (LESS, NOWHERE)])
def test_it_turns_to_the_nearest_bearing_with_room_for_a_look_else_to_the_most_room(
    more: list[float], less: list[float], goal: tuple[float, float], mirror: int
) -> None:
    ways = (more, less) if mirror > 0 else (less, more)
    assert side_of_the_turn(*ways, goal) == mirror


@pytest.mark.parametrize("ways", [NEAR, FAR, SHORT, NOWHERE])
def test_as_far_round_on_both_sides_it_turns_to_the_goals(ways: list[float]) -> None:
    for goal, side in (((4.0, 1.0), 1), ((4.0, -1.0), -1), ((-4.0, 1.0), 1), ((-4.0, -1.0), -1), ((4.0, 0.0), 1)):
        assert side_of_the_turn(ways, ways, goal) == side
        longer = [*ways[:-1], ways[-1] + 2.0]  # more than a look is no better than it, if one is there
        assert side_of_the_turn(ways, longer, goal) == (side if max(ways) >= 3.0 else -1)


def test_as_far_as_the_goal_is_room_enough() -> None:
    assert [side_of_the_turn(LESS, FAR, (x, -0.1)) for x in (1.0, 1.4, 2.0)] == [1, 1, -1]


@pytest.mark.parametrize("kinematics", ["differential", "ackermann"])
def test_a_mirrored_world_is_driven_through_as_its_mirror_image(kinematics: str) -> None:
    overrides = {"robot.kinematics": kinematics}
    paths = []
    for mirror in (1.0, -1.0):
        wall = [[4.0, -2.0 * mirror], [4.5, -2.0 * mirror], [4.5, 2.0 * mirror], [4.0, 2.0 * mirror]]
        world = {**BOX, "goal": [11, 0.5 * mirror], "polygons": [wall]}
        episode = run_episode("dwa", {"world": world, "lidar": {"beams": 180}}, overrides, max_steps=150)
        paths.append(episode.path[:, :2] * [1.0, mirror])
    assert paths[0][:, 0].max() > 3.0 and np.ptp(paths[0][:, 1]) > 0.1
    np.testing.assert_allclose(paths[0], paths[1], atol=1e-4)


def a_window(**weights: float) -> Window:
    """A window in which only the weights told count."""
    none: dict[str, Any] = {"heading_weight": 0.0, "distance_weight": 0.0, "speed_weight": 0.0}
    limits: dict[str, Any] = {
        "radius": 0.2,
        "max_speed": 1.0,
        "step": 0.1,
        "acceleration": 0.5,
        "turn_rate": 2.0,
        "gain": 1e9,
    }
    return Window(**limits, look=3.0, **{**none, **weights}, is_holonomic=False)


def scores_of(window: Window, speeds: F64, rates: F64, points: F64, goal: tuple[float, float]) -> F64:
    """What the velocities of a window are worth (v, w)."""
    scores = np.empty((len(speeds), len(rates)))
    weigh_window(window, speeds, rates, points[:, 0].copy(), points[:, 1].copy(), *goal, scores)
    return scores


def test_the_heading_is_that_to_the_goal_where_it_comes_to_stand_if_it_brakes_after_the_decision() -> None:
    window, goal = a_window(heading_weight=1.0), (2.0, 1.5)
    speeds, rates = np.array([0.2, 0.6, 1.0]), np.array([-1.5, -0.4, 0.0, 0.7, 2.0])
    found = scores_of(window, speeds, rates, np.zeros((0, 2)), goal)
    for (i, speed), (j, rate) in itertools.product(enumerate(speeds.tolist()), enumerate(rates.tolist())):
        x = y = heading = time = 0.0
        left, tick = speed, 1e-4
        while left > 0.0:  # along its circle, at first as it is, then ever slower
            x, y = x + tick * left * math.cos(heading), y + tick * left * math.sin(heading)
            heading += tick * left * rate / speed
            time += tick
            left = speed if time < window.step else speed - window.acceleration * (time - window.step)
        error = (math.atan2(goal[1] - y, goal[0] - x) - heading + math.pi) % (2.0 * math.pi) - math.pi
        assert found[i, j] == pytest.approx(1.0 - abs(error) / math.pi, abs=1e-3)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_admissible_can_be_stopped_on_the_free_part_of_its_circle(seed: int) -> None:
    generator = np.random.default_rng(seed)
    away, angle = generator.uniform(0.3, 1.5, 12), generator.uniform(-np.pi, np.pi, 12)
    points = np.stack([away * np.cos(angle), away * np.sin(angle)], axis=1)
    window = a_window(distance_weight=1.0, speed_weight=1.0)
    speeds, rates = np.linspace(0.1, 1.0, 7), np.linspace(-2.0, 2.0, 9)
    found = scores_of(window, speeds, rates, points, (50.0, 0.0))
    for (i, speed), (j, rate) in itertools.product(enumerate(speeds.tolist()), enumerate(rates.tolist())):
        free = distance_on_arc(points[:, 0].copy(), points[:, 1].copy(), speed, rate, window.radius, window.look)
        if math.isfinite(found[i, j]):
            assert speed <= math.sqrt(2.0 * free * window.acceleration)
            assert found[i, j] == pytest.approx(free / window.look + speed / window.max_speed)
        else:
            assert speed * window.step + speed**2 / (2.0 * window.acceleration) > free


def test_what_lies_behind_the_goal_takes_nothing_from_a_free_way() -> None:
    wall = np.array([[2.0, 0.1 * number] for number in range(-30, 31)])
    window = a_window(distance_weight=1.0)
    for goal, worth in ((1.0, 1.0), (1.79, 1.0), (1.81, 1.8 / 3.0), (50.0, 1.8 / 3.0)):
        found = scores_of(window, np.array([0.4]), np.array([0.0]), wall, (goal, 0.0))
        assert found[0, 0] == pytest.approx(worth)


def test_standing_is_worth_the_way_along_the_heading_that_it_has_then() -> None:
    """So that it is no more than creeping on is: as the speed falls to 0, the worth goes over into that of standing."""
    points = np.array([[1.2, 0.0]])
    window = a_window(distance_weight=1.0, speed_weight=1.0)
    found = scores_of(window, np.array([0.0, 1e-9]), np.array([-2.0, 0.0, 2.0]), points, (50.0, 0.0))
    assert found[0, 1] == pytest.approx((1.2 - window.radius) / window.look) and found[1, 1] == pytest.approx(
        found[0, 1]
    )
    # Turned by 0.2 rad the disc of 0.2 m passes 1.2 sin(0.2) = 0.238 m beside the point.
    assert found[0, 0] == found[0, 2] == 1.0


@pytest.mark.parametrize(
    ("parameters", "words"),
    [({"look": 0.0}, "look must be above 0"), ({"heading_weight": -1.0}, "heading_weight must not be negative")],
)
def test_bad_parameters_are_refused(parameters: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make_policy("dwa", "static", **parameters)
