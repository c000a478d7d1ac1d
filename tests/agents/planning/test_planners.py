"""The map planners: ways no shorter than the shortest, verdicts that are true, and nobody changes the world."""

from __future__ import annotations

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from episodes import run_episode

from bug_gym.agents import AGENTS, make_policy
from bug_gym.agents.planning.grid import grid_of
from bug_gym.agents.planning.live import Maps
from bug_gym.agents.planning.map import PlanningMap
from bug_gym.agents.planning.rrt_star import TRIES, Grown, rrt_star
from bug_gym.agents.planning.seen_ground import FORGOTTEN, MOST_WAITING, STILL_FOR, SeenGround
from bug_gym.agents.planning.smoothing import Solids, pulled
from bug_gym.config import dump
from bug_gym.evaluation import evaluate
from bug_gym.geometry import F64
from bug_gym.reproductions import cylinder_claims
from bug_gym.shortest_path import shortest_path
from bug_gym.simulation import Simulation
from bug_gym.vector_env import NavigationVectorEnv

PLANNERS = [name for name, line in AGENTS.items() if line.entry_point.startswith("planning.")]
GRID = [name for name in PLANNERS if name not in ("visibility_graph", "rrt_star", "d2t_eaco", "d2t_dijkstra")]
BODY, MARGIN = 0.2, 0.05


def walled(gap: float, *, thick: float = 0.4) -> dict[str, Any]:
    """A wall across the world with one gap in it, above the straight way."""
    return {
        "family": "explicit",
        "bounds": [-2, -4, 12, 4],
        "polygons": [
            [[5, -4.5], [5 + thick, -4.5], [5 + thick, 1.03], [5, 1.03]],
            [[5, 1.03 + gap], [5 + thick, 1.03 + gap], [5 + thick, 4.5], [5, 4.5]],
        ],
        "start": [0, 0, 0],
        "goal": [10, 0],
    }


def shortest(simulation: Simulation, radius: float) -> float:
    """The exact shortest way of a disc in a world that has begun [m]."""
    layout = simulation.world.layout(0)
    ends = simulation.world.pose[0, 0, :2], layout.goals[0]
    return shortest_path(layout.circles, layout.polygons, layout.border, *ends, radius=radius).length


@pytest.mark.parametrize("name", PLANNERS)
@pytest.mark.parametrize("kinematics", ["holonomic", "differential"])
@pytest.mark.parametrize("scenario", ["rooms", "u_trap"])
def test_every_planner_arrives_and_no_way_is_shorter_than_the_shortest(
    name: str, kinematics: str, scenario: str
) -> None:
    overrides = {"robot.kinematics": kinematics}
    episode = run_episode(name, scenario, overrides, seed=2)
    assert episode.outcome == "success"
    simulation = Simulation(scenario, overrides=overrides)
    simulation.reset(seeds=[2])
    # What is driven ends within the goal's radius of it.
    assert episode.full_length >= shortest(simulation, BODY) - 1e-6
    most = {"bfs": 1.3, "rrt_star": 1.25}.get(name, 1.12)
    assert episode.full_length <= most * shortest(simulation, BODY + 2 * MARGIN)


@pytest.mark.parametrize("name", PLANNERS)
def test_planning_reads_the_world_and_changes_nothing(name: str) -> None:
    simulation = Simulation("dynamic")
    flat = simulation.reset(seeds=[1])[:, 0]
    policy = make_policy(name, simulation)
    before = simulation.world.floats.copy(), simulation.world.ints.copy(), simulation.world.observation.copy()
    state = None
    for _ in range(3):
        _, state = policy.predict(flat, state)
    for was, now in zip(
        before, (simulation.world.floats, simulation.world.ints, simulation.world.observation), strict=True
    ):
        np.testing.assert_array_equal(was, now)


@pytest.mark.parametrize("seed", range(12))
def test_a_way_pulled_straight_is_clear_and_lies_between_that_over_cells_and_the_exact_one(seed: int) -> None:
    simulation = Simulation("static", overrides={"world.obstacles": 30})
    simulation.reset(seeds=[seed])
    live = Maps(simulation).of_robot(0)
    growth = BODY + MARGIN
    policy: Any = make_policy("a_star", simulation)
    memory = policy.begin(0)
    found = policy.plan(policy.look(None, memory), memory)
    solids = Solids.of(live.still, growth)
    over_cells = np.concatenate([[(0.0, 0.0)], memory.cells, [live.goal]])
    lengths = [float(np.hypot(*np.diff(places, axis=0).T).sum()) for places in (over_cells, found.places)]
    exact = live.still.shortest_path((0.0, 0.0), live.goal, radius=growth).length
    assert exact - 1e-6 <= lengths[1] <= lengths[0] + 1e-9
    assert lengths[1] <= 1.08 * exact
    assert [tuple(found.places[0]), tuple(found.places[-1])] == [(0.0, 0.0), live.goal]
    for places in (memory.cells, found.places):
        for a, b in zip(places[:-1].tolist(), places[1:].tolist(), strict=True):
            assert solids.is_clear(tuple(a), tuple(b))


