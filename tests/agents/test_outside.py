"""Policies from outside: by class, object, module, file, registered name and entry point; in workers and when resumed."""

from __future__ import annotations

import importlib
import json
import os
import pickle
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from bug_gym import agents
from bug_gym.agents import AGENTS, REGISTERED, Spec, known_agents, make_policy, policy_names, register
from bug_gym.agents.floors.go_to_goal import GoToGoal
from bug_gym.agents.learning.settings import load_settings
from bug_gym.cli import main
from bug_gym.config import ScenarioError, load
from bug_gym.evaluation import entries, evaluate, read_rows
from bug_gym.evaluation.entries import PolicyEntry
from bug_gym.evaluation.plan import make_plan
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.suites import load_suite
from bug_gym.navigation_env import NavigationEnv
from bug_gym.policy import Memory, ScriptedPolicy, Velocity
from bug_gym.robots_env import parallel_env
from bug_gym.simulation import Simulation
from bug_gym.team_policy import EachAlone
from bug_gym.view import View

OPEN = {"name": "open", "world": {"family": "empty", "start": [0, 0, 0], "goal": [3, 1]}, "lidar": {"beams": 8}}
PAIR = {
    "world": {"family": "empty"},
    "robots": [{"start": [-5, 0, 0], "goal": [5, 0]}, {"start": [-5, 3, 0], "goal": [3, 3]}],
}

CODE = '''
from __future__ import annotations
import math
from dataclasses import dataclass
from bug_gym.policy import Memory, ScriptedPolicy

@dataclass(frozen=True)
class Parameters:
    speed: float = 1.0
    """Speed [m/s]."""

class MyBug(ScriptedPolicy):
    Parameters = Parameters
    def start(self):
        return Memory(mode="motion_to_goal")
    def act(self, view, memory):
        speed = self.parameters.speed
        return speed * math.cos(view.goal_bearing), speed * math.sin(view.goal_bearing)

class Unfinished(ScriptedPolicy):
    def start(self):
        return Memory()

class OtherArguments:
    def __init__(self, network):
        self.network = network
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return observation, state

class NoPolicy:
    pass

class NotBegun(ScriptedPolicy):
    def __init__(self, sensors, *, discrete=False):
        self.reach = sensors.range
    def start(self):
        return Memory()
    def act(self, view, memory):
        return 0.0, 0.0

class OneForAll(MyBug):
    memory = Memory()
    def start(self):
        return self.memory

class OtherQuestion:
    def __init__(self, sensors, *, discrete=False):
        pass
    def predict(self, observation, state=None):
        return [[0.0, 0.0]] * len(observation), None

policy = 3
'''
"""A user's file: a bug, and what may be wrong with one."""


