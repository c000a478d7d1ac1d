"""The arrays of a World: laws of motion against closed forms, growth, snapshots, layouts there and back."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from scipy import stats

from bug_gym.config import Bounce, RandomWalk, Scenario, Waypoints, load
from bug_gym.limits import FAST
from bug_gym.scenarios import draw_layout
from bug_gym.simulation import Simulation
from bug_gym.world import Capacity, World, beam_angles
from bug_gym.worlds.layout import Layout, Mover

F64 = NDArray[np.float64]

STEP = 0.1
TRIANGLE = [[-0.4, -0.3], [0.5, -0.2], [0.0, 0.45]]


def movers_scenario(movers: list[dict[str, Any]], **world: Any) -> dict[str, Any]:
    """Movers in an explicit world; the robot is small and shut away in a corner."""
    return {
        "robot": {"radius": 0.01},
        "lidar": {"beams": 1, "range": 0.1},
        "time": {"step": STEP, "limit": 100000.0},
        "world": {"family": "explicit", "start": [-9.98, -9.98, 0.0], "goal": [9.5, 9.5], "movers": movers, **world},
    }


def circle(at: list[float], radius: float, **motion: Any) -> dict[str, Any]:
    """A circular mover."""
    return {"shape": {"circle": radius}, "at": at, "motion": motion}


def polygon(at: list[float], corners: list[list[float]], **motion: Any) -> dict[str, Any]:
    """A polygonal mover."""
    return {"shape": {"polygon": corners}, "at": at, "motion": motion}


def record(scenario: dict[str, Any], steps: int, seed: int = 0) -> tuple[F64, F64]:
    """Places (steps + 1, B, 2) and velocities of all movers, the circles first, over an episode."""
    simulation = Simulation(scenario)
    simulation.reset(seeds=[seed])
    places, velocities = [], []
    stand = np.zeros((1, 1, 2))
    for number in range(steps + 1):
        if number:
            simulation.step(stand)
        world = simulation.world
        circles, first = int(world.array("moving_disc_count")[0, 0]), int(world.spec["discs"][0])
        bodies = [*range(circles), *range(first, first + int(world.array("moving_polygon_count")[0, 0]))]
        row = {name: world.array(name)[0, bodies] for name in ("body_x", "body_y", "body_vx", "body_vy")}
        places.append(np.column_stack([row["body_x"], row["body_y"]]))
        velocities.append(np.column_stack([row["body_vx"], row["body_vy"]]))
    return np.array(places), np.array(velocities)


# ------------------------------------------------------------------------------------------------ bounce


def folded(x: Any, low: float, high: float) -> F64:
    """Where a point going straight would be if it were reflected at `low` and `high`: a billiard unfolded."""
    inside: F64 = low + np.abs((x - low + (high - low)) % (2.0 * (high - low)) - (high - low))
    return inside


def test_a_circle_in_a_rectangle_follows_the_unfolded_billiard_for_10000_steps() -> None:
    radius, at, velocity = 0.3, np.array([1.0, 2.0]), np.array([1.37, -0.61])
    places, velocities = record(
        movers_scenario([circle([1.0, 2.0], radius, law="bounce", velocity=[1.37, -0.61])]), 10000
    )
    time = STEP * np.arange(10001)[:, None]
    expected = folded(at + velocity * time, -10.0 + radius, 10.0 - radius)
    assert np.abs(places[:, 0] - expected).max() < 1e-7
    assert np.abs(np.abs(velocities[:, 0]) - np.abs(velocity)).max() < 1e-12


def test_a_circle_at_20_m_per_s_between_walls_1_m_apart_follows_the_unfolded_billiard() -> None:
    """Several reflections within a step."""
    walls = [[[-9, 1], [9, 1], [9, 1.2], [-9, 1.2]], [[-9, 0], [9, 0], [9, -0.2], [-9, -0.2]]]
    places, _ = record(
        movers_scenario([circle([0.0, 0.5], 0.2, law="bounce", velocity=[0.01, 20.0])], polygons=walls), 500
    )
    expected = folded(0.5 + 20.0 * STEP * np.arange(501), 0.2, 0.8)
    assert np.abs(places[:, 0, 1] - expected).max() < 1e-8


def test_more_reflections_in_a_step_than_the_core_handles_delay_the_body_but_keep_it_inside() -> None:
    walls = [[[-9, 0.41], [9, 0.41], [9, 0.5], [-9, 0.5]], [[-9, 0], [9, 0], [9, -0.2], [-9, -0.2]]]
    scenario = movers_scenario([circle([0.0, 0.2], 0.2, law="bounce", velocity=[0.0, 20.0])], polygons=walls)
    places, velocities = record(scenario, 200)
    assert places[:, 0, 1].min() >= 0.2 - 1e-9 and places[:, 0, 1].max() <= 0.21 + 1e-9
    assert np.abs(np.abs(velocities[:, 0, 1]) - 20.0).max() < 1e-12


@pytest.mark.parametrize("offset", [-0.69, -0.4, 0.0, 0.2, 0.55])
def test_a_circle_is_reflected_by_a_still_circle_at_the_angle_of_incidence(offset: float) -> None:
    """Hit with the offset b, the deflection is pi - 2 asin(b / (r1 + r2)), and the contact point is known."""
    speed, together = 0.8, 0.7
    movers = [circle([-5.0, offset], 0.3, law="bounce", velocity=[speed, 0.0])]
    places, velocities = record(movers_scenario(movers, circles=[[0.0, 0.0, 0.4]]), 100)
    turn = math.pi - 2.0 * math.asin(offset / together)
    direction = np.array([math.cos(turn), math.sin(turn)])
    contact = np.array([-math.sqrt(together**2 - offset**2), offset])
    left = STEP * 100 - (contact[0] + 5.0) / speed
    assert velocities[-1, 0] == pytest.approx(speed * direction, abs=1e-9)
    assert places[-1, 0] == pytest.approx(contact + speed * left * direction, abs=1e-9)


def test_a_circle_is_reflected_by_a_polygons_corner_as_by_a_circle_of_its_own_radius_about_it() -> None:
    """Head on to the corner of a square standing on it, 0.1 m beside the axis."""
    diamond = [[0, -1], [1, 0], [0, 1], [-1, 0]]
    movers = [circle([-5.0, 0.1], 0.5, law="bounce", velocity=[1.0, 0.0])]
    places, velocities = record(movers_scenario(movers, polygons=[diamond]), 70)
    contact = np.array([-1.0 - math.sqrt(0.5**2 - 0.1**2), 0.1])
    turn = math.pi - 2.0 * math.asin(0.1 / 0.5)
    direction = np.array([math.cos(turn), math.sin(turn)])
    assert velocities[-1, 0] == pytest.approx(direction, abs=1e-9)
    assert places[-1, 0] == pytest.approx(contact + (7.0 - contact[0] - 5.0) * direction, abs=1e-9)


def test_a_body_that_runs_into_a_right_corner_comes_back_the_way_it_came() -> None:
    movers = [circle([8.0, 8.0], 0.5, law="bounce", velocity=[1.0, 1.0])]
    places, velocities = record(movers_scenario(movers), 30)
    assert velocities[-1, 0] == pytest.approx([-1.0, -1.0])
    assert places[-1, 0] == pytest.approx([8.0, 8.0])


STILL_THINGS: dict[str, Any] = {
    "circles": [[0.0, 0.0, 1.0], [4.0, 4.0, 0.5], [4.0, 5.0, 0.5], [-6.0, 3.0, 1.5]],
    "polygons": [
        [[-4, -4], [-2, -4], [-2, -2]],
        [[5, -6], [8, -6], [8, -1], [7, -1], [7, -5], [5, -5]],
        {"shell": [[-8, -9], [-5, -9], [-5, -6], [-8, -6]], "holes": [[[-7, -8], [-6, -8], [-6, -7], [-7, -7]]]},
    ],
}


def still_geometry(scenario: Scenario) -> Any:
    """Everything that stands, without the border, as one shapely geometry."""
    layout = draw_layout(scenario, 0, 0)
    circles = [shapely.Point(x, y).buffer(r, quad_segs=500) for x, y, r in layout.circles]
    return shapely.union_all([*circles, *(shapely.Polygon(rings[0], rings[1:]) for rings in layout.polygons)])


@pytest.mark.parametrize("law", ["bounce", "random_walk"])
def test_movers_keep_their_speed_and_enter_neither_border_nor_obstacles_in_10000_steps(law: str) -> None:
    rng = np.random.default_rng(2)
    still = still_geometry(load(movers_scenario([], **STILL_THINGS)))
    inside = shapely.box(-10, -10, 10, 10)
    movers: list[dict[str, Any]] = []
    outlines, speeds = [], []
    while len(movers) < 12:
        at, radius, speed = rng.uniform(-9, 9, 2), float(rng.uniform(0.1, 0.5)), float(rng.uniform(0.2, 3.0))
        if still.distance(shapely.Point(at)) < 0.7:
            continue
        angle = rng.uniform(-math.pi, math.pi)
        velocity = [speed * math.cos(angle), speed * math.sin(angle)]
        motion = {"law": "bounce", "velocity": velocity} if law == "bounce" else {"law": law, "speed": speed}
        if len(movers) < 8:
            movers.append(circle(at.tolist(), radius, **motion))
            outlines.append(shapely.Point(0, 0).buffer(radius, quad_segs=500))
        else:
            movers.append(polygon(at.tolist(), TRIANGLE, **motion))
            outlines.append(shapely.Polygon(TRIANGLE))
        speeds.append(speed)
    places, velocities = record(movers_scenario(movers, **STILL_THINGS), 10000)
    assert np.abs(np.linalg.norm(velocities, axis=2) - speeds).max() < 1e-9
    for body, outline in enumerate(outlines):
        corners = shapely.get_coordinates(outline)
        low, high = corners.min(axis=0), corners.max(axis=0)
        assert (places[:, body] + low > -10.0 - 1e-6).all() and (places[:, body] + high < 10.0 + 1e-6).all()
        centres = shapely.points(places[:, body])
        if body < 8:
            assert (
                shapely.distance(centres, still).min() > movers[body]["shape"]["circle"] - 1e-4
            )  # arcs are chords there
        else:
            swept = [shapely.affinity.translate(outline, x, y) for x, y in places[::7, body]]
            assert shapely.area(shapely.intersection(swept, still)).max() < 1e-9
        assert shapely.within(centres, inside).all()
        assert np.ptp(places[:, body], axis=0).min() > 1.0, "it got about"


@pytest.mark.parametrize("shape", ["circle", "polygon"])
@pytest.mark.parametrize("side", range(4))
def test_a_body_that_begins_across_the_border_does_not_leave_the_world(shape: str, side: int) -> None:
    """A bar whose bounding circle overlaps the border, and a goal nearer to it than the room it keeps."""
    out = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])[side]
    at, velocity = (9.5 * out).tolist(), (1.0 * out + 0.3 * out[::-1]).tolist()
    if shape == "circle":
        scenario = movers_scenario([])
        scenario["world"]["target"] = {"at": (9.9 * out).tolist(), "motion": {"law": "bounce", "velocity": velocity}}
        scenario["world"]["goal"] = None
    else:
        bar = [[-2, -0.1], [2, -0.1], [2, 0.1], [-2, 0.1]]
        corners = [[x, y] if side % 2 else [y, x] for x, y in bar]
        scenario = movers_scenario([polygon(at, corners, law="bounce", velocity=velocity)])
    simulation = Simulation(scenario)
    simulation.reset(seeds=[0])
    for _ in range(600):
        simulation.step([[[0.0, 0.0]]])
        layout = simulation.world.layout(0)
        places = layout.goals if shape == "circle" else np.array([layout.movers[0].at])
        assert np.abs(places).max() <= 9.9 + 1e-9


# ------------------------------------------------------------------------------------------------ waypoints


@pytest.mark.parametrize("stop", [False, True])
def test_a_mover_is_on_its_line_of_way_points_at_every_time(stop: bool) -> None:
    points, at, speed = [[3.0, 0.0], [3.0, 4.0], [-2.0, 4.0], [-2.0, 4.5]], [0.0, 0.0], 0.77
    scenario = movers_scenario([circle(at, 0.1, law="waypoints", points=points, speed=speed, stop=stop)])
    places, _ = record(scenario, 1000)
    tour = np.array([at, *points, *([] if stop else points * 8)])
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(tour, axis=0).T))])
    gone = speed * STEP * np.arange(1001)
    assert gone[-1] > length[len(points)]
    expected = np.column_stack([np.interp(gone, length, tour[:, axis]) for axis in range(2)])
    assert np.abs(places[:, 0] - expected).max() < 1e-9


def test_a_mover_with_stop_stands_at_its_last_point_and_has_no_velocity_there() -> None:
    movers = [circle([0, 0], 0.1, law="waypoints", points=[[1, 0], [1, 1]], speed=1.0, stop=True)]
    places, velocities = record(movers_scenario(movers), 40)
    assert places[25:, 0] == pytest.approx(np.tile([1.0, 1.0], (16, 1)), abs=1e-12)
    assert (velocities[25:] == 0.0).all()


def test_a_mover_that_loops_through_one_point_stands_there() -> None:
    movers = [circle([0.3, 0.1], 0.1, law="waypoints", points=[[1.0, 0.7]], speed=1.1)]
    places, velocities = record(movers_scenario(movers), 60)
    assert places[20:, 0] == pytest.approx(np.tile([1.0, 0.7], (41, 1)), abs=1e-12)
    assert (velocities[20:] == 0.0).all()


def test_more_way_points_in_a_step_than_the_core_handles_delay_a_mover_but_let_it_leap_nowhere() -> None:
    points = [[0.001, 0.0], [0.0, 0.0]] * 16 + [[5.0, 0.0]]
    places, _ = record(movers_scenario([circle([0, 0], 0.1, law="waypoints", points=points, speed=20.0, stop=True)]), 6)
    assert np.abs(np.diff(places[:, 0, 0])).max() <= 20.0 * STEP + 1e-9
    assert places[-1, 0] == pytest.approx([5.0, 0.0])


def test_way_points_lead_through_obstacles_and_other_movers() -> None:
    movers = [
        circle([-4, 0], 0.5, law="waypoints", points=[[4, 0]], speed=1.0, stop=True),
        polygon([4, 0], TRIANGLE, law="waypoints", points=[[-4, 0]], speed=1.0, stop=True),
    ]
    places, _ = record(movers_scenario(movers, circles=[[0, 0, 1]]), 100)
    assert places[-1] == pytest.approx(np.array([[4.0, 0.0], [-4.0, 0.0]]), abs=1e-9)


# ------------------------------------------------------------------------------------------------ random walk

WIDE = {"bounds": [-5000.0, -5000.0, 5000.0, 5000.0], "start": [-4000.0, 0.0, 0.0], "goal": [4000.0, 0.0]}


def walk(seed: int, steps: int, count: int = 1, **motion: Any) -> F64:
    """Velocities (steps, B, 2) of random walkers in a world that has no end for them."""
    motions = {"law": "random_walk", "speed": 1.3, "min_leg": 0.8, "max_leg": 2.1, **motion}
    _, velocities = record(movers_scenario([circle([0, i], 0.1, **motions) for i in range(count)], **WIDE), steps, seed)
    return velocities


def test_a_random_walker_keeps_its_speed_and_its_legs_last_as_long_as_stated() -> None:
    velocities = walk(0, 6000)[:, 0]
    assert np.hypot(*velocities.T) == pytest.approx(1.3, abs=1e-12)
    turns = np.nonzero((np.diff(velocities, axis=0) != 0.0).any(axis=1))[0]
    legs = np.diff(turns) * STEP
    assert legs.min() >= 0.8 - STEP - 1e-9 and legs.max() <= 2.1 + STEP + 1e-9
    assert abs(legs.mean() - 1.45) < 4.0 * (1.3 / math.sqrt(12.0)) / math.sqrt(len(legs))
    assert legs.min() < 1.0 and legs.max() > 1.9


def test_a_random_walkers_headings_are_uniform_and_independent() -> None:
    velocities = walk(1, 8000)[:, 0]
    turns = (np.diff(velocities, axis=0) != 0.0).any(axis=1)
    headings = np.arctan2(velocities[1:, 1], velocities[1:, 0])[turns]
    assert stats.kstest(headings, "uniform", args=(-math.pi, 2.0 * math.pi)).pvalue > 1e-3
    change = np.cos(np.diff(headings))
    assert abs(change.mean()) < 4.0 * math.sqrt(0.5 / len(change))


def test_random_walkers_differ_between_seeds_and_from_one_another() -> None:
    here, there = walk(0, 40, count=3), walk(1, 40, count=3)
    first = np.concatenate([here[0], there[0]])
    assert len(np.unique(np.round(first, 6), axis=0)) == 6
    assert (walk(0, 40, count=3) == here).all()


def test_a_random_walker_is_reflected_between_turns() -> None:
    movers = [circle([9.0, 0.0], 0.3, law="random_walk", speed=1.0, min_leg=50.0, max_leg=60.0)]
    for seed in range(10):
        places, velocities = record(movers_scenario(movers), 300, seed)
        for axis in range(2):
            expected = folded(places[0, 0, axis] + velocities[0, 0, axis] * STEP * np.arange(301), -9.7, 9.7)
            assert np.abs(places[:, 0, axis] - expected).max() < 1e-9


# ------------------------------------------------------------------------------------------------ still and moving


def test_what_stands_never_moves() -> None:
    simulation = Simulation("dynamic", count=3)
    simulation.reset(seeds=[0, 1, 2])
    before = [simulation.world.layout(row) for row in range(3)]
    rng = np.random.default_rng(0)
    for _ in range(100):
        simulation.step(rng.uniform(-1, 1, (3, 1, 2)))
    for row, old in enumerate(before):
        new = simulation.world.layout(row)
        assert (new.circles == old.circles).all() and (new.goals == old.goals).all()
        assert all(
            (a == b).all()
            for one, other in zip(new.polygons, old.polygons, strict=True)
            for a, b in zip(one, other, strict=True)
        )
        assert all(a.at != b.at for a, b in zip(new.movers, old.movers, strict=True))


def test_a_polygon_moves_as_one_body() -> None:
    movers = [polygon([0, 0], TRIANGLE, law="random_walk", speed=1.0)]
    simulation = Simulation(movers_scenario(movers))
    simulation.reset(seeds=[0])
    for _ in range(200):
        simulation.step([[[0.0, 0.0]]])
        [mover] = simulation.world.layout(0).movers
        assert np.asarray(mover.outline) == pytest.approx(np.array(TRIANGLE), abs=1e-12)


# ------------------------------------------------------------------------------------------------ layouts

MOTIONS = (
    Bounce(law="bounce", velocity=(0.3, -0.2)),
    RandomWalk(law="random_walk", speed=0.7, min_leg=0.5, max_leg=4.0),
    Waypoints(law="waypoints", points=((1.0, 2.0), (3.0, -4.0), (0.0, 0.5)), speed=0.9),
    Waypoints(law="waypoints", points=((1.0, 2.0), (3.0, -4.0)), speed=0.0, stop=True),
)


def random_layout(rng: np.random.Generator) -> Layout:
    """Any mixture of what a layout can hold, sense or no sense."""
    movers = tuple(
        Mover(
            float(rng.uniform(0.1, 0.5)) if rng.random() < 0.5 else rng.uniform(-1, 1, (int(rng.integers(3, 7)), 2)),
            (float(rng.uniform(-8, 8)), float(rng.uniform(-8, 8))),
            MOTIONS[int(rng.integers(len(MOTIONS)))],
        )
        for _ in range(int(rng.integers(0, 6)))
    )
    polygons = tuple(
        tuple(rng.uniform(-9, 9, (int(rng.integers(3, 9)), 2)) for _ in range(int(rng.integers(1, 4))))
        for _ in range(int(rng.integers(0, 5)))
    )
    target = [None, *MOTIONS[:3]][int(rng.integers(4))]
    return Layout(
        border=rng.uniform(-10, 10, (int(rng.integers(3, 8)), 2)),
        starts=rng.uniform(-1, 1, (1, 3)),
        goals=rng.uniform(-9, 9, (1, 2)),
        circles=rng.uniform(0.1, 9, (int(rng.integers(0, 7)), 3)),
        polygons=polygons,
        movers=movers,
        target=target,
        goal_room=float(rng.uniform(0.1, 1.0)),
    )


def assert_same_layout(one: Layout, other: Layout) -> None:
    """Same numbers but for rounding; movers may come circles first."""

    def by_shape(movers: tuple[Mover, ...]) -> list[Mover]:
        return sorted(movers, key=lambda mover: np.ndim(mover.outline))

    for name in ("border", "starts", "goals", "circles"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), abs=1e-12), name
    assert one.goal_room == other.goal_room
    assert one.target == other.target
    assert len(one.polygons) == len(other.polygons)
    for mine, yours in zip(one.polygons, other.polygons, strict=True):
        assert [ring.tolist() for ring in mine] == [ring.tolist() for ring in yours]
    for a, b in zip(by_shape(one.movers), by_shape(other.movers), strict=True):
        assert a.at == b.at and a.motion == b.motion
        assert np.asarray(a.outline) == pytest.approx(np.asarray(b.outline), abs=1e-12)


def bare_world(count: int = 1) -> World:
    """A World without a Simulation around it."""
    terms = ("progress", "goal", "collision", "step", "clearance", "smoothness")
    scenario = load({"lidar": {"beams": 5}, "world": {"family": "empty"}})
    return World(scenario, count, width=12, weights=dict.fromkeys(terms, 1.0), clearance_scale=0.5, span=30.0)


def test_a_layout_that_is_loaded_is_read_back_as_it_was() -> None:
    rng = np.random.default_rng(0)
    world = bare_world(count=3)
    kept: dict[int, Layout] = {}
    for number in range(60):
        row = number % 3
        kept[row] = random_layout(rng)
        world.load(row, kept[row])
        for other, layout in kept.items():  # rows that were there before the World grew are as they were
            assert_same_layout(world.layout(other), layout)


def test_a_layout_read_in_mid_episode_continues_as_the_episode_does() -> None:
    """Movers by bounce and way-points have no memory but place, velocity and the points still to come."""
    movers = [
        circle([1.0, 2.0], 0.3, law="bounce", velocity=[0.9, -0.7]),
        circle([-3.0, 2.0], 0.2, law="waypoints", points=[[2, 2], [2, -3], [0, 0]], speed=1.7),
        circle([-5.0, 2.0], 0.2, law="waypoints", points=[[-5, 0], [-6, 3]], speed=0.7, stop=True),
        polygon([4.0, 0.0], TRIANGLE, law="bounce", velocity=[-0.4, 1.1]),
    ]
    whole, resumed = Simulation(movers_scenario(movers)), Simulation(movers_scenario(movers))
    whole.reset(seeds=[0])
    resumed.reset(seeds=[0])
    for _ in range(57):
        whole.step([[[0.0, 0.0]]])
    resumed.world.load(0, whole.world.layout(0))
    resumed.begin(resumed.all_rows)
    for _ in range(200):
        whole.step([[[0.0, 0.0]]])
        resumed.step([[[0.0, 0.0]]])
        expected = [mover.at for mover in whole.world.layout(0).movers]
        assert np.array([mover.at for mover in resumed.world.layout(0).movers]) == pytest.approx(
            np.array(expected), abs=1e-9
        )


@pytest.mark.parametrize("velocity", [[8000.0, 7000.0], [10_000.0, 0.0]])
def test_a_layout_is_read_where_a_reflection_has_made_a_part_of_a_velocity_more_than_a_scenario_may_say(
    velocity: list[float],
) -> None:
    """At slanted walls a part of a velocity grows up to the speed, and by rounding beyond: the speed stays what it was."""
    wedges = [[[3, -3], [6, 0], [6, -3]], [[-3, 3], [-6, 1], [-6, 3]]]
    simulation = Simulation(
        movers_scenario([circle([0.0, 0.0], 0.2, law="bounce", velocity=velocity)], polygons=wedges)
    )
    simulation.reset(seeds=[0])
    greatest = 0.0
    for _ in range(50):
        simulation.step([[[0.0, 0.0]]])
        [mover] = simulation.world.layout(0).movers
        assert isinstance(mover.motion, Bounce) and mover.motion.velocity is not None
        assert mover.motion.velocity == tuple(simulation.world.disc_velocity[0, 0])
        assert math.hypot(*mover.motion.velocity) == pytest.approx(math.hypot(*velocity), rel=1e-9)
        greatest = max(greatest, *map(abs, mover.motion.velocity))
    assert greatest > FAST


def test_a_circle_given_as_a_whole_number_is_a_circle() -> None:
    world = bare_world()
    layout = random_layout(np.random.default_rng(1))
    world.load(0, replace(layout, movers=(Mover(1, (0.0, 0.0), MOTIONS[0]),)))
    [mover] = world.layout(0).movers
    assert mover.outline == 1.0


# ------------------------------------------------------------------------------------------------ growth, snapshots


def busy_scenario(robots: int = 1) -> dict[str, Any]:
    """Everything at once: noises, movers of every law and shape, a moving goal, several robots."""
    movers = [
        circle([1.0, 2.0], 0.3, law="bounce", velocity=[0.9, -0.7]),
        circle([-3.0, 2.0], 0.2, law="waypoints", points=[[2, 2], [2, -3], [0, 0]], speed=1.7),
        circle([5.0, 2.0], 0.2, law="random_walk", speed=1.0),
        polygon([4.0, 0.0], TRIANGLE, law="bounce", velocity=[-0.4, 1.1]),
        polygon([-4.0, 0.0], TRIANGLE, law="random_walk", speed=0.8),
    ]
    target = {"region": [5, 5, 9, 9], "motion": {"law": "random_walk", "speed": 0.5}}
    return {
        "robot": {"kinematics": "differential", "max_acceleration": 3.0, "circles": [[0, 0, 0.1], [0.1, 0, 0.1]]},
        "lidar": {"beams": 17, "noise": 0.02, "dropout": 0.1},
        "odometry": {"translation_noise": 0.1, "rotation_noise": 0.05, "translation_bias": 0.01},
        "world": {
            "family": "explicit",
            "start": {"region": [-8, -8, -6, -6]},
            "target": target,
            "movers": movers,
            **STILL_THINGS,
            "polygons": STILL_THINGS["polygons"][:2],
        },
        "robots": {"count": robots},
    }


def rollout(simulation: Simulation, actions: F64) -> list[Any]:
    """All that steps give, as lists that compare exactly."""
    result = []
    for action in actions:
        transition = simulation.step(action)
        info = simulation.info()
        result.append([array.tolist() for array in transition] + [info[name].tolist() for name in sorted(info)])
    return result


GROWTH = {
    "discs": Capacity(discs=40),
    "polygons": Capacity(polygons=9),
    "walls": Capacity(walls=200),
    "ways": Capacity(ways=31),
    "all": Capacity(discs=40, polygons=9, walls=200, ways=31),
}


@pytest.mark.parametrize("robots", [1, 3])
@pytest.mark.parametrize("what", GROWTH)
def test_room_for_more_in_mid_episode_changes_nothing_bit_for_bit(what: str, robots: int) -> None:
    actions = np.random.default_rng(0).uniform(-1, 1, (80, 2, robots, 2))
    plain, grown = (Simulation(busy_scenario(robots), count=2) for _ in range(2))
    for simulation in (plain, grown):
        simulation.reset(seeds=[3, 4])
    assert rollout(plain, actions[:30]) == rollout(grown, actions[:30])
    grown.world.grow(GROWTH[what])
    assert grown.world.capacity == plain.world.capacity.joined(GROWTH[what])
    for row in range(2):
        assert_same_layout(grown.world.layout(row), plain.world.layout(row))
    assert rollout(plain, actions[30:]) == rollout(grown, actions[30:])
    assert (plain.reset() == grown.reset()).all()
    assert rollout(plain, actions) == rollout(grown, actions)


@pytest.mark.parametrize("name", ["busy", "dynamic", "rush"])
def test_a_restored_state_continues_bit_for_bit(name: str) -> None:
    scenario: Any = busy_scenario(2) if name == "busy" else name
    robots = 2 if name == "busy" else 1
    actions = np.random.default_rng(0).uniform(-1, 1, (90, 3, robots, 2))
    simulation, other = Simulation(scenario, count=3), Simulation(scenario, count=3)
    simulation.reset(seeds=[5, 6, 7])
    rollout(simulation, actions[:30])
    saved = simulation.save()
    first = rollout(simulation, actions[30:])
    again_first = simulation.reset().tolist()
    simulation.restore(saved)
    assert rollout(simulation, actions[30:]) == first
    assert simulation.reset().tolist() == again_first, "the next episode is the same one too"
    other.world.grow(Capacity(discs=99))
    other.restore(saved)
    assert rollout(other, actions[30:]) == first
    assert other.reset().tolist() == again_first


def test_a_snapshot_is_not_changed_by_going_on() -> None:
    simulation = Simulation("dynamic", count=2)
    simulation.reset(seeds=[0, 1])
    snapshot = simulation.world.save()
    floats, observation = snapshot.floats.copy(), snapshot.observation.copy()
    rollout(simulation, np.full((5, 2, 1, 2), 0.3))
    assert (snapshot.floats == floats).all() and (snapshot.observation == observation).all()


def test_a_snapshot_of_another_number_of_worlds_is_refused() -> None:
    simulation, other = Simulation("dynamic", count=2), Simulation("dynamic", count=3)
    simulation.reset(seeds=[0, 1])
    with pytest.raises(ValueError, match=r"\(2, 1, 71\), expected \(3, 1, 71\)"):
        other.restore(simulation.save())


# ------------------------------------------------------------------------------------------------ beams


def test_beams_go_all_round_without_repeating_the_first() -> None:
    angles = beam_angles(load({"lidar": {"beams": 7, "fov": 6.2832}}))
    assert angles == pytest.approx([2.0 * math.pi * i / 7 for i in range(7)])


def test_beams_over_a_narrow_view_spread_from_side_to_side() -> None:
    angles = beam_angles(load({"lidar": {"beams": 5, "fov": 2.0}}))
    assert angles == pytest.approx([-1.0, -0.5, 0.0, 0.5, 1.0])


def test_a_single_beam_looks_ahead() -> None:
    for fov in (1.0, 6.2832):
        assert beam_angles(load({"lidar": {"beams": 1, "fov": fov}})) == pytest.approx([0.0])
