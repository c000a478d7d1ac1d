"""Bodies that look before each step: the crowd, evaders, and those that follow a record."""

import itertools
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from compiled import for_python
from numpy.typing import NDArray
from scipy.optimize import linprog

from bug_gym.config import Crowd, Evade, Replay, ScenarioError, load
from bug_gym.kernels import avoidance
from bug_gym.limits import SMALL
from bug_gym.simulation import Simulation
from bug_gym.world import Capacity
from bug_gym.worlds.layout import Layout, Mover
from bug_gym.worlds.recordings import load_recording

F64 = NDArray[np.float64]

STEP = 0.1

escape_velocity = for_python(avoidance.escape_velocity)
least_violation = for_python(avoidance.least_violation)
nearest_velocity = for_python(avoidance.nearest_velocity)


def scenario(movers: list[dict[str, Any]] | None = None, **parts: Any) -> dict[str, Any]:
    """Movers in an explicit world; unless told otherwise the robot is small and shut away in a corner."""
    world = {"start": [-9.98, -9.98, 0.0], "movers": movers or [], **parts.pop("world", {})}
    world = world if "target" in world else {"goal": [9.5, 9.5], **world}
    return {
        "robot": {"radius": 0.01},
        "lidar": {"beams": 1, "range": 0.1},
        "time": {"step": STEP, "limit": 100000.0},
        "world": {"family": "explicit", **world},
        **parts,
    }


def circle(at: list[float] | None, radius: float, **motion: Any) -> dict[str, Any]:
    """A circular mover."""
    return {"shape": {"circle": radius}, "motion": motion, **({} if at is None else {"at": at})}


def begin(what: Any, count: int = 1, seed: int = 0) -> Simulation:
    """Worlds at the start of their first episodes."""
    simulation = Simulation(what, count=count)
    simulation.reset(seeds=range(seed, seed + count))
    return simulation


def movers_of(simulation: Simulation, name: str = "body_x") -> F64:
    """Places (N, M, 2) of the moving circles, or with "body_vx" their velocities."""
    moving = int(simulation.world.array("moving_disc_count")[0, 0])
    pair = simulation.world.disc_position if name == "body_x" else simulation.world.disc_velocity
    values: F64 = pair[:, :moving].copy()
    return values


def watch(simulation: Simulation, steps: int, action: Any = (0.0, 0.0)) -> tuple[F64, F64]:
    """Places (steps + 1, N, M, 2) and velocities (steps, N, M, 2) of the moving circles over some steps."""
    actions = np.broadcast_to(np.asarray(action, dtype=np.float64), (simulation.count, simulation.robots, 2))
    places, velocities = [movers_of(simulation)], []
    for _ in range(steps):
        simulation.advance(actions)
        places.append(movers_of(simulation))
        velocities.append(movers_of(simulation, "body_vx"))
    return np.array(places), np.array(velocities)


def norms(vectors: F64) -> F64:
    """Lengths (...) of vectors (..., 2)."""
    lengths: F64 = np.hypot(vectors[..., 0], vectors[..., 1])
    return lengths


def least_distance(places: F64) -> float:
    """Smallest distance of two discs' centres on their chords, places (T, N, M, 2)."""
    apart = places[:, :, :, None] - places[:, :, None]
    apart = apart[:, :, *np.triu_indices(places.shape[2], 1)]
    start, way = apart[:-1], np.diff(apart, axis=0)
    share = np.clip(-(start * way).sum(-1) / np.maximum((way**2).sum(-1), 1e-300), 0.0, 1.0)
    return float(norms(start + share[..., None] * way).min())


# ------------------------------------------------------------------------------------------------ events


def alone(motion: dict[str, Any], at: list[float], step: float, steps: int, **world: Any) -> F64:
    """Places (steps + 1, 2) of a mover of 0.1 m that is the only one."""
    time = {"step": step, "limit": 100000.0}
    places: F64 = watch(begin(scenario([circle(at, 0.1, **motion)], time=time, world=world)), steps)[0][:, 0, 0]
    return places


def test_way_points_nearer_to_one_another_than_a_step_is_long_are_all_passed() -> None:
    """50 of them in each step of 0.1 m."""
    points = [[-5.0 + 0.002 * number, 0.0] for number in range(1, 5001)]
    places = alone({"law": "waypoints", "speed": 1.0, "points": points}, [-5.0, 0.0], 0.1, 90)
    assert places == pytest.approx(np.column_stack([-5.0 + 0.1 * np.arange(91), np.zeros(91)]), abs=1e-9)


def test_a_track_sampled_finely_is_followed_at_its_speed_round_after_round() -> None:
    angles = 2.0 * np.pi * np.arange(126) / 126
    track = 2.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    points = np.roll(track, -1, axis=0)  # from where it starts on
    places = alone({"law": "waypoints", "speed": 5.0, "points": points.tolist()}, [2.0, 0.0], 1.0, 20)
    side = 4.0 * math.sin(math.pi / 126)
    gone = 5.0 * np.arange(21) % (126.0 * side)
    closed = np.vstack([track, track[:1]])
    expected = np.column_stack([np.interp(gone, side * np.arange(127), closed[:, axis]) for axis in range(2)])
    assert places == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("spare", [1e-2, 1e-3, 1e-5])
def test_a_body_in_a_narrow_slit_goes_on_along_it(spare: float) -> None:
    """Between two walls, with so much room to either side, y swings as a triangle does and x grows evenly [m]."""
    half = 0.1 + spare
    slit = [[[-9, half], [9, half], [9, 1], [-9, 1]], [[-9, -1], [9, -1], [9, -half], [-9, -half]]]
    places = alone({"law": "bounce", "velocity": [1.0, 1.0]}, [-5.0, 0.0], 1.0, 8, polygons=slit)
    time = np.arange(9)
    there = (time + spare) % (4.0 * spare)
    y = np.where(there < 2.0 * spare, there, 4.0 * spare - there) - spare
    assert places == pytest.approx(np.column_stack([-5.0 + time, y]), abs=1e-7)


def test_where_a_walker_of_short_legs_is_does_not_depend_on_the_step() -> None:
    walk = {"law": "random_walk", "speed": 1.0, "min_leg": 0.002, "max_leg": 0.01}
    fine, coarse = alone(walk, [0.0, 0.0], 0.01, 400), alone(walk, [0.0, 0.0], 1.0, 4)
    assert coarse == pytest.approx(fine[::100], abs=1e-9)
    assert np.ptp(fine, axis=0).min() > 0.01


@pytest.mark.parametrize("count", [2, 50])
def test_a_tour_without_length_ends_and_points_that_are_one_take_no_time(count: int) -> None:
    there = [[1.0, 0.0]] * count
    assert (alone({"law": "waypoints", "speed": 1.0, "points": there}, [1.0, 0.0], 1.0, 5) == [1.0, 0.0]).all()
    places = alone({"law": "waypoints", "speed": 1.0, "points": [*there, [1.0, 4.0]]}, [1.0, 0.0], 1.0, 8)
    assert places[:, 1] == pytest.approx([0, 1, 2, 3, 4, 3, 2, 1, 0], abs=1e-9)


def test_a_body_between_walls_that_leave_it_no_room_ends_its_step() -> None:
    """It touches both at once, all the time."""
    slit = [[[-9, 0.05], [9, 0.05], [9, 1], [-9, 1]], [[-9, -1], [9, -1], [9, -0.05], [-9, -0.05]]]
    places = alone({"law": "bounce", "velocity": [0.0, 1.0]}, [0.0, 0.0], 1.0, 5, polygons=slit)
    assert np.abs(places).max() <= 1e-9


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        (
            {"law": "waypoints", "speed": 10.0, "points": [[0, 0], [1e-5, 0]]},
            r"movers.0.motion.points: got 1e\+09 turns in a step of 1000 s \(time.step\), expected at most 1,000,000",
        ),
        (
            {"law": "random_walk", "speed": 1.0, "min_leg": 1e-6, "max_leg": 1e-6},
            r"movers.0.motion.max_leg: got 1e\+09 turns in a step",
        ),
    ],
)
def test_motion_that_turns_more_often_than_a_step_goes_through_is_refused(motion: dict[str, Any], words: str) -> None:
    load(scenario([circle([0, 0], 0.1, **motion)], time={"step": 0.1}))
    with pytest.raises(ScenarioError, match=words):
        load(scenario([circle([0, 0], 0.1, **motion)], time={"step": 1e3, "limit": 1e6}))
    with pytest.raises(ScenarioError, match=r"world.target.motion"):
        load(scenario(world={"target": {"at": [0, 0], "motion": motion}}, time={"step": 1e3, "limit": 1e6}))


