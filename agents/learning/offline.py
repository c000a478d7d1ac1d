"""Training on recorded episodes: batches in, the same folder out as that of every other training.

A training that is cut off begins again: it takes minutes, and its networks and their optimisers would be a megabyte to keep
at each validation. What it learns from is kept, as is its best model until there is one that did as well, and a seed that is
done is not done again.
"""

from __future__ import annotations

import copy
import hashlib
import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.policies import ActorCriticPolicy

from bug_gym.agents.learning.cloning import Cloning, WithDriver
from bug_gym.agents.learning.dagger import ask, make_expert
from bug_gym.agents.learning.diverging import told_when_diverged
from bug_gym.agents.learning.folder import CONFIG, Point, models_so_far, read_config
from bug_gym.agents.learning.iql import IQL
from bug_gym.agents.learning.progress import Progress
from bug_gym.agents.learning.recorded import Recorded, worlds_of
from bug_gym.agents.learning.regression import Batch, Learner, near_moves
from bug_gym.agents.learning.settings import (
    AnyOffline,
    CloningSettings,
    CriticSettings,
    DaggerSettings,
    IQLSettings,
    TD3BCSettings,
)
from bug_gym.agents.learning.shown import VALIDATING, reported
from bug_gym.agents.learning.so_far import BestSoFar, keep_earlier_curve
from bug_gym.agents.learning.td3_bc import TD3BC
from bug_gym.agents.learning.training import (
    InTraining,
    begin_with,
    each_seed,
    first_world,
    kept_when_stopped,
    make_training_env,
    network_arguments,
    robot_of,
    train_in_folder,
    validate,
    write_best,
)
from bug_gym.checks import checked_count
from bug_gym.files import out_path
from bug_gym.held_out import TEST_SEEDS, TRAINING_SEEDS
from bug_gym.kinematics import discrete_actions
from bug_gym.limits import MOST_TRAININGS, MOST_WORKERS
from bug_gym.log import warn_once
from bug_gym.policy import ScriptedPolicy
from bug_gym.view import Sensors
from bug_gym.workers import Workers, are_several

AT_ONCE = 65_536
"""Observations that are encoded together."""
TOLD = 100
"""Gradient steps from one time that progress is shown to the next."""


class Samples:
    """The steps of recorded episodes as tensors, encoded, to draw batches from.

    Args:
        actor: whose encoding it is.
        settings: of the training.
        seed: of the draws.
    """

    def __init__(self, actor: ActorCriticPolicy, settings: AnyOffline, seed: int) -> None:
        self._actor, self._settings = actor, settings
        self._robot = robot_of(settings.loaded)
        self._generator = torch.Generator().manual_seed(seed)
        self._parts: list[Batch] = []
        self._all: Batch | None = None

    def add(self, episodes: Recorded) -> None:
        """Take in some episodes."""
        scaled = self._settings.reward_scale
        features = self._encoded(episodes.with_history(self._robot, self._settings.history))
        steps = self._settings.n_steps if isinstance(self._settings, CriticSettings) else int(episodes.steps.max())
        rewards, following, worth = episodes.summed(steps, self._settings.gamma)
        self._parts.append(
            Batch(
                features[torch.from_numpy(episodes.seen)],
                torch.from_numpy(episodes.actions),
                _tensor(scaled * rewards),
                features[torch.from_numpy(following)],
                _tensor(worth),
            )
        )
        self._all = Batch(*(torch.cat(parts) for parts in zip(*self._parts, strict=True)))
        self._parts = [self._all]

    @torch.no_grad()
    def _encoded(self, episodes: Recorded) -> torch.Tensor:
        pieces = torch.split(torch.from_numpy(episodes.observations), AT_ONCE)
        return torch.cat([self._actor.pi_features_extractor(piece) for piece in pieces])

    def draw(self) -> Batch:
        """A batch of steps, each drawn from all of them."""
        assert self._all is not None
        count = len(self._all.rewards)
        chosen = torch.randint(count, (self._settings.batch_size,), generator=self._generator)
        return Batch(*(part[chosen] for part in self._all))


def _tensor(values: Any) -> torch.Tensor:
    return torch.from_numpy(np.asarray(values, dtype=np.float32))


def make_actor(settings: AnyOffline, seed: int) -> ActorCriticPolicy:
    """An untrained actor: the network of stable-baselines3's PPO; its actions are continuous or discrete."""
    env = make_training_env(settings, seed)
    torch.manual_seed(seed)
    arguments = network_arguments(settings) | {"log_std_init": settings.policy_kwargs.log_std_init}
    actor = ActorCriticPolicy(env.observation_space, env.action_space, settings.rate, **arguments)
    env.close()
    return actor


