"""The second stage of a predictor's training: runs of HD-BUG, and the search over them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra `play`")

from bug_gym.agents.learning.folder import TRAINED_FOLDER
from bug_gym.agents.prediction import second_stage as prediction_navigation
from bug_gym.agents.prediction.features import ANSWERS, WIDTH
from bug_gym.agents.prediction.learned import GRAPH, LearnedPredictor
from bug_gym.agents.prediction.second_stage import (
    LAWS,
    NUMBERS,
    ChangedPredictor,
    NavigationSettings,
    Run,
    compare,
    drive,
    main,
    search,
)
from bug_gym.config import load
from bug_gym.view import Sensors

FOLDER = TRAINED_FOLDER / "rl_predictor"
SENSORS = Sensors.of(load("dynamic"))
FEATURES = np.random.default_rng(0).uniform(-1.0, 1.0, (50, WIDTH)).astype(np.float32)


def test_no_change_changes_no_answer() -> None:
    changed = ChangedPredictor(SENSORS, FOLDER, np.zeros(NUMBERS))
    assert np.array_equal(changed.answer(FEATURES), LearnedPredictor(SENSORS, FOLDER).answer(FEATURES))


def test_a_change_scales_answers_and_shifts_what_lies_ahead() -> None:
    numbers = np.concatenate([np.full(ANSWERS, -0.5), [0.1, 0.2, 0.3, 0.4]])
    answers = LearnedPredictor(SENSORS, FOLDER).answer(FEATURES)
    expected = 0.5 * answers + [0.1, 0.0, 0.2, 0.0, 0.3, 0.0, 0.4, 0.0]
    changed = ChangedPredictor(SENSORS, FOLDER, numbers).answer(FEATURES)
    assert changed == pytest.approx(np.clip(expected, -1.0, 1.0), abs=1e-6)


def test_a_return_is_the_progress_less_a_collision() -> None:
    assert Run(0.75, True, 9.0).value == -0.25
    assert Run(1.0, False, 9.0).value == 1.0


@pytest.mark.parametrize("world", [*LAWS, "rush"])
def test_a_run_ends_the_same_again(world: str) -> None:
    first, second = (drive(FOLDER, np.zeros(NUMBERS), world, 3) for _ in range(2))
    assert first == second and first.progress <= 1.0 and 0.0 < first.time <= 60.1


def test_no_change_makes_no_difference() -> None:
    found = compare(FOLDER, np.zeros(NUMBERS), NavigationSettings(validation_worlds=1))
    assert found["worlds"] == len(LAWS) and found["worlds_that_differ"] == 0
    assert found["gain"] == {"value": 0.0, "low": 0.0, "high": 0.0} and found["before"] == found["after"]


def test_the_search_goes_where_the_return_grows(monkeypatch: pytest.MonkeyPatch) -> None:
    best = np.linspace(-0.3, 0.3, NUMBERS)

    def run(folder: Path, change: np.ndarray, law: str, seed: int) -> Run:
        return Run(-float(np.square(change - best).sum()), False, 1.0)

    monkeypatch.setattr(prediction_navigation, "drive", run)
    change, returns = search(FOLDER, NavigationSettings(rounds=60, pairs=20, noise=0.05))
    assert np.linalg.norm(change - best) < 0.3 * np.linalg.norm(best)
    assert len(returns) == 60 and returns[-1] > returns[0]


def test_the_command_writes_what_was_found(tmp_path: Path) -> None:
    out = tmp_path / "found.json"
    main([str(FOLDER), "--out", str(out), "--rounds", "1", "--pairs", "1", "--validation-worlds", "1"])
    record = json.loads(out.read_text(encoding="utf-8"))
    assert record["settings"]["worlds"] == list(LAWS)
    assert len(record["change"]) == NUMBERS and record["validation"]["worlds"] == len(LAWS)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--workers", "0"], "workers must be at least 1, got 0"),
        (["--rounds", "0"], "rounds must be at least 1, got 0"),
        (["--pairs", "0"], "pairs must be at least 1, got 0"),
        (["--pairs", str(10**12)], "pairs must be at most 10,000,000, got 1000000000000"),
        (["--noise", "0"], "noise must be a number above 0, got 0.0"),
        (["--rate", "nan"], "rate must be a number above 0, got nan"),
        (["--validation-worlds", "0"], "validation_worlds must be at least 1, got 0"),
        (["--validation-worlds", "1", "--worlds", "rush"], "got 1 of each of 1 kinds, expected two in all"),
        (["--seed", "-1"], "a seed is an integer from 0 to 2**63 - 1, got -1"),
        (["--worlds", "bounce", "rushes"], "no scenario 'rushes'"),
        (["--worlds", "crossing_robots"], "'crossing_robots' has 2 robots, expected 1"),
        (["--out", "nowhere/found.json"], "no folder nowhere to write found.json into"),
        (["--out", "damaged"], "damaged is a folder, expected a regular file or a new name"),
        (["nothing"], "no trained predictor in nothing: it has no predictor.json"),
        (["damaged"], "damaged/predictor.onnx is damaged"),
    ],
)
def test_what_cannot_be_is_told_in_a_line_before_anything_is_driven(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def driven(*arguments: Any) -> Any:
        raise AssertionError("something is driven")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(prediction_navigation, "drive", driven)
    shutil.copytree(FOLDER, "damaged")
    Path("damaged", GRAPH).write_bytes(b"none")
    with pytest.raises(SystemExit) as left:
        main([*([] if words[0][0] != "-" else [str(FOLDER)]), "--out", "found.json", *words])
    assert left.value.code == 2 and not Path("found.json").exists()
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("python -m bug_gym.agents.prediction.second_stage: error: ") and said in line