@pytest.mark.parametrize("seed", range(6))
def test_steps_between_coarse_cells_keep_their_room_in_the_middle_too(seed: int) -> None:
    simulation = Simulation("static", overrides={"world.obstacles": 30})
    simulation.reset(seeds=[seed])
    policy: Any = make_policy("a_star", simulation, resolution=0.45)
    memory = policy.begin(0)
    policy.plan(policy.look(None, memory), memory)
    room = policy.rooms[0] if len(memory.grounds) == 1 else policy.rooms[-1]
    solids = Solids.of(memory.live.still, room.growth)
    assert len(memory.cells) > 3
    for a, b in zip(memory.cells[:-1].tolist(), memory.cells[1:].tolist(), strict=True):
        assert solids.is_clear(tuple(a), tuple(b))


@pytest.mark.parametrize("name", GRID)
def test_cells_too_coarse_for_a_gap_are_told_and_which_would_do(name: str) -> None:
    settings = {"world": walled(0.7)}
    episode = run_episode(name, settings, {"robot.kinematics": "holonomic"}, resolution=0.8)
    assert episode.verdict == "stuck"  # what its cells don't show proves nothing
    assert "no way over cells of 0.8 m for a body of radius 0.2 m" in episode.memory.reason
    words = episode.memory.reason.rsplit("a resolution of ", maxsplit=1)[1].split()
    finer = run_episode(name, settings, {"robot.kinematics": "holonomic"}, resolution=float(words[0]))
    assert finer.outcome == "success"


def test_the_straight_ways_of_theta_star_need_cells_that_are_halved_more_often() -> None:
    """Between two cells they may touch any point of a free one, so a gap must be wider by a diagonal of a cell."""
    settings, robot = {"world": walled(0.43)}, {"robot.kinematics": "holonomic"}
    reason = run_episode("theta_star", settings, robot, resolution=0.4).memory.reason
    enough = float(reason.rsplit("a resolution of ", maxsplit=1)[1].split()[0])
    assert 0.4 / enough > 8.0
    assert run_episode("theta_star", settings, robot, resolution=enough).outcome == "success"


@pytest.mark.parametrize("name", GRID)
def test_smaller_cells_that_were_tried_in_vain_are_told(name: str) -> None:
    """The body alone fits through 0.402 m, and nothing with 0.005 m beside it."""
    episode = run_episode(name, {"world": walled(0.402)}, {"robot.kinematics": "holonomic"})
    assert episode.verdict == "stuck"
    reason = episode.memory.reason
    tried = float(reason.rsplit(" m", maxsplit=1)[0].rsplit(maxsplit=1)[1])
    assert "nor over smaller ones down to" in reason and 14.0 * 8.0 / (0.5 * tried) ** 2 > 4_000_000


@pytest.mark.parametrize("name", PLANNERS)
def test_where_there_is_no_way_it_is_told_and_no_finer_cells_are_promised(name: str) -> None:
    episode = run_episode(name, {"world": walled(0.3), "time": {"limit": 30.0}}, {"robot.kinematics": "holonomic"})
    assert episode.verdict == "unreachable"
    assert "would do" not in episode.memory.reason and episode.memory.reason


@pytest.mark.parametrize("name", GRID)
@pytest.mark.parametrize(("gap", "verdict"), [(0.38, "unreachable"), (0.42, "stuck")])
def test_unreachable_is_said_of_what_stops_the_body_and_never_of_what_stops_the_cells(
    name: str, gap: float, verdict: str
) -> None:
    """Cells of 0.4 m show a way through neither gap; one is wider than the body (0.4 m)."""
    episode = run_episode(name, {"world": walled(gap)}, {"robot.kinematics": "holonomic"}, resolution=0.4)
    assert episode.verdict == verdict


def test_a_gap_for_the_body_alone_is_no_way_with_a_margin_and_proves_nothing() -> None:
    simulation = Simulation({"world": walled(0.405)}, overrides={"robot.kinematics": "holonomic"})
    simulation.reset(seeds=[0])
    policy: Any = make_policy("visibility_graph", simulation)
    memory = policy.begin(0)
    found = policy.plan(policy.look(None, memory), memory)
    assert found.places is None and found.verdict == "stuck"
    assert found.reason.endswith("for a body of radius 0.2 m and 0.005 m beside it")


