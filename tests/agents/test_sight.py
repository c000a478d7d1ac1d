"""Robots that are shown too late what is in their way: refused, and rightly so; those just within the bounds are not."""

from __future__ import annotations

import math
import re
from typing import Any

import pytest
from episodes import Episode, run_episode

from bug_gym import agents
from bug_gym.agents import AGENTS, make_policy
from bug_gym.agents.learning.settings import load_settings, training_names
from bug_gym.agents.sight import require_sight, way_to_stand
from bug_gym.config import Scenario, load, scenario_names
from bug_gym.evaluation.suites import load_suite, suite_names
from bug_gym.policy import MisfitError
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

OPEN = {"world": {"family": "empty", "bounds": [-10, -10, 10, 10]}, "lidar": {"beams": 720, "range": 30.0}}
"""A holonomic robot of 0.2 m with 1 m/s and steps of 0.1 s."""

Overrides = dict[str, Any]


def robot(**overrides: Any) -> Scenario:
    """OPEN's, with `robot__max_speed=2.0` and the like."""
    return load(OPEN, {key.replace("__", "."): value for key, value in overrides.items()})


def refusal(scenario: Scenario, name: str = "bug2") -> str:
    """Why a policy is refused the robot; "" where it is not."""
    try:
        make_policy(name, scenario)
    except MisfitError as error:
        return str(error)
    return ""


def test_no_robot_of_the_package_is_refused() -> None:
    scenarios = [load(name) for name in scenario_names()]
    for suite in map(load_suite, suite_names()):
        entries = [entry for entry in suite.scenarios if isinstance(entry.scenario, str)]
        scenarios += [load(entry.scenario, entry.overrides) for entry in entries]
    scenarios += [scenario for name in training_names() for scenario in load_settings(name).loaded]
    assert len(scenarios) > 50
    for scenario in scenarios:
        require_sight(scenario, "anybody")


# ------------------------------------------------------------------------------------------------------- both sides

MOTIONS: list[Overrides] = [
    {"robot__max_speed": 1.0},
    {"robot__max_speed": 2.0, "robot__max_acceleration": 0.5},
    {"robot__max_speed": 1.5, "robot__max_acceleration": 3.0, "robot__latency": 0.3},
    {"robot__max_speed": 2.0, "robot__latency": 0.1, "time__step": 0.05},
]


def way_by_steps(motion: Overrides) -> float:
    """The way to stand [m], step by step: one at full speed, those of the latency, and slower ones."""
    step, speed = motion.get("time__step", 0.1), motion["robot__max_speed"]
    late = round(motion.get("robot__latency", 0.0) / step)
    way: float = (1 + late) * speed * step
    loss = motion.get("robot__max_acceleration", math.inf) * step
    while (speed := speed - loss) > 0.0:
        way += speed * step
    return way


@pytest.mark.parametrize("motion", MOTIONS)
def test_the_scanner_reaches_as_far_as_the_robot_needs_to_stand(motion: Overrides) -> None:
    way = way_by_steps(motion)
    assert way_to_stand(Sensors.of(robot(**motion)).drive) == pytest.approx(way)
    needed = max(0.2 + way, 0.45)
    assert refusal(robot(**motion, lidar__range=max(needed, 1.0) + 1e-3)) == ""
    if needed > 1.0:
        assert "to come to stand" in refusal(robot(**motion, lidar__range=needed - 1e-3))


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_thing_as_wide_as_the_body_is_met_in_time(motion: Overrides) -> None:
    """With n beams all round a disc of radius R touches two of them, and none goes through it, at R / sin(pi / n)."""
    needed = 2 * 0.2 + way_by_steps(motion)
    enough = math.ceil(math.pi / math.asin(0.2 / needed))
    assert 0.2 / math.sin(math.pi / enough) >= needed > 0.2 / math.sin(math.pi / (enough - 1))
    assert refusal(robot(**motion, lidar__beams=enough)) == ""
    assert f"at least {enough} lidar.beams" in refusal(robot(**motion, lidar__beams=enough - 1))


