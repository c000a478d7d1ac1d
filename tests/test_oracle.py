"""The comparison with plain oracles sees what it is there to see, and finds nothing where nothing is wrong."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import oracle
import pytest

from bug_gym.config import Bounce, Crowd, load
from bug_gym.simulation import Simulation
from bug_gym.worlds.layout import Layout, Mover

BORDER = np.array([[-10.0, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]])
WALL = np.array([[1.0, -2.0], [1.01, -2.0], [1.01, 2.0], [1.0, 2.0]])
SQUARE = np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])


def layout(**parts: Any) -> Layout:
    """A room of 20 m with what is named in it."""
    return Layout(BORDER, np.zeros((1, 3)), np.array([[9.0, 9.0]]), parts.pop("circles", np.zeros((0, 3))), **parts)


def begun(name: str, tally: oracle.Tally, seed: int = 0) -> oracle.World:
    """A world of a scenario at its start."""
    return oracle.World(Simulation(load(name, {"lidar.noise": 0.0})), seed, tally, name)


@pytest.mark.parametrize("name", ["dynamic", "crowd", "crossing", "replay", "rush", "maze"])
def test_nothing_is_found_where_nothing_is_wrong(name: str) -> None:
    tally = oracle.Tally()
    for seed in range(3):
        begun(name, tally, seed).run()
    assert tally.broken == []
    assert tally.count["range"] > 0 and tally.count["clearance"] > 0


def test_a_range_that_is_off_is_found() -> None:
    tally = oracle.Tally()
    world = begun("static", tally)
    world.simulation.world.ranges[...] += np.float32(2.0 * oracle.BOUNDS["range"])
    oracle.compare_scan(tally, world.simulation, world.layout, world.rng, "here")
    assert len(tally.broken) == 1 and "range" in tally.broken[0]


def test_a_clearance_that_is_off_is_found() -> None:
    tally = oracle.Tally()
    world = begun("static", tally)
    world.simulation.world.array("min_clearance")[:] -= 0.1  # more than it goes in a step
    world.step(np.zeros((1, 1, 2)), "here")
    assert any("clearance" in told for told in tally.broken)


def test_a_robot_inside_a_thing_or_behind_the_border_is_found() -> None:
    for place in ([0.0, 0.0], [11.0, 0.0]):
        tally = oracle.Tally()
        world = begun("disc", tally)
        world.layout = layout(circles=np.array([[0.0, 0.0, 1.0]]))
        world.simulation.world.pose[0, 0, :2] = place
        world.compare_room()
        assert len(tally.broken) == 1


def test_who_goes_through_a_thin_wall_between_two_steps_is_within_it() -> None:
    still = oracle.Still.of(layout(polygons=((WALL,),)))
    motion = Bounce(law="bounce", velocity=(10.0, 0.0))
    for outline in (0.2, SQUARE):
        here, beyond, beside = (Mover(outline, (x, y), motion) for x, y in ((0.0, 0.0), (2.0, 0.0), (0.0, 3.0)))
        assert oracle.depth(still, here, beyond) > 0.1
        assert oracle.depth(still, here, beside) <= 0.0
    ways = oracle.body_ways(np.zeros(3), np.array([2.0, 0.0, 0.0]), np.array([[0.0, 0.0, 0.2]]), 1)
    assert oracle.gap_on_the_way(still, [], ways, np.array([0.2]), 1.0) == pytest.approx(-0.2)


def test_the_gap_to_a_mover_is_that_of_where_it_is_at_the_same_time() -> None:
    """The robot goes along x, a disc along y: they pass the origin one after the other, half a step apart."""
    still, motion = oracle.Still.of(layout()), Bounce(law="bounce", velocity=(0.0, 1.0))
    ways = oracle.body_ways(np.array([-2.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0]), np.array([[0.0, 0.0, 0.2]]), 1)
    pair = Mover(0.3, (0.0, -4.0), motion), Mover(0.3, (0.0, 0.0), motion)
    gap = oracle.gap_on_the_way(still, [pair], ways, np.array([0.2]), 1.0)
    assert gap == pytest.approx(math.sqrt(2.0) - 0.5)


def test_a_disc_is_reflected_by_a_disc_at_the_angle_of_incidence() -> None:
    still = oracle.Still.of(layout(circles=np.array([[0.0, 0.0, 0.4]])))
    offset, together = 0.2, 0.7
    end = oracle.reflected(still, np.array([-5.0, offset]), np.array([1.0, 0.0]), 0.3, 10.0)
    turn = math.pi - 2.0 * math.asin(offset / together)
    contact = np.array([-math.sqrt(together**2 - offset**2), offset])
    left = 10.0 - (contact[0] + 5.0)
    assert end == pytest.approx(contact + left * np.array([math.cos(turn), math.sin(turn)]), abs=1e-9)


def test_a_mover_that_leaves_its_law_is_found() -> None:
    still, motion = oracle.Still.of(layout()), Bounce(law="bounce", velocity=(1.0, 0.0))
    velocity = np.array([[1.0, 0.0]])
    for way, broken in ((0.1, 0), (0.1 - 1e-6, 1), (0.2, 1)):
        tally = oracle.Tally()
        old, new = (oracle.Bodies((Mover(0.2, (x, 0.0), motion),), velocity) for x in (0.0, way))
        oracle.compare_step(tally, still, old, new, 0.1, "here")
        assert bool(tally.broken) == bool(broken)


def test_discs_of_a_crowd_that_change_places_are_within_one_another() -> None:
    motion = Crowd(law="crowd", speed=1.0)
    old = [Mover(0.3, (x, 0.0), motion) for x in (-1.0, 1.0)]
    assert oracle.depth_of_crowd(old, old[::-1]).tolist() == pytest.approx([0.6])
    assert oracle.depth_of_crowd(old, old).tolist() == pytest.approx([0.6 - 2.0])


def test_what_is_no_number_breaks_a_bound() -> None:
    tally = oracle.Tally()
    tally.add("range", [0.0, math.nan], "here")
    assert tally.broken


@pytest.mark.parametrize(("bound", "code"), [(1e-4, 0), (0.0, 1)])
def test_the_script_fails_where_a_bound_is_broken(bound: float, code: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(oracle.BOUNDS, "range", bound)
    static = {"static": Simulation(load("static", {"lidar.noise": 0.0}))}
    monkeypatch.setattr(oracle, "single_robot_scenarios", lambda: static)
    assert oracle.main(["--worlds", "2"]) == code