@pytest.mark.parametrize("name", PLANNERS)
def test_a_goal_inside_of_a_grown_obstacle_is_told_as_such(name: str) -> None:
    simulation = Simulation({"world": walled(1.0)}, overrides={"robot.kinematics": "holonomic"})
    simulation.reset(seeds=[0])
    policy: Any = make_policy(name, simulation)
    memory = policy.begin(0)
    scene = policy.look(None, memory)
    found = policy.plan(scene._replace(goal=(5.2, 0.0)), memory)
    assert found.places is None and found.verdict == "unreachable"
    assert found.reason == (
        "the goal (5.2, 0) lies in an obstacle, or nearer to one than a body of radius 0.2 m can come"
    )
    assert policy.plan(scene, memory).places is not None


@pytest.mark.parametrize("name", PLANNERS)
def test_a_start_inside_of_an_obstacle_is_told_as_such(name: str) -> None:
    simulation = Simulation({"world": walled(1.0, thick=2.0)}, overrides={"robot.kinematics": "holonomic"})
    simulation.reset(seeds=[0])
    policy: Any = make_policy(name, simulation)
    memory = policy.begin(0)
    found = policy.plan(policy.look(None, memory)._replace(pose=(6.0, -2.0, 0.0)), memory)
    assert found.places is None
    assert (
        found.reason == "the start (6, -2) lies in an obstacle, or nearer to one than a body of radius 0.2 m can come"
    )


@pytest.mark.parametrize("name", [*PLANNERS])
def test_a_start_and_a_goal_nearer_to_a_wall_than_the_margin_are_no_hindrance(name: str) -> None:
    world = {
        "family": "explicit",
        "bounds": [-1, -3, 9, 3],
        "polygons": [
            [[-0.9, -2.0], [0.9, -2.0], [0.9, -0.21], [-0.9, -0.21]],
            [[6, -2], [8, -2], [8, -0.1], [6, -0.1]],
        ],
        "start": [0, 0, 0],
        "goal": [7, 0],
    }
    assert run_episode(name, {"world": world}, {"robot.kinematics": "holonomic"}).outcome == "success"


@pytest.mark.parametrize("name", GRID)
def test_a_way_over_coarse_cells_ends_where_the_goal_counts_as_reached(name: str) -> None:
    """The goal is 0.21 m from a wall, the nearest free cell of 0.5 m beside it half a metre away."""
    world = {
        "family": "explicit",
        "bounds": [-1, -3, 9, 3],
        "polygons": [[[6, -2], [8, -2], [8, -0.21], [6, -0.21]]],
        "start": [0, 0, 0],
        "goal": [7, 0],
    }
    episode = run_episode(
        name, {"world": world, "time": {"limit": 30.0}}, {"robot.kinematics": "holonomic"}, resolution=0.5
    )
    assert episode.outcome == "success" and episode.memory.plans == 1


def test_a_grid_of_very_many_cells_is_refused_with_what_it_would_take() -> None:
    world = {"family": "empty", "bounds": [0, 0, 100, 100], "start": [5, 5, 0], "goal": [90, 90]}
    simulation = Simulation({"world": world})
    with pytest.raises(
        ValueError, match=r"cells of resolution 0.01 m would take .* GB.*resolution of 0\.0.* m or more"
    ):
        make_policy("a_star", simulation, resolution=0.01)
    simulation.reset(seeds=[0])
    still = Maps(simulation).of_robot(0).still
    with pytest.raises(ValueError, match="expected at most 50,000,000 cells"):
        grid_of(still, 0.01, 0.2)


