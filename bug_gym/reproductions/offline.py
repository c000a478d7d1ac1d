"""Learning from what others did, among still and moving obstacles: five ways beside the expert and beside PPO.

Behaviour cloning (of HD-BUG's episodes, and of a mixed dataset of HD-BUG, two bugs and chance), cloning of the best tenth of
the mixed episodes, implicit Q-learning and TD3+BC on the mixed ones, and DAgger, which asks HD-BUG again. Each model is judged
in the same worlds, which neither collection, training nor validation saw. The normalised score is Minari's: the mean return as
a share of the way from the random policy's to HD-BUG's.

PPO is trained twice beside them, from nothing and from the clone of HD-BUG of the same seed, up to 98 % of validation worlds.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import mean
from typing import Any

import numpy as np

from bug_gym.agents.learning.folder import read_config
from bug_gym.agents.learning.settings import AnyOffline, DaggerSettings, OfflineSettings, load_settings
from bug_gym.checks import needed_from, shortened
from bug_gym.config import load
from bug_gym.evaluation.datasets import COLLECTED, episodes_for
from bug_gym.evaluation.demonstrations import ENDINGS, demonstrate
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.progress import progress_bar
from bug_gym.files import from_json
from bug_gym.held_out import TEST_SEEDS
from bug_gym.intervals import wilson_interval
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.workers import each, on_this_machine, starred

SEEDS = 3
WORLDS = 200
"""Held-out worlds of each model."""
SCENARIO = "dynamic"
MIXED: dict[str, Any] = {"data": {"policies": ["hd_bug", "tangent_bug", "bug2", "random"], "episodes": 250}}
TRAININGS: dict[str, tuple[str, dict[str, Any]]] = {
    "bc_hd_bug": ("bc_hd_bug", {}),
    "bc_mixed": ("bc_hd_bug", MIXED),
    "filtered_bc_mixed": ("bc_hd_bug", {**MIXED, "keep_best": 0.1}),
    "iql_mixed": ("iql_mixed", {}),
    "td3_bc_mixed": ("td3_bc_mixed", {}),
    "dagger_hd_bug": ("dagger_hd_bug", {}),
}
"""Training of configs/train, and what is changed in it, by the name of a row."""
STARTS = "ppo_from_clone"
"""Name of the row that trains PPO twice, from nothing and from the model of the row CLONE of the same seed."""
CLONE, ONLINE_TRAINING = "bc_hd_bug", "ppo_dynamic"
ONLINE_CHANGES = {"n_timesteps": 1_500_000, "eval_freq": 98_304, "eval_episodes": 300, "test_episodes": 10}
ENOUGH = 0.98
"""Share of validation worlds that tells when PPO has learnt enough."""
EXPERT, FLOOR, ONLINE = "hd_bug", "random", "ppo_dynamic"
BESIDE = (EXPERT, "tangent_bug", "bug2", FLOOR, ONLINE)
"""Policies that are judged in the same worlds: those of the datasets, and PPO."""
DAGGER_AIM = 0.97
"""Success of DAgger that the plan of the project asks for."""


def reproduce(settings: Settings) -> Reproduction:
    """Train and judge; `seeds` is the number of trainings of each row, `policies` names the rows, `workers` share them.

    Datasets are kept in results/datasets. `data` is an earlier record of this: its rows are kept but for those named.

    Raises:
        ValueError: no such row, or an earlier record of something else.
    """
    with needed_from("train", "offline"):
        from bug_gym.agents.learning.offline import train_offline  # noqa: F401  # loads torch
    rows = (*TRAININGS, STARTS)
    if unknown := [name for name in settings.policies if name not in rows]:
        raise ValueError(f"rows are {', '.join(rows)}, got {shortened(unknown[0])}")
    count, labels = settings.seeds or SEEDS, settings.policies or rows
    earlier = None if settings.data is None else _earlier(settings.data, count)
    workers = on_this_machine(settings.workers)
    worlds = range(TEST_SEEDS, TEST_SEEDS + WORLDS)
    beside = {name: _judged(name, worlds) for name in BESIDE}
    floor, ceiling = (float(beside[name]["return"]) for name in (FLOOR, EXPERT))
    jobs = [(label, seed) for label in labels for seed in range(count)]
    for label in labels:
        _episodes(_settings_of(CLONE if label == STARTS else label), workers)  # not by several of them at once
    found: dict[str, list[dict[str, Any]]] = {label: [] for label in labels}
    with progress_bar(shown=settings.progress) as track:
        work = each(partial(starred, _run), [(*job, worlds) for job in jobs], workers, in_order=True)
        for (label, _), run in zip(jobs, track(work, "trainings", len(jobs)), strict=True):
            found[label].append(run)
    starts = found.pop(STARTS, [])
    remark = ""
    if earlier is not None:
        remark = _kept(earlier, labels)
        kept = earlier["trainings"] | found
        found = {label: kept[label] for label in TRAININGS if label in kept}
        starts = starts or earlier.get("starts", [])
    for one in (*beside.values(), *(run for runs in found.values() for run in runs)):
        one["score"] = round((one["return"] - floor) / (ceiling - floor), 4)
    data = {"worlds": WORLDS, "seeds": count, "scenario": SCENARIO, "trainings": found, "beside": beside}
    data |= ({"starts": starts} if starts else {}) | ({"remark": remark} if remark else {})
    claims = claims_of(data)
    header = ["", "seeds", "success [%]", "95 %", "score", "minutes of one core"]
    return Reproduction(
        "offline",
        [
            Table(f"Offline learning in {WORLDS} held-out worlds of {SCENARIO}", header, list(_rows(data))),
            *([_starts_table(starts)] if starts else []),
        ],
        [f"not so: {claim}" for claim, holds in claims.items() if not holds],
        {**data, "claims": claims},
        all(claims.values()) if claims else None,
    )


def _earlier(path: Path, count: int) -> dict[str, Any]:
    """An earlier record, whose models were judged in as many worlds of the same scenario.

    Raises:
        ValueError: it is none, or of other worlds or another number of seeds.
    """
    try:
        record = from_json(path.read_bytes())
    except (OSError, ValueError) as error:
        raise ValueError(f"{path} is no record of `bug-gym reproduce offline`: {error}") from None
    expected = {"name": "offline", "scenario": SCENARIO, "worlds": WORLDS, "seeds": count}
    found = {key: record.get(key) for key in expected} if isinstance(record, dict) else {}
    if found != expected:
        raise ValueError(f"{path}: expected a record with {expected}, got {found}")
    return dict(record)


def _kept(earlier: Mapping[str, Any], labels: Sequence[str]) -> str:
    """Which rows of an earlier record are kept, and where they are from; none where all are new."""
    rows = [*earlier["trainings"], *([STARTS] if "starts" in earlier else [])]
    kept = [f"`{label}`" for label in rows if label not in labels]
    made = f"{', '.join(kept)}: made at commit `{earlier['commit']}`, all others at the one above"
    told = f"{made}; scores are over the references of now."
    return " ".join(filter(None, [earlier.get("remark", ""), told])) if kept else ""


def claims_of(data: Mapping[str, Any]) -> dict[str, bool]:
    """What the plan of the project asks for of the rows that there are, and whether it is so."""
    success = {label: pooled(runs)["success"] for label, runs in data["trainings"].items()}
    single = max(data["beside"][name]["success"] for name in MIXED["data"]["policies"])
    claims = {}
    if "dagger_hd_bug" in success:
        claims[f"DAgger reaches {100 * DAGGER_AIM:g} %"] = success["dagger_hd_bug"] >= DAGGER_AIM
    if "iql_mixed" in success:
        claims["IQL does better than the best policy in its dataset"] = success["iql_mixed"] > single
    if {"iql_mixed", "bc_mixed"} <= success.keys():
        claims["IQL does better than cloning the same dataset"] = success["iql_mixed"] > success["bc_mixed"]
    if data.get("starts"):
        claims[f"PPO that begins with a clone reaches {100 * ENOUGH:g} % sooner, the clone's training included"] = (
            is_sooner(data["starts"])
        )
    return claims


def pooled(runs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Success over the worlds of all runs with its Wilson interval, mean score and mean minutes."""
    n = sum(run["n"] for run in runs)
    won = round(sum(run["n"] * run["success"] for run in runs))
    interval = wilson_interval(won, n)
    minutes = [run["minutes"] for run in runs if run["minutes"] is not None]
    return {
        "success": won / n,
        "low": interval.low,
        "high": interval.high,
        "score": mean(run["score"] for run in runs) if "score" in runs[0] else None,
        "minutes": mean(minutes) if minutes else None,
    }


