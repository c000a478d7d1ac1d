"""Commands where something is not installed, and what they say of it; what they refuse before any work."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from bug_gym.checks import install_command
from bug_gym.cli import main

OPEN = ["--set", "world.goal=[2, 0]", "--set", "lidar.beams=8"]
"""Makes `empty` a matter of some twenty steps."""


def hide(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a package not be installed, and what needs it not be imported yet."""
    monkeypatch.setitem(sys.modules, package, None)
    for name in [*sys.modules]:
        if name.startswith(
            (f"{package}.", "bug_gym.agents.learning", "bug_gym.agents.sb3", "bug_gym.agents.prediction")
        ):
            monkeypatch.delitem(sys.modules, name)


def failed(arguments: str, capsys: pytest.CaptureFixture[str]) -> str:
    """The one line that a command with bad input says."""
    try:
        code: Any = main(arguments.split())
    except SystemExit as left:
        code = left.code
    said = capsys.readouterr()
    lines = said.err.strip().splitlines()  # a bar of progress may leave an empty one
    assert (code, said.out, len(lines)) == (2, "", 1), said.err
    return said.err


@pytest.mark.parametrize("package", ["torch", "stable_baselines3"])
@pytest.mark.parametrize("arguments", ["reproduce ppo-curve --seeds 1", "train ppo_static"])
def test_a_command_that_trains_names_the_extra(
    package: str,
    arguments: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    hide(package, monkeypatch)
    line = failed(arguments, capsys)
    assert f"{package}, of the extra `train`: {install_command('train')}" in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("package", "extra", "arguments"),
    [
        ("pygame", "render", "show empty --out world.png"),
        ("pygame", "render", "render bug0 empty --out path.png"),
        ("PIL", "render", "show empty --out world.png"),
        ("imageio_ffmpeg", "render", "render bug0 empty --out film.mp4"),
        ("onnxruntime", "play", "evaluate --scenario static --policies ppo_static --episodes 1"),
        ("minari", "data", "collect static --policies bug2 --episodes 1 --out datasets"),
        ("h5py", "data", "collect static --policies bug2 --episodes 1 --out datasets"),
    ],
)
def test_a_command_names_the_extra_that_it_lacks(
    package: str,
    extra: str,
    arguments: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, package, None)
    assert install_command(extra) in failed(arguments, capsys)


@pytest.mark.parametrize("is_there", [True, False])
def test_pictures_are_spoken_of_where_there_are_some(
    is_there: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if is_there:
        pytest.importorskip("pygame", reason="pygame-ce comes with the extra `render`")
    else:
        monkeypatch.setitem(sys.modules, "pygame", None)
    out = tmp_path / "out"
    arguments = ["--scenario", "empty", *OPEN, "--policies", "go_to_goal", "--episodes", "1", "--out", str(out)]
    assert main(["evaluate", *arguments, "--pictures"]) == 0
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == f"{'rows, summary and pictures' if is_there else 'rows and summary'}: {out}"
    assert (out / "pictures").exists() == is_there


@pytest.mark.parametrize("minutes", ["nan", "-1", "0", "inf", "soon"])
def test_minutes_are_a_number_above_0(
    minutes: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert f"--minutes: got '{minutes}', expected a number above 0" in failed(
        f"train ppo_static --minutes {minutes}", capsys
    )
    assert not list(tmp_path.iterdir())


def test_a_model_to_start_from_is_found_out_before_the_work_with_the_nearest_names(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")
    monkeypatch.chdir(tmp_path)
    line = failed("train ppo_static --start-from ppo_statik --steps 100", capsys)
    assert "no model 'ppo_statik'; did you mean 'ppo_static'" in line and "known: dqn_candidates" in line
    assert "no model 'nope' (known:" in failed("train ppo_static --start-from nope", capsys)
    assert "no trained policy in nope: it has no config.json" in failed("train ppo_static --start-from nope/", capsys)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("--start-from nope/", "no trained policy in nope: it has no config.json"),
        ("--start-from sac_dynamic", "sac_dynamic is of another network: its algorithm was 'sac', is now 'ppo'"),
        ("--seed -1", "a seed is an integer from 0"),
        ("--seeds 20000", "the number of seeds must be at most"),
    ],
)
def test_nothing_is_collected_for_an_offline_training_that_cannot_begin(
    asked: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")
    pytest.importorskip("minari", reason="minari comes with the extra `data`")
    monkeypatch.chdir(tmp_path)
    arguments = f"train bc_hd_bug --set data.policies=[go_to_goal] --set data.episodes=2 {asked}"
    assert said in failed(arguments, capsys)
    assert not list(tmp_path.iterdir())
