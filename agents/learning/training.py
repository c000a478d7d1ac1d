"""Training with stable-baselines3: settings in, a folder with the best model and all that made it out.

The trained worlds, those of validation and those of evaluations are apart (bug_gym.held_out). A PPO training that was
killed goes on from its last checkpoint, at the border of a rollout, and ends with the same model bit for bit.
"""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import DQN, PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import KVWriter, Logger
from stable_baselines3.common.policies import BasePolicy

from bug_gym.agents.learning.checkpoints import (
    CHECKPOINT,
    LIBRARIES,
    Rollouts,
    load_checkpoint,
    restore,
    save_checkpoint,
)
from bug_gym.agents.learning.curriculum import rows_of_stage
from bug_gym.agents.learning.diverging import require_finite, told_when_diverged
from bug_gym.agents.learning.elsewhere import Job, train_each
from bug_gym.agents.learning.folder import (
    CONFIG,
    WEIGHTS,
    Entered,
    Point,
    best_so_far,
    model_folder,
    models_so_far,
    read_config,
)
from bug_gym.agents.learning.history import with_history
from bug_gym.agents.learning.models import gather, load_weights, write_agent
from bug_gym.agents.learning.networks import RobotEncoding
from bug_gym.agents.learning.progress import CURVE, Events, Progress, write_curve
from bug_gym.agents.learning.robot_model import RobotModel
from bug_gym.agents.learning.settings import (
    ALGORITHMS,
    AnySettings,
    DQNSettings,
    OfflineSettings,
    OffPolicySettings,
    PPOSettings,
    SACSettings,
    Settings,
    load_settings,
)
from bug_gym.agents.learning.shown import SAVING, TESTING, VALIDATING, WRITING, Report, reported
from bug_gym.agents.learning.so_far import BestSoFar, keep_earlier_curve
from bug_gym.agents.learning.vec_envs import CurriculumVecEnv, FlatEnv, HistoryVecEnv, TrainingEnv, join
from bug_gym.checks import checked_count, checked_seed, checked_time, shortened
from bug_gym.config import Scenario
from bug_gym.files import one_writer, out_path
from bug_gym.held_out import ENDS, TEST_SEEDS, TRAINING_SEEDS, VALIDATION_SEEDS, Played, play
from bug_gym.limits import MOST_EPISODES, MOST_TRAININGS, MOST_WORKERS
from bug_gym.log import warn_once
from bug_gym.references import source_digest
from bug_gym.view import Sensors
from bug_gym.workers import Workers, are_several

SEED_BLOCK = 2**20
"""Seeds of one training's worlds."""


# ---------------------------------------------------------------------------------------------------------------------
# The parts of a training
# ---------------------------------------------------------------------------------------------------------------------


def first_world(seed: int) -> int:
    """Seed of the first of a training's worlds, of which it has SEED_BLOCK.

    Raises:
        ValueError: some of them are no seeds, or those of worlds that models are chosen by.
    """
    first = TRAINING_SEEDS + checked_seed(seed) * SEED_BLOCK
    if first + SEED_BLOCK > 2**63:
        raise ValueError(f"a training's seed is at most {(2**63 - TRAINING_SEEDS) // SEED_BLOCK - 1}, got {seed}")
    if first < VALIDATION_SEEDS + MOST_EPISODES and first + SEED_BLOCK > VALIDATION_SEEDS:
        raise ValueError(f"seed {seed}: the worlds of its training would be those of validations, give another one")
    return first


def robot_of(scenarios: Sequence[Scenario]) -> RobotModel:
    """The robot that all scenarios share.

    Raises:
        ValueError: their robots differ.
    """
    first, *others = [RobotModel.of(Sensors.of(scenario)) for scenario in scenarios]
    for scenario, other in zip(scenarios[1:], others, strict=True):
        if differences := list(first.differences(other)):
            raise ValueError(f"{scenario.name} has another robot than {scenarios[0].name}: {', '.join(differences)}")
    return first


def curriculum_of(env: TrainingEnv) -> CurriculumVecEnv | None:
    """The env of a training that goes by stages; None: there are none."""
    inner = env.inner if isinstance(env, HistoryVecEnv) else env
    return inner if isinstance(inner, CurriculumVecEnv) else None