def test_the_scanner_looks_where_the_robot_goes() -> None:
    turns = {"robot__kinematics": "differential"}
    assert refusal(robot()) == refusal(robot(**turns, lidar__fov=math.pi), "dwa") == ""
    assert "lidar.fov of 2 pi" in refusal(robot(lidar__fov=6.2))
    assert "lidar.fov of at least pi" in refusal(robot(**turns, lidar__fov=3.1), "dwa")
    assert refusal(robot(robot__kinematics="ackermann", lidar__fov=4.0)) == ""


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("lidar", [{"lidar__range": 0.25}, {"lidar__beams": 7}, {"lidar__beams": 6, "lidar__fov": 4.5}])
def test_what_is_told_would_do(motion: Overrides, lidar: Overrides) -> None:
    overrides = {"robot__kinematics": "differential", "robot__max_reverse": 0.0, **motion, **lidar}
    said = refusal(robot(**overrides), "dwa")  # who follows no walls asks for nothing else
    told = set()
    for key, law in {
        "lidar__range": r"lidar\.range of at least ([\d.]+) m",
        "lidar__beams": r"at least (\d+) lidar\.beams",
        "robot__max_speed": r"robot\.max_speed of at most ([\d.]+) m/s",
    }.items():
        if found := re.search(law, said):
            number = float(found[1])
            changed = {**overrides, key: int(number) if key == "lidar__beams" else number}
            assert refusal(robot(**changed), "dwa") == ""
            told.add(key)
    assert told == {next(iter(lidar)), "robot__max_speed"}


# ------------------------------------------------------------------------------------------------- beyond the bounds


def driven_anyway(monkeypatch: pytest.MonkeyPatch, name: str, world: dict[str, Any], **parts: Any) -> Episode:
    """An episode of a robot that would be refused."""
    monkeypatch.setattr(agents, "require_sight", lambda scenario, told: None)
    described = {"world": {"family": "explicit", "bounds": [-5, -8, 30, 8], "start": [0, 0, 0], **world}, **parts}
    return run_episode(name, described, max_steps=250)