class Straight(ScriptedPolicy):
    """Straight to the goal."""

    def start(self) -> Memory:
        return Memory()

    def act(self, view: Any, memory: Memory) -> tuple[float, float]:
        return float(np.cos(view.goal_bearing)), float(np.sin(view.goal_bearing))


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of a user's, in which the process works; names and paths are forgotten after the test."""
    (tmp_path / "my_bug.py").write_text(CODE, encoding="utf-8")
    (tmp_path / "my_module_of_bugs.py").write_text(CODE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    before = set(sys.modules)
    yield tmp_path
    REGISTERED.clear()
    agents._installed.cache_clear()
    for name in set(sys.modules) - before:
        if name.startswith("my_"):
            del sys.modules[name]


def runs(rows: list[EpisodeRow]) -> list[tuple[Any, ...]]:
    """What does not depend on labels and clocks."""
    return [(row.seed, row.outcome, row.time, row.path_length) for row in rows]


def install(place: Path, lines: str) -> None:
    """Have a package with entry points on Python's path."""
    folder = place / "their_package-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: their-package\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text(f"[bug_gym.policies]\n{lines}\n")
    sys.path.append(str(place))
    agents._installed.cache_clear()


# ---------------------------------------------------------------------------------------------- ways to name one


@pytest.mark.parametrize("name", ["my_bug.py:MyBug", "my_module_of_bugs:MyBug", "./my_bug.py:MyBug"])
def test_a_class_is_made_by_the_place_of_its_code(name: str) -> None:
    policy: Any = make_policy(name, OPEN, speed=0.5)
    assert type(policy).__name__ == "MyBug" and policy.parameters.speed == 0.5
    text: Any = make_policy(f"{name}:speed=0.25", OPEN)
    assert text.parameters.speed == 0.25


def test_a_class_and_an_object_are_policies() -> None:
    made = make_policy(Straight, OPEN)
    assert type(made) is Straight and make_policy(made, OPEN) is made
    expected = runs(evaluate([Straight], OPEN, episodes=2))
    assert runs(evaluate(Straight, OPEN, episodes=2)) == expected
    assert runs(evaluate([made], OPEN, episodes=2)) == expected
    assert runs(evaluate([("mine", Straight)], OPEN, episodes=2)) == expected
    assert all(outcome == "success" for _, outcome, *_ in expected)


def test_several_robots_have_a_policy_from_outside_each() -> None:
    env = parallel_env(scenario=PAIR)
    assert isinstance(make_policy(Straight, env), EachAlone)
    alone = make_policy(Straight, Simulation({key: value for key, value in PAIR.items() if key != "robots"}))
    assert isinstance(make_policy(alone, env), EachAlone)
    each = make_policy(Straight, env)
    assert make_policy(each, env) is each


def test_a_planner_from_outside_is_given_the_map(place: Path) -> None:
    (place / "my_planner.py").write_text("from bug_gym.agents.planning.a_star import AStar\nclass Mine(AStar): pass\n")
    rows = evaluate(["my_planner.py:Mine", "a_star"], "static", episodes=2)
    assert rows[0].policy == "my_planner.py:Mine (privileged)"
    assert runs(rows[:2]) == runs(rows[2:])


def test_a_registered_name_is_a_policy_like_any_other() -> None:
    register("my_bug", "my_bug.py:MyBug")
    register("my_bug", "my_bug.py:MyBug")
    assert "my_bug" in policy_names()
    policy: Any = make_policy("my_bug", OPEN, speed=0.5)
    assert policy.parameters.speed == 0.5
    with pytest.raises(ValueError, match="unknown policy 'my_bugs'; did you mean 'my_bug'"):
        make_policy("my_bugs", OPEN)


def test_an_installed_package_offers_policies(
    place: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    install(place, "their_bug = my_bug:MyBug\nbug2 = my_bug:MyBug\nodd = my_bug")
    assert type(make_policy("their_bug", OPEN)).__name__ == "MyBug"
    assert type(make_policy("bug2", OPEN)).__name__ == "Bug2"
    assert [record.args[0] for record in caplog.records if record.args] == ["bug2", "odd"]  # type: ignore[index]
    assert main(["list", "policies"]) == 0
    assert "from outside; package their-package" in capsys.readouterr().out


def test_a_training_knows_the_code_of_an_expert_that_has_a_name(place: Path) -> None:
    install(place, "their_bug = my_bug:MyBug")
    register("my_bug", "my_bug.py:MyBug")
    asked = {"algo": "dagger", "scenarios": ["dynamic"]}
    for name in ("their_bug", "my_bug"):
        settings = load_settings({**asked, "expert": f"{name}:speed=0.5"})
        by_place = load_settings({**asked, "expert": "my_bug.py:MyBug"}, trust=True)
        assert settings.made_of["expert"] == by_place.made_of["expert"] != ""
    with (place / "my_bug.py").open("a") as file:
        file.write("\n# another text\n")
    with pytest.raises(ValueError, match="my_bug.py was changed after it was imported"):
        _ = load_settings({**asked, "expert": "their_bug"}).made_of


@pytest.mark.parametrize("name", ["a,b", "col:on", "two words", "1bug", "a/b"])
def test_an_offer_whose_name_no_command_can_take_is_left_out_with_a_word(
    name: str, place: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    with pytest.raises(ValueError, match="expected letters, digits, _ and -"):
        register(name, "my_bug.py:MyBug")
    install(place, f"{name} = my_bug:MyBug\ntheir-bug_2 = my_bug:MyBug")
    assert main(["list", "policies"]) == 0
    told = capsys.readouterr().out
    assert "their-bug_2" in told and name not in told and name not in known_agents()
    (warning,) = [record.getMessage() for record in caplog.records]
    left_out = f"policy {name!r} of package their-package is left out: 'my_bug:MyBug' has a name that cannot be one"
    assert warning == f"{left_out}, expected letters, digits, _ and -"


@pytest.mark.parametrize(
    ("code", "told"),
    [
        (None, "no module 'their_code', looked for on Python's path"),
        ("import nowhere_to_be_found\n", "No module named 'nowhere_to_be_found'"),
        ("1 / 0\n", "ZeroDivisionError: division by zero"),
        ("class Bug: pass\n", "their_code:Bug is no policy: got class Bug, expected a class with `predict`"),
    ],
)
def test_a_broken_offer_of_a_package_is_named_where_it_is_asked_for_and_left_out_of_all(
    code: str | None, told: str, place: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    install(place, "broken = their_code:Bug\nsound = my_bug:MyBug")
    if code is not None:
        (place / "their_code.py").write_text(code)
    sys.modules.pop("their_code", None)
    for ask in (lambda: make_policy("broken", OPEN), lambda: evaluate(["sound", "broken"], OPEN, episodes=1)):
        with pytest.raises((ValueError, ImportError)) as error:
            ask()
        assert str(error.value).startswith(f"policy 'broken' of package their-package: {told}")
    monkeypatch.setattr(agents, "AGENTS", {"go_to_goal": AGENTS["go_to_goal"]})
    rows = evaluate(None, OPEN, episodes=1)
    assert [row.policy for row in rows] == ["go_to_goal", "sound"]
    (warning,) = [record.getMessage() for record in caplog.records]
    assert warning.startswith(f"policy 'broken' of package their-package: {told}")
    assert warning.endswith("; it is left out")


@pytest.mark.parametrize(
    ("code", "told"),
    [
        (
            "def __init__(self): pass",
            r"cannot be made: .*; expected Bug\(sensors, \*, discrete",
        ),
        (
            "def __init__(self, sensors, *, discrete, network): pass",
            "cannot be made: missing a required argument: 'network'",
        ),
        ("def __init__(self, sensors, *, discrete): self.width = sensors.no_such", "AttributeError: .*no_such"),
        ("def act(self, view, memory): return 1 / 0", "ZeroDivisionError: 'division by zero'"),
        ("def act(self, view, memory): return (0.0, 0.0, 0.0)", "ValueError: "),
    ],
)
def test_an_offer_that_fails_where_all_are_asked_for_is_left_out_with_a_word_and_by_name_ends_with_one(
    code: str, told: str, place: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    install(place, "failing = their_code:Bug\nsound = my_bug:MyBug")
    sys.modules.pop("their_code", None)
    (place / "their_code.py").write_text(
        "from bug_gym.policy import Memory, ScriptedPolicy\n\n\nclass Bug(ScriptedPolicy):\n"
        "    def start(self): return Memory()\n    def act(self, view, memory): return (0.0, 0.0)\n"
        f"    {code}\n"
    )
    monkeypatch.setattr(agents, "AGENTS", {"go_to_goal": AGENTS["go_to_goal"]})
    assert [row.policy for row in evaluate(None, OPEN, episodes=1)] == ["go_to_goal", "sound"]
    (warning,) = [record.getMessage() for record in caplog.records]
    assert "failing" in warning and "their" in warning
    assert re.search(told, warning), warning
    assert "left out" in warning and "\n" not in warning
    with pytest.raises(Exception) as error:  # noqa: PT011 - what their code raises
        evaluate(["sound", "failing"], OPEN, episodes=1)
    assert "failing" in "; ".join([str(error.value), *getattr(error.value, "__notes__", ())])


def test_options_stand_in_lists_as_on_the_command_line() -> None:
    entries = [PolicyEntry.of(one) for one in ("bug2:turn=right", Spec("bug2", {"turn": "right"}))]
    assert entries[0] == entries[1] and entries[0].label == "bug2:turn=right"
    trusted = PolicyEntry.of(Spec(Path("model.zip"), trust=True))
    assert (trusted.name, trusted.parameters) == ("./model.zip", {"trust": True})
    rows = evaluate(["go_to_goal", "bug2:turn=right", Spec(Straight)], OPEN, episodes=1)
    assert [row.policy for row in rows] == ["go_to_goal", "bug2:turn=right", "Straight"]
    policy: Any = make_policy(Spec("bug2", {"turn": "right"}), OPEN, clearance=0.3)
    assert (policy.parameters.turn, policy.parameters.clearance) == ("right", 0.3)


def test_a_path_is_a_folder_of_a_model() -> None:
    with pytest.raises(ValueError, match="no_model"):
        make_policy(Path("no_model"), "static")
    with pytest.raises(ValueError, match="no file no_model.zip"):
        make_policy(Path("no_model.zip"), "static")


# ---------------------------------------------------------------------------------------------- workers, resuming


def test_workers_find_them_all(place: Path) -> None:
    """Each way: by file, by a module in the working directory, by a registered name, and as a class."""
    for name in ("my_bug", "my_other_bug"):
        register(name, f"{name.replace('other_', '')}.py:MyBug")
    policies = ["my_bug.py:MyBug", "my_module_of_bugs:MyBug", "my_bug", ("registered too", "my_other_bug"), GoToGoal]
    alone = evaluate(policies, OPEN, episodes=3)
    assert runs(evaluate(policies, OPEN, episodes=3, workers=2)) == runs(alone)
    # The workers wait for more, in the folder and with the path of a moment ago.
    folder = place / "elsewhere"
    folder.mkdir()
    (folder / "my_second_module.py").write_text(CODE, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert evaluate("my_second_module:MyBug", OPEN, episodes=9, workers=2)[0].success  # of two jobs


def test_a_run_of_policies_from_outside_goes_on_by_name(place: Path) -> None:
    register("my_bug", "my_bug.py:MyBug")
    policies = ["my_bug", "my_module_of_bugs:MyBug", Straight]
    rows = evaluate(policies, OPEN, episodes=3, out="results")
    path = place / "results" / "rows.jsonl"
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:4]))
    assert runs(evaluate(policies, OPEN, episodes=3, out="results")) == runs(rows)
    assert path.read_text().splitlines(keepends=True)[:4] == lines[:4]


def test_a_run_does_not_go_on_with_other_code(place: Path) -> None:
    evaluate("my_bug.py:MyBug", OPEN, episodes=1, out="results")
    (place / "my_bug.py").write_text(CODE.replace("= 1.0", "= 0.5"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"another run: policies\.my_bug\.py:MyBug\.code was"):
        evaluate("my_bug.py:MyBug", OPEN, episodes=1, out="results")


def test_a_changed_file_is_read_again_though_it_is_as_long_and_of_the_same_second(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    for speed in (1.0, 0.5):
        (place / "my_bug.py").write_text(CODE.replace("= 1.0", f"= {speed}"), encoding="utf-8")
        os.utime(place / "my_bug.py", (1e9, 1e9))
        policy: Any = make_policy("my_bug.py:MyBug", OPEN)
        assert policy.parameters.speed == speed
    assert not (place / "__pycache__").exists()


FAMILY = {
    "my_bug.py:Mine": {
        "my_bug.py": "from my_base import Base\n\nclass Mine(Base): pass\n",
        "my_base.py": f"{CODE}\nclass Base(MyBug): pass\n",
        "my_plans.py": "SPEED = 1.0\n",
    },
    "my_package.bugs.mine:Mine": {
        "my_package/__init__.py": "",
        "my_package/bugs/__init__.py": "",
        "my_package/bugs/mine.py": "from my_package.base import Base\n\nclass Mine(Base): pass\n",
        "my_package/base.py": f"{CODE}\nclass Base(MyBug): pass\n",
        "my_package/plans.py": "SPEED = 1.0\n",
        "my_notes.py": "",
    },
}
"""Policies of several files, and the files; the last one of each is no base and in no package."""


def of_a_new_process(reference: str) -> str:
    """The digest of a policy's code where nothing of it was imported before."""
    for name in [name for name in sys.modules if name.startswith("my_")]:
        del sys.modules[name]
    importlib.invalidate_caches()
    return PolicyEntry.of(reference).code


@pytest.mark.parametrize("reference", FAMILY)
def test_the_code_of_a_policy_is_that_of_its_bases_and_its_package_too(reference: str, place: Path) -> None:
    for name, text in FAMILY[reference].items():
        (place / name).parent.mkdir(exist_ok=True, parents=True)
        (place / name).write_text(text, encoding="utf-8")
    before = of_a_new_process(reference)
    assert len(before) == 16 and of_a_new_process(reference) == before
    *noticed, other = FAMILY[reference]
    for number, name in enumerate([*noticed, other]):
        (place / name).write_text(f"{FAMILY[reference][name]}# {number}\n", encoding="utf-8")
        after = of_a_new_process(reference)
        assert (after != before) == (name != other), name
        before = after
    if "package" in reference:
        for name in (".#hidden.py", "__pycache__/cached.py", "notes.txt"):
            (place / "my_package" / name).parent.mkdir(exist_ok=True)
            (place / "my_package" / name).write_text("")
        assert of_a_new_process(reference) == before
        (place / "my_package" / "new.py").write_text("")
        assert of_a_new_process(reference) != before


def test_bases_of_installed_packages_and_of_ours_do_not_count(place: Path) -> None:
    (place / "my_own.py").write_text("from my_installed import Mine\n\nclass Own(Mine): pass\n", encoding="utf-8")
    folder = place / "site-packages"
    folder.mkdir()
    sys.path.append(str(folder))
    (folder / "my_installed.py").write_text(CODE.replace("MyBug", "Mine"), encoding="utf-8")
    own, installed = of_a_new_process("my_own:Own"), of_a_new_process("my_installed:Mine")
    with (folder / "my_installed.py").open("a") as file:
        file.write("# another one\n")
    assert of_a_new_process("my_own:Own") == own and of_a_new_process("my_installed:Mine") != installed


def test_a_class_whose_file_was_changed_after_it_was_imported_is_refused_until_it_is_reloaded(place: Path) -> None:
    sys.path.append(str(place))
    mine = importlib.import_module("my_module_of_bugs")
    before, told = mine.MyBug, r"^my_module_of_bugs\.py was changed after it was imported: reload it, or restart$"
    rows = evaluate(before, OPEN, episodes=1)  # from now on it is known
    (place / "my_module_of_bugs.py").write_text(CODE.replace("= 1.0", "= 0.50"), encoding="utf-8")
    assert runs(evaluate(before, OPEN, episodes=1)) == runs(rows)  # what was imported runs, and nothing is said of it
    for policy in (before, "my_module_of_bugs:MyBug", mine.OneForAll):
        with pytest.raises(ValueError, match=told):
            PolicyEntry.of(policy).code  # noqa: B018
    with pytest.raises(ValueError, match=told):
        evaluate(before, OPEN, episodes=1, out="results")
    assert not list((place / "results").glob("*.json*"))
    with pytest.raises(ValueError, match=told):
        evaluate(before, OPEN, episodes=1, workers=2)
    importlib.reload(mine)
    assert evaluate(mine.MyBug, OPEN, episodes=1, out="results")[0].time > 1.5 * rows[0].time
    with pytest.raises(ValueError, match=told):  # the old one is still that of the old text
        evaluate(before, OPEN, episodes=1, out="others")


class Editing(GoToGoal):
    """Edits a file of the user's on its way, as somebody does who can't wait for the end."""

    def act(self, view: Any, memory: Memory) -> tuple[float, float]:
        if view.goal_distance < 1.0:
            Path("my_bug.py").write_text(CODE.replace("= 1.0", "= 0.50"), encoding="utf-8")
        return super().act(view, memory)


def test_an_edit_during_an_evaluation_changes_none_of_its_rows(place: Path) -> None:
    rows = evaluate("my_bug.py:MyBug", OPEN, episodes=2)
    both = evaluate([Editing, "my_bug.py:MyBug"], OPEN, episodes=2, out="results")
    assert runs([row for row in both if row.policy == "my_bug.py:MyBug"]) == runs(rows)
    (mine,) = (one for one in read_rows("results") if one.policy == "my_bug.py:MyBug" and one.seed == 0)
    assert mine.time == rows[0].time < evaluate("my_bug.py:MyBug", OPEN, episodes=1)[0].time
    with pytest.raises(ValueError, match="results holds another run"):
        evaluate([Editing, "my_bug.py:MyBug"], OPEN, episodes=2, out="results")


def test_a_process_that_reads_a_policy_after_an_edit_refuses_it(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (place / "my_model").mkdir()
    (place / "my_model" / "config.json").write_text("{}")
    simulation = Simulation(load(OPEN), 1)
    by_file, by_class = (PolicyEntry.of(one).held() for one in ("my_bug.py:MyBug", GoToGoal))
    of_model = PolicyEntry.of("./my_model/").held()
    (place / "my_bug.py").write_text(CODE.replace("= 1.0", "= 0.50"), encoding="utf-8")
    (place / "my_model" / "config.json").write_text("{ }")
    assert by_file.make(simulation) and by_class.make(simulation)
    monkeypatch.setattr(entries, "_HELD", {})  # as in a worker that begins now
    assert by_class.make(simulation)
    for entry in (by_file, of_model):
        with pytest.raises(ValueError, match="its code or model was changed after this began") as caught:
            entry.make(simulation)
        assert caught.value.__notes__ == [f"policy {entry.label}"]


def test_a_process_that_reads_a_scenarios_code_after_an_edit_refuses_it(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (place / "my_term.py").write_text("def near(ranges): return ranges.min(axis=1)\n")
    own = {**OPEN, "reward_terms": {"near": {"function": "my_term.py:near", "weight": 1.0}}}
    (planned,) = make_plan("go_to_goal", own, episodes=1, trust=True).scenarios
    (place / "my_term.py").write_text("def near(ranges): return ranges.max(axis=1) / 2.0\n")
    planned.require_held()  # this process has what it planned
    monkeypatch.setattr(entries, "_PLANNED", set())  # as in a worker that begins now
    with pytest.raises(ValueError, match=r"the code of reward_terms\.near was changed after this began$"):
        pickle.loads(pickle.dumps(planned)).require_held()


def test_a_base_whose_file_was_changed_after_it_was_imported_is_named(place: Path) -> None:
    for name, text in FAMILY["my_bug.py:Mine"].items():
        (place / name).write_text(text, encoding="utf-8")
    evaluate("my_bug.py:Mine", OPEN, episodes=1)
    (place / "my_bug.py").write_text("from my_base import Base\n\nclass Mine(Base): speed = 1\n", encoding="utf-8")
    evaluate("my_bug.py:Mine", OPEN, episodes=1, out="results")  # this one is read again
    (place / "my_base.py").write_text(f"{FAMILY['my_bug.py:Mine']['my_base.py']}# another one\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"^my_base\.py was changed after it was imported"):
        evaluate("my_bug.py:Mine", OPEN, episodes=1, out="others")


def test_a_class_that_autoreload_has_brought_up_to_date_is_the_new_one(place: Path) -> None:
    sys.path.append(str(place))
    mine = importlib.import_module("my_module_of_bugs")
    imported = mine.MyBug
    before = PolicyEntry.of(imported).code
    (place / "my_module_of_bugs.py").write_text(CODE.replace("= 1.0", "= 0.50"), encoding="utf-8")
    importlib.reload(mine)
    for name in ("start", "act"):  # as IPython does it
        getattr(imported, name).__code__ = getattr(mine.MyBug, name).__code__
    assert PolicyEntry.of(imported).code == PolicyEntry.of(mine.MyBug).code != before


def test_the_class_of_a_script_is_what_it_was_when_its_file_changes(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = ModuleType("__main__")
    script.__file__ = str(place / "my_bug.py")
    monkeypatch.setitem(sys.modules, "__main__", script)
    exec(compile(CODE, script.__file__, "exec"), vars(script))
    before = PolicyEntry.of(script.MyBug).code
    (place / "my_bug.py").write_text(CODE.replace("= 1.0", "= 0.5"), encoding="utf-8")
    assert PolicyEntry.of(script.MyBug).code == before


def test_the_manifest_of_the_packages_own_policies_is_as_it_was(place: Path) -> None:
    evaluate("go_to_goal", OPEN, episodes=1, out="results")
    manifest = json.loads((place / "results" / "manifest.json").read_text())
    assert manifest["policies"] == {"go_to_goal": {"name": "go_to_goal", "parameters": {}}}


# ---------------------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("no_such_module:MyBug", r"no module 'no_such_module', looked for on Python's path and in"),
        ("no_such_file.py:MyBug", r"no file .*no_such_file\.py"),
        ("my_bug.py", r"expected its class, too, such as my_bug\.py:MyBug"),
        ("my_bug.py:MyBgu", r"my_bug\.py has no class 'MyBgu', did you mean 'MyBug'\?"),
        ("my_module_of_bugs:Nothing", r"my_module_of_bugs has no class 'Nothing'"),
        (
            "my_bug.py:NoPolicy",
            r"my_bug\.py:NoPolicy is no policy: got class NoPolicy, expected a class with `predict`",
        ),
        ("my_bug.py:policy", r"my_bug\.py:policy is no policy: got an object of type int"),
        ("my_bug.py:Unfinished", r"my_bug\.py:Unfinished is no whole policy: it lacks act"),
        (
            "my_bug.py:OtherArguments",
            r"OtherArguments' cannot be made: .*expected OtherArguments\(sensors, \*, discrete",
        ),
        ("my_bug.py:NotBegun", r"NotBegun': its __init__ does not call that of ScriptedPolicy, expected super\(\)"),
        (
            "my_bug.py:OneForAll",
            "OneForAll': start answered the same memory twice, expected a new one for each episode",
        ),
        (
            "my_bug.py:OtherQuestion",
            r"OtherQuestion: predict takes \(self, observation, state, episode_start, deterministic\): ",
        ),
        (
            "my_script.py:MyBug",
            r"my_script\.py ends the process when it is imported \(exit code 0\), expected one that",
        ),
        ("my_bug.py:MyBug:sped=1", r"has no parameter 'sped', did you mean 'speed'\?"),
        ("my_broken.py:MyBug", r"my_broken\.py, line 1: "),
    ],
)
def test_what_cannot_be_is_said_in_one_line(
    place: Path, name: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (place / "my_broken.py").write_text("class MyBug(:\n", encoding="utf-8")
    (place / "my_script.py").write_text(f"{CODE}\nraise SystemExit(0)\n", encoding="utf-8")
    with pytest.raises(ValueError, match=message) as error:
        make_policy(name, OPEN)
    assert "\n" not in str(error.value)
    assert main(["evaluate", "--scenario", "static", "--episodes", "1", "--policies", name]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_what_a_module_lacks_itself_is_told_and_not_the_module(place: Path) -> None:
    (place / "my_needy.py").write_text("import no_such_package\n", encoding="utf-8")
    for name in ("my_needy:MyBug", "my_needy.py:MyBug"):
        with pytest.raises(ModuleNotFoundError, match="no_such_package"):
            make_policy(name, OPEN)


@pytest.mark.parametrize(
    ("name", "reference", "message"),
    [
        ("bug2", "my_bug.py:MyBug", r"the name 'bug2' is taken, by bugs\.bug2:Bug2"),
        ("com1_rev3", "my_bug.py:MyBug", "is taken"),
        ("mine", "my_bug.py:Unfinished", r"'mine' is taken, by .*my_bug\.py:MyBug"),
        ("a/b", "my_bug.py:MyBug", "as the name of a policy, expected letters"),
        ("my_bug", "my_bug.py", "expected text such as 'my_module:MyBug'"),
        ("my_bug", Straight, "expected text such as 'my_module:MyBug'"),
    ],
)
def test_a_name_that_cannot_be_registered_is_refused(name: str, reference: Any, message: str) -> None:
    register("mine", "my_bug.py:MyBug")
    known = known_agents()
    with pytest.raises(ValueError, match=message):
        register(name, reference)
    assert known_agents() == known


@pytest.mark.parametrize(
    "reference",
    [
        "my_bug.py:MyBgu",
        "nowhere.py:MyBug",
        "my_nowhere:MyBug",
        "my_bug.py:Unfinished",
        "my_bug.py:NoPolicy",
        "my_bug.py:OtherArguments",
        "my_bug.py:policy",
        "my_broken.py:MyBug",
        "my_needy.py:MyBug",
    ],
)
def test_a_name_that_could_not_be_registered_is_free_for_the_next(reference: str, place: Path) -> None:
    (place / "my_broken.py").write_text("1 / 0\n")
    (place / "my_needy.py").write_text("import nowhere_to_be_found\n")
    known = known_agents()
    with pytest.raises((ValueError, ImportError, ZeroDivisionError)):
        register("mine", reference)
    assert known_agents() == known
    register("mine", "my_bug.py:MyBug")
    assert type(make_policy("mine", OPEN)).__name__ == "MyBug"


def test_a_policy_that_needs_a_parameter_can_be_registered() -> None:
    register("played", "bug_gym.agents.learning.play:LearnedPolicy")
    with pytest.raises(ValueError, match="no_model"):
        make_policy("played", OPEN, model=Path("no_model"))


def test_an_object_takes_no_parameters() -> None:
    made = make_policy(Straight, OPEN)
    with pytest.raises(ValueError, match="made already takes no parameters, got speed"):
        make_policy(made, OPEN, speed=1.0)
    with pytest.raises(ValueError, match="made already takes no parameters, got speed"):
        evaluate([("mine", made, {"speed": 1.0})], OPEN)
    with pytest.raises(ValueError, match="got 5 as a policy's parameters, expected a dict"):
        evaluate([("mine", Straight, 5)], OPEN)


@pytest.mark.parametrize(
    "policy",
    [
        "my_bug.py:MyBug",
        "my_bug.py:MyBug:speed=1",
        "m.zip:trust=true",
        {"name": "m.zip", "parameters": {"trust": True}},
    ],
)
def test_a_suite_is_data_and_names_no_code(place: Path, policy: Any) -> None:
    (place / "suite.yaml").write_text(json.dumps({"scenarios": ["static"], "policies": [policy]}))
    with pytest.raises(ScenarioError, match="expected policies that run no code"):
        load_suite(place / "suite.yaml")


# ---------------------------------------------------------------------------------------------- a new one


def test_a_new_policy_is_a_file_that_runs_and_a_test_that_passes(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", "policy", "fine_bug"]) == 0
    told = capsys.readouterr().out
    (line,) = (line.strip() for line in told.splitlines() if "bug-gym evaluate" in line)
    assert line.endswith("fine_bug.py:FineBug")
    assert main(["evaluate", "--scenario", "static", "--episodes", "1", "--policies", line.split()[-1]]) == 0
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_fine_bug.py"]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert main(["new", "policy", "fine_bug"]) == 2
    assert "exists already" in capsys.readouterr().err


@pytest.mark.parametrize("folder", ["my bugs", "bug's own", "it's $HOME", "plain"])
def test_a_shell_takes_the_lines_that_run_a_new_policy_as_they_are_told(
    place: Path, folder: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", "policy", "fine_bug", "--folder", folder]) == 0
    _, *lines = capsys.readouterr().out.splitlines()
    assert [line[:9] for line in lines] == ["run it:  ", "see it:  ", "test it: "]
    run, see, test = (shlex.split(line[9:]) for line in lines)
    policy = f"{folder}/fine_bug.py:FineBug"
    assert run == ["bug-gym", "evaluate", "--scenario", "static", "--policies", f"bug2,{policy}"]
    assert see == ["bug-gym", "render", policy, "static", "--out", "fine_bug.png"]
    assert test == ["python", "-m", "pytest", f"{folder}/test_fine_bug.py"] and Path(test[-1]).exists()
    assert main([*run[1:], "--episodes", "1"]) == 0


@pytest.mark.parametrize(("name", "message"), [("bug2", "taken"), ("My-Bug", "expected"), ("class", "expected")])
def test_a_new_policy_needs_a_name_of_its_own(
    place: Path, name: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["new", "policy", name]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and not list(place.glob("test_*"))


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    import bug_gym

    with pytest.raises(SystemExit) as left:
        main(["--version"])
    assert left.value.code == 0
    assert capsys.readouterr().out == f"bug-gym {bug_gym.__version__}\n"


def test_a_verdict_that_is_none_is_told() -> None:
    class Misspelt(ScriptedPolicy):
        def start(self) -> Memory:
            return Memory()

        def act(self, view: View, memory: Memory) -> Velocity:
            memory.verdict = "unreachabel"
            return 0.0, 0.0

    env = NavigationEnv("empty")
    policy = make_policy(Misspelt, env)
    observation, _ = env.reset(seed=0)
    with pytest.raises(ValueError, match="Misspelt: got the verdict 'unreachabel', expected one of '', 'unreachable'"):
        policy.predict(observation)