def make_training_env(settings: AnySettings, seed: int) -> TrainingEnv:
    """The worlds of a training, seeded.

    Raises:
        ValueError: fewer worlds than scenarios, or scenarios with different robots.
    """
    scenarios = settings.loaded
    joined: FlatEnv
    if isinstance(settings, PPOSettings) and settings.curriculum:
        stages = settings.stages
        robot = robot_of([*scenarios, *(scenario for stage in stages for scenario in stage)])
        numbers = range(len(stages))
        shared = [rows_of_stage(settings.curriculum, stages, number, settings.n_envs) for number in numbers]
        joined = CurriculumVecEnv(shared, settings.action)
    else:
        robot = robot_of(scenarios)
        joined = join(scenarios, settings.n_envs, settings.action)
    env = HistoryVecEnv(joined, robot, settings.history) if settings.history else joined
    env.seed(first_world(seed))
    return env


def network_arguments(settings: AnySettings) -> dict[str, Any]:
    """What stable-baselines3 makes the network of a policy of."""
    kwargs = settings.policy_kwargs
    return {
        "features_extractor_class": RobotEncoding,
        "features_extractor_kwargs": {
            "robot": robot_of(settings.loaded).as_dict(),
            "lags": settings.history,
            "linear": settings.encoding == "linear",
        },
        "net_arch": list(kwargs.net_arch),
        "activation_fn": {"relu": partial(torch.nn.ReLU, inplace=True), "tanh": torch.nn.Tanh}[kwargs.activation_fn],
    }


def make_model(settings: AnySettings, env: TrainingEnv, seed: int) -> BaseAlgorithm:
    """An untrained model of stable-baselines3."""
    policy_kwargs = network_arguments(settings)
    same: dict[str, Any] = {
        "policy": settings.policy,
        "env": env,
        "learning_rate": settings.rate,
        "gamma": settings.gamma,
        "batch_size": settings.batch_size,
        "seed": seed,
        "device": "cpu",
    }
    model: BaseAlgorithm
    if isinstance(settings, PPOSettings):
        policy_kwargs["log_std_init"] = settings.policy_kwargs.log_std_init
        own = ("n_steps", "n_epochs", "gae_lambda", "clip_range", "ent_coef", "vf_coef", "max_grad_norm")
        model = PPO(
            **same,
            **{name: getattr(settings, name) for name in own},
            policy_kwargs=policy_kwargs,
            rollout_buffer_class=Rollouts,
            rollout_buffer_kwargs={"seed": seed},
        )
    elif isinstance(settings, OffPolicySettings):
        model = _off_policy_model(settings, {**same, "policy_kwargs": policy_kwargs})
    else:
        raise ValueError(f"{settings.algo} is no algorithm of stable-baselines3: it learns offline")
    env.seed(first_world(seed))  # SB3 has just seeded it as it seeds itself
    return model


def _off_policy_model(settings: SACSettings | DQNSettings, same: Mapping[str, Any]) -> BaseAlgorithm:
    shared = [name for name in OffPolicySettings.model_fields if name in OffPolicySettings.__annotations__]
    own = {name: getattr(settings, name) for name in [*shared, *type(settings).__annotations__]}
    for name in ("n_envs", "algo", "action"):
        own.pop(name, None)
    kind: type[SAC] | type[DQN] = SAC if isinstance(settings, SACSettings) else DQN
    return kind(**{**own, **same})


def rebuild(model: str | Path, *, trust: bool = False) -> BaseAlgorithm:
    """A trained model of ours in SB3, with an env of its own, to train on.

    Args:
        model: name or folder.
        trust: whether code that its scenarios name may be imported.

    Raises:
        ValueError: its files are missing or damaged.
    """
    folder = model_folder(model)
    config = read_config(folder)
    settings = load_settings(config["settings"], trust=trust)
    if isinstance(settings, OfflineSettings):
        raise ValueError(f"{folder} was trained offline: begin a training of its own with it (--start-from)")
    made = make_model(settings, make_training_env(settings, config["seed"]), config["seed"])
    load_weights(folder / WEIGHTS, made.policy, config["sha256"][WEIGHTS])
    return made


