"""A caller's own code, run by a command: what is wrong with it is told in a line, with its place."""

from __future__ import annotations

from pathlib import Path

import pytest

from bug_gym.cli import main

POLICIES = """
from bug_gym.config import load
from bug_gym.policy import Memory, ScriptedPolicy


class Bug(ScriptedPolicy):
    def start(self):
        return Memory()

    def act(self, view, memory):
        return (0.0, 0.0)


class Raises(Bug):
    def act(self, view, memory):
        raise ValueError("no idea")


class Asks(Bug):
    def act(self, view, memory):
        return load("nothing of the kind")


class Forgets(Bug):
    def start(self):
        return None


class Strays(Bug):
    def act(self, view, memory):
        return (0.0, 0.0, 0.0)


class Late(Bug):
    asked = 0

    def act(self, view, memory):
        self.asked += 1
        return self.late() if self.asked > 2 else (0.0, 0.0)


class LateRaises(Late):
    def late(self):
        raise ValueError("no idea")


class LateStrays(Late):
    def late(self):
        return "left"


class Short(Bug):
    def act(self, view):
        return (0.0, 0.0)


class Loses(Bug):
    def act(self, view, memory):
        return {}["way"]


class Unmade(Bug):
    def __init__(self, sensors, *, discrete=False):
        raise RuntimeError("no luck")


class Leaves(Bug):
    def start(self):
        raise SystemExit(0)
"""


@pytest.mark.parametrize(
    ("policy", "told"),
    [
        ("mine.py:Raises", "error: no idea (FOLDER/mine.py, line 16); policy mine.py:Raises, scenario static, seed 0"),
        (
            "mine.py:Loses",
            "error: KeyError: 'way' (FOLDER/mine.py, line 59); policy mine.py:Loses, scenario static, seed 0",
        ),
        ("mine.py:Unmade", "error: RuntimeError: no luck (FOLDER/mine.py, line 64); policy mine.py:Unmade"),
        (
            "mine.py:Leaves",
            "error: RuntimeError: its code ends the process (exit code 0) (FOLDER/mine.py, line 69); policy mine.py:Leaves",
        ),
        ("mine.py:Asks", "(FOLDER/mine.py, line 21); policy mine.py:Asks, scenario static, seed 0"),
        ("mine.py:Strays", "; policy mine.py:Strays, scenario static, seed 0"),
        ("mine.py:Forgets", "policy 'FOLDER/mine.py:Forgets': start answered None, expected a bug_gym.policy.Memory"),
        ("mine.py:Short", "FOLDER/mine.py:Short: act takes (self, view, memory): too many positional arguments"),
        ("lost.py:Bug", "error: No module named 'nowhere_to_be_found' (FOLDER/lost.py, line 1)"),
        ("bug2:turn", "policy 'bug2': got the parameter 'turn' without a value, expected turn=VALUE"),
        ("model.zip", "error: no file model.zip"),
        ("bug2,bug2", "two policies are called 'bug2': leave one out, or give them labels"),
    ],
)
def test_what_is_wrong_is_told_in_a_line_with_its_place(
    policy: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(POLICIES)
    (tmp_path / "lost.py").write_text("import nowhere_to_be_found\n")
    assert main(["evaluate", "--scenario", "static", "--policies", policy, "--episodes", "1"]) == 2
    said = capsys.readouterr().err.strip()
    assert said.endswith(told.replace("FOLDER", str(tmp_path))) and "\n" not in said


@pytest.mark.parametrize("workers", ["1", "2"])
@pytest.mark.parametrize("policy", ["LateRaises", "LateStrays"])
def test_what_fails_on_its_way_says_which_policy_and_where(
    policy: str, workers: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(POLICIES)
    arguments = ["--scenario", "empty", "--seed", "7", "--policies", f"mine.py:{policy}", "--episodes", "9"]
    assert main(["evaluate", *arguments, "--workers", workers]) == 2
    said, _, hint = capsys.readouterr().err.strip().splitlines()[-1].rpartition("; ")
    assert hint == "a traceback: --out FOLDER"
    # Workers get eight worlds at a time; either of the two jobs fails first.
    seeds = [" 7, 8, 9, 10, 11, 12, 13, 14, 15"] if workers == "1" else [" 7, 8, 9, 10, 11, 12, 13, 14", " 15"]
    assert said.count("policy mine.py") == 1
    assert any(
        said.endswith(f"; policy mine.py:{policy}, scenario empty, seed{'s' * (',' in some)}{some}") for some in seeds
    )


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--data", "x"], "got data 'x', expected none: only some suites need any, such as barn"),
        (["--pictures"], "got pictures and no folder, expected one in `out` (--out FOLDER)"),
        (["--replay-successes"], "got replay_successes and no folder"),
        (["--repair"], "got repair and no folder"),
    ],
)
def test_what_an_evaluation_has_no_use_for_is_refused(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", "--scenario", "static", "--policies", "bug2", "--episodes", "1", *arguments]) == 2
    assert told in capsys.readouterr().err


def test_a_name_that_would_hide_a_module_is_no_name_of_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("numpy", "json"):
        assert main(["new", "policy", name]) == 2
        assert f"the name '{name}' is that of a module" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_value_of_two_kinds_is_told_once_with_both(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", "ppo_dynamic", "--set", "learning_rate=-1", "--out", "unused"]) == 2
    assert "ppo_dynamic.yaml: learning_rate: got -1, expected a number above 0 or text\n" in capsys.readouterr().err
