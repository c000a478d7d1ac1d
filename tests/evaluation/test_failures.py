"""A policy that fails on its way: it is told in a line, the others go on, and nothing that is done is lost."""

from __future__ import annotations

import json
import pickle
import re
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bug_gym
from bug_gym import agents
from bug_gym.agents import AGENTS, REGISTERED, register
from bug_gym.agents.floors import go_to_goal
from bug_gym.cli import main
from bug_gym.config import load
from bug_gym.evaluation import FailedPolicyError, evaluate, record_episode
from bug_gym.evaluation.demonstrations import Extras, demonstrate
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.policy import Memory, ScriptedPolicy, Velocity
from bug_gym.references import imported
from bug_gym.view import View
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.places import finish

PACKAGE = Path(bug_gym.__file__).parent
OPEN = {"name": "open", "world": {"family": "empty", "start": [0, 0, 0], "goal": [3, 1]}, "lidar": {"beams": 8}}
FAR = {**OPEN, "name": "far", "world": {"family": "empty", "start": [0, 0, 0], "goal": [6, 1]}}

CODE = """
import math
import sys
from dataclasses import dataclass

import numpy as np

from bug_gym.policy import Drawing, Memory, ScriptedPolicy


@dataclass
class Steps(Memory):
    steps: int = 0


class Sound(ScriptedPolicy):
    def start(self):
        return Steps()

    def act(self, view, memory):
        memory.steps += 1
        if memory.steps > 10:
            self.later(view)
        return 0.5 * math.cos(view.goal_bearing), 0.5 * math.sin(view.goal_bearing)

    def later(self, view):
        pass


class TwoWords(Exception):
    def __init__(self, one, other):
        super().__init__(f"{one} and {other}")  # as Python makes it again it lacks an argument


class Raises(Sound):
    def later(self, view):
        raise TwoWords("lost", "gone")


class Leaves(Sound):
    def later(self, view):
        sys.exit(0)


class FarAway(Sound):
    def later(self, view):
        if view.goal_distance > 4.0:
            raise KeyError("goal")


class Tires(Sound):
    def act(self, view, memory):
        if memory.steps == 150:
            raise KeyError("rest")
        return super().act(view, memory)


class Draws(Sound):
    def draw(self, memory):
        return 1 / 0


class DrawsAnything(Sound):
    def draw(self, memory):
        return Drawing(points=[(0.0, 1.0)])


class DrawsNowhere(Sound):
    def draw(self, memory):
        return Drawing(segments=[(0.0, 1.0, math.nan, 0.0, "m_line")])


class Strays:
    def __init__(self, sensors, *, discrete):
        self.asked = 0

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        self.asked += 1
        return np.full((len(observation), 2), math.nan if self.asked > 10 else 0.1), None
"""


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with a user's file, in which the process works."""
    (tmp_path / "mine.py").write_text(CODE)
    (tmp_path / "open.yaml").write_text(json.dumps(OPEN))
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    REGISTERED.clear()


def runs(rows: list[EpisodeRow]) -> list[tuple[Any, ...]]:
    """What does not depend on clocks."""
    return [(row.policy, row.scenario, row.seed, row.outcome, row.time, row.path_length) for row in rows]


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("Raises", "TwoWords: lost and gone (FOLDER/mine.py, line "),
        ("Leaves", "RuntimeError: its code ends the process (exit code 0) (FOLDER/mine.py, line "),
        ("Strays", "the policy answered with nan among its actions, expected finite numbers; policy mine.py:Strays"),
    ],
)
def test_the_others_go_on_to_the_end(name: str, told: str, workers: int, place: Path) -> None:
    others = ["go_to_goal", "mine.py:Sound"]
    expected = runs(evaluate(others, OPEN, episodes=9))
    with pytest.raises(FailedPolicyError) as error:
        evaluate([f"mine.py:{name}", *others], OPEN, episodes=9, workers=workers)
    assert runs(error.value.rows) == expected
    said = str(error.value)
    assert said.startswith(told.replace("FOLDER", str(place))) and "\n" not in said
    assert f"; policy mine.py:{name}, scenario open, seed" in said
    assert [(one.policy, one.scenario) for one in error.value.failures] == [(f"mine.py:{name}", "open")]