class InTraining:
    """A model in training as a policy: flat observations, and a History where it has one."""

    def __init__(self, model: BaseAlgorithm | BasePolicy, robot: RobotModel, lags: Sequence[int]) -> None:
        self.model, self.robot, self.lags = model, robot, lags

    def predict(
        self,
        observation: Any,
        state: tuple[Any, ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], tuple[Any, ...] | None]:
        """Actions (n, ...) for flat observations (n, D); state is (History,) where there is one."""
        observation, state = with_history(observation, state, episode_start, robot=self.robot, lags=self.lags)
        actions, _ = self.model.predict(observation, deterministic=deterministic)
        return actions, state


# ---------------------------------------------------------------------------------------------------------------------
# While it runs
# ---------------------------------------------------------------------------------------------------------------------


class ProgressKeeper(BaseCallback):
    """Validates, keeps the best model, saves checkpoints, and watches the clock; all at the borders of rollouts.

    Args:
        settings: of the training.
        progress: of an earlier run of it, or a new one.
        folder: where the curve and checkpoints go.
        env: its worlds.
        save: writes a checkpoint; None where the algorithm cannot go on from one.
        minutes: time of training after which it ends early; None: it does not.
        report: told the number of steps, the last validation, and what is done beside.
        best: writes the best model so far.
    """

    def __init__(
        self,
        settings: AnySettings,
        progress: Progress,
        folder: Path,
        *,
        env: TrainingEnv,
        save: Callable[[], None] | None,
        minutes: float | None,
        report: Report,
        best: BestSoFar,
    ) -> None:
        super().__init__()
        self.settings, self.progress, self.folder, self.env, self._best = settings, progress, folder, env, best
        self._save, self._limit, self._report = save, None if minutes is None else 60.0 * minutes, report
        self._began = self._began_cpu = 0.0
        self._saved_at = -1
        self._learnt = self._batches = 0
        self.is_over = False
        """Whether it has ended the training early, at a checkpoint."""

    def _on_training_start(self) -> None:
        self._saved_at = self._learnt = self.num_timesteps
        if isinstance(self.model, PPO):
            assert isinstance(self.model.rollout_buffer, Rollouts)
            self.model.rollout_buffer.on_batch = self._on_batch
        self._start_clock()

    def _start_clock(self) -> None:
        self._began, self._began_cpu = time.perf_counter(), time.process_time()

    def _stop_clock(self) -> None:
        self.progress.seconds += time.perf_counter() - self._began
        self.progress.cpu_seconds += time.process_time() - self._began_cpu

    def _on_rollout_start(self) -> None:
        # The callback's own count is that of the last step: it lags behind where a training goes on.
        self.num_timesteps = self.model.num_timesteps
        self._stop_clock()
        steps, done = self.num_timesteps, self.progress.points
        if steps >= self.settings.eval_freq + (done[-1].steps if done else 0):
            self.validate()
            self.go_on_to_next_stage()
        self.is_over = self._limit is not None and self.progress.seconds >= self._limit
        if self._save is not None and (self.is_over or steps >= self._saved_at + self.settings.save_freq):
            self._report.stage(SAVING)
            self._save()
            self._saved_at = steps
        self._learnt, self._batches = steps, 0
        self._tell(steps)
        self._start_clock()

    def _on_step(self) -> bool:
        self._tell(0.5 * (self.num_timesteps + self._learnt) if isinstance(self.model, PPO) else self.num_timesteps)
        return not self.is_over

    def _on_batch(self) -> None:
        """PPO has taken a gradient step: what was driven is learnt from in equal parts."""
        assert isinstance(self.settings, PPOSettings)
        driven = self.num_timesteps - self._learnt
        self._batches += 1
        share = self._batches / (self.settings.n_epochs * math.ceil(driven / self.settings.batch_size))
        self._tell(self._learnt + 0.5 * driven * (1.0 + share))

    def _tell(self, done: float) -> None:
        self._report(done, self.progress.points[-1] if self.progress.points else None)

    def _on_training_end(self) -> None:
        self._stop_clock()
        if not self.progress.points or self.progress.points[-1].steps < self.num_timesteps:
            self.validate()
        self._tell(self.num_timesteps)

    def go_on_to_next_stage(self) -> None:
        """Begin the next stage of a curriculum, where enough of the validation worlds of this one are solved."""
        worlds, settings = curriculum_of(self.env), self.settings
        if worlds is None or not isinstance(settings, PPOSettings):
            return
        wanted = settings.curriculum[worlds.stage].success
        if wanted is None:
            return
        scenarios = settings.stages[worlds.stage]
        runs = play_validation(self.model.policy, settings, scenarios)
        success = round(float(np.mean([run.ended("success").mean() for run in runs])), 6)
        self.logger.record("validation/stage", worlds.stage)
        self.logger.record("validation/stage_success", success)
        if success >= wanted:
            worlds.enter(worlds.stage + 1)
            self.progress.entered.append(Entered(stage=worlds.stage, steps=self.num_timesteps, success=success))
            # The rollout that begins now has yet to look at these.
            model = self.model
            assert isinstance(model, PPO)
            model._last_obs = self.env.reset()
            model._last_episode_starts = np.ones(self.env.num_envs, dtype=bool)

    def validate(self) -> None:
        """Drive through the validation worlds, and keep the model if none did better so far."""
        self._report.stage(VALIDATING)
        point = validate(self.model.policy, self.settings, self.num_timesteps, self.progress, self.folder)
        for name in ENDS:
            self.logger.record(f"validation/{name}", getattr(point, name))
        self._best.keep(self.model.policy, self.progress)


