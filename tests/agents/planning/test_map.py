"""The map that planners get: what stands where, in which frame, and whose it is."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import shapely
from ros_maps import write_map

from bug_gym.agents.planning.live import LiveMap, Maps
from bug_gym.agents.planning.map import PlanningMap
from bug_gym.robots_env import parallel_env
from bug_gym.simulation import Simulation
from bug_gym.vector_env import NavigationVectorEnv
from bug_gym.worlds.ros_files import FREE, OCCUPIED, UNKNOWN

WORLD = {
    "family": "explicit",
    "bounds": [-5, -5, 15, 5],
    "circles": [[4.0, 1.0, 0.8]],
    "polygons": [[[7, -2], [8, -2], [8, 1], [7, 1]]],
    "movers": [
        {"shape": {"circle": 0.4}, "at": [2.0, 3.0], "motion": {"law": "bounce", "velocity": [0.5, 0.0]}},
        {
            "shape": {"polygon": [[-0.5, -0.2], [0.5, -0.2], [0.0, 0.4]]},
            "at": [10.0, 2.0],
            "motion": {"law": "bounce", "velocity": [0.0, -0.3]},
        },
    ],
    "regions": [{"circle": [1.0, -3.0, 1.0], "factor": 3.0}],
    "start": [1.0, 2.0, 0.5 * math.pi],
    "goal": [12.0, 0.0],
}


def live(world: dict[str, Any] = WORLD, **overrides: Any) -> tuple[Simulation, LiveMap]:
    """A world that has begun, and its map."""
    simulation = Simulation({"world": world, **overrides})
    simulation.reset(seeds=[0])
    return simulation, Maps(simulation).of_robot(0)


def in_start_frame(x: float, y: float) -> tuple[float, float]:
    """A place of WORLD as its robot sees it, which stands at (1, 2) and looks along y."""
    return y - 2.0, -(x - 1.0)


def test_a_live_map_is_in_the_frame_of_the_start() -> None:
    _, here = live()
    np.testing.assert_allclose(here.still.discs, [[*in_start_frame(4.0, 1.0), 0.8]], atol=1e-12)
    ((shell,),) = here.still.polygons
    np.testing.assert_allclose(shell, [in_start_frame(*corner) for corner in [(7, -2), (8, -2), (8, 1), (7, 1)]])
    (ground,) = here.still.regions
    assert ground.factor == 3.0 and ground.disc == pytest.approx((*in_start_frame(1.0, -3.0), 1.0))
    assert here.goal == pytest.approx(in_start_frame(12.0, 0.0))
    assert here.pose == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


def test_movers_are_told_where_they_are_now_and_the_map_stays_what_it_was() -> None:
    simulation, here = live()
    before = here.still.discs.copy(), simulation.world.floats.copy(), simulation.world.ints.copy()
    first = here.movers()
    np.testing.assert_allclose(first.discs[0], [*in_start_frame(2.0, 3.0), 0.4], atol=1e-12)
    np.testing.assert_allclose(first.velocities, [[0.0, -0.5], [-0.3, 0.0]], atol=1e-12)
    assert first.is_round.tolist() == [True, False]
    np.testing.assert_array_equal(simulation.world.floats, before[1])
    np.testing.assert_array_equal(simulation.world.ints, before[2])
    for _ in range(10):
        simulation.step(np.zeros((1, 1, 2)))
    now = here.movers()
    np.testing.assert_allclose(now.discs[:, :2], first.discs[:, :2] + 1.0 * first.velocities, atol=1e-9)
    np.testing.assert_allclose(now.polygons[0][0], first.polygons[0][0] + (-0.3, 0.0), atol=1e-9)
    np.testing.assert_array_equal(here.still.discs, before[0])
    assert len(here.now().discs) == 2 and len(here.now().polygons) == 2


def test_a_map_that_is_read_on_the_way_is_in_the_same_frame() -> None:
    simulation, here = live()
    for _ in range(5):
        simulation.step(np.array([[[0.7, 0.2]]]))
    later = Maps(simulation).of_robot(0)
    np.testing.assert_allclose(later.start, here.start, atol=1e-9)
    np.testing.assert_allclose(later.pose, simulation.world.odometry[0, 0], atol=1e-9)


def test_grown_obstacles_hold_the_true_ones_and_half_a_per_cent_more() -> None:
    square = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    border = np.array([[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]])
    plan = PlanningMap(border, np.array([[5.0, 5.0, 1.0]]), ((square,),))
    for margin in (0.0, 0.3, 1.0):
        inside, (disc, polygon) = plan.grown(margin)
        true = [
            shapely.Point(5.0, 5.0).buffer(1.0 + margin, quad_segs=200),
            shapely.Polygon(square).buffer(margin, 200),
        ]
        for grown, exact in zip((disc, polygon), true, strict=True):
            assert grown.contains(exact.buffer(-1e-4))
            assert grown.hausdorff_distance(exact) <= 0.005 * (1.0 + margin) + 1e-4
        assert shapely.box(-9 + margin, -9 + margin, 9 - margin, 9 - margin).buffer(1e-9).contains(inside)
    with pytest.raises(ValueError, match="a margin is at least 0 m, got -1"):
        plan.grown(-1.0)


def test_what_reads_a_map_cannot_write_to_it() -> None:
    simulation, here = live(WORLD)
    for plan in (
        here.still,
        here.now(),
        PlanningMap.of_layout(simulation.world.layout(0)),
        here.still.seen_from((1, 2, 3)),
    ):
        for array in (plan.border, plan.discs, *(ring for rings in plan.polygons for ring in rings)):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0.0


def test_a_recorded_scan_is_a_map() -> None:
    simulation, here = live({**WORLD, "movers": []}, lidar={"beams": 720, "range": 12.0})
    angles = 2.0 * np.pi * np.arange(720) / 720
    seen = PlanningMap.of_scan(angles, simulation.world.ranges[0, 0], reach=12.0)
    hits = shapely.points(seen.discs[:, :2])
    exact = shapely.union_all([*here.still.shapes(), shapely.Polygon(here.still.border).exterior])
    assert len(hits) > 300 and shapely.distance(hits, exact).max() < 0.02
    for angle, bad, words in [([0.0], [1.0, 2.0], "as many ranges"), ([], [], "as many ranges")]:
        with pytest.raises(ValueError, match=words):
            PlanningMap.of_scan(angle, bad, reach=3.0)
    with pytest.raises(ValueError, match="reach must be above 0"):
        PlanningMap.of_scan([0.0], [1.0], reach=0.0)


@pytest.mark.parametrize("turn", [0.0, 0.5])
def test_a_map_of_ros_is_its_walls_within_the_outline_of_its_picture(tmp_path: Path, turn: float) -> None:
    """A wall of 2 x 40 cells of 0.1 m across a picture of 60 x 50; nobody knows what is above row 45."""
    cells = np.full((50, 60), FREE)
    cells[0:40, 30:32] = OCCUPIED
    cells[45:] = UNKNOWN
    path = write_map(tmp_path, cells, resolution=0.1, origin=[-1.0, 2.0, turn])

    def there(x: float, y: float) -> tuple[float, float]:
        return -1.0 + math.cos(turn) * x - math.sin(turn) * y, 2.0 + math.sin(turn) * x + math.cos(turn) * y

    plan, careful = PlanningMap.of_ros(path), PlanningMap.of_ros(path, unknown_is_wall=True)
    np.testing.assert_allclose(plan.border, [there(*at) for at in [(0, 0), (6, 0), (6, 5), (0, 5)]], atol=1e-9)
    wall = shapely.Polygon([there(*at) for at in [(3.0, 0.0), (3.2, 0.0), (3.2, 4.0), (3.0, 4.0)]])
    unknown = shapely.Polygon([there(*at) for at in [(0.0, 4.5), (6.0, 4.5), (6.0, 5.0), (0.0, 5.0)]])
    assert shapely.union_all(plan.shapes()).symmetric_difference(wall).area < 1e-6
    assert shapely.union_all(careful.shapes()).symmetric_difference(wall | unknown).area < 1e-6
    assert plan.clearance_at(there(1.0, 2.5)) == pytest.approx(1.0) == careful.clearance_at(there(1.0, 2.5))
    assert plan.clearance_at(there(1.0, 4.4)) == pytest.approx(0.6)
    assert careful.clearance_at(there(1.0, 4.4)) == pytest.approx(0.1)
    # Over the wall's end: a tangent, an arc about its corner, the wall's width, and the same down again.
    away, down = math.hypot(2.0, 2.0), math.hypot(1.8, 2.0)
    legs = sum(math.sqrt(length**2 - 0.2**2) for length in (away, down))
    turns = sum(math.asin(2.0 / length) + math.asin(0.2 / length) for length in (away, down))
    way = plan.shortest_path(there(1.0, 2.0), there(5.0, 2.0), radius=0.2)
    assert way.length == pytest.approx(legs + 0.2 * turns + 0.2, abs=1e-3)
    with pytest.raises(ValueError, match="none.yaml"):
        PlanningMap.of_ros(tmp_path / "none.yaml")


def test_each_robot_of_each_row_has_its_own_map() -> None:
    simulation = Simulation("static", 3)
    flat = simulation.reset(seeds=[4, 5, 6])[:, 0]
    maps = Maps(simulation)
    for number in range(3):
        assert maps.robot_behind(flat, number) == number
        assert maps.robot_behind(flat[number][None], 0) == number
        still = maps.of_robot(number).still
        assert len(still.discs) + len(still.polygons) > 0
    with pytest.raises(ValueError, match="number 0 is none of theirs"):
        maps.robot_behind(flat[:1] + 1.0, 0)
    with pytest.raises(ValueError, match="expected a robot from 0 to 2, got 3"):
        maps.of_robot(3)
    with pytest.raises(ValueError, match="row 0 has no episode yet"):
        Maps(Simulation("static")).of_robot(0)


def test_worlds_that_look_alike_are_not_guessed_at() -> None:
    far = {"family": "field", "bounds": [0, 0, 60, 60], "start": [5, 5, 0], "goal": [55, 55], "obstacles": 3}
    simulation = Simulation({"world": far, "lidar": {"range": 0.5}}, 2)
    flat = simulation.reset(seeds=[0, 1])[:, 0]
    maps = Maps(simulation)
    assert [maps.robot_behind(flat, number) for number in (0, 1)] == [0, 1]
    with pytest.raises(ValueError, match="see the same in different worlds"):
        maps.robot_behind(flat[:1], 0)


def test_every_face_has_maps_and_a_scenario_has_none() -> None:
    robots = parallel_env("crossing_robots")
    for env in (gym.make("BugGym/Static-v0"), NavigationVectorEnv(2), robots, Simulation("static")):
        assert isinstance(Maps.of(env, "a_star").simulation, Simulation)
    for scenario in ("static", {"world": WORLD}, Simulation("static").scenario):
        with pytest.raises(ValueError, match="policy 'a_star' reads the map of a live world: expected an env"):
            Maps.of(scenario, "a_star")
    with pytest.raises(ValueError, match="expected an env of bug_gym"):
        Maps.of(5, "a_star")


def test_other_robots_are_movers() -> None:
    simulation = Simulation("crossing_robots")
    simulation.reset(seeds=[0])
    here = Maps(simulation).of_robot(1)
    moving = here.movers()
    others = simulation.world.pose[0, [k for k in range(simulation.robots) if k != 1], :2]
    distances = np.sort(np.hypot(*(others - simulation.world.pose[0, 1, :2]).T))
    np.testing.assert_allclose(np.sort(np.hypot(*moving.discs[:, :2].T)), distances)
    assert here.has_movers
