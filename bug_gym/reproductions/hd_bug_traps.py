"""HD-BUG and the map planner in traps: u_trap, hook, maze and rooms are left, the ring is found to be closed."""

from __future__ import annotations

from typing import Any

from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import path_ratio
from bug_gym.reproductions.claims import CLEARANCE, as_percent, entry, mean, numbers, of, paired, run, told
from bug_gym.reproductions.replayable import replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table

TRAPS: dict[str, dict[str, Any]] = {
    "u_trap": {"world.rotation": "random"},
    "hook": {"world.rotation": "random"},
    "maze": {},
    "rooms": {},
    "ring": {"world.start": None, "world.goal": None},
}
POLICIES = ("hd_bug", "hd_bug_map")
SEEDS = 200
TIME_LIMIT = 2000.0


def reproduce(settings: Settings) -> Reproduction:
    """Drive through all traps."""
    policies = settings.policies or POLICIES
    seeds = settings.seeds or SEEDS
    scenarios = [
        {"scenario": name, "overrides": {"time.limit": TIME_LIMIT, **overrides}, "label": name}
        for name, overrides in TRAPS.items()
    ]
    entries = [entry(policy) for policy in policies]
    rows = run(entries, scenarios, seeds, settings, name="hd-bug-traps")
    lines, pairs, data, differences, holds = [], [], {}, {}, True
    for name in TRAPS:
        for policy in policies:
            mine = of(rows, policy=policy, scenario=name)
            unreachable = sum(row.verdict == "unreachable" for row in mine)
            reached = [row for row in mine if row.success]
            hits = sum(row.outcome == "collision" for row in mine)
            ratio = f"{mean([path_ratio(row) for row in reached]):.3f}" if reached else "-"
            lines.append([name, policy, as_percent(mine), str(unreachable), str(hits), ratio])
            data[f"{name}, {policy}"] = numbers(mine)
            holds = holds and all(map(is_right, mine))
        if set(POLICIES) <= set(policies):
            first, second = (of(rows, policy=policy, scenario=name) for policy in POLICIES)
            differences[name] = gap = paired(first, second)
            pairs.append([name, *told(gap["success"], 100.0, 1), *told(gap["path_length"])])
    header = ["trap", "policy", "reached [%]", "unreachable", "collisions", "path / shortest"]
    notes = [
        "There is a way in every world but those of ring, where there is none.",
        f"Both keep {CLEARANCE:g} m from walls where there is room; paths are compared where both arrive.",
    ]
    tables = [Table(f"Traps, {seeds} worlds a line", header, lines)]
    if pairs:
        tables.append(Table("hd_bug minus hd_bug_map, in the same worlds", PAIRED, pairs))
    episodes = replayable(rows, entries, scenarios, is_right=is_right)
    data = {"results": data, "paired": differences}
    return Reproduction("hd-bug-traps", tables, notes, data, holds, episodes=episodes)


def is_right(row: EpisodeRow) -> bool:
    """Whether an episode ended as its world is: there is no way in the ring."""
    return row.verdict == "unreachable" if row.scenario == "ring" else row.success


PAIRED = ["trap", "success [%]", "95 %", "p (McNemar)", "path [m]", "95 %", "p (sign test)"]