def validate(network: BasePolicy, settings: AnySettings, steps: int, progress: Progress, folder: Path) -> Point:
    """Drive through the validation worlds, and keep the network's weights if none did better so far.

    Args:
        network: of the model in training.
        settings: of the training.
        steps: how far it is.
        progress: what is known of it, which is added to.
        folder: where the curve goes.

    Raises:
        NotFiniteError: the network has weights that are no numbers.
    """
    require_finite(network)
    runs = play_validation(network, settings, settings.loaded)
    shares = {name: round(float(np.mean([run.ended(name).mean() for run in runs])), 6) for name in ENDS}
    times = np.concatenate([run.time[run.ended("success")] for run in runs])
    point = Point(
        steps,
        round(progress.seconds, 2),
        round(progress.cpu_seconds, 2),
        **shares,
        time=round(float(times.mean()), 3) if len(times) else None,
    )
    progress.points.append(point)
    if progress.best_point is None or point.success >= progress.best_point.success:
        progress.best_point = point
        progress.best = {name: value.detach().clone() for name, value in network.state_dict().items()}
    write_curve(folder / CURVE, progress.points)
    return point


def play_validation(network: BasePolicy, settings: AnySettings, scenarios: Sequence[Scenario]) -> list[Played]:
    """Drive a network in training through the validation worlds of some scenarios."""
    policy = InTraining(network, robot_of(scenarios), settings.history)
    seeds = range(VALIDATION_SEEDS, VALIDATION_SEEDS + settings.eval_episodes)
    return [play(policy, scenario, seeds) for scenario in scenarios]


# ---------------------------------------------------------------------------------------------------------------------
# The whole of it
# ---------------------------------------------------------------------------------------------------------------------


def train(
    settings: AnySettings,
    out: str | os.PathLike[str],
    *,
    seed: int = 0,
    minutes: float | None = None,
    threads: int | None = None,
    tensorboard: bool = True,
    progress: bool = False,
) -> Progress:
    """Train a model, or go on with a training that was cut off; one of another algorithm than PPO begins again then.

    Args:
        settings: what to train, from `load_settings`.
        out: its folder: curve.csv, checkpoint.pt, TensorBoard's events, and in the end the agent, for `make_policy`;
            until then the best so far in `best-STEPS`, which stays until there is one that did as well.
        seed: of the network and the worlds.
        minutes: time of training after which it ends early; None: it does not.
        threads: of torch; None: one for each core. Runs with different numbers differ in the last bits.
        tensorboard: whether to write its events.
        progress: whether to show a bar on the terminal.

    Raises:
        ValueError: a training that learns offline, a seed below 0, a model to begin with that does not fit, or `out` is of
            another training, of an evaluation or in use, or holds a model that cannot be gone on with; or the training has
            diverged.
    """
    if isinstance(settings, OfflineSettings):
        raise ValueError(f"{settings.algo} learns offline, from recorded episodes: see agents/learning/offline.py")
    if threads is not None:
        threads = checked_count("threads", threads, most=MOST_WORKERS)
    work = partial(_train_in, threads=threads, tensorboard=tensorboard, progress=progress)
    return train_in_folder(settings, out, seed, minutes, work)


