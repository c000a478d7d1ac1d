"""How a training shows itself, and what is left of one that is stopped."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from signals import as_from_a_terminal

torch = pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")
pytest.importorskip("onnx")

from bug_gym.agents import make_policy  # noqa: E402  torch may be missing
from bug_gym.agents.learning import so_far, training  # noqa: E402  torch may be missing
from bug_gym.agents.learning.folder import Point, best_so_far, checksums, model_folder, read_config  # noqa: E402  the same
from bug_gym.agents.learning.settings import AnySettings, load_settings  # noqa: E402  the same
from bug_gym.agents.learning.shown import (  # noqa: E402  the same
    LINE_EACH,
    TESTING,
    VALIDATING,
    WRITING,
    LineReport,
    Report,
    told_time,
)
from bug_gym.agents.learning.training import train  # noqa: E402  the same
from bug_gym.cli import main  # noqa: E402  the same
from bug_gym.navigation_env import NavigationEnv  # noqa: E402  the same

ROOT = Path(__file__).resolve().parents[3]
TINY: dict[str, Any] = {
    "name": "tiny",
    "algo": "ppo",
    "scenarios": ["dynamic"],
    "n_envs": 8,
    "n_steps": 16,
    "batch_size": 32,
    "n_epochs": 2,
    "n_timesteps": 512,
    "eval_freq": 200,
    "eval_episodes": 4,
    "test_episodes": 4,
    "save_freq": 128,
    "overrides": {"time.limit": 3.0},
}


def tiny(**changes: Any) -> AnySettings:
    return load_settings({**TINY, **changes})


def point(steps: int, success: float) -> Point:
    return Point(steps, 1.0, 1.0, success, 1.0 - success, 0.0, None)


# ---------------------------------------------------------------------------------------------- what is told


class Told(Report):
    """Keeps what it is told."""

    def __init__(self, settings: AnySettings) -> None:
        super().__init__(settings)
        self.places: list[float] = []
        self.stages: list[str] = []

    def _show(self, *, is_stage: bool) -> None:
        if is_stage:
            self.stages.append(self.doing)
        else:
            self.places.append(self.done)


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[Told]:
    """What trainings tell."""
    found: list[Told] = []

    def reported(settings: AnySettings, *, shown: bool) -> Any:
        found.append(Told(settings))
        return nullcontext(found[-1])

    monkeypatch.setattr(training, "reported", reported)
    return found


def test_it_moves_through_driving_and_updates_and_never_back(told: list[Told], tmp_path: Path) -> None:
    train(tiny(), tmp_path, threads=1, tensorboard=False)
    places = told[0].places
    assert places[0] == 0 and places[-1] == 512 and (np.diff(places) >= 0).all()
    # A rollout of 128 steps is 16 steps of 8 worlds, and 2 rounds of 4 batches: each half of the way.
    assert {place for place in places if place <= 128} == {*range(0, 65, 4), *range(64, 129, 8)}
    assert told[0].stages[-2:] == [TESTING, WRITING] and told[0].stages.count(VALIDATING) == 2


def test_it_moves_with_each_step_of_an_algorithm_that_learns_meanwhile(told: list[Told], tmp_path: Path) -> None:
    settings = load_settings(
        {
            **{key: value for key, value in TINY.items() if key not in ("n_steps", "n_epochs", "save_freq")},
            **{"algo": "dqn", "learning_starts": 64, "n_timesteps": 160},
        }
    )
    train(settings, tmp_path, threads=1, tensorboard=False)
    assert {*range(8, 161, 8)} <= set(told[0].places) and max(told[0].places) == 160


def lines_of(steps: Callable[[LineReport, Callable[[float], None]], None]) -> list[str]:
    """The lines that somebody sees who has no terminal."""
    now, lines = [100.0], list[str]()

    def wait(seconds: float) -> None:
        now[0] += seconds

    steps(LineReport(tiny(n_timesteps=100_000), lines.append, clock=lambda: now[0]), wait)
    return lines


def test_a_line_says_how_far_how_fast_and_how_long() -> None:
    def steps(report: LineReport, wait: Callable[[float], None]) -> None:
        report(20_000, None)  # it goes on from there
        wait(20.0)
        report(40_000, point(32_768, 0.5))

    first, second = lines_of(steps)
    assert first == "tiny: 20,000 of 100,000 steps"
    assert second == "tiny: 40,000 of 100,000 steps, 1,000 a second, 1 min 0 s left, 50.0 % success at 32,768"


def test_a_rollout_that_is_driven_to_its_end_is_not_a_share_of_what_was_asked() -> None:
    def steps(report: LineReport, wait: Callable[[float], None]) -> None:
        report(90_000, None)
        wait(10.0)
        report(106_496, None)

    assert lines_of(steps)[1] == "tiny: 106,496 steps, 100,000 asked, 1,650 a second"


def test_a_line_comes_each_few_seconds_and_for_the_test_at_once() -> None:
    def steps(report: LineReport, wait: Callable[[float], None]) -> None:
        for number in range(1000):
            report(float(number), None)
            wait(0.1)
        report.stage(VALIDATING)
        report.stage(TESTING)

    lines = lines_of(steps)
    assert len(lines) == pytest.approx(100.0 / LINE_EACH + 2, abs=1)
    assert lines[-1].endswith(TESTING)


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.2, "0 s"), (59.6, "1 min 0 s"), (307.0, "5 min 7 s"), (12_000.0, "3 h 20 min")]
)
def test_times_are_told_in_their_two_largest_units(seconds: float, text: str) -> None:
    assert told_time(seconds) == text


# ---------------------------------------------------------------------------------------------- what is left


def require_playable(folder: Path) -> None:
    """Whether a model is whole, and drives."""
    config = read_config(folder)
    assert config["sha256"] == checksums(folder, config["sha256"])
    env = NavigationEnv("dynamic", TINY["overrides"])
    observation, _ = env.reset(seed=0)
    action, _ = make_policy(f"{folder}/", env).predict(observation)
    assert action in env.action_space


def started(out: Path, **changes: Any) -> subprocess.Popen[bytes]:
    """A training in a process of its own."""
    script = (
        "import sys\nfrom bug_gym.agents.learning.training import train\n"
        "from bug_gym.agents.learning.settings import load_settings\n"
        "train(load_settings(eval(sys.argv[1])), sys.argv[2], threads=1, tensorboard=False, progress=True)"
    )
    command = [sys.executable, "-c", script, repr({**TINY, "n_timesteps": 10**7, **changes}), str(out)]
    return subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, preexec_fn=as_from_a_terminal)


@pytest.mark.parametrize("with_what", [signal.SIGKILL, signal.SIGINT])
def test_the_best_model_of_a_training_that_is_stopped_can_be_played(
    with_what: signal.Signals, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    process = started(tmp_path)
    deadline = time.monotonic() + 120.0
    while best_so_far(tmp_path) is None and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(process.pid, with_what)
    _, said = process.communicate(timeout=60)
    assert b"tiny: 0 of 10,000,000 steps\n" in said
    best = best_so_far(tmp_path)
    assert best is not None
    require_playable(best)
    assert read_config(best)["runs"]["0"]["held_out"] == {}
    assert "not yet judged in held-out worlds" in (best / "card.md").read_text(encoding="utf-8")
    assert main(["evaluate", "--scenario", "dynamic", "--episodes", "1", "--policies", f"{tmp_path}/"]) == 2
    assert f"its training has not ended, its best model so far is {best}/" in capsys.readouterr().err


def test_what_is_left_has_the_weights_that_did_best(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept: list[tuple[int, dict[str, Any]]] = []

    class Watched(so_far.BestSoFar):
        def keep(self, network: Any, progress: Any, *, is_end: bool = False) -> None:
            super().keep(network, progress, is_end=is_end)
            kept.append((progress.best_point.steps, {name: value.clone() for name, value in progress.best.items()}))
            if len(kept) == 2 and not is_end:
                raise KeyboardInterrupt

    monkeypatch.setattr(training, "BestSoFar", Watched)
    with pytest.raises(KeyboardInterrupt):
        train(tiny(), tmp_path, threads=1, tensorboard=False)
    (folder,) = tmp_path.glob("best-*")
    steps, weights = kept[-1]
    assert folder.name == f"best-{steps}"
    from safetensors.torch import load_file

    written = load_file(folder / "policy.safetensors")
    assert all(torch.equal(written[name], weights[name]) for name in weights)


def test_a_training_that_is_stopped_amid_an_update_leaves_its_best(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(self: training.ProgressKeeper) -> None:
        if self.progress.points:
            raise KeyboardInterrupt

    monkeypatch.setattr(so_far, "WRITE_EACH", float("inf"))  # none is written before
    monkeypatch.setattr(training.ProgressKeeper, "_on_batch", stop)
    with pytest.raises(KeyboardInterrupt):
        train(tiny(), tmp_path, threads=1, tensorboard=False)
    best = best_so_far(tmp_path)
    assert best is not None
    require_playable(best)


def test_nothing_is_left_beside_the_model_in_the_end_and_what_others_put_there_stays(tmp_path: Path) -> None:
    (tmp_path / "best-3").mkdir()
    (tmp_path / "best-of-all").mkdir()
    train(tiny(n_timesteps=256), tmp_path, threads=1, tensorboard=False)
    assert sorted(path.name for path in tmp_path.glob("best-*")) == ["best-3", "best-of-all"]
    assert read_config(tmp_path)["runs"]["0"]["held_out"]
    assert "not yet judged" not in (tmp_path / "card.md").read_text(encoding="utf-8")


def test_another_training_does_not_go_over_what_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(*arguments: Any, **keywords: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(training, "write_best", stopped)
    settings = tiny(n_timesteps=256)
    with pytest.raises(KeyboardInterrupt):
        train(settings, tmp_path, threads=1, tensorboard=False)
    assert best_so_far(tmp_path) is not None
    (tmp_path / "checkpoint.pt").unlink()
    with pytest.raises(ValueError, match=r"best-\d+ is of another training: settings.gamma"):
        train(tiny(n_timesteps=256, gamma=0.5), tmp_path, threads=1, tensorboard=False)
    assert model_folder(tmp_path) == tmp_path and best_so_far(tmp_path) is not None


class Drove:
    """Validation worlds of which a share was solved."""

    def __init__(self, success: float) -> None:
        self.success, self.time = success, np.ones(100)

    def ended(self, name: str) -> Any:
        share = {"success": self.success, "collision": 1.0 - self.success}.get(name, 0.0)
        return np.arange(100) < round(100 * share)

    def summary(self) -> dict[str, Any]:
        shares = {"success": self.success, "collision": 1.0 - self.success, "timeout": 0.0}
        return {"n": 100, "low": 0.0, "high": 1.0, "time": 1.0, **shares}


def begins_again(**changes: Any) -> AnySettings:
    """Settings of a training that has no checkpoints, which validates each 32 steps."""
    own = {key: value for key, value in TINY.items() if key not in ("n_steps", "n_epochs", "save_freq")}
    short = {"algo": "dqn", "n_envs": 4, "learning_starts": 8, "batch_size": 8, "n_timesteps": 192, "eval_freq": 32}
    return load_settings({**own, **short, **changes})


def stop_after(monkeypatch: pytest.MonkeyPatch, *shares: float) -> None:
    """Let the validations of a training have these shares of successes, and stop it at the next."""
    left = list(shares)

    def validated(*_: Any) -> list[Drove]:
        if not left:
            raise KeyboardInterrupt
        return [Drove(left.pop(0))]

    monkeypatch.setattr(training, "play_validation", validated)


@pytest.fixture
def driven(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Trains in a folder so that the validations have these shares of successes, and is stopped at the next."""
    monkeypatch.setattr(so_far, "WRITE_EACH", 0.0)

    def run(folder: Path, *shares: float, settings: AnySettings | None = None) -> None:
        stop_after(monkeypatch, *shares)
        monkeypatch.setattr(training, "play", lambda *_: Drove(0.5))
        with suppress(KeyboardInterrupt):
            train(settings or begins_again(), folder, threads=1, tensorboard=False)

    return run


