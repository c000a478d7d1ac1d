"""Branches of a Simulation: they begin as the original stands, and go on as it does, or into another future."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from bug_gym.simulation import Simulation, Transition
from bug_gym.world import Capacity

GUIDE = Path(__file__).resolve().parents[1] / "docs" / "guide" / "environments.md"
NOISY: dict[str, Any] = {
    "lidar": {"beams": 24, "noise": 0.02, "dropout": 0.05},
    "odometry": {"translation_noise": 0.1, "rotation_noise": 0.1},
}
PEOPLE: list[dict[str, Any]] = [
    {"law": "bounce", "velocity": [0.4, 0.3]},
    {"law": "random_walk", "speed": 0.6},
    {"law": "waypoints", "points": [[2, 2], [4, -2]], "speed": 0.5},
    {"law": "crowd", "speed": 0.7},
    {"law": "evade", "speed": 0.5, "sight": 4.0, "wander": 0.2},
    {"law": "replay", "points": [[0.0, -3, 3], [4.0, 3, 3], [9.0, 3, -3]]},
]
PLACES = [[3, 3], [-3, 2], [2, 2], [-3, -3], [3, -4], [-3, 3]]
EVERY_LAW: dict[str, Any] = {
    **NOISY,
    "world": {
        "family": "explicit",
        "bounds": [-6, -6, 6, 6],
        "circles": [[0, 2.5, 0.4]],
        "polygons": [[[-1, -3], [1, -3], [0, -2]]],
        "movers": [
            {"shape": {"circle": 0.25}, "at": at, "motion": motion} for at, motion in zip(PLACES, PEOPLE, strict=True)
        ],
        "start": [0, 0, 0],
        "target": {"at": [5, 5], "motion": {"law": "random_walk", "speed": 0.3}},
    },
}
WORLDS: dict[str, Any] = {
    "every law": EVERY_LAW,
    "robots": {"world": {"family": "circle_swap", "radius": 3.0}, "robots": {"count": 3}, **NOISY},
    "field": "rush",
}


def driven(simulation: Simulation, steps: int, seed: int = 0) -> list[Transition]:
    """What rows give that all get the same random actions."""
    rng = np.random.default_rng(seed)
    shape = (1, simulation.robots, 2)
    return [simulation.step(np.repeat(rng.uniform(-1, 1, shape), simulation.count, axis=0)) for _ in range(steps)]


def begun(scenario: Any, count: int = 2, steps: int = 12) -> Simulation:
    """Some rows in the midst of their episodes."""
    simulation = Simulation(scenario, count)
    simulation.reset(seeds=range(3, 3 + count))
    driven(simulation, steps)
    return simulation


@pytest.mark.parametrize("name", WORLDS)
def test_branches_that_get_the_originals_actions_are_the_original(name: str) -> None:
    original = begun(WORLDS[name])
    many = original.branches(5, row=1)
    np.testing.assert_array_equal(many.observations(), np.repeat(original.observations()[[1]], 5, axis=0))
    for expected, found in zip(driven(original, 25, 1), driven(many, 25, 1), strict=True):
        own: Any
        for own, others in zip(expected, found, strict=True):
            np.testing.assert_array_equal(others, np.repeat(own[[1]], 5, axis=0))
    info: dict[str, Any] = original.info()
    for key, values in info.items():
        np.testing.assert_array_equal(many.info()[key], np.repeat(values[[1]], 5, axis=0))


def test_branches_go_apart_from_one_another_and_leave_the_original_alone() -> None:
    original = begun(EVERY_LAW, 1)
    before = original.snapshot()
    many = original.branches(64)
    for _ in range(10):
        many.step(np.random.default_rng(5).uniform(-1, 1, (64, 1, 2)))
    assert len(np.unique(many.world.pose[:, 0, 0])) == 64
    for was, now in zip(before[0][1:4], original.snapshot()[0][1:4], strict=True):
        np.testing.assert_array_equal(was, now)


def test_a_snapshot_restored_goes_on_bit_for_bit_and_save_is_its_older_name() -> None:
    simulation = begun(EVERY_LAW)
    saved, same = simulation.snapshot(), simulation.save()
    np.testing.assert_array_equal(saved[0].floats, same[0].floats)
    first = driven(simulation, 15, 2)
    simulation.restore(saved)
    for one, other in zip(first, driven(simulation, 15, 2), strict=True):
        np.testing.assert_array_equal(one.observation, other.observation)


def futures_of(futures: Any, steps: int = 60) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Places of the walker (4, 2) and scans (4, B) of four branches, and of the original in a fifth row."""
    original = begun(EVERY_LAW, 1)
    many = original.branches(4, futures=futures)
    np.testing.assert_array_equal(many.observations(), np.repeat(original.observations(), 4, axis=0))
    still = np.zeros((4, 1, 2))
    for _ in range(steps):
        original.step(still[:1])
        many.step(still)
    worlds = (many.world, original.world)
    return (
        np.concatenate([world.disc_position[:, 1] for world in worlds]),
        np.concatenate([world.ranges[:, 0] for world in worlds]),
    )