class Work(Protocol):
    """What trains a model in its folder."""

    def __call__(
        self, folder: Path, settings: Any, seed: int, begun: Path | None, *, minutes: float | None
    ) -> Progress:
        """Train it.

        Args:
            folder: which is there, and belongs to this process alone.
            settings: what to train.
            seed: of the network and the worlds.
            begun: folder of the model that it begins with, if any.
            minutes: time of training after which it ends early.
        """
        ...


def train_in_folder(
    settings: AnySettings, out: str | os.PathLike[str], seed: int, minutes: float | None, work: Work
) -> Progress:
    """Have a model trained in a folder that nobody else writes to, and that holds no model which would be lost.

    Raises:
        ValueError: as `train` has it.
    """
    seed = checked_seed(seed)
    if minutes is not None:
        checked_time("minutes", minutes)
    folder = out_path(out)
    begun = require_trainable(settings, {seed: folder})  # what is wrong is found out before anything is written
    folder.mkdir(parents=True, exist_ok=True)
    with one_writer(folder):
        require_same(folder, settings, [seed])  # somebody may have ended just now
        require_to_go_on(folder, settings)
        torch.set_flush_denormal(True)
        try:
            return work(folder, settings, seed, begun, minutes=minutes)
        finally:
            torch.set_flush_denormal(False)  # it holds for all that this process computes, not for torch alone


def require_trainable(settings: AnySettings, folders: Mapping[int, Path], *, is_elsewhere: bool = False) -> Path | None:
    """Refuse what cannot be trained, before anything is written, or collected to learn from.

    Args:
        settings: of the training.
        folders: of the model of each seed.
        is_elsewhere: whether other processes are to train.

    Returns:
        The folder of the model that it begins with, if any.

    Raises:
        ValueError: as `train` has it.
    """
    for seed in folders:
        first_world(seed)
    begun = None if settings.start_from is None else model_folder(settings.start_from)
    _ = settings.made_of  # from here on files may change
    if begun is not None:
        require_same_network(begun, settings)
    for seed, folder in folders.items():
        if (folder / "rows.jsonl").exists():
            raise ValueError(
                f"{folder} holds the rows of an evaluation, expected a new folder or that of an earlier training"
            )
        for model in (folder, *models_so_far(folder)):
            require_same(model, settings, [seed])
        require_to_go_on(folder, settings, is_elsewhere=is_elsewhere)
    return begun


def require_same(folder: Path, settings: AnySettings, seeds: Sequence[int]) -> None:
    """Refuse a folder with a model that another training has made.

    Raises:
        ValueError: its settings were others, or what they name has changed, or it holds seeds that are not to be trained now.
    """
    if not (folder / CONFIG).exists():
        return
    if other := _other_training(read_config(folder), settings, seeds):
        raise ValueError(f"{folder} is of another training: {other}")


def _other_training(config: Mapping[str, Any], settings: AnySettings, seeds: Sequence[int]) -> str:
    """What tells the training of a model from this one, "" where it is the same.

    Args:
        config: of the model.
        settings: of this training.
        seeds: that are to be trained now.
    """
    here = json.loads(settings.model_dump_json())
    for key in dict.fromkeys([*config["settings"], *here]):
        was, now = config["settings"].get(key), here.get(key)
        if was != now:
            return f"settings.{key} was {shortened(was)}, is now {shortened(now)}"
    made_of = config.get("made_of", {})
    for key, digest in settings.made_of.items():
        if key not in made_of:
            return f"nobody can tell whether {key} has changed since, its digest was not kept"
        if made_of[key] != digest:
            return f"{key} has changed since, its digest was {made_of[key]}, is now {digest}"
    if others := config["runs"].keys() - set(map(str, seeds)):
        return f"seed was {', '.join(sorted(others))}, is now {', '.join(map(str, seeds))}"
    return ""


def require_to_go_on(folder: Path, settings: AnySettings, *, is_elsewhere: bool = False) -> None:
    """Refuse a folder with a model of this training that a run from the beginning would replace.

    Args:
        folder: of the model.
        settings: of the training.
        is_elsewhere: whether another process is to train it, which has no checkpoint.

    Raises:
        ValueError: there is nothing to go on from.
    """
    is_kept = isinstance(settings, PPOSettings) and (folder / CHECKPOINT).exists()
    if not (folder / CONFIG).exists() or (is_kept and not is_elsewhere):
        return
    config = read_config(folder)
    done, steps = config["runs"][str(config["seed"])]["curve"][-1]["steps"], settings.n_timesteps
    came = f"was ended after {done:,} of {steps:,} steps by --minutes" if done < steps else "has taken all of its steps"
    where = " by other processes" if is_kept else ""
    raise ValueError(
        f"{folder} holds a model whose training {came}; it cannot be gone on with{where}: give a new --out"
    )