# ------------------------------------------------------------------------------------------------ half planes


def random_half_planes(rng: np.random.Generator, count: int, least: float) -> F64:
    """Half planes (n, 3): nx, ny, c, all of which c from `least` on."""
    angle = rng.uniform(-math.pi, math.pi, count)
    return np.column_stack([np.cos(angle), np.sin(angle), rng.uniform(least, 0.5, count)])


def candidates(lines: F64, speed: float, wish: F64) -> F64:
    """Velocities (k, 2) among which the one nearest to a wish is: the wish, feet of it, and corners."""
    norm = np.hypot(*wish)
    found = [wish if norm <= speed else wish * speed / norm]
    for nx, ny, c in lines:
        found.append(wish + (c - nx * wish[0] - ny * wish[1]) * np.array([nx, ny]))
        if abs(c) <= speed:
            half = math.sqrt(speed**2 - c**2)
            found += [c * np.array([nx, ny]) + side * half * np.array([-ny, nx]) for side in (-1.0, 1.0)]
    for one, two in itertools.combinations(lines, 2):
        normals = np.array([one[:2], two[:2]])
        if abs(np.linalg.det(normals)) > 1e-9:
            found.append(np.linalg.solve(normals, [one[2], two[2]]))
    return np.array(found)


def nearest_by_trying(lines: F64, speed: float, wish: F64) -> F64 | None:
    """The velocity within half planes and a speed that is nearest to a wish; None where there is none."""
    tried = candidates(lines, speed, wish)
    fits = (norms(tried) <= speed + 1e-9) & ((tried @ lines[:, :2].T - lines[:, 2]).min(axis=1, initial=0.0) >= -1e-9)
    if not fits.any():
        return None
    best: F64 = tried[fits][np.argmin(norms(tried[fits] - wish))]
    return best


def test_the_nearest_velocity_within_half_planes_is_that_of_trying_every_corner() -> None:
    rng = np.random.default_rng(0)
    solved = 0
    for _ in range(2000):
        lines = random_half_planes(rng, int(rng.integers(0, 7)), -1.0)
        speed, wish = float(rng.uniform(0.3, 1.5)), rng.uniform(-1.5, 1.5, 2)
        vx, vy, failed = nearest_velocity(lines.ravel(), len(lines), speed, *wish)
        expected = nearest_by_trying(lines, speed, wish)
        assert (failed == len(lines)) == (expected is not None)
        if expected is not None:
            assert [vx, vy] == pytest.approx(expected, abs=1e-7)
            solved += 1
        else:
            assert nearest_by_trying(lines[:failed], speed, wish) == pytest.approx([vx, vy], abs=1e-7)
            assert nearest_by_trying(lines[: failed + 1], speed, wish) is None
    assert 300 < solved < 1900


def least_violation_by_linprog(hard: F64, soft: F64, speed: float) -> float:
    """How much the worst of the soft half planes must be missed, the disc of velocities as a polygon around it."""
    angle = np.linspace(-math.pi, math.pi, 1000, endpoint=False)
    disc = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
    rows = np.vstack([np.c_[-soft[:, :2], -np.ones(len(soft))], np.c_[-hard[:, :2], np.zeros(len(hard))], disc])
    most = np.concatenate([-soft[:, 2], -hard[:, 2], np.full(len(angle), speed)])
    result = linprog([0.0, 0.0, 1.0], rows, most, bounds=[(None, None), (None, None), (0.0, None)])
    assert result.success
    return float(result.fun)


def test_where_half_planes_leave_nothing_the_worst_of_them_is_missed_by_the_least() -> None:
    rng = np.random.default_rng(1)
    tried = 0
    while tried < 60:
        hard = random_half_planes(rng, int(rng.integers(0, 4)), -0.8)
        hard[:, 2] = np.minimum(hard[:, 2], 0.0)
        soft = random_half_planes(rng, int(rng.integers(2, 7)), -0.3)
        lines, speed = np.vstack([hard, soft]), float(rng.uniform(0.3, 1.5))
        vx, vy, failed = nearest_velocity(lines.ravel(), len(lines), speed, *rng.uniform(-1, 1, 2))
        assert failed >= len(hard), "to stand keeps the hard ones"
        if failed == len(lines):
            continue
        spare = np.zeros(lines.size)
        vx, vy = least_violation(lines.ravel(), len(hard), failed, len(lines), speed, vx, vy, spare)
        assert math.hypot(vx, vy) <= speed + 1e-9
        assert (hard[:, :2] @ [vx, vy] >= hard[:, 2] - 1e-8).all()
        missed = float((soft[:, 2] - soft[:, :2] @ [vx, vy]).max())
        assert missed == pytest.approx(least_violation_by_linprog(hard, soft, speed), abs=1e-5 * speed)
        tried += 1


def escape(place: F64, velocity: F64, together: float, horizon: float) -> tuple[float, float, float, float]:
    """`avoidance.escape_velocity` of vectors."""
    (px, py), (vx, vy) = place.tolist(), velocity.tolist()
    return escape_velocity(px, py, vx, vy, together, horizon, STEP)


def meets(place: F64, velocities: F64, together: float, horizon: float) -> NDArray[np.bool_]:
    """Whether a point going with each velocity comes within a distance of a place before the horizon."""
    square = np.maximum((velocities**2).sum(-1), 1e-300)
    time = np.clip(velocities @ place / square, 0.0, horizon)
    near: NDArray[np.bool_] = norms(time[..., None] * velocities - place) < together
    return near


def test_the_escape_from_contact_is_the_smallest_change_of_velocity_that_ends_it_or_leads_to_it() -> None:
    rng = np.random.default_rng(2)
    angle = np.linspace(-math.pi, math.pi, 721)
    around = np.column_stack([np.cos(angle), np.sin(angle)])
    both = set()
    for _ in range(1000):
        together, horizon = float(rng.uniform(0.2, 1.0)), float(rng.uniform(0.5, 4.0))
        turn = rng.uniform(-math.pi, math.pi)
        place = (together + rng.exponential(1.5) + 1e-3) * np.array([math.cos(turn), math.sin(turn)])
        velocity = rng.uniform(-2.0, 2.0, 2)
        ux, uy, nx, ny = escape(place, velocity, together, horizon)
        change, normal = np.array([ux, uy]), np.array([nx, ny])
        hits = bool(meets(place, velocity[None], together, horizon)[0])
        both.add(hits)
        assert math.hypot(nx, ny) == pytest.approx(1.0)
        assert meets(place, (velocity + change - 1e-6 * normal)[None], together, horizon).all()
        assert not meets(place, (velocity + change + 1e-6 * normal)[None], together, horizon).any()
        nearer = velocity + (np.hypot(ux, uy) - 1e-6) * around
        assert (meets(place, nearer, together, horizon) == hits).all(), "nothing nearer changes it"
    assert both == {True, False}


@pytest.mark.parametrize("ahead", [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])
def test_two_exactly_head_on_both_escape_to_their_right(ahead: tuple[float, float]) -> None:
    """As in RVO2, whose else-branch takes the right leg of the cone; each sees the other as the other sees it."""
    way = np.array(ahead)
    for one in (way, -way):
        ux, uy, nx, ny = escape(2.0 * one, 2.0 * one, 0.5, 3.0)
        right = np.array([one[1], -one[0]])
        assert right @ [ux, uy] > 0.1 and right @ [nx, ny] > 0.9


def test_bodies_that_overlap_come_apart_within_a_step() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        place, velocity = rng.uniform(-0.3, 0.3, 2), rng.uniform(-1.0, 1.0, 2)
        ux, uy, _, _ = escape(place, velocity, 0.6, 2.0)
        assert norms(place - STEP * (velocity + [ux, uy])) == pytest.approx(0.6)


# ------------------------------------------------------------------------------------------------ crowd


def walker(at: Any, *goals: Any, speed: float = 1.0, radius: float = 0.3, **more: Any) -> dict[str, Any]:
    """A body of a crowd; without goals they are drawn."""
    motion = {"law": "crowd", "speed": speed, **({"goals": [list(goal) for goal in goals]} if goals else {}), **more}
    return circle([float(x) for x in at], radius, **motion)


