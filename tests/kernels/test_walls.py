"""Walls of polygons with holes, of which a row has each corner once: as they are told, seen and touched."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.simulation import Simulation

F64 = NDArray[np.float64]

SHELL = [[-6.0, -5.0], [5.0, -5.0], [5.0, 4.0], [-6.0, 4.0]]
ROOM = [[-1.0, -2.0], [-1.0, 2.0], [3.0, 2.0], [3.0, -2.0]]
OTHER_ROOM = [[-5.0, -4.0], [-5.0, 3.0], [-2.0, 3.0], [-2.0, -4.0]]
TRIANGLE = [[-9.0, 5.0], [-7.0, 5.0], [-8.0, 6.0]]
BORDER = [[-10.0, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]]
MOVER = {
    "shape": {"polygon": [[-0.5, -0.5], [0.5, -0.5], [0.0, 0.5]]},
    "at": [-3.5, -1.0],
    "motion": {"law": "bounce", "velocity": [0.0, 0.25]},
}


def rooms(*movers: Any) -> Simulation:
    """A polygon with two rooms in it, in one of which the robot is, and a triangle outside."""
    polygons = [{"shell": SHELL, "holes": [ROOM, OTHER_ROOM]}, TRIANGLE]
    world = {"family": "explicit", "polygons": polygons, "movers": list(movers), "start": [0, 0, 0], "goal": [2, 1.5]}
    lidar = {"beams": 8, "range": 9.0}
    simulation = Simulation({"robot": {"radius": 0.2, "max_speed": 1.0}, "lidar": lidar, "world": world})
    simulation.reset(seeds=[0])
    return simulation


def sides(rings: list[list[list[float]]]) -> list[list[list[float]]]:
    """Both ends of each side of rings, in an order of their own."""
    return ordered(np.concatenate([np.hstack([ring, np.roll(ring, -1, axis=0)]) for ring in map(np.array, rings)]))


def ordered(walls: F64) -> list[list[list[float]]]:
    """The same of walls (n, 4)."""
    return sorted(sorted(ends) for ends in walls.round(9).reshape(-1, 2, 2).tolist())


@pytest.mark.parametrize("movers", [[], [MOVER]])
def test_walls_are_the_sides_of_all_rings_also_of_one_that_moves(movers: list[Any]) -> None:
    simulation = rooms(*movers)
    for _ in range(5):
        simulation.step(np.zeros((1, 1, 2)))
    world = simulation.world
    way = 0.25 * float(world.time[0])
    moved = [(np.array(m["shape"]["polygon"]) + m["at"] + np.array([0.0, way])).tolist() for m in movers]
    assert ordered(world.wall[0, : world.wall_count[0]]) == sides([BORDER, SHELL, ROOM, OTHER_ROOM, TRIANGLE, *moved])
    layout = world.layout(0)
    assert [[ring.tolist() for ring in rings] for rings in layout.polygons] == [[SHELL, ROOM, OTHER_ROOM], [TRIANGLE]]


@pytest.mark.parametrize("movers", [[], [MOVER]])
def test_in_a_hole_only_its_own_walls_are_seen(movers: list[Any]) -> None:
    near, far = math.sqrt(2.0), 2.0 * math.sqrt(2.0)
    assert rooms(*movers).world.ranges[0, 0] == pytest.approx([3.0, far, 2.0, near, 1.0, near, 2.0, far])


def test_from_outside_the_walls_of_holes_are_hidden_and_none_leads_from_ring_to_ring() -> None:
    simulation = rooms()
    simulation.world.pose[0, 0] = [8.0, 0.0, 0.0]
    simulation.step(np.zeros((1, 1, 2)))
    ranges = simulation.world.ranges[0, 0]
    assert ranges[[0, 4]] == pytest.approx([2.0, 3.0])


@pytest.mark.parametrize(("heading", "room"), [(0.0, 3.0), (0.5 * math.pi, 2.0), (math.pi, 1.0), (-0.5 * math.pi, 2.0)])
def test_a_robot_runs_into_the_walls_of_the_hole_that_it_is_in(heading: float, room: float) -> None:
    simulation = rooms()
    world = simulation.world
    world.pose[0, 0, 2] = heading
    assert world.array("min_clearance")[0, 0] == pytest.approx(0.8)
    way = 0.0
    while world.active[0, 0]:
        simulation.step(np.array([[[1.0, 0.0]]]))
        way = float(np.hypot(*world.pose[0, 0, :2]))
    assert way == pytest.approx(room - 0.2)


# ------------------------------------------------------------------------------------------------ the border as a room

FIFTH = [
    [-3.0, -2.0],
    [1.0, -2.0],
    [4.0, -2.0],
    [4.0, 2.5],
    [-3.0, 2.5],
]  # the rectangle -3, -2, 4, 2.5 with one more corner


@pytest.mark.parametrize("polygons", [[], [[[1.0, 0.5], [2.0, 0.5], [2.0, 1.5]]]])
@pytest.mark.parametrize("reach", [1.2, 10.0])
def test_a_rectangular_border_is_seen_and_touched_as_the_same_ring_with_a_corner_more(
    reach: float, polygons: list[list[list[float]]]
) -> None:
    rng = np.random.default_rng(3)
    actions = rng.uniform(-1.0, 1.0, (400, 1, 1, 2))
    actions[..., 0] = 0.5 + 0.5 * actions[..., 0]
    seen: list[list[F64]] = []
    for bounds in ([-3.0, -2.0, 4.0, 2.5], FIFTH):
        world = {
            "family": "explicit",
            "bounds": bounds,
            "polygons": polygons,
            "start": [0, -1, 0.3],
            "goal": [-2.5, 2.0],
        }
        lidar = {"beams": 61, "range": reach}
        simulation = Simulation({"robot": {"radius": 0.2, "max_speed": 1.0}, "lidar": lidar, "world": world})
        told, collisions = [simulation.reset(seeds=[0])[0, 0].astype(np.float64)], 0
        for action in actions:
            told.append(simulation.step(action).observation[0, 0].astype(np.float64))
            told.append(np.array([simulation.info()["min_clearance"][0, 0]]))
            if not simulation.world.active[0, 0]:
                collisions += int(simulation.info()["collision"][0, 0])
                simulation.reset(seeds=[0])
        assert collisions > 3
        seen.append(told)
    assert all(one == pytest.approx(other, abs=1e-6) for one, other in zip(*seen, strict=True))
