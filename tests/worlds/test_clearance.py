"""What is free in a world, against the slow plain rules: no side nearer than the room, in the border, in no polygon."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bug_gym.geometry import F64
from bug_gym.simulation import Simulation
from bug_gym.worlds.clearance import clearance, contains, is_clear, obstacles_of


def plain_distance(ring: F64, x: float, y: float) -> float:
    """To the nearest side, one side at a time."""
    nearest = math.inf
    for (ax, ay), (bx, by) in zip(ring.tolist(), [*ring[1:].tolist(), ring[0].tolist()], strict=True):
        length = (bx - ax) ** 2 + (by - ay) ** 2
        share = min(max(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length, 0.0), 1.0) if length else 0.0
        nearest = min(nearest, math.hypot(ax + share * (bx - ax) - x, ay + share * (by - ay) - y))
    return nearest


def plain_inside(ring: F64, x: float, y: float) -> bool:
    """Whether a ray to the right crosses an odd number of sides."""
    crossings = 0
    for (ax, ay), (bx, by) in zip(ring.tolist(), [*ring[1:].tolist(), ring[0].tolist()], strict=True):
        crossings += (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay)
    return crossings % 2 == 1


@pytest.mark.parametrize("name", ["rooms", "urban", "u_trap", "static"])
def test_a_place_is_free_by_the_plain_rules(name: str) -> None:
    simulation, rng = Simulation(name), np.random.default_rng(1)
    simulation.reset(seeds=[4])
    layout = simulation.world.layout(0)
    circles, polygons = obstacles_of(layout.circles, layout.polygons, layout.movers)
    low, high = layout.border.min(axis=0) - 0.5, layout.border.max(axis=0) + 0.5
    found = set()
    for room in (0.0, 0.3):
        free = is_clear(circles, polygons, layout.border, room)
        for x, y in rng.uniform(low, high, (80, 2)).tolist():
            rings = [layout.border, *(ring for polygon in polygons for ring in polygon)]
            gaps = [math.hypot(cx - x, cy - y) - radius for cx, cy, radius in circles.tolist()]
            solid = any(
                plain_inside(shell, x, y) and not any(plain_inside(hole, x, y) for hole in holes)
                for shell, *holes in polygons
            )
            near = min([*gaps, *(plain_distance(ring, x, y) for ring in rings)])
            expected = plain_inside(layout.border, x, y) and not solid and near >= room
            assert free(x, y) == expected
            assert clearance(circles, rings, x, y) == pytest.approx(near, abs=1e-12)
            found.add(expected)
    assert found == {True, False}


def test_a_hole_of_a_polygon_is_free_and_what_stands_in_it_is_not() -> None:
    def square(half: float) -> F64:
        return half * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])

    free = is_clear(np.zeros((0, 3)), ((square(4.0), square(3.0)), (square(1.0),)), square(10.0), 0.5)
    assert [free(x, 0.0) for x in (0.0, 1.4, 2.0, 2.6, 3.5, 4.4, 4.6, 9.4, 9.6, 11.0)] == [
        False, False, True, False, False, False, True, True, False, False,
    ]  # fmt: skip
    assert contains(square(1.0), 0.9, -0.9) and not contains(square(1.0), 1.1, 0.0)
