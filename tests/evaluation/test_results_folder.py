"""What lies in a results folder: what is refused when it is read back, what is mended, and who may write there."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import product
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bug_gym.agents.bugs.bug2 import Bug2
from bug_gym.agents.learning import folder as model_files
from bug_gym.agents.navigator.policy import Navigator
from bug_gym.cli import main
from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.evaluation import plan as plan_module
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.plan import Plan
from bug_gym.evaluation.results_folder import DROPPED, LENGTHS, MANIFEST, ROWS, opened
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.files import one_writer

OPEN = {"family": "empty", "start": [0, 0, 0], "goal": [8, 0]}
PAIR = [{"start": [-5, 0, 0], "goal": [5, 0]}, {"start": [-5, 3, 0], "goal": [3, 3]}]
TARGET = {"at": [8, 0], "motion": {"law": "bounce", "velocity": [0, 0]}}
SCENARIOS = {
    "open": load({"name": "open", "world": OPEN}),
    "pair": load({"name": "pair", "world": {"family": "empty"}, "robots": PAIR}),
    "target": load({"name": "target", "world": {"family": "empty", "start": [0, 0, 0], "target": TARGET}}),
}
PLAN = Plan(
    "",
    (PolicyEntry("bug0", "bug0"), PolicyEntry("bug2", "bug2")),
    tuple(ScenarioEntry(label, scenario, range(2, 5)) for label, scenario in SCENARIOS.items()),
    frozenset({("bug2", "target")}),
)
"""bug0 and bug2 in three worlds of one robot, and of two; bug0 alone after a moving target."""


def row_of(policy: str, scenario: str, seed: int, robot: int) -> EpisodeRow:
    """What an episode of 10 s could have been."""
    shortest = nan if scenario == "target" else 8.0 + robot
    ratio = 0.5 if scenario == "target" else nan
    share = shortest / 16.0
    numbers = (10.0, 100, 15.5, 0.5, shortest, share, ratio, inf, 3, 1.5, 1e-3, 2e-3, 0.1)
    return EpisodeRow(policy, scenario, seed, robot, "success", "", True, *numbers)


def worlds() -> list[list[EpisodeRow]]:
    """The rows of each world of the plan."""
    return [
        [row_of(policy.label, scenario.label, seed, robot) for robot in range(scenario.scenario.robots.count)]
        for scenario, policy in PLAN.pairs()
        for seed in scenario.seeds
    ]


ALL = [row for world in worlds() for row in world]


def fill(folder: Path) -> None:
    """Write a finished run of the plan."""
    with opened(folder, PLAN, repair=False) as results:
        for scenario, seed in product(PLAN.scenarios, range(2, 5)):
            if not scenario.has_moving_target:
                results.add_lengths((scenario.label, seed), [8.0, 9.0][: scenario.scenario.robots.count])
        for world in worlds():
            results.add_rows(world)


@cache
def finished() -> dict[str, bytes]:
    """The files of a finished run of the plan."""
    with tempfile.TemporaryDirectory() as place:
        fill(Path(place))
        return files_in(Path(place))


def put_finished(folder: Path) -> None:
    """Make a finished run's folder of what it holds."""
    for name, data in finished().items():
        (folder / name).write_bytes(data)


def read(folder: Path, *, repair: bool = False) -> list[EpisodeRow]:
    with opened(folder, PLAN, repair=repair) as results:
        return results.rows


def same(rows: list[EpisodeRow], others: list[EpisodeRow]) -> bool:
    """Whether rows are the same, as text: NaN is not equal to itself."""
    return list(map(str, rows)) == list(map(str, others))


