"""Trainings elsewhere leave what trainings here leave; a sweep tries what it should, goes on where it was, keeps the best."""

from __future__ import annotations

import csv
import json
import shlex
import shutil
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from bug_gym.agents.learning.folder import CONFIG, GRAPH, WEIGHTS
from bug_gym.agents.learning.settings import load_settings
from bug_gym.agents.learning.sweep_settings import load_sweep, sweep_names
from bug_gym.cli import main
from bug_gym.config import ScenarioError
from bug_gym.evaluation import evaluate

optuna = pytest.importorskip("optuna", reason="of the extra `sweep`")
pytest.importorskip("stable_baselines3", reason="of the extra `train`")

from bug_gym.agents.learning import sweeps, training  # noqa: E402
from bug_gym.agents.learning.checkpoints import CHECKPOINT  # noqa: E402
from bug_gym.agents.learning.elsewhere import Job  # noqa: E402
from bug_gym.agents.learning.training import train, train_seeds  # noqa: E402

SHORT: dict[str, Any] = {
    "n_timesteps": 1024, "n_envs": 8, "n_steps": 32, "batch_size": 128, "n_epochs": 1, "eval_freq": 512,
    "eval_episodes": 4, "test_episodes": 4,
}  # fmt: skip
"""A training of a second."""


def test_a_training_in_another_process_leaves_the_same_model(tmp_path: Path) -> None:
    settings = load_settings("ppo_static", SHORT)
    train(settings, tmp_path / "here", seed=1, threads=1, tensorboard=False)
    best = train_seeds(settings, tmp_path / "there", seeds=(0, 1), workers=2)
    assert best == tmp_path / "there" / "agent" and (best / GRAPH).is_file()
    for name in (WEIGHTS, GRAPH):
        assert (tmp_path / "there" / "seed-1" / name).read_bytes() == (tmp_path / "here" / name).read_bytes()
    here, there = (json.loads((tmp_path / part / CONFIG).read_text()) for part in ("here", "there/seed-1"))
    assert [point["success"] for point in here["runs"]["1"]["curve"]] == [
        point["success"] for point in there["runs"]["1"]["curve"]
    ]
    before = (tmp_path / "there" / "seed-0" / WEIGHTS).stat().st_mtime_ns
    train_seeds(settings, tmp_path / "there", seeds=(0, 1), workers=2)  # all is done
    assert (tmp_path / "there" / "seed-0" / WEIGHTS).stat().st_mtime_ns == before
    with pytest.raises(ValueError, match="is of another training"):
        train_seeds(load_settings("ppo_static", SHORT | {"gamma": 0.9}), tmp_path / "there", seeds=(0, 1), workers=2)


class Meanwhile:
    """Does jobs here, and before them something else."""

    size = 2

    def __init__(self, does: Callable[[], None]) -> None:
        self._does = does

    def each(self, function: Callable[[Any], Any], jobs: Sequence[Any], *, in_order: bool = False) -> Iterator[Any]:
        self._does()
        yield from map(function, jobs)


@pytest.mark.parametrize("seeds", [(0,), (0, 1)])
def test_trainings_elsewhere_have_their_folder_alone(seeds: tuple[int, ...], tmp_path: Path) -> None:
    settings, other = (load_settings("ppo_static", SHORT | {"gamma": gamma}) for gamma in (0.9, 0.95))

    def another() -> None:
        for workers in (1, 2):
            with pytest.raises(ValueError, match="is in use: process"):
                train_seeds(other, tmp_path, seeds=seeds, workers=workers)

    best = train_seeds(settings, tmp_path, seeds=seeds, workers=Meanwhile(another))
    assert json.loads((best / CONFIG).read_text())["settings"]["gamma"] == 0.9


GRID: dict[str, Any] = {
    "training": "ppo_static",
    "overrides": SHORT,
    "space": {"gamma": [0.9, 0.99], "learning_rate": [1e-4, 1e-3]},
}