def test_a_body_of_a_crowd_that_is_alone_goes_straight_to_its_goal_and_stays_there() -> None:
    places, velocities = watch(begin(scenario([walker([-4, 1], [2, -3.5], speed=1.2)])), 100)
    start, goal = np.array([-4.0, 1.0]), np.array([2.0, -3.5])
    time = STEP * np.arange(101)[:, None]
    expected = start + np.minimum(time * 1.2 / 7.5, 1.0) * (goal - start)
    assert places[:, 0, 0] == pytest.approx(expected, abs=1e-9)
    assert norms(velocities[70:]).max() < 1e-9


def test_goals_are_visited_in_turn_over_and_over() -> None:
    corners = [[2, 0], [2, 2], [0, 2], [0, 0]]
    places, _ = watch(begin(scenario([walker([0, 0], *corners, radius=0.1)])), 200)
    near = norms(places[:, 0, 0, None] - np.array(corners, dtype=float)).min(axis=1) <= 0.101
    which = norms(places[:, 0, 0, None] - np.array(corners, dtype=float)).argmin(axis=1)
    order = [corner for corner, _ in itertools.groupby(which[near].tolist())]
    assert order[:9] == [3, 0, 1, 2, 3, 0, 1, 2, 3]


@pytest.mark.parametrize("speeds", [(1.0, 1.0), (1.2, 0.4)])
@pytest.mark.parametrize("radius", [0.2, 0.5])
def test_two_discs_head_on_keep_their_distance_and_pass(speeds: tuple[float, float], radius: float) -> None:
    pair = [
        walker([-4, 0], [4, 0], speed=speeds[0], radius=radius),
        walker([4, 0], [-4, 0], speed=speeds[1], radius=radius),
    ]
    places, _ = watch(begin(scenario(pair)), 300)
    assert least_distance(places) >= 2.0 * radius
    assert places[-1, 0] == pytest.approx(np.array([[4.0, 0.0], [-4.0, 0.0]]), abs=1e-6)


@pytest.mark.parametrize(("horizon", "step"), [(0.1, 0.5), (0.01, 0.1), (2.0, 2.0), (1.0, 5.0)])
@pytest.mark.parametrize("beside", [0.0, 0.1, -0.3])
def test_discs_that_look_less_far_ahead_than_a_step_keep_their_distance(
    horizon: float, step: float, beside: float
) -> None:
    pair = [
        walker([-4, 0], [4, 0], speed=2.0, horizon=horizon),
        walker([4, beside], [-4, beside], speed=1.5, horizon=horizon),
        walker([0.1, 4], [0.1, -4], speed=0.7, horizon=horizon),
    ]
    places, _ = watch(begin(scenario(pair, time={"step": step, "limit": 1000.0})), 60)
    assert least_distance(places) >= 0.6


def test_two_discs_head_on_that_hold_each_other_up_turn_to_their_right() -> None:
    pair = [walker([-4, 0], [4, 0]), walker([4, 0], [-4, 0])]
    places, _ = watch(begin(scenario(pair), count=20), 100)
    first, second = places[:, :, 0], places[:, :, 1]
    passing = np.abs(first[..., 0] - second[..., 0]).argmin(axis=0), np.arange(20)
    # The right of who goes along x is where y falls. Side by side they are two radii apart, of which each has gone a part.
    assert (first[passing][:, 1] < -0.1).all() and (second[passing][:, 1] > 0.1).all()


def crossing(seed: int, count: int) -> Layout:
    """Discs about the middle of a world, each on its way to the other side."""
    rng = np.random.default_rng(seed)
    places: list[F64] = []
    while len(places) < count:
        angle, distance = rng.uniform(-math.pi, math.pi), rng.uniform(4.0, 8.0)
        place = distance * np.array([math.cos(angle), math.sin(angle)])
        if all(np.hypot(*(place - other)) > 0.7 for other in places):
            places.append(place)
    movers = []
    for x, y in np.array(places).tolist():
        movers.append(Mover(0.3, (x, y), Crowd(law="crowd", speed=float(rng.uniform(0.7, 1.2)), goals=((-x, -y),))))
    border = np.array([[-10.0, -10.0], [10.0, -10.0], [10.0, 10.0], [-10.0, 10.0]])
    corner, far_corner = np.array([[-9.9, -9.9, 0.0]]), np.array([[9.5, 9.5]])
    return Layout(border, corner, far_corner, np.zeros((0, 3)), movers=tuple(movers))


def speed_of(mover: Mover) -> float:
    """Greatest speed of a body of a crowd [m/s]."""
    assert isinstance(mover.motion, Crowd)
    return mover.motion.speed


def begin_with(layouts: list[Layout]) -> Simulation:
    """Worlds that begin with these layouts."""
    simulation = begin(scenario([walker([0, 0])]), count=len(layouts))
    for row, layout in enumerate(layouts):
        simulation.world.load(row, layout)
    simulation.begin(simulation.all_rows)
    return simulation


def test_in_100_crossings_of_20_nobody_touches_anybody_and_all_arrive() -> None:
    layouts = [crossing(seed, 20) for seed in range(100)]
    places, velocities = watch(begin_with(layouts), 450)
    assert least_distance(places) >= 0.6
    assert norms(places[-1] + places[0]).max() < 0.01
    speeds = np.array([[speed_of(mover) for mover in layout.movers] for layout in layouts])
    assert (norms(velocities) <= speeds * (1.0 + 1e-12)).all()


def test_a_ring_of_discs_that_all_cross_its_middle_does_not_lock() -> None:
    angle = 2.0 * np.pi * np.arange(16) / 16
    ring = 6.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    places, _ = watch(begin(scenario([walker(place, -place) for place in ring])), 400)
    assert least_distance(places) >= 0.6
    assert norms(places[-1, 0] + ring).max() < 0.01


def test_a_crowd_without_room_stands_rather_than_touch() -> None:
    """Everybody wants to be at the same place."""
    rng = np.random.default_rng(0)
    grid = [(x, y) for x in np.arange(-4.0, 4.1, 0.9) for y in np.arange(-4.0, 4.1, 0.9)]
    crowd = [walker(rng.uniform(-0.1, 0.1, 2) + place, [0.0, 0.0]) for place in grid]
    places, _ = watch(begin(scenario(crowd)), 300)
    assert least_distance(places) >= 0.6
    assert np.median(norms(places[-1, 0])) < 3.6, "they have come together"


STILL_THINGS: dict[str, Any] = {
    "circles": [[3.0, 3.0, 1.0], [-4.0, 2.0, 0.5], [0.0, -5.0, 1.5]],
    "polygons": [
        [[5, -3], [7, -3], [7, 1], [5, 1]],
        [[-7, -6], [-4, -7], [-5, -3]],
        {"shell": [[-8, 4], [-3, 4], [-3, 8], [-8, 8]], "holes": [[[-7, 5], [-4, 5], [-4, 7], [-7, 7]]]},
        [[0, 1], [1, 0], [0.3, 0], [0, 0.3]],
    ],
}


def still_geometry(what: dict[str, Any]) -> Any:
    """Still obstacles and border of a scenario as shapely's, circles as polygons of many corners inside them."""
    world = load(what).world
    assert world.family == "explicit"
    circles = [shapely.Point(x, y).buffer(radius, quad_segs=64) for x, y, radius in world.circles]
    outside = shapely.box(-50, -50, 50, 50).difference(shapely.box(*world.bounds))
    return shapely.union_all([*circles, *(polygon.geometry() for polygon in world.polygons), outside])


def free_places(still: Any, radius: float, count: int, seed: int) -> list[list[float]]:
    """Places where discs of a radius overlap neither each other nor what is still."""
    rng = np.random.default_rng(seed)
    places: list[list[float]] = []
    while len(places) < count:
        place = rng.uniform(-9.5, 9.5, 2).tolist()
        if shapely.distance(still, shapely.Point(place)) > radius + 1e-3 and all(
            math.dist(place, other) > 2.0 * radius for other in places
        ):
            places.append(place)
    return places


SQUARE = [[-10, -10], [10, -10], [10, 10], [-10, 10]]
HEXAGON = [[-9.5, 0], [-6, -9], [6, -9], [9.5, 0], [6, 9], [-6, 9]]