@pytest.mark.parametrize("value", [math.inf, math.nan, 0.0, -1.0])
@pytest.mark.parametrize("key", ["margin", "resolution"])
def test_lengths_that_cannot_be_are_refused(key: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{key} must be finite and at least 0.001 m"):
        make_policy("a_star", Simulation("static"), **{key: value})


@pytest.mark.parametrize("source", ["static", {"world": walled(1.0)}, Simulation("static").scenario])
def test_a_bare_scenario_has_no_map(source: Any) -> None:
    with pytest.raises(ValueError, match="policy 'a_star' reads the map of a live world: expected an env of bug_gym"):
        make_policy("a_star", source)
    assert make_policy("d_star_lite", source, known=False) is not None


def test_an_env_that_hides_its_map_is_refused() -> None:
    envs = gym.vector.AsyncVectorEnv([lambda: gym.make("BugGym/Static-v0")])
    try:
        with pytest.raises(ValueError, match="expected an env of bug_gym"):
            make_policy("a_star", envs)
    finally:
        envs.close()


@pytest.mark.parametrize(
    ("name", "told"), [("d2t_eaco", {}), ("visibility_graph", {}), ("velocity_obstacle", {"privileged": True})]
)
def test_every_kind_that_reads_a_map_refuses_a_bare_scenario_in_one_line(name: str, told: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="reads the map of a live world: expected an env of bug_gym") as caught:
        make_policy(name, "static", **told)
    assert "\n" not in str(caught.value)


def test_a_map_of_a_hundred_million_cells_is_told_its_memory_and_a_resolution_that_would_do() -> None:
    side = 1000.0
    simulation = Simulation(
        {"world": {"family": "empty", "bounds": [0, 0, side, side], "start": [5, 5, 0], "goal": [9, 9]}}
    )
    with pytest.raises(ValueError, match="would take") as caught:
        make_policy("a_star", simulation, resolution=0.1)
    words = str(caught.value)
    assert "\n" not in words and "GB" in words
    enough = float(words.rsplit("a resolution of ", maxsplit=1)[1].split()[0])
    across = side * math.sqrt(2.0)  # whichever way the robot faces
    assert (across / enough + 4.0) ** 2 <= 50e6 and 0.1 < enough < 0.3
    make_policy("a_star", simulation, resolution=enough)


def test_each_row_of_a_vector_env_is_driven_by_its_own_map() -> None:
    env = NavigationVectorEnv(3, scenario="static", observation="flat", autoreset_mode="SameStep")
    values, _ = env.reset(seed=5)
    policy = make_policy("a_star", env)
    state, starts, arrived = None, np.ones(3, dtype=bool), np.zeros(3, dtype=int)
    for _ in range(600):
        actions, state = policy.predict(values, state, starts)
        values, _, terminated, truncated, infos = env.step(actions)
        starts = np.asarray(terminated | truncated)
        for row in np.flatnonzero(starts):
            assert infos["final_info"]["is_success"][row]
        arrived += starts
    assert (arrived >= 3).all()


def test_an_evaluation_gives_each_episode_its_own_map_and_marks_who_reads_it() -> None:
    side_by_side = evaluate(["a_star", ("unknown", "d_star_lite", {"known": False})], "static", episodes=5)
    assert {row.policy for row in side_by_side} == {"a_star (privileged)", "unknown"}
    for row in side_by_side:
        assert row.success
        if row.policy == "unknown":
            continue
        alone = run_episode("a_star", "static", seed=row.seed)
        assert row.path_length == pytest.approx(alone.length, abs=1e-12)
        assert row.path_length + row.goal_distance >= 0.999 * row.shortest_path_length


def test_a_planner_of_another_env_is_refused_by_an_evaluation() -> None:
    policy = make_policy("a_star", Simulation("static"))
    with pytest.raises(ValueError, match="a planner reads the map of the env that it was made with"):
        evaluate([("mine", policy)], "static", episodes=1)


@pytest.mark.parametrize("name", GRID)
def test_a_mover_that_comes_to_stand_in_the_way_is_planned_round(name: str) -> None:
    world = {
        "family": "explicit",
        "bounds": [-2, -4, 14, 4],
        "movers": [
            {
                "shape": {"circle": 0.6},
                "at": [7.0, 2.5],
                "motion": {"law": "waypoints", "points": [[7.0, 2.5], [7.0, 0.0]], "speed": 1.0, "stop": True},
            }
        ],
        "start": [0, 0, 0],
        "goal": [12, 0],
    }
    episode = run_episode(name, {"world": world}, {"robot.kinematics": "holonomic"})
    assert episode.outcome == "success" and episode.memory.plans >= 2
    assert 12.1 <= episode.full_length <= 13.2


def test_a_goal_that_moves_is_planned_for_again() -> None:
    episode = run_episode("a_star", "moving_target", {"lidar.beams": 128}, seed=1)
    assert episode.memory.plans > 1


def test_d_star_lite_repairs_with_fewer_cells_than_new_searches_would_take() -> None:
    simulation = Simulation("crossing", overrides={"robot.kinematics": "holonomic"})
    simulation.reset(seeds=[3])
    policy: Any = make_policy("d_star_lite", simulation)
    memory = policy.begin(0)
    policy.plan(policy.look(None, memory)._replace(moving=None), memory)
    episode = run_episode("d_star_lite", "crossing", {"robot.kinematics": "holonomic"}, seed=3)
    assert episode.memory.plans > 3
    assert episode.memory.expanded < 0.7 * episode.memory.plans * memory.expanded


def test_in_unknown_terrain_d_star_lite_sees_the_map_of_no_one() -> None:
    policy: Any = make_policy("d_star_lite", Simulation("static"), known=False)
    assert not policy.privileged and policy.maps is None
    episode = run_episode("d_star_lite", "u_trap", known=False)
    assert episode.outcome == "success" and episode.memory.live is None
    given = run_episode("d_star_lite", "u_trap")
    assert given.full_length < episode.full_length


def ringed_goal(goal_radius: float) -> dict[str, Any]:
    """A goal in a ring of posts that nobody passes, whose outer side is 0.8 m from it."""
    turns = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    posts = np.column_stack([8.0 + 0.55 * np.cos(turns), 0.55 * np.sin(turns), np.full(24, 0.06)])
    world = {"family": "explicit", "bounds": [-2, -4, 12, 4], "circles": posts.tolist(), "start": [0, 0, 0]}
    return {"world": world | {"goal": [8, 0]}, "goal": {"radius": goal_radius}, "time": {"limit": 60.0}}


@pytest.mark.parametrize("name", [name for name, line in AGENTS.items() if line.family == "planner"])
def test_a_goal_in_a_ring_is_open_where_its_radius_reaches_beyond(name: str) -> None:
    """The free place nearest to it is shut off; others within its radius are not."""
    robot = {"robot.kinematics": "holonomic"}
    assert run_episode(name, ringed_goal(1.2), robot).outcome == "success"
    assert run_episode(name, ringed_goal(0.7), robot).verdict == "unreachable"


@pytest.mark.parametrize("seed", [34, 70, 74, 77, 78])
def test_in_unknown_terrain_it_neither_denies_nor_touches_among_thin_cylinders(seed: int) -> None:
    """Open for the body, not for the cells of what has been seen; in 70 its follower cuts a corner between cylinders."""
    world = cylinder_claims.scenario("holonomic", shut=False)
    episode = run_episode("d_star_lite", world, seed=seed, known=False)
    assert (episode.outcome, episode.verdict) == ("running", "stuck") and episode.min_clearance > 0.0


@pytest.mark.parametrize("name", ["a_star", "d_star_lite", "rrt_star", "visibility_graph"])
def test_no_fast_robot_stands_for_good_beside_its_way_among_thin_cylinders(name: str) -> None:
    """At 2 m/s it swings out of bends; with 700,002, 09, 15 and 29 some came so near to a cylinder that the brake held them."""
    world = dump(cylinder_claims.scenario("jackal", shut=False)) | {"time": {"step": 0.05, "limit": 60.0}}
    rows = [row for seed in (700_002, 700_009, 700_015, 700_029) for row in evaluate([name], [world], 1, seed)]
    assert [(row.outcome, row.min_clearance > 0.0) for row in rows] == [("success", True)] * 4


def test_in_unknown_terrain_nothing_seen_is_the_straight_way_however_far() -> None:
    world = {"family": "empty", "bounds": [-5, -5, 60, 60], "start": [0, 0, 0], "goal": [40, 30]}
    episode = run_episode("d_star_lite", {"world": world, "lidar": {"range": 3.0}}, known=False)
    assert episode.outcome == "success" and episode.full_length == pytest.approx(50.0, rel=0.005)


def test_in_unknown_terrain_a_shut_in_goal_is_found_out() -> None:
    episode = run_episode("d_star_lite", {"world": walled(0.3)}, known=False)
    assert episode.verdict == "unreachable" and "what has been seen leaves no way" in episode.memory.reason


@pytest.mark.parametrize(
    ("name", "speed", "beams", "own"),
    [("d_star_lite", 0.1, 180, {}), ("d_star_lite", 0.3, 90, {}), ("d2t_eaco", 0.3, 90, {"optimiser": "funnel"})],
)
def test_in_unknown_terrain_who_goes_on_through_the_only_door_has_not_shut_it(
    name: str, speed: float, beams: int, own: dict[str, Any]
) -> None:
    motion = {"law": "waypoints", "points": [[5.2, 1.63], [8.5, 1.63], [8.5, -2.5]], "speed": speed, "stop": True}
    mover = {"shape": {"circle": 0.5}, "at": [5.2, 1.63], "motion": motion}
    settings = {"world": walled(1.2) | {"movers": [mover]}, "lidar": {"beams": beams, "range": 6.0}}
    episode = run_episode(name, settings, {"robot.kinematics": "holonomic", "time.limit": 200.0}, known=False, **own)
    assert "waiting" in episode.modes and (episode.outcome, episode.verdict) == ("success", "")


def test_in_unknown_terrain_a_door_that_stays_shut_is_found_out_however_much_moves() -> None:
    motion = {"law": "waypoints", "points": [[3.0, 3.0], [3.0, -3.0]], "speed": 0.5}
    mover = {"shape": {"circle": 0.3}, "at": [3.0, 3.0], "motion": motion}
    settings = {"world": walled(0.3) | {"movers": [mover]}, "time": {"limit": 1000.0}}
    episode = run_episode("d_star_lite", settings, {"robot.kinematics": "holonomic"}, known=False)
    assert episode.verdict == "unreachable" and len(episode.path) <= 10 * 3 * 90


def test_what_has_been_seen_leaves_no_way_after_ten_seconds_in_which_nothing_opens_or_a_minute_without_one() -> None:
    policy: Any = make_policy("d_star_lite", Simulation("static"), known=False)
    seen = SeenGround(policy.parameters, policy.rooms)

    def waited(seconds: float, *, opens_every: float = math.inf) -> bool:
        for step in range(1, round(seconds) + 1):
            seen.wait(1.0, is_open=step % opens_every == 0.0)
        return seen.is_shut

    assert not waited(STILL_FOR - 1.0) and waited(1.0)
    seen.go_on()
    assert not seen.is_shut and not waited(MOST_WAITING - 1.0, opens_every=5.0) and waited(1.0, opens_every=1.0)
    seen.go_on()
    for _ in range(round(MOST_WAITING) - 1):  # on the way to look nothing is proven, but time is not without end
        seen.look_on(1.0)
        assert not seen.is_shut
    seen.look_on(1.0)
    assert seen.is_shut


def test_what_has_been_seen_is_forgotten_twice_at_most_and_only_where_something_has_gone() -> None:
    policy: Any = make_policy("d_star_lite", Simulation("static"), known=False)
    seen = SeenGround(policy.parameters, policy.rooms)
    assert len(policy.rooms) > 1 and not seen.forget()  # nothing has gone
    for _ in range(FORGOTTEN):
        rooms = [seen.room]
        while seen.narrow():
            rooms.append(seen.room)
        assert rooms == list(policy.rooms)  # one after the other, and all of them again
        seen.points.removed += 1
        seen.wait(99.0, is_open=False)
        assert seen.forget() and not seen.is_shut
        assert not seen.forget()  # not for the same
    seen.points.removed += 1
    assert not seen.forget()


# ------------------------------------------------------------------------------------------------------------- RRT*


def scattered() -> tuple[PlanningMap, float]:
    """Some discs and a wall in a box, and what a body grows them by."""
    rng = np.random.default_rng(3)
    discs = np.column_stack([rng.uniform(2.0, 18.0, 25), rng.uniform(0.5, 11.5, 25), rng.uniform(0.2, 0.9, 25)])
    border = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 12.0], [0.0, 12.0]])
    return PlanningMap(border, discs), 0.25


