"""How a differential robot that rounds corners comes from its straight way onto a contour."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from episodes import run_episode

from bug_gym.agents import make_policy
from bug_gym.agents.walls.contour import Contour
from bug_gym.config import load
from bug_gym.simulation import Simulation
from bug_gym.view import View


def facing(**world: object) -> dict[str, object]:
    """A robot of 0.2 m that faces its goal, 8 m ahead."""
    bounded = {"family": "explicit", "bounds": [0, 0, 12, 8], "start": [2, 4, 0], "goal": [10, 4], **world}
    return {
        "robot": {"kinematics": "differential", "radius": 0.2},
        "lidar": {"beams": 180},
        "time": {"limit": 100.0},
        "world": bounded,
    }


ACROSS = facing(polygons=[[[6, 1], [6.4, 1], [6.4, 7], [6, 7]]])


@pytest.mark.parametrize("name", ["bug1", "bug2", "com1", "class1", "alg2", "rev3", "bug0_plus", "dist_bug"])
def test_a_robot_turns_onto_a_wall_on_an_arc_and_takes_the_end_of_its_straight_way_for_the_hit_point(name: str) -> None:
    """The wall is met at a right angle, which an arc of 2/3 m rounds."""
    clearance, step = 0.4, 0.1
    hits, ways, times = [], [], []
    for rounds in (False, True):
        episode = run_episode(name, ACROSS, clearance=clearance, round_corners=rounds)
        assert episode.outcome == "success"
        hits.append(episode.memory.hits[0])
        steps = int((abs(episode.path[:, 1] - 4.0) > 1.0).argmax())
        ways.append(np.hypot(episode.path[:steps, 0] - 5.6, episode.path[:steps, 1] - 4.0).min())
        times.append(steps * step)
    # By odometry, from the start.
    assert hits[0] == pytest.approx((3.6, 0.0), abs=0.02) and hits[1] == pytest.approx((3.6, 0.0), abs=0.02)
    assert ways[0] <= 0.02 and ways[1] >= 0.15
    # Straight, a quarter of a turn, straight: 3.6 s, 1.05 s, 1 s; an arc takes 2 (2/3 m) (1 - pi/4) / (1 m/s) less of the way,
    # and does not stand.
    quarter = 0.5 * math.pi / 1.5
    assert times[0] >= 4.6 + quarter - 2.0 * step
    assert times[1] <= 4.6 + 2.0 * step


def test_no_wall_is_hit_where_what_stood_in_the_way_has_gone() -> None:
    """A disc crosses the way where the robot begins to look for a contour, and is gone before it comes there."""
    mover = {"shape": {"circle": 0.5}, "at": [6.0, 1.4], "motion": {"law": "bounce", "velocity": [0.0, 1.6]}}
    episode = run_episode("bug1", facing(movers=[mover]), clearance=0.4)
    assert episode.outcome == "success" and not episode.memory.hits and episode.memory.landing is None


@pytest.mark.parametrize(
    ("name", "measured"), [("bug1", "hit_distance"), ("bug2", "hit_distance"), ("alg1", "nearest")]
)
def test_what_is_measured_at_a_hit_point_is_of_the_point_and_not_of_where_the_arc_ends(
    name: str, measured: str
) -> None:
    """Along a slanting wall the arc comes nearer to the goal than the hit point."""
    slanting = facing(polygons=[[[5, 3.5], [8, 6.5], [7.8, 6.7], [4.8, 3.7]], [[4.8, 3.7], [5, 3.5], [5, 1], [4.8, 1]]])
    episode = run_episode(name, slanting, clearance=0.4, max_steps=30)
    contour = episode.memory.contour
    assert contour is not None and abs(contour.hit[1]) <= 0.02
    distance = math.dist(contour.hit, (8.0, 0.0))
    assert math.dist(contour.position, (8.0, 0.0)) < distance - 0.1
    assert getattr(episode.memory, measured) == pytest.approx(distance, abs=1e-5)


def test_the_side_is_chosen_by_the_wall_at_the_hit_point_and_not_by_what_stands_beside_the_way_to_it() -> None:
    """The wall comes nearer on the right; a post stands on the left, a metre before it."""
    leaning = [[5.0, 1.0], [5.2, 1.0], [6.7, 7.0], [6.5, 7.0]]
    episode = run_episode("dist_bug", facing(polygons=[leaning], circles=[[4.6, 4.75, 0.2]]), clearance=0.4)
    assert episode.outcome == "success" and episode.memory.hit_sides[0] == 1
    assert np.hypot(episode.path[:, 0] - 5.35, episode.path[:, 1] - 4.0).min() >= 0.1


@pytest.mark.parametrize("slope", [20.0, 60.0])
@pytest.mark.parametrize(("name", "record"), [("alg1", "nearest"), ("alg2", "nearest"), ("class1", "least_distance")])
def test_the_hit_point_counts_as_visited_and_for_the_m_line_no_place_beside_it(
    name: str, record: str, slope: float
) -> None:
    """Along a wall that leads on to the goal the arc may end nearer to it, and before a steep one farther off."""
    cos, sin = math.cos(math.radians(slope)), math.sin(math.radians(slope))
    ends = [(5.0 - cos, 3.5 - sin), (5.0 + 4.0 * cos, 3.5 + 4.0 * sin)]
    wall = [ends[0], *((x + 0.2 * sin, y - 0.2 * cos) for x, y in ends), ends[1]]
    scenario = facing(polygons=[wall])
    for steps in range(20, 60):
        episode = run_episode(name, scenario, clearance=0.4, max_steps=steps)
        if episode.memory.contour is not None:
            break
    contour = episode.memory.contour
    assert contour is not None and math.dist(contour.position, contour.hit) > 0.05
    beyond = getattr(episode.memory, record) - contour.hit_distance
    assert beyond <= 1e-6 and (name != "alg1" or beyond >= -1e-6)


class Flickering:
    """Rounding that leads on at every other look, and then elsewhere than the rule: as one that stands sees other beams."""

    def __init__(self) -> None:
        self.looks = 0

    def go_on(self, view: View, contour: Contour) -> tuple[float, float] | None:
        self.looks += 1
        return (-0.1, -0.1) if self.looks % 2 else None

    def begin(self, view: View, contour: Contour, heading: float) -> None:
        contour.foot = (*view.position, heading + view.heading)


def test_who_turns_to_and_fro_between_an_arc_and_the_contour_takes_the_contour() -> None:
    """Once it has stood for as long as half a turn takes."""
    simulation = Simulation(load(ACROSS), 1)
    policy: Any = make_policy("com1", simulation, clearance=0.4)
    flat, state = simulation.reset(seeds=[0])[:, 0], (policy.start(),)
    while state[0].contour is None or state[0].contour.heading is None:
        action, state = policy.predict(flat, state)
        flat = simulation.step(action[:, None]).observation[:, 0]
    view, memory, boundary = View(flat[0], policy.sensors), state[0], policy.boundary
    boundary.rounding = Flickering()
    memory.contour.foot = (*view.position, view.heading)
    asked = [boundary.follow(view, memory) for _ in range(4 * boundary.turn_decisions)]
    assert len(set(asked[: boundary.turn_decisions])) == 2
    assert len(set(asked[2 * boundary.turn_decisions :])) == 1


@pytest.mark.parametrize("asked", [2.0, -0.3])
def test_who_has_been_of_two_minds_for_as_long_as_half_a_turn_takes_keeps_to_the_last_one_where_it_is_open(
    asked: float,
) -> None:
    """Each turn on the spot shows the wall by other beams. The wall lies 0.35 m ahead here, its contour at 0.4 m."""
    simulation = Simulation(load(facing(start=[11.65, 4, 0], goal=[2, 4])), 1)
    policy: Any = make_policy("com1", simulation, clearance=0.4)
    view, boundary = View(simulation.reset(seeds=[0])[0, 0], policy.sensors), policy.boundary
    contour = boundary.lay_hand(view, 1, 0.0)
    assert boundary._resolved(view, contour, 1.6) == 1.6
    contour.asked, contour.asked_for = asked + view.heading, boundary.turn_decisions
    assert boundary._resolved(view, contour, 1.6) == 1.6
    contour.asked_for += 1
    assert boundary._resolved(view, contour, 1.6) == pytest.approx(asked if asked > 1.0 else 1.6)
