"""Contacts with what stands still: none on the first seeds, and one that is there is counted."""

import pytest

from bug_gym.policy import Memory, ScriptedPolicy, Velocity
from bug_gym.reproductions import reproduction, still_things
from bug_gym.reproductions.result import Settings
from bug_gym.view import View


def test_nothing_is_touched_on_the_first_seeds() -> None:
    result = reproduction("still-things")(Settings(seeds=16, policies=("bug2", "tangent_bug", "dist_bug", "a_star")))
    assert result.holds and result.data["touched"] == []
    for name, line in result.data["policies"].items():
        assert line["driven"] + line["refused"] == 16, name
        assert line["driven"] == line["arrived"] + line["gave up"] + line["out of time"], name
        assert line["arrived"] > 0.3 * line["driven"], name
    assert result.data["policies"]["a_star"]["refused"] == 0  # which reads the map
    assert [row[0] for row in result.tables[0].rows] == ["bug2", "tangent_bug", "dist_bug", "a_star (privileged)"]
    for kinds in (one for of_policy in result.data["kinds"].values() for one in of_policy.values()):
        assert sum(line["driven"] + line["refused"] for line in kinds.values()) == 16


def test_whoever_runs_into_things_is_told() -> None:
    result = reproduction("still-things")(Settings(seeds=8, policies=(f"{__file__}:Blind",)))
    (line,) = result.data["policies"].values()
    assert line["touched"] == len(result.data["touched"]) > 0
    assert not result.holds


class Blind(ScriptedPolicy):
    """Straight to the goal, whatever stands there."""

    room = None

    def start(self) -> Memory:
        """A memory of nothing."""
        return Memory()

    def act(self, view: View, memory: Memory) -> Velocity:
        """Full speed to the goal."""
        speed = self.sensors.drive.max_speed
        x, y = view.to_robot(*view.goal_position)
        return speed * x / view.goal_distance, speed * y / view.goal_distance


@pytest.mark.parametrize("seed", range(40))
def test_robots_are_of_the_kinds_that_are_told(seed: int) -> None:
    robot = still_things.robot(seed)
    assert 0.5 <= robot["robot.max_speed"] <= 2.0
    assert robot["robot.max_acceleration"] is None or 0.5 <= robot["robot.max_acceleration"] <= 5.0
    assert robot["time.step"] in (0.05, 0.1, 0.2) and robot["lidar.beams"] in (32, 64, 180, 360)
    assert 0.0 <= robot["lidar.noise"] <= 0.03 and 0.0 <= robot["lidar.dropout"] <= 0.05
    assert all(robot == still_things.robot(seed) for _ in range(2))
