"""Grids: which cells are blocked and which steps are open, against slow plain answers; and ways that are followed."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest

from bug_gym.agents import make_policy
from bug_gym.agents.planning.follow import LOOKAHEAD, PurePursuit, Scene, make_follower
from bug_gym.agents.planning.grid import Grid, grid_of, lattice_of, make_grid, relink_nodes, with_discs
from bug_gym.agents.planning.map import PlanningMap
from bug_gym.agents.planning.route import Route, distances_to_chain
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View


def random_map(seed: int) -> PlanningMap:
    """Discs, a square with a hole and a star in a border that is not convex."""
    rng = np.random.default_rng(seed)
    border = np.array([[-0.37, -0.41], [9.3, -0.2], [9.1, 7.7], [5.2, 5.1], [0.3, 7.9]])
    discs = np.column_stack([rng.uniform(0.5, 8.5, (6, 2)), rng.uniform(0.1, 0.5, 6)])
    outer, inner = (
        np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]),
        np.array([[-0.6, -0.6], [-0.6, 0.6], [0.6, 0.6], [0.6, -0.6]]),
    )
    at = rng.uniform(2.0, 6.0, 2)
    angles = np.arange(10) * math.pi / 5.0
    star = np.column_stack([np.cos(angles), np.sin(angles)]) * np.where(np.arange(10) % 2, 0.3, 0.9)[:, None]
    return PlanningMap(border, discs, ((outer + at, inner + at), (star + rng.uniform(1.0, 7.0, 2),)))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("growth", [0.0, 0.17])
def test_a_cell_is_blocked_where_its_centre_has_less_room_than_the_body(seed: int, growth: float) -> None:
    plan = random_map(seed)
    grid = grid_of(plan, 0.21, growth)
    places = grid.lattice.places(np.arange(grid.blocked.size, dtype=np.int32))
    for (x, y), is_blocked in zip(places.tolist(), grid.blocked.ravel().tolist(), strict=True):
        room = plan.clearance_at((x, y))
        if abs(room - growth) > 1e-9:
            assert bool(is_blocked) == (room < growth), (x, y, room)


def test_a_lattice_has_a_centre_in_the_origin_and_a_blocked_rim() -> None:
    grid = grid_of(random_map(0), 0.13, 0.0)
    (origin,) = grid.lattice.places(np.array([grid.lattice.node_at((0.0, 0.0))], dtype=np.int32))
    np.testing.assert_allclose(origin, (0.0, 0.0), atol=1e-12)
    for rim in (grid.blocked[0], grid.blocked[-1], grid.blocked[:, 0], grid.blocked[:, -1]):
        assert rim.all()
    assert lattice_of((-1.0, -1.0, 1.0, 1.0), 0.5).rows >= 7


def slow_links(grid: Grid) -> list[int]:
    """The open steps of each cell by their meaning."""
    rows, columns = grid.blocked.shape
    found = [0] * (rows * columns)
    for row, column in itertools.product(range(1, rows - 1), range(1, columns - 1)):
        for step in range(8):
            down, across = round(math.sin(step * math.pi / 4.0)), round(math.cos(step * math.pi / 4.0))
            if grid.blocked[row, column] or grid.blocked[row + down, column + across]:
                continue
            beside = [not grid.blocked[row + down, column], not grid.blocked[row, column + across]]
            is_diagonal = step % 2 == 1
            is_allowed = grid.connectivity == 8 and (any(beside) if grid.cut_corners else all(beside))
            found[row * columns + column] |= int(not is_diagonal or is_allowed) << step
    return found


@pytest.mark.parametrize(("connectivity", "cut"), [(4, False), (8, False), (8, True)])
def test_steps_are_open_by_connectivity_and_corners(connectivity: int, cut: bool) -> None:
    rng = np.random.default_rng(1)
    grid = make_grid((rng.random((17, 23)) < 0.35).astype(np.uint8), connectivity=connectivity, cut_corners=cut)
    assert grid.links.tolist() == slow_links(grid)
    # The same after some cells have changed.
    inner = np.argwhere(np.ones((17, 23)))[rng.integers(17 * 23, size=12)] + 1
    grid.blocked[inner[:, 0], inner[:, 1]] ^= 1
    relink_nodes(grid, (inner[:, 0] * grid.lattice.columns + inner[:, 1]).astype(np.int32))
    assert grid.links.tolist() == slow_links(grid)


@pytest.mark.parametrize("seed", range(4))
def test_discs_that_are_added_are_obstacles_like_others_and_leave_the_grid_as_it_was(seed: int) -> None:
    plan = random_map(seed)
    discs = np.column_stack([np.random.default_rng(seed).uniform(0.0, 8.0, (4, 2)), [0.2, 0.4, 0.1, 0.6]])
    grid = grid_of(plan, 0.2, 0.15)
    before = grid.blocked.copy(), grid.links.copy()
    with_more, expected = with_discs(grid, discs, 0.15), grid_of(plan.with_obstacles(discs), 0.2, 0.15)
    np.testing.assert_array_equal(with_more.blocked, expected.blocked)
    np.testing.assert_array_equal(with_more.links, expected.links)
    np.testing.assert_array_equal(grid.blocked, before[0])
    np.testing.assert_array_equal(grid.links, before[1])


def test_the_nearest_free_cell_is_nearest() -> None:
    rng = np.random.default_rng(5)
    grid = make_grid((rng.random((30, 30)) < 0.8).astype(np.uint8))
    free = np.flatnonzero(grid.blocked.ravel() == 0).astype(np.int32)
    places = grid.lattice.places(free)
    for place in rng.uniform(0.0, 29.0, (40, 2)):
        away = np.hypot(*(places - place).T)
        found = grid.free_node_near((float(place[0]), float(place[1])), 6.0)
        ((x, y),) = grid.lattice.places(np.array([found], dtype=np.int32))
        assert math.dist((x, y), place) == pytest.approx(away.min())
    assert make_grid(np.ones((9, 9), dtype=np.uint8)).free_node_near((4.0, 4.0), 3.0) == -1


# ------------------------------------------------------------------------------------------------------------- routes


def test_a_route_is_walked_along_and_never_back() -> None:
    route = Route(np.array([[0, 0], [3, 0], [3, 0], [3, 4], [0, 4]]), margin=0.05)
    assert route.length == 10.0 and route.at(5.0) == (3.0, 2.0) and route.at(99.0) == (0.0, 4.0)
    assert route.advance(1.0, 0.5) == pytest.approx(0.5) and route.done == pytest.approx(1.0)
    # Pushed back, it is so far from the place that it had reached; what lies behind that is done with.
    assert route.advance(0.2, 0.0) == pytest.approx(0.8) and route.done == pytest.approx(1.0)
    np.testing.assert_allclose(route.ahead(3.0), [[1, 0], [3, 0], [3, 1]])
    route.advance(2.5, 0.0)
    route.advance(2.9, 1.0)
    assert route.done == pytest.approx(4.0) and route.rest == pytest.approx(6.0)
    # The end of the way is nearer, but the robot comes there only along it.
    assert Route(np.array([[0, 0], [9, 0], [9, 1], [0, 1]]), margin=0.05).advance(0.0, 0.9) == pytest.approx(0.9)
    np.testing.assert_allclose(distances_to_chain(route.places, np.array([[1.0, 1.0], [5.0, 2.0]])), [1.0, 2.0])
    assert distances_to_chain(np.array([[1.0, 1.0]]), np.array([[4.0, 5.0]])).tolist() == [5.0]


def flat_view(ranges: float = 5.0, **robot: Any) -> tuple[Sensors, View]:
    """What a robot at the origin of its frame sees that stands in the open, or in a circle about it."""
    simulation = Simulation("empty", overrides={f"robot.{name}": value for name, value in robot.items()})
    flat = simulation.reset(seeds=[0])[0, 0]
    sensors = Sensors.of(simulation.scenario)
    flat[: len(sensors.angles)] = min(ranges, sensors.range)
    return sensors, View(flat, sensors)


def test_pure_pursuit_heads_for_a_place_from_which_the_way_is_hardly_left() -> None:
    sensors, view = flat_view(99.0)
    route = Route(np.array([[0, 0], [0.2, 0], [0.2, 3.0]]), margin=0.05)
    follower = PurePursuit(sensors)
    x, y = follower._target(route)
    chain = route.ahead(next(s for s in np.arange(0.0, 1.0, 0.001) if math.dist(route.at(s), (x, y)) < 0.002))
    assert distances_to_chain(np.array([[0.0, 0.0], [x, y]]), chain).max() <= 0.4 * 0.05 + 1e-9
    straight = Route(np.array([[0, 0], [9, 0]]), margin=0.05)
    assert follower._target(straight) == pytest.approx((LOOKAHEAD, 0.0))
    speed = follower.follow(straight, view, Scene((0.0, 0.0, 0.0), (9.0, 0.0), None))
    assert speed == pytest.approx((sensors.drive.max_speed, 0.0))
    turned = follower.follow(straight, view, Scene((0.0, 0.0, 0.5 * math.pi), (9.0, 0.0), None))
    assert turned == pytest.approx((0.0, -sensors.drive.max_speed), abs=1e-9)


def test_pure_pursuit_stands_before_what_the_scan_shows() -> None:
    sensors, view = flat_view(0.21, kinematics="holonomic")
    velocity = PurePursuit(sensors).follow(
        Route(np.array([[0, 0], [9, 0]]), margin=0.05), view, Scene((0.0, 0.0, 0.0), (9.0, 0.0), None)
    )
    assert math.hypot(*velocity) * sensors.drive.step <= 0.011


def followed(route: Route, view: View, x: float = 0.0, y: float = 0.0) -> tuple[float, float]:
    """What pure pursuit drives along a way from a place."""
    route.advance(x, y)
    return PurePursuit(view.sensors).follow(route, view, Scene((x, y, 0.0), (9.0, 0.0), None))


@pytest.mark.parametrize("away", [0.02, 0.07, 0.3, 0.59])
def test_the_end_of_a_way_is_not_driven_past_and_what_brakes_can_stop_there(away: float) -> None:
    places = np.array([[-1.0, 0.0], [away, 0.0]])
    for brake in (None, 0.8):
        sensors, view = flat_view(99.0, kinematics="holonomic", max_acceleration=brake)
        step, most = sensors.drive.step, sensors.drive.max_speed
        can_stop = math.inf if brake is None else max(math.sqrt(2.0 * brake * away), brake * step)
        speed = followed(Route(places, margin=0.05), view)
        assert speed == pytest.approx((min(most, away / step, can_stop), 0.0))


def test_who_is_held_beside_its_way_goes_back_to_it_first() -> None:
    """Going on beside its way it heads for a place ahead; standing there for what is near on it, until it is back."""
    (sensors, standing), (_, going) = flat_view(99.0, kinematics="holonomic"), flat_view(99.0, kinematics="holonomic")
    going.velocity = (0.8, 0.0)
    route = Route(np.array([[-1, 0], [9, 0]]), margin=0.05)
    for view, is_left in ((going, False), (standing, True), (going, True)):
        vx, vy = followed(route, view, 0.0, 0.3)
        assert route.is_left == is_left
        ahead = 0.5 * sensors.step_length if is_left else LOOKAHEAD
        assert math.atan2(vy, vx) == pytest.approx(math.atan2(-0.3, ahead))
    followed(route, going, 0.1, 0.01)
    assert not route.is_left


def test_an_unknown_follower_is_refused() -> None:
    sensors, _ = flat_view()
    with pytest.raises(ValueError, match=r"follower must be one of \['pure_pursuit'.*\], got 'hope'"):
        make_follower("hope", sensors)
    with pytest.raises(ValueError, match="follower must be one of"):
        make_policy("a_star", Simulation("static"), follower="hope")