def is_sooner(starts: Sequence[Mapping[str, Any]]) -> bool:
    """Whether PPO has learnt enough sooner from a clone with every seed; one that never has learnt enough is the later."""
    never = float("inf")
    return all(
        (one["from_clone"] or never) + one["clone"]["minutes"] < (one["from_nothing"] or never) for one in starts
    )


def _run(label: str, seed: int, worlds: range) -> dict[str, Any]:
    return _started(seed) if label == STARTS else _trained(label, seed, worlds)


def _started(seed: int) -> dict[str, Any]:
    """Minutes of one core until PPO has learnt enough, from nothing and from a clone, whose own are told beside."""
    from bug_gym.agents.learning.offline import train_offline  # loads torch
    from bug_gym.agents.learning.training import train  # loads torch

    training = _settings_of(CLONE)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "clone"
        kept = train_offline(training, folder, episodes=_episodes(training), seed=seed)
        assert kept.best_point is not None
        found: dict[str, Any] = {
            "seed": seed,
            "clone": {"success": kept.best_point.success, "minutes": round(kept.cpu_seconds / 60.0, 3)},
        }
        for name, begun in (("from_nothing", None), ("from_clone", str(folder))):
            online = load_settings(ONLINE_TRAINING, {**ONLINE_CHANGES, "start_from": begun})
            points = train(online, Path(place) / name, seed=seed, threads=1, tensorboard=False).points
            found[name] = next((round(one.cpu_seconds / 60.0, 3) for one in points if one.success >= ENOUGH), None)
            found[f"{name}_curve"] = [[one.steps, round(one.cpu_seconds / 60.0, 3), one.success] for one in points]
    return found