def files_in(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def change_line(path: Path, number: int, change: Callable[[dict[str, Any]], object]) -> None:
    """Change what a line of a file says, the first being 1; what `change` returns is written, or the value changed."""
    lines = path.read_bytes().splitlines(keepends=True)
    value = json.loads(lines[number - 1])
    changed = change(value)
    lines[number - 1] = changed if isinstance(changed, bytes) else json.dumps(changed or value).encode() + b"\n"
    path.write_bytes(b"".join(lines))


def setter(**values: Any) -> Callable[[dict[str, Any]], object]:
    """What sets keys of a line."""
    return lambda record: {**record, **values}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The folder of a finished run."""
    fill(tmp_path / "out")
    return tmp_path / "out"


def test_what_was_written_is_read_again(folder: Path) -> None:
    before = files_in(folder)
    assert same(read(folder), ALL)
    assert files_in(folder) == before


# ---------------------------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (setter(policy="bug3"), "policy: got 'bug3', expected one of those in open, did you mean 'bug"),
        (setter(scenario="opne"), "scenario: got 'opne', expected one of open, pair, target, did you mean 'open'"),
        (setter(scenario="target", policy="bug2"), "policy: got 'bug2', expected one of those in target"),
        (setter(seed=1), "seed: got 1, expected one from 2 to 4"),
        (setter(seed=5), "seed: got 5"),
        (setter(seed="3"), "seed must be of type int"),
        (setter(seed=3.0), "seed must be of type int"),
        (setter(robot=1), "robot: got 1, expected a number below 1"),
        (setter(robot=-1), "robot must be >= 0"),
        (setter(outcome="won"), "outcome must be one of"),
        (setter(success=False), "contradicts outcome"),
        (setter(spl=0.9), r"spl: got 0\.9, expected 0\.5 by the row's lengths"),
        (setter(spl=None), "spl: got nan"),
        (
            setter(shortest_path_length=7.0, spl=7.0 / 16.0),
            r"shortest_path_length: got 7\.0, shortest_paths\.jsonl says 8",
        ),
        (setter(shortest_path_length=None, spl=None), "shortest_path_length: got nan"),
        (setter(time_ratio=0.5), "time_ratio: got 0.5, expected none"),
        (setter(time=10**400), "time must be finite"),
        (setter(time=-(10**400)), "time must be finite"),
        (setter(extra=1), r"unknown: \['extra'\]"),
        (lambda record: {key: value for key, value in record.items() if key != "turns"}, r"missing: \['turns'\]"),
        (lambda record: b"null\n", "a row must be a mapping, came None"),
        (lambda record: b"[]\n", "a row must be a mapping"),
        (lambda record: b"\n", "Expecting value"),
        (lambda record: b"\xff\n", "codec can't decode"),
        (lambda record: b"[" * 100_000 + b"\n", "nested too deep"),
        (lambda record: json.dumps(record).encode()[:-1] + b', "seed": 3}\n', "key 'seed' twice"),
        (lambda record: json.dumps(record).replace('"time": 10.0', '"time": NaN').encode() + b"\n", "got NaN"),
        (lambda record: json.dumps(row_of("bug0", "open", 2, 0).as_dict()).encode() + b"\n", "says again what line 1"),
    ],
)
def test_a_row_that_the_plan_cannot_have_is_refused_with_file_line_and_key(
    change: Callable[[dict[str, Any]], object], said: str, folder: Path
) -> None:
    change_line(folder / ROWS, 2, change)
    before = files_in(folder)
    with pytest.raises(ValueError, match=rf"rows\.jsonl: line 2: .*{said}") as caught:
        read(folder)
    assert "\n" not in str(caught.value)
    assert files_in(folder) == before


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (setter(lengths="12"), "lengths: got '12', expected a list"),
        (setter(lengths=[]), "lengths: got 0 of them, expected 1"),
        (setter(lengths=["8.0", "9.0"]), "lengths: got 2 of them, expected 1"),
        (setter(lengths=[8.0]), r"lengths\.0: got 8\.0, expected text"),
        (setter(lengths=["-1"]), r"lengths\.0: got '-1', expected a length as text"),
        (setter(lengths=["far"]), r"lengths\.0: got 'far'"),
        (setter(lengths=None), "lengths: got None, expected a list"),
        (setter(scenario="opne"), "scenario: got 'opne'.* did you mean 'open'"),
        (setter(scenario="target"), "scenario: got 'target', which has a moving target"),
        (setter(seed=7), "seed: got 7, expected one from 2 to 4"),
        (setter(seed=True), "seed: got True, expected a whole number"),
        (setter(length=1), "did you mean 'lengths'"),
        (setter(seed=2), "says again what line 1"),
        (setter(seed=2, lengths=["9.0"]), "contradicts what line 1"),
        (lambda record: b"null\n", "got None, expected a mapping"),
        (lambda record: b"3\n", "got 3, expected a mapping"),
    ],
)
def test_a_shortest_path_that_the_plan_cannot_have_is_refused_with_file_line_and_key(
    change: Callable[[dict[str, Any]], object], said: str, folder: Path
) -> None:
    change_line(folder / LENGTHS, 2, change)
    before = files_in(folder)
    with pytest.raises(ValueError, match=rf"shortest_paths\.jsonl: line 2: .*{said}") as caught:
        read(folder)
    assert "\n" not in str(caught.value)
    assert files_in(folder) == before


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("null", "is damaged: got None, expected a mapping"),
        ("[]", r"is damaged: got \[\], expected a mapping"),
        ("{}", "is damaged: suite: missing"),
        ("", "is damaged: Expecting value"),
        ('{"suite": 3, "scenarios": {}, "policies": {}, "versions": {}}', "suite: got 3, expected text"),
        ('{"suite": "", "scenarios": [], "policies": {}, "versions": {}}', "scenarios: got .*expected a mapping"),
        (
            '{"suite": "", "scenarios": {"a": 1}, "policies": {}, "versions": {}}',
            r"scenarios\.a: got 1, expected a map",
        ),
        ('{"suite": "", "scenarios": {}, "policies": {"a": {"name": 1}}, "versions": {}}', r"policies\.a"),
        ('{"suite": "", "scenarios": {}, "policies": {}, "versions": {}, "x": 1}', "unknown key.*x|x: unknown key"),
        (
            '{"suite": "", "scenarios": {}, "policies": {}, "versions": {}}',
            "holds another run: versions.bug_gym was missing",
        ),
    ],
)
def test_a_manifest_that_is_none_is_refused_with_its_key(text: str, said: str, folder: Path) -> None:
    (folder / MANIFEST).write_text(text)
    with pytest.raises(ValueError, match=said) as caught:
        read(folder)
    assert "\n" not in str(caught.value)
    assert (folder / MANIFEST).read_text() == text


@pytest.mark.parametrize("name", [MANIFEST, ROWS, LENGTHS, DROPPED])
def test_a_link_in_the_place_of_a_file_is_refused(name: str, folder: Path, tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes((folder / name).read_bytes() if name != DROPPED else b"mine")
    before = victim.read_bytes()
    (folder / name).unlink(missing_ok=True)
    (folder / name).symlink_to(victim)
    with pytest.raises(ValueError, match=f"{name} is a symbolic link"):
        read(folder)
    assert victim.read_bytes() == before


def test_what_another_source_of_the_package_has_made_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = files_in(folder)
    monkeypatch.setattr(plan_module, "source_digest", lambda: "another" * 10)
    told = r"out holds what another source of bug_gym has made, whose code has changed since \(versions\.bug_gym_source was "
    for repair in (False, True):
        with pytest.raises(
            ValueError, match=rf'{told}.*"anotheranotheran"\); name another folder, or remove'
        ) as caught:
            read(folder, repair=repair)
        assert "\n" not in str(caught.value)
    other = replace(PLAN, scenarios=(ScenarioEntry("open", SCENARIOS["open"], range(3, 5)), *PLAN.scenarios[1:]))
    with (
        pytest.raises(ValueError, match=r"holds another run: scenarios\.open\.seeds\.first was 2, is now 3"),
        opened(folder, other),
    ):
        pass
    assert files_in(folder) == before


# ---------------------------------------------------------------------------------------------- models by their place


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory; what is on the hub stands in its folder `model`."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(model_files, "fetched", lambda model, files: tmp_path / "model")
    return tmp_path


def put_models(policy: str, predictor: str) -> None:
    """Put shipped models into the working directory, in the place of others: two folders, and a file as a zip."""
    for name, there in ((policy, "model"), (predictor, "predictor")):
        shutil.rmtree(there, ignore_errors=True)
        shutil.copytree(model_files.TRAINED_FOLDER / name, there)
    shutil.copy(Path("model", "policy.onnx"), "model.zip")


BY_PLACE = {
    **{name: name for name in ("./model/", "./model", "model.zip", "./model.zip:trust=true", "hf://somebody/model")},
    "predictor": "hd_bug:predictor=./predictor/",
    "network": ("navigator", Navigator, {"model": "./model"}),
    "network on the hub": ("navigator", Navigator, {"model": "hf://somebody/model"}),
}
"""Policies of `put_models`."""


@pytest.mark.parametrize("policy", BY_PLACE.values(), ids=BY_PLACE)
def test_a_run_goes_on_with_the_model_that_lay_at_a_place_and_with_no_other(policy: Any, place: Path) -> None:
    plan = replace(PLAN, policies=(PolicyEntry.of(policy),), left_out=frozenset())
    put_models("ppo_static", "rl_predictor")
    for _ in range(2):
        with opened(place / "out", plan):
            put_models("ppo_static", "rl_predictor")
    before = files_in(place / "out")
    put_models("ppo_dynamic", "supervised_predictor")
    with (
        pytest.raises(ValueError, match=r"out holds another run: policies\..*\.code was "),
        opened(place / "out", plan),
    ):
        pass
    assert files_in(place / "out") == before


def test_an_evaluation_does_not_go_on_with_another_model_at_the_same_place(place: Path) -> None:
    pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra `play`")
    asked: Any = {"episodes": 1, "overrides": {"time.limit": 1.0}, "out": place / "out"}
    put_models("ppo_static", "rl_predictor")
    rows = evaluate("./model/", "static", **asked)
    before = (place / "out" / ROWS).read_bytes()
    assert same(evaluate("./model/", "static", **asked), rows)
    put_models("ppo_dynamic", "rl_predictor")
    with pytest.raises(ValueError, match=r"out holds another run: policies\.\./model/\.code was "):
        evaluate("./model/", "static", **asked)
    assert (place / "out" / ROWS).read_bytes() == before


@pytest.mark.parametrize("policy", ["ppo_static", "hd_bug:predictor=rl", "navigator", "bug2:turn=left"])
def test_a_model_that_is_named_by_name_belongs_to_the_package(policy: str, place: Path) -> None:
    for name in ("ppo_static", "rl", "navigator", "left"):
        shutil.copytree(model_files.TRAINED_FOLDER / "ppo_static", name)
    assert PolicyEntry.of(policy).code == ""


def test_a_place_where_nothing_lies_is_told_by_who_makes_the_policy_not_by_the_digest(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(model: str, files: object) -> Path:
        raise ValueError(f"{model} cannot be fetched: nobody answers")

    monkeypatch.setattr(model_files, "fetched", refused)
    Path("nothing").mkdir()
    told = {
        "./none/": "no trained policy in none",
        "./nothing/": "no trained policy in nothing",
        "none.zip": "no file none.zip",
        "hf://somebody/none": "hf://somebody/none cannot be fetched",
        "hd_bug:predictor=./none/": "no trained predictor in none",
        "hd_bug:predictor=hf://somebody/none": "no trained predictor in hf:/somebody/none",
    }
    for policy, message in told.items():
        assert PolicyEntry.of(policy).code == "", policy
        with pytest.raises(ValueError, match=message):
            evaluate(policy, "static", episodes=1, out="out")
    assert not Path("out").exists()
    assert PolicyEntry.of("hd_bug:predictor=~nobody_of_this_name/none").code == ""


def test_a_class_from_outside_is_told_by_its_file_and_by_the_models_that_its_parameters_name(place: Path) -> None:
    put_models("ppo_static", "rl_predictor")
    alone = PolicyEntry.of(("mine", Bug2, {})).code
    model, predictor = (PolicyEntry.of(name).code for name in ("./model", "./predictor"))
    own = PolicyEntry.of(("mine", Bug2, {"second": "./predictor", "first": "./model", "third": "./none", "fourth": 4}))
    assert own.code == f"{alone}, first={model}, second={predictor}"
    typed: dict[str, Any] = {"Bug2": Bug2, "__name__": "typed_in_by_hand"}
    exec("class Mine(Bug2): pass", typed)  # a class without a file
    entry = PolicyEntry.of(("mine", typed["Mine"], {"first": "./model"}))
    assert entry.is_nameless and entry.code == f"first={model}"


# ---------------------------------------------------------------------------------------------- what a kill leaves


@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_wherever_a_kill_cuts_the_rows_off_the_worlds_before_are_kept(data: st.DataObject) -> None:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        put_finished(folder)
        whole = (folder / ROWS).read_bytes()
        end = data.draw(st.integers(0, len(whole)))
        (folder / ROWS).write_bytes(whole[:end])
        kept: list[EpisodeRow] = []
        for world in worlds():
            if len(lines_of([*kept, *world])) > end:
                break
            kept += world
        assert same(read(folder), kept)
        assert (folder / ROWS).read_bytes() == lines_of(kept)
        assert same(read(folder), kept)


def lines_of(rows: list[EpisodeRow]) -> bytes:
    return b"".join(json.dumps(row.as_dict()).encode() + b"\n" for row in rows)


def test_a_world_without_all_its_robots_in_the_middle_is_refused_and_goes_in_a_repair(folder: Path) -> None:
    number = next(n for n, row in enumerate(ALL) if row.scenario == "pair")
    (folder / ROWS).write_bytes(lines_of(ALL[:number] + ALL[number + 1 :]))
    with pytest.raises(
        ValueError, match=rf"line {number + 1}: bug0 in pair, seed 2, has 1 of 2 robots; --repair drops"
    ):
        read(folder)
    assert same(read(folder, repair=True), ALL[:number] + ALL[number + 2 :])


@pytest.mark.parametrize("left", [(), (".0123456789abcdef.partial.json",), (".lock", ".lock.json")])
def test_a_start_that_was_cut_off_is_begun_again(left: tuple[str, ...], tmp_path: Path) -> None:
    for name in left:
        (tmp_path / name).write_text("")
    fill(tmp_path)
    assert same(read(tmp_path), ALL)


@pytest.mark.parametrize("name", ["a.partial.json", "notes.txt", ".0123456789abcdef.partial.png", "rows.jsonl"])
def test_a_folder_of_something_else_is_refused_and_left(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text("mine")
    with pytest.raises(ValueError, match="holds something else"):
        read(tmp_path)
    assert files_in(tmp_path) == {name: b"mine"}


# ---------------------------------------------------------------------------------------------- repair


def test_rows_that_two_processes_wrote_are_mended_on_request(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    slower = [replace(row, decision_time_mean=0.5) for row in ALL]
    (folder / ROWS).write_bytes(lines_of(ALL[:3] + slower[:2] + ALL[3:] + slower[2:3]))
    (folder / LENGTHS).write_bytes((folder / LENGTHS).read_bytes() * 2)
    before = files_in(folder)
    with pytest.raises(ValueError, match=r"rows.jsonl: line 4: says again what line 1 says \(3 such lines\)"):
        read(folder)
    assert files_in(folder) == before
    assert same(read(folder, repair=True), ALL)
    told = [record.getMessage() for record in caplog.records]
    assert len(told) == 2 and not any("\n" in line for line in told)
    assert "shortest_paths.jsonl: dropped 6 of 12 lines, 6 there twice (line 7, 8, 9, 10, 11, 12)" in told[1]
    assert f"rows.jsonl: dropped 3 of {len(ALL) + 3} lines, 3 there twice (line 4, 5, {len(ALL) + 3})" in told[0]
    assert same(read(folder), ALL)
    assert len((folder / DROPPED).read_bytes().splitlines()) == 9


def test_of_rows_that_contradict_each_other_the_first_is_kept_and_told(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    other = replace(ALL[0], turns=7)
    (folder / ROWS).write_bytes(lines_of([*ALL, other]))
    with pytest.raises(ValueError, match=f"line {len(ALL) + 1}: contradicts what line 1 says; --repair drops it"):
        read(folder)
    assert same(read(folder, repair=True), ALL)
    (record,) = caplog.records
    assert f"1 contradicting an earlier line, which is kept (line {len(ALL) + 1})" in record.getMessage()
    assert json.loads((folder / DROPPED).read_bytes()) == other.as_dict()


def test_rows_and_shortest_paths_that_contradict_each_other_both_go_in_a_repair(folder: Path) -> None:
    change_line(folder / LENGTHS, 1, setter(lengths=["7.0"]))
    with pytest.raises(ValueError, match=r"rows\.jsonl: line 1: shortest_path_length: got 8\.0, .* says 7\.0"):
        read(folder)
    with opened(folder, PLAN, repair=True) as results:
        assert same(results.rows, [row for row in ALL if (row.scenario, row.seed) != ("open", 2)])
        assert ("open", 2) not in results.lengths and len(results.lengths) == 5
    assert len(read(folder)) == len(ALL) - 2


def test_one_robot_of_several_that_contradicts_its_shortest_path_takes_its_world_along(folder: Path) -> None:
    worlds = [json.loads(line) for line in (folder / LENGTHS).read_bytes().splitlines()]
    number, world = next((number, world) for number, world in enumerate(worlds, start=1) if len(world["lengths"]) == 2)
    place = world["scenario"], world["seed"]
    change_line(folder / LENGTHS, number, lambda record: record | {"lengths": [record["lengths"][0], "77.0"]})
    told = r"rows\.jsonl: line \d+: of a world with line \d+, .* shortest_paths\.jsonl says 77\.0"
    with pytest.raises(ValueError, match=told):
        read(folder)
    with opened(folder, PLAN, repair=True) as results:
        assert same(results.rows, [row for row in ALL if (row.scenario, row.seed) != place])
        assert place not in results.lengths


def test_a_repair_of_a_sound_folder_changes_nothing(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    before = files_in(folder)
    assert same(read(folder, repair=True), ALL)
    assert files_in(folder) == before and not caplog.records


def in_plan(row: EpisodeRow) -> bool:
    return any(
        (row.policy, row.scenario, row.seed, row.robot) == (one.policy, one.scenario, one.seed, one.robot)
        for one in ALL
    )


@settings(max_examples=100, deadline=None)
@given(
    name=st.sampled_from([ROWS, LENGTHS]),
    start=st.integers(0, 4000),
    length=st.integers(0, 600),
    put=st.binary(max_size=60) | st.sampled_from([b"\n", b"null", b"1e999", b'"', b"{}", b"-", b"9" * 50]),
    again=st.integers(0, 3),
)
def test_whatever_was_done_to_the_lines_nothing_wrong_is_read_and_a_repair_helps(
    name: str, start: int, length: int, put: bytes, again: int
) -> None:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        put_finished(folder)
        data = (folder / name).read_bytes()
        start %= len(data)
        # A piece goes, or comes again, and something else comes in its place.
        (folder / name).write_bytes(data[:start] + put + data[start : start + length] * again + data[start + length :])
        try:
            rows = read(folder)
        except ValueError as error:
            assert "\n" not in str(error) and "jsonl: line " in str(error)
            rows = read(folder, repair=True)
        keys = [(row.policy, row.scenario, row.seed, row.robot) for row in rows]
        assert len(set(keys)) == len(keys) and all(map(in_plan, rows))
        assert all(keys.count((p, s, n, 1 - r)) == 1 for p, s, n, r in keys if s == "pair")
        assert same(read(folder), rows)


# ---------------------------------------------------------------------------------------------- one writer at a time


COMMAND = ["evaluate", "--scenario", "empty", "--policies", "bug0", "--episodes", "2"]


def test_a_folder_has_one_writer_at_a_time(folder: Path) -> None:
    with opened(folder, PLAN) as results:
        before = files_in(folder)
        with pytest.raises(ValueError, match="out is in use: process"):
            read(folder)
        assert files_in(folder) == before
        assert same(results.rows, ALL)
    assert same(read(folder), ALL)


def test_a_second_evaluation_into_a_folder_fails_in_one_line_and_loses_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main([*COMMAND, "--out", str(out)]) == 0
    capsys.readouterr()
    with one_writer(out):
        before = files_in(out)
        assert main([*COMMAND, "--out", str(out)]) == 2
        assert files_in(out) == before
    said = capsys.readouterr().err
    assert said.startswith(f"bug-gym: error: {out} is in use: process ") and said.count("\n") == 1


def test_the_command_mends_a_folder_with_rows_twice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main([*COMMAND, "--out", str(out)]) == 0
    whole = (out / ROWS).read_bytes()
    (out / ROWS).write_bytes(whole * 2)
    capsys.readouterr()
    assert main([*COMMAND, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "rows.jsonl: line 3: says again what line 1 says" in said and "--repair" in said
    assert main([*COMMAND, "--out", str(out), "--repair"]) == 0
    assert (out / ROWS).read_bytes() == whole
    assert len(json.loads((out / "summary.json").read_bytes())["rows"]) == 2
    assert main([*COMMAND, "--repair"]) == 2
    assert "got repair and no folder" in capsys.readouterr().err