def test_the_cause_is_what_the_policy_has_raised() -> None:
    with pytest.raises(FailedPolicyError) as error:
        evaluate(["go_to_goal", "mine.py:Raises"], OPEN, episodes=1)
    assert type(error.value.__cause__).__name__ == "TwoWords"


@pytest.mark.parametrize("workers", [1, 2])
def test_the_traceback_is_kept(workers: int, place: Path) -> None:
    with pytest.raises(FailedPolicyError, match=r"; traceback: results/failed\.txt$") as error:
        evaluate(["go_to_goal", "mine.py:Raises"], OPEN, episodes=9, workers=workers, out="results")
    (failure,) = error.value.failures
    assert failure.traceback.startswith("Traceback (most recent call last):\n")
    assert 'raise TwoWords("lost", "gone")' in failure.traceback
    assert (place / "results" / "failed.txt").read_text() == f"{failure.told}\n\n{failure.traceback}"


def test_a_fault_of_a_shipped_policy_has_its_place_in_the_traceback_until_it_is_mended(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its line can tell none: it lies in no caller's code."""
    wrong = "def act(self, view, memory):\n    return (0.5, 0.0) if view.goal_distance > 2.0 else 1 / 0\n"
    written: dict[str, Any] = {}
    exec(compile(wrong, go_to_goal.__file__, "exec"), written)  # as if it stood there
    arguments = ["evaluate", "--scenario", "open.yaml", "--episodes", "1", "--policies", "go_to_goal"]
    with monkeypatch.context() as broken:
        broken.setattr(go_to_goal.GoToGoal, "act", written["act"])
        assert main(arguments) == 2
        told = "bug-gym: error: ZeroDivisionError: division by zero; policy go_to_goal, scenario open, seed 0"
        assert capsys.readouterr().err.splitlines()[-1] == f"{told}; a traceback: --out FOLDER"
        assert main([*arguments, "--out", "results"]) == 2
        assert capsys.readouterr().err.splitlines()[-1] == f"{told}; traceback: results/failed.txt"
        assert f'File "{go_to_goal.__file__}", line 2, in act' in (place / "results" / "failed.txt").read_text()
    assert main([*arguments, "--out", "results"]) == 0
    assert not (place / "results" / "failed.txt").exists()


@pytest.mark.parametrize("workers", [1, 2])
def test_worlds_that_it_had_finished_are_told_as_none_that_count(workers: int, place: Path) -> None:
    """It has done those in which it arrives before it tires, as all worlds begin at the same time: eight a job."""
    scattered = {**OPEN, "world": {"family": "empty", "start": [0, 0, 0]}}
    steps = [row.steps for row in evaluate("mine.py:Sound", scattered, episodes=8)]
    done = sum(number <= 150 for number in steps)
    assert 1 < done < 8
    with pytest.raises(
        FailedPolicyError, match=f"; not counted: {done} worlds that it had finished; traceback"
    ) as error:
        evaluate(["go_to_goal", "mine.py:Tires"], scattered, episodes=8, workers=workers, out="results")
    assert [one.finished for one in error.value.failures] == [done]
    kept = [json.loads(line) for line in (place / "results" / "rows.jsonl").read_text().splitlines()]
    assert sum(row["policy"] == "mine.py:Tires" for row in kept) == done
    assert {row.policy for row in error.value.rows} == {"go_to_goal"}


def test_where_it_does_not_fail_its_rows_count() -> None:
    expected = runs(evaluate(["go_to_goal", "mine.py:Sound"], [OPEN, FAR], episodes=2))
    with pytest.raises(FailedPolicyError) as error:
        evaluate(["go_to_goal", "mine.py:FarAway", "mine.py:Raises"], [OPEN, FAR], episodes=2)
    mine = [(policy.replace("FarAway", "Sound"), *rest) for policy, *rest in runs(error.value.rows)]
    assert mine == [row for row in expected if row[:2] != ("mine.py:Sound", "far")]
    failed = [("mine.py:Raises", "open"), ("mine.py:FarAway", "far"), ("mine.py:Raises", "far")]
    assert [(one.policy, one.scenario) for one in error.value.failures] == failed
    assert str(error.value).endswith("; failed, too: mine.py:FarAway in far, mine.py:Raises in far")


def test_an_evaluation_of_all_policies_reports_the_others_and_ends_with_an_error(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(agents, "AGENTS", {"go_to_goal": AGENTS["go_to_goal"]})
    register("failing", "mine.py:Raises")
    register("sound", "mine.py:Sound")
    arguments = ["evaluate", "--scenario", "open.yaml", "--episodes", "2", "--out", "results", "--details"]
    for _ in range(2):  # a run that goes on finds the same
        assert main([*arguments, "--baseline", "failing"]) == 2
        out, err = capsys.readouterr()
        assert "sound" in out and "failing" not in out
        assert err.splitlines()[-1].startswith("bug-gym: error: TwoWords: lost and gone")
        kept = (place / "results" / "rows.jsonl").read_text().splitlines()
        assert [json.loads(line)["policy"] for line in kept] == ["go_to_goal", "go_to_goal", "sound", "sound"]
        summary = json.loads((place / "results" / "summary.json").read_text())
        assert "failing" not in json.dumps(summary) and "sound" in json.dumps(summary)
        assert (place / "results" / "report.html").exists()


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("Draws", "ZeroDivisionError: division by zero (FOLDER/mine.py, line "),
        ("DrawsAnything", "DrawsAnything.draw answered (0.0, 1.0) among its points, expected (x, y, label) of"),
        ("DrawsNowhere", "DrawsNowhere.draw answered (0.0, 1.0, nan, 0.0, 'm_line') among its segments, expected (x1"),
    ],
)
def test_what_cannot_be_drawn_costs_its_picture_alone(
    name: str, told: str, place: Path, caplog: pytest.LogCaptureFixture
) -> None:
    pytest.importorskip("pygame")
    policies = ["go_to_goal", f"mine.py:{name}"]
    rows = evaluate(policies, OPEN, episodes=1, out="results", pictures=True, replay_successes=True)
    assert [row.policy for row in rows] == policies
    assert (place / "results" / "report.html").exists()
    assert [path.name for path in (place / "results" / "pictures").iterdir()] == ["open-go_to_goal.png"]
    said = [record.getMessage() for record in caplog.records if f"mine.py:{name}" in record.getMessage()]
    assert [one.partition(": ")[0] for one in said] == ["no replay", "no picture"]
    assert all(one.partition(": ")[2].startswith(told.replace("FOLDER", str(place))) for one in said)
    with pytest.raises((ValueError, ZeroDivisionError)):  # who asks for that episode alone is told
        record_episode(f"mine.py:{name}", OPEN)