def make_learner(settings: AnyOffline, actor: ActorCriticPolicy) -> Learner:
    """The algorithm of a training."""
    if isinstance(settings, IQLSettings):
        return IQL(actor, settings)
    if isinstance(settings, TD3BCSettings):
        return TD3BC(actor, settings)
    worth = _worth_of(settings)
    kept = Cloning(actor, settings.gamma, worth)
    return kept if worth is None else WithDriver(kept, Cloning(copy.deepcopy(actor), settings.gamma))


def _worth_of(settings: AnyOffline) -> torch.Tensor | None:
    """What an answer is worth to each discrete action; None: it counts for itself, or actions are continuous."""
    if not (isinstance(settings, DaggerSettings) and settings.action == "discrete" and settings.answer_width > 0.0):
        return None
    (scenario,) = settings.loaded
    return near_moves(discrete_actions(Sensors.of(scenario).drive), settings.answer_width)


def train_offline(
    settings: AnyOffline,
    out: str | os.PathLike[str],
    *,
    episodes: Recorded | None = None,
    seed: int = 0,
    minutes: float | None = None,
    threads: int = 1,
    progress: bool = False,
    dataset: str | os.PathLike[str] | None = None,
) -> Progress:
    """Train a model on recorded episodes, or on an expert's answers.

    Args:
        settings: what to train, from `load_settings`.
        out: its folder: curve.csv, and in the end the agent, for `make_policy`.
        episodes: to learn from; DAgger has the expert's answers and takes none.
        seed: of the networks and batches, and of DAgger's worlds.
        minutes: time of training after which it ends early, at a validation; None: it does not.
        threads: of torch. Runs with different numbers differ in the last bits.
        progress: whether to show a bar on the terminal.
        dataset: folder or name of what the episodes were read from, for the model's card; None: what the settings collect.

    Raises:
        ValueError: no episodes, or such that DAgger has no use for; a seed below 0, a model to begin with that does not
            fit, an expert that cannot be asked, or `out` is of another training or in use, or holds a model, which cannot be
            gone on with; or the training has diverged.
    """
    if (episodes is None) != isinstance(settings, DaggerSettings):
        expected = "no episodes" if isinstance(settings, DaggerSettings) else "episodes to learn from"
        raise ValueError(f"{settings.algo}: expected {expected}, got {'none' if episodes is None else 'some'}")
    if isinstance(settings, DaggerSettings):
        _expert_of(settings)  # what cannot be asked is found out before anything is written
    require_same_data(out_path(out), episodes)
    _tell_worlds_known(settings, episodes)
    threads = checked_count("threads", threads, most=MOST_WORKERS)
    told = None if dataset is None else os.fspath(dataset)
    work = partial(_train_in, episodes=episodes, threads=threads, progress=progress, dataset=told)
    return train_in_folder(settings, out, seed, minutes, work)


def train_offline_seeds(
    settings: AnyOffline,
    out: str | os.PathLike[str],
    *,
    episodes: Recorded | None = None,
    seeds: Sequence[int] = (0,),
    workers: Workers = 1,
    **arguments: Any,
) -> Path:
    """Train a model for each seed; what is done already is not done again.

    Args:
        settings: what to train.
        out: folder of the model; with several seeds `seed-0`, `seed-1` ... in it, and the best in `agent`.
        episodes: to learn from, as `train_offline` takes them.
        seeds: one a model.
        workers: who trains: this process, so many others, or a cluster.
        **arguments: as `train_offline` takes them; a model that has had its `minutes` is done, one that has had fewer is
            refused, as it cannot be gone on with.

    Returns:
        The folder of the model, of several the one that did best in its validation.

    Raises:
        ValueError: as `train_offline` has it.
    """
    checked_count("the number of seeds", len(seeds), most=MOST_TRAININGS)
    whole = out_path(out)
    for folder in (whole, *(whole / f"seed-{seed}" for seed in seeds)):
        require_same_data(folder, episodes)
    if are_several(workers):
        arguments = {**arguments, "progress": False}
    one = partial(train_offline, episodes=episodes, **arguments)
    return each_seed(settings, out, seeds, one, workers, minutes=arguments.get("minutes"))


def require_same_data(folder: Path, episodes: Recorded | None) -> None:
    """Refuse a folder with a model that has learnt from other episodes, or with one of a training that has not ended.

    Raises:
        ValueError: it has.
    """
    now = origin_of(episodes)
    for model in (folder, *models_so_far(folder)):
        if (model / CONFIG).exists():
            _require_same_origin(model, read_config(model).get("data"), now)


def _tell_worlds_known(settings: AnyOffline, episodes: Recorded | None) -> None:
    """Say so where a model would be judged in worlds that it has learnt from."""
    tests = range(TEST_SEEDS, TEST_SEEDS + settings.test_episodes)
    if episodes is not None and (known := worlds_of(episodes.origin, tests)):
        expected = f"collect those to learn from in worlds of trainings, bug-gym collect --seed {TRAINING_SEEDS}"
        told = f"{known:,} of the {len(tests):,} worlds that {settings.name} is judged in are those of its episodes"
        warn_once(f"{told}, as those of `bug-gym evaluate` may be: {expected}")


