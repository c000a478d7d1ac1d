"""Two results folders side by side: what an edit has won and lost, in worlds that are the same."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest

from bug_gym.cli import main
from bug_gym.evaluation import compare_folders, evaluate, read_rows
from bug_gym.evaluation.results_folder import MANIFEST, ROWS
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import OVERALL
from bug_gym.evaluation.two_folders import Change, change_table, changes

BOX = [[[2, -1.5], [3, -1.5], [3, 1.5], [2, 1.5]]]
GROUND: dict[str, Any] = {
    "family": "explicit",
    "bounds": [-2, -4, 7, 4],
    "polygons": BOX,
    "start": [0, 0, 0],
    "goal": [5, 0],
}
WORLD: dict[str, Any] = {"name": "box", "world": GROUND}
PAIR = {"name": "two", "world": {"family": "empty"}, "robots": [{"start": [0, y, 0], "goal": [3, y]} for y in (0, 2)]}

MINE = """
from bug_gym.agents.floors.go_to_goal import GoToGoal


class Mine(GoToGoal):
    def act(self, view, memory):
        return {action}
"""


def row_of(
    seed: int, policy: str = "mine", scenario: str = "field", *, success: bool = True, **other: Any
) -> EpisodeRow:
    """What an episode could have been, of a robot alone."""
    numbers = (10.0, 100, 15.5, 0.5, 8.0, 0.5 * success, nan, 0.4, 3, 1.5, 1e-3, 2e-3, 0.1)
    outcome = "success" if success else "collision"
    return replace(EpisodeRow(policy, scenario, seed, 0, outcome, "", success, *numbers), **other)


def field_of(change: Change, field: str) -> float:
    return next(one.mean for one in change.differences if one.field == field)


def test_what_is_lost_and_won_is_told_by_its_seed() -> None:
    before = [row_of(seed, success=seed != 4) for seed in range(10)]
    after = [row_of(seed, success=seed not in (2, 7), time=9.0) for seed in range(12)]
    (change,) = changes(before, after)
    assert (change.n, change.before, change.after) == (10, 9, 8)
    assert (change.lost, change.won) == ((("field", 2), ("field", 7)), (("field", 4),))
    assert field_of(change, "success") == pytest.approx(-0.1)
    # Time is compared where both arrived.
    assert field_of(change, "time") == pytest.approx(-1.0)
    assert change.same == 0
    assert next(one for one in change.differences if one.field == "success").p_value == 1.0  # of 3 that differ, 2 to 1


def test_the_table_of_changes_has_each_measure_that_something_was_measured_of() -> None:
    before = [row_of(seed, success=seed != 1, time=10.0 + seed) for seed in range(4)]
    after = [row_of(seed, success=seed > 0, time=9.0 + seed) for seed in range(4)]
    table = change_table(changes(before, after))
    (line,) = table.lines
    told = {name: cell.split(" [")[0] for name, cell in zip(table.header, line, strict=True)}
    counted = {"policy": "mine", "scenario": "field", "worlds": "4", "the same": "0", "lost": "1", "won": "1"}
    shares = {"before [%]": "75", "after [%]": "75", "success [%]": "+0.0", "p": "1"}
    assert told == {**counted, **shares, "SPL": "+0.00", "time [s]": "-1.0"}  # no earliest arrival is known
    assert "(2)" in line[table.header.index("time [s]")]  # worlds in which both arrived


def test_the_other_way_round_all_is_the_other_way_round() -> None:
    before = [row_of(seed, success=seed % 3 > 0, time=10.0 + seed) for seed in range(30)]
    after = [row_of(seed, success=seed % 5 > 0, time=9.0 + 0.5 * seed) for seed in range(20)]
    (there,), (back,) = changes(before, after), changes(after, before)
    assert (there.lost, there.won, there.n, there.same) == (back.won, back.lost, back.n, back.same)
    for one, other in zip(there.differences, back.differences, strict=True):
        same = (one.mean == pytest.approx(-other.mean)) or (math.isnan(one.mean) and math.isnan(other.mean))
        assert same and one.n == other.n
        assert one.p_value == other.p_value or math.isnan(one.p_value)


def test_over_all_scenarios_there_is_what_there_is_in_each() -> None:
    rows = [row_of(seed, scenario=scenario) for scenario in ("field", "maze") for seed in range(4)]
    worse = [replace(row, outcome="timeout", success=False, spl=0.0) if row.seed == 1 else row for row in rows]
    field, maze, whole = changes(rows, worse)
    assert (field.scenario, maze.scenario, whole.scenario) == ("field", "maze", OVERALL)
    assert whole.n == field.n + maze.n and whole.same == field.same + maze.same == 6
    assert whole.lost == (*field.lost, *maze.lost) == (("field", 1), ("maze", 1))


def test_times_of_decisions_are_no_difference() -> None:
    rows = [row_of(seed) for seed in range(3)]
    (change,) = changes(rows, [replace(row, decision_time_mean=5e-3, decision_time_total=0.5) for row in rows])
    assert change.same == change.n == 3
    (change,) = changes(rows, [replace(row, min_clearance=0.39) for row in rows])
    assert change.same == 0


def own_policy(folder: Path, action: str) -> str:
    """A policy in a file, in another folder each time: one that was imported is not imported anew."""
    folder.mkdir()
    file = folder / "mine.py"
    file.write_text(MINE.format(action=action))
    return f"{file}:Mine"


def test_a_policy_of_ones_own_before_and_after_an_edit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, action in (("before", "super().act(view, memory)"), ("after", "0.0, 0.0")):
        policies: list[Any] = [("mine", own_policy(tmp_path / f"code {name}", action), {}), "bug2"]
        evaluate(policies, "empty", episodes=3, out=tmp_path / name, overrides={"robot.kinematics": "differential"})
    there = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    assert main(["compare", str(tmp_path / "before"), str(tmp_path / "after"), "--out", str(tmp_path / "x.json")]) == 0
    assert there == {path: path.stat().st_mtime_ns for path in there if path != tmp_path}, "it only reads"
    lines = capsys.readouterr().out.splitlines()
    told = {line.split()[0]: line.split() for line in lines if line.startswith((" mine", " bug2"))}
    arrived = read_rows(tmp_path / "before")
    mine = [row for row in arrived if row.policy == "mine" and row.success]
    assert told["bug2"][2:4] == ["3", "3"], "worlds, and those that are the same"
    assert told["mine"][2] == "3" and told["mine"][6:8] == [str(len(mine)), "0"]
    assert any(line.startswith("policies.mine.code was") for line in lines)
    data = json.loads((tmp_path / "x.json").read_text(), parse_constant=lambda constant: pytest.fail(constant))
    assert [change["policy"] for change in data["changes"]] == ["mine", "bug2"]


def test_worlds_that_are_others_are_not_compared(tmp_path: Path) -> None:
    evaluate("bug2", [WORLD, PAIR], episodes=1, out=tmp_path / "before")
    moved = {**WORLD, "world": {**GROUND, "goal": [5, 1]}}
    evaluate("bug2", [moved, PAIR], episodes=1, out=tmp_path / "after")
    comparison = compare_folders(tmp_path / "before", tmp_path / "after")
    assert [change.scenario for change in comparison.changes] == ["two"]
    assert any(
        note.startswith("not compared: scenario box, which is another one: scenario.world.goal was")
        for note in comparison.notes
    )
    evaluate("bug2", moved, episodes=1, out=tmp_path / "moved")
    with pytest.raises(ValueError, match="nothing in common: .*scenario box"):
        compare_folders(tmp_path / "before", tmp_path / "moved")


def test_a_scenario_whose_defaults_have_changed_is_another_one(tmp_path: Path) -> None:
    for name in ("before", "after"):
        evaluate("bug2", WORLD, episodes=1, out=tmp_path / name)
    file = tmp_path / "after" / MANIFEST
    manifest = json.loads(file.read_text())
    manifest["scenarios"]["box"]["digest"] = "0" * 16
    file.write_text(json.dumps(manifest))
    with pytest.raises(
        ValueError, match="box, which is another one: what it leaves to its defaults has changed, digest"
    ):
        compare_folders(tmp_path / "before", tmp_path / "after")


def test_worlds_of_another_code_are_told_by_their_shortest_paths(tmp_path: Path) -> None:
    evaluate("bug2", WORLD, episodes=1, out=tmp_path / "before")
    evaluate("bug2", WORLD, episodes=1, out=tmp_path / "after")
    (row,) = read_rows(tmp_path / "after")
    longer = replace(row, shortest_path_length=1.01 * row.shortest_path_length, spl=row.spl)
    (tmp_path / "after" / ROWS).write_text(json.dumps(longer.as_dict()) + "\n")
    with pytest.raises(ValueError, match=r"the shortest path of seed 0 was .* m, is now"):
        compare_folders(tmp_path / "before", tmp_path / "after")


def test_of_a_run_that_was_cut_off_whole_worlds_count(tmp_path: Path) -> None:
    evaluate("bug2", PAIR, episodes=3, out=tmp_path / "out")
    file = tmp_path / "out" / ROWS
    whole = file.read_bytes()
    lines = whole.splitlines(keepends=True)
    assert len(read_rows(tmp_path / "out")) == 6
    file.write_bytes(b"".join(lines[:5]) + lines[5][:20])
    assert len(read_rows(tmp_path / "out")) == 4, "of the last world one robot is missing"
    file.write_bytes(lines[0])
    assert read_rows(tmp_path / "out") == [], "of the only one"
    file.write_bytes(b"".join([*lines[:3], b"{}\n", *lines[3:]]))
    with pytest.raises(ValueError, match=rf"{ROWS}: line 4: a row needs the keys"):
        read_rows(tmp_path / "out")
    file.write_bytes(whole)
    (tmp_path / "out" / MANIFEST).write_text("{}")
    with pytest.raises(ValueError, match=rf"{MANIFEST} is damaged"):
        read_rows(tmp_path / "out")


def test_worlds_that_one_folder_lacks_are_told(tmp_path: Path) -> None:
    two: list[Any] = ["bug2", "go_to_goal"]
    evaluate(two, [WORLD, PAIR], episodes=4, out=tmp_path / "whole")
    evaluate(two, [WORLD, PAIR], episodes=4, out=tmp_path / "cut")
    file = tmp_path / "cut" / ROWS
    lines = file.read_text().splitlines(keepends=True)

    def left(policy: str, scenario: str, worlds: int) -> None:
        rows = [EpisodeRow.from_dict(json.loads(line)) for line in lines]
        gone = [row.policy == policy and row.scenario == scenario and row.seed >= worlds for row in rows]
        file.write_text("".join(line for line, is_gone in zip(lines, gone, strict=True) if not is_gone))

    left("bug2", "two", 1)
    for old, new in (("whole", "cut"), ("cut", "whole")):
        found, notes = compare_folders(tmp_path / old, tmp_path / new)
        assert notes == [f"not compared: 3 worlds of bug2 in two, in {tmp_path / 'whole'} alone"]
        assert [change.n for change in found if change.scenario == "two"] == [1, 4]
    left("bug2", "two", 0)
    found, notes = compare_folders(tmp_path / "whole", tmp_path / "cut")
    assert notes == [f"not compared: 4 worlds of bug2 in two, in {tmp_path / 'whole'} alone"]
    assert [(change.policy, change.scenario) for change in found][0] == ("bug2", "box")
    # As many of several policies are one line.
    file.write_text("".join(line for line in lines if json.loads(line)["seed"] < 3))
    _, notes = compare_folders(tmp_path / "whole", tmp_path / "cut")
    told = [f"1 world of bug2, go_to_goal in {scenario}, in {tmp_path / 'whole'} alone" for scenario in ("box", "two")]
    assert notes == [f"not compared: {one}" for one in told]


def test_a_row_that_stands_twice_is_told_by_its_line(tmp_path: Path) -> None:
    evaluate("bug2", WORLD, episodes=3, out=tmp_path / "out")
    file = tmp_path / "out" / ROWS
    lines = file.read_bytes().splitlines(keepends=True)
    file.write_bytes(b"".join([*lines, lines[1]]))
    # Its world would have two robots, and all others, which have one, would be taken for cut short.
    with pytest.raises(ValueError, match=rf"{ROWS}: line 4: robot 0 of that world stands in line 2, too"):
        read_rows(tmp_path / "out")


def test_a_folder_at_home_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    evaluate("bug2", WORLD, episodes=1, out="~/out")
    assert len(read_rows("~/out")) == 1
    assert compare_folders("~/out", "~/out").changes[0].same == 1


def test_a_comparison_is_not_written_into_what_it_compares(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("before", "after"):
        evaluate("bug2", WORLD, episodes=1, out=tmp_path / name)
    (tmp_path / "link").symlink_to(tmp_path / "before")
    folders = [str(tmp_path / name) for name in ("before", "after")]
    there = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    for out in (f"before/{MANIFEST}", f"after/{ROWS}", f"link/{MANIFEST}", "after/compared.json"):
        assert main(["compare", *folders, "--out", str(tmp_path / out)]) == 2
        assert "expected a file outside of both" in capsys.readouterr().err
    assert there == {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert main(["compare", *folders, "--out", str(tmp_path / "before.json")]) == 0


def test_what_is_no_results_folder_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").mkdir()
    for name in ("nowhere", "empty"):
        assert main(["compare", str(tmp_path / name), str(tmp_path / name)]) == 2
        assert f"{name} is no results folder: expected {MANIFEST} in it" in capsys.readouterr().err


def test_a_goal_that_no_way_leads_to_is_one_in_both(tmp_path: Path) -> None:
    rows = [row_of(seed, success=False, shortest_path_length=inf, spl=nan) for seed in range(2)]
    (change,) = changes(rows, rows)
    assert change.same == 2 and math.isnan(field_of(change, "spl"))
