"""Evaluation: rows against plain loops and closed forms, suites, result folders that go on after a kill."""

import json
import math
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from math import inf, isnan, nan
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from bug_gym.agents import make_policy, policy_names
from bug_gym.agents.floors.go_to_goal import GoToGoal
from bug_gym.config import dump, load, scenario_names
from bug_gym.evaluation import evaluate, make_plan, rollout, work
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.pictures import typical
from bug_gym.evaluation.plan import room_at_goal
from bug_gym.evaluation.rollout import Rollout
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.suites import load_suite, suite_names
from bug_gym.evaluation.summary import OVERALL
from bug_gym.evaluation.teams import team_rows
from bug_gym.policy import Memory, ScriptedPolicy, Velocity
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

OPEN = {"name": "open", "world": {"family": "empty", "start": [0, 0, 0], "goal": [8, 0]}, "lidar": {"beams": 8}}
"""Nothing but a straight line of 8 m, at 1 m/s."""
NOISE = {"lidar.noise": 0.05, "odometry.rotation_noise": 0.05}
"""Noise that makes the same world another run for another seed."""


def without_times(rows: list[EpisodeRow]) -> list[dict[str, Any]]:
    """The rows as dicts without what a clock has measured."""
    kept = [{name: value for name, value in asdict(row).items() if "decision" not in name} for row in rows]
    return [{name: "nan" if value != value else value for name, value in row.items()} for row in kept]


def lines_of(folder: Path) -> list[bytes]:
    return (folder / "rows.jsonl").read_bytes().splitlines(keepends=True)


@dataclass
class Count(Memory):
    """How many decisions there were."""

    decisions: int = 0


class GivesUp(ScriptedPolicy):
    """Goes ahead, and gives up at its fourth decision where the goal is nearer than `within` [m]."""

    within = inf

    def start(self) -> Count:
        return Count()

    def act(self, view: View, memory: Count) -> Velocity:
        memory.decisions += 1
        memory.verdict = "stuck" if memory.decisions == 4 and view.goal_distance < self.within else ""
        return 1.0, 0.0


