"""The D2T policies: they arrive, keep off, plan anew, say when there is no way, and each part of them works."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import shapely
from episodes import run_episode
from shapely.affinity import translate as moved

from bug_gym.agents import make_policy
from bug_gym.agents.local.navigator import Navigator, NavigatorParameters
from bug_gym.agents.planning import triangulated
from bug_gym.agents.planning.a_star import a_star
from bug_gym.agents.planning.ants import Colony, eaco
from bug_gym.agents.planning.d2t_eaco import D2TEaco
from bug_gym.agents.planning.d2t_planner import AROUND, BEYOND, ROUGH, seen_obstacles
from bug_gym.agents.planning.follow import Scene
from bug_gym.agents.planning.funnel import funnel
from bug_gym.agents.planning.grid import grid_of
from bug_gym.agents.planning.sleeve import Sleeve
from bug_gym.agents.planning.triangulated import Manner, Optimiser, Task, find_way
from bug_gym.reproductions import d2t_worlds
from bug_gym.reproductions.d2t_tables import map_of
from bug_gym.simulation import Simulation

WAYS: list[Optimiser] = ["funnel", "eaco", "eaco_refined", "aco", "vertices"]


def scenario(task: Task, **more: Any) -> dict[str, Any]:
    return {"world": d2t_worlds.as_world(task), "lidar": {"beams": 180, "range": 6.0}, "time": {"limit": 200.0}, **more}


def clearance(path: Any, task: Task) -> float:
    return float(min(shapely.distance(np.array(task.obstacles), shapely.LineString(path))))


@pytest.mark.parametrize("optimiser", WAYS)
@pytest.mark.parametrize("seed", range(3))
def test_every_way_of_planning_keeps_off_and_none_beats_the_shortest(optimiser: Optimiser, seed: int) -> None:
    task = d2t_worlds.field(seed, 30)
    found = find_way(task, Manner(optimiser, facets=1), seed=seed)
    best = triangulated.shortest_way(task, Manner())
    assert found is not None and best is not None
    assert clearance(found.path, task) >= 0.3 - 1e-9
    assert found.length >= best.length - 0.01
    if optimiser in ("funnel", "eaco_refined"):
        assert found.length <= 1.05 * best.length


def test_ants_cannot_shorten_what_dijkstra_finds_below_the_funnel() -> None:
    lengths: dict[str, float] = {}
    for optimiser in WAYS:
        found = find_way(d2t_worlds.scenario_1(), Manner(optimiser, facets=1))
        assert found is not None
        lengths[optimiser] = found.length
    assert lengths["funnel"] <= lengths["eaco_refined"] <= lengths["eaco"] < lengths["vertices"]


@pytest.mark.parametrize("name", ["d2t_eaco", "d2t_dijkstra"])
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
def test_the_goal_is_reached_without_contact(name: str, kinematics: str) -> None:
    task = d2t_worlds.field(3, 30, 20.0, 12.0)
    episode = run_episode(name, scenario(task), {"robot.kinematics": kinematics})
    assert episode.outcome == "success" and episode.min_clearance > 0.0
    best = triangulated.shortest_way(task, Manner())
    assert best is not None and episode.full_length <= 1.25 * best.length


def test_where_there_is_no_way_it_says_so_and_a_narrow_one_is_found() -> None:
    walls = [d2t_worlds.block(5.0, -5.0, 0.5, 4.7), d2t_worlds.block(5.0, 0.3, 0.5, 4.7)]
    border = np.array([[-2, -5], [12, -5], [12, 5], [-2, 5]], dtype=float)
    for gap, reached in ((0.6, True), (0.52, True), (0.4, False)):
        parted = [moved(walls[0], yoff=0.3 - 0.5 * gap), moved(walls[1], yoff=0.5 * gap - 0.3)]
        task = Task(parted, border, (0.0, 0.0), (10.0, 0.0), 0.25)
        found = find_way(task)
        assert (found is not None) == reached
        if found is not None:
            assert clearance(found.path, task) >= 0.25 - 1e-3
    closed = {"family": "explicit", "bounds": [-2, -5, 12, 5], "start": [0, 0, 0], "goal": [10, 0]}
    episode = run_episode("d2t_eaco", {"world": {**closed, "polygons": [[[5, -5], [6, -5], [6, 5], [5, 5]]]}})
    assert episode.verdict == "unreachable" and episode.length == 0.0
    assert "no way leads" in episode.memory.reason


@pytest.mark.parametrize("gap", [0.43, 0.405])
def test_a_gap_between_large_discs_that_their_polygons_close_is_no_dead_end(gap: float) -> None:
    """A polygon around a disc of 5 m reaches 2.4 cm beyond it."""
    discs = [[6.0, 5.0 + 0.5 * gap, 5.0], [6.0, -5.0 - 0.5 * gap, 5.0]]
    world = {"family": "explicit", "bounds": [-2, -5, 14, 5], "start": [0, 0, 0], "goal": [12, 0], "circles": discs}
    episode = run_episode("d2t_eaco", {"world": world}, {"robot.kinematics": "holonomic"}, max_steps=300)
    assert episode.outcome == "success" and episode.min_clearance > 0.0


def test_a_start_beside_a_wall_and_a_goal_in_a_nook_are_no_trouble() -> None:
    border = np.array([[-2, -5], [12, -5], [12, 5], [-2, 5]], dtype=float)
    wall, nook = d2t_worlds.block(-0.5, 0.27, 1.0, 1.0), d2t_worlds.block(9.0, 0.26, 2.0, 1.0)
    task = Task([wall, nook], border, (0.0, 0.0), (10.0, 0.0), 0.25, goal_radius=0.3)
    found = find_way(task, Manner("funnel"))
    assert found is not None and found.path[0].tolist() == [0.0, 0.0]
    assert math.dist(found.path[-1], task.goal) <= 0.3
    assert clearance(found.path[1:], task) >= 0.3 - 1e-9


def test_hulls_that_close_the_way_are_given_up_for_the_obstacles_themselves() -> None:
    # A ring of posts with one door too wide to be closed: the hull of the posts holds neither start nor goal, but the
    # border stands so near to it that nothing leads round.
    posts = [d2t_worlds.block(4.0, y, 0.4, 0.4) for y in np.arange(-3.0, 2.7, 0.8)]
    posts += [d2t_worlds.block(x, 2.6, 0.4, 0.4) for x in np.arange(4.8, 8.1, 0.8)]
    border = np.array([[-2, -3.2], [12, -3.2], [12, 3.2], [-2, 3.2]], dtype=float)
    task = Task(posts[1:], border, (0.0, 0.0), (10.0, 0.0), 0.25)
    found = find_way(task, Manner("funnel"))
    assert found is not None and found.by in ("obstacles", "split sides")
    assert clearance(found.path, task) >= 0.3 - 1e-9


def test_points_sampled_in_free_space_are_used_and_the_seed_is_kept() -> None:
    task = d2t_worlds.field(5, 25)
    first, again, other = (find_way(task, Manner("funnel", samples=60), seed=seed) for seed in (1, 1, 2))
    assert first is not None and again is not None and other is not None and first.mesh is not None
    np.testing.assert_array_equal(first.path, again.path)
    assert len(first.mesh.extra) > 40 and first.mesh.extra.size != 2
    assert other.mesh is not None and not np.array_equal(first.mesh.points, other.mesh.points)


def test_within_a_horizon_it_replans_as_it_goes_and_arrives() -> None:
    task = d2t_worlds.field(4, 20, 20.0, 12.0)
    episode = run_episode("d2t_eaco", scenario(task), horizon=5.0, samples=60)
    assert episode.outcome == "success" and episode.memory.plans >= 10
    whole = run_episode("d2t_eaco", scenario(task))
    assert whole.memory.plans == 1
    often = run_episode("d2t_eaco", scenario(task), replan="horizon")
    assert often.outcome == "success" and often.memory.plans >= 10


def test_it_plans_anew_round_a_mover_that_has_come_to_stand_in_the_way() -> None:
    # It crosses over to the robot's way, and stays there.
    motion = {"law": "waypoints", "points": [[6.0, 4.0], [6.0, 0.0]], "speed": 1.0, "stop": True}
    mover = {"shape": {"circle": 0.8}, "at": [6.0, 4.0], "motion": motion}
    world = {"family": "explicit", "bounds": [-2, -6, 14, 6], "start": [0, 0, 0], "goal": [12, 0], "movers": [mover]}
    episode = run_episode("d2t_eaco", {"world": world, "lidar": {"beams": 180}})
    assert episode.outcome == "success" and episode.min_clearance > 0.0
    assert episode.memory.plans >= 2


@pytest.mark.parametrize("optimiser", ["eaco", "eaco_refined", "aco", "funnel"])
def test_the_policy_takes_what_pulls_the_way_taut_as_a_parameter(optimiser: str) -> None:
    policy = make_policy("d2t_eaco", Simulation("static"), optimiser=optimiser, ants=7, levy_rate=0.0)
    assert isinstance(policy, D2TEaco)
    assert policy.manner.optimiser == optimiser and policy.manner.colony.ants == 7


def test_its_follower_avoids_movers_as_its_parameters_say_and_leaves_what_stands_to_the_way() -> None:
    settings = {"avoidance": "orca", "mover_horizon": 1.7, "mover_margin": 0.35}
    policy: Any = make_policy("d2t_eaco", Simulation("static"), **settings)
    own = NavigatorParameters(avoidance="orca", horizon=1.7, mover_margin=0.35, still_horizon=0.0)
    assert policy.follower.navigator.robot == Navigator(policy.sensors, own).robot


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"horizon": -1.0}, "horizon must be above 0"),
        ({"threshold": 0.0}, "threshold must be above 0"),
        ({"ants": 0}, "ants must be at least 1"),
        ({"facets": 0}, "facets must be at least 1"),
        ({"mover_horizon": 0.0}, "mover_horizon must be above 0"),
        ({"seed": -1}, "seed must not be negative"),
    ],
)
def test_bad_parameters_are_refused(parameters: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make_policy("d2t_eaco", Simulation("static"), **parameters)


# ---------------------------------------------------------------------------------------------------- unknown terrain


def test_in_unknown_terrain_it_arrives_without_a_map_and_goes_farther_than_with_one() -> None:
    policy: Any = make_policy("d2t_eaco", "static", known=False)
    assert not policy.privileged and policy.maps is None
    episode = run_episode("d2t_eaco", "rooms", seed=2, known=False)
    assert episode.outcome == "success" and episode.memory.live is None
    given = run_episode("d2t_eaco", "rooms", seed=2)
    assert given.memory.plans == 1 < episode.memory.plans
    assert given.full_length < episode.full_length


def test_in_unknown_terrain_it_is_rebuilt_as_it_goes_where_asked() -> None:
    episode = run_episode("d2t_eaco", "static", seed=2, known=False, replan="horizon")
    steps = len(episode.modes)
    assert episode.outcome == "success" and episode.memory.plans >= steps // 5  # every half second, a step is a tenth


def test_in_unknown_terrain_a_shut_in_goal_is_found_out() -> None:
    wall = [[5, -5], [6, -5], [6, 5], [5, 5]]
    closed = {"family": "explicit", "bounds": [-2, -5, 12, 5], "polygons": [wall], "start": [0, 0, 0], "goal": [10, 0]}
    episode = run_episode("d2t_eaco", {"world": closed, "lidar": {"beams": 180}}, known=False)
    assert episode.verdict == "unreachable" and "what has been seen leaves no way" in episode.memory.reason
    assert episode.length > 0.0  # it had to go and see


@pytest.mark.parametrize("seed", range(4))
def test_what_has_been_seen_lies_in_obstacles_that_go_hardly_beyond(seed: int) -> None:
    generator = np.random.default_rng(seed)
    points = generator.uniform(-4.0, 4.0, (150, 2))
    scene = Scene((0.0, 0.0, 0.0), (9.0, 1.0), None)
    obstacles, border = seen_obstacles(points, scene)
    whole = shapely.union_all(obstacles)
    assert shapely.contains_xy(whole, points[:, 0], points[:, 1]).all()
    alone = [points[k] for k in range(len(points)) if np.sort(np.hypot(*(points - points[k]).T))[1] > 0.7]
    for place in alone:
        (own,) = [one for one in obstacles if shapely.contains_xy(one, *place)]
        assert max(math.dist(corner, place) for corner in shapely.get_coordinates(own)) <= AROUND + ROUGH
    assert border.max(axis=0) == pytest.approx(np.maximum(points.max(axis=0), (9.0, 1.0)) + BEYOND)
    assert seen_obstacles(np.zeros((0, 2)), scene)[0] == []


# ------------------------------------------------------------------------------------------------- clipping, as printed


def test_where_two_edges_meet_in_a_corner_clipping_lets_the_way_come_nearer() -> None:
    # Both edges begin in the origin, at right angles; crossed at 0.3 m from it each, the chord comes to 0.3 cos 45 deg.
    right, left = np.array([[0.0, 0.3], [0.3, 0.0]]), np.array([[0.0, 5.0], [5.0, 0.0]])
    sleeve = Sleeve(np.array([-3.0, -2.0]), np.array([-2.0, -3.0]), left, right, np.arange(3))
    way = shapely.LineString(funnel(sleeve))
    assert way.distance(shapely.Point(0.0, 0.0)) == pytest.approx(0.3 * math.sqrt(0.5), abs=1e-9)


def test_clipped_ways_come_nearer_to_obstacles_than_they_are_to_and_grown_ones_never() -> None:
    nearest = []
    for seed in range(4):
        task = d2t_worlds.field(seed, 30)
        clipped, grown = (find_way(task, Manner("funnel", clip=clip)) for clip in (True, False))
        assert clipped is not None and grown is not None
        assert clearance(grown.path, task) >= 0.3 - 1e-9
        nearest.append(clearance(clipped.path, task))
    assert min(nearest) < 0.9 * 0.3


def test_an_edge_too_short_to_be_clipped_is_closed() -> None:
    border = np.array([[-2, -1], [12, -1], [12, 1], [-2, 1]], dtype=float)
    for gap, by in ((0.7, "obstacles"), (0.55, "shortest path")):
        walls = [
            d2t_worlds.block(5.0, -1.0, 0.5, 1.0 - 0.5 * gap),
            d2t_worlds.block(5.0, 0.5 * gap, 0.5, 1.0 - 0.5 * gap),
        ]
        task = Task(walls, border, (0.0, 0.0), (10.0, 0.0), 0.25)
        found = find_way(task, Manner("funnel", clip=True, use_clusters=False))
        assert found is not None and found.by == by


def test_among_600_obstacles_a_way_is_found_in_clusters() -> None:
    # `bug-gym benchmark` says how long it takes.
    found = find_way(d2t_worlds.field(9, 600, 100.0, 100.0, sizes=(0.3, 1.2)), Manner("funnel", facets=1))
    assert found is not None and found.by == "clusters"


def test_patient_ants_go_on_to_their_last_iteration() -> None:
    way = find_way(d2t_worlds.field(3, 30, goal=(20.0, 12.0)), Manner("funnel", facets=1))
    assert way is not None and way.sleeve is not None and 8 < len(way.sleeve.left) <= 20
    assert len(eaco(way.sleeve, Colony(patience=50)).curve) == 50


def test_among_600_obstacles_a_star_over_cells_of_10_cm_finds_nearly_the_exact_way() -> None:
    task, growth = d2t_worlds.field(9, 600, 100.0, 100.0, sizes=(0.3, 1.2)), 0.3
    plan = map_of(task)
    grid = grid_of(plan, 0.1, growth)
    ends = [grid.lattice.node_at(place) for place in (task.start, task.goal)]
    lengths = plan.shortest_path(task.start, task.goal, radius=growth).length, 0.1 * a_star(grid, *ends).length
    assert lengths[0] <= lengths[1] <= 1.09 * lengths[0]