def _train_in(
    folder: Path,
    settings: AnySettings,
    seed: int,
    begun: Path | None,
    *,
    minutes: float | None,
    threads: int | None,
    tensorboard: bool,
    progress: bool,
) -> Progress:
    torch.set_num_threads(threads or usable_cores())
    env = make_training_env(settings, seed)
    model = make_model(settings, env, seed)
    begin_with(model.policy, begun)
    goes_on = isinstance(model, PPO) and (folder / CHECKPOINT).exists()
    kept, save = resume(model, env, folder / CHECKPOINT, identity_of(settings, seed))
    events = [Events(folder / "tensorboard", model.num_timesteps)] if tensorboard else []
    model.set_logger(Logger(str(folder), list[KVWriter](events)))
    left = settings.n_timesteps - model.num_timesteps
    if not goes_on:
        keep_earlier_curve(folder)
    best = BestSoFar(folder, settings, robot_of(settings.loaded), seed, goes_on=goes_on)
    with reported(settings, shown=progress) as report, kept_when_stopped(best, model.policy, kept):
        keeper = ProgressKeeper(settings, kept, folder, env=env, save=save, minutes=minutes, report=report, best=best)
        with told_when_diverged(settings, seed, lambda: model.num_timesteps):
            model.learn(max(left, 0), callback=keeper, log_interval=16, reset_num_timesteps=not goes_on)
        if save is not None and not keeper.is_over:
            report.stage(SAVING)
            save()
        best.put_by_ended(kept)
        write_best(folder, settings, model.policy, kept, seed, report=report)
    best.clear(kept)
    env.close()
    return kept


@contextmanager
def kept_when_stopped(best: BestSoFar, network: BasePolicy, kept: Progress) -> Iterator[None]:
    """Keep the best model of a training that is stopped meanwhile, or that fails."""
    try:
        yield
    except BaseException:
        best.keep(network, kept, is_end=True)
        raise


def begin_with(network: BasePolicy, begun: Path | None) -> None:
    """Give a network the weights of the model that its training begins with, if any.

    Raises:
        ValueError: its files are damaged, or it is another network.
    """
    if begun is not None:
        load_weights(begun / WEIGHTS, network, read_config(begun)["sha256"][WEIGHTS])


def require_same_network(begun: Path, settings: AnySettings) -> None:
    """Refuse to begin with a model of another network; of one for another robot a word is said, once.

    Raises:
        ValueError: it is of other layers, or its weights mean something else: another kind of algorithm, encoding, activation,
            action or history, or other numbers of a robot's observation; or its files are damaged.
    """
    config, here = read_config(begun), json.loads(settings.model_dump_json())
    robot, ours = RobotModel.from_dict(config["robot"]), robot_of(settings.loaded)
    keys = ("encoding", "action", "history", "policy_kwargs.net_arch", "policy_kwargs.activation_fn")
    parts = {
        "its algorithm": tuple(map(_network_of, (config["settings"], here))),
        **{key: (_below(config["settings"], key), _below(here, key)) for key in keys},
        **{name: (getattr(robot, name), getattr(ours, name)) for name in ("beams", "peers", "own_width")},
    }
    for name, (was, now) in parts.items():
        if was != now:
            raise ValueError(f"{begun} is of another network: {name} was {shortened(was)}, is now {shortened(now)}")
    if differences := list(robot.differences(ours)):
        warn_once(f"{begun}, which is begun with, was made for another robot: {'; '.join(differences)}")


def _network_of(settings: Mapping[str, Any]) -> str:
    """The algorithm whose network a training has: those that learn offline have PPO's."""
    algo = str(settings.get("algo"))
    return "ppo" if issubclass(ALGORITHMS.get(algo, Settings), OfflineSettings) else algo


def _below(settings: Mapping[str, Any], key: str) -> Any:
    """The value of a dotted key; None: there is none."""
    value: Any = settings
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return value


