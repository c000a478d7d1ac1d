"""A bug that begins anew is thinner, never thinner than its body allows, and the same in a batch as alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bug_gym.agents import make_policy
from bug_gym.agents.walls.vision import Scout, VisionMemory
from bug_gym.config import load
from bug_gym.policy import hidden_gap
from bug_gym.reproductions import cylinder_claims
from bug_gym.reproductions.barn import PARAMETERS
from bug_gym.simulation import Simulation

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


@pytest.mark.parametrize("name", ["com1", "vis_bug_21"])
def test_so_do_those_that_brake_for_what_a_thinner_robot_keeps(name: str) -> None:
    inert = {
        "robot.kinematics": "differential",
        "robot.max_acceleration": 1.0,
        "robot.max_speed": 2.0,
        "lidar.range": 10.0,
    }
    many, alone = (Simulation("disc", rows, overrides=inert) for rows in (2, 1))
    policy: Any = make_policy(name, many)
    flat, one = many.reset(seeds=[0, 0])[:, 0], alone.reset(seeds=[0])[0, 0]
    state, own = (policy.start(), policy.start()), (policy.start(),)
    differ = False
    for step in range(150):
        if step == 1:
            for memory in (state[0], own[0]):
                begin_anew(memory)
        actions, state = policy.predict(flat, state)
        action, own = policy.predict(one, own)
        np.testing.assert_array_equal(action, actions[0])
        differ = differ or bool((actions[0] != actions[1]).any())
        flat, one = many.step(actions[:, None]).observation[:, 0], alone.step(action[None, None]).observation[0, 0]
    assert differ
