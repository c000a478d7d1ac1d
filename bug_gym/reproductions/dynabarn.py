"""The DynaBARN benchmark's worlds (Nair et al. 2022): success among discs on splines, with the benchmark's robot.

Needs the benchmark's worlds (`--data`: a .jsonl). Each world is driven with several start phases of its movers, drawn by the
seed. The score as coded there is 0.125 for every success, whatever the time (its path length is negative, by a slip); as
meant it is success x OT / clip(AT, 2 OT, 8 OT) with OT = 10 s, the 20 m at 2 m/s. A mover whose spline is open jumps from
its end to its beginning: whom it jumps onto is counted apart.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from bug_gym.config import load
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import PRIVILEGED
from bug_gym.intervals import wilson_interval
from bug_gym.reproductions import barn
from bug_gym.reproductions.avoidable import SUDDEN, appeared
from bug_gym.reproductions.claims import mean, of, run
from bug_gym.reproductions.replayable import replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.worlds.dynabarn_files import load_dynabarn

PHASES = 3
"""Runs in each world."""
LENGTH = 20.0
"""From start to goal, along the line on which the benchmark's length was meant [m]."""
CODED = 0.125
"""The score of a success as the benchmark's code has it."""


def scenario(path: str, world: int) -> dict[str, Any]:
    """One of the benchmark's worlds for its robot, as a suite's scenario."""
    described = barn.scenario("faithful", path, world)
    family = {"family": "dynabarn", "path": path, "world": world}
    return {**described, "scenario": {**described["scenario"], "world": family}}


def drivers(described: Mapping[str, Any]) -> list[str]:
    """Every policy of the table that drives the robot of a scenario, each once."""
    policies = barn.every_policy()
    refused = barn.refusals(policies, described)
    return [policy for policy in policies if policy not in refused]


def is_jumped_on(policy: str, described: Mapping[str, Any], row: EpisodeRow) -> bool:
    """Whether a mover that had jumped less than SUDDEN before was touched.

    To be overlapped and move apart is no contact in the simulation: then a clearance of 0 m tells it.
    """
    if row.outcome != "collision":
        return row.min_clearance <= 0.0
    return appeared(policy, load(described["scenario"], described["overrides"]), row)


def is_success(row: EpisodeRow) -> bool:
    """Whether the robot arrived in time, and nothing that had jumped onto it was left out of the reckoning."""
    return row.success and row.time <= barn.SCORED and row.min_clearance > 0.0


def as_meant(row: EpisodeRow) -> float:
    """The score of a run with OT = 10 s."""
    return barn.score(row, LENGTH) if is_success(row) else 0.0


def summed_up(policy: str, rows: Sequence[EpisodeRow], described: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Numbers of a policy's runs; `described` are the scenarios by label."""
    reached = [row for row in rows if is_success(row)]
    low, high = wilson_interval(len(reached), len(rows))
    jumped = sum(is_jumped_on(policy, described[row.scenario], row) for row in rows)
    share = len(reached) / len(rows)
    failed = [row for row in rows if not is_success(row)]
    return {
        "n": len(rows),
        "success": share,
        "success_interval": [low, high],
        "collisions": sum(row.outcome == "collision" for row in rows),
        "jumped_on": jumped,
        "timeouts": sum(row.outcome == "timeout" for row in rows),
        "as_coded": CODED * share,
        "as_meant": mean([as_meant(row) for row in rows]),
        "time": math.fsum(row.time for row in reached) / max(len(reached), 1),
        "missed": [f"{row.scenario}, seed {row.seed}: {row.outcome} {row.verdict}".strip() for row in failed],
    }


def reproduce(settings: Settings) -> Reproduction:
    """Drive through all worlds of the file; `--seeds` takes the first worlds only.

    Raises:
        ValueError: no data given, or a file that holds no such worlds.
    """
    if settings.data is None:
        raise ValueError("the DynaBARN worlds are not part of this package: give them with --data (a .jsonl)")
    path = str(settings.data)
    scenarios = [scenario(path, number) for number in sorted(load_dynabarn(path))[: settings.seeds]]
    policies = settings.policies or drivers(scenarios[0])
    rows = run(policies, scenarios, PHASES, settings, name="dynabarn")
    labelled = {one["label"]: one for one in scenarios}
    labels = list(dict.fromkeys(row.policy for row in rows))  # who is told the map is marked
    data = {label: summed_up(label.removesuffix(PRIVILEGED), of(rows, policy=label), labelled) for label in labels}
    header = [
        "policy",
        "success [%]",
        "collisions",
        "of them jumped on",
        "timeouts",
        "as coded",
        "as meant",
        "time [s]",
    ]
    title = f"{len(scenarios)} worlds of DynaBARN, {PHASES} phases each"
    lines = [line(policy, found) for policy, found in data.items()]
    episodes = replayable(rows, policies, scenarios, is_right=is_success)
    return Reproduction("dynabarn", [Table(title, header, lines)], NOTES, {"results": data}, None, episodes=episodes)


NOTES = [
    f"as coded: {CODED:g} a success, whatever its time. as meant: OT / clip(AT, 2 OT, 8 OT), OT = 10 s, at most 0.5.",
    f"jumped on: by a mover that had jumped there less than {SUDDEN:g} s before; overlapped without a contact, too.",
    "The robot is the faithful one of `barn`: with its latency; no limit of angular acceleration, no slip.",
    "Movers keep to the benchmark's splines within 0.5 mm; within a step of 0.05 s they go straight.",
]


def line(policy: str, found: Mapping[str, Any]) -> list[str]:
    """The line of the table that says these numbers."""
    low, high = found["success_interval"]
    return [
        policy,
        f"{100.0 * found['success']:.0f} [{100.0 * low:.0f}, {100.0 * high:.0f}]",
        *(str(found[key]) for key in ("collisions", "jumped_on", "timeouts")),
        *(f"{found[key]:.4f}" for key in ("as_coded", "as_meant")),
        f"{found['time']:.1f}",
    ]
