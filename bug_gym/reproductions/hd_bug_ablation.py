"""What each named part of HD-BUG is worth: the whole, and the whole without one part, in the same worlds."""

from __future__ import annotations

from typing import Any, get_args

from bug_gym.agents.hd_bug.parameters import Part
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.evaluation.summary import path_ratio
from bug_gym.reproductions import hd_bug_tables
from bug_gym.reproductions.claims import FIRST_SEED, as_percent, entry, mean, numbers, of, paired, run, told
from bug_gym.reproductions.replayable import replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table

WHOLE = "whole"
MAP = "hd_bug_map"
"""The map planner, beside the variants: how far the whole is from what a map is worth."""
PARTS: tuple[str, ...] = tuple(part for part in get_args(Part) if part)
WORLDS: dict[str, dict[str, Any]] = {
    "500 still obstacles": {"scenario": hd_bug_tables.field(500, 10.0), "overrides": {"time.limit": 400.0}},
    "u_trap": {"scenario": "u_trap", "overrides": {"world.rotation": "random", "time.limit": 300.0}},
    "hook": {"scenario": "hook", "overrides": {"world.rotation": "random", "time.limit": 300.0}},
    "rooms": {"scenario": "rooms", "overrides": {"time.limit": 300.0}},
    "maze": {"scenario": "maze", "overrides": {"time.limit": 300.0}},
    "dynamic": {"scenario": "dynamic"},
    "rush": {"scenario": "rush"},
}
SEEDS = 100


def reproduce(settings: Settings) -> Reproduction:
    """Drive every variant, and the map planner, through the same worlds; `settings.policies` picks among them."""
    others = [name for name in settings.policies or (*PARTS, MAP) if name != WHOLE]
    entries: list[str | dict[str, Any]] = [{"name": "hd_bug", "label": WHOLE}]
    entries += [
        entry(MAP) if name == MAP else {"name": "hd_bug", "label": name, "parameters": {"without": name}}
        for name in others
    ]
    scenarios = [{**described, "label": label} for label, described in WORLDS.items()]
    seeds = settings.seeds or SEEDS
    # Seeds beyond those of the claims.
    rows = run(entries, scenarios, seeds, settings, name="hd-bug-ablation", first=2 * FIRST_SEED)
    lines, data = [], {}
    for world in WORLDS:
        whole = of(rows, policy=WHOLE, scenario=world)
        for variant in (WHOLE, *others):
            mine = of(rows, policy=variant, scenario=world)
            lines.append([world, variant, as_percent(mine), *shown(mine), *compared(mine, whole, variant)])
            data[f"{world}, {variant}"] = {**numbers(mine), **worth(mine, whole)}
    table = Table(f"What each part is worth, {seeds} worlds a line", HEADER, lines)
    episodes = replayable(rows, entries, scenarios)
    return Reproduction("hd-bug-ablation", [table], NOTES, {"results": data}, None, episodes=episodes)


HEADER = [
    "worlds", "HD-BUG without", "reached [%]", "collisions", "time [s]", "path / shortest",
    "success minus whole's [%]", "95 %", "p (McNemar)", "path minus whole's [m]", "95 %", "p (sign test)", "changed",
]  # fmt: skip


def shown(rows: list[EpisodeRow]) -> list[str]:
    """Collisions, time and path of one variant."""
    reached = [row for row in rows if row.success]
    ratio = mean([path_ratio(row) for row in reached])
    hits = str(sum(row.outcome == "collision" for row in rows))
    return [hits, f"{mean([row.time for row in reached]):.2f}", f"{ratio:.3f}" if ratio == ratio else "-"]


def worth(mine: list[EpisodeRow], whole: list[EpisodeRow]) -> dict[str, Any]:
    """Paired differences to the whole, for JSON; and in how many worlds the run is another one."""
    gaps = paired(mine, whole)
    success, path = gaps["success"], gaps["path_length"]
    ends = {(row.scenario, row.seed): (row.outcome, row.path_length) for row in whole}
    return {
        "success_minus_whole": [success["mean"], *success["interval"]],
        "p_value": success["p_value"],
        "path_minus_whole": [path["mean"], *path["interval"]] if path["n"] > 1 else None,
        "path_p_value": path["p_value"],
        "time_minus_whole": gaps["time"],
        "changed": sum(ends[row.scenario, row.seed] != (row.outcome, row.path_length) for row in mine),
    }


def compared(mine: list[EpisodeRow], whole: list[EpisodeRow], variant: str) -> list[str]:
    """The same for the table."""
    if variant == WHOLE:
        return [""] * 7
    gaps, changed = paired(mine, whole), worth(mine, whole)["changed"]
    return [*told(gaps["success"], 100.0, 1), *told(gaps["path_length"]), f"{changed} of {len(mine)}"]


NOTES = [
    "Seeds from 20,000 on, on which no parameter was set.",
    "path / shortest leaves moving goals out; differences of paths are over the worlds that both reach.",
    "hd_bug_map: the map planner, whole, at HD-BUG's clearance.",
    "changed: in how many worlds the outcome or the length is another one.",
]