def test_a_grid_tries_each_combination_once_and_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = load_sweep(GRID)
    real = sweeps._value
    trained: list[int] = []

    def cut_off(*arguments: Any) -> float:
        if len(trained) == 2:
            raise KeyboardInterrupt
        trained.append(arguments[2])
        return real(*arguments)

    monkeypatch.setattr(sweeps, "_value", cut_off)
    with pytest.raises(KeyboardInterrupt):
        sweeps.sweep(settings, tmp_path)
    monkeypatch.setattr(sweeps, "_value", real)
    told: list[str] = []
    best = sweeps.sweep(settings, tmp_path, report=told.append)
    assert len(told) == 2
    with (tmp_path / sweeps.TABLE).open() as file:
        header, *rows = csv.reader(file)
    tried = [tuple(map(float, row[2:])) for row in rows]
    assert header == ["trial", "success", "gamma", "learning_rate"]
    assert sorted(tried) == sorted(product([0.9, 0.99], [1e-4, 1e-3]))
    successes = [float(row[1]) for row in rows]
    assert successes == sorted(successes, reverse=True)
    best_of = {row[0]: float(row[1]) for row in rows}
    assert best_of[best.name.removeprefix("trial-")] == max(successes)
    for number, row in ((row[0], row) for row in rows):
        record = json.loads((tmp_path / f"trial-{number}" / "seed-0" / CONFIG).read_text())
        assert (record["settings"]["gamma"], record["settings"]["learning_rate"]) == (float(row[2]), float(row[3]))
        assert record["runs"]["0"]["best"]["success"] == pytest.approx(float(row[1]), abs=1e-6)
    (played,) = evaluate(f"{best / 'seed-0'}/", "static", episodes=1)
    assert played.policy == f"{best / 'seed-0'}/"
    assert sweeps.sweep(settings, tmp_path, report=told.append) == best and len(told) == 2, "all is done"
    with pytest.raises(ValueError, match="is of another sweep: seeds was 1, is now 2"):
        sweeps.sweep(load_sweep(GRID | {"seeds": 2}), tmp_path)


def test_a_search_of_which_more_trials_are_asked_goes_on(tmp_path: Path) -> None:
    shorter = SHORT | {"n_timesteps": 256, "eval_freq": 256}
    search = {
        "training": "ppo_static",
        "overrides": shorter,
        "sampler": "tpe",
        "space": {"gamma": {"low": 0.9, "high": 0.99}},
    }
    told: list[str] = []
    sweeps.sweep(load_sweep(search | {"trials": 2}), tmp_path, report=told.append)
    first = (tmp_path / "trial-1" / "seed-0" / WEIGHTS).stat().st_mtime_ns
    best = sweeps.sweep(load_sweep(search | {"trials": 3}), tmp_path, report=told.append)
    assert [line.partition(":")[0] for line in told] == ["trial 0", "trial 1", "trial 2"] and best.is_dir()
    assert (tmp_path / "trial-1" / "seed-0" / WEIGHTS).stat().st_mtime_ns == first
    values = {
        tuple(trial.params.items()) for trial in optuna.load_study(study_name="sweep", storage=storage(tmp_path)).trials
    }
    assert len(values) == 3, "each tries something else"
    with pytest.raises(ValueError, match="holds more than is asked: trials was 3, is now 2"):
        sweeps.sweep(load_sweep(search | {"trials": 2}), tmp_path)


def storage(out: Path) -> str:
    """Where Optuna's tools find the study of a sweep."""
    return f"sqlite:///{out / sweeps.STUDY}"


