"""Many trainings with other values each, every one or by a search, and which did best: Optuna proposes, workers train.

What is done is kept in Optuna's own storage, `study.db` in the folder, and in a folder for each trial and seed, and Optuna's
tools read it. A sweep that was cut off goes on with the trials that were under way; their models that are done are not trained
again. The others begin anew, but for PPO where this process trains by itself: it goes on from its last checkpoint.

A trial whose training comes to nothing, as one does whose step is so large that its network's numbers are none any more, counts
as done, and says why in its folder and in the study. Without what its folder says of that its values are tried again.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from statistics import mean
from typing import TYPE_CHECKING, Any

import torch

from bug_gym.agents.learning.checkpoints import CHECKPOINT, load_checkpoint
from bug_gym.agents.learning.elsewhere import Job, train_each
from bug_gym.agents.learning.folder import read_config
from bug_gym.agents.learning.settings import AnySettings
from bug_gym.agents.learning.sweep_settings import Choice, Range, SweepSettings
from bug_gym.agents.learning.training import identity_of, is_done, require_same, train
from bug_gym.checks import needed_from, shortened
from bug_gym.config import ScenarioError
from bug_gym.files import one_writer, out_path, replaced_when_done, writable
from bug_gym.references import source_digest
from bug_gym.workers import Crew, Workers, are_several

if TYPE_CHECKING:
    import optuna

STUDY, TABLE = "study.db", "sweep.csv"
"""Files of a sweep: what Optuna keeps, and its trials as a table."""
FAILED = "failed.txt"
"""File of a model's folder that has none: why."""
SOURCE = "bug_gym_source"
"""What the study keeps of a trial beside its value: which code of this package has trained it."""