def usable_cores() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):  # macOS and Windows don't tell
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def identity_of(settings: AnySettings, seed: int) -> dict[str, Any]:
    """What a checkpoint has to share with a training that goes on from it."""
    return {
        **settings.made_of,
        "settings": json.loads(settings.model_dump_json()),
        "seed": seed,
        "threads": torch.get_num_threads(),
        "torch": str(torch.__version__),
        **{name: version(name) for name in LIBRARIES},
        "bug_gym_source": source_digest()[:16],
    }


def resume(
    model: BaseAlgorithm, env: TrainingEnv, path: Path, identity: Mapping[str, Any]
) -> tuple[Progress, Callable[[], None] | None]:
    """Bring a new model to its checkpoint, if there is one.

    Returns:
        How far the training is; and what writes a checkpoint, None where the algorithm cannot go on from one.

    Raises:
        ValueError: the checkpoint is damaged, or of another training.
    """
    if not isinstance(model, PPO):
        if path.exists():
            raise ValueError(f"{path} is of another training: {type(model).__name__} leaves no checkpoints")
        return Progress(), None
    kept = restore(model, env, load_checkpoint(path, identity)) if path.exists() else Progress()
    return kept, partial(save_checkpoint, path, model, env, kept, identity)


def write_best(
    folder: Path,
    settings: AnySettings,
    network: BasePolicy,
    kept: Progress,
    seed: int,
    data: Mapping[str, Any] | None = None,
    dataset: str | None = None,
    *,
    report: Report,
) -> None:
    """Judge the weights that did best in the held-out worlds, and write them as an agent.

    Args:
        folder: where to.
        settings: of the training.
        network: of its model.
        kept: its validations, with the weights that did best.
        seed: of the training.
        data: of an offline training: what its episodes were collected of.
        dataset: of one that was given its episodes: where they came from.
        report: told what is done.
    """
    report.stage(TESTING)
    assert kept.best_point is not None  # the end of learning validates
    network.load_state_dict(kept.best)
    policy = InTraining(network, robot_of(settings.loaded), settings.history)
    tests = range(TEST_SEEDS, TEST_SEEDS + settings.test_episodes)
    held_out = {scenario.name: play(policy, scenario, tests).summary() for scenario in settings.loaded}
    run = {"curve": [asdict(point) for point in kept.points], "best": asdict(kept.best_point), "held_out": held_out}
    if kept.entered:
        run["entered"] = [entered.model_dump() for entered in kept.entered]
    report.stage(WRITING)
    write_agent(folder, network, settings, policy.robot, {str(seed): run}, data, dataset)


def is_done(settings: AnySettings, folder: Path, seed: int, minutes: float | None = None) -> bool:
    """Whether a folder holds the model of this training, and all of its steps were taken, or all of its minutes."""
    if not (folder / CONFIG).exists():
        return False
    config = read_config(folder)
    if _other_training(config, settings, [seed]):
        return False
    last = config["runs"][str(seed)]["curve"][-1]
    is_over = minutes is not None and last["seconds"] + 0.005 >= 60.0 * minutes  # kept to hundredths
    return bool(last["steps"] >= settings.n_timesteps or is_over)


def told_left(
    settings: AnySettings, out: Path, seeds: Sequence[int], minutes: float | None, *, is_elsewhere: bool = False
) -> str:
    """What a training leaves that is stopped, and what the same one would do then, in half a line.

    Args:
        settings, out, seeds, minutes: as `train_seeds` takes them.
        is_elsewhere: whether other processes train.
    """
    left = dict[int, Path]()
    for seed, folder in folders_of(out, seeds).items():
        with suppress(ValueError):  # a folder that cannot be read
            if not is_done(settings, folder, seed, minutes):
                left[seed] = folder
    if not left:
        return f"{out} keeps what is done, the same command goes on"
    seed, folder = next(iter(left.items()))
    if isinstance(settings, PPOSettings) and (folder / CHECKPOINT).exists() and not is_elsewhere:
        return f"{out} keeps what is done, the same command goes on"
    if isinstance(settings, OfflineSettings) and not folder.exists():
        return "what was collected is kept, the same command goes on with it"
    again = "" if len(seeds) == 1 else "the others " if is_elsewhere else f"seed {seed} "
    kept = f"{out} keeps the seeds that are done, " if len(left) < len(seeds) else ""
    best = best_so_far(folder)
    return f"{kept}the same command begins {again}again{'' if best is None else f'; the best so far is in {best}/'}"