@pytest.mark.parametrize("changed", ["training", "scenario"])
def test_trials_of_a_training_that_has_changed_since_are_not_gone_on_with(changed: str, tmp_path: Path) -> None:
    def written(name: str, data: dict[str, Any]) -> str:
        path = tmp_path / f"{name}.yaml"
        path.write_text(json.dumps(data), encoding="utf-8")
        return path.as_posix()

    scenario = {"name": "mine", "world": {"family": "field", "obstacles": 5}, "time": {"limit": 2.0}}
    learnt = {**SHORT, "algo": "ppo", "n_timesteps": 256, "scenarios": [written("scenario", scenario)]}
    grid = {"training": written("training", learnt), "space": {"gamma": [0.9, 0.99]}}
    best = sweeps.sweep(load_sweep(grid), tmp_path / "sweep")
    assert sweeps.sweep(load_sweep(grid), tmp_path / "sweep") == best, "all is done"
    if changed == "training":
        written("training", {**learnt, "gae_lambda": 0.5})
    else:
        written("scenario", {**scenario, "world": {"family": "field", "obstacles": 20}})
    told = {"training": "settings.gae_lambda was 0.95, is now 0.5", "scenario": "scenarios.0 has changed since"}
    with pytest.raises(ValueError, match=f"seed-0 is of another training: {told[changed]}"):
        sweeps.sweep(load_sweep(grid), tmp_path / "sweep")