@pytest.mark.parametrize("corners", [SQUARE, HEXAGON])
def test_a_crowd_enters_neither_border_nor_still_obstacles(corners: list[list[float]]) -> None:
    border = np.array(corners, dtype=np.float64)
    still = still_geometry(scenario([], world=STILL_THINGS)).union(
        shapely.box(-50, -50, 50, 50).difference(shapely.Polygon(border))
    )
    radius = 0.25
    crowd = [walker(place, radius=radius, speed=1.5) for place in free_places(still, radius, 18, seed=1)]
    layout = begin(scenario(crowd, world=STILL_THINGS)).world.layout(0)
    places, _ = watch(simulation := begin_with([replace(layout, border=border)] * 3), 1500)
    room = shapely.distance(still, shapely.points(places))
    assert room.min() >= radius - 3e-4  # the corners of a drawn circle are inside it, its edges 3e-4 of a radius
    assert least_distance(places) >= 2.0 * radius
    assert simulation.world.array("body_leg")[:, :18].min() >= 3, "each has had several goals"


def test_goals_that_are_drawn_are_free_and_everywhere_and_each_bodys_own() -> None:
    still = still_geometry(scenario([], world=STILL_THINGS))
    crowd = [walker(place, radius=0.25, speed=1.5) for place in free_places(still, 0.25, 8, seed=2)]
    simulation = begin(scenario(crowd, world=STILL_THINGS), count=30)
    goals = np.stack([simulation.world.array(name)[:, :8] for name in ("body_goal_x", "body_goal_y")], axis=-1)
    assert shapely.distance(still, shapely.points(goals)).min() >= 0.25 - 3e-4
    assert len(np.unique(goals.reshape(-1, 2), axis=0)) == 240
    quarters = {(x > 0, y > 0) for x, y in goals.reshape(-1, 2).tolist()}
    assert len(quarters) == 4
    free = shapely.box(-10, -10, 10, 10).difference(still.buffer(0.25))
    assert goals.reshape(-1, 2).mean(axis=0) == pytest.approx(np.ravel(free.centroid.coords), abs=1.2)  # 3 sigma
    again = begin(scenario(crowd, world=STILL_THINGS), count=30)
    assert (again.world.array("body_goal_x") == simulation.world.array("body_goal_x")).all()
    again.reset()
    assert (again.world.array("body_goal_x")[:, :8] != simulation.world.array("body_goal_x")[:, :8]).all()


def test_a_goal_that_cannot_be_reached_is_given_up_for_the_next() -> None:
    walled = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    places, _ = watch(begin(scenario([walker([-4, 0], [0, 0], [-8, 0])], world={"polygons": [walled]})), 400)
    assert norms(places[:, 0, 0] - [-8.0, 0.0]).min() <= 0.3
    assert norms(places[:130, 0, 0] - [-8.0, 0.0]).min() > 3.0, "after 5 s and twice the straight way, 13 s, not before"


def test_a_body_goes_round_a_disc_and_round_a_box_in_its_way() -> None:
    for still in ({"circles": [[0, 0, 1]]}, {"polygons": [[[-1, -2], [1, -2], [1, 2], [-1, 2]]]}):
        places, _ = watch(begin(scenario([walker([-4, 0], [4, 0])], world=still)), 200)
        assert norms(places[-1, 0, 0] - [4.0, 0.0]) < 1e-6


CROWD_WORLD = load("crowd").world.model_dump(exclude_defaults=True)


def test_a_robot_that_stands_is_touched_by_nobody() -> None:
    robot = {"circles": [[0, 0, 0.3], [0.4, 0, 0.25]], "kinematics": "differential"}
    simulation = begin({"robot": robot, "lidar": {"beams": 4}, "world": {**CROWD_WORLD, "solvable": 0.7}}, count=20)
    stand = [2.0 * 0.3 / 1.3 - 1.0, 0.0]
    for _ in range(400):
        simulation.advance(np.broadcast_to(stand, (20, 1, 2)))
    assert (simulation.info()["outcome"] == "running").all()
    assert simulation.info()["min_clearance"].min() < 0.2, "they come near"
    assert simulation.info()["min_clearance"].min() > 0.01


def test_a_body_of_a_crowd_dodges_a_robot_that_comes_straight_at_it() -> None:
    """The robot avoids nobody; the body does it all."""
    what = scenario(
        [walker([4, 0], [-8, 0], speed=1.2)],
        robot={"radius": 0.3, "max_speed": 1.0},
        world={"start": [-4.0, 0.0, 0.0], "goal": [9.0, 0.0]},
    )
    simulation = begin(what)
    places, _ = watch(simulation, 120, action=(1.0, 0.0))
    assert simulation.info()["outcome"][0, 0] == "running"
    assert norms(places[-1, 0, 0] - [-8.0, 0.0]) < 1e-6


def test_a_crowd_and_movers_of_other_laws_pass_through_one_another() -> None:
    movers = [walker([-4, 0], [4, 0]), circle([4, 0], 0.3, law="bounce", velocity=[-1.0, 0.0])]
    places, velocities = watch(begin(scenario(movers)), 60)
    assert np.abs(places[..., 1]).max() == 0.0
    assert velocities[:, 0, 1, 0] == pytest.approx(-1.0)


def test_a_body_without_speed_stands_and_the_others_go_round_it() -> None:
    places, _ = watch(begin(scenario([walker([0, 0], [5, 5], speed=0.0), walker([-3, 0.01], [3, 0.0])])), 150)
    assert (places[:, 0, 0] == 0.0).all()
    assert least_distance(places) >= 0.6
    assert norms(places[-1, 0, 1] - [3.0, 0.0]) < 1e-6


def test_a_polygon_of_a_crowd_counts_as_the_disc_about_its_place() -> None:
    triangle = [[-0.4, -0.3], [0.5, -0.2], [0.0, 0.45]]
    motion = {"law": "crowd", "speed": 1.0, "goals": [[-4, 0]]}
    pair = [walker([-4, 0], [4, 0]), {"shape": {"polygon": triangle}, "at": [4, 0], "motion": motion}]
    simulation = begin(scenario(pair))
    gaps = []
    for _ in range(150):
        simulation.advance(np.zeros((1, 1, 2)))
        one, two = (mover.at for mover in simulation.world.layout(0).movers)
        gaps.append(math.dist(one, two))
    assert min(gaps) >= 0.3 + math.hypot(0.5, 0.2)
    assert one == pytest.approx((4.0, 0.0), abs=1e-6) and two == pytest.approx((-4.0, 0.0), abs=1e-6)


# ------------------------------------------------------------------------------------------------ evade


def evader(at: list[float], radius: float = 0.3, **motion: Any) -> dict[str, Any]:
    """A body that flees the robot."""
    return circle(at, radius, law="evade", **motion)


def chase(simulation: Simulation, steps: int) -> tuple[F64, F64]:
    """Places of movers and robots (steps + 1, N, 2), a holonomic robot that heads for the first mover all the time."""
    movers, robots = [movers_of(simulation)[:, 0]], [simulation.world.pose[:, 0, :2].copy()]
    for _ in range(steps):
        simulation.advance((movers[-1] - robots[-1])[:, None])
        movers.append(movers_of(simulation)[:, 0])
        robots.append(simulation.world.pose[:, 0, :2].copy())
    return np.array(movers), np.array(robots)


def hunt(movers: list[dict[str, Any]], start: list[float], **world: Any) -> dict[str, Any]:
    """A world with a robot of radius 0.2 m that starts at a pose."""
    return scenario(movers, robot={"radius": 0.2}, world={"start": start, **world})


def test_an_evader_flees_straight_from_a_robot_in_sight_and_stands_while_it_sees_none() -> None:
    simulation = begin(hunt([evader([0.0, 1.0], speed=0.7, sight=4.0)], [-6.0, 0.0, 0.0]))
    places, velocities = watch(simulation, 60, action=(0.5, 0.0))
    robot = -6.0 + 0.05 * np.arange(61)
    away = places[:-1, 0, 0] - np.column_stack([robot[:-1], np.zeros(60)])
    seen = norms(away) <= 4.0
    assert seen.any() and not seen.all()
    assert velocities[~seen, 0, 0] == pytest.approx(0.0, abs=0.0)
    assert velocities[seen, 0, 0] == pytest.approx(0.7 * away[seen] / norms(away[seen])[:, None])


def test_an_evader_flees_the_nearest_of_several_robots() -> None:
    places = [{"start": [-2.0, 0.0, 0.0]}, {"start": [0.0, 3.0, 0.0]}]
    what = {**hunt([evader([0.0, 0.0], speed=0.5)], [-9.0, -9.0, 0.0]), "robots": places}
    _, velocities = watch(begin(what), 1)
    assert velocities[0, 0, 0] == pytest.approx([0.5, 0.0])