def left_to_train(
    settings: AnySettings, out: Path, seeds: Sequence[int], minutes: float | None, *, is_elsewhere: bool
) -> dict[int, Path]:
    """The folders of the seeds that are not done, by seed, after it was asked whether all can be trained.

    Args:
        settings, out, seeds, minutes: as `train_seeds` takes them.
        is_elsewhere: whether other processes are to train.

    Raises:
        ValueError: as `train` has it.
    """
    checked_count("the number of seeds", len(seeds), most=MOST_TRAININGS)
    for seed in seeds:
        first_world(seed)  # the last one is found out before the first is trained
    if len(seeds) > 1:
        require_same(out / "agent", settings, seeds)
    folders = folders_of(out, seeds)
    missing = {seed: folder for seed, folder in folders.items() if not is_done(settings, folder, seed, minutes)}
    if missing:
        require_trainable(settings, missing, is_elsewhere=is_elsewhere)
    return missing


def folders_of(out: Path, seeds: Sequence[int]) -> dict[int, Path]:
    """The folder of each seed's model."""
    return {seed: out / f"seed-{seed}" for seed in seeds} if len(seeds) > 1 else {seeds[0]: out}


def train_seeds(
    settings: AnySettings,
    out: str | os.PathLike[str],
    *,
    seeds: Sequence[int] = (0,),
    minutes: float | None = None,
    threads: int | None = None,
    progress: bool = False,
    workers: Workers = 1,
) -> Path:
    """Train a model for each seed; what is done already is not done again.

    A model that has had its `minutes` is done. One that has had fewer goes on from its checkpoint where there is one, and is
    refused where there is none, as it would begin again.

    Args:
        settings: what to train.
        out: folder of the model; with several seeds `seed-0`, `seed-1` ... in it, and the best in `agent`.
        seeds: one a model.
        minutes, threads, progress: as `train` takes them; where others do the work, a thread each and no bar.
        workers: who trains: this process, so many others, or a cluster.

    Returns:
        The folder of the model, of several the one that did best in its validation.

    Raises:
        ValueError: as `train` has it; nothing is trained then that would replace the model of another training.
    """
    one = partial(train, minutes=minutes, threads=threads, progress=progress)
    if are_several(workers):
        one = partial(train, minutes=minutes, threads=threads or 1, tensorboard=False)
    return each_seed(settings, out, seeds, one, workers, minutes=minutes)


def each_seed(
    settings: AnySettings,
    out: str | os.PathLike[str],
    seeds: Sequence[int],
    one: Callable[..., Progress],
    workers: Workers = 1,
    *,
    minutes: float | None = None,
) -> Path:
    """Train a model for each seed, as `train_seeds` says.

    Args:
        settings, out, seeds, workers, minutes: as `train_seeds` takes them.
        one: trains one, of settings and folder and `seed`.
    """
    whole, is_elsewhere = out_path(out), are_several(workers)
    folders = folders_of(whole, seeds)
    left = partial(left_to_train, settings, whole, seeds, minutes, is_elsewhere=is_elsewhere)
    missing = left()
    with ExitStack() as stack:
        if len(seeds) > 1:
            _hold(whole, stack)
        for folder in missing.values() if is_elsewhere else ():  # who trains here holds its folder itself
            _hold(folder, stack)
        missing = left()  # somebody may have ended just now
        if is_elsewhere:
            for folder in missing.values():
                keep_earlier_curve(folder)
            for _ in train_each([Job(one, settings, seed, folder) for seed, folder in missing.items()], workers):
                pass
        else:
            for seed, folder in missing.items():
                one(settings, folder, seed=seed)
        for seed, folder in folders.items():
            require_same(folder, settings, [seed])  # a worker that began late may have read other files
        return gather(list(folders.values()), whole / "agent") if len(seeds) > 1 else whole


def _hold(folder: Path, stack: ExitStack) -> None:
    """Have a folder, which is made where it is missing, to this process for as long as a stack lasts."""
    folder.mkdir(parents=True, exist_ok=True)
    stack.enter_context(one_writer(folder))
