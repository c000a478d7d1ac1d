"""Lists of near bodies: what a step sees and touches does not depend on what is listed, or on who looks in between."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bug_gym.kernels import neighbours
from bug_gym.simulation import Simulation

STEPS = 120


def crowded(shapes: str, beams: int = 24) -> dict[str, Any]:
    """A world with more bodies than are listed without a choice, most of them beyond the scan."""
    world = {
        "family": "field",
        "bounds": [-14, -14, 14, 14],
        "obstacles": neighbours.FEW + 32,
        "shapes": shapes,
        "sizes": [0.1, 0.3],
        "moving": 0.6,
        "laws": ["bounce", "random_walk"],
        "speeds": [0.2, 2.0],
    }
    return {"lidar": {"beams": beams, "range": 2.5}, "time": {"limit": 30.0}, "world": world}


def run(scenario: Any, margin: float | None, *, worlds: int = 3, look: bool = False) -> dict[str, Any]:
    """What robots see and get over some steps with resets, and where all bodies are at the end."""
    simulation = Simulation(scenario, worlds)
    if margin is not None:
        simulation.world.spec["margin"] = margin
    simulation.reset(seeds=range(worlds))
    random = np.random.default_rng(1)
    seen: list[Any] = []
    for _ in range(STEPS):
        actions = random.uniform(-1.0, 1.0, (worlds, simulation.robots, 2))
        observation, reward, terminated, truncated = simulation.step(actions)
        seen.append((observation.tobytes(), reward.tobytes()))
        if look:
            simulation.world.disc_position.sum()
        ended = np.flatnonzero((terminated | truncated).all(axis=1))
        if len(ended):
            seen.append(simulation.reset(ended).tobytes())
    listed = float(simulation.world.array("near_discs").mean() + simulation.world.array("near_polygons").mean())
    places = [simulation.world.array(name).copy() for name in ("body_x", "body_y", "body_vx", "body_vy", "body_event")]
    return {"seen": seen, "places": np.array(places), "listed": listed}


@pytest.fixture(scope="module", params=[("circles", 0.6), ("mixed", 0.6), ("circles", 1.0), ("mixed", 1.0)])
def whole(request: pytest.FixtureRequest) -> tuple[Any, dict[str, Any]]:
    """A scenario, and what happens in it where all bodies are always listed.

    Where all move, first events are planned late.
    """
    shapes, moving = request.param
    scenario = crowded(shapes)
    scenario["world"]["moving"] = moving
    return scenario, run(scenario, math.inf)


@pytest.mark.parametrize("margin", [0.0, 0.3, 1.0])
def test_a_world_that_lists_who_is_near_is_the_world_that_lists_all(whole: Any, margin: float) -> None:
    scenario, all_listed = whole
    listed = run(scenario, margin)
    assert listed["seen"] == all_listed["seen"], "to the last bit"
    assert (listed["places"] == all_listed["places"]).all(), (
        "wherever they are brought forward, in one stride or in many"
    )
    assert listed["listed"] < 0.5 * all_listed["listed"], "and it did list fewer"


def test_who_asks_where_the_bodies_are_changes_nothing(whole: Any) -> None:
    scenario, all_listed = whole
    looked = run(scenario, None, look=True)
    assert looked["seen"] == all_listed["seen"]
    assert (looked["places"] == all_listed["places"]).all()


def test_several_robots_each_have_their_near_bodies_listed() -> None:
    scenario = crowded("circles") | {"robots": {"count": 3}}
    assert run(scenario, 0.5)["seen"] == run(scenario, math.inf)["seen"]


def test_a_robot_put_elsewhere_finds_what_is_near_there() -> None:
    """As a planner or a test does: the pose is written, and the world steps on."""
    ends = []
    for margin in (0.5, math.inf):
        simulation = Simulation(crowded("circles"), 2)
        simulation.world.spec["margin"] = margin
        simulation.reset(seeds=[4, 5])
        for x in (-10.0, 9.0, 0.0):
            simulation.world.pose[:, 0, :2] = (x, 0.5 * x)
            ends.append(simulation.step(np.zeros((2, 1, 2))).observation.tobytes())
    assert ends[:3] == ends[3:]


def test_a_body_that_nobody_was_near_is_where_the_closed_form_has_it() -> None:
    """A circle that goes to and fro between two walls, asked for once after many steps."""
    speed, steps = 1.37, 600
    scenario = {
        "lidar": {"beams": 4, "range": 1.0},
        "time": {"step": 0.1, "limit": 100.0},
        "world": {
            "family": "explicit",
            "bounds": [0, 0, 40, 10],
            "start": [2, 9, 0],
            "goal": [38, 9],
            "circles": [[10.0 + 0.1 * i, 1.0, 0.05] for i in range(neighbours.FEW)],
            "movers": [
                {"shape": {"circle": 0.5}, "at": [30, 5], "motion": {"law": "bounce", "velocity": [speed, 0.0]}}
            ],
        },
    }
    simulation = Simulation(scenario)
    simulation.reset(seeds=[0])
    for _ in range(steps):
        simulation.advance(np.zeros((1, 1, 2)))
    between = 40.0 - 2.0 * 0.5  # where its centre may be
    along = (30.0 - 0.5 + speed * 0.1 * steps) % (2.0 * between)
    expected = 0.5 + min(along, 2.0 * between - along)
    assert simulation.world.disc_position[0, 0].tolist() == pytest.approx([expected, 5.0], abs=1e-9)


def test_the_step_of_one_world_tells_where_bodies_are_too() -> None:
    one, batch = Simulation(crowded("circles")), Simulation(crowded("circles"))
    for simulation in (one, batch):
        simulation.reset(seeds=[7])
    for _ in range(20):
        one.step_one(0.1, 0.2)
        batch.step([[[0.1, 0.2]]])
        assert (one.world.disc_position == batch.world.disc_position).all()


@pytest.mark.parametrize(("shapes", "moving"), [("circles", 1.0), ("circles", 0.5), ("mixed", 0.3), ("squares", 1.0)])
def test_a_listed_body_is_looked_at_before_it_touches_anything(shapes: str, moving: float) -> None:
    """Its first contact is not known at the start of an episode; the time until which it is left alone is no later."""
    scenario = crowded(shapes)
    scenario["world"] |= {"moving": moving, "laws": ["bounce"], "obstacles": 40}
    simulation = Simulation(scenario, 20)
    simulation.reset(seeds=range(20))
    world = simulation.world
    alone, contact = world.array("near_event").copy(), world.array("body_event")
    compared = 0
    begins = [("disc", 0, 0), ("polygon", int(world.spec["discs"][0]), int(world.spec["disc_room"][0]))]
    for kind, first, at in begins:
        count = int(world.array(f"moving_{kind}_count")[0, 0])
        until, true = alone[:, at : at + count], contact[:, first : first + count]
        assert (until <= true).all()
        compared += int(np.isfinite(true).sum())
        if moving == 1.0:  # nothing stands but the four walls of the bounds
            assert until == pytest.approx(true, abs=1e-6)
    assert compared > 100