def files_in(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_training_that_begins_again_keeps_a_better_model_and_the_curve_of_the_run_before(
    tmp_path: Path, driven: Callable[..., None]
) -> None:
    driven(tmp_path, 0.1, 0.3, 0.8, 0.7)
    left, curve = tmp_path / "best-96", (tmp_path / "curve.csv").read_bytes()
    before = files_in(left)
    driven(tmp_path, 0.1, 0.3)
    assert [path.name for path in tmp_path.glob("best-*")] == ["best-96"] and files_in(left) == before
    assert (tmp_path / "curve-128.csv").read_bytes() == curve
    assert len((tmp_path / "curve.csv").read_text(encoding="utf-8").splitlines()) == 3
    driven(tmp_path, 0.9)  # which is better
    assert [path.name for path in tmp_path.glob("best-*")] == ["best-32"]
    assert sorted(path.name for path in tmp_path.glob("curve-*")) == ["curve-128.csv", "curve-64.csv"]


def test_a_better_model_of_an_earlier_run_outlives_the_end_of_a_later_one(
    tmp_path: Path, driven: Callable[..., None], caplog: pytest.LogCaptureFixture
) -> None:
    driven(tmp_path, 0.1, 0.8)
    before = files_in(tmp_path / "best-64")
    driven(tmp_path, *[0.5] * 6)
    assert read_config(tmp_path)["runs"]["0"]["best"]["success"] == 0.5
    assert [path.name for path in tmp_path.glob("best-*")] == ["best-64"] and files_in(tmp_path / "best-64") == before
    assert f"{tmp_path}/best-64 of an earlier run did better in its validation" in caplog.text


@pytest.mark.parametrize("later", [0.5, 0.8, 0.9])
def test_a_model_that_minutes_ended_outlives_a_run_that_goes_on_and_does_worse(
    later: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    settings = tiny(save_freq=128, eval_freq=256, n_timesteps=1024)
    monkeypatch.setattr(training, "play", lambda *_: Drove(0.5))
    stop_after(monkeypatch, 0.8)
    train(settings, tmp_path, threads=1, tensorboard=False, minutes=1e-9)
    ended = read_config(tmp_path)["runs"]["0"]["best"]
    assert ended["success"] == 0.8 and not list(tmp_path.glob("best-*"))
    before = {name: (tmp_path / name).read_bytes() for name in ("policy.onnx", "policy.safetensors", "config.json")}
    stop_after(monkeypatch, *[later] * 4)
    train(settings, tmp_path, threads=1, tensorboard=False)
    assert read_config(tmp_path)["runs"]["0"]["best"]["success"] == later
    left = [tmp_path / f"best-{ended['steps']}"] if later < 0.8 else []
    assert list(tmp_path.glob("best-*")) == left and not (tmp_path / ".best.partial").exists()
    for path in left:
        assert before.items() <= files_in(path).items() and "Ended by --minutes" in (path / "card.md").read_text()
        assert f"{path} of an earlier run did better in its validation" in caplog.text


def test_a_model_that_did_as_well_is_replaced_by_a_run_that_begins_again_and_kept_by_one_that_goes_on(
    tmp_path: Path, driven: Callable[..., None]
) -> None:
    driven(tmp_path / "again", 0.5)
    written = (tmp_path / "again" / "best-32" / "config.json").stat().st_ino
    driven(tmp_path / "again", 0.5)
    assert (tmp_path / "again" / "best-32" / "config.json").stat().st_ino != written
    assert [path.name for path in (tmp_path / "again").glob("best-*")] == ["best-32"]
    ppo = tiny(save_freq=640, eval_freq=256, n_timesteps=4096)
    driven(tmp_path / "on", 0.1, 0.2, 0.5, settings=ppo)
    before = files_in(tmp_path / "on" / "best-768")
    driven(tmp_path / "on", settings=ppo)  # from 640 on, where the best was that of 512
    driven(tmp_path / "on", 0.5, settings=ppo)
    assert files_in(tmp_path / "on" / "best-768") == before
    assert not list((tmp_path / "on").glob("curve-*"))


def test_tensorboard_shows_nothing_twice_of_a_training_that_goes_on_or_begins_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")

    def shown() -> list[int]:
        found = events.EventAccumulator(str(tmp_path / "tensorboard"))
        found.Reload()
        return [event.step for event in found.Scalars("train/loss")]

    # It writes each 16 rollouts, here 512 steps.
    settings = tiny(n_steps=4, n_timesteps=1536, save_freq=640, eval_freq=1100)
    monkeypatch.setattr(training, "play", lambda *_: Drove(0.5))

    def stopped() -> None:
        stop_after(monkeypatch)
        with pytest.raises(KeyboardInterrupt):
            train(settings, tmp_path, threads=1)

    stopped()
    assert shown() == [512, 1024]
    (tmp_path / "checkpoint.pt").unlink()
    stopped()
    assert shown() == [512, 1024]
    stop_after(monkeypatch, 0.5, 0.5)
    train(settings, tmp_path, threads=1)  # from 640 on
    assert shown() == [512, 1152]


def test_who_stops_a_training_is_told_what_the_same_command_will_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(so_far, "WRITE_EACH", 0.0)
    path = tmp_path / "training.yaml"

    def told(folder: str, settings: AnySettings, *shares: float, options: tuple[str, ...] = ()) -> str:
        stop_after(monkeypatch, *shares)
        path.write_text(settings.model_dump_json(), encoding="utf-8")
        assert main(["train", str(path), "--threads", "1", "--out", str(tmp_path / folder), *options]) == 130
        return capsys.readouterr().err.splitlines()[-1].removeprefix("bug-gym: interrupted")

    out = tmp_path / "dqn"
    assert told("dqn", begins_again(), 0.1, 0.8, 0.2) == (
        f"; the same command begins again; the best so far is in {out}/best-64/"
    )
    assert told("none", begins_again()) == "; the same command begins again"
    several = told("several", begins_again(), *[0.5] * 8, options=("--seeds", "3"))
    out = tmp_path / "several"
    assert several == (
        f"; {out} keeps the seeds that are done, the same command begins seed 1 again; "
        f"the best so far is in {out}/seed-1/best-64/"
    )
    goes_on = tiny(save_freq=128, eval_freq=256, n_timesteps=4096)
    assert told("ppo", goes_on, 0.5) == f"; {tmp_path}/ppo keeps what is done, the same command goes on"


def test_of_two_models_that_a_kill_has_left_the_better_one_is_named(
    tmp_path: Path, driven: Callable[..., None]
) -> None:
    driven(tmp_path, 0.8)
    driven(tmp_path / "other", 0.1, 0.2)
    (tmp_path / "other" / "best-64").rename(tmp_path / "best-64")
    assert best_so_far(tmp_path) == tmp_path / "best-32"


def test_of_two_that_a_kill_has_left_the_later_one_is_named(tmp_path: Path) -> None:
    for steps in 900, 1000:
        (tmp_path / f"best-{steps}").mkdir()
        (tmp_path / f"best-{steps}" / "config.json").touch()
    assert best_so_far(tmp_path) == tmp_path / "best-1000"
