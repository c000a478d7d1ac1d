"""What the reproduction apf-wall-following drives in, and its small parts: Fig. 6, the U and the hook, walls, V, scenes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import shapely
from shapely.affinity import translate

from bug_gym.agents import make_policy
from bug_gym.config import load, to_yaml
from bug_gym.reproductions import apf_wall_following, apf_worlds
from bug_gym.reproductions.apf_tracks import Track, drive, over_time


def test_along_a_straight_wall_alpha_says_how_a_robot_comes_nearer_to_it() -> None:
    """Fig. 6: without feedback the distance falls by the sine of what alpha is beyond 90 degrees, else as exp(-x)."""
    part = apf_wall_following.alphas()
    assert part.holds
    times, found = np.array(part.data["Fig. 6"]["times"]), part.data["Fig. 6"]["alphas"]
    plain, leaning, whole = ({kind: np.array(values) for kind, values in found[label].items()} for label in found)
    met = plain["distance"][0]
    assert met == leaning["distance"][0] == whole["distance"][0] > apf_worlds.CLEARANCE + 0.2
    # Beams are float32: a tenth of a millimetre is plenty.
    assert np.allclose(plain["distance"], met, atol=1e-4) and np.allclose(plain["driven"], 0.0, atol=0.01)
    sine, speed = math.sin(math.radians(2.0)), 0.5
    falling = met - speed * sine * times
    is_free = falling > apf_worlds.CLEARANCE
    assert 4 < is_free.sum() < len(times)
    assert np.allclose(leaning["distance"][is_free], falling[is_free], atol=1e-4)
    assert np.allclose(leaning["driven"][is_free], 2.0, atol=0.01) and np.allclose(leaning["expected"], 2.0)
    # Held where a step must end outside: within the clearance, and outside the body.
    held = leaning["distance"][~is_free]
    assert np.ptp(held) < 1e-4 and 0.2 < held[-1] < apf_worlds.CLEARANCE
    assert np.allclose(leaning["driven"][~is_free], 0.0, atol=0.01)
    # Alpha is 91 degrees and 60 a metre: 90 degrees are a sixtieth of a metre inside the clearance.
    rests = apf_worlds.CLEARANCE - 1.0 / 60.0
    assert whole["distance"][-1] == pytest.approx(rests, abs=1e-4)
    assert np.allclose(whole["expected"], 60.0 * (whole["distance"] - rests), atol=0.01)
    assert np.allclose(whole["driven"], whole["expected"], atol=0.01)


def test_fig_6_is_told_as_it_is_found() -> None:
    def side(distance: float, expected: float) -> dict[str, list[float]]:
        return {"distance": [0.8, distance], "expected": [expected, expected]}

    for distance, expected, holds in ((0.7, 2.0, True), (0.8, 2.0, False), (0.7, 0.0, False)):
        found = dict(
            zip(apf_wall_following.ALPHAS, (side(0.8, 0.0), side(distance, expected), side(0.4, 9.0)), strict=True)
        )
        assert apf_wall_following.leans(found) is holds


def test_with_the_field_the_u_and_the_hook_are_as_long_as_straight_until_contact() -> None:
    part = apf_wall_following.closed_forms()
    assert part.holds and len(part.data["closed forms"]) == 2 * (1 + 4)
    for name, one in part.data["closed forms"].items():
        # Twice 1.5 % or three steps: each may be as far from the length of a point.
        apart = 2.0 * max(0.015 * one["ideal"], 0.3)
        assert abs(float(one["field"]) - float(one["straight"])) <= apart, name


# ---------------------------------------------------------------------------------------------- walls, V and distance


def is_in_u(wall: dict[str, Any], mouth: float) -> bool:
    """Whether a wall was taken up within the U whose mouth is at an x [m]: 4 m deep and 5 m wide."""
    return bool(mouth < wall["x"] < mouth + 4.0 and abs(wall["y"]) < 2.5)


def test_the_real_robots_scenes_have_the_papers_two_walls_and_one() -> None:
    """Figs. 12a and 12b at 0.3 m/s; V falls, and what is told of a wall is where the robot was."""
    part = apf_wall_following.wall_phases()
    assert part.holds
    found = part.data["phases"]
    for scenario in (apf_worlds.scenes()["12a"], apf_worlds.moving_scenes()["12b"]):
        assert scenario["robot"]["max_speed"] == 0.3
    slab, u = found["12a, holonomic"]["phases"]
    assert 4.0 < slab["x"] < 6.0 and abs(slab["y"]) < 2.0 and is_in_u(u, 10.0)
    assert slab["begins"] < slab["ends"] < u["begins"] < u["ends"]
    for wall in (slab, u):
        assert wall["entered"] == pytest.approx(math.hypot(18.0 - wall["x"], wall["y"]))
    assert slab["from_wall"] == pytest.approx(6.0 - 0.2 - slab["x"])
    (wall,) = found["12b, differential"]["phases"]
    assert is_in_u(wall, 4.0)
    assert len(found["12b, holonomic"]["phases"]) == 1


@pytest.mark.parametrize("count", [1, 3])
def test_another_number_of_walls_is_not_the_papers(count: int) -> None:
    names = {"12a, holonomic": 2, "12a, differential": 3, "12b, holonomic": 1, "12b, differential": 1}
    found: dict[str, Any] = {name: {"phases": [{}] * number} for name, number in names.items()}
    assert apf_wall_following.has_phases(found)
    assert not apf_wall_following.has_phases(found | {"12a, holonomic": {"phases": [{}] * count}})
    for kind in ("holonomic", "differential"):
        assert not apf_wall_following.has_phases(found | {f"12b, {kind}": {"phases": [{}] * (count - 1)}})


def in_the_open(kinematics: str, target: dict[str, Any]) -> Track:
    """Ours, where there is nothing, at 0.5 m/s, the target at (8, 3) to begin with."""
    world = {"family": "explicit", "bounds": [-30, -30, 30, 30], "start": [0, 0, 2.0], **target}
    scenario = {**apf_worlds.ROBOT, "world": world}
    return drive(scenario, ("apf_wall_following", {}), {"robot.kinematics": kinematics})


STILL = {"goal": [8.0, 3.0]}
GOES_ON = {
    "target": {
        "at": [8.0, 3.0],
        "motion": {"law": "waypoints", "points": [[8.0, 3.0], [8.0, 23.0]], "speed": 0.3, "stop": True},
    }
}
SPEEDS = [(STILL, 0.0), (GOES_ON, 0.3)]


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize(("target", "speed"), SPEEDS)
def test_v_is_the_attractive_potential_of_where_robot_and_target_are_and_go(
    target: dict[str, Any], speed: float, kinematics: str
) -> None:
    """alpha_p |p_T - p| + alpha_v |v_T - v|^2, with alpha_p 1, and alpha_v such that the latter is 0.05 at 0.5 m/s."""
    track = in_the_open(kinematics, target)
    assert track.outcome == "success"
    for number in range(1, len(track.values)):
        place, before = track.path[number, :2], track.path[number - 1, :2]
        there = 8.0, 3.0 + speed * 0.1 * number
        velocity = (place - before) / 0.1
        expected = math.dist(there, place) + 0.05 / 0.5**2 * math.hypot(velocity[0], speed - velocity[1]) ** 2
        assert track.values[number] == pytest.approx(expected, abs=1e-6)
    assert track.values[0] == track.distances[0] == pytest.approx(math.hypot(8.0, 3.0))


@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize(("target", "speed"), SPEEDS)
def test_v_falls_where_nothing_repels_as_long_as_the_robot_goes_on(
    target: dict[str, Any], speed: float, kinematics: str
) -> None:
    track = in_the_open(kinematics, target)
    assert all(track.free) and track.phases == [] and track.rises == 0
    falls = np.diff(track.values) < 0.0
    goes_on = np.hypot(*np.diff(track.path[:-1, :2], axis=0).T) > 1e-6
    assert falls[1:][goes_on[1:]].all() and goes_on.sum() > 80
    # Run backwards it would rise.
    assert track._replace(values=track.values[::-1]).rises > 80


def test_v_and_distance_over_time_can_be_told_apart_and_show_each_wall() -> None:
    track = drive(apf_worlds.scenes()["7c"], apf_wall_following.METHODS["apf_wall_following"])
    distance, beside = over_time("7c", track)
    (wall,) = track.phases
    assert list(distance.x) == list(beside.x) and np.diff(distance.x).max() <= 1.0 and distance.x[-1] > 50.0
    for time, (value, low, high) in zip(distance.x, distance.lines["distance to the target"], strict=True):
        assert value == high and low == (0.0 if wall.begins <= time < wall.ends else value)
    # What is beside the distance is that of a speed of at most 0.5 m/s, which no curve of metres would show.
    values = np.array(beside.lines["V - alpha_p d"])[:, 0]
    assert values.min() > -1e-9 and values.max() == pytest.approx(0.05) and beside.y_range[1] < 0.06


# ---------------------------------------------------------------------------------------------- scenes


@pytest.mark.parametrize("name", apf_worlds.scenes() | apf_worlds.moving_scenes())
def test_each_scene_of_the_potential_field_is_a_scenario_for_any_policy(name: str, tmp_path: Path) -> None:
    scenario = (apf_worlds.scenes() | apf_worlds.moving_scenes())[name]
    file = tmp_path / "scene.yaml"
    file.write_text(to_yaml(load(scenario)), encoding="utf-8")
    assert load(file).world == load(scenario).world and load(file).robot == load(scenario).robot
    env = gym.make("BugGym/Navigation-v0", scenario=scenario)
    observation, _ = env.reset(seed=0)
    action, _ = make_policy("bug2", env).predict(observation)
    assert env.action_space.contains(action)
    assert not env.step(action)[2]


def walls_of(scenario: dict[str, Any]) -> list[shapely.Polygon]:
    """Each wall of a scene, its lower left corner at the origin."""
    walls = [shapely.Polygon(corners) for corners in scenario["world"]["polygons"]]
    return [translate(wall, -wall.bounds[0], -wall.bounds[1]) for wall in walls]


def test_the_complex_scene_is_composed_of_the_simple_traps() -> None:
    """Each of its walls is one of 7a to 7f, put elsewhere."""
    scenes = apf_worlds.scenes()
    simple = [wall for letter in "abcdef" for wall in walls_of(scenes[f"7{letter}"])]
    composed = walls_of(scenes["8a"])
    assert len(simple) == 6 and len(composed) == 4
    assert all(any(one.equals_exact(other, 1e-9, normalize=True) for other in simple) for one in composed)
