"""A robot among recorded pedestrians crosses their flow, from either side, whichever way they walk."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bug_gym.simulation import Simulation


def recording_of_walkers(path: Path, heading: float) -> Path:
    """Six who walk side by side, 1 m/s, for 12 s; straight along an axis where the heading is a quarter turn."""
    along = np.round([math.cos(heading), math.sin(heading)], 15)
    aside = np.array([-along[1], along[0]])
    lines = ["time_s,pedestrian,x_m,y_m"]
    for number in range(6):
        for time in range(13):
            x, y = (number - 2.5) * aside + (time - 6.0) * along
            lines.append(f"{time},{number},{x},{y}")
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


# A start lies at just the radius and 0.5 m from the border, which rounding makes too little for a radius of 0.2 m.
@pytest.mark.parametrize(("bound", "radius"), [(8.0, 0.25), (9.0, 0.2)])
@pytest.mark.parametrize("heading", [0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi])
@pytest.mark.filterwarnings("error")
def test_the_robot_crosses_from_either_side_also_where_all_walk_along_an_axis(
    heading: float, bound: float, radius: float, tmp_path: Path
) -> None:
    path = recording_of_walkers(tmp_path / "walkers.csv", heading)
    world = {"family": "replay", "path": str(path), "bounds": [-bound, -bound, bound, bound]}
    robot, lidar, time = {"radius": radius}, {"beams": 1}, {"limit": 5.0}
    simulation = Simulation({"robot": robot, "lidar": lidar, "time": time, "world": world}, 20)
    simulation.reset(seeds=range(20))
    starts, goals = simulation.world.pose[:, 0, :2], simulation.world.goal[:, 0]
    side = (goals - starts) @ [-math.sin(heading), math.cos(heading)] / np.hypot(*(goals - starts).T)
    assert np.abs(side) == pytest.approx(1.0), "straight across the flow"
    assert 5 <= (side > 0.0).sum() <= 15, "each side as likely as the other"
    for places in (starts, goals):
        assert np.abs(places).max(axis=1) == pytest.approx(bound - radius - 0.5), "at the sides, with room for the body"


@pytest.mark.parametrize("seed", range(12))
def test_rounding_shuts_no_side(seed: int, tmp_path: Path) -> None:
    """Each start lies at just its distance from the border, and rounding may have called all of one side too near."""
    rng = np.random.default_rng(seed)
    path = recording_of_walkers(tmp_path / "walkers.csv", rng.uniform(-math.pi, math.pi))
    xmin, ymin, xmax, ymax = (float(side) for side in rng.uniform([-9.0, -9.0, 7.0, 7.0], [-7.0, -7.0, 9.0, 9.0]))
    world = {"family": "replay", "path": str(path), "bounds": [xmin, ymin, xmax, ymax]}
    simulation = Simulation({"lidar": {"beams": 1}, "time": {"limit": 5.0}, "world": world}, 60)
    simulation.reset(seeds=range(60))
    robot = simulation.scenario.robot
    places, goals = simulation.world.pose[:, 0, :2], simulation.world.goal[:, 0]
    is_one_way = (goals - places) @ (goals - places)[0] > 0.0
    assert 15 <= is_one_way.sum() <= 45, "each way as likely as the other"
    gaps = [places[:, 0] - xmin, xmax - places[:, 0], places[:, 1] - ymin, ymax - places[:, 1]]
    assert np.min(gaps, axis=0) == pytest.approx(robot.radius + 0.5, abs=1e-6)