def test_what_cannot_be_sent_to_workers_is_named_before_anything_is_written(place: Path) -> None:
    class Holds:
        def __init__(self) -> None:
            self.lock = threading.Lock()

        def predict(self, observation: Any, *_: Any, **__: Any) -> Any:
            return np.zeros((len(observation), 2)), None

    class Typed(Family):
        def layout(self, crew: Crew, rng: Rng) -> Layout:
            return finish(crew, self, (0.0, 0.0, 0.0), (3.0, 1.0))

    lock = threading.Lock()

    def locked(steps: Any) -> Any:
        with lock:
            return 0.0 * steps

    asked: list[tuple[Any, Any, str]] = [
        (["go_to_goal", Holds()], OPEN, "policy Holds cannot be sent to workers, expected .* or one worker: .*lock"),
        ("go_to_goal", {**OPEN, "reward_terms": {"locked": locked}}, "scenario open cannot be sent to workers, .*lock"),
        (
            "go_to_goal",
            {**OPEN, "world": {"family": Typed}},
            "scenario open: the family .*Typed cannot be sent to workers",
        ),
    ]
    for policies, scenario, told in asked:
        with pytest.raises(ValueError, match=told):
            evaluate(policies, scenario, episodes=9, workers=2, out="results")
        assert not (place / "results").exists()
        assert evaluate(policies, scenario, episodes=1)  # one process sends nothing


