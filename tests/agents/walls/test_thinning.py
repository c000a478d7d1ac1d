"""A bug that begins anew is thinner, never thinner than its body allows, and the same in a batch as alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bug_gym.agents import make_policy
from bug_gym.agents.walls.vision import Scout, VisionMemory
from bug_gym.config import load
from bug_gym.policy import Memory, ScriptedPolicy, Velocity, hidden_gap
from bug_gym.reproductions import cylinder_claims
from bug_gym.reproductions.barn import PARAMETERS
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

BEGINNING_ANEW = ("bug1", "bug2", "com1", "class1", "alg1", "alg2", "rev1", "dist_bug", "tangent_bug", "vis_bug_21")


def begin_anew(memory: Any, starts: int = 1) -> None:
    """As if it had begun anew so often."""
    counts = memory
    if isinstance(memory, VisionMemory):
        memory.trail = memory.trail or [Scout()]
        counts = memory.scout
    counts.fresh_starts = starts


def after(policy: Any, starts: int) -> Any:
    """Who drives after so many fresh starts."""
    memory = policy.start()
    begin_anew(memory, starts)
    return policy.driver(memory)


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("name", BEGINNING_ANEW)
def test_each_fresh_start_keeps_less_from_walls_and_as_much_as_the_robot_needs(name: str, kinematics: str) -> None:
    policy: Any = make_policy(name, load("disc", {"robot.kinematics": kinematics}))
    kept = [after(policy, starts).kept.clearance for starts in range(4)]
    assert after(policy, 0) is policy and kept[0] == policy.kept.clearance
    assert kept[1] < kept[0] and kept == sorted(kept, reverse=True)
    thinnest = after(policy, 3).kept
    sure = policy.sensors.radius + hidden_gap(policy.sensors)
    assert min(thinnest.hit_radius, thinnest.safe_radius) >= sure - 1e-9


def test_where_noise_leaves_no_room_nobody_gets_thinner() -> None:
    policy: Any = make_policy("com1", load("disc", {"lidar.noise": 0.03}))
    assert after(policy, 3).kept.clearance == policy.kept.clearance


def test_a_scanner_that_does_not_show_corners_so_near_leaves_it_at_the_clearance() -> None:
    # A corner passed by a step of 0.1 m lies 108.4 degrees from ahead at 0.3 m, 110.6 at 0.2667 m.
    robot = {"robot.kinematics": "differential", "lidar.fov": 2.0 * np.radians(109.0), "lidar.beams": 181}
    policy: Any = make_policy("com1", load("disc", robot))
    assert after(policy, 1) is policy


def test_what_it_keeps_else_stays() -> None:
    policy: Any = make_policy("com1", "disc", turn="right", leave_rule="any", clearance=0.35)
    thinner = after(policy, 1)
    assert (thinner.side, thinner.parameters.leave_rule) == (policy.side, "any")
    assert thinner.kept.clearance == pytest.approx(0.2 + 2.0 / 3.0 * 0.15)


@pytest.mark.parametrize(("name", "robot", "seed"), [("vis_bug_21", "jackal", 223), ("com1", "jackal", 1632)])
def test_thin_rows_of_a_batch_do_what_they_do_alone(name: str, robot: str, seed: int) -> None:
    """The world of the seed is begun anew in; beside it go worlds where nobody begins anew."""
    seeds = [seed, seed + 4, seed + 8] if cylinder_claims.is_shut(seed) else [seed, 0, 4]
    scenario = cylinder_claims.scenario(robot, shut=cylinder_claims.is_shut(seed))
    many, alone = Simulation(scenario, 3), [Simulation(scenario, 1) for _ in seeds]
    policy: Any = make_policy(name, many, **PARAMETERS[robot])
    flat, flats = (
        many.reset(seeds=seeds)[:, 0],
        [one.reset(seeds=[own])[0, 0] for one, own in zip(alone, seeds, strict=True)],
    )
    state, states, began = None, [None] * 3, False
    for _ in range(400 if name == "vis_bug_21" else 2600):
        actions, state = policy.predict(flat, state)
        for row, own in enumerate(alone):
            action, states[row] = policy.predict(flats[row], states[row])
            np.testing.assert_array_equal(action, actions[row])
            flats[row] = own.step(action[None, None]).observation[0, 0]
        began = began or policy.driver(state[0]) is not policy
        flat = many.step(actions[:, None]).observation[:, 0]
    assert began


class Ahead(ScriptedPolicy):
    """Goes ahead and keeps 0.5 m about its body, or 0.1 m where its memory says so."""

    room = 0.5

    def start(self) -> Memory:
        return Memory(mode="")

    def act(self, view: View, memory: Memory) -> Velocity:
        return view.sensors.drive.max_speed, 0.0

    def driver(self, memory: Memory) -> ScriptedPolicy:
        other = Ahead(self.sensors)
        other.room = 0.1
        return other if memory.mode == "near" else self


def test_a_driver_keeps_its_own_room_in_a_batch_as_alone() -> None:
    world = {"family": "explicit", "bounds": [0, 0, 8, 4], "start": [1, 2, 0], "goal": [7, 2]}
    wall = {"polygons": [[[5, 0], [5.5, 0], [5.5, 4], [5, 4]]]}
    robot = {"kinematics": "differential", "radius": 0.2, "max_acceleration": 1.0}
    scenario = load({"world": {**world, **wall}, "robot": robot, "lidar": {"beams": 180}, "time": {"limit": 30.0}})
    many, alone = Simulation(scenario, 2), Simulation(scenario, 1)
    policy = Ahead(Sensors.of(scenario))
    flat, one = many.reset(seeds=[0, 0])[:, 0], alone.reset(seeds=[0])[0, 0]
    state: tuple[Memory, ...] = (Memory(mode="near"), policy.start())
    own: tuple[Memory, ...] = (Memory(mode="near"),)
    for _ in range(150):
        actions, state = policy.predict(flat, state)
        action, own = policy.predict(one, own)
        np.testing.assert_array_equal(action, actions[0])
        flat, one = many.step(actions[:, None]).observation[:, 0], alone.step(action[None, None]).observation[0, 0]
    # The wall is 3.8 m before the body's front.
    near, far = (many.world.pose[:, 0, 0] - 1.0).tolist()
    assert far < 3.8 - 0.5 + 0.01 and 3.8 - 0.5 < near < 3.8 - 0.1 + 0.01
