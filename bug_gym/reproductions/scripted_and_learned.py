"""Scripted beside learned policies in the same worlds: those that the models were trained in, and others.

Every scenario has the robot of the shipped models, so that all can drive in all of them; only where the scanner itself
is changed the models are left out. With a folder of maps of ROS's map_server (`--data`) these are driven in, too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bug_gym.agents.learning.folder import lone_names
from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.rollout import Rollout
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import Summary, paired_difference, summarise
from bug_gym.reproductions.claims import CLEARANCE, entry
from bug_gym.reproductions.collisions import KINDS, contact
from bug_gym.reproductions.replayable import replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table

WORLDS = 100
BASELINE = "tangent_bug"
SCRIPTED = ("go_to_goal", "bug2", "dist_bug", BASELINE, "hd_bug", "hd_bug_map", "navigator")
ROBOT: dict[str, Any] = {
    "robot.kinematics": "differential",
    "lidar.beams": 64,
    "lidar.range": 5.0,
    "lidar.noise": 0.01,
}
Described = tuple[str | dict[str, Any], dict[str, Any]]
"""A scenario and what is changed in it."""
SCENARIOS: dict[str, Described] = {
    "static": ("static", {}),
    "dynamic": ("dynamic", {}),
    "moving_target": ("moving_target", {}),
    "rush": ("rush", {}),
    "denser": ("dynamic", {"world.obstacles": 35}),
    "faster": ("dynamic", {"world.speeds": [0.5, 1.0]}),
    "noisy scan": ("dynamic", {"lidar.noise": 0.05}),
    "32 beams": ("dynamic", {"lidar.beams": 32}),
    "crowd": ("crowd", {}),
    "maze": ("maze", {}),
    "rooms": ("rooms", {}),
    "u_trap": ("u_trap", {"world.rotation": "random", "time.limit": 120.0}),
}
"""By label. Models were trained in the first four."""


def real_maps(folder: Path) -> dict[str, Described]:
    """The maps of ROS's map_server in a folder and those below it, by label.

    Raises:
        ValueError: none there.
    """
    found = sorted(path for path in folder.rglob("*.yaml") if path.with_suffix(".pgm").exists())
    if not found:
        raise ValueError(f"expected with --data a folder with maps of ROS's map_server (.yaml and .pgm), got {folder}")
    return {f"map {path.stem}": ({"world": map_world(path), "time": {"limit": 120.0}}, {}) for path in found}


def map_world(path: Path) -> dict[str, Any]:
    """The world of a map: what is known to be free of it, start and goal not too near to each other."""
    return {"family": "ros_map", "path": str(path), "unknown_is_wall": True, "separation": 3.0}


def reproduce(settings: Settings) -> Reproduction:
    """Drive all policies through all scenarios.

    Raises:
        ValueError: a folder of data without maps.
    """
    scenarios = SCENARIOS if settings.data is None else {**SCENARIOS, **real_maps(settings.data)}
    policies = list(settings.policies or (*SCRIPTED, *lone_names()))
    worlds = settings.seeds or WORLDS
    suite: dict[str, Any] = {
        "name": "scripted-and-learned",
        "seeds": {"count": worlds},
        "scenarios": [
            {"scenario": source, "label": label, "overrides": {**ROBOT, **changes}}
            for label, (source, changes) in scenarios.items()
        ],
    }
    entries = [entry(policy) for policy in policies]
    rows = evaluate(entries, suite, workers=settings.workers, progress=settings.progress)
    summaries = [summary for summary in summarise(rows, resamples=500) if summary.scenario in scenarios]
    hits = {
        label: {policy: _kinds(rows, label, policy, described) for policy in policies}
        for label, described in scenarios.items()
    }
    differences = _differences(rows, list(scenarios), policies) if BASELINE in policies else []
    return Reproduction(
        "scripted-and-learned",
        [
            *(_table(label, [s for s in summaries if s.scenario == label], hits[label]) for label in scenarios),
            _paired_table(differences),
        ],
        [
            f"{worlds} worlds a scenario, the same for all; SPL where the goal stands; times of successes.",
            f"hd_bug_map keeps {CLEARANCE:g} m from walls where there is room, as hd_bug and the bugs do.",
        ],
        {
            "worlds": worlds,
            "summaries": [summary.as_dict() for summary in summaries],
            "collisions": hits,
            "differences": differences,
        },
        rows=rows,
        episodes=replayable(rows, entries, suite["scenarios"]),
    )


def _kinds(rows: Sequence[EpisodeRow], label: str, policy: str, described: Described) -> dict[str, int]:
    """How often a policy ran into what; each collision is driven again to see it."""
    source, changes = described
    scenario = load(source, {**ROBOT, **changes})
    found: Counter[str] = Counter()
    for row in rows:
        if (row.scenario, row.policy, row.outcome) != (label, policy, "collision"):
            continue
        where = ScenarioEntry(label, scenario, range(row.seed, row.seed + 1))
        rollout = Rollout(PolicyEntry.of(entry(policy)), where, [row.seed])
        world = rollout.simulation.world
        before = world.pose[0, 0, :2].copy()
        while not rollout.is_over:
            before = world.pose[0, 0, :2].copy()
            rollout.advance()
        found[contact(world, 0, before).kind] += 1
    return {kind: found[kind] for kind in KINDS if found[kind]}


def _differences(rows: Sequence[EpisodeRow], labels: Sequence[str], policies: Sequence[str]) -> list[dict[str, Any]]:
    """Success of each other policy minus the baseline's, by scenario, in the same worlds."""
    found = []
    for label in labels:
        mine = {policy: [row for row in rows if (row.scenario, row.policy) == (label, policy)] for policy in policies}
        for policy in policies:
            if policy != BASELINE and mine[policy]:
                difference = paired_difference(mine[policy], mine[BASELINE], "success", resamples=500)
                found.append({"scenario": label, **difference.as_dict()})
    return found


def _table(label: str, summaries: Sequence[Summary], hits: dict[str, dict[str, int]]) -> Table:
    header = ["policy", "success [%]", "95 %", "SPL", "time [s]", "collision [%]", "timeout [%]", "gave up [%]"]
    lines = []
    for s in summaries:
        shares = [f"{100 * share:.0f}" for share in (s.collision, s.timeout, s.gave_up)]
        interval = f"{100 * s.success_low:.0f} - {100 * s.success_high:.0f}"
        kinds = ", ".join(f"{count} {kind}" for kind, count in hits[s.policy].items())
        decision = f"{1000 * s.decision_time:.3f}"
        lines.append(
            [s.policy, f"{100 * s.success:.0f}", interval, f"{s.spl:.2f}", f"{s.time:.1f}", *shares, decision, kinds]
        )
    return Table(label, [*header, "decision [ms]", "collisions with"], lines)


def _paired_table(differences: Sequence[dict[str, Any]]) -> Table:
    lines = [
        [
            str(one["scenario"]),
            str(one["policy"]),
            f"{100 * one['mean']:+.0f}",
            f"{100 * one['low']:+.0f} - {100 * one['high']:+.0f}" if one["low"] is not None else "-",
            f"{one['p_value']:.3f}",
        ]
        for one in differences
    ]
    return Table(f"Success minus that of {BASELINE} [points]", ["scenario", "policy", "mean", "95 %", "p"], lines)