def test_an_evader_driven_against_a_wall_goes_along_it_at_full_speed() -> None:
    """The robot comes square to the wall, 0.2 m beside the evader."""
    simulation = begin(hunt([evader([9.0, 0.0], speed=0.8)], [6.0, -0.2, 0.0]))
    places, velocities = watch(simulation, 60, action=(0.3, 0.0))
    assert norms(velocities) == pytest.approx(0.8)
    assert places[:, 0, 0, 0].max() <= 9.7 + 1e-9
    assert places[-1, 0, 0, 1] > 3.0


def test_an_evader_in_a_corner_stands_and_is_caught() -> None:
    simulation = begin(hunt([evader([9.0, 9.0], speed=0.8)], [6.0, 6.0, 0.0]))
    movers, _ = chase(simulation, 60)
    assert simulation.info()["outcome"][0, 0] == "collision"
    assert movers[-1, 0] == pytest.approx([9.7, 9.7], abs=0.1)


@pytest.mark.parametrize("speed", [0.6, 2.5])
def test_an_evader_that_is_chased_enters_neither_border_nor_still_obstacles(speed: float) -> None:
    still = still_geometry(scenario([], world=STILL_THINGS))
    radius, closest = 0.25, math.inf
    for seed in range(12):
        start = free_places(still, 0.3, 2, seed)
        movers = [evader(start[1], radius, speed=speed, wander=0.3, sight=3.0)]
        world = {**STILL_THINGS, "start": [*start[0], 0.0]}
        simulation = begin(scenario(movers, robot={"radius": 0.02, "max_speed": 1.5}, world=world))
        places, _ = chase(simulation, 300)
        closest = min(closest, float(shapely.distance(still, shapely.points(places)).min()))
    assert closest >= radius - 3e-4


def test_an_evader_that_sees_no_robot_wanders_in_directions_that_it_keeps_for_2_s() -> None:
    movers = [evader([0.0, 0.0], speed=1.0, wander=0.4, sight=1.0), evader([1, 1], speed=1.0, wander=0.4, sight=1.0)]
    _, velocities = watch(begin(scenario(movers, world={"bounds": [-90, -90, 90, 90]})), 200)
    legs = velocities[:, 0].reshape(10, 20, 2, 2)
    assert norms(legs) == pytest.approx(0.4)
    assert (legs == legs[:, :1]).all()
    headings = np.arctan2(legs[:, 0, :, 1], legs[:, 0, :, 0])
    assert len(np.unique(headings)) == 20


def test_a_goal_that_evades_is_caught_by_a_faster_robot_and_keeps_its_room_until_then() -> None:
    target = {"region": [-3, -3, 3, 3], "motion": {"law": "evade", "speed": 0.5, "sight": 6.0}}
    simulation = begin(scenario([], robot={"radius": 0.2}, world={"start": [-8, -8, 0], "target": target}), count=20)
    rooms = []
    for _ in range(1000):
        goals, robots = simulation.world.goal[:, 0], simulation.world.pose[:, 0, :2]
        rooms.append(10.0 - np.abs(goals).max())
        simulation.advance((goals - robots)[:, None] * 10.0)
    assert (simulation.info()["outcome"] == "success").all()
    assert min(rooms) >= 0.3 - 1e-9, "the goal's radius"


# ------------------------------------------------------------------------------------------------ replay


def follower(points: Any, radius: float = 0.3) -> dict[str, Any]:
    """A body that follows a record."""
    return circle(None, radius, law="replay", points=points)


def test_a_record_is_followed_exactly_with_straight_lines_between() -> None:
    rng = np.random.default_rng(0)
    times = np.sort(rng.uniform(-2.0, 20.0, 30))
    points = np.column_stack([times, rng.uniform(-8, 8, (30, 2))])
    places, velocities = watch(begin(scenario([follower(points.tolist())])), 190)
    time = STEP * np.arange(191)
    expected = np.column_stack([np.interp(time, times, points[:, i]) for i in (1, 2)])
    inside = (times[0] <= time) & (time <= times[-1])
    assert inside.sum() > 150
    assert np.abs(places[inside, 0, 0] - expected[inside]).max() < 1e-12
    after = inside[1:] & inside[:-1]
    assert velocities[after, 0, 0] * STEP == pytest.approx(np.diff(expected, axis=0)[after], abs=1e-12)


def test_who_follows_a_record_is_seen_and_hit_only_from_its_first_to_its_last_time() -> None:
    """He stands right before the robot from 1 s to 2 s; the robot wants to drive on all the time."""
    points = [[1.0, 1.0, 0.0], [2.0, 1.0, 0.0]]
    what = scenario([follower(points)], robot={"radius": 0.2}, world={"start": [0, 0, 0], "goal": [9, 0]})
    what["lidar"] = {"beams": 8, "range": 5.0}
    simulation = begin(what)
    ahead = [float(simulation.world.ranges[0, 0, 0])]
    for _ in range(30):
        simulation.advance(np.zeros((1, 1, 2)))
        ahead.append(float(simulation.world.ranges[0, 0, 0]))
    expected = np.where((np.arange(31) >= 10) & (np.arange(31) <= 20), 0.7, 5.0)
    assert ahead == pytest.approx(expected.tolist(), abs=1e-6)
    outcomes = {}
    for wait in (0, 10, 25):  # drive over the place before he comes, while he is there, and after he has gone
        simulation = begin(what)
        watch(simulation, wait)
        watch(simulation, 15, action=(1.0, 0.0) if wait == 10 else (1.0, 0.0))
        outcomes[wait] = str(simulation.info()["outcome"][0, 0])
    assert outcomes == {0: "collision", 10: "collision", 25: "running"}
    fast = {**what, "robot": {"radius": 0.2, "max_speed": 3.0}}
    simulation = begin(fast)
    watch(simulation, 15, action=(1.0, 0.0))
    assert simulation.info()["outcome"][0, 0] == "running"


@pytest.mark.parametrize("end", ["first", "last"])
def test_a_layout_has_who_follows_a_record_where_the_scan_sees_him_also_in_the_step_that_a_record_names(
    end: str,
) -> None:
    """Three steps of 0.1 s end at 0.30000000000000004 s, which is the 0.3 s of a record; so do others."""
    records = [[[0.0, 1.0, 0.0], [step / 10, 1.0, 0.0]] for step in range(1, 30)]
    if end == "first":
        records = [[[last[0], 1.0, 0.0], [9.0, 1.0, 0.0]] for _, last in records]
    for number, points in enumerate(records, start=1):
        simulation = begin(
            scenario([follower(points)], lidar={"beams": 1, "range": 5.0}, world={"start": [0.0, 0.0, 0.0]})
        )
        for steps in range(number + 2):
            is_due = steps <= number if end == "last" else steps >= number
            [mover] = simulation.world.layout(0).movers
            assert (simulation.world.ranges[0, 0, 0] < 5.0, mover.is_there) == (is_due, is_due), (points, steps)
            simulation.advance(np.zeros((1, 1, 2)))


def test_a_layout_has_records_that_lie_as_near_to_one_another_as_they_may() -> None:
    """What the clock has gone on is taken off their times, which rounds."""
    for second in np.linspace(1.0, 8.0, 50):
        third = second + SMALL
        third = third if third - second >= SMALL else np.nextafter(third, np.inf)
        points = [[-1.0, 0.0, 0.0], [float(second), 1.0, 1.0], [float(third), 1.0, 2.0]]
        simulation = begin(scenario([follower(points)]))
        for _ in range(9):
            simulation.advance(np.zeros((1, 1, 2)))
            [mover] = simulation.world.layout(0).movers
            assert isinstance(mover.motion, Replay)
            times = [time for time, _, _ in mover.motion.points]
            assert times == pytest.approx([time - simulation.world.time[0] for time, _, _ in points], abs=1e-12)


def test_who_comes_in_where_a_robot_stands_touches_it_only_when_he_moves_at_it() -> None:
    what = scenario([follower([[1.0, 1.0, 0.0], [3.0, -1.0, 0.0]])], robot={"radius": 0.2}, world={"start": [0, 0, 0]})
    simulation = begin(what)
    watch(simulation, 14)
    assert simulation.info()["outcome"][0, 0] == "running"
    watch(simulation, 2)
    assert simulation.info()["outcome"][0, 0] == "collision", "he is 0.5 m away at 1.5 s"


def test_a_goal_that_follows_a_record_stands_before_it_begins_and_after_it_ends() -> None:
    motion = {"law": "replay", "points": [[1.0, 2.0, 0.0], [3.0, 4.0, 2.0]]}
    simulation = begin(scenario([], world={"target": {"motion": motion}}))
    goals = [simulation.world.goal[0, 0].copy()]
    for _ in range(50):
        simulation.advance(np.zeros((1, 1, 2)))
        goals.append(simulation.world.goal[0, 0].copy())
    time = STEP * np.arange(51)
    expected = np.column_stack([np.interp(time, [1.0, 3.0], ends) for ends in ([2.0, 4.0], [0.0, 2.0])])
    assert np.array(goals) == pytest.approx(expected, abs=1e-12)


