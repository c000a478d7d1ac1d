"""Driving by hand: where keys, stick and mouse take a robot, and what Gymnasium's own `play` makes of an env."""

import math
from collections.abc import Iterator
from itertools import count
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import bug_gym  # noqa: F401  registers the ids
from bug_gym.by_hand import DEAD, Hands, direction, hand_action, keys_to_action
from bug_gym.drawing.brush import load_pygame
from bug_gym.kinematics import discrete_velocities
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

HEADINGS = [-2.5, 0.0, 0.7, 3.0]
KINEMATICS = ["holonomic", "differential"]


def robot(kinematics: str, heading: float = 0.0, **robot: Any) -> Simulation:
    """One robot in the middle of an empty world."""
    world = {
        "family": "explicit",
        "bounds": [-10.0, -10.0, 10.0, 10.0],
        "start": [0.0, 0.0, heading],
        "goal": [9.0, 9.0],
    }
    simulation = Simulation({"world": world, "robot": {"kinematics": kinematics, **robot}})
    simulation.reset(seeds=[0])
    return simulation


def drive(simulation: Simulation, hands: Hands, steps: int, place: tuple[float, float] | None = None) -> list[float]:
    """Do what the hands say for some steps; returns where the robot is then."""
    told = Sensors.of(simulation.scenario).drive
    for _ in range(steps):
        x, y, heading = simulation.world.pose[0, 0].tolist()
        action = hand_action(hands, told, (x, y, heading), place)
        assert action.dtype == np.float32 and np.abs(action).max() <= 1.0
        simulation.step(action[None, None])
    pose: list[float] = simulation.world.pose[0, 0].tolist()
    return pose


@pytest.mark.parametrize("heading", HEADINGS)
@pytest.mark.parametrize(
    ("keys", "way"),
    [
        ({"up"}, (0.0, 1.0)),
        ({"a"}, (-1.0, 0.0)),
        ({"right", "s"}, (math.sqrt(0.5), -math.sqrt(0.5))),
        ({"up", "w"}, (0.0, 1.0)),
        ({"left", "right"}, (0.0, 0.0)),
        ({"x"}, (0.0, 0.0)),
    ],
)
def test_a_holonomic_robot_goes_where_the_keys_point_on_the_screen(
    heading: float, keys: set[str], way: tuple[float, float]
) -> None:
    simulation = robot("holonomic", heading, max_speed=1.5)
    x, y, turned = drive(simulation, Hands(held=frozenset(keys)), steps=10)
    length = 1.5 * 10 * simulation.scenario.time.step
    assert (x, y) == pytest.approx((length * way[0], length * way[1]), abs=1e-5)
    assert turned == heading


@pytest.mark.parametrize("heading", HEADINGS)
def test_a_differential_robot_has_gas_and_wheel(heading: float) -> None:
    simulation = robot("differential", heading, max_speed=1.5, max_turn_rate=2.0)
    x, y, turned = drive(simulation, Hands(held=frozenset({"up"})), steps=10)
    length = 1.5 * 10 * simulation.scenario.time.step
    assert (x, y) == pytest.approx((length * math.cos(heading), length * math.sin(heading)), abs=1e-5)
    assert turned == pytest.approx(heading)
    *_, turned = drive(simulation, Hands(held=frozenset({"left"})), steps=1)
    assert math.remainder(turned - heading, math.tau) == pytest.approx(2.0 * simulation.scenario.time.step)


@pytest.mark.parametrize("max_reverse", [0.0, 0.5])
def test_backwards_is_as_fast_as_the_robot_can(max_reverse: float) -> None:
    simulation = robot("differential", max_reverse=max_reverse)
    x, *_ = drive(simulation, Hands(held=frozenset({"down"})), steps=10)
    assert x == pytest.approx(-max_reverse * 10 * simulation.scenario.time.step, abs=1e-6)


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("stick", [(0.0, 0.0), (0.7 * DEAD, -0.7 * DEAD)])
def test_a_robot_without_hands_stands_still(kinematics: str, stick: tuple[float, float]) -> None:
    assert drive(robot(kinematics, 0.5), Hands(stick=stick), steps=5) == pytest.approx([0.0, 0.0, 0.5], abs=1e-6)


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("place", [(3.0, 2.0), (-2.0, -0.1)])
def test_a_robot_follows_the_mouse_and_waits_there(kinematics: str, place: tuple[float, float]) -> None:
    x, y, _ = drive(robot(kinematics), Hands(), 100, place)
    assert math.hypot(x - place[0], y - place[1]) < 0.05


def test_a_stick_tells_how_far_and_shift_slows_down() -> None:
    assert direction(Hands(stick=(0.3, -0.4))) == (0.3, -0.4)
    assert math.hypot(*direction(Hands(stick=(1.0, 1.0)))) == pytest.approx(1.0)
    slow = direction(Hands(held=frozenset({"up", "left shift"})))
    assert 0.0 < slow[1] < direction(Hands(held=frozenset({"up"})))[1]


@pytest.mark.parametrize("kinematics", KINEMATICS)
@pytest.mark.parametrize("name", ["BugGym/Static-v0", "BugGym/StaticDiscrete-v0"])
def test_each_key_of_an_env_is_an_action_of_it(kinematics: str, name: str) -> None:
    env = gym.make(name, overrides={"robot.kinematics": kinematics})
    actions = env.get_wrapper_attr("get_keys_to_action")()
    assert {frozenset(keys) for keys in actions} == set(map(frozenset, ["w", "a", "s", "d", "wa", "wd", "as", "sd"]))
    assert all(action in env.action_space for action in actions.values())


def test_the_discrete_actions_of_keys_point_where_the_keys_do() -> None:
    simulation = robot("holonomic", max_speed=2.0)
    told = Sensors.of(simulation.scenario).drive
    table = discrete_velocities(told)
    ways = {keys: table[number].tolist() for keys, number in keys_to_action(told, discrete=True).items()}
    assert ways["w",] == pytest.approx([2.0, 0.0]) and ways["a",] == pytest.approx([0.0, 2.0])
    assert ways["w", "d"] == pytest.approx([math.sqrt(2.0), -math.sqrt(2.0)])


# ---------------------------------------------------------------------------------------------- Gymnasium's own


@pytest.fixture
def pygame(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Pygame on the driver that shows nothing."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    module = load_pygame()
    module.display.quit()
    yield module
    module.display.quit()


def test_gymnasium_plays_the_env_of_an_id(pygame: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setattr("matplotlib.use", lambda backend: None)  # which `play` sets for the whole process
    from gymnasium.utils.play import play

    done: list[int] = []
    frames = count(1)

    def press(before: Any, after: Any, action: int, *rest: Any) -> None:
        done.append(action)
        number = next(frames)
        if number == 2:
            pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_a))
        if number == 5:
            pygame.event.post(pygame.event.Event(pygame.QUIT))

    env = gym.make("BugGym/StaticDiscrete-v0", render_mode="rgb_array")
    play(env, seed=0, callback=press)
    assert done == [0, 0, *[env.get_wrapper_attr("get_keys_to_action")()["a",]] * 3]
