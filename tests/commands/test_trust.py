"""Commands run code that a scenario names with `--trust` only."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bug_gym.cli import main
from bug_gym.evaluation import record_episode
from bug_gym.evaluation.minari_files import open_dataset

CODE = """
open({marker!r}, "w").close()

def near(ranges):
    return -1.0 * (ranges.min(axis=1) < 1.0)

def twice(action):
    return 2.0 * action
"""
SCENARIO = """
world: {family: empty}
time: {limit: 2.0}
reward_terms: {near: rewards.py:near}
observation_fields: {twice: {function: "rewards.py:twice", shape: [2], low: -2, high: 2}}
"""


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """A scenario that names functions of a file beside it, which leaves a file `ran` where it is run."""
    (tmp_path / "rewards.py").write_text(CODE.format(marker=(tmp_path / "ran").as_posix()), encoding="utf-8")
    (tmp_path / "mine.yaml").write_text(SCENARIO, encoding="utf-8")
    return tmp_path / "mine.yaml"


def command(name: str, mine: Path) -> list[str]:
    """A command that makes worlds of the scenario and writes something."""
    out = mine.parent / "out"
    by, place = ["--policies", "go_to_goal", "--episodes", "2"], str(mine)
    return {
        "collect": ["collect", place, *by, "--expert", "go_to_goal", "--out", str(out)],
        "evaluate": ["evaluate", "--scenario", place, *by, "--out", str(out)],
        "gallery": ["gallery", "--scenario", place, *by[:2], "--size", "100", "--out", f"{out}.png"],
        "render": ["render", "go_to_goal", place, "--out", f"{out}.html"],
        "show": ["show", place, "--out", f"{out}.png"],
    }[name]  # fmt: skip


@pytest.mark.parametrize("name", ["collect", "evaluate", "gallery", "render", "show"])
def test_code_of_a_scenario_is_run_where_it_is_trusted_and_nowhere_else(
    name: str, mine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if name == "collect":
        pytest.importorskip("minari")
    assert main(command(name, mine)) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "near is the code" in told and "trust" in told
    assert not (mine.parent / "ran").exists() and not list(mine.parent.glob("out*/*.md"))
    assert main([*command(name, mine), "--trust"]) == 0
    assert (mine.parent / "ran").exists() and list(mine.parent.glob("out*"))


def test_an_episode_of_a_trusted_scenario_is_recorded(mine: Path) -> None:
    with pytest.raises(ValueError, match="trust"):
        record_episode("go_to_goal", mine)
    assert not (mine.parent / "ran").exists()
    assert record_episode("go_to_goal", mine, trust=True).frames > 1


def test_a_dataset_of_a_trusted_scenario_has_its_fields(mine: Path) -> None:
    pytest.importorskip("minari")
    assert main([*command("collect", mine), "--observations", "dict", "--trust"]) == 0
    (metadata,) = mine.parent.glob("out/bug_gym/mine/*/data")
    dataset = open_dataset(metadata.parent)
    assert "trust" not in dataset.env_spec.kwargs
    for episode in dataset.iterate_episodes():
        assert (episode.observations["twice"][1:] == 2.0 * episode.actions).all()


@pytest.mark.parametrize("name", ["play", "watch"])
def test_windows_too(
    name: str, mine: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shown: list[Any] = []
    monkeypatch.setattr("bug_gym.drawing.screen.Screen", NoScreen)
    monkeypatch.setattr("bug_gym.evaluation.live.run", lambda show, *others: shown.append(show))
    asked = [name, str(mine)] if name == "play" else [name, "go_to_goal", str(mine)]
    assert main(asked) == 2
    assert "near is the code" in capsys.readouterr().err and not (mine.parent / "ran").exists()
    assert main([*asked, "--trust"]) == 0
    assert shown and (mine.parent / "ran").exists()


class NoScreen:
    """A window that nobody sees."""

    def close(self) -> None:
        """Nothing is open."""
