"""The folder of a trained predictor: its graph and weights, what made them, and the same for people as a card."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from torch import nn

from bug_gym.agents.learning.folder import checksums
from bug_gym.agents.learning.models import training_machine, write_graph, write_weights
from bug_gym.agents.prediction.features import HORIZONS, WIDTH, errors_of
from bug_gym.agents.prediction.learned import CONFIG, GRAPH, WEIGHTS
from bug_gym.agents.prediction.network import Answering, Curve, validation_errors
from bug_gym.agents.prediction.samples import Samples
from bug_gym.agents.prediction.settings import ON_COMMAND_LINE, THREADS, PredictorSettings
from bug_gym.files import replaced_when_done

HOW = {
    "ppo": "PPO of stable-baselines3, each answer judged by the others to its question",
    "reinforce": "REINFORCE, answers tried in pairs on either side",
    "supervised": "supervision by the gradient of the cost",
}
"""What a card says of each `kind`."""


def write_predictor(
    folder: Path,
    settings: PredictorSettings,
    model: Answering,
    curve: Curve,
    samples: tuple[int, int],
    *,
    held_out: Mapping[str, Samples] | None = None,
    repeats: Mapping[int, list[dict[str, Any]]] | None = None,
) -> None:
    """Write a model and what made it into a folder.

    Args:
        folder: where to.
        settings: how it was trained.
        model: the network.
        curve: of its training.
        samples: how many there were for training and for validation.
        held_out: others, by name, that it is judged by.
        repeats: curves of the same training with other seeds.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_graph(folder / GRAPH, model.eval(), (WIDTH,))
    write_weights(folder / WEIGHTS, model)
    record = {
        "kind": settings.kind,
        "width": WIDTH,
        "horizons": HORIZONS.tolist(),
        "errors": [round(error, 4) for error in curve.best_errors.tolist()],
        "settings": asdict(settings),
        "sources": [source.name if isinstance(source, Path) else source for source in settings.sources],
        "samples": {"training": samples[0], "validation": samples[1]},
        "held_out": {name: judged(model, some) for name, some in (held_out or {}).items()},
        "curve": curve.points,
        "repeats": {str(seed): points for seed, points in (repeats or {}).items()},
        "machine": training_machine(),
        "sha256": checksums(folder, (GRAPH, WEIGHTS)),
    }
    with replaced_when_done(folder / CONFIG) as partial:
        partial.write_text(json.dumps(record, indent=1, default=str) + "\n", encoding="utf-8")
    with replaced_when_done(folder / "card.md") as partial:
        partial.write_text(card(folder.name, record), encoding="utf-8")


def judged(model: nn.Module, samples: Samples) -> dict[str, Any]:
    """Number of samples, and mean errors [m] (HORIZONS,) of a model's predictions and of the Kalman filter's in them."""
    by_filter = errors_of(np.zeros_like(samples.answers), samples.answers).mean(axis=0)
    by_model = validation_errors(model, samples)
    return {
        "tracks": len(samples.features),
        "errors": [round(error, 4) for error in by_model.tolist()],
        "filter_errors": [round(error, 4) for error in by_filter.tolist()],
    }


def _made_again(record: Mapping[str, Any]) -> str:
    """How to train it again: the command with all that it has of its own, where a command says all of it."""
    told = {key: None if value is None else str(value) for key, value in record["settings"].items()}
    usual = {key: None if value is None else str(value) for key, value in asdict(PredictorSettings("ppo")).items()}
    usual["hidden"] = str(list(PredictorSettings.hidden))
    told["hidden"] = str(list(record["settings"]["hidden"]))
    own = [key for key, value in usual.items() if key != "kind" and told.get(key, value) != value]
    taken_over = ["hidden"] if told["start_from"] else []  # the layers are those of the model that it begins with
    if set(own) - {*ON_COMMAND_LINE, *taken_over}:
        return f"Made by `bug_gym.agents.prediction.training.train`, with the settings in {CONFIG}"
    words = f"python -m bug_gym.agents.prediction.training {told['kind']}".split()
    for key in ON_COMMAND_LINE:
        words += [f"--{key.replace('_', '-')}", str(told[key])] if key in own else []
    words += ["--seeds", str(1 + len(record["repeats"]))] if record["repeats"] else []
    threads = record["machine"]["threads"]  # the last bits depend on them
    words += ["--threads", str(threads)] if threads != THREADS else []
    return f"Made again by `{shlex.join([*words, '--out', 'FOLDER'])}`"


def card(name: str, record: dict[str, Any]) -> str:
    """What people want to know of a predictor, as Markdown."""
    last, settings, made_on = record["curve"][-1], record["settings"], record["machine"]
    count, tried = record["samples"], last["samples"]
    begun = f", begun from {Path(settings['start_from']).name}" if settings["start_from"] else ""
    each = "" if settings["kind"] == "supervised" else f", {settings['tries']} answers to each"
    columns = " | ".join(f"{horizon:g} s" for horizon in record["horizons"])
    rule = "|---" * (1 + len(record["horizons"])) + "|"
    lines = [
        f"# {name}",
        "",
        "- Task: where a tracked mover will be after 0.8, 1.6, 3.2 and 4.8 s (BugGym/Prediction-v0)",
        f"- Algorithm: {HOW[settings['kind']]}; layers {list(settings['hidden'])}{begun}",
        f"- Worlds: {settings['worlds']} for training and {settings['validation_worlds']} for validation of each of "
        f"{', '.join(record['sources'])}; {count['training']:,} and {count['validation']:,} tracks in them",
        f"- {tried:,} samples{each}, in {last['seconds'] / 60:.1f} minutes ({last['cpu_seconds'] / 60:.1f} CPU minutes), "
        f"seed {settings['seed']}, on {made_on['cpu']}, {made_on['threads']} thread(s)",
        f"- {_made_again(record)}",
        "",
    ]
    if record["held_out"]:
        lines += [
            f"Mean distance [m] of the predicted from the true place in {settings['test_worlds']} worlds each that neither "
            "training nor validation saw, and the Kalman filter's after it; `bug-gym reproduce predictors` asks all of "
            "them at more times, with intervals.",
            "",
            f"| worlds | {columns} |",
            rule,
        ]
        for source, one in record["held_out"].items():
            pairs = zip(one["errors"], one["filter_errors"], strict=True)
            lines.append(f"| {source} | {' | '.join(f'{error:.3f} ({filters:.3f})' for error, filters in pairs)} |")
        lines.append("")
    lines += [
        "The same in the validation worlds, as it learned; the first line is about the Kalman filter's where the training "
        "begins from scratch.",
        "",
        f"| samples | {columns} |",
        rule,
    ]
    for point in record["curve"]:
        lines.append(f"| {point['samples']:,} | {' | '.join(f'{error:.3f}' for error in point['errors'])} |")
    if record["repeats"]:
        curves = {settings["seed"]: record["curve"], **record["repeats"]}
        title = (
            f"The same over prediction.features.KALMAN_ERRORS, in the mean; the model is of seed {settings['seed']}:"
        )
        lines += ["", title, "", f"| samples | {' | '.join(f'seed {seed}' for seed in curves)} |"]
        lines += ["|---" * (1 + len(curves)) + "|"]
        for points in zip(*curves.values(), strict=True):
            lines.append(
                f"| {points[0]['samples']:,} | {' | '.join(format(point['cost'], '.3f') for point in points)} |"
            )
    return "\n".join([*lines, ""])