def exceptions() -> list[str]:
    """Module and name of each exception class that the package defines, read from the source."""
    found = []
    for path in (path for folder in (PACKAGE, PACKAGE / "agents") for path in folder.rglob("*.py")):  # agents is a link
        module = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        names = re.findall(r"^class (\w+)\(\w*(?:Error|Exception)\):", path.read_text(encoding="utf-8"), re.MULTILINE)
        found += [f"{module}:{name}" for name in names]
    return sorted(set(found))


def failed_policies() -> FailedPolicyError:
    """An error of two policies, one of them with an exception that cannot be pickled, and with a note."""
    with pytest.raises(FailedPolicyError) as error:
        evaluate(["mine.py:Raises", "mine.py:FarAway", "go_to_goal"], FAR, episodes=1, out="results")
    error.value.add_note("seen here")
    return error.value


@pytest.mark.parametrize("name", exceptions())
def test_every_exception_of_the_package_can_be_sent_from_process_to_process(name: str) -> None:
    if ".learning." in name:
        pytest.importorskip("torch", reason="torch comes with the extra `train`")
    found = imported(name, "class")
    error = failed_policies() if found is FailedPolicyError else found("what is wrong")
    sent = pickle.loads(pickle.dumps(error))
    assert type(sent) is found and str(sent) == str(error)
    assert getattr(sent, "__notes__", []) == getattr(error, "__notes__", [])


def test_policies_that_have_failed_come_out_of_another_process_as_text_with_all_rows() -> None:
    error = failed_policies()
    sent = pickle.loads(pickle.dumps(error))
    assert (sent.failures, sent.place) == (error.failures, error.place)
    assert repr(sent.rows) == repr(error.rows)  # some numbers are NaN
    assert [one.traceback for one in sent.failures] == [one.traceback for one in error.failures]
    assert [row.policy for row in sent.rows] == ["go_to_goal"]
    assert all(one.error is None for one in sent.failures)


@dataclass
class OwnFields(Memory):
    """Fields with names that the package's own memories have, and other meanings."""

    holds: tuple[str, ...] = ()
    held: str = "nothing"
    hits: int = 3
    leaves: float = 0.5
    follow: str = "the goal"


class Remembers(ScriptedPolicy):
    """Goes ahead with fields of its own."""

    def start(self) -> OwnFields:
        return OwnFields()

    def act(self, view: View, memory: OwnFields) -> Velocity:
        return 1.0, 0.0


def test_names_of_fields_in_a_memory_of_ones_own_mean_nothing() -> None:
    scenario = load(OPEN, {"time.limit": 1.0})
    (row,) = evaluate(Remembers, scenario, episodes=1)
    assert (row.holds, row.held_time) == (0, 0.0)
    found = demonstrate(
        PolicyEntry.of(Remembers), ScenarioEntry("open", scenario, range(1)), range(1), Extras(modes=True)
    )
    assert len(found.points) == len(found.actions) and np.isnan(found.points).all()


def test_what_is_no_fault_of_a_policy_ends_all() -> None:
    """A reward of one's own is the scenario's: it fails for every policy."""

    def breaks(steps: Any) -> Any:
        return np.array(1.0) if steps[0] > 5 else np.zeros(len(steps))

    with pytest.raises(ValueError, match=r"reward_terms\.breaks") as error:
        evaluate("go_to_goal", {**OPEN, "reward_terms": {"breaks": breaks}}, episodes=1)
    assert not isinstance(error.value, FailedPolicyError)
