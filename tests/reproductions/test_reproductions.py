"""The reproductions behind `bug-gym reproduce`: each runs, and its claims hold, on its first seeds."""

from __future__ import annotations

import argparse
import errno
import io
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib import import_module
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from episodes import run_episode

from bug_gym import benchmark
from bug_gym.agents import make_policy
from bug_gym.cli import main, make_parser
from bug_gym.commands import reproduce
from bug_gym.config import load
from bug_gym.evaluation.curves import draw_curves
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.reproductions import (
    REPRODUCTIONS,
    apf_wall_following,
    barn,
    bug_no_way,
    navigator,
    operative_critical_points,
    reproduction,
    require_use,
)
from bug_gym.reproductions.claims import paired
from bug_gym.reproductions.result import Curves, Reproduction, Settings, Table
from bug_gym.scenarios import draw_layout
from bug_gym.shortest_path import free_space
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors


@pytest.mark.parametrize("name", REPRODUCTIONS)
def test_settings_that_a_reproduction_does_not_read_are_refused(name: str) -> None:
    given: dict[str, Any] = {"seeds": 1, "policies": ("bug2",), "data": Path()}
    written = Path(import_module(f"bug_gym.reproductions.{REPRODUCTIONS[name]}").__file__ or "").read_text("utf-8")
    for setting, value in given.items():
        settings = replace(Settings(), **{setting: value})
        if f"settings.{setting}" in written:
            require_use(name, settings)
        else:
            with pytest.raises(ValueError, match=f"{name} takes no --{setting} "):
                require_use(name, settings)
    require_use(name, Settings())


def test_all_72_cells_of_oni_and_wangs_table_come_out_as_they_should(tmp_path: Path) -> None:
    out = tmp_path / "table.json"
    assert main(["reproduce", "oni-wang-table-1", "--out", str(out)]) == 0
    record = json.loads(out.read_text(encoding="utf-8"))
    assert record["name"] == "oni-wang-table-1" and len(record["commit"]) in (7, 40) and record["holds"]
    cells = record["cells"]
    assert sum(len(routes) for routes in cells.values()) == 72
    for policy, routes in cells.items():
        for route, cell in routes.items():
            # Reached or not as printed, and within 1.5 % or three steps of 0.1 m of the ideal rounded length.
            assert (cell["length"] is None) == (cell["printed"] is None), (policy, route, cell)
            if cell["length"] is not None:
                allowed = max(0.015 * cell["rounded"], 0.3)
                assert abs(cell["length"] - cell["rounded"]) <= allowed, (policy, route, cell)
    page = out.with_suffix(".html").read_text(encoding="utf-8")
    assert "oni-wang-table-1" in page and all(policy in page for policy in cells)
    buttons = set(re.findall(r'data-replay="(\d+)"', page))  # what failed can be looked at
    assert buttons and buttons <= set(re.findall(r'id="replay-(\d+)"', page))