class Standing:
    """Never moves."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> Any:
        return np.zeros((len(observation), 2), dtype=np.float32), None


class Recurrent:
    """Stands for three steps, then goes ahead; its state is arrays for all robots, as SB3's recurrent policies have it.

    It keeps how many robots were in each call.
    """

    def __init__(self) -> None:
        self.sizes: list[int] = []

    def predict(
        self,
        observation: Any,
        state: tuple[Any, ...] | None = None,
        episode_start: Any = None,
        deterministic: bool = False,
    ) -> tuple[Any, tuple[Any, ...]]:
        rows = len(observation)
        self.sizes.append(rows)
        since = np.zeros((1, rows)) if state is None else state[0]
        since = np.where(episode_start, 0, since)
        actions = np.column_stack([np.where(since[0] < 3, 0.0, 1.0), np.zeros(rows)])
        return actions.astype(np.float32), (since + 1, since)


# ---------------------------------------------------------------------------------------------- rows


@pytest.mark.parametrize("scenario", ["dynamic", "maze", "u_trap"])
def test_a_row_is_what_a_plain_loop_over_the_env_measures(scenario: str) -> None:
    env = gym.make("BugGym/Navigation-v0", scenario=scenario)
    policy = make_policy("bug2", env)
    (row,) = evaluate("bug2", scenario, episodes=1, seed=3)
    observation, info = env.reset(seed=3, options={"shortest_path": True})
    assert row.shortest_path_length == info["shortest_path_length"]
    state, steps, over = None, 0, False
    while not over:
        action, state = policy.predict(observation, state, deterministic=True)
        assert state is not None
        if state[0].verdict:
            break
        observation, _, terminated, truncated, info = env.step(action)
        steps += 1
        over = terminated or truncated
    outcome = "gave_up" if state is not None and state[0].verdict else info["outcome"]
    assert (row.outcome, row.steps, row.time) == (outcome, steps, info["time"])
    assert (row.path_length, row.goal_distance) == (info["path_length"], info["goal_distance"])
    assert row.min_clearance == info["min_clearance"]


def test_a_straight_run_has_the_numbers_of_a_straight_line() -> None:
    (row,) = evaluate("go_to_goal", OPEN, episodes=1)
    assert row.success
    assert row.shortest_path_length == pytest.approx(8.0)
    assert row.path_length + row.goal_distance == pytest.approx(8.0, abs=1e-6)
    assert (row.spl, row.turns) == (1.0, 0)
    assert row.time == pytest.approx(row.steps * 0.1)
    assert isnan(row.time_ratio)


def test_the_earliest_time_of_meeting_a_target_that_waits_is_the_way_over_the_speed() -> None:
    target = {"at": [8, 0], "motion": {"law": "bounce", "velocity": [0, 0]}}
    waiting = {**OPEN, "world": {"family": "empty", "start": [0, 0, 0], "target": target}}
    (row,) = evaluate("go_to_goal", waiting, episodes=1)
    assert row.time_ratio == pytest.approx((8.0 - 0.3) / row.time)
    assert isnan(row.spl) and isnan(row.shortest_path_length)


def test_a_policy_meets_a_moving_target_no_earlier_than_a_straight_run_could() -> None:
    rows = evaluate("bug0", "moving_target", episodes=6)
    assert {row.success for row in rows} == {True}
    assert all(0.0 < row.time_ratio <= 1.0 for row in rows)


def test_the_earliest_meeting_is_that_of_the_robot_that_was_drawn() -> None:
    target = {"at": [5, 0], "motion": {"law": "bounce", "velocity": [0.3, 0.0]}}
    world = {"family": "explicit", "bounds": [-20, -20, 40, 20], "start": [0, 0, 0], "target": target}
    scenario = {"robot": {"kinematics": "holonomic"}, "time": {"limit": 60.0}, "world": world}
    speeds = {"robot.max_speed": {"choice": [0.8, 2.0]}}
    rows = evaluate(["go_to_goal"], scenario, episodes=8, overrides=speeds)
    # Straight after what goes away: 5 m less the goal's radius at the difference of the speeds, but for a step.
    met = [(5.0 - 0.3) / (speed - 0.3) for speed in (0.8, 2.0)]
    assert {min(met, key=lambda time: abs(time - row.time)) for row in rows} == set(met)
    assert all(row.time_ratio == pytest.approx(1.0, abs=0.1 / min(met)) for row in rows)


def test_every_policy_drives_in_the_same_worlds() -> None:
    rows = evaluate(["go_to_goal", "bug0"], ["static", "maze"], episodes=3, seed=5)
    worlds = [(row.scenario, row.seed, row.shortest_path_length) for row in rows]
    for policy in ("go_to_goal", "bug0"):
        mine = [world for world, row in zip(worlds, rows, strict=True) if row.policy == policy]
        assert [seed for _, seed, _ in mine] == [5, 6, 7] * 2
        assert mine == sorted(set(worlds), key=worlds.index)


def test_a_row_depends_on_its_seed_and_not_on_the_others() -> None:
    together = evaluate("bug2", "rush", episodes=20, overrides=NOISE)
    alone = [row for seed in range(20) for row in evaluate("bug2", "rush", episodes=1, seed=seed, overrides=NOISE)]
    assert without_times(together) == without_times(alone)
    assert len({row.path_length for row in together}) == 20


def test_two_workers_make_the_rows_of_one() -> None:
    arguments: dict[str, Any] = {"episodes": 10, "overrides": NOISE}
    one = evaluate(["bug0", "go_to_goal"], ["static", "rush"], **arguments)
    two = evaluate(["bug0", "go_to_goal"], ["static", "rush"], workers=2, **arguments)
    assert without_times(one) == without_times(two)


def test_a_verdict_ends_the_episode_before_the_robot_moves_again() -> None:
    policy = GivesUp(Sensors.of(load(OPEN)))
    (row,) = evaluate(policy, OPEN, episodes=1)
    assert (row.outcome, row.verdict, row.steps) == ("gave_up", "stuck", 3)
    assert row.path_length == pytest.approx(0.3, abs=1e-6)
    assert not row.success and row.spl == 0.0


def test_a_robot_that_gave_up_stands_while_the_other_goes_on() -> None:
    places = [{"start": [-5, 0, 0], "goal": [5, 0]}, {"start": [-5, 3, 0], "goal": [-3, 3]}]
    scenario = load({**OPEN, "world": {"family": "empty"}, "robots": places})
    policy = GivesUp(Sensors.of(scenario))
    policy.within = 3.0
    drive = Rollout(PolicyEntry("a", "a", policy=policy), ScenarioEntry("s", scenario, range(1)), [0])
    ((first, second),) = drive.worlds()
    assert (first.robot, first.outcome, second.robot, second.outcome) == (0, "success", 1, "gave_up")
    assert (second.steps, first.steps > 90) == (3, True)
    assert second.path_length == pytest.approx(0.3, abs=1e-6)
    assert drive.simulation.world.pose[0, 1, 0] == pytest.approx(-4.7, abs=1e-6)


@pytest.mark.parametrize("robot", [{}, {"latency": 0.2, "max_acceleration": 1.0}])
def test_a_goal_that_comes_to_a_robot_that_gave_up_ends_no_mission(robot: dict[str, Any]) -> None:
    target = {"at": [8, 0], "motion": {"law": "bounce", "velocity": [-0.4, 0]}}
    world = {"family": "explicit", "bounds": [-3, -9, 40, 9], "target": target, "start": [0, 0, 0]}
    places = [{"start": [0, 0, 0]}, {"start": [0, 4, 0]}]
    settings = {**OPEN, "mission": "first", "robot": robot, "time": {"limit": 25.0}, "world": world, "robots": places}
    scenario = load(settings)
    policy = GivesUp(Sensors.of(scenario))
    policy.within = 8.5  # robot 0, which starts 8 m from the goal; the other one goes ahead, and meets it nowhere
    drive = Rollout(PolicyEntry("a", "a", policy=policy), ScenarioEntry("s", scenario, range(1)), [0])
    ((first, second),) = drive.worlds()
    assert (first.outcome, second.outcome, second.time) == ("gave_up", "timeout", 25.0)
    reached = 8.0 - 0.4 * 25.0  # where the goal is by then: it has gone past the one that gave up
    assert reached < -scenario.goal.radius < 0.0 < first.path_length < 1.0
    (team,) = team_rows([first, second])
    assert (team.success, team.winner) == (False, -1)


def test_each_robot_of_a_world_has_a_row() -> None:
    rows = evaluate("go_to_goal", "crossing_robots", episodes=2)
    assert [(row.seed, row.robot) for row in rows] == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert [row.shortest_path_length for row in rows] == pytest.approx([10.0] * 4)


def test_each_decision_of_a_scripted_policy_is_timed_on_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = iter(range(1_000_000))
    monkeypatch.setattr(rollout, "perf_counter", lambda: float(next(ticks)))
    for row in evaluate("bug0", "static", episodes=3):
        assert (row.decision_time_mean, row.decision_time_p99) == (1.0, 1.0)
        assert row.decision_time_total == row.steps


def test_robots_share_the_time_of_a_call_for_all_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = iter(range(1_000_000))
    monkeypatch.setattr(rollout, "perf_counter", lambda: float(next(ticks)))
    for row in evaluate(Recurrent(), OPEN, episodes=4):
        assert row.decision_time_mean == 0.25


# ---------------------------------------------------------------------------------------------- policies of other kinds


def test_a_recurrent_policy_starts_anew_with_each_episode() -> None:
    policy = Recurrent()
    scenario = ScenarioEntry("open", load(OPEN), range(5))
    drive = Rollout(PolicyEntry("recurrent", "Recurrent", policy=policy), scenario, range(5), slots=2)
    rows = [row for world in drive.worlds() for row in world]
    (straight,) = evaluate("go_to_goal", OPEN, episodes=1)
    assert sorted(row.seed for row in rows) == [0, 1, 2, 3, 4]
    assert {row.steps for row in rows} == {3 + straight.steps}
    assert set(policy.sizes) == {2}


def test_numbers_of_discrete_actions_are_driven_as_velocities() -> None:
    class Ahead:
        observation_space = gym.spaces.Dict()

        def predict(self, observation: Any, *_: Any, deterministic: bool) -> tuple[Any, None]:
            assert isinstance(observation, Mapping) and observation["ranges"].shape == (1, 8)
            return np.array([3]), None  # heading 0 at full speed

    (row,) = evaluate(Ahead(), OPEN, episodes=1)
    assert row.success
    assert row.policy == "Ahead"


@pytest.mark.parametrize(
    "answer",
    [
        None,
        (None, None),
        "ab",
        ("ab", None),
        (np.zeros(2), None),
        (np.zeros((7, 2)), None),
        (np.zeros((1, 3)), None),
        (np.array([[1j, 0]]), None),
        (np.array([[True, False]]), None),
        (np.array(["a"]), None),
        (np.array([128]), None),
        (np.array([-1]), None),
        (3, None),
        (np.full((1, 2), np.nan), None),
        (np.full((1, 2), 1e300), None),
        (np.zeros((1, 2)), None, None),
    ],
    ids=repr,
)
def test_what_is_no_answer_of_a_policy_is_told_and_not_driven(answer: Any) -> None:
    class Answers:
        def predict(self, *_: Any, **__: Any) -> Any:
            return answer

    with pytest.raises(ValueError, match="^the policy('s predict)? answered"):
        evaluate(Answers(), OPEN, episodes=1)


@pytest.mark.parametrize(
    "velocity",
    [None, 5, "ab", (1.0,), (1.0, 2.0, 3.0), (nan, 0.0), (inf, 0.0), (1j, 0.0), (None, None), np.eye(2)],
    ids=repr,
)
def test_what_is_no_velocity_of_an_act_is_told_and_not_driven(velocity: Any) -> None:
    class Mine(ScriptedPolicy):
        def start(self) -> Memory:
            return Memory()

        def act(self, view: View, memory: Memory) -> Any:
            return velocity

    for kinematics in ("holonomic", "differential"):
        with pytest.raises(ValueError, match=r"^Mine\.act answered .*, expected a velocity \(ahead, left\)"):
            evaluate(Mine, OPEN, episodes=1, overrides={"robot.kinematics": kinematics})


def test_a_policy_that_reads_the_map_says_so_in_its_rows_and_has_one_world_at_a_time() -> None:
    policy = Recurrent()
    policy.privileged = True  # type: ignore[attr-defined]
    rows = evaluate([("planner", policy)], OPEN, episodes=3)
    assert {row.policy for row in rows} == {"planner (privileged)"}
    assert set(policy.sizes) == {1}


def test_policies_that_read_the_map_can_be_left_out() -> None:
    unknown = {"name": "d_star_lite", "label": "unknown", "parameters": {"known": False}}
    entries = ["bug2", "a_star", unknown, "d_star_lite"]
    assert [entry.label for entry in make_plan(entries, OPEN, episodes=1, privileged=False).policies] == [
        "bug2",
        "unknown",
    ]
    marked = [entry.label for entry in make_plan(entries, OPEN, episodes=1).policies]
    assert marked == ["bug2", "a_star (privileged)", "unknown", "d_star_lite (privileged)"]
    with pytest.raises(ValueError, match="expected a policy that does not read the map, got a_star"):
        make_plan(["a_star"], OPEN, privileged=False)


def test_parameters_reach_the_policy_under_a_label_of_its_own() -> None:
    left, right = {"name": "bug0", "label": "left"}, ("right", "bug0", {"turn": "right"})
    rows = evaluate([left, right], "slab", episodes=1)
    assert [row.policy for row in rows] == ["left", "right"]
    # The slab reaches 5 m to the left of the straight line and 3 m to the right.
    assert rows[0].path_length > rows[1].path_length + 1.0


@pytest.mark.parametrize(
    ("policies", "message"),
    [
        (["bug0", "bug0"], "two policies are called 'bug0'"),
        ("bug_0", "did you mean 'bug0'"),
        ([{"name": "bug0", "labell": "a"}], "did you mean 'label'"),
        ([("two\nlines", GoToGoal)], "label: got 'two.nlines', expected one line without control characters"),
        ([(5, GoToGoal)], "label: got 5"),
        ([("a", "bug0", {"turm": "left"})], "did you mean 'turn'"),
        (
            [{"name": "bug0:turn=left", "parameters": {"turn": "right"}}],
            "got turn of 'bug0:turn=left' .* expected it once",
        ),
        ([3], "expected a name"),
        ([], "no policies"),
        ([GivesUp(Sensors.of(load("disc")))], "made for another robot: .*beams 360, not 64"),
    ],
)
def test_bad_policies_are_told_before_anything_is_written(policies: Any, message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=message):
        evaluate(policies, "static", episodes=1, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"episodes": 0}, "at least one episode"),
        ({"seed": -1}, "a seed from 0 on"),
        ({"workers": 0}, "workers"),
        ({"overrides": {"lidar.beems": 3}}, "did you mean 'beams'"),
    ],
)
def test_bad_arguments_are_told(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        evaluate("bug0", "static", **arguments)


# ---------------------------------------------------------------------------------------------- suites


BARN_WORLD = {
    "world": 7,
    "start": [-2.0, 3.0, 1.57],
    "goal": [-2.0, 13.0],
    "cylinder_radius": 0.075,
    "cylinders": [[-3.0, 5.0], [-1.0, 8.0]],
}


@pytest.fixture
def barn_file(tmp_path: Path) -> Path:
    """A file of one world in the form of the BARN benchmark's."""
    path = tmp_path / "worlds.jsonl"
    path.write_text(json.dumps(BARN_WORLD) + "\n")
    return path