def test_who_outruns_its_sight_touches_walls(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wall across the way, at any distance within a step."""
    way = 4.1
    for sight, touches in ((0.95 * (0.2 + way), True), (1.01 * (0.2 + way), False)):
        lidar = {"beams": 360, "range": sight}
        episodes = [
            driven_anyway(
                monkeypatch,
                "bug2",
                {"goal": [28, 0], "polygons": [[[x, -4], [x + 1, -4], [x + 1, 4], [x, 4]]]},
                robot={"max_speed": 2.0, "max_acceleration": 0.5},
                lidar=lidar,
            )
            for x in (15.0, 15.05, 15.1, 15.15)
        ]
        assert any(episode.outcome == "collision" for episode in episodes) == touches


@pytest.mark.parametrize("name", ["bug2", "tangent_bug", "vis_bug_21"])
def test_who_has_too_few_beams_does_not_get_past_things_as_wide_as_itself(
    monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """A disc straight ahead, in the middle between two beams: it is touched, or the robot stands before it."""
    outcomes = {}
    for beams in (6, 16):
        world = {"start": [0, 0, math.pi / beams], "goal": [10, 0], "circles": [[5, 0, 0.2]]}
        outcomes[beams] = driven_anyway(monkeypatch, name, world, lidar={"beams": beams, "range": 8.0}).outcome
    assert outcomes[6] in ("collision", "running") and outcomes[16] == "success"


@pytest.mark.parametrize(("name", "kinematics", "fov", "world"), [
    ("bug2", "holonomic", 1.5 * math.pi, {"start": [0, 0, math.pi], "circles": [[5, 0, 0.5]]}),  # it goes back, as it lies
    ("dwa", "differential", math.radians(140.0), {"circles": [[0.058, 0.204, 0.01]]}),  # beside its view, before its body
])  # fmt: skip
def test_who_does_not_look_there_touches_what_it_never_sees(
    monkeypatch: pytest.MonkeyPatch, name: str, kinematics: str, fov: float, world: dict[str, Any]
) -> None:
    for seen, touches in ((fov, True), (2.0 * math.pi, False)):
        lidar = {"beams": 360, "fov": seen}
        episode = driven_anyway(
            monkeypatch, name, {"goal": [10, 0], **world}, robot={"kinematics": kinematics}, lidar=lidar
        )
        assert (episode.outcome == "collision") == touches


# ------------------------------------------------------------------------------------------------------ who is asked

BLIND: Overrides = {"lidar.beams": 3, "lidar.fov": 1.0, "lidar.range": 5.0, "robot.kinematics": "differential"}


@pytest.mark.parametrize("name", ["bug0", "hd_bug", "hd_bug_map", "velocity_obstacle", "mppi", "orca", "apf"])
def test_who_has_but_its_scanner_is_asked(name: str) -> None:
    with pytest.raises(MisfitError, match="lidar.fov"):
        make_policy(name, load("static", BLIND))


SHORT: Overrides = {"lidar.range": 1.0}
"""Less than potential fields reach by default."""


@pytest.mark.parametrize("overrides", [BLIND, SHORT, {"lidar.beams": 1}], ids=["blind", "short", "one beam"])
def test_a_robot_that_does_not_suit_is_told_from_a_parameter_that_cannot_be(overrides: Overrides) -> None:
    """An evaluation of all policies leaves out whom the robot does not suit; any other error ends it."""
    scenario, refused = load("static", overrides), set()
    for name, agent in AGENTS.items():
        if agent.model or agent.family == "planner":  # which need a live env
            continue
        try:
            make_policy(name, scenario)
        except MisfitError:
            refused.add(name)
    assert "apf_wall_following" in refused


LEAVING: dict[str, dict[str, Any]] = {
    "d2t_eaco": {},
    "a_star": {"follower": "velocity_obstacle"},
    "velocity_obstacle": {"privileged": True},
    "d_star_lite": {"known": False},
}


@pytest.mark.parametrize("name", LEAVING)
def test_who_leaves_its_way_by_what_is_seen_is_asked_too(name: str) -> None:
    with pytest.raises(MisfitError, match="lidar.fov"):
        make_policy(name, Simulation("static", overrides=BLIND), **LEAVING[name])


@pytest.mark.parametrize("name", ["go_to_goal", "random", "a_star", "visibility_graph"])
def test_who_takes_no_care_or_keeps_to_the_map_is_not(name: str) -> None:
    make_policy(name, Simulation("static", overrides=BLIND))


def test_walls_are_followed_where_the_scanner_tells_their_distance() -> None:
    assert refusal(robot(lidar__min_range=0.3)) == ""
    assert refusal(robot(lidar__min_range=0.31)) == (
        "walls cannot be followed at 0.3 m, the scanner tells no distance below 0.31 m: expected a clearance of at least that"
    )
    make_policy("bug2", robot(lidar__min_range=0.31), clearance=0.32)


@pytest.mark.parametrize("name", ["bug2", "vis_bug_21", "hd_bug"])
@pytest.mark.parametrize("clearance", [0.3, 0.5])
def test_corners_are_seen_a_step_after_they_are_passed(name: str, clearance: float) -> None:
    """With 180 degrees bugs once passed by doors, and took a maze for a room without any."""
    needed = math.pi + 2.0 * math.atan(0.1 / clearance)
    turns = {"robot__kinematics": "differential"}
    make_policy(name, robot(**turns, lidar__fov=needed + 1e-6), clearance=clearance)
    with pytest.raises(MisfitError, match="a wall's corner that is passed lies .* from ahead, the scanner looks to"):
        make_policy(name, robot(**turns, lidar__fov=needed - 1e-3), clearance=clearance)


@pytest.mark.parametrize("name", ["bug2", "vis_bug_21", "hd_bug"])
def test_and_left_where_it_sees_that_the_way_is_free(name: str) -> None:
    """With less sight VisBug once took the open for a room without a door."""
    make_policy(name, robot(lidar__range=1.5), clearance=1.0)
    with pytest.raises(MisfitError, match="where 1.5 m toward the goal are free, the scanner sees 1.49 m"):
        make_policy(name, robot(lidar__range=1.49), clearance=1.0)