def sweep(
    settings: SweepSettings,
    out: Path,
    *,
    workers: Workers = 1,
    report: Callable[[str], None] = lambda line: None,
) -> Path:
    """Train all trials that are not done yet, a seed on each worker at a time.

    Args:
        settings: from `load_sweep`.
        out: its folder: study.db, sweep.csv, and `trial-0/seed-0` ... with the models.
        workers: who trains.
        report: is told a line for each trial that has ended.

    Returns:
        The folder of the best trial.

    Raises:
        ImportError: Optuna is not installed; the message names the extra.
        ValueError: the folder is of another sweep, or what its trials were trained with has changed since, or it is in use, or
            no trial could be trained.
        OSError: the disk is full, say; the sweep goes on where it was once there is room.
    """
    with needed_from("sweep", "a sweep"):
        import optuna
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    out = out_path(out)
    out.mkdir(parents=True, exist_ok=True)
    with one_writer(out), _naming_storage(out):
        study = _study(settings, out)
        _require_same_trainings(settings, out, study)
        under_way = _under_way(study)
        _tell_what_was(study, out, report)
        _ask_again(study, out)
        if settings.sampler == "grid":
            _ask_whole_grid(study, out, settings.grid)
        while (left := settings.total - _finished(study, out)) > 0:
            at_once = max(workers.size if isinstance(workers, Crew) else workers, 1)
            count = min(left, max(at_once // settings.seeds, 1))
            trials = [under_way.pop(0) if under_way else study.ask() for _ in range(count)]
            _train_trials(settings, out, trials, workers)
            for trial in trials:
                if why := _why_failed(settings, out, trial.number):
                    trial.set_user_attr(FAILED, why)
                    study.tell(trial, state=optuna.trial.TrialState.FAIL)
                    report(f"trial {trial.number}: failed with {trial.params}: {why}")
                    continue
                value = _value(settings, out, trial.number)
                trial.set_user_attr(SOURCE, source_digest()[:16])
                study.tell(trial, value)
                report(f"trial {trial.number}: {100.0 * value:.1f} % with {trial.params}")
                _write_table(study, out / TABLE)
        if not any(trial.value is not None for trial in study.trials):
            first = next(trial for trial in study.trials if _has_failed(trial, out))
            told = f"{first.params}: {first.user_attrs[FAILED]}; {_how_again(first, out)}"
            raise ValueError(f"{out}: no trial could be trained; {told}")
        return out / f"trial-{study.best_trial.number}"


@contextmanager
def _naming_storage(out: Path) -> Iterator[None]:
    """Tell which file Optuna could not write, or read, and why."""
    from optuna.exceptions import StorageInternalError
    from sqlalchemy.exc import SQLAlchemyError

    try:
        yield
    except (SQLAlchemyError, StorageInternalError) as error:
        raise OSError(f"{out / STUDY} cannot be used: {str(error.__cause__ or error).splitlines()[0]}") from None


def _study(settings: SweepSettings, out: Path) -> optuna.Study:
    """The study of a folder, or a new one; a search goes on where more trials are asked for than before.

    Raises:
        ValueError: it is of another sweep, or of one with more trials, or damaged.
    """
    import optuna
    from sqlalchemy.exc import OperationalError, SQLAlchemyError

    path = writable(out.absolute() / STUDY)
    try:
        study = optuna.create_study(
            storage=f"sqlite:///{path}",
            study_name="sweep",
            direction="maximize",
            load_if_exists=True,
        )
    except SQLAlchemyError as error:
        if isinstance(error, OperationalError):
            raise  # the disk is full, say
        raise ValueError(f"{out / STUDY} is damaged: {str(error).splitlines()[0]}") from None
    # As many trials as there are: what goes on does not draw again what was drawn. A grid's trials are all enqueued.
    study.sampler = optuna.samplers.TPESampler(seed=len(study.trials), constant_liar=True)
    here = settings.model_dump(mode="json")
    was = study.user_attrs.get("settings", here)
    if was.get("trials") and here["trials"] and was["trials"] > here["trials"]:
        raise ValueError(f"{out} holds more than is asked: trials was {was['trials']}, is now {here['trials']}")
    for key in here:
        if was.get(key) != here[key] and not (key == "trials" and was.get("trials") and here["trials"]):
            raise ValueError(
                f"{out} is of another sweep: {key} was {shortened(was.get(key))}, is now {shortened(here[key])}"
            )
    study.set_user_attr("settings", here)
    return study


def _require_same_trainings(settings: SweepSettings, out: Path, study: optuna.Study) -> None:
    """Refuse trials that are done of a training which has changed since, or whose scenarios have: others would not compare.

    Raises:
        ValueError: there are some.
    """
    for trial in study.trials:
        if trial.value is not None:
            trained = settings.trained_with(trial.params)
            for seed in range(settings.seeds):
                require_same(out / f"trial-{trial.number}" / f"seed-{seed}", trained, [seed])


def _has_failed(trial: optuna.trial.FrozenTrial, out: Path) -> bool:
    """Whether a trial came to nothing, and its folder still says so; who was cut off has failed for Optuna, too."""
    return FAILED in trial.user_attrs and any(out.glob(f"trial-{trial.number}/seed-*/{FAILED}"))


def _is_finished(trial: optuna.trial.FrozenTrial, out: Path) -> bool:
    """Whether a trial has a value, or could not have one."""
    from optuna.trial import TrialState

    return trial.state == TrialState.COMPLETE or _has_failed(trial, out)


def _finished(study: optuna.Study, out: Path) -> int:
    return sum(_is_finished(trial, out) for trial in study.trials)


def _tell_what_was(study: optuna.Study, out: Path, report: Callable[[str], None]) -> None:
    """Tell of trials that had failed before and are not tried again, and of those that other code has trained."""
    if failed := [trial for trial in study.trials if _has_failed(trial, out)]:
        first, *others = failed
        more = f", and {len(others)} more" if others else ""
        why = f"{first.params}: {first.user_attrs[FAILED]}"
        report(f"trial {first.number}{more} had failed before: {why}; {_how_again(first, out)}")
    here = source_digest()[:16]
    by_others = [
        one.number for one in study.trials if one.value is not None and one.user_attrs.get(SOURCE, here) != here
    ]
    if by_others:
        which = f"{'trials' if len(by_others) > 1 else 'trial'} {', '.join(map(str, by_others))}"
        report(f"{which}: trained by other code of bug_gym than this, the others may not compare with that")


def _how_again(trial: optuna.trial.FrozenTrial, out: Path) -> str:
    """What to do to have a trial that has failed tried again."""
    return f"remove {out / f'trial-{trial.number}'} to have its values tried again"


def _ask_again(study: optuna.Study, out: Path) -> None:
    """Have the values of trials waiting that had failed, and whose folders say so no more."""
    again = [trial.params for trial in study.trials if FAILED in trial.user_attrs and not _has_failed(trial, out)]
    _ask_each(study, out, again)


def _under_way(study: optuna.Study) -> list[optuna.Trial]:
    """The trials that a sweep was at when it was cut off: they go on under their numbers, in their folders."""
    import optuna

    running = [trial for trial in study.trials if trial.state == optuna.trial.TrialState.RUNNING]
    return [optuna.Trial(study, trial._trial_id) for trial in running]  # as `study.ask` makes one


def _ask_whole_grid(study: optuna.Study, out: Path, grid: Mapping[str, Sequence[Choice]]) -> None:
    """Have each combination waiting, but for those that are done, under way or waiting already."""
    _ask_each(study, out, [dict(zip(grid, values, strict=True)) for values in product(*grid.values())])


def _ask_each(study: optuna.Study, out: Path, combinations: Sequence[Mapping[str, Any]]) -> None:
    """Have values waiting, but for those that are done, under way or waiting already."""
    from optuna.trial import TrialState

    done = [trial.params for trial in study.trials if _is_finished(trial, out)]
    asked = [
        trial.system_attrs.get("fixed_params", trial.params)
        for trial in study.trials
        if trial.state in (TrialState.WAITING, TrialState.RUNNING)
    ]  # where Optuna keeps what was enqueued
    for combination in combinations:
        if combination not in done and combination not in asked:
            study.enqueue_trial(dict(combination))


def _train_trials(settings: SweepSettings, out: Path, trials: Sequence[optuna.Trial], workers: Workers) -> None:
    jobs = []
    for trial in trials:
        values = {
            key: choices.suggested(trial, key)
            if isinstance(choices, Range)
            else trial.suggest_categorical(key, list(choices))
            for key, choices in settings.space.items()
        }
        folders = [out / f"trial-{trial.number}" / f"seed-{seed}" for seed in range(settings.seeds)]
        try:
            trained = settings.trained_with(values)
        except ScenarioError as error:
            _tell_failed(folders[0], error)
            continue
        for seed, folder in enumerate(folders):
            require_same(folder, trained, [seed])
            if not (is_done(trained, folder, seed) or (folder / FAILED).exists()):
                jobs.append(Job(_train, trained, seed, folder))
    if not are_several(workers):
        for job in jobs:
            _train_here(job)
        return
    for _ in train_each(jobs, workers):
        pass


def _train_here(job: Job) -> None:
    """Train in the model's own folder, from the checkpoint of a training that was cut off; none is kept of what has ended."""
    checkpoint = job.folder / CHECKPOINT
    if checkpoint.exists():
        torch.set_num_threads(1)  # as `_train` has it
        try:
            load_checkpoint(checkpoint, identity_of(job.settings, job.seed))
        except ValueError:  # damaged, or of another version of torch
            checkpoint.unlink()
    job.train(job.settings, job.folder, seed=job.seed)
    checkpoint.unlink(missing_ok=True)


def _train(settings: AnySettings, out: str | os.PathLike[str], *, seed: int) -> None:
    """Train a model, or leave a word in its folder why there is none: no other trial is lost with it."""
    try:
        train(settings, out, seed=seed, threads=1, tensorboard=False)
    except (ValueError, ArithmeticError) as error:
        _tell_failed(Path(out), error)


def _tell_failed(folder: Path, error: Exception) -> None:
    """Leave a word in a model's folder why there is none."""
    first, *_ = str(error).splitlines() or [""]  # errors of scenarios have a line for each key
    folder.mkdir(parents=True, exist_ok=True)  # it may have failed before it made its folder
    with replaced_when_done(folder / FAILED) as partial:
        partial.write_text(f"{type(error).__name__}: {shortened(first, 300)}", encoding="utf-8")


def _why_failed(settings: SweepSettings, out: Path, number: int) -> str:
    """Why a trial has no value, "" where it has."""
    told = [out / f"trial-{number}" / f"seed-{seed}" / FAILED for seed in range(settings.seeds)]
    return next((path.read_text(encoding="utf-8") for path in told if path.exists()), "")


def _value(settings: SweepSettings, out: Path, number: int) -> float:
    """What a trial counts: success in the best validation, mean over its seeds."""
    records = [read_config(out / f"trial-{number}" / f"seed-{seed}") for seed in range(settings.seeds)]
    return float(mean(record["runs"][str(record["seed"])]["best"]["success"] for record in records))


def _write_table(study: optuna.Study, path: Path) -> None:
    """The trials that are done, best first."""
    done = sorted((trial for trial in study.trials if trial.value is not None), key=lambda trial: -(trial.value or 0.0))
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(["trial", "success", *done[0].params])
    writer.writerows([trial.number, round(trial.value or 0.0, 6), *trial.params.values()] for trial in done)
    with replaced_when_done(path) as partial_file:
        partial_file.write_text(text.getvalue(), encoding="utf-8")