def _settings_of(label: str) -> AnyOffline:
    """Of the training of a row."""
    name, changes = TRAININGS[label]
    training = load_settings(name, {**changes, "test_episodes": 10})  # judged here, in worlds and by measures of all
    assert isinstance(training, OfflineSettings)
    return training


def _trained(label: str, seed: int, worlds: range) -> dict[str, Any]:
    """A model of a seed, judged."""
    from bug_gym.agents.learning.offline import train_offline  # loads torch

    training = _settings_of(label)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "model"
        kept = train_offline(training, folder, episodes=_episodes(training), seed=seed)
        record = read_config(folder)
        return {
            "seed": seed,
            "steps": record["runs"][str(seed)]["curve"][-1]["steps"],
            **_judged(f"{folder}/", worlds),
            "minutes": round(kept.cpu_seconds / 60.0, 2),
        }


def _episodes(training: AnyOffline, workers: int = 1) -> Any:
    return None if isinstance(training, DaggerSettings) else episodes_for(training, root=COLLECTED, workers=workers)


def _judged(policy: str, worlds: range) -> dict[str, Any]:
    """How a policy does in some worlds: shares of the outcomes, and the mean return."""
    driven = demonstrate(PolicyEntry.of(policy), ScenarioEntry(SCENARIO, load(SCENARIO), worlds), worlds)
    shares = {end: float(np.mean(driven.outcomes == ENDINGS.index(end))) for end in ("success", "collision", "timeout")}
    return {"n": len(worlds), **shares, "return": round(float(driven.returns().mean()), 3), "minutes": None}


def _rows(data: Mapping[str, Any]) -> Iterator[list[str]]:
    for label, runs in (*data["trainings"].items(), *((name, [one]) for name, one in data["beside"].items())):
        one = pooled(runs)
        minutes = "-" if one["minutes"] is None else f"{one['minutes']:.1f}"
        seeds = str(len(runs)) if label in data["trainings"] else "-"
        interval = f"{100 * one['low']:.1f} - {100 * one['high']:.1f}"
        yield [label, seeds, f"{100 * one['success']:.1f}", interval, f"{100 * one['score']:.1f}", minutes]


def _starts_table(starts: Sequence[Mapping[str, Any]]) -> Table:
    def told(minutes: float | None) -> str:
        return "-" if minutes is None else f"{minutes:.2f}"

    header = ["seed", "from nothing", "from the clone", "the clone's own", "its success [%]"]
    rows = [
        [
            *(str(one["seed"]), told(one["from_nothing"]), told(one["from_clone"])),
            *(told(one["clone"]["minutes"]), f"{100 * one['clone']['success']:.1f}"),
        ]
        for one in starts
    ]
    return Table(f"PPO: minutes of one core to {100 * ENOUGH:g} % of validation worlds of {SCENARIO}", header, rows)