def test_the_cost_of_rrt_star_falls_toward_the_shortest_way() -> None:
    plan, growth = scattered()
    start, goal = (0.8, 6.0), (19.2, 6.0)
    exact = plan.shortest_path(start, goal, radius=growth).length
    solids = Solids.of(plan, growth)
    gaps = []
    for seed in range(4):
        grown = rrt_star(solids, plan.box, start, goal, samples=6000, seed=seed, step=1.0)
        finite = grown.lengths[np.isfinite(grown.lengths)]
        assert (np.diff(finite) <= 1e-12).all()
        assert finite[-1] == pytest.approx(np.hypot(*np.diff(grown.places, axis=0).T).sum())
        assert finite[-1] >= exact - 1e-9
        for a, b in zip(grown.places[:-1].tolist(), grown.places[1:].tolist(), strict=True):
            assert solids.is_clear(tuple(a), tuple(b)) and math.dist(a, b) <= 1.0 + 1e-9
        gaps.append([grown.lengths[number] / exact - 1.0 for number in (1500, 3000, 5999)])
    early, middle, late = np.mean(gaps, axis=0)
    assert early > middle > late and late < 0.02


def plain_tree(
    solids: Solids, box: tuple[float, float, float, float], start: F64, goal: F64, draws: F64, step: float
) -> list[float]:
    """The length of the best way at each draw of informed RRT*, step by step as its papers have it."""

    def is_clear(a: F64, b: F64) -> bool:
        return solids.is_clear(tuple(a.tolist()), tuple(b.tolist()))

    def cost(node: int) -> float:
        up = parents[node]
        return 0.0 if up < 0 else cost(up) + math.dist(places[node], places[up])

    places, parents, last = [start], [-1], -1
    lengths: list[float] = []
    apart, along = math.dist(start, goal), (goal - start) / math.dist(start, goal)
    for u, v, w in draws:
        best = cost(last) + math.dist(places[last], goal) if last >= 0 else math.inf
        lengths.append(best)
        angle, rim = 2.0 * math.pi * v, math.sqrt(u)
        longer, shorter = 0.5 * best, 0.5 * math.sqrt(best**2 - apart**2)  # of the ellipse
        if last >= 0:
            area = math.pi * longer * shorter
            ball = longer * rim * math.cos(angle) * along + shorter * rim * math.sin(angle) * np.array(
                [-along[1], along[0]]
            )
            place = 0.5 * (start + goal) + ball
        else:
            area = math.inf
            place = goal if w < 0.05 else np.array(box[:2]) + (u, v) * (np.array(box[2:]) - box[:2])
        away = np.hypot(*(np.array(places) - place).T)
        nearest = int(away.argmin())
        if away[nearest] > step:
            place = places[nearest] + step * (place - places[nearest]) / away[nearest]
        if not is_clear(places[nearest], place):
            continue
        away, count = np.hypot(*(np.array(places) - place).T), len(places)
        area = min(area, (box[2] - box[0]) * (box[3] - box[1]))
        least = 2.0 * math.sqrt(1.0 + 0.5) * math.sqrt(area / math.pi)  # gamma*, of theorem 38 of the paper
        near = np.flatnonzero(away <= min(1.1 * least * math.sqrt(math.log(count + 1) / (count + 1)), step))
        seen = [node for node in near.tolist() if is_clear(places[node], place)]
        parents.append(min([nearest, *seen], key=lambda node: cost(node) + away[node]))
        places.append(place)
        for node in seen:
            if cost(count) + away[node] < cost(node) - 1e-12:
                parents[node] = count
        rest = math.dist(place, goal)
        if rest <= step and cost(count) + rest < best and is_clear(place, goal):
            last = count
    return lengths


