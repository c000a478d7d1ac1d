"""What the bounds of bug-bounds are made of, in worlds whose contours are known."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from bug_gym.config import load
from bug_gym.reproductions.bug_bounds import BOUNDS, COMPLETE, Contours, Found, Hit, hits_of, local_minima
from bug_gym.simulation import Simulation

C = 0.5
GOAL = shapely.Point(20.0, 0.0)
SLAB = {
    "world": {
        "family": "explicit",
        "bounds": [-100, -100, 100, 100],
        "polygons": [[[8, -3], [12, -3], [12, 5], [8, 5]]],
        "start": [0, 0, 0],
        "goal": [20, 0],
    }
}
PERIMETER = 2.0 * (4.0 + 8.0) + 2.0 * math.pi * C


def slab() -> Contours:
    """The contours of one rectangle in the open."""
    simulation = Simulation(load(SLAB), 1)
    simulation.reset(seeds=[0])
    return Contours.of(simulation.world.layout(0), C)


def ring_of(shape: shapely.Polygon) -> shapely.LinearRing:
    """A polygon's outline."""
    return shapely.LinearRing(shape.exterior.coords)


@pytest.mark.parametrize(
    ("shape", "count"),
    [
        (shapely.Point(10.0, 3.0).buffer(3.0, quad_segs=64), 1),
        (GOAL.buffer(3.0, quad_segs=64), 1),
        (shapely.box(8.0, -3.0, 12.0, 5.0), 2),  # nearest on the face toward the goal, and on the one behind it
        (shapely.box(8.0, 1.0, 12.0, 5.0), 1),  # the goal is square to neither: one corner is the nearest
        (shapely.Point(20.0, 0.0).buffer(5.0).difference(shapely.box(18.0, -9.0, 22.0, 9.0)).geoms[0], 1),
    ],
)
def test_the_distance_to_the_goal_has_as_many_minima_on_a_contour_as_its_shape_says(
    shape: shapely.Polygon, count: int
) -> None:
    assert local_minima(ring_of(shape), GOAL) == count


def test_the_minima_are_those_of_a_finely_sampled_contour() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, 14))
        radii = rng.uniform(1.0, 6.0, 14)
        shape = shapely.Polygon(np.stack([12.0 + radii * np.cos(angles), radii * np.sin(angles)], axis=1)).buffer(C)
        fine = np.array(
            [GOAL.distance(shapely.Point(*p)) for p in shapely.segmentize(shape.exterior, 0.02).coords[:-1]]
        )
        lower = (fine < np.roll(fine, 1)) & (fine <= np.roll(fine, -1))
        # Without a threshold sampling counts shallow ones too: never fewer.
        assert 1 <= local_minima(ring_of(shape), GOAL) <= lower.sum()


def test_each_claim_on_one_rectangle_is_its_formula() -> None:
    contours, hits = slab(), [Hit(PERIMETER, 10.0), Hit(PERIMETER, 1.5 * PERIMETER)]
    expected = {
        "bug1": 1.5 * PERIMETER,
        "bug2": PERIMETER,
        "vis_bug_21": PERIMETER,
        "alg1": 2.0 * PERIMETER,
        "alg2": 2.0 * PERIMETER,
        "rev1": 2.0 * PERIMETER,
        "com1": 2.0 * PERIMETER,
        "class1": 2.0 * PERIMETER,
        "dist_bug": (1.5 + 2.5) * PERIMETER,
        "tangent_bug": 3.0 * PERIMETER,
    }
    assert expected.keys() == BOUNDS.keys()
    for policy, beyond in expected.items():
        assert BOUNDS[policy][1](contours, hits) == pytest.approx(20.0 + beyond, rel=1e-3), policy


def test_every_complete_bug_but_two_claims_a_bound() -> None:
    assert set(COMPLETE) - set(BOUNDS) == {"vis_bug_22", "hd_bug"}


def test_the_way_along_a_wall_is_what_is_not_walked_straight() -> None:
    # Hit at (7.5, 0) in the world, half round in 15 m, left at (12.5, 0); the start looks left.
    memory = SimpleNamespace(hits=[(0.0, -7.5)], leaves=[(0.0, -12.5)], hit_odometers=[7.5], odometer=30.0)
    (hit,) = hits_of(memory, slab(), np.array([0.0, 0.0, 0.5 * math.pi]), (0.0, -20.0))
    assert hit.perimeter == pytest.approx(PERIMETER, rel=1e-3)
    assert hit.walked == pytest.approx(15.0)


@pytest.mark.parametrize("policy", BOUNDS)
def test_a_way_longer_than_the_claim_is_a_fault(policy: str) -> None:
    def faults(length: float) -> list[str]:
        return Found(policy, "maze", 0, "success", "", length, 20.0, 40.0, True, False).faults

    assert faults(40.0) == []
    assert faults(43.0) == [f"longer than {BOUNDS[policy][0]}"]
