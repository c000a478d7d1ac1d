"""Teams of robots that are larger than the paper's distances allow for."""

from typing import Any

import pytest

from bug_gym.agents import team_names
from bug_gym.agents.teams.bug_team import distances
from bug_gym.agents.teams.partners import least_gap
from bug_gym.config import load
from bug_gym.reproductions.team_runs import run_team
from bug_gym.view import Sensors

WIDE = {
    "world.bounds": [-12, -12, 12, 12],
    "world.radius": 9.0,
    "lidar.range": 12.0,
    "lidar.beams": 180,
    "time.limit": 200.0,
}
LONG = {"robot.kinematics": "differential", "robot.circles": [[0.1 * x, 0.0, 0.17] for x in range(-8, 9)]}


def sensors_of(radius: float) -> Sensors:
    return Sensors.of(load({"robot": {"radius": radius}}))


@pytest.mark.parametrize("radius", [0.05, 0.2, 0.5, 0.6])
def test_robots_that_have_the_room_keep_the_papers_distances(radius: float) -> None:
    assert distances(sensors_of(radius)) == (1.5, 2.0)


@pytest.mark.parametrize("radius", [0.2, 0.7, 0.75, 1.0, 5.0])
def test_who_holds_can_still_be_passed(radius: float) -> None:
    sensors = sensors_of(radius)
    hold, go = distances(sensors)
    assert hold >= least_gap(sensors) + 2.0 * sensors.step_length - 1e-9 and go == pytest.approx(hold + 0.5)


@pytest.mark.parametrize("radius", [0.2, 3.0])
def test_a_distance_that_is_asked_for_is_kept(radius: float) -> None:
    assert distances(sensors_of(radius), 0.0, 0.7) == (0.0, 0.7)


@pytest.mark.parametrize("team", team_names())
@pytest.mark.parametrize("robot", [{"robot.radius": 1.0}, {"robot.radius": 1.5}, LONG], ids=["1.0", "1.5", "long"])
def test_large_robots_that_meet_get_past_one_another(team: str, robot: dict[str, Any]) -> None:
    count = 2 if team == "bug1_pair" else 4
    run = run_team(team, "circle_swap", {**WIDE, **robot, "robots.count": count}, robots=count, max_steps=2000)
    assert "success" in run.outcomes and "collision" not in run.outcomes