@pytest.mark.parametrize("step", [1.5, 6.0])
@pytest.mark.parametrize("seed", range(2))
def test_rrt_star_grows_the_tree_that_its_papers_describe(seed: int, step: float) -> None:
    """Where to samples go before and after the first way, from which place each is reached, and what is rewired."""
    plan, growth = scattered()
    solids, start, goal, samples = Solids.of(plan, growth), (0.8, 6.0), (19.2, 6.0), 500
    found = rrt_star(solids, plan.box, start, goal, samples=samples, seed=seed, step=step).lengths
    draws = np.random.default_rng(seed).random((samples, 3))
    lengths = plain_tree(solids, plan.box, np.array(start), np.array(goal), draws, step)
    assert np.isfinite(lengths).sum() > 100 and len({round(length, 9) for length in lengths[:-1]}) > 10
    np.testing.assert_allclose(found[:-1], lengths[1:], rtol=1e-9)


def test_rrt_star_is_a_function_of_its_seed() -> None:
    plan, growth = scattered()
    solids = Solids.of(plan, growth)
    first, again, other = (
        rrt_star(solids, plan.box, (0.8, 6.0), (19.2, 6.0), samples=600, seed=seed).lengths for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_rrt_star_draws_on_where_few_places_can_be_joined() -> None:
    """Between combs, which a way passes tooth by tooth, samples alone find none; patience does, and no longer than said."""
    teeth = [(x, 0.0, 10.4) if number % 2 else (x, 1.6, 12.0) for number, x in enumerate(np.arange(2.0, 18.5, 2.4))]
    polygons = tuple((np.array([[x, a], [x + 0.2, a], [x + 0.2, b], [x, b]]),) for x, a, b in teeth)
    plan = PlanningMap(scattered()[0].border, np.zeros((0, 3)), polygons)
    solids, start, goal = Solids.of(plan, 0.3), (0.7, 6.0), (19.3, 6.0)
    exact = plan.shortest_path(start, goal, radius=0.3).length
    for seed in range(3):
        once, patient = (
            rrt_star(solids, plan.box, start, goal, samples=1000, seed=seed, patience=patience) for patience in (1, 100)
        )
        assert len(once.places) == 0 and len(once.lengths) == 1000
        first = int(np.argmax(np.isfinite(patient.lengths)))
        assert 1000 < first < len(patient.lengths) <= first + 1000 + 1
        assert exact - 1e-9 <= patient.lengths[-1] < 1.5 * exact
        assert patient.lengths[-1] == pytest.approx(np.hypot(*np.diff(patient.places, axis=0).T).sum())


@pytest.mark.parametrize(("gap", "verdict"), [(0.3, "unreachable"), (0.45, "stuck")])
def test_rrt_star_is_patient_only_where_there_is_a_way_and_none_found_proves_nothing(
    gap: float, verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    patient: list[int] = []

    def counted(*args: Any, **settings: Any) -> Grown:
        patient.append(settings.get("patience", 1))
        return rrt_star(*args, **settings)

    monkeypatch.setattr("bug_gym.agents.planning.rrt_star.rrt_star", counted)
    episode = run_episode("rrt_star", {"world": walled(gap)}, {"robot.kinematics": "holonomic"}, samples=2)
    assert episode.verdict == verdict
    assert ("proves nothing" in episode.memory.reason) == (verdict == "stuck")
    assert (max(patient) > 1) == (verdict == "stuck")


def test_each_plan_of_rrt_star_draws_anew_and_only_after_several_in_vain_it_is_stuck(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seeds: list[Any] = []

    def none(*_: Any, seed: Any, **__: Any) -> Grown:
        seeds.append(seed)
        return Grown(np.zeros((0, 2)), np.zeros(0))

    monkeypatch.setattr("bug_gym.agents.planning.rrt_star.rrt_star", none)
    simulation = Simulation({"world": walled(1.0)}, overrides={"robot.kinematics": "holonomic"})
    simulation.reset(seeds=[0])
    policy: Any = make_policy("rrt_star", simulation, seed=5)
    memory, verdicts, drawn = policy.begin(0), [], []
    for memory.plans in range(6):
        verdicts.append(policy.plan(policy.look(None, memory), memory).verdict)
        drawn.append(set(seeds))
        seeds.clear()
    assert verdicts == [""] * TRIES + ["stuck"] * (6 - TRIES)
    assert all(len(one) == 1 for one in drawn) and len(set.union(*drawn)) == 6


def test_the_way_of_rrt_star_is_that_of_its_tree_pulled_straight() -> None:
    simulation = Simulation({"world": walled(1.0)}, overrides={"robot.kinematics": "holonomic"})
    simulation.reset(seeds=[0])
    lengths = {}
    for smooth in (True, False):
        policy: Any = make_policy("rrt_star", simulation, samples=300, smooth=smooth)
        memory = policy.begin(0)
        scene = policy.look(None, memory)
        places = policy.plan(scene, memory).places
        lengths[smooth] = float(np.hypot(*np.diff(places, axis=0).T).sum())
    still, room = memory.live.still, policy.rooms[0]
    tree = rrt_star(Solids.of(still, room.growth), still.box, scene.pose[:2], scene.goal, samples=300, seed=(0, 0))
    assert lengths[False] == pytest.approx(tree.lengths[-1], rel=1e-6)
    exact = still.shortest_path(scene.pose[:2], scene.goal, radius=room.growth).length
    assert exact - 1e-6 <= lengths[True] < lengths[False]


def test_rrt_star_refuses_an_end_in_an_obstacle() -> None:
    plan, growth = scattered()
    inside = (float(plan.discs[0, 0]), float(plan.discs[0, 1]))
    with pytest.raises(ValueError, match="the start .* lies in an obstacle, or nearer to one than 0.25 m"):
        rrt_star(Solids.of(plan, growth), plan.box, inside, (19.2, 6.0), samples=10)


# ------------------------------------------------------------------------------------------------------------- straight


@pytest.mark.parametrize("seed", range(20))
def test_clear_is_what_a_fine_walk_along_the_piece_finds(seed: int) -> None:
    plan, _ = scattered()
    square = np.array([[9.0, 5.0], [11.0, 5.0], [11.0, 7.5], [9.0, 7.5]])
    plan = PlanningMap(plan.border, plan.discs[:6], ((square,),))
    rng = np.random.default_rng(seed)
    for growth in (0.1, 0.6):
        solids = Solids.of(plan, growth)
        for _ in range(15):
            a, b = rng.uniform(0.0, (20.0, 12.0), (2, 2))
            walk = a + np.linspace(0.0, 1.0, 400)[:, None] * (b - a)
            least = min(plan.clearance_at((float(x), float(y))) for x, y in walk)
            step = math.dist(a, b) / 400
            if plan.clearance_at(tuple(a)) == 0.0 or plan.clearance_at(tuple(b)) == 0.0 or abs(least - growth) < step:
                continue
            assert solids.is_clear(tuple(a.tolist()), tuple(b.tolist())) == (least >= growth)


def test_pulling_straight_never_makes_longer_and_keeps_the_ends() -> None:
    rng = np.random.default_rng(0)
    chain = np.cumsum(rng.normal(size=(60, 2)), axis=0)
    open_ground = pulled(chain, 0.5, lambda a, b: True)
    assert open_ground.tolist() == chain[[0, -1]].tolist()
    as_it_was = pulled(chain, 0.5, lambda a, b: False)
    assert np.hypot(*np.diff(as_it_was, axis=0).T).sum() == pytest.approx(np.hypot(*np.diff(chain, axis=0).T).sum())


@pytest.mark.parametrize("name", PLANNERS)
def test_the_table_says_who_reads_the_map(name: str) -> None:
    assert AGENTS[name].privileged and make_policy(name, Simulation("static")).privileged  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", ["visibility_graph", "a_star"])
def test_who_goes_far_in_a_step_cuts_no_corner_of_its_way(name: str) -> None:
    # 2.5 m a step: it stood 0.214 m from the box for ever, nearer than its brake lets it begin to go.
    box = [[-1, -2], [1, -2], [1, 3], [-1, 3]]
    world = {"family": "explicit", "bounds": [-8, -8, 8, 8], "polygons": [box], "start": [-6, 0, 0], "goal": [6, 0.3]}
    described = {
        "robot": {"kinematics": "differential", "max_speed": 5.0},
        "lidar": {"beams": 180, "range": 20.0},
        "goal": {"radius": 1.5},
        "time": {"step": 0.5, "limit": 60.0},
        "world": world,
    }
    (row,) = evaluate([name], described, episodes=1)
    assert row.success and row.min_clearance > 0.03