def origin_of(episodes: Recorded | None) -> dict[str, Any] | None:
    """What a model's config.json says of its episodes: what they were collected of, or a checksum where nobody knows."""
    if episodes is None or episodes.origin:
        return None if episodes is None else episodes.origin
    digest = hashlib.sha256()
    for part in (episodes.observations, episodes.actions, episodes.rewards, episodes.steps, episodes.terminated):
        digest.update(f"{part.dtype} {part.shape}".encode())
        digest.update(np.ascontiguousarray(part).tobytes())
    return {"sha256": digest.hexdigest()}


def _require_same_origin(folder: Path, was: dict[str, Any] | None, now: dict[str, Any] | None) -> None:
    if was != now:
        keys = [
            key for key in dict.fromkeys([*(was or {}), *(now or {})]) if (was or {}).get(key) != (now or {}).get(key)
        ]
        raise ValueError(
            f"{folder} is of another training: it learnt from other episodes ({', '.join(keys[:3])} differ)"
        )


def _train_in(
    folder: Path,
    settings: AnyOffline,
    seed: int,
    begun: Path | None,
    *,
    minutes: float | None,
    episodes: Recorded | None,
    threads: int,
    progress: bool,
    dataset: str | None,
) -> Progress:
    torch.set_num_threads(threads)
    actor = make_actor(settings, seed)
    begin_with(actor, begun)
    learner, samples, kept = make_learner(settings, actor), Samples(actor, settings, seed), Progress()
    driver = learner.driver.actor if isinstance(learner, WithDriver) else actor
    gather = _gatherer(settings, driver, samples, seed, episodes)
    done = 0
    data = origin_of(episodes)
    keep_earlier_curve(folder)
    best = BestSoFar(folder, settings, robot_of(settings.loaded), seed, data, dataset)
    with (
        reported(settings, shown=progress) as report,
        kept_when_stopped(best, actor, kept),
        told_when_diverged(settings, seed, lambda: done),
    ):
        while done < settings.n_timesteps and not (minutes is not None and kept.seconds >= 60.0 * minutes):
            with timed(kept):
                gather(done // settings.eval_freq)
                last = kept.points[-1] if kept.points else None
                done = _learn(learner, samples, settings, done, _with(report, last))
            report.stage(VALIDATING)
            report(done, validate(actor, settings, done, kept, folder))
            best.keep(actor, kept)
        write_best(folder, settings, actor, kept, seed, data, dataset, report=report)
    best.clear(kept)
    return kept


def _with(report: Callable[[int, Point | None], None], last: Point | None) -> Callable[[int], None]:
    """What shows the number of steps, beside the last validation."""
    return lambda steps: report(steps, last)


def _learn(learner: Learner, samples: Samples, settings: AnyOffline, done: int, report: Callable[[int], None]) -> int:
    """Take the gradient steps up to the next validation; returns how many have been taken then."""
    end = min(done + settings.eval_freq, settings.n_timesteps)
    for step in range(done, end):
        rate = settings.rate(1.0 - step / settings.n_timesteps)
        for optimizer in learner.optimizers:
            optimizer.param_groups[0]["lr"] = rate
        learner.update(samples.draw())
        if step % TOLD == 0:
            report(step)
    return end


def _gatherer(
    settings: AnyOffline, driver: ActorCriticPolicy, samples: Samples, seed: int, episodes: Recorded | None
) -> Callable[[int], None]:
    """What gives the samples more to learn from, before each round of gradient steps."""
    if isinstance(settings, DaggerSettings):
        return partial(_ask_expert, settings, driver, samples, seed)
    assert episodes is not None
    kept = episodes.best(settings.keep_best) if isinstance(settings, CloningSettings) else episodes
    return lambda number: samples.add(kept) if number == 0 else None


def _expert_of(settings: DaggerSettings) -> ScriptedPolicy:
    (scenario,) = settings.loaded
    return make_expert(settings.expert, scenario, discrete=settings.action == "discrete")


def _ask_expert(settings: DaggerSettings, driver: ActorCriticPolicy, samples: Samples, seed: int, number: int) -> None:
    """A round of DAgger, in worlds that no other round sees; in the first the expert drives."""
    (scenario,) = settings.loaded
    count = settings.episodes_per_round
    first = first_world(seed) + number * count
    learner = InTraining(driver, robot_of([scenario]), settings.history) if number else None
    samples.add(ask(_expert_of(settings), learner, scenario, range(first, first + count), settings.n_envs))


@contextmanager
def timed(kept: Progress) -> Iterator[None]:
    """Count what is done meanwhile as training."""
    began, began_cpu = time.perf_counter(), time.process_time()
    yield
    kept.seconds += time.perf_counter() - began
    kept.cpu_seconds += time.process_time() - began_cpu