def write_csv(path: Path, rows: list[Any], header: str = "time_s,pedestrian,x_m,y_m") -> str:
    """A recording; returns its path."""
    lines = [header, *(row if isinstance(row, str) else ",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


def recorded(path: str, **world: Any) -> dict[str, Any]:
    """A world with the pedestrians of a recording."""
    return {
        "robot": {"radius": 0.2},
        "lidar": {"beams": 8, "range": 10.0},
        "time": {"step": STEP, "limit": world.pop("limit", 30.0)},
        "world": {"family": "replay", "path": path, **world},
    }


def rows_of_walkers(count: int, seed: int = 0) -> list[tuple[float, int, float, float]]:
    """Pedestrians who walk along x, a record each 0.4 s, in the order of time."""
    rng = np.random.default_rng(seed)
    rows = []
    for pedestrian in range(count):
        begin_time, y, speed = round(rng.uniform(0, 40) / 0.4) * 0.4, rng.uniform(-4, 4), rng.choice([-1.3, 1.3])
        for record in range(20):
            x = speed * 0.4 * (record - 9.5)
            rows.append((round(begin_time + 0.4 * record, 3), pedestrian, round(x, 3), round(y + 0.01 * record, 3)))
    return sorted(rows)


def assert_hits_the_records(path: str, rows: Any, since: float, **world: Any) -> None:
    """The places of all who are there are those recorded, at each time that is a time of a step."""
    what = recorded(path, start_time=since, start=[-1e-3, 0.0, 0.0], goal=[0.0, 0.0], **world)
    what["robot"] = {"radius": 1e-4}
    simulation = begin_where_free(what)
    steps = round(what["time"]["limit"] / STEP) - 1
    places, _ = watch(simulation, steps)
    compared = 0
    for time, _, x, y in rows:
        step = round((time - since) / STEP)
        if 0 <= step <= steps and abs(since + step * STEP - time) < 1e-6:
            assert norms(places[step, 0] - [x, y]).min() < 1e-9
            compared += 1
    assert compared > 30
    there = (np.abs(places[:, 0]) < 1e5).all(axis=-1).sum(axis=1)
    by_pedestrian: dict[Any, list[float]] = {}
    for time, pedestrian, _, _ in rows:
        by_pedestrian.setdefault(pedestrian, []).append(time)
    for step in range(steps + 1):
        now = since + step * STEP
        spans = [(min(times), max(times)) for times in by_pedestrian.values()]
        surely = sum(first + 1e-6 <= now <= last - 1e-6 for first, last in spans)
        at_most = sum(first - 1e-6 <= now <= last + 1e-6 for first, last in spans)
        assert surely <= there[step] <= at_most


def begin_where_free(what: dict[str, Any]) -> Simulation:
    """A world whose robot, which is as good as a point, stands in the first corner where nobody is."""
    xmin, ymin, xmax, ymax = load(what).world.box
    for x, y in itertools.product((xmin + 0.01, xmax - 0.01), (ymin + 0.01, ymax - 0.01)):
        what["world"] = {**what["world"], "start": [x, y, 0.0], "goal": [x + 1e-3, y]}
        try:
            return begin(what)
        except ValueError:
            continue
    raise AssertionError("somebody in each corner")


def test_replay_hits_the_recorded_positions_of_a_file(tmp_path: Path) -> None:
    rows = rows_of_walkers(12)
    assert_hits_the_records(write_csv(tmp_path / "walk.csv", rows), rows, since=rows[0][0], limit=50.0)


@pytest.mark.parametrize("name", ["pedestrians_eth.csv", "pedestrians_hotel.csv"])
def test_replay_hits_the_recorded_positions_of_the_real_files(name: str, shared_data: Path) -> None:
    path = shared_data / name
    rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()[1:]]
    numbers = [(float(time), pedestrian, float(x), float(y)) for time, pedestrian, x, y in rows]
    first = min(time for time, *_ in numbers)
    assert_hits_the_records(str(path), numbers, since=first + 100.0, limit=60.0)


def test_the_bounds_of_a_recording_hold_all_recorded_bodies_and_the_margin(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "two.csv", [(0, 1, -3, 1), (1, 1, 4, 2.5), (0.5, 7, 0, -2)])
    world = load(recorded(path, margin=0.5, radius=0.25)).world
    assert world.bounds == pytest.approx((-3.75, -2.75, 4.75, 3.25))
    given = load(recorded(path, bounds=[-9, -9, 9, 9])).world
    assert given.bounds == (-9.0, -9.0, 9.0, 9.0)


def test_who_leaves_given_bounds_is_not_there_until_he_comes_in_again(tmp_path: Path) -> None:
    rows = [(t, 1, x, 0.0) for t, x in enumerate([0.0, 2.0, 4.0, 6.0, 4.0, 2.0, 0.0])]
    path = write_csv(tmp_path / "out.csv", rows)
    what = recorded(path, bounds=[-5, -5, 5, 5], start=[-4, -4, 0], goal=[-4, 4], start_time=0.0, limit=6.0)
    places, _ = watch(begin(what), 59)
    there = np.abs(places[:, 0]).max(axis=-1) < 1e5
    assert there.sum(axis=1).tolist() == [1] * 21 + [0] * 19 + [1] * 20
    time = STEP * np.arange(60)
    expected = np.interp(time, [0, 2, 4, 6], [0, 4, 4, 0])
    seen = there.any(axis=1)
    assert places[:, 0][there][:, 0] == pytest.approx(expected[seen])


def test_an_episode_begins_within_the_window_and_the_recording_does_not_run_out(tmp_path: Path) -> None:
    path = write_csv(tmp_path / "walk.csv", rows_of_walkers(30))

    def first_times(**world: Any) -> F64:
        """How long after the start of the recording the episodes of 60 seeds begin, from what pedestrian 0 does."""
        start = []
        for seed in range(60):
            layout = begin(recorded(path, limit=5.0, **world), seed=seed).world.layout(0)
            motions = [mover.motion for mover in layout.movers if isinstance(mover.motion, Replay)]
            x, y = motions[0].points[0][1:]
            [time] = {t for t, _, u, v in rows_of_walkers(30) if (u, v) == (x, y)}
            start.append(time - motions[0].points[0][0])
        return np.array(start)

    first, last = load_recording(path).times
    drawn = first_times()
    assert drawn.min() >= first and drawn.max() <= last - 5.0
    assert np.ptp(drawn) > 0.7 * (last - 5.0 - first)
    drawn = first_times(window=[10.0, 20.0])
    assert drawn.min() >= 10.0 - 1e-9 and drawn.max() <= 15.0 + 1e-9
    assert (first_times(window=[10.0, 20.0]) == drawn).all()


def test_a_robot_without_a_place_of_its_own_starts_clear_and_goes_across_the_flow(tmp_path: Path) -> None:
    """The pedestrians walk along a line at 0.3 rad, one way or the other."""
    turn = np.array([[math.cos(0.3), math.sin(0.3)], [-math.sin(0.3), math.cos(0.3)]])
    rows = [(t, p, *(np.array([x, 2.0 * y]) @ turn).round(6).tolist()) for t, p, x, y in rows_of_walkers(30)]
    path = write_csv(tmp_path / "oblique.csv", rows)
    assert load_recording(path).flow() == pytest.approx(0.3, abs=0.05)
    sides = set()
    for seed in range(20):
        simulation = begin(recorded(path), seed=seed)
        layout = simulation.world.layout(0)
        x, y, heading = layout.starts[0]
        way = layout.goals[0] - [x, y]
        assert abs(math.cos(heading - load_recording(path).flow())) < 1e-9
        assert way / np.hypot(*way) == pytest.approx([math.cos(heading), math.sin(heading)])
        assert np.hypot(*way) > 5.0
        there = [mover for mover in layout.movers if mover.is_there]
        assert all(math.dist((x, y), mover.at) >= 0.3 + 0.2 + 0.5 - 1e-9 for mover in there)
        sides.add(heading > math.pi / 2.0)
    assert sides == {False, True}


HEADER = "time_s,pedestrian,x_m,y_m"
BAD_FILES = {
    "no header": (["0.0,1,2.0,3.0"], "0.0,1,2.0,3.0", "line 1: got the header"),
    "another header": (["0.0,1,2.0,3.0"], "time,id,x,y", "line 1: got the header 'time,id,x,y'"),
    "nothing": ([], HEADER, "no record in it"),
    "a column missing": (["0,1,2,3", "1,1,2"], HEADER, "line 3: got '1,1,2', expected 4 columns"),
    "a column too many": (["0,1,2,3,4"], HEADER, "line 2: got '0,1,2,3,4', expected 4 columns"),
    "a gap": (["0,1,2,3", "1,1,,3"], HEADER, "line 3: got '1,1,,3', expected 4 columns, none of them empty"),
    "an empty line": (["0,1,2,3", "", "1,1,2,3"], HEADER, "line 3: got ''"),
    "not a number": (["0,1,2,3", "1,1,two,3"], HEADER, "line 3: got '1,1,two,3', expected numbers"),
    "NaN": (["0,1,2,3", "1,1,nan,3"], HEADER, "line 3: got '1,1,nan,3', expected finite"),
    "infinite": (["inf,1,2,3"], HEADER, "line 2: got 'inf,1,2,3', expected finite"),
    "unsorted": (
        ["0,1,2,3", "0,2,2,3", "0.8,1,2,3", "0.4,1,2,3"],
        HEADER,
        "line 5: got time 0.4 of pedestrian 1, expected one after 0.8",
    ),
    "the same time twice": (["0,1,2,3", "0,1,2,3"], HEADER, "line 3: got time 0 of pedestrian 1"),
    "a quote that is not closed": (["0,1,2,3", '0,"2,2,3'], HEADER, "line 3: not csv"),
}


@pytest.mark.parametrize("fault", BAD_FILES)
@pytest.mark.parametrize("world", [{}, {"bounds": [-10, -10, 10, 10]}])
def test_a_recording_that_is_none_is_refused_with_the_line(fault: str, world: dict[str, Any], tmp_path: Path) -> None:
    rows, header, words = BAD_FILES[fault]
    path = write_csv(tmp_path / "bad.csv", list(rows), header)
    with pytest.raises(ScenarioError) as told:
        load(recorded(path, **world))
    assert words in str(told.value) and "world.path" in str(told.value) and path in str(told.value)


def test_a_recording_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "picture.csv"
    path.write_bytes(b"\x89PNG\r\n\x1a\n\xff\xfe")
    with pytest.raises(ScenarioError, match="not a csv file"):
        load(recorded(str(path)))


@pytest.mark.parametrize(
    ("world", "words"),
    [
        ({"start_time": 99.0}, "start_time: got 99, expected a time from 0 to 1"),
        ({"window": [0.5, 3.0]}, r"window: got \[0.5, 3.0\], expected times from 0 to 1"),
        ({"window": [0.2, 0.5], "start_time": 0.3}, "window: expected either start_time or window"),
        ({"start": [0, 0, 0]}, "goal: expected both start and goal, or neither"),
        ({"start": [50, 0, 0], "goal": [0, 0]}, "start: got"),
        ({"path": "nowhere.csv"}, "path: got .*nowhere.csv', expected a file"),
    ],
)
def test_a_recorded_world_that_cannot_be_is_refused(world: dict[str, Any], words: str, tmp_path: Path) -> None:
    path = write_csv(tmp_path / "one.csv", [(0, 1, 0, 0), (1, 1, 5, 5)])
    with pytest.raises(ScenarioError, match=words):
        load(recorded(**{"path": path, **world}))


@pytest.mark.parametrize(
    ("mover", "words"),
    [
        (follower([[0, 0, 0], [0, 1, 1]]), r"movers.0.motion.points.1: got time 0, expected more than 0"),
        (follower([]), "points: got .*, expected a list of at least 1"),
        (follower([[0, 0, 0, 0]]), r"points.0: got \[0, 0, 0, 0\], expected \[time, x, y\]"),
        (follower([[0, 0, 0], [1, 50, 0]]), r"points.1: got \[50.0, 0.0\], expected a point in"),
        ({**follower([[0, 1, 1]]), "at": [0, 0]}, r"movers.0.at: got \[0.0, 0.0\], expected \[1.0, 1.0\]"),
        (walker([0, 0], [50, 0]), r"goals.0: got \[50.0, 0.0\], expected a point in"),
        (walker([0, 0], horizon=0.0), "horizon: got 0.0, expected a number above 0"),
        (evader([0, 0], speed=0.5, wander=0.8), "wander: got 0.8, expected at most speed"),
        (evader([0, 0], speed=0.5, sight=0.0), "sight: got 0.0, expected a number above 0"),
    ],
)
def test_motion_that_cannot_be_is_refused(mover: dict[str, Any], words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        load(scenario([mover]))


def test_who_has_yet_to_come_leaves_room_for_the_robots_start() -> None:
    late = follower([[5.0, 0.0, 0.0], [6.0, 1.0, 0.0]])
    assert begin(hunt([late], [0.0, 0.0, 0.0])).info()["outcome"][0, 0] == "running"
    with pytest.raises(ScenarioError, match=r"in its way: movers.0"):
        load(hunt([follower([[-1.0, 0.0, 0.0], [6.0, 1.0, 0.0]])], [0.0, 0.0, 0.0]))


# ------------------------------------------------------------------------------------------------ field


def test_the_pedestrians_of_a_field_have_the_stated_number_size_and_speeds_and_overlap_nothing() -> None:
    world = {"family": "field", "obstacles": 12, "moving": 0.5, "pedestrians": 25, "pedestrian_speeds": [0.4, 0.9]}
    simulation = begin({"lidar": {"beams": 1}, "world": {**world, "pedestrian_radius": 0.2, "solvable": 0.3}}, count=50)
    speeds: list[float] = []
    for row in range(50):
        layout = simulation.world.layout(row)
        walkers = [mover for mover in layout.movers if isinstance(mover.motion, Crowd)]
        others = [mover for mover in layout.movers if not isinstance(mover.motion, Crowd)]
        assert len(walkers) == 25 and len(others) == 6 and len(layout.circles) + len(layout.polygons) == 6
        assert {mover.outline for mover in walkers} == {0.2}
        speeds += map(speed_of, walkers)
        places = np.array([mover.at for mover in walkers])
        assert least_distance(np.stack([places, places])[:, None]) >= 0.4
        circles = [shapely.Point(x, y).buffer(radius) for x, y, radius in layout.circles]
        still = shapely.union_all([*circles, *(shapely.Polygon(rings[0]) for rings in layout.polygons)])
        assert shapely.distance(still, shapely.points(places)).min() >= 0.2 - 1e-9
        assert norms(places - layout.starts[0, :2]).min() >= 1.0 + 0.2 + 0.2
    assert 0.4 <= min(speeds) < 0.42 and 0.88 < max(speeds) <= 0.9


@pytest.mark.parametrize("laws", ["crowd", "bounce crowd", "crowd random_walk", "bounce random_walk crowd"])
def test_the_laws_of_a_field_are_in_equal_parts_with_crowd_among_them(laws: str) -> None:
    names = laws.split()
    world = {"family": "field", "obstacles": 12, "moving": 1.0, "laws": names, "sizes": [0.2, 0.4]}
    simulation = begin({"lidar": {"beams": 1}, "world": world}, count=5)
    for row in range(5):
        counts = Counter(mover.motion.law for mover in simulation.world.layout(row).movers)
        assert counts == dict.fromkeys(names, 12 // len(names))


def test_a_field_of_a_crowd_keeps_everybody_apart_whatever_their_shapes() -> None:
    world = {"family": "field", "obstacles": 20, "moving": 0.8, "laws": ["crowd"], "solvable": 0.3, "pedestrians": 5}
    simulation = begin({"robot": {"radius": 0.1}, "lidar": {"beams": 1}, "world": world}, count=10)
    first = int(simulation.world.spec["discs"][0])
    numbers = [*range(13), *range(first, first + 8)]
    radius = simulation.world.array("body_radius")[:, numbers]
    for _ in range(300):
        simulation.advance(np.zeros((10, 1, 2)))
        places = np.stack([simulation.world.array(name)[:, numbers] for name in ("body_x", "body_y")], axis=-1)
        gaps = norms(places[:, :, None] - places[:, None]) - radius[:, :, None] - radius[:, None] + 99.0 * np.eye(21)
        assert gaps.min() >= 0.0
        assert (np.abs(places) <= 10.0 - radius[..., None] + 1e-9).all()


@pytest.mark.parametrize(
    "motion", [{"law": "crowd", "speed": 0.5}, {"law": "evade", "speed": 0.5, "sight": 4.0, "wander": 0.2}]
)
def test_a_fields_goal_under_the_new_laws_keeps_clear_of_border_and_obstacles(motion: dict[str, Any]) -> None:
    world = {"family": "field", "solvable": 0.3, "target_motion": motion}
    simulation = begin({"robot": {"radius": 0.2}, "lidar": {"beams": 1}, "world": world}, count=10)
    layouts = [simulation.world.layout(row) for row in range(10)]
    assert layouts[0].target == load(simulation.scenario).world.target_motion  # type: ignore[union-attr]
    begins = simulation.world.goal.copy()
    rooms = []
    for _ in range(400):
        simulation.advance(np.zeros((10, 1, 2)))
        for layout, (x, y) in zip(layouts, simulation.world.goal[:, 0], strict=True):
            still = [math.dist((x, y), (u, v)) - r for u, v, r in layout.circles]
            still += [shapely.Polygon(rings[0]).distance(shapely.Point(x, y)) for rings in layout.polygons]
            rooms.append(min(*still, 10.0 - abs(x), 10.0 - abs(y)))
    assert min(rooms) >= 0.5 - 1e-9, "the goal's clearance"
    assert np.median(norms(simulation.world.goal - begins)) > 1.0


@pytest.mark.parametrize(
    ("motion", "name"),
    [
        ({"law": "replay", "points": [[0, 0, 0]]}, "replay"),
        ({"law": "crowd", "speed": 1.0, "goals": [[0, 0]]}, "crowd with goals"),
    ],
)
def test_a_field_refuses_a_goal_that_goes_to_given_places(motion: dict[str, Any], name: str) -> None:
    with pytest.raises(ValueError, match=f"crowd or evade, not {name}: its free space is drawn"):
        Simulation({"world": {"family": "field", "target_motion": motion}})


# ------------------------------------------------------------------------------------------------ all three


def lively(robots: int = 1) -> dict[str, Any]:
    """Everything that looks, in one world, among other movers."""
    movers = [
        walker([0, 3]),
        walker([3, 0], [-3, 0.2], [4, 4]),
        walker([-3, 0]),
        evader([5, 5], speed=0.9, wander=0.3, sight=4.0),
        follower([[-1.0, -6.0, 4.0], [3.0, 2.0, 4.0], [5.0, 2.0, -2.0]]),
        follower([[2.0, 6.0, -4.0], [9.0, -2.0, -4.0]]),
        circle([1, -3], 0.2, law="random_walk", speed=1.0),
        circle([1, -5], 0.2, law="waypoints", points=[[4, -5], [1, -6]], speed=1.0),
        {**walker([6, -6]), "shape": {"polygon": [[-0.4, -0.3], [0.5, -0.2], [0.0, 0.45]]}},
    ]
    target = {"at": [7, 7], "motion": {"law": "crowd", "speed": 0.6}}
    world = {"family": "explicit", "start": [-6, -6, 0.8], "target": target, "circles": [[0, 0, 0.5]]}
    return {
        "robot": {"radius": 0.2, "kinematics": "differential"},
        "lidar": {"beams": 17, "range": 6.0, "noise": 0.02},
        "robots": {"count": robots},
        "world": {**world, "movers": movers},
    }


def play(simulation: Simulation, actions: F64) -> list[Any]:
    """All that steps give, as lists that compare exactly."""
    result = []
    for action in actions:
        transition = simulation.step(action)
        result.append([array.tolist() for array in transition])
        result.append([simulation.world.array(name)[:, :9].tolist() for name in ("seed", "steps")])
    return result


@pytest.mark.parametrize("robots", [1, 2])
def test_bodies_that_look_do_the_same_in_a_batch_alone_and_in_threads(robots: int) -> None:
    actions = np.random.default_rng(0).uniform(-1, 1, (120, 6, robots, 2))
    batch, threads = (Simulation(lively(robots), count=6, threads=n) for n in (1, 3))
    for simulation in (batch, threads):
        simulation.reset(seeds=range(6))
    observations = [batch.step(action).observation for action in actions]
    others = [threads.step(action).observation for action in actions]
    threads.close()
    assert (np.array(observations) == np.array(others)).all()
    single = begin(lively(robots), seed=4)
    alone = [single.step(action[4:5]).observation for action in actions]
    assert (np.array(alone)[:, 0] == np.array(observations)[:, 4]).all()


def test_bodies_that_look_go_on_from_a_saved_state_bit_for_bit() -> None:
    actions = np.random.default_rng(0).uniform(-1, 1, (150, 2, 1, 2))
    simulation = begin(lively(), count=2)
    play(simulation, actions[:60])
    saved = simulation.save()
    first = play(simulation, actions[60:])
    simulation.reset()
    simulation.restore(saved)
    assert play(simulation, actions[60:]) == first
    other = Simulation(lively(), count=2)
    other.world.grow(Capacity(discs=50, steered=1))
    other.restore(saved)
    assert play(other, actions[60:]) == first


@pytest.mark.parametrize("more", [Capacity(discs=40), Capacity(polygons=9), Capacity(walls=99, ways=31)])
def test_room_for_more_changes_nothing_for_bodies_that_look(more: Capacity) -> None:
    actions = np.random.default_rng(1).uniform(-1, 1, (120, 2, 2, 2))
    plain, grown = begin(lively(2), count=2), begin(lively(2), count=2)
    assert play(plain, actions[:50]) == play(grown, actions[:50])
    grown.world.grow(more)
    assert play(plain, actions[50:]) == play(grown, actions[50:])
    assert (plain.reset() == grown.reset()).all()
    assert play(plain, actions) == play(grown, actions)


def test_a_world_in_which_nobody_looks_makes_room_when_somebody_does() -> None:
    simulation = begin(scenario([circle([0, 0], 0.3, law="bounce", velocity=[1.0, 0.3])]), count=2)
    assert simulation.world.array("body_foresight").shape == (2, 0)
    watch(simulation, 10)
    before = simulation.world.layout(0)
    simulation.world.load(1, crossing(0, 5))
    assert simulation.world.layout(0).movers == before.movers
    simulation.begin(np.array([1]))
    moving = watch(simulation, 20)[0]
    assert norms(moving[-1, 1, :1] - moving[0, 1, :1]).min() > 0.5
    assert moving[-1, 0, 0] == pytest.approx(np.array(before.movers[0].at) + 2.0 * np.array([1.0, 0.3]))


def test_a_layout_under_the_new_laws_is_read_back_as_it_was_loaded() -> None:
    simulation = begin(lively())
    layout = simulation.world.layout(0)
    expected = load(lively()).world
    assert expected.family == "explicit"
    motions = [mover.motion for mover in expected.movers]
    assert [mover.motion for mover in layout.movers] == motions
    assert layout.target == Crowd(law="crowd", speed=0.6)
    assert layout.movers[3].motion == Evade(law="evade", speed=0.9, wander=0.3, sight=4.0)
    assert layout.movers[4].at == (-4.0, 4.0) and not layout.movers[5].is_there
    other = begin(scenario([walker([0, 0])]))
    other.world.load(0, layout)
    assert [(mover.at, mover.motion) for mover in other.world.layout(0).movers] == [
        (mover.at, mover.motion) for mover in layout.movers
    ]


def test_a_record_read_in_mid_episode_continues_as_the_episode_does() -> None:
    movers = [
        follower([[-1.0, -6.0, 4.0], [3.0, 2.0, 4.0], [5.0, 2.0, -2.0]]),
        follower([[3.0, 6.0, -4.0], [9.0, -2.0, -4.0]]),
        follower([[0.0, 5.0, 5.0], [1.0, 6.0, 5.0]]),
    ]
    whole, resumed = begin(scenario(movers)), begin(scenario(movers))
    watch(whole, 17)
    layout = whole.world.layout(0)
    resumed.world.load(0, replace(layout))
    resumed.begin(resumed.all_rows)
    assert watch(resumed, 80)[0] == pytest.approx(watch(whole, 80)[0], abs=1e-9)


def test_goals_still_to_come_are_read_in_the_order_in_which_they_come() -> None:
    simulation = begin(scenario([walker([0, 0], [2, 0], [2, 2], [0, 2])]))
    watch(simulation, 30)
    [mover] = simulation.world.layout(0).movers
    assert isinstance(mover.motion, Crowd) and mover.motion.goals == ((2.0, 2.0), (0.0, 2.0), (2.0, 0.0))