@pytest.mark.parametrize("again", [1, 2])
def test_a_trial_that_was_cut_off_goes_on_with_its_other_seeds(
    again: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shorter = {"n_timesteps": 512, "n_steps": 16, "save_freq": 128, "eval_freq": 256}
    settings = load_sweep(GRID | {"overrides": SHORT | shorter, "space": {"gamma": [0.9, 0.99]}, "seeds": 2})
    whole = sweeps.sweep(settings, tmp_path / "whole")
    validate, saved = training.validate, tmp_path / "cut" / "trial-0" / "seed-1" / CHECKPOINT

    def cut_off(network: Any, trained: Any, steps: int, progress: Any, folder: Path) -> Any:
        if saved.exists():
            raise KeyboardInterrupt
        return validate(network, trained, steps, progress, folder)

    monkeypatch.setattr(training, "validate", cut_off)
    with pytest.raises(KeyboardInterrupt):
        sweeps.sweep(settings, tmp_path / "cut")
    monkeypatch.setattr(training, "validate", validate)
    done = tmp_path / "cut" / "trial-0" / "seed-0" / WEIGHTS
    made_at = done.stat().st_mtime_ns
    begun: list[tuple[str, bool]] = []
    real = sweeps._train_here

    def watched(job: Any) -> None:
        begun.append((str(job.folder.relative_to(tmp_path / "cut")), (job.folder / CHECKPOINT).exists()))
        real(job)

    monkeypatch.setattr(sweeps, "_train_here", watched)
    told: list[str] = []
    best = sweeps.sweep(settings, tmp_path / "cut", workers=again, report=told.append)
    assert best.name == whole.name and [line[:7] for line in told] == ["trial 0", "trial 1"]
    if again == 1:
        assert begun == [("trial-0/seed-1", True), ("trial-1/seed-0", False), ("trial-1/seed-1", False)]
    assert done.stat().st_mtime_ns == made_at
    assert (tmp_path / "cut" / sweeps.TABLE).read_text() == (tmp_path / "whole" / sweeps.TABLE).read_text()
    folders = ["trial-0/seed-0", "trial-0/seed-1", "trial-1/seed-0", "trial-1/seed-1"]
    for kind in ("whole", "cut"):
        found = sorted(tmp_path.glob(f"{kind}/trial-*/seed-*"))
        assert [str(path.relative_to(tmp_path / kind)) for path in found] == folders
        assert again == 2 or not list(tmp_path.glob(f"{kind}/**/{CHECKPOINT}"))
    for folder in folders:
        parts = (tmp_path / "whole" / folder / WEIGHTS, tmp_path / "cut" / folder / WEIGHTS)
        assert parts[0].read_bytes() == parts[1].read_bytes()


def test_a_trial_that_was_cut_off_begins_anew_where_its_checkpoint_is_no_use(tmp_path: Path) -> None:
    settings = load_settings("ppo_static", SHORT | {"n_timesteps": 256})
    (tmp_path / CHECKPOINT).write_bytes(b"of another torch")
    sweeps._train_here(Job(sweeps._train, settings, 0, tmp_path))
    assert (tmp_path / WEIGHTS).is_file() and not (tmp_path / sweeps.FAILED).exists()


def test_a_search_goes_on_with_what_it_drew_and_a_failure_is_not_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    space = {"gamma": {"low": 0.9, "high": 0.99}}
    settings = load_sweep(GRID | {"space": space, "sampler": "tpe", "trials": 2, "seeds": 2})
    tried: list[tuple[float, str, int]] = []

    def fake(trained: Any, out: Path, *, seed: int, **arguments: Any) -> None:
        tried.append((trained.gamma, Path(out).parent.name, seed))
        if len(tried) == 2:
            raise KeyboardInterrupt
        raise ValueError("no such world")

    monkeypatch.setattr(sweeps, "train", fake)
    with pytest.raises(KeyboardInterrupt):
        sweeps.sweep(settings, tmp_path)
    with pytest.raises(ValueError, match="no trial could be trained"):
        sweeps.sweep(settings, tmp_path)
    assert [one[1:] for one in tried] == [
        (f"trial-{trial}", seed) for trial, seed in [(0, 0), (0, 1), (0, 1), (1, 0), (1, 1)]
    ]
    assert len({one[0] for one in tried[:3]}) == 1 and tried[3][0] != tried[0][0]


DIVERGES = 1e8
"""A learning rate with which nothing is learnt but numbers that are none."""


@pytest.mark.parametrize("workers", [1, 2])
def test_a_trial_that_cannot_be_trained_is_told_and_the_others_are(workers: int, tmp_path: Path) -> None:
    overrides = {**SHORT, "batch_size": 64}
    settings = load_sweep(
        {"training": "ppo_static", "overrides": overrides, "space": {"learning_rate": [DIVERGES, 1e-3]}}
    )
    told: list[str] = []
    best = sweeps.sweep(settings, tmp_path, workers=workers, report=told.append)
    failed, sound = sorted(told, key=lambda line: "failed" not in line)
    assert (
        "failed with {'learning_rate': 100000000.0}: ValueError: 'ppo_static (ppo, seed 0) has diverged after "
        in failed
    )
    assert "\n" not in failed
    assert sound.startswith(f"{best.name.replace('-', ' ')}: ") and "{'learning_rate': 0.001}" in sound
    with (tmp_path / sweeps.TABLE).open() as file:
        assert [row[2] for row in csv.reader(file)] == ["learning_rate", "0.001"]
    assert sweeps.sweep(settings, tmp_path, workers=workers, report=told.append) == best and len(told) == 3, (
        "all is done"
    )
    assert "had failed before: {'learning_rate': 100000000.0}: ValueError: 'ppo_static (ppo, seed 0) has" in told[2]


@pytest.mark.parametrize(
    ("space", "bad", "said"),
    [
        ({"gamma": [0.9, 1.5, 0.99]}, 1.5, "gamma: got 1.5, expected at most 1"),
        ({"batch_size": [1, 32]}, 1, "batch_size: got 1, expected at least 2"),
    ],
)
def test_values_that_no_training_can_have_are_told_and_the_others_are_trained(
    space: dict[str, Any], bad: float, said: str, tmp_path: Path
) -> None:
    ((key, values),) = space.items()
    shorter = {"n_timesteps": 64, "n_envs": 2, "n_steps": 16, "batch_size": 32, "eval_episodes": 2, "test_episodes": 2}
    settings = load_sweep({"training": "ppo_static", "overrides": SHORT | shorter, "space": space})
    told: list[str] = []
    best = sweeps.sweep(settings, tmp_path, report=told.append)
    (failed,) = (line for line in told if "failed" in line)
    assert f"failed with {{'{key}': {bad}}}: ScenarioError: " in failed and said in failed and "\n" not in failed
    with (tmp_path / sweeps.TABLE).open() as file:
        tried = sorted(float(row[key]) for row in csv.DictReader(file))
    assert tried == sorted(value for value in values if value != bad)
    again: list[str] = []
    assert sweeps.sweep(settings, tmp_path, report=again.append) == best and len(again) == 1, "all is done"
    assert "had failed before" in again[0] and said in again[0]


@pytest.mark.parametrize("sampler", ["grid", "tpe"])
def test_values_that_had_failed_are_told_and_tried_again_where_their_folder_is_removed(
    sampler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where the disk was full, or a package was missing: the values were not at fault."""
    search: dict[str, Any] = {"sampler": "tpe", "trials": 3, "space": {"gamma": {"low": 0.9, "high": 0.99}}}
    settings = load_sweep(GRID | ({"space": {"gamma": [0.9, 0.95, 0.99]}} if sampler == "grid" else search))
    tried: list[float] = []

    def fake(trained: Any, out: Path, *, seed: int, **arguments: Any) -> None:
        tried.append(trained.gamma)
        if len(tried) in (1, 3, 4):
            raise ValueError("the machine was out of sorts")

    monkeypatch.setattr(sweeps, "train", fake)
    monkeypatch.setattr(sweeps, "_value", lambda *_: 0.5)
    sweeps.sweep(settings, tmp_path)
    told: list[str] = []
    sweeps.sweep(settings, tmp_path, report=told.append)
    assert len(tried) == 3 and len(told) == 1, "nothing is tried again by itself"
    assert told[0].startswith("trial 0, and 1 more had failed before: {'gamma': ")
    assert "the machine was out of sorts" in told[0] and f"; remove {tmp_path / 'trial-0'} to" in told[0]
    for number in (0, 2):
        shutil.rmtree(tmp_path / f"trial-{number}")
    told.clear()
    sweeps.sweep(settings, tmp_path, report=told.append)
    assert tried[3:] == [tried[0], tried[2]] and [line[:8] for line in told] == ["trial 3:", "trial 4:"]
    sweeps.sweep(settings, tmp_path, report=told.append)
    assert len(tried) == 5 and told[2].startswith("trial 3 had failed before"), "what has been tried again is done"


def test_a_sweep_that_goes_on_with_other_code_of_the_package_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = load_sweep(GRID)
    monkeypatch.setattr(sweeps, "_train", lambda *arguments, **named: None)
    values = iter((0.5, 0.6))
    monkeypatch.setattr(sweeps, "_value", lambda *_: next(values))
    monkeypatch.setattr(sweeps, "source_digest", lambda: "one text of the package")
    with pytest.raises(StopIteration):
        sweeps.sweep(settings, tmp_path)
    monkeypatch.setattr(sweeps, "_value", lambda *_: 0.7)
    monkeypatch.setattr(sweeps, "source_digest", lambda: "another text of it")
    told: list[str] = []
    sweeps.sweep(settings, tmp_path, report=told.append)
    assert told[0].startswith("trials 0, 1: trained by other code of bug_gym") and len(told) == 3


def test_a_sweep_is_refused_where_none_of_its_combinations_can_be_trained_with() -> None:
    bad_first = {"gamma": [1.5, 0.9], "learning_rate": [-1.0, 1e-3]}
    assert load_sweep(GRID | {"space": bad_first}).total == 4
    with pytest.raises(ScenarioError, match="gamma: got 1.5, expected at most 1"):
        load_sweep(GRID | {"space": bad_first | {"gamma": [1.5, 2.0]}})
    together = {"n_envs": [1], "n_steps": [1]}
    with pytest.raises(ScenarioError, match="n_steps: got 1 with n_envs 1"):
        load_sweep(GRID | {"space": together})
    assert load_sweep(GRID | {"space": together | {"n_steps": [1, 16]}}).total == 2
    endless = {"sampler": "tpe", "trials": 2, "space": {f"{key}_": list(range(9)) for key in SHORT}}
    with pytest.raises(ScenarioError, match="unknown key"):
        load_sweep(GRID | endless)


def test_a_study_that_can_no_longer_be_written_is_named_and_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on a full disk: SQLite may not lengthen its file."""
    settings = load_sweep(GRID | {"space": {"gamma": [0.9, 0.99]}})
    monkeypatch.setattr(sweeps, "_train", lambda *arguments, **named: None)

    def last_of_room(*_: Any) -> float:
        from sqlalchemy import Engine, event

        def full(connection: Any, cursor: Any, statement: str, *_: Any) -> tuple[str, tuple[()]]:
            return "no statement at all", ()

        event.listen(Engine, "before_cursor_execute", full, retval=True)
        monkeypatch.setattr(sweeps, "_value", lambda *_: 0.5)
        undoing.append(lambda: event.remove(Engine, "before_cursor_execute", full))
        return 0.5

    undoing: list[Callable[[], None]] = []
    monkeypatch.setattr(sweeps, "_value", last_of_room)
    try:
        with pytest.raises(OSError, match=r"study.db cannot be used: \(sqlite3.OperationalError\)"):
            sweeps.sweep(settings, tmp_path)
    finally:
        for undo in undoing:
            undo()
    told: list[str] = []
    sweeps.sweep(settings, tmp_path, report=told.append)
    assert [line[:8] for line in told] == ["trial 0:", "trial 1:"]


def test_a_sweep_of_which_nothing_can_be_trained_says_why(tmp_path: Path) -> None:
    settings = load_sweep({"training": "ppo_static", "overrides": SHORT, "space": {"learning_rate": [DIVERGES]}})
    for _ in range(2):
        with pytest.raises(
            ValueError, match=r"no trial could be trained; \{'learning_rate': 1.*\}: ValueError: .*"
        ) as error:
            sweeps.sweep(settings, tmp_path)
        assert "\n" not in str(error.value)


def test_a_search_keeps_to_its_ranges(tmp_path: Path) -> None:
    space = {
        "gamma": {"low": 0.9, "high": 0.99},
        "learning_rate": {"low": 1e-4, "high": 1e-2, "log": True},
        "n_steps": {"low": 16, "high": 32, "step": 16},
        "encoding": ["linear", "clearance"],
    }
    settings = load_sweep(GRID | {"space": space, "sampler": "tpe", "trials": 3, "seeds": 2})
    sweeps.sweep(settings, tmp_path, workers=2)
    with (tmp_path / sweeps.TABLE).open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3
    for row in rows:
        assert 0.9 <= float(row["gamma"]) <= 0.99 and 1e-4 <= float(row["learning_rate"]) <= 1e-2
        assert row["n_steps"] in ("16", "32") and row["encoding"] in ("linear", "clearance")
        runs = [
            json.loads((tmp_path / f"trial-{row['trial']}" / f"seed-{seed}" / CONFIG).read_text())["runs"][str(seed)]
            for seed in range(2)
        ]
        assert float(row["success"]) == pytest.approx(sum(run["best"]["success"] for run in runs) / 2, abs=1e-6)


def test_a_search_that_goes_on_does_not_draw_again_what_it_drew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[dict[str, Any]] = []

    def only_draw(settings: Any, out: Path, trials: Sequence[Any], workers: Any) -> None:
        for trial in trials:
            drawn.append({key: choices.suggested(trial, key) for key, choices in settings.space.items()})

    monkeypatch.setattr(sweeps, "_train_trials", only_draw)
    monkeypatch.setattr(sweeps, "_value", lambda *_: 0.5)
    space = {"gamma": {"low": 0.9, "high": 0.99}}
    for trials in (3, 6):
        settings = load_sweep(GRID | {"space": space, "sampler": "tpe", "trials": 6})
        monkeypatch.setattr(type(settings), "total", trials)
        sweeps.sweep(settings, tmp_path)
    assert len({values["gamma"] for values in drawn}) == 6


@pytest.mark.parametrize("name", sweep_names())
def test_the_sweeps_that_come_along_are_trainings(name: str) -> None:
    settings = load_sweep(name)
    assert settings.name == name and settings.total >= 2
    assert settings.trained_with({}).name


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"training": "ppo_statik"}, "did you mean 'ppo_static'"),
        ({"training": "bc_hd_bug", "overrides": {}}, "learns offline, expected one that learns in worlds"),
        ({"space": {}}, "space"),
        ({"space": {"gama": [0.9]}}, "gama"),
        ({"space": {"gamma": [2.0]}}, "gamma"),
        ({"space": {"gamma": []}}, "got no values of gamma"),
        ({"seeds": 10**9}, "got 4 trials of 1,000,000,000 seeds, 4,000,000,000 models, expected at most 10,000"),
        ({"sampler": "tpe", "trials": 10**9}, "trials: got 1,000,000,000 trials of"),
        ({"space": {"gamma": {"low": 0.9, "high": 0.99}}}, "expected a list of values in a grid"),
        ({"sampler": "tpe"}, "expected a number with sampler tpe"),
        ({"trials": 3}, "none with grid"),
        ({"sampler": "tpe", "trials": 3, "space": {"gamma": {"low": 0.9, "high": 0.5}}}, "expected more than low"),
        ({"sampler": "tpe", "trials": 3, "space": {"gamma": {"low": 0.0, "high": 0.5, "log": True}}}, "low above 0"),
    ],
)
def test_what_is_no_sweep_is_told_before_anything_is_trained(change: dict[str, Any], told: str) -> None:
    with pytest.raises(ScenarioError) as error:
        load_sweep(GRID | change)
    assert told in str(error.value) and "\n" not in str(error.value).strip()


