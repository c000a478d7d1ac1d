"""Training of learned predictors: by reinforcement, and the same network by supervision.

All see the same samples of the same worlds (samples), and all are judged by the same cost: the distance of the
predicted from the true place at each horizon, over what the Kalman filter's is there. Reinforcement learns from the
costs of the answers that it tried (a contextual bandit: an episode is one question), supervision from the cost's
gradient. Reinforcement tries many answers to each question, and judges what was tried at a horizon by the cost at that
horizon; there are two of this kind, PPO (ppo) and REINFORCE (descent). The model that did best in the validation worlds
is kept.

    python -m bug_gym.agents.prediction.training ppo --out results/rl_predictor
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from bug_gym.agents.learning.diverging import NotFiniteError, tells_divergence
from bug_gym.agents.learning.models import load_weights
from bug_gym.agents.prediction.card import write_predictor
from bug_gym.agents.prediction.descent import train_reinforce, train_supervised
from bug_gym.agents.prediction.learned import CONFIG, WEIGHTS, read_config
from bug_gym.agents.prediction.network import Answering, Curve, network
from bug_gym.agents.prediction.ppo import train_ppo
from bug_gym.agents.prediction.samples import Samples, samples_of, world_of
from bug_gym.agents.prediction.settings import THREADS, PredictorSettings
from bug_gym.checks import checked_count
from bug_gym.files import one_writer
from bug_gym.held_out import TEST_SEEDS, TRAINING_SEEDS, VALIDATION_SEEDS
from bug_gym.limits import MOST_TRAININGS, MOST_WORKERS
from bug_gym.references import told_of
from bug_gym.workers import Workers, each

TRAININGS = {"ppo": train_ppo, "reinforce": train_reinforce, "supervised": train_supervised}
"""What trains by `kind`."""
BAD_INPUT = 2
"""Exit code where an argument is wrong, or a file cannot be read or written."""


def gather(sources: Sequence[str | Path], seeds: Sequence[int], *, workers: Workers = 1) -> Samples:
    """The samples of a world of each source (see samples.world_of) and seed.

    Raises:
        ValueError: not one mover was tracked in them.
    """
    asked = [(source, seed) for seed in seeds for source in sources]
    found = list(each(_samples, asked, workers, in_order=True))
    if not any(len(samples.features) for samples in found):
        raise ValueError(f"nothing was tracked in {len(asked)} worlds of {', '.join(map(str, sources))}")
    return Samples(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _samples(asked: tuple[str | Path, int]) -> Samples:
    source, seed = asked
    return samples_of(world_of(source, seed), seed)


def gather_for(settings: PredictorSettings, *, workers: Workers = 1) -> tuple[Samples, Samples]:
    """The samples of a training and of its validation."""
    training = range(TRAINING_SEEDS, TRAINING_SEEDS + settings.worlds)
    validation = range(VALIDATION_SEEDS, VALIDATION_SEEDS + settings.validation_worlds)
    return (
        gather(settings.sources, training, workers=workers),
        gather(settings.sources, validation, workers=workers),
    )


def gather_held_out(settings: PredictorSettings, *, workers: Workers = 1) -> dict[str, Samples]:
    """The samples of worlds that neither training nor validation saw, by motion law; of a recording none are left."""
    if settings.real is not None:
        return {}
    seeds = range(TEST_SEEDS, TEST_SEEDS + settings.test_worlds)
    return {str(law): gather([law], seeds, workers=workers) for law in settings.sources}


def train(
    settings: PredictorSettings,
    out: Path,
    training: Samples,
    validation: Samples,
    *,
    held_out: Mapping[str, Samples] | None = None,
    repeats: Sequence[int] = (),
) -> None:
    """Train a predictor and write it into a folder; one that begins with another's weights has its layers.

    Args:
        settings: what it learns, and how.
        out: the folder.
        training: what it learns from.
        validation: what the best weights are chosen by.
        held_out: what it is judged by in the end, by name.
        repeats: other seeds to train with, to see how much depends on the seed; only their curves are kept.

    The model is written before it is trained with other seeds: one of those that is stopped, or fails, costs no model.

    Raises:
        ValueError: as `prepared` has it, or a training has diverged.
    """
    settings = prepared(settings, out)
    model, curve = _trained(settings, training, validation)
    counts = len(training.features), len(validation.features)
    write = partial(write_predictor, out, settings, model, curve, counts, held_out=held_out)
    write()
    if repeats:
        curves = {seed: _trained(replace(settings, seed=seed), training, validation)[1] for seed in repeats}
        write(repeats={seed: one.points for seed, one in curves.items()})


def _trained(settings: PredictorSettings, training: Samples, validation: Samples) -> tuple[Answering, Curve]:
    """The model of a training, and its curve.

    Raises:
        ValueError: it has diverged.
    """
    try:
        return TRAININGS[settings.kind](settings, training, validation)
    except (ValueError, NotFiniteError) as error:
        if not tells_divergence(error):
            raise
        why = f"its network answers with NaN or infinity; rate is {settings.rate}, try a smaller one"
        raise ValueError(f"{settings.kind} (seed {settings.seed}) has diverged: {why}") from error


def prepared(settings: PredictorSettings, out: Path) -> PredictorSettings:
    """The settings with the layers of the predictor to begin with, and the folder made: what is wrong is told before the work.

    Raises:
        ValueError: a predictor to begin with that is damaged, or the folder holds another one.
        OSError: there can be no such folder.
    """
    if (begun := settings.start_from) is not None:
        config = read_config(begun)
        settings = replace(settings, hidden=tuple(config["settings"]["hidden"]))
        load_weights(begun / WEIGHTS, Answering(network(settings.hidden)), config["sha256"][WEIGHTS])
    require_same(out, settings)
    out.mkdir(parents=True, exist_ok=True)
    return settings


def require_same(folder: Path, settings: PredictorSettings) -> None:
    """Refuse a folder with a predictor that other settings have made."""
    if not (folder / CONFIG).exists():
        return
    there, here = read_config(folder)["settings"], json.loads(json.dumps(asdict(settings), default=str))
    for key in dict.fromkeys([*there, *here]):
        if there.get(key) != here.get(key):
            raise ValueError(
                f"{folder} holds another predictor: {key} was {there.get(key)!r}, is now {here.get(key)!r}"
            )


def main(arguments: Sequence[str] | None = None) -> None:
    """Train a predictor as the command line says."""
    parser = argparse.ArgumentParser(prog="python -m bug_gym.agents.prediction.training", description=main.__doc__)
    parser.add_argument("kind", choices=sorted(TRAININGS))
    parser.add_argument("--out", type=Path, required=True, help="folder for the model")
    parser.add_argument("--seed", type=int, default=PredictorSettings.seed, help="of the model")
    parser.add_argument(
        "--seeds", type=int, default=1, help="how many times it is trained, to see how much a seed does"
    )
    parser.add_argument("--worlds", type=int, default=PredictorSettings.worlds, help="training worlds of each law")
    parser.add_argument("--validation-worlds", type=int, default=PredictorSettings.validation_worlds)
    parser.add_argument(
        "--test-worlds", type=int, default=PredictorSettings.test_worlds, help="held-out worlds of each law"
    )
    parser.add_argument("--epochs", type=int, default=PredictorSettings.epochs)
    parser.add_argument("--rate", type=float, default=PredictorSettings.rate, help="learning rate at first")
    parser.add_argument("--real", type=Path, help="recorded pedestrians (csv) to learn from instead of the laws")
    parser.add_argument("--start-from", type=Path, help="folder of a predictor to train on")
    parser.add_argument("--threads", type=int, default=THREADS)
    options = vars(parser.parse_args(arguments))
    try:
        _run(**options)
    except (ValueError, OSError, ImportError) as error:
        parser.exit(BAD_INPUT, f"{parser.prog}: error: {told_of(error)}\n")


def _run(*, out: Path, threads: int, seeds: int, **options: Any) -> None:
    threads = checked_count("threads", threads, most=MOST_WORKERS)
    checked_count("seeds", seeds, most=MOST_TRAININGS)
    settings = PredictorSettings(**options)
    repeats = range(settings.seed + 1, settings.seed + seeds)
    for seed in repeats[-1:]:
        replace(settings, seed=seed)  # the last one is the greatest
    if settings.real is not None:
        world_of(settings.real, settings.seed)  # the recording can be read
    settings = prepared(settings, out)
    with one_writer(out):
        torch.set_num_threads(threads)
        samples = gather_for(settings, workers=threads)
        train(settings, out, *samples, held_out=gather_held_out(settings, workers=threads), repeats=repeats)


if __name__ == "__main__":
    main()
