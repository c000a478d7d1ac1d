"""What a robot ran into, in worlds where it is plain."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bug_gym.reproductions.collisions import Contact, contact
from bug_gym.simulation import Simulation

ROBOT = {"robot.kinematics": "differential", "robot.radius": 0.2}
STANDING, AHEAD = [-0.53846154, 0.0], [1.0, 0.0]  # reverse is 0.3 of 1.3 m/s
SQUARE = [[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]]


def crash(action: list[float], **world: Any) -> Contact:
    """Drives on with one action until the robot touches something."""
    family = {"family": "explicit", "bounds": [-5, -5, 5, 5], "start": [0, 0, 0], "goal": [0, 4], **world}
    simulation = Simulation({"world": family}, overrides=ROBOT)
    simulation.reset(seeds=[0])
    for _ in range(200):
        before = simulation.world.pose[0, 0, :2].copy()
        simulation.step([[action]])
        if simulation.info()["collision"][0, 0]:
            return contact(simulation.world, 0, before)
    raise AssertionError("nothing was touched")


def mover(shape: dict[str, Any], at: list[float], velocity: list[float]) -> dict[str, Any]:
    return {"shape": shape, "at": at, "motion": {"law": "bounce", "velocity": velocity}}


@pytest.mark.parametrize("world", [{}, {"circles": [[3, 0, 0.5]]}, {"polygons": [[[3, -1], [4, -1], [4, 1], [3, 1]]]}])
def test_border_circle_and_polygon_that_stand_are_still(world: dict[str, Any]) -> None:
    # Beside the way, nearer to the start than what is hit, a mover.
    found = crash(AHEAD, movers=[mover({"circle": 0.3}, [0, -2], [0.1, 0.0])], **world)
    assert found.kind == "still" and found.its_speed == 0.0


@pytest.mark.parametrize("shape", [{"circle": 0.3}, {"polygon": SQUARE}])
@pytest.mark.parametrize(
    ("action", "velocity", "kind"),
    [
        (STANDING, [-0.5, 0.0], "mover, it closing"),
        (AHEAD, [-0.5, 0.0], "mover, both closing"),
        (AHEAD, [0.2, 0.0], "mover, robot closing"),
    ],
)
def test_who_closes_in_on_whom_is_told(
    shape: dict[str, Any], action: list[float], velocity: list[float], kind: str
) -> None:
    found = crash(action, movers=[mover(shape, [2.0, 0.0], velocity)], polygons=[[[0, 1], [1, 1], [1, 2], [0, 2]]])
    assert found.kind == kind
    assert found.its_speed == pytest.approx(-velocity[0], abs=1e-6)


def test_speeds_are_those_toward_the_other() -> None:
    # The robot drives along x, the mover comes down along y: each closes by its own part of the line between them.
    found = crash(AHEAD, movers=[mover({"circle": 0.5}, [1.0, 1.0], [0.0, -0.9])])
    assert 0.0 < found.own_speed < 1.0 and 0.0 < found.its_speed < 0.9
    assert np.hypot(found.own_speed / 1.0, found.its_speed / 0.9) == pytest.approx(1.0, abs=0.05)