def test_results_go_on_where_their_data_has_moved_and_nothing_else(barn_file: Path, tmp_path: Path) -> None:
    moved, out = tmp_path / "elsewhere" / barn_file.name, tmp_path / "out"
    one = {"world": {"family": "barn", "path": str(barn_file)}, "time": {"limit": 1.0}}
    rows = evaluate("go_to_goal", one, episodes=1, out=out)
    moved.parent.mkdir()
    barn_file.rename(moved)
    there = {"world.path": str(moved)}
    one["world"] = {"family": "barn", "path": str(tmp_path)}
    assert [row.seed for row in evaluate("go_to_goal", one, episodes=1, out=out, overrides=there)] == [rows[0].seed]
    with pytest.raises(ValueError, match="another run: scenarios.custom.scenario.time.limit was 1.0, is now 2.0"):
        evaluate("go_to_goal", one, episodes=1, out=out, overrides={**there, "time.limit": 2.0})
    moved.write_text(moved.read_text() + "\n")
    with pytest.raises(ValueError, match="another run: scenarios.custom.data was"):
        evaluate("go_to_goal", one, episodes=1, out=out, overrides=there)


@pytest.mark.parametrize("name", suite_names())
def test_every_suite_can_be_driven(name: str, barn_file: Path) -> None:
    suite = load_suite(name)
    plan = make_plan("go_to_goal", suite, episodes=1, data=barn_file if suite.data else None)
    assert plan.suite == f"{name} v{suite.version}"
    assert {policy.name for policy in suite.policies} <= set(policy_names())