def test_futures_are_the_originals_or_shared_or_each_its_own() -> None:
    for futures, kinds in (("same", 1), ("shared", 2), ("own", 5)):
        for values in futures_of(futures):
            assert len(np.unique(values, axis=0)) == kinds, futures
    for first, second in zip(futures_of("own"), futures_of("own"), strict=True):
        np.testing.assert_array_equal(first, second)


def test_rows_become_other_rows_of_the_same_simulation() -> None:
    tree = begun(EVERY_LAW, 4)
    tree.copy_rows(tree, [2, 2, 0], [0, 1, 3])
    before = tree.observations()
    np.testing.assert_array_equal(before[0], before[2])
    np.testing.assert_array_equal(before[1], before[2])
    after = driven(tree, 10)[-1].observation
    np.testing.assert_array_equal(after[0], after[1])
    assert not np.array_equal(after[2], after[3])


def test_a_source_of_less_room_and_one_of_more() -> None:
    """Worlds grow as they meet layouts; what is copied is the row and not where it lies."""
    for grown in (0, 1):
        pair = begun(EVERY_LAW, 1), begun(EVERY_LAW, 1, steps=3)
        pair[grown].world.grow(Capacity(discs=30, polygons=20, walls=200, ways=40, steered=1))
        pair[1].copy_rows(pair[0], [0])
        for one, other in zip(driven(pair[0], 10, 1), driven(pair[1], 10, 1), strict=True):
            np.testing.assert_array_equal(one.observation, other.observation)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (([0, 5],), "source_rows are from 0 to 1, got 5"),
        (([0, -1],), "source_rows are from 0 to 1, got -1"),
        (([0.0, 1.0],), "source_rows are numbers of rows"),
        (([0],), "one for each"),
        (([0, 1], [1, 1]), "none twice"),
    ],
)
def test_rows_that_cannot_be_are_refused(arguments: Any, said: str) -> None:
    simulation = begun(EVERY_LAW)
    with pytest.raises(ValueError, match=said):
        simulation.copy_rows(simulation, *arguments)


def test_other_scenarios_futures_rows_and_rows_without_an_episode_are_refused() -> None:
    simulation = begun(EVERY_LAW)
    with pytest.raises(ValueError, match="very scenario"):
        simulation.copy_rows(begun("static"), [0, 0])
    with pytest.raises(ValueError, match="futures must be one of.*'fair'"):
        simulation.branches(2, futures="fair")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="row are from 0 to 1, got 7"):
        simulation.branches(2, row=7)
    with pytest.raises(ResetNeeded):
        Simulation("static").branches(2)


def test_a_layout_that_is_read_and_placed_is_the_world_again() -> None:
    """As the robot stands there: a model begins at a start of its own, but sees the same."""
    world = begun({**EVERY_LAW, "lidar": {"beams": 24}}, 1)
    model = Simulation(world.scenario, 2)
    seen = model.place([world.world.layout(0)] * 2)
    np.testing.assert_array_equal(seen[:, 0, :24], np.repeat(world.world.ranges[:, 0], 2, axis=0))
    np.testing.assert_array_equal(model.world.time, 0.0)
    model.step(np.zeros((2, 1, 2)))
    with pytest.raises(ValueError, match="got 1 layouts for 2 rows"):
        model.place([world.world.layout(0)])


def test_the_planner_of_the_guide_arrives() -> None:
    """Random shooting, as the page has it."""
    text = GUIDE.read_text(encoding="utf-8").partition("## A model to plan with")[2]
    found = re.search(r"```python\n(.*?)```", text, re.DOTALL)
    assert found is not None
    names: dict[str, Any] = {}
    exec(found[1], names)
    assert names["world"].info()["outcome"][0, 0] == "success"


@pytest.mark.parametrize("futures", ["same", "own"])
def test_branches_keep_the_robot_that_was_drawn(futures: Any) -> None:
    changes = {"robot.max_speed": {"uniform": [0.5, 1.5]}, "lidar.noise": {"uniform": [0.0, 0.05]}}
    source = Simulation("dynamic", 3, overrides=changes)
    source.reset(seeds=[4, 5, 6])
    many = source.branches(4, row=1, futures=futures)
    own = source.world.own(1, "max_speed")
    assert own != source.world.own(0, "max_speed")
    again = Simulation("dynamic", 4, overrides=changes)
    again.restore(many.snapshot())
    for worlds in (many, again):
        assert [worlds.world.own(row, "max_speed") for row in range(4)] == [own] * 4
        worlds.step(np.ones((4, 1, 2)))
    assert np.array_equal(many.observations(), again.observations())


def test_branches_of_many_bodies_show_them_where_they_are() -> None:
    """Beyond some number of bodies a row brings only those near its robot to now; what is read is brought there."""
    source = Simulation("rush", overrides={"world.obstacles": 150, "world.bounds": [-20, -20, 20, 20]})
    source.reset(seeds=[2])
    for _ in range(20):
        source.step(np.zeros((1, 1, 2)))
    many = source.branches(2)
    assert np.array_equal(many.world.array("body_x")[1], source.world.array("body_x")[0])
    for _ in range(20):
        many.step(np.zeros((2, 1, 2)))
        source.step(np.zeros((1, 1, 2)))
    assert np.array_equal(many.world.array("body_x")[0], source.world.array("body_x")[0])
