"""K-Bug: chains of vertices past an obstacle, and the shorter one of two."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import shapely
from episodes import Episode, run_episode, tolerance

from bug_gym.agents import make_policy
from bug_gym.agents.bugs.k_bug import KBug
from bug_gym.agents.walls.vertex_chain import chain_past, tangent
from bug_gym.geometry import F64, Point
from bug_gym.simulation import Simulation

C, LEAST = 0.5, 0.45
GOAL = (20.0, 0.0)

Polygon = list[tuple[float, float]]

BOX: Polygon = [(8, -4), (12, -4), (12, 5), (8, 5)]
"""A rectangle across the way."""
TRAP: Polygon = [(3, 4), (3, 3), (11, 3), (11, -3), (6, -3), (6, -4), (12, -4), (12, 4)]
"""A U that opens to the left, its arm on the left side longer by 3 m."""
BAG: Polygon = [
    (6, 2.5),
    (8, 6.5),
    (12, 6.5),
    (12, -5.3),
    (5, -3),
    (4.85, -3.5),
    (12.5, -6),
    (12.5, 7),
    (7.7, 7),
    (5.5, 2.7),
]
"""A trap whose left arm is bent twice: over its tip alone the left way is shorter, over all vertices the right one."""


def world(polygon: Polygon, start: Point = (0.0, 0.0), *, mirrored: bool = False, angle: float = 0.0) -> dict[str, Any]:
    """A polygon between a start and the goal, mirrored about the x axis, then turned about the origin."""
    cos, sin = math.cos(angle), math.sin(angle)

    def moved(points: Any) -> Any:
        there = np.asarray(points, dtype=float) * (1.0, -1.0 if mirrored else 1.0)
        return (there @ np.array([[cos, sin], [-sin, cos]])).tolist()

    explicit = {"family": "explicit", "bounds": [-35, -35, 35, 35], "polygons": [moved(polygon)]}
    explicit |= {"start": [*moved(start), angle], "goal": moved(GOAL)}
    return {"lidar": {"beams": 720, "range": 60.0}, "time": {"limit": 600.0}, "world": explicit}


def taut(places: Sequence[Point], side: int) -> float:
    """Length of the string from the first place over discs of the clearance to the last, turning away from a side [m].

    With r0 and r1 the radii at the ends of a piece d long, it is sqrt(d^2 - (r1 - r0)^2) long and leans by
    asin((r1 - r0) / d) from the line of centres; each disc adds an arc of its bend.
    """
    total, heading = 0.0, math.nan
    radii = [0.0, *[C] * (len(places) - 2), 0.0]
    for (x, y), (u, v), before, after in zip(places, places[1:], radii, radii[1:], strict=False):
        apart = math.hypot(u - x, v - y)
        now = math.atan2(v - y, u - x) + side * math.asin((after - before) / apart)
        if not math.isnan(heading):
            total += C * (side * (heading - now) % (2.0 * math.pi))
        total += math.sqrt(apart**2 - (after - before) ** 2)
        heading = now
    return total


def sampled(polygon: Polygon) -> F64:
    """Points (k, 2) along the outline of a polygon, 5 cm apart, all its corners among them."""
    ring = shapely.segmentize(shapely.Polygon(polygon).exterior, 0.05)
    return np.array(ring.coords)[:-1]


def around(convex: shapely.Polygon, side: int) -> float:
    """Length of the string from (0, 0) round one side of a convex obstacle to the goal, by the hull of them all [m]."""
    hull = shapely.MultiPoint([(0.0, 0.0), GOAL]).union(convex.buffer(C, quad_segs=512)).convex_hull
    half = shapely.box(-1.0, min(0.0, 20.0 * side), 21.0, max(0.0, 20.0 * side))
    return float(hull.exterior.intersection(half).length)


# ------------------------------------------------------------------------------------------------ chains


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("side", [1, -1])
def test_a_chain_is_as_long_as_the_hull_of_start_goal_and_the_grown_obstacle(seed: int, side: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.uniform((6.0, -4.0), (14.0, 4.0), (8, 2))
    hull = shapely.MultiPoint(np.vstack([corners, [[10.0, 4.0], [10.0, -4.0]]])).convex_hull
    points = sampled(list(hull.exterior.coords)[:-1])
    legs = [tangent((0.0, 0.0), (float(x), float(y)), side, (0.0, C)).heading for x, y in points]
    first = points[int(np.argmax(side * np.array(legs)))]
    chain = chain_past(points, (float(first[0]), float(first[1])), GOAL, side, C, C - 1e-6)
    assert chain.length == pytest.approx(around(hull, side), abs=2e-3)
    outline = {(round(x, 9), round(y, 9)) for x, y in hull.exterior.coords}
    bends = {(round(x, 9), round(y, 9)) for x, y in chain.vertices}
    assert bends & outline, "a string bends at corners"


def test_without_anything_behind_the_first_vertex_the_chain_ends_there() -> None:
    chain = chain_past(np.empty((0, 2)), (8.0, 3.0), GOAL, 1, C, LEAST)
    assert chain.vertices == ((8.0, 3.0),)
    assert chain.length == pytest.approx(taut([(0.0, 0.0), (8.0, 3.0), GOAL], 1), abs=1e-9)


def test_a_chain_in_a_pocket_goes_over_its_tip_and_its_corner() -> None:
    # Seen from (8, 0) in the trap: both arms' inner sides and the base; counted from there.
    seen = sampled(TRAP)
    seen = seen[(seen[:, 0] >= 3.0) & (seen[:, 0] <= 11.0) & (np.abs(seen[:, 1]) <= 3.0)] - (8.0, 0.0)
    chain = chain_past(seen, (-5.0, 3.0), (12.0, 0.0), 1, C, LEAST)
    assert chain.vertices[0] == (-5.0, 3.0) and chain.vertices[-1] == pytest.approx((3.0, 3.0))
    assert chain.length == pytest.approx(taut([(0.0, 0.0), (-5.0, 3.0), (3.0, 3.0), (12.0, 0.0)], 1), abs=1e-6)


# ------------------------------------------------------------------------------------------------ ways


BOX_WAYS = {1: [(0.0, 0.0), (8, 5), (12, 5), GOAL], -1: [(0.0, 0.0), (8, -4), (12, -4), GOAL]}
INSIDE = (8.0, 0.0)
TRAP_WAYS = {
    1: [INSIDE, (3, 3), (3, 4), (12, 4), GOAL],
    -1: [INSIDE, (6, -3), (6, -4), (12, -4), GOAL],
}
BAG_WAYS = {
    1: [INSIDE, (6, 2.5), (5.5, 2.7), (7.7, 7), (12.5, 7), GOAL],
    -1: [INSIDE, (5, -3), (4.85, -3.5), (12.5, -6), GOAL],
}
WAYS: dict[str, tuple[Polygon, dict[int, list[Any]]]] = {
    "rectangle": (BOX, BOX_WAYS),
    "u": (TRAP, TRAP_WAYS),
    "bag": (BAG, BAG_WAYS),
}


@pytest.mark.parametrize("name", WAYS)
@pytest.mark.parametrize(("mirrored", "angle"), [(False, 0.0), (True, 0.7)])
@pytest.mark.parametrize("turn", ["left", "right"])
def test_the_shorter_chain_is_taken_and_its_length_is_that_of_the_taut_string(
    name: str, mirrored: bool, angle: float, turn: str
) -> None:
    polygon, ways = WAYS[name]
    left, right = taut(ways[1], 1), taut(ways[-1], -1)
    assert right < left - 0.5
    episode = run_episode("k_bug", world(polygon, ways[1][0], mirrored=mirrored, angle=angle), turn=turn, clearance=C)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(right, abs=tolerance(right))
    assert {collision.side for collision in episode.memory.collisions[:1]} == {1 if mirrored else -1}


@pytest.mark.parametrize("height", [1.5, -1.5])
def test_an_oblique_rectangle_that_shows_two_faces_is_passed_by_the_shorter_chain(height: float) -> None:
    cos, sin = math.cos(0.9), math.sin(0.9)
    box = [(10.0 + cos * x - sin * y, height + sin * x + cos * y) for x, y in ((-2, -4), (2, -4), (2, 4), (-2, 4))]
    bearings = [math.atan2(y, x) for x, y in box]
    assert sorted(range(4), key=bearings.__getitem__)[::3] == [0, 2], "its ends in sight have a corner between them"
    lengths = {side: around(shapely.Polygon(box), side) for side in (1, -1)}
    assert abs(lengths[1] - lengths[-1]) > 0.5
    episode = run_episode("k_bug", world(box), clearance=C)
    shortest = min(lengths.values())
    assert episode.full_length == pytest.approx(shortest, abs=tolerance(shortest))


def test_one_vertex_alone_would_choose_the_other_side_of_the_bag() -> None:
    tips = [math.dist(INSIDE, way[1]) + math.dist(way[1], GOAL) for way in (BAG_WAYS[1], BAG_WAYS[-1])]
    assert tips[0] < tips[1]
    episode = run_episode("e_bug", world(BAG, INSIDE), clearance=C, max_steps=2)
    assert episode.memory.sub_goals[0][1] > 0.0


@pytest.mark.parametrize(("elsewhere", "sides"), [(2.0, [-1, 1, -1, 1]), (0.0, [-1, -1, -1, -1])])
def test_at_a_collision_point_met_again_it_takes_the_other_side(elsewhere: float, sides: list[int]) -> None:
    """Once it has been elsewhere in between; else it is the same collision, looked at again."""
    simulation = Simulation(world(BOX), 1)
    policy = make_policy("k_bug", simulation, clearance=C)
    flat, state = simulation.reset(seeds=[0]), None
    while state is None or len(state[0].collisions) < len(sides):
        known = 0 if state is None else len(state[0].collisions)
        action, state = policy.predict(flat[:, 0], state)
        assert state is not None
        memory: Any = state[0]
        if len(memory.collisions) > known:
            memory.corner, memory.mode = None, "motion_to_goal"
            memory.odometer += elsewhere
        flat = simulation.step(0.0 * action[:, None]).observation
    assert [collision.side for collision in memory.collisions] == sides


def first_steps(polygon: Polygon, start: Point) -> Episode:
    """K-Bug just after its first choice."""
    return run_episode("k_bug", world(polygon, start), clearance=C, max_steps=3)


def test_it_draws_the_chain_that_it_chose() -> None:
    episode = first_steps(BAG, INSIDE)
    policy = make_policy("k_bug", episode.simulation)
    assert isinstance(policy, KBug)
    segments = policy.draw(episode.memory).segments
    assert len(episode.memory.chain) >= 2 and len(segments) == len(episode.memory.chain) - 1