def test_the_promised_suites_are_there() -> None:
    promised = ["barn", "dynamic", "moving_target", "noise", "quick", "smoke", "static", "traps"]
    assert suite_names() == promised


def test_a_name_that_a_suite_shares_with_a_scenario_is_the_scenarios() -> None:
    assert "static" in suite_names() and "static" in scenario_names()
    plan = make_plan("go_to_goal", "static", episodes=1)
    assert plan.suite == "" and [entry.label for entry in plan.scenarios] == ["static"]


def test_a_suite_that_needs_data_asks_for_it() -> None:
    with pytest.raises(ValueError, match="suite 'barn' needs data .*: the worlds of the BARN benchmark"):
        make_plan("go_to_goal", load_suite("barn"))


def test_data_that_no_suite_asked_for_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="got data .*, expected none"):
        make_plan("go_to_goal", "smoke", data=tmp_path)


def test_data_that_is_not_there_is_told_by_its_path(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"barn v1: scenarios\.0: .*world\.path: got .*nowhere.*exists"):
        make_plan("go_to_goal", "barn", data=tmp_path / "nowhere")


def test_a_faulty_entry_of_a_suite_is_told_once() -> None:
    with pytest.raises(ValueError, match="did you mean 'overrides'") as found:
        load_suite({"scenarios": [{"scenario": "static", "overides": {}}], "seeds": {"count": 2}})
    assert "\n" not in str(found.value)


def test_a_missing_scenario_of_a_suite_is_told_with_its_place_in_the_suite(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("scenarios: [static, dynamik]\n")
    with pytest.raises(ValueError, match=r"mine v1: scenarios\.1: no scenario 'dynamik', did you mean 'dynamic'"):
        make_plan("go_to_goal", path)


def test_the_summary_on_disk_compares_each_policy_with_the_baseline(tmp_path: Path) -> None:
    world = {"world": {"family": "empty", "start": [0, 0, 0], "goal": {"region": [4, -1, 6, 1]}}}
    policies = ["bug0", ("standing", Standing()), "go_to_goal"]
    evaluate(policies, world, episodes=4, out=tmp_path, baseline="go_to_goal", overrides={"time.limit": 12.0})
    stored = json.loads((tmp_path / "summary.json").read_text())["differences"]
    assert {(one["policy"], one["baseline"]) for one in stored} == {("bug0", "go_to_goal"), ("standing", "go_to_goal")}
    success = {one["policy"]: one["mean"] for one in stored if one["field"] == "success"}
    assert success == {"bug0": 0.0, "standing": -1.0}
    assert (tmp_path / "differences.csv").read_text().count("\n") == 1 + len(stored)


def test_a_baseline_that_does_not_drive_is_told() -> None:
    with pytest.raises(ValueError, match="baseline must be one of bug0, came 'bug2'"):
        evaluate("bug0", "static", episodes=1, baseline="bug2")


def test_a_baseline_that_reads_the_map_is_named_with_or_without_its_mark(tmp_path: Path) -> None:
    world = {"world": {"family": "empty", "start": [0, 0, 0], "goal": [3, 0]}, "lidar": {"beams": 8}}
    for name in ("a_star", "a_star (privileged)"):
        evaluate(["a_star", "go_to_goal"], world, episodes=1, out=tmp_path / name, baseline=name)
        (pair,) = {
            (one["policy"], one["baseline"])
            for one in json.loads((tmp_path / name / "summary.json").read_text())["differences"]
        }
        assert pair == ("go_to_goal", "a_star (privileged)")


@pytest.mark.parametrize(
    ("policies", "message"),
    [
        ([("a_star (privileged)", "go_to_goal"), "a_star"], r"^a_star \(privileged\) does not read the map"),
        ([("a_star (privileged)", "a_star"), "a_star"], r"^two policies are called 'a_star \(privileged\)'"),
    ],
)
def test_a_label_is_that_of_one_policy_with_the_mark_of_those_that_read_the_map_too(
    policies: Any, message: str, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=message):
        evaluate(policies, "static", episodes=1, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_mark_of_a_policy_that_reads_the_map_stands_there_once() -> None:
    plan = make_plan([("best (privileged)", "a_star")], OPEN, episodes=1)
    assert [entry.label for entry in plan.policies] == ["best (privileged)"]


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"policies": 5}, "got 5 as policies, expected a list of these, or one: a name, a Spec"),
        ({"policies": Memory}, "as policies, expected a list"),
        ({"overrides": [1]}, r"overrides: got \[1\], expected a mapping of dotted keys to values"),
        ({"overrides": "lidar.beams=3"}, "overrides: got 'lidar.beams=3', expected a mapping"),
        ({"episodes": True}, "at least one episode, whole numbers, got 0 and True"),
        ({"seed": False}, "expected a seed from 0 on .* got False and 50"),
    ],
)
def test_what_is_no_evaluation_is_told_with_what_came(asked: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message) as error:
        evaluate(**{"policies": "bug0", "scenario_or_suite": "static", **asked})
    assert "\n" not in str(error.value)


