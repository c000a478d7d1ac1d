"""HD-BUG and the map planner in traps: u_trap, hook, maze and rooms are left, the ring is found to be closed."""

from __future__ import annotations

from typing import Any

from bug_gym.reproductions.claims import as_percent, mean, numbers, of, path_ratio, run
from bug_gym.reproductions.result import Reproduction, Settings, Table

TRAPS: dict[str, dict[str, Any]] = {
    "u_trap": {"world.rotation": "random"},
    "hook": {"world.rotation": "random"},
    "maze": {},
    "rooms": {},
    "ring": {"world.start": None, "world.goal": None},
}
SEEDS = 200
TIME_LIMIT = 2000.0


def reproduce(settings: Settings) -> Reproduction:
    """Drive through all traps."""
    policies = settings.policies or ("hd_bug", "hd_bug_map")
    seeds = settings.seeds or SEEDS
    scenarios = [
        {"scenario": name, "overrides": {"time.limit": TIME_LIMIT, **overrides}, "label": name}
        for name, overrides in TRAPS.items()
    ]
    rows = run(policies, scenarios, seeds, settings, name="hd-bug-traps")
    lines, data, holds = [], {}, True
    for name in TRAPS:
        for policy in policies:
            mine = of(rows, policy=policy, scenario=name)
            unreachable = sum(row.verdict == "unreachable" for row in mine)
            reached = [row for row in mine if row.success]
            hits = sum(row.outcome == "collision" for row in mine)
            ratio = f"{mean([path_ratio(row) for row in reached]):.3f}" if reached else "-"
            lines.append([name, policy, as_percent(mine), str(unreachable), str(hits), ratio])
            data[f"{name}, {policy}"] = numbers(mine)
            right = unreachable if name == "ring" else len(reached)
            holds = holds and right == len(mine)
    header = ["trap", "policy", "reached [%]", "unreachable", "collisions", "path / shortest"]
    notes = ["There is a way in every world but those of ring, where there is none."]
    table = Table(f"Traps, {seeds} worlds a line", header, lines)
    return Reproduction("hd-bug-traps", [table], notes, {"results": data}, holds)
