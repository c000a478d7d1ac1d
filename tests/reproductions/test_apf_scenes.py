"""What the reproduction apf-wall-following drives in: scenes by name, and along a straight wall as in Fig. 6."""

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