def test_the_quick_suite_is_driven_by_every_policy_but_that_of_two_robots() -> None:
    driven = [name for name in policy_names() if name != "ppo_crossing_robots"]
    assert [entry.name for entry in make_plan(None, "quick").policies] == driven


def test_a_suite_says_scenarios_overrides_labels_seeds_and_policies(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("world: {family: empty, start: [0, 0, 0], goal: [4, 0]}\n")
    path = tmp_path / "suite.yaml"
    path.write_text(
        "version: 3\nseeds: {first: 7, count: 2}\npolicies: [go_to_goal]\nscenarios:\n"
        "  - ./mine.yaml\n"
        "  - {scenario: mine.yaml, label: far, overrides: {world.goal: [6, 0]}, seeds: {count: 1}}\n"
    )
    rows = evaluate(None, path)
    assert [(row.scenario, row.seed) for row in rows] == [("mine", 7), ("mine", 8), ("far", 0)]
    assert [row.shortest_path_length for row in rows] == pytest.approx([4.0, 4.0, 6.0])
    assert make_plan(None, path).suite == "suite v3"


@pytest.mark.parametrize(
    "scenario",
    [
        "{world: {family: far.py:Far}}",
        '{world: {family: empty}, reward_terms: {path: "far.py:near"}}',
        '{world: {family: empty}, reward_terms: {function: "far.py:near"}}',
        '{world: {family: empty}, reward_terms: {near: {function: "far.py:near"}}}',
        'empty, overrides: {reward_terms.near: "far.py:near"}',
        'empty, overrides: {observation_fields.x: {function: "far.py:near", low: 0, high: 1}}',
        "empty, overrides: {world: {family: far.py:Far}}",
        "{world: {family: barn, path: far.jsonl}}",
        "{world: {family: barn, path: gone.jsonl}}, overrides: {world.path: far.jsonl}",
    ],
)
def test_what_a_suite_names_lies_beside_it(scenario: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the working directory lie others of the same names, which must not be taken."""
    beside, elsewhere = tmp_path / "suites", tmp_path / "elsewhere"
    code = (
        "from bug_gym.worlds.empty import EmptyWorld\n\ndef near(clearance):\n    return clearance\n\n"
        "class Far(EmptyWorld):\n    pass\n"
    )
    for folder, text in ((beside, code), (elsewhere, "raise AssertionError('of another folder')\n")):
        folder.mkdir()
        (folder / "far.py").write_text(text, encoding="utf-8")
        (folder / "far.jsonl").write_text("{}\n", encoding="utf-8")
    monkeypatch.chdir(elsewhere)
    (beside / "suite.yaml").write_text(f"scenarios:\n  - {{label: one, scenario: {scenario}}}\n", encoding="utf-8")
    (item,) = load_suite("../suites/suite.yaml").scenarios
    data = dump(load(item.scenario, item.overrides, trust=True))
    own = {**data.get("reward_terms", {}), **data.get("observation_fields", {})}
    named = [*map(str, data.get("world", {}).values()), *(part["function"] for part in own.values())]
    places = [Path(name.rpartition(":")[0] or name) for name in named if "far" in name]
    assert [place.resolve().parent for place in places] == [beside]


def test_seeds_of_the_caller_replace_those_of_a_suite() -> None:
    plan = make_plan("bug0", "smoke", episodes=2, seed=11)
    assert {entry.seeds for entry in plan.scenarios} == {range(11, 13)}


@pytest.mark.parametrize(
    ("suite", "message"),
    [
        ("smok", "did you mean 'smoke'"),
        ({"scenarios": []}, "scenarios: got .*at least 1"),
        ({"scenarios": ["static"], "seed": 3}, "did you mean 'seeds'"),
        ({"scenarios": ["static"], "seeds": {"count": 0}}, "seeds.count: got 0, expected at least 1"),
    ],
)
def test_a_suite_that_cannot_be_is_told(suite: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        load_suite(suite)


def test_a_scenario_that_is_called_as_all_of_them_is_refused_before_anything_is_driven(tmp_path: Path) -> None:
    suite = {"scenarios": ["empty", {"scenario": "static", "label": OVERALL}]}
    with pytest.raises(ValueError, match=r"no scenario may be named '\(all\)'"):
        evaluate("bug0", suite, episodes=1, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_scenario_twice_without_labels_is_told() -> None:
    with pytest.raises(
        ValueError, match=r"two scenarios are called 'static': leave one out, or give them names \(`name:`\)$"
    ):
        make_plan("bug0", ["static", "static"])


# ---------------------------------------------------------------------------------------------- result folders


def test_a_folder_holds_rows_summary_and_a_picture_of_each_policy_and_scenario(tmp_path: Path) -> None:
    rows = evaluate(["bug0", "go_to_goal"], ["static", OPEN], episodes=2, out=tmp_path, pictures=True)
    read = [EpisodeRow.from_dict(json.loads(line)) for line in lines_of(tmp_path)]
    assert sorted(map(str, read)) == sorted(map(str, rows))
    assert json.loads((tmp_path / "summary.json").read_text())["summaries"]
    pictures = {path.name for path in (tmp_path / "pictures").iterdir()}
    assert pictures == {f"{scenario}-{name}.png" for scenario in ("static", "open") for name in ("bug0", "go_to_goal")}


def test_a_run_that_was_cut_off_goes_on_and_repeats_nothing(tmp_path: Path) -> None:
    whole = evaluate(["bug0", "bug2"], "static", episodes=4, out=tmp_path)
    lines = lines_of(tmp_path)
    (tmp_path / "rows.jsonl").write_bytes(b"".join(lines[:3]) + lines[3][:50])
    again = evaluate(["bug0", "bug2"], "static", episodes=4, out=tmp_path)
    assert without_times(again) == without_times(whole)
    assert lines_of(tmp_path)[:3] == lines[:3]
    assert len(lines_of(tmp_path)) == 8


def test_a_finished_run_is_only_read(tmp_path: Path) -> None:
    rows = evaluate("bug0", "static", episodes=2, out=tmp_path)
    before = (tmp_path / "rows.jsonl").read_bytes()
    again = evaluate("bug0", "static", episodes=2, out=tmp_path)
    assert list(map(str, again)) == list(map(str, rows))  # as text, because NaN is not equal to itself
    assert (tmp_path / "rows.jsonl").read_bytes() == before


def test_a_world_of_which_a_robot_is_missing_is_driven_again(tmp_path: Path) -> None:
    evaluate("go_to_goal", "crossing_robots", episodes=2, out=tmp_path)
    lines = lines_of(tmp_path)
    (tmp_path / "rows.jsonl").write_bytes(b"".join(lines[:3]))
    evaluate("go_to_goal", "crossing_robots", episodes=2, out=tmp_path)
    assert lines_of(tmp_path)[:2] == lines[:2]
    assert [(row["seed"], row["robot"]) for row in map(json.loads, lines_of(tmp_path))] == [
        (0, 0),
        (0, 1),
        (1, 0),
        (1, 1),
    ]


def test_known_shortest_paths_are_not_searched_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    evaluate("bug0", "static", episodes=2, out=tmp_path)
    (tmp_path / "rows.jsonl").unlink()
    monkeypatch.setattr(work, "shortest_lengths", None)
    assert len(evaluate("bug0", "static", episodes=2, out=tmp_path)) == 2


def test_an_infinite_shortest_path_survives_the_folder(tmp_path: Path) -> None:
    evaluate("go_to_goal", "ring", episodes=1, out=tmp_path, overrides={"time.limit": 1.0})
    (tmp_path / "rows.jsonl").unlink()
    (row,) = evaluate("go_to_goal", "ring", episodes=1, out=tmp_path, overrides={"time.limit": 1.0})
    assert row.shortest_path_length == inf


def test_a_killed_run_loses_no_finished_row(tmp_path: Path) -> None:
    arguments = ["--scenario", "static", "--policies", "bug0,bug2", "--episodes", "60", "--out", str(tmp_path / "out")]
    command = [sys.executable, "-m", "bug_gym", "evaluate", *arguments]
    rows = tmp_path / "out" / "rows.jsonl"
    with subprocess.Popen(command, cwd=Path(__file__).parents[2], stderr=subprocess.DEVNULL) as run:
        while run.poll() is None and (not rows.exists() or rows.read_bytes().count(b"\n") < 5):
            time.sleep(0.005)
        run.kill()
    assert run.returncode < 0, "it was over before it was killed"
    kept = [line for line in lines_of(tmp_path / "out") if line.endswith(b"\n")]
    finished = evaluate(["bug0", "bug2"], "static", episodes=60, out=tmp_path / "out")
    assert lines_of(tmp_path / "out")[: len(kept)] == kept
    assert len(finished) == len(lines_of(tmp_path / "out")) == 120


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"episodes": 1}, "scenarios.static.seeds.count was 2, is now 1"),
        ({"seed": 1, "episodes": 8}, "scenarios.static.seeds.first was 0, is now 1"),
        ({"overrides": {"lidar.beams": 90}}, "scenarios.static.scenario.lidar.beams was 64, is now 90"),
        ({"policies": [("bug0", "bug0", {"turn": "right"})]}, "policies.bug0.parameters.turn was missing"),
        ({"policies": ["bug2"]}, "policies.bug0 was .*, is now missing"),
    ],
)
def test_a_folder_of_another_run_is_refused_by_what_differs(
    change: dict[str, Any], message: str, tmp_path: Path
) -> None:
    arguments: dict[str, Any] = {"policies": ["bug0"], "episodes": 2, "out": tmp_path}
    evaluate(scenario_or_suite="static", **arguments)
    before = sorted((path, path.read_bytes()) for path in tmp_path.rglob("*") if path.is_file())
    with pytest.raises(ValueError, match=message):
        evaluate(scenario_or_suite="static", **{**arguments, **change})
    assert sorted((path, path.read_bytes()) for path in tmp_path.rglob("*") if path.is_file()) == before


def test_a_folder_grows_by_seeds_and_policies_and_has_what_a_new_one_would(tmp_path: Path) -> None:
    grown, new = tmp_path / "grown", tmp_path / "new"
    first = evaluate("bug0", "static", episodes=3, seed=4, out=grown)
    before = lines_of(grown)
    rows = evaluate(["bug0", "bug2"], "static", episodes=8, seed=2, out=grown)
    assert lines_of(grown)[: len(before)] == before and len(rows) == len(lines_of(grown)) == 16
    assert [row for row in rows if row.policy == "bug0" and 4 <= row.seed < 7] == first

    def without_times(folder: Path) -> list[dict[str, Any]]:
        told = [json.loads(line) for line in lines_of(folder)]
        kept = [{key: value for key, value in row.items() if "decision_time" not in key} for row in told]
        return sorted(kept, key=lambda row: (row["policy"], row["seed"]))

    evaluate(["bug0", "bug2"], "static", episodes=8, seed=2, out=new)
    assert without_times(grown) == without_times(new)
    assert (grown / "manifest.json").read_bytes() == (new / "manifest.json").read_bytes()
    evaluate(["bug0", "bug2"], "static", episodes=8, seed=2, out=grown)
    assert len(lines_of(grown)) == 16
    with pytest.raises(ValueError, match=r"seeds\.first was 2, is now 4"):  # what it has grown by is its own now
        evaluate("bug0", "static", episodes=3, seed=4, out=grown)


def test_who_asks_a_folder_for_less_is_told_to_ask_for_all_of_it(tmp_path: Path) -> None:
    evaluate(["bug0", "bug2"], "static", episodes=3, out=tmp_path)
    for policies, episodes, told in (
        (["bug0"], 3, "policies.bug2 was"),
        (["bug0", "bug2"], 2, "seeds.count was 3, is now 2"),
    ):
        with pytest.raises(
            ValueError, match=f"holds more than is asked: .*{told}.*; ask for all of it, or name another"
        ):
            evaluate(policies, "static", episodes=episodes, out=tmp_path)


WALKER = """from bug_gym.agents.floors.go_to_goal import GoToGoal


class Walker(GoToGoal):
    pass
"""


def test_a_repair_drops_the_rows_of_a_policy_that_was_mended_since_and_of_no_other(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    runs: dict[str, Any] = {"scenario_or_suite": OPEN, "episodes": 2, "out": tmp_path / "out"}
    file = tmp_path / "walker.py"
    policies = ["bug0", f"{file}:Walker"]
    file.write_text(WALKER)
    evaluate(policies, **runs)
    before = lines_of(tmp_path / "out")
    file.write_text(WALKER + "\n# mended\n")
    with pytest.raises(ValueError, match=r"Walker\.code was .*name another folder, --repair drops its rows, or remove"):
        evaluate(policies, **runs)
    assert lines_of(tmp_path / "out") == before
    rows = evaluate([*policies, "bug2"], **runs, repair=True)  # it may grow, too
    assert [row.policy for row in rows] == ["bug0", "bug0", *[policies[1]] * 2, "bug2", "bug2"]
    kept, dropped = ([line for line in before if (b"Walker" in line) == is_its] for is_its in (False, True))
    assert lines_of(tmp_path / "out")[:2] == kept and len(lines_of(tmp_path / "out")) == 6
    assert (tmp_path / "out" / "dropped.jsonl").read_bytes() == b"".join(dropped)
    assert "dropped 2 of 4 lines, 2 of the code that" in caplog.text
    evaluate([*policies, "bug2"], **runs)
    with pytest.raises(ValueError, match="seeds.first"):  # it makes no other run the same
        evaluate([*policies, "bug2"], **runs, seed=9, repair=True)


def test_a_damaged_folder_does_not_grow(tmp_path: Path) -> None:
    evaluate("bug0", "static", episodes=1, out=tmp_path)
    manifest = (tmp_path / "manifest.json").read_bytes()
    with (tmp_path / "rows.jsonl").open("ab") as file:
        file.write(b"{}\n")
    with pytest.raises(ValueError, match="line 2"):
        evaluate(["bug0", "bug2"], "static", episodes=2, out=tmp_path)
    assert (tmp_path / "manifest.json").read_bytes() == manifest
    assert len(evaluate("bug0", "static", episodes=1, out=tmp_path, repair=True)) == 1


def test_a_folder_grows_by_scenarios(tmp_path: Path) -> None:
    suite: dict[str, Any] = {"name": "growing", "seeds": {"count": 2}, "scenarios": ["static"]}
    evaluate("bug0", suite, out=tmp_path)
    rows = evaluate("bug0", {**suite, "scenarios": ["empty", "static"]}, out=tmp_path)
    assert [row.scenario for row in rows] == ["empty", "empty", "static", "static"] and len(lines_of(tmp_path)) == 4


def test_a_policy_object_does_not_go_on_with_the_rows_of_another(tmp_path: Path) -> None:
    evaluate(Recurrent(), OPEN, episodes=1, out=tmp_path)
    with pytest.raises(ValueError, match="Recurrent is an object"):
        evaluate(Recurrent(), OPEN, episodes=1, out=tmp_path)


def test_a_folder_with_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ValueError, match="holds something else"):
        evaluate("bug0", "static", episodes=1, out=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_damaged_row_is_told_with_its_line(tmp_path: Path) -> None:
    evaluate("bug0", "static", episodes=3, out=tmp_path)
    lines = lines_of(tmp_path)
    (tmp_path / "rows.jsonl").write_bytes(lines[0] + b"{]\n" + lines[2])
    with pytest.raises(ValueError, match=r"rows\.jsonl: line 2"):
        evaluate("bug0", "static", episodes=3, out=tmp_path)


# ---------------------------------------------------------------------------------------------- pictures


ROW = EpisodeRow("a", "s", 0, 0, "success", "", True, 1.0, 10, 1.0, 0.1, 1.0, 1.0, 0.5, 0.5, 0, 0.0, 0.1, 0.1, 1.0)


def test_the_typical_episode_is_the_success_with_the_median_path() -> None:
    rows = [replace(ROW, seed=seed, path_length=length) for seed, length in enumerate([9.0, 1.0, 5.0])]
    failed = replace(ROW, seed=7, outcome="timeout", success=False, path_length=4.0)
    assert typical([failed, *rows]).seed == 2


def test_where_nothing_succeeded_the_first_episode_is_typical() -> None:
    failed = [replace(ROW, seed=seed, outcome="timeout", success=False, path_length=9.0 - seed) for seed in (3, 4)]
    assert typical(failed).seed == 3


@pytest.mark.parametrize(
    ("scenario", "overrides", "expected"),
    [
        ("oni_wang_pair", {}, True),
        ("crossing_robots", {}, True),  # the scanner's noise alone differs
        ("u_trap", {}, True),
        ("u_trap", {"world.rotation": "random"}, False),
        ("u_trap", {"robot.max_speed": {"uniform": [0.8, 1.0]}}, False),
        ("random_crossings", {}, False),
        ("static", {}, False),
        ("moving_target", {}, False),
        ("crowd", {}, False),
    ],
)
def test_who_evaluates_one_world_many_times_is_told(
    scenario: str,
    overrides: dict[str, Any],
    expected: bool,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("bug_gym.log.told", set())
    make_plan("go_to_goal", scenario, episodes=2, overrides=overrides)
    assert ("every seed has the same world" in caplog.text) == expected
    caplog.clear()
    make_plan("go_to_goal", scenario, episodes=1, overrides=overrides)
    assert "every seed" not in caplog.text


def test_worlds_that_nobody_asks_for_need_no_place() -> None:
    field = {"family": "field", "bounds": [-6, -6, 6, 6], "sizes": [0.4, 0.9], "separation": 6.0, "solvable": 0.3}
    tight = load({"name": "tight", "world": {**field, "obstacles": 29}})

    def finds_place(seed: int) -> bool:
        try:
            Simulation(tight).reset(seeds=[seed])
        except ValueError:
            return False
        return True

    has_place = [finds_place(seed) for seed in range(40)]
    assert not (has_place[0] and has_place[1])
    seed = next(seed for seed in range(2, 39) if has_place[seed] and has_place[seed + 1])
    assert make_plan("go_to_goal", tight, episodes=2, seed=seed).scenarios[0].seeds == range(seed, seed + 2)


@pytest.mark.parametrize(("count", "radius"), [(2, 0.21), (3, 0.41), (6, 1.01), (9, 1.61)])
def test_robots_find_room_at_a_goal_whose_radius_is_above_all_bodies_but_one(count: int, radius: float) -> None:
    assert room_at_goal(radius, 0.2) >= count


@pytest.mark.parametrize("share", [0.99, 0.9, 0.7, 0.5, 0.3, 0.05])
def test_whoever_has_come_first_leaves_room_at_a_goal(share: float) -> None:
    """Bodies on the rim about a goal, each as far from the others as leaves as little as can be to who comes next."""
    room, taken = room_at_goal(1.0, share), 2.0 * math.asin(share)
    assert (room - 1) * 2.0 * taken < 2.0 * math.pi <= room * 2.0 * taken


@pytest.mark.parametrize(
    ("count", "changes", "told"),
    [
        (3, {}, False),
        (4, {}, True),
        (2, {"robot.radius": 0.4}, True),
        (4, {"robot.radius": 0.05}, False),
        (4, {"mission": "first"}, False),
        (4, {"goal.radius": 0.7}, False),
        (4, {"world.goal": None, "world.target": {"at": [8, 0], "motion": {"law": "bounce", "speed": 0.1}}}, False),
    ],
)
def test_who_sends_more_robots_to_a_goal_than_find_room_is_told(
    count: int,
    changes: dict[str, Any],
    told: bool,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("bug_gym.log.told", set())
    world = {"family": "empty", "start": [-4, 0, 0], "goal": [8, 0]}
    scenario = load({"name": "crew", "world": world, "robots": {"count": count}}, changes)
    make_plan("go_to_goal", scenario, episodes=1)
    assert (f"{count} robots go to one goal" in caplog.text) == told
    caplog.clear()
    make_plan("go_to_goal", "circle_swap", episodes=1, overrides={"robots.count": 8})
    assert "go to one goal" not in caplog.text


def test_who_evaluates_one_world_again_and_again_is_told_once(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As `bug-gym benchmark` does, which drives the same episodes five times to time their decisions."""
    monkeypatch.setattr("bug_gym.log.told", set())
    for scenario in ("crossing_robots", "u_trap", "crossing_robots"):
        for _ in range(3):
            make_plan("go_to_goal", scenario, episodes=2)
    said = [record.getMessage().partition(",")[0] for record in caplog.records]
    assert said == [f"{name}: every seed has the same world" for name in ("crossing_robots", "u_trap")]


def test_where_nothing_is_drawn_one_episode_is_enough(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bug_gym.log.told", set())
    make_plan("go_to_goal", "oni_wang", episodes=2)
    assert "and nothing is drawn" in caplog.text
    caplog.clear()
    make_plan("go_to_goal", "oni_wang", episodes=2, overrides={"lidar.noise": 0.01})
    assert "episodes differ by noise alone" in caplog.text


def test_what_a_suite_drives_in_once_is_driven_in_once() -> None:
    plan = make_plan("bug2", "traps", episodes=6)
    assert {one.label: len(one.seeds) for one in plan.scenarios} == {
        **dict.fromkeys(("u_trap", "hook", "maze", "rooms"), 6),
        **dict.fromkeys(("oni_wang", "ring"), 1),
    }
