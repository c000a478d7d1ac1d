"""Which doors HD-BUG notes and keeps: apart from one another, none right before walls that are known, and open to movers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.agents import make_policy
from bug_gym.agents.hd_bug.doors import LEAST_JUMP, MOST_DOORS, find_doors, thin_out
from bug_gym.agents.hd_bug.explore import CLOSED_ABOUT, MOVED_NEAR, PASSED, THINNED
from bug_gym.agents.hd_bug.light import ANGLES, HEADINGS
from bug_gym.agents.hd_bug.memory import Closing, Walls
from bug_gym.agents.hd_bug.path_list import Door
from bug_gym.agents.hd_bug.perceive import Scene
from bug_gym.simulation import Simulation
from bug_gym.view import View

F64 = NDArray[np.float64]
REACH = 5.0
"""Range of the beams [m]."""


def at(x: float, polygons: list[list[list[float]]], **parameters: Any) -> tuple[Any, Scene, Any]:
    """A policy at a place of the x axis, what it sees among still things, and its memory."""
    world = {
        "family": "explicit",
        "bounds": [-40, -40, 40, 40],
        "start": [x, 0, 0],
        "goal": [30, 0],
        "polygons": polygons,
    }
    settings = {"robot": {"kinematics": "holonomic"}, "lidar": {"beams": 360, "range": REACH}, "world": world}
    simulation = Simulation(settings)
    policy: Any = make_policy("hd_bug", simulation, **parameters)
    memory, view = policy.start(), View(simulation.reset(seeds=[0])[0, 0], policy.sensors)
    memory.goal = view.goal_position
    return policy, policy.perception.perceive(view, memory), memory


def pillars(seed: int) -> list[list[list[float]]]:
    """A dozen round pillars about the origin, whose edges make many small jumps of the light beside one another."""
    rng = np.random.default_rng(seed)
    turns, found = np.arange(24) * (2.0 * math.pi / 24), []
    for angle in np.arange(12) * (2.0 * math.pi / 12):
        away, radius = rng.uniform(2.0, 4.5), rng.uniform(0.2, 0.5)
        centre = away * np.array([math.cos(angle), math.sin(angle)])
        found.append((centre + radius * np.column_stack([np.cos(turns), np.sin(turns)])).tolist())
    return found


@pytest.mark.parametrize("seed", [0, 1, 4, 5])
def test_doors_of_one_place_lie_apart_from_one_another_and_from_those_that_led_nowhere(seed: int) -> None:
    policy, scene, memory = at(0.0, pillars(seed))
    policy.explorer.look(scene, memory)
    nowhere = memory.path.doors[::4]
    policy, scene, memory = at(0.0, pillars(seed))
    memory.closed = [Closing(door.outside, math.inf) for door in nowhere]
    policy.explorer.look(scene, memory)
    places = np.array([door.outside for door in memory.path.doors])
    assert len(places) > 10 and len(nowhere) > 3
    apart = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) + np.diag(np.full(len(places), np.inf))
    assert apart.min() >= THINNED
    closed = np.array([door.outside for door in nowhere])
    assert np.hypot(*(places[:, None] - closed).transpose(2, 0, 1)).min() >= CLOSED_ABOUT


@pytest.mark.parametrize("seed", range(3))
def test_of_places_too_near_to_one_another_the_first_stays(seed: int) -> None:
    """One that is dropped drops no other; what was dropped before stays so."""
    rng = np.random.default_rng(seed)
    places, before = rng.uniform(0.0, 2.0, (60, 2)), rng.random(60) < 0.2
    dropped = before.copy()
    thin_out(places, 0.25, dropped)
    kept: list[F64] = []
    for place, is_dropped, was_dropped in zip(places, dropped, before, strict=True):
        is_near = any(math.dist(place, other) < 0.25 for other in kept)
        assert is_dropped == (was_dropped or is_near)
        if not is_dropped:
            kept.append(place)
    assert 10 < len(kept) < 60 - before.sum()


@pytest.mark.parametrize("is_known", [True, False])
def test_where_sight_ends_right_before_a_wall_that_is_known_there_is_no_door(is_known: bool) -> None:
    """The wall lies 5.25 m ahead, so beams of 5 m end before it; from a place 1 m nearer to it was seen."""
    wall = [[[5.25, -20.0], [6.0, -20.0], [6.0, 20.0], [5.25, 20.0]]]
    policy, scene, memory = at(0.0, wall)
    if is_known:
        _, nearer, _ = at(1.0, wall)
        light, _ = policy.perception.light_up(nearer)
        memory.path.visit((1.0, 0.0), 0.0, light)
    policy.explorer.look(scene, memory)
    ahead = [door for door in memory.path.doors if abs(math.atan2(*door.outside[::-1])) < 0.25]
    aside = [door for door in memory.path.doors if abs(math.atan2(*door.outside[::-1])) > 1.5]
    assert bool(ahead) != is_known and aside


@pytest.mark.parametrize("is_still", [True, False])
def test_what_moves_in_a_door_does_not_close_it(is_still: bool) -> None:
    policy, _, memory = at(0.0, [])
    node = memory.path.visit((0.0, 0.0), 0.0, memory.light)
    node.doors = [Door((2.0, 0.0), (2.3, 0.0), 5.0, node.number), Door((0.0, 2.0), (0.0, 2.3), 5.0, node.number)]
    walls = Walls(np.array([2.1]), np.array([0.05]), np.array([is_still]))
    assert policy.explorer._is_solid(walls, node.doors).tolist() == [is_still, False]


@pytest.mark.parametrize(("steps", "is_passed"), [(PASSED - 0.1, True), (PASSED + 0.1, False)])
def test_a_node_of_the_way_back_that_is_nearly_reached_is_passed(steps: float, is_passed: bool) -> None:
    """On the way back the next one follows it, and behind the last one v."""
    policy, scene, memory = at(0.0, [])
    light = np.full_like(memory.light, 3.0)
    near = (steps * policy.explorer.step, 0.0)
    first, second = memory.path.visit(near, 0.0, light), memory.path.visit((2.0, 0.0), 1.0, light)
    memory.door = Door((2.0, 1.0), (2.0, 1.3), 5.0, second.number)
    memory.way = [first.number, second.number]
    assert policy.explorer.next_place(scene, memory) == ((2.0, 0.0) if is_passed else near)
    assert memory.mode == "backtracking"
    memory.way = [first.number]
    assert policy.explorer.next_place(scene, memory) == ((2.0, 1.0) if is_passed else near)


@pytest.mark.parametrize("hysteresis", [0.0, 0.1])
@pytest.mark.parametrize("has_other", [True, False])
def test_a_door_that_no_way_leads_to_is_not_chosen_though_it_lies_where_the_last_one_was(
    has_other: bool, hysteresis: float
) -> None:
    """A wall hides it, and the way back to its node was cut."""
    policy, scene, memory = at(0.0, [], hysteresis=hysteresis)
    path, light = memory.path, np.full_like(memory.light, 5.0)
    there, here = path.visit((4.0, 0.0), 0.0, light), path.visit((0.0, 0.0), 4.0, light)
    path.cut(here.number, there.number)
    there.doors = [Door((4.0, 0.0), (4.3, 0.0), 5.0, there.number)]
    wall = np.linspace(-1.0, 1.0, 21)
    memory.walls, memory.heading_to = Walls(np.full(21, 2.0), wall, np.ones(21, dtype=np.bool_)), (4.3, 0.0)
    if has_other:
        here.doors = [Door((-2.0, 0.0), (-2.3, 0.0), 5.0, here.number)]
    policy.explorer.choose(scene, memory)
    assert np.isfinite(memory.costs).tolist() == [False, True][: 1 + has_other]
    assert memory.door is (here.doors[0] if has_other else None) and memory.way == []


@pytest.mark.parametrize("angle", [0.3, 2.0, -1.234])
def test_where_nothing_hides_the_goal_but_its_distance_a_door_leads_straight_to_it(angle: float) -> None:
    policy, scene, memory = at(0.0, [])
    memory.goal = (30.0 * math.cos(angle), 30.0 * math.sin(angle))
    policy.explorer.look(scene, memory)
    off = [abs(math.remainder(math.atan2(*door.outside[::-1]) - angle, 2.0 * math.pi)) for door in memory.path.doors]
    assert min(off) < 1e-9


@pytest.mark.parametrize(("gap", "may_open"), [(MOVED_NEAR - 0.05, True), (MOVED_NEAR + 0.05, False)])
@pytest.mark.parametrize("radius", [0.2, 1.0])
def test_how_near_to_a_door_something_moves_is_told_from_its_edge(radius: float, gap: float, may_open: bool) -> None:
    policy, scene, memory = at(0.0, [])
    door = Door((2.0, 0.0), (2.3, 0.0), 5.0, 0)
    tracks = scene.tracks._replace(
        position=np.array([[2.3, radius + gap]]),
        velocity=np.zeros((1, 2)),
        radius=np.array([radius]),
        moving=np.ones(1, dtype=np.bool_),
    )
    assert math.isfinite(policy.explorer._closing(Scene(scene.view, tracks), memory, door).until) == may_open


def doors_beside_a_jump(near: float, far: float, clearance: float, *points: tuple[float, float]) -> F64:
    """Doors (k, 5) where the light jumps from half the headings to the other half, seen at (1, 2)."""
    light = np.where(np.arange(HEADINGS) < HEADINGS // 2, far, near)
    x, y = np.array(points).reshape(-1, 2).T.copy()
    found = np.empty((MOST_DOORS, 5))
    jumps, _ = find_doors(light, 1.0, 2.0, x, y, clearance, 9.0, 0.0, found)
    return found[:jumps]


@pytest.mark.parametrize("clearance", [0.1, 0.27, 0.5])
def test_beside_a_jump_doors_lead_from_the_light_into_the_shadow_a_clearance_apart(clearance: float) -> None:
    """The first is one and a half of them behind the end of what is nearer; they end with the light."""
    near, far = 2.0, 4.0
    found = doors_beside_a_jump(near, far, clearance)
    first, last = ANGLES[0], ANGLES[HEADINGS // 2 - 1]  # of the light
    away = np.arange(near + 1.5 * clearance, far + 1e-9, clearance)
    assert len(found) == 2 * len(away) and np.isinf(found[:, 4]).all()
    for angle, aside in ((first, -1.0), (last, 1.0)):
        along, left = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
        v = found[:, :2] - (1.0, 2.0)
        here = np.abs(v @ left) < 1e-9
        here &= v @ along > 0.0
        np.testing.assert_allclose(np.sort(v[here] @ along), away)
        np.testing.assert_allclose(
            found[here, 2:4] - found[here, :2], np.tile(1.1 * aside * clearance * left, (len(away), 1))
        )


@pytest.mark.parametrize(("change", "count"), [(LEAST_JUMP - 0.01, 0), (LEAST_JUMP + 0.01, 2)])
def test_a_small_jump_hides_no_door(change: float, count: int) -> None:
    clearance = 0.15  # one and a half of them are less than the jump
    assert len(doors_beside_a_jump(2.0, 2.0 + change, clearance)) == count


@pytest.mark.parametrize(("room", "count"), [(0.9, 0), (1.0, 1)])
def test_a_door_needs_the_room_of_a_clearance_about_the_way_through_it(room: float, count: int) -> None:
    """Beyond v on the right hand of the light lies a point, in clearances of 0.3 m."""
    clearance = 0.3
    v, other = 2.0 + 1.5 * clearance, -2.0
    beyond = (1.0 + v + room * clearance, 2.0 - 0.5 * clearance)
    elsewhere = (1.0 + other - 1.5 * clearance, 2.0)  # in the way of the other one
    found = doors_beside_a_jump(2.0, v + 0.1, clearance, beyond, elsewhere)
    assert len(found) == count
    np.testing.assert_allclose(found[:, 4], room * clearance)


@pytest.mark.parametrize("seed", range(6))
def test_where_sight_ends_there_is_a_door_in_the_middle_and_every_metre_from_end_to_end(seed: int) -> None:
    """A stretch narrower than a metre has the one in its middle alone; where headings are counted from does not matter."""
    rng, step = np.random.default_rng(seed), 2.0 * math.pi / HEADINGS
    widths = rng.integers(1, 24, 12)
    widths = widths[np.cumsum(widths) < HEADINGS - 30]
    is_far = np.repeat(np.arange(len(widths)) % 2 == 0, widths)
    is_far = np.concatenate([is_far, np.zeros(HEADINGS - len(is_far), dtype=np.bool_)])
    for turn in (0, 1, int(widths[0]) // 2, 100):
        light = np.roll(np.where(is_far, REACH, REACH - 0.1), -turn)
        found = np.empty((MOST_DOORS, 5))
        jumps, count = find_doors(
            light, 1.0, 2.0, np.empty(0), np.empty(0), 0.3, REACH, (HEADINGS - 10 - turn) * step, found
        )
        assert jumps == 0
        v, q = found[:count, :2] - (1.0, 2.0), found[:count, 2:4] - (1.0, 2.0)
        np.testing.assert_allclose(np.hypot(*v.T), REACH)
        np.testing.assert_allclose(q, v * (1.0 + 1.1 * 0.3 / REACH), atol=1e-9)
        doors = np.sort((np.rint(np.arctan2(*v.T[::-1]) / step).astype(int) + turn) % HEADINGS)
        assert is_far[doors].all() and len(set(doors.tolist())) == len(doors)
        for first, width in zip((np.cumsum(widths) - widths)[::2], widths[::2], strict=True):
            own = doors[(doors >= first) & (doors < first + width)] - first
            assert width // 2 in own
            if width * step * REACH > 1.0:
                assert own[0] == 0 and own[-1] == width - 1 and np.diff(own).max() * step * REACH <= 1.0
            else:
                assert len(own) == 1


def test_all_round_in_the_open_doors_lie_a_metre_apart_at_most() -> None:
    light, found = np.full(HEADINGS, REACH), np.empty((MOST_DOORS, 5))
    _, count = find_doors(light, 0.0, 0.0, np.empty(0), np.empty(0), 0.3, REACH, 0.0, found)
    turns = np.sort(np.arctan2(found[:count, 1], found[:count, 0]))
    assert REACH * np.diff(np.append(turns, turns[0] + 2.0 * math.pi)).max() <= 1.0 + 1e-9


@pytest.mark.parametrize("room", [1, 3, 21, 22, 30])
def test_no_more_doors_are_noted_than_there_is_room_for(room: int) -> None:
    """Compiled code would write over whatever lies behind; a small body with a long sight has thousands of them."""
    light = np.where(np.arange(HEADINGS) < HEADINGS // 2, REACH, 2.0)
    rows = np.full((room + 2, 5), np.nan)
    jumps, count = find_doors(light, 0.0, 0.0, np.empty(0), np.empty(0), 0.27, REACH, 1.0, rows[:room])
    assert jumps == min(room, 20) and jumps <= count <= room
    assert not np.isnan(rows[:count]).any() and np.isnan(rows[room:]).all()
