"""The navigator beside its two parts, the map planner and the network: is it good in every kind of world?

`navigator` is `hd_bug_map` where nothing moves; among movers `ppo_mixed` proposes what to drive on the planned way, and the
planner judges it beside its own. Nine kinds with the robot that the network was trained for, in worlds on which nothing was
set. Claimed of each kind: it arrives no less often than the better one, as far as the
worlds can tell (McNemar's exact test against both, Holm's correction for all of the tests); and where nothing moves it goes
the planner's way to the last digit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.intervals import holm
from bug_gym.reproductions.claims import as_percent, mean, numbers, of, paired, run, told
from bug_gym.reproductions.replayable import replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.reproductions.scripted_and_learned import ROBOT, SCENARIOS

OURS, PLANNER, NETWORK = "navigator", "hd_bug_map", "ppo_mixed"
PARTS = (PLANNER, NETWORK)
SEEDS = 500
FIRST = 730_000
"""First seed; its switch was set on seeds below 200, its credit on some from 3,000,000 on."""
KINDS = ("static", "dynamic", "moving_target", "denser", "faster", "rush", "crowd", "rooms", "u_trap")
STILL = ("static", "rooms", "u_trap")
"""Kinds in which nothing moves."""
LEVEL = 0.05
"""Of the tests all together."""


def reproduce(settings: Settings) -> Reproduction:
    """Drive all three through the same worlds of each kind."""
    policies = [OURS, *(part for part in settings.policies or PARTS if part != OURS)]
    seeds = settings.seeds or SEEDS
    lines, pairs, episodes = [], [], []
    results: dict[str, Any] = {}
    gaps: dict[str, Any] = {}
    other_ways: dict[str, int] = {}
    for kind in KINDS:
        source, changes = SCENARIOS[kind]
        worlds = [{"scenario": source, "label": kind, "overrides": {**ROBOT, **changes}}]
        rows = run(policies, worlds, seeds, settings, name="navigator", first=FIRST)
        episodes += replayable(rows, policies, worlds)
        mine = of(rows, policy=OURS)
        for policy in policies:
            theirs = of(rows, policy=policy)
            results[f"{kind}, {policy}"] = numbers(theirs)
            hits = sum(row.outcome == "collision" for row in theirs)
            time = f"{mean([row.time for row in theirs if row.success]):.2f}"
            lines.append([kind, policy, as_percent(theirs), str(hits), time])
            if policy != OURS:
                gaps[f"{kind}, {policy}"] = gap = paired(mine, theirs)
                pairs.append([kind, policy, *told(gap["success"], 100.0, 1), *told(gap["time"])])
        if kind in STILL and PLANNER in policies:
            other_ways[kind] = other_way(mine, of(rows, policy=PLANNER))
    worse = found_worse(gaps)
    holds = not worse and not any(other_ways.values()) if set(policies) >= set(PARTS) else None
    tables = [
        Table(f"{seeds} worlds of each kind", ["worlds", "policy", "reached [%]", "collisions", "time [s]"], lines),
        Table("The navigator minus its parts, in the same worlds", [*PAIRED], pairs),
    ]
    data = {"results": results, "paired": gaps, "worse": worse, "other_ways": other_ways}
    return Reproduction("navigator", tables, NOTES, data, holds, episodes=episodes)


def other_way(mine: Sequence[EpisodeRow], theirs: Sequence[EpisodeRow]) -> int:
    """In how many of the same worlds two policies end otherwise, go another length or need another time."""
    ends = {row.seed: (row.outcome, row.verdict, row.path_length, row.time) for row in theirs}
    return sum((row.outcome, row.verdict, row.path_length, row.time) != ends[row.seed] for row in mine)


def found_worse(gaps: dict[str, Any]) -> list[str]:
    """Where the navigator arrives less often than one of its parts: kind and part."""
    names = list(gaps)
    adjusted = holm([gaps[name]["success"]["p_value"] for name in names])
    return [name for name, p in zip(names, adjusted, strict=True) if p < LEVEL and gaps[name]["success"]["mean"] < 0.0]


PAIRED = ("worlds", "part", "success [points]", "95 %", "p (McNemar)", "time [s]", "95 %", "p (sign test)")
NOTES = [
    "All with their own parameters, and the robot of the networks: differential, 64 beams, 5 m, noise of 1 cm.",
    "denser: 35 obstacles instead of 20; faster: movers of 0.5 to 1 m/s; u_trap: turned at random.",
]