@pytest.mark.parametrize(
    ("holds", "strict", "code"), [(True, True, 0), (False, True, 3), (None, True, 0), (False, False, 0)]
)
def test_a_false_claim_is_a_result_but_for_who_asks(
    holds: bool | None, strict: bool, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = Reproduction("made up", [], holds=holds)
    monkeypatch.setattr("bug_gym.commands.reproduce.reproduction", lambda name: lambda settings: found)
    out = tmp_path / "found.json"
    assert main(["reproduce", "oni-wang-table-1", "--out", str(out), *(["--strict"] if strict else [])]) == code
    assert json.loads(out.read_text(encoding="utf-8"))["holds"] is holds  # which is written in any case


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
@pytest.mark.parametrize("place", ["stdout", "file"])
def test_no_error_ends_as_a_false_claim_does(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Who asks by `--strict` takes the one for the other else."""
    found = Reproduction("made up", [], holds=False)
    monkeypatch.setattr("bug_gym.commands.reproduce.reproduction", lambda name: lambda settings: found)
    out = tmp_path / "found.json"
    told = main(["reproduce", "oni-wang-table-1", "--out", str(out), "--strict"])
    if place == "stdout":
        with Path("/dev/full").open("w", encoding="utf-8") as full:
            monkeypatch.setattr("sys.stdout", full)
            code = main(["reproduce", "oni-wang-table-1", "--strict"])
    else:
        out.unlink()
        out.mkdir()
        code = main(["reproduce", "oni-wang-table-1", "--out", str(out), "--strict"])
    assert code not in (0, told)
    assert capsys.readouterr().err.splitlines()[-1].startswith("bug-gym: error: ")


class Unwritable(io.StringIO):
    """A stdout that takes nothing."""

    def write(self, text: str) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")


def test_the_files_are_written_where_tables_cannot_be_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = Reproduction("made up", [Table("a table", ["a"], [["1"]])], holds=True)
    monkeypatch.setattr("bug_gym.commands.reproduce.reproduction", lambda name: lambda settings: found)
    monkeypatch.setattr("sys.stdout", Unwritable())
    with pytest.raises(OSError, match="No space left"):
        reproduce.run(options_of(tmp_path / "found.json"))
    assert json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))["holds"]
    assert "a table" in (tmp_path / "found.html").read_text(encoding="utf-8")


def test_tables_are_printed_where_a_file_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: Any) -> None:
        raise ImportError("no matplotlib")

    curves = Curves("c", "x", "y", [0.0], {"a": [(0.0, 0.0, 0.0)]})
    found = Reproduction("made up", [], holds=True, curves=[curves])
    monkeypatch.setattr("bug_gym.commands.reproduce.reproduction", lambda name: lambda settings: found)
    monkeypatch.setattr("bug_gym.evaluation.curves.draw_curves", fail)
    out = tmp_path / "found.json"
    with pytest.raises(ImportError, match="no matplotlib"):
        reproduce.run(options_of(out))
    told = capsys.readouterr().out
    assert "every claim holds" in told and f"numbers: {out}" in told and f"report: {out.with_suffix('.html')}" in told


def options_of(out: Path) -> argparse.Namespace:
    """What the command line makes of a name and a file."""
    return make_parser().parse_args(["reproduce", "oni-wang-table-1", "--out", str(out)])


def test_the_benchmark_writes_its_file_where_its_table_cannot_be_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("speed_tasks", "part_tasks", "start_tasks", "plan_tasks", "decision_tasks"):
        monkeypatch.setattr(benchmark, name, lambda *_: [])
    monkeypatch.setattr(benchmark, "speed_tasks", lambda *_: [benchmark.Task("one", "s", lambda: 1.0)])
    monkeypatch.setattr("sys.stdout", Unwritable())
    out = tmp_path / "speeds.json"
    with pytest.raises(OSError, match="No space left"):
        benchmark.run_benchmark(repeats=1, out=out)
    (line,) = json.loads(out.read_text(encoding="utf-8"))["measurements"]
    assert line["name"] == "one" and line["median"] == 1.0


def test_a_benchmark_that_is_interrupted_keeps_what_it_has_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted() -> float:
        raise KeyboardInterrupt

    for name in ("part_tasks", "start_tasks", "plan_tasks", "decision_tasks"):
        monkeypatch.setattr(benchmark, name, lambda *_: [])
    tasks = [benchmark.Task("one", "s", lambda: 1.0), benchmark.Task("two", "s", interrupted)]
    monkeypatch.setattr(benchmark, "speed_tasks", lambda *_: tasks)
    out = tmp_path / "speeds.json"
    for kept in (out, tmp_path / "speeds-incomplete.json"):
        before = out.read_bytes() if out.exists() else None
        assert main(["benchmark", "--repeats", "1", "--out", str(out)]) == 130
        assert f"interrupted; {kept} keeps 1 of 2 measurements" in " ".join(capsys.readouterr().err.split())
        data = json.loads(kept.read_text(encoding="utf-8"))
        assert [line["name"] for line in data["measurements"]] == ["one"] and data["missing"] == ["two"]
        assert before is None or out.read_bytes() == before, "what was there stays"
    tasks[:] = [benchmark.Task("two", "s", interrupted)]
    assert main(["benchmark", "--repeats", "1", "--out", str(tmp_path / "none.json")]) == 130
    assert "keeps" not in capsys.readouterr().err and not (tmp_path / "none.json").exists()


def test_an_unknown_reproduction_is_refused_with_the_nearest_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", "oni-wang"]) == 2
    assert "did you mean 'oni-wang-table-1'" in capsys.readouterr().err


@pytest.mark.parametrize("name", REPRODUCTIONS)
def test_each_reproduction_can_be_found(name: str) -> None:
    assert callable(reproduction(name))


def test_the_bounds_and_guarantees_of_the_bugs_hold_on_their_first_seeds() -> None:
    result = reproduction("bug-bounds")(Settings(seeds=12, workers=2))
    assert result.data["faults"] == []
    assert result.holds


def test_the_critical_points_of_the_paper_hold_in_its_scenes_and_in_the_first_still_worlds() -> None:
    policies = ("operative_critical_point_bug",)
    result = reproduction("operative-critical-points")(Settings(seeds=4, policies=policies))
    assert result.holds
    assert {one["label"] for one in result.data["scenes"]} >= {"five obstacles (5, 7)", "crossing (9)"}
    assert {one["label"] for one in result.data["scenes"]} >= {"opposite (10)", "course (12)"}
    assert result.data["repairs"]["sub_goal=printed"]["collisions"] > 0


def test_one_scan_shows_both_ends_of_each_of_the_five_obstacles() -> None:
    five = operative_critical_points.FIVE
    world = {**operative_critical_points.SENSORS, "world": operative_critical_points.SCENES["five obstacles (5, 7)"]}
    simulation = Simulation(world, 1)
    policy, state = make_policy("operative_critical_point_bug", simulation, clearance=0.4), None
    observation = simulation.reset(seeds=[0])[0]
    for _ in range(2):  # an open point is one where two looks show it
        _, state = policy.predict(observation, state)
    assert state is not None
    ends = [shapely.Point(place) for place in state[0].open_points]
    assert [sum(shapely.Polygon(ring).distance(end) < 0.1 for end in ends) for ring in five] == [2] * 5


def test_complete_bugs_say_unreachable_exactly_where_the_configuration_space_has_no_way() -> None:
    result = reproduction("bug-no-way")(Settings(seeds=12, workers=2, policies=bug_no_way.PROVEN))
    assert result.data["wrong"] == []
    for policy, counts in result.data["policies"].items():
        assert counts["reached"] == counts["with a way"] == 6, policy
        assert counts["unreachable"] == counts["without"] == 6, policy


def test_where_no_world_is_shut_nothing_was_shown() -> None:
    result = reproduction("bug-no-way")(Settings(seeds=1, policies=("bug2",)))
    assert result.data["policies"]["bug2"]["without"] == 0
    assert result.holds is None and "not tried" in result.notes[-1]
    assert not bug_no_way.held([bug_no_way.Answer("bug2", "field", 0, True, "gave_up", "unreachable")])


def test_incomplete_bugs_end_by_themselves_and_call_no_open_goal_unreachable() -> None:
    result = reproduction("bug-no-way")(Settings(seeds=6, workers=2, policies=bug_no_way.INCOMPLETE))
    assert result.data["wrong"] == []


def test_before_a_ring_incomplete_bugs_end_with_a_verdict_at_every_noise() -> None:
    policies = ("point_bug", "operative_critical_point_bug")
    result = reproduction("ring-verdicts")(Settings(seeds=1, policies=policies))
    assert result.holds and set(result.data["results"]["point_bug, holonomic"]) == {"0", "0.01", "0.02", "0.03"}
    assert all(one["collisions"] == 0 for noises in result.data["results"].values() for one in noises.values())


@pytest.mark.parametrize("seed", range(12))
def test_a_drawn_world_has_a_way_exactly_where_its_answer_says_so(seed: int) -> None:
    """The same question, put to the free space in which shortest paths are searched, for a body between the two."""
    one = bug_no_way.problem(seed)
    layout = draw_layout(one.scenario, seed, 0)
    space = free_space(layout.circles, layout.polygons, layout.border, radius=0.25)
    start, goal = shapely.Point(layout.starts[0, :2]), shapely.Point(layout.goals[0])
    room = next(part for part in shapely.get_parts(space) if part.intersects(start))
    assert one.has_way == (room.distance(goal) <= 0.3)


def test_barn_is_passed_on_its_first_worlds(shared_data: Path) -> None:
    settings = Settings(seeds=4, workers=2, data=shared_data / "barn_worlds.jsonl", policies=("bug2", "com1"))
    results = reproduction("barn")(settings).data["results"]
    for name in ("holonomic bug2", "holonomic com1"):
        assert results[name]["success"] == 1.0 and results[name]["collisions"] == 0
    # At most 0.5 and 0.25 by definition; the old score is the lesser one, and nobody here takes as much as 4 OT less.
    for one in results.values():
        assert 0.0 < one["score_2022"] <= 0.25 and one["score_2022"] <= one["score_2024"] <= 0.5


BLANK = EpisodeRow("a", "s", 0, 0, "success", "", True, 1.0, 10, 1.0, 0.1, 8.0, nan, nan, 0.5, 0, 0.0, 0.0, 0.0, 0.0)


# A reference path of 10 m: OT is 5 s.
@pytest.mark.parametrize(
    ("time", "new", "old"),
    [
        (5.0, 0.5, 0.25),
        (10.0, 0.5, 0.25),
        (12.5, 0.4, 0.25),
        (20.0, 0.25, 0.25),
        (25.0, 0.2, 0.2),
        (40.0, 0.125, 0.125),
        (100.0, 0.125, 0.125),
        (100.1, 0.0, 0.0),
    ],
)
def test_barns_scores_are_those_of_their_formulas(time: float, new: float, old: float) -> None:
    run = replace(BLANK, time=time)
    assert barn.score(run, 10.0) == barn.score(run, 10.0, "score_2024") == pytest.approx(new)
    assert barn.score(run, 10.0, "score_2022") == pytest.approx(old)


def test_barns_score_is_nothing_for_a_failure_and_takes_the_shortest_path_for_want_of_a_reference() -> None:
    assert barn.score(replace(BLANK, outcome="collision", success=False, time=5.0), 10.0) == 0.0
    run = replace(BLANK, time=16.0)
    assert barn.score(run, None) == pytest.approx(4.0 / 16.0) and barn.score(run, 10.0) == pytest.approx(5.0 / 16.0)


def test_barns_table_takes_the_reference_paths_of_its_file_and_says_where_there_are_none() -> None:
    rows = [replace(BLANK, scenario=name, time=20.0) for name in ("world 1", "world 2")]
    found = barn.summed_up(rows, {"world 1": 12.0, "world 2": None})
    assert found["score_2024"] == pytest.approx((6.0 / 20.0 + 4.0 / 20.0) / 2.0)
    assert any("OT of 1 worlds" in note for note in barn.notes({"world 1": 12.0, "world 2": None}))
    assert not any("OT of" in note for note in barn.notes({"world 1": 12.0}))


# What once defeated them: a gap that counted as one or not by the side from which it was come to; a robot that braked
# before what its eyes called open.
DEFEATED = [("bug2", "holonomic", 117, 0.3), ("alg1", "jackal", 117, 0.33), ("vis_bug_21", "jackal", 171, 0.299)]


@pytest.mark.parametrize(("policy", "robot", "world", "clearance"), DEFEATED)
def test_worlds_of_barn_that_defeated_a_bug_are_passed(
    policy: str, robot: str, world: int, clearance: float, shared_data: Path
) -> None:
    places = {"family": "barn", "path": str(shared_data / "barn_worlds.jsonl"), "world": world}
    overrides = {**barn.COMMON, "time.step": barn.STEPS[robot], "time.limit": 200.0}
    episode = run_episode(policy, {"robot": barn.ROBOTS[robot], "world": places}, overrides, clearance=clearance)
    assert episode.outcome == "success"


def test_who_came_back_through_a_gap_that_is_none_from_within_does_not_call_itself_shut_in(shared_data: Path) -> None:
    # It had been 5 m beyond the room whose wall it then followed round.
    places = {"family": "barn", "path": str(shared_data / "barn_worlds.jsonl"), "world": 273}
    described = {"robot": barn.ROBOTS["jackal"], "world": places}
    overrides = {**barn.COMMON, "time.step": barn.STEPS["jackal"]}
    episode = run_episode("apf_wall_following", described, overrides, **barn.PARAMETERS["jackal"])
    assert episode.verdict != "unreachable" and episode.outcome != "collision"


def test_the_faithful_robot_of_barn_holds_the_rectangle_and_hardly_more() -> None:
    circles = load("jackal").robot.footprint
    body = shapely.union_all([shapely.Point(x, y).buffer(radius) for x, y, radius in circles])
    rectangle = shapely.box(-0.229, -0.208, 0.229, 0.208)
    # A circle's buffer is a polygon within it, by less than 0.5 mm here.
    assert body.buffer(5e-4).covers(rectangle.exterior)
    assert rectangle.buffer(0.026).covers(body)
    # The wheels reach so far: nothing of them is left out.
    assert rectangle.covers(shapely.box(-0.229, -0.2078, 0.229, 0.2078))


def test_the_faithful_robot_of_barn_has_the_benchmarks_limits_and_scanner() -> None:
    described = barn.scenario("faithful", "worlds.jsonl", 0)
    robot = load({**described["scenario"], "world": {"family": "empty"}}, described["overrides"])
    assert (robot.robot.max_speed, robot.robot.max_reverse, robot.robot.max_turn_rate) == (2.0, 2.0, 4.0)
    assert robot.robot.max_acceleration == 20.0 and robot.robot.kinematics == "differential"
    angles = Sensors.of(robot).angles
    assert len(angles) == 720 and not robot.lidar.is_full_circle
    assert angles[0] == pytest.approx(-2.35619) and angles[-1] == pytest.approx(2.35619)
    assert (robot.lidar.min_range, robot.lidar.range, robot.lidar.noise) == (0.1, 30.0, 0.001)
    assert (robot.robot.latency, robot.time.step, robot.latency_steps) == (0.1, 0.05, 2)
    assert (robot.goal.radius, robot.time.limit) == (1.0, 100.0)


def test_the_faithful_robot_of_barn_cannot_stop_at_once() -> None:
    """20 m/s^2 for a step of 0.05 s: 1 m/s, so half of the way from standing to the top speed; 0.1 s later."""
    described = barn.scenario("faithful", "worlds.jsonl", 0)
    world = {"family": "empty", "start": [-8.0, 0.0, 0.0], "goal": [8.0, 0.0]}
    simulation = Simulation(load({**described["scenario"], "world": world}, described["overrides"]))
    simulation.reset(seeds=[0])
    speeds = []
    for ahead in (1.0, 1.0, -1.0, 0.0, 0.0):
        simulation.step(np.array([[[ahead, 0.0]]], dtype=np.float32))
        speeds.append(float(simulation.world.array("velocity")[0, 0]))
    assert speeds == pytest.approx([0.0, 0.0, 1.0, 2.0, 1.0])


def test_barn_is_driven_by_every_policy_of_the_table_that_can_and_tells_who_cannot(tmp_path: Path) -> None:
    cylinder = {"world": 7, "start": [-2.0, 3.0, 1.57], "goal": [-2.0, 13.0], "cylinder_radius": 0.075}
    path = tmp_path / "worlds.jsonl"
    path.write_text(json.dumps({**cylinder, "cylinders": [[-3.5, 8.0]]}) + "\n", encoding="utf-8")
    everybody = set(barn.every_policy())
    assert {"bug2", "hd_bug", "hd_bug_map", "navigator", "dwa", "a_star", "ppo_mixed"} <= everybody
    assert not {"com", "ocpb"} & everybody  # second names of others
    asked = ("go_to_goal", "a_star", "ppo_mixed")
    result = reproduction("barn")(Settings(data=path, policies=asked))
    assert set(result.data["results"]) == {
        f"{robot} {policy}"
        for robot in ("holonomic", "jackal", "faithful")
        for policy in ("go_to_goal", "a_star (privileged)")
    }
    for robot, refused in result.data["refused"].items():
        assert list(refused) == ["ppo_mixed"], robot
    assert sum("left out ppo_mixed" in note for note in result.notes) == 3
    assert json.loads(result.as_json("0" * 40))["results"]["faithful a_star (privileged)"]["success"] == 1.0


def test_barn_without_its_worlds_says_what_is_missing() -> None:
    with pytest.raises(ValueError, match="--data"):
        reproduction("barn")(Settings())


@pytest.mark.parametrize("name", ["lidar-density", "odometry-drift"])
def test_a_sweep_gives_success_with_an_interval_for_each_value(name: str, tmp_path: Path) -> None:
    result = reproduction(name)(Settings(seeds=1, policies=("go_to_goal", "bug0")))
    for sweep in result.data["sweeps"]:
        for series in sweep["policies"].values():
            assert len(series) == len(sweep["values"])
            for point in series:
                low, high = point["success_interval"]
                assert 0.0 <= low <= point["success"] <= high <= 1.0
    draw_curves(tmp_path / "curves.png", result.curves)
    assert (tmp_path / "curves.png").stat().st_size > 10_000


def test_potential_field_with_wall_following_arrives_in_its_scenes_and_on_the_map() -> None:
    for part in (apf_wall_following.still_scenes(), apf_wall_following.moving_scenes()):
        assert part.holds, part.data
    assert apf_wall_following.routes(["AC", "CB"]).holds


def test_potential_field_with_wall_following_in_the_first_traps_and_mazes() -> None:
    ours = {"apf_wall_following": apf_wall_following.METHODS["apf_wall_following"]}
    traps = apf_wall_following.compare("Traps", apf_wall_following.trap_rows, ours, 4, Settings())
    assert traps.holds and traps.data["Traps"]["apf_wall_following"]["success"] == 1.0
    assert apf_wall_following.compare("Mazes", apf_wall_following.maze_rows, ours, 2, Settings()).holds


def test_the_worlds_of_a_comparison_come_in_order_whichever_worker_is_first(monkeypatch: pytest.MonkeyPatch) -> None:
    def last_one_first(
        function: Callable[[Any], Any], jobs: Sequence[Any], workers: int, *, in_order: bool = False
    ) -> Any:
        return map(function, jobs if in_order else jobs[::-1])

    monkeypatch.setattr(apf_wall_following, "each", last_one_first)
    part = apf_wall_following.compare("Mazes", apf_wall_following.maze_rows, {"apf": ("apf", {})}, 6, Settings())
    missed = part.data["Mazes"]["apf"]["missed_seeds"]
    assert len(missed) > 1 and missed == sorted(missed)


def test_success_falls_with_the_density_of_the_scan() -> None:
    result = reproduction("lidar-density")(Settings(seeds=4, policies=("bug0",), workers=2))
    series = result.data["sweeps"][0]["policies"]["bug0"]
    # Eight beams are half a metre apart at the clearance's range and more: obstacles fit between them.
    assert series[0]["success"] < series[-1]["success"]


def test_robots_change_places_across_circles_without_a_contact_on_the_first_seeds() -> None:
    result = reproduction("circle-swap")(Settings(seeds=1, policies=("orca",)))
    assert result.holds
    assert {name: told["n"] for name, told in result.data["circles"].items()} == {
        f"{kinematics}, {robots}": robots for kinematics in ("holonomic", "differential") for robots in (2, 4, 8, 16)
    }
    assert all(told["success"] == 1.0 for told in result.data["crowds"].values())


def test_the_navigator_goes_the_planners_way_where_nothing_moves_and_arrives_in_the_first_worlds_of_each_kind() -> None:
    result = reproduction("navigator")(Settings(seeds=2, policies=("hd_bug_map",), workers=2))
    assert result.data["other_ways"] == {"static": 0, "rooms": 0, "u_trap": 0} and result.data["worse"] == []
    assert result.holds is None  # one of its parts was not asked
    assert all(one["success"] == 1.0 for told, one in result.data["results"].items() if told.endswith("navigator"))


@pytest.mark.parametrize(("lost", "is_worse"), [(8, False), (12, True)])
def test_the_navigator_is_worse_where_all_tests_together_say_so(lost: int, is_worse: bool) -> None:
    """Of 18 tests one alone is below 0.05 / 18 = 0.0028: 2 / 2^8 = 0.0078 isn't, 2 / 2^12 = 0.0005 is."""
    even = paired(ended(20, ()), ended(20, ()))
    gaps = {f"kind {k}": even for k in range(17)}
    assert navigator.found_worse(gaps | {"rush": paired(ended(20, range(lost)), ended(20, ()))}) == ["rush"] * is_worse
    assert navigator.found_worse(gaps | {"rush": paired(ended(20, ()), ended(20, range(lost)))}) == []


def test_another_way_is_told_by_its_length_time_or_end() -> None:
    mine, theirs = ended(5, (3,)), ended(5, ())
    assert navigator.other_way(theirs, theirs) == 0 and navigator.other_way(mine, theirs) == 1
    assert navigator.other_way([replace(theirs[0], path_length=9.0)], theirs) == 1
    assert navigator.other_way([replace(theirs[0], time=9.0)], theirs) == 1


def ended(worlds: int, lost: Sequence[int]) -> list[EpisodeRow]:
    """Runs of one policy in worlds of one kind, some of which end in a collision."""
    return [
        replace(BLANK, seed=seed, outcome="collision" if seed in lost else "success", success=seed not in lost)
        for seed in range(worlds)
    ]


def test_notes_are_printed_with_all_of_their_words(capsys: pytest.CaptureFixture[str]) -> None:
    note = "[b]ug.py:Mine: the interval is [low, high]"
    reproduce._print(Reproduction("one", [], [note], {}, None))
    assert capsys.readouterr().out == f"{note}\n"