@pytest.mark.parametrize(
    "spoil", [lambda path: path.write_bytes(b"no database" * 99), lambda path: path.symlink_to("a")]
)
def test_a_damaged_folder_of_a_sweep_is_told_in_one_line(spoil: Any, tmp_path: Path) -> None:
    spoil(tmp_path / sweeps.STUDY)
    with pytest.raises(ValueError, match=r"study\.db is damaged: |study\.db is a symbolic link") as error:
        sweeps.sweep(load_sweep(GRID), tmp_path)
    assert "\n" not in str(error.value)


def test_the_command_names_sweeps_and_extras(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sweep", "ppo_dynamik"]) == 2
    assert "no sweep 'ppo_dynamik', did you mean 'ppo_dynamic'?" in capsys.readouterr().err
    assert main(["list", "sweeps"]) == 0
    assert "ppo_dynamic " in capsys.readouterr().out
    monkeypatch.setitem(__import__("sys").modules, "optuna", None)
    assert main(["sweep", "ppo_dynamic", "--out", "nowhere"]) == 2
    assert "a sweep needs optuna, of the extra `sweep`" in capsys.readouterr().err
    assert not Path("nowhere").exists()


def test_the_command_says_how_its_best_is_played_as_a_shell_reads_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    best = tmp_path / "my sweep" / "trial-0"
    monkeypatch.setattr(sweeps, "sweep", lambda *_, **__: best)
    assert main(["sweep", "ppo_dynamic", "--out", str(best.parent)]) == 0
    words = shlex.split(capsys.readouterr().out.partition("play it with ")[2].partition(";")[0])
    assert words == ["--policies", f"{best / 'seed-0'}/"]


def test_a_line_about_a_trial_stays_one_line_and_loses_no_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    line = f"trial 0: failed with {{'start_from': '[b]/model'}}: got {'7' * 200}, expected [x, y, yaw]"

    def one_trial(*_: Any, report: Callable[[str], None], **__: Any) -> Path:
        report(line)
        return tmp_path / "trial-0"

    monkeypatch.setattr(sweeps, "sweep", one_trial)
    assert main(["sweep", "ppo_dynamic", "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().err == f"{line}\n"


def test_a_training_that_fails_before_it_has_a_folder_says_why_in_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*arguments: Any, **named: Any) -> None:
        raise ValueError("no such start")

    monkeypatch.setattr(sweeps, "train", fails)
    sweeps._train(load_settings("ppo_mixed"), str(tmp_path / "trial-0" / "seed-0"), seed=0)
    told = (tmp_path / "trial-0" / "seed-0" / sweeps.FAILED).read_text()
    assert told.startswith("ValueError: ")
    assert "no such start" in told
