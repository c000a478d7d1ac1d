"""What each part of HD-BUG is worth: the whole, and the whole without one part, in the same worlds."""

from __future__ import annotations

from typing import Any

from bug_gym.evaluation.summary import paired_difference
from bug_gym.reproductions import hd_bug_dynamic, hd_bug_tables
from bug_gym.reproductions.claims import FIRST_SEED, as_percent, mean, numbers, of, path_ratio, run
from bug_gym.reproductions.result import Reproduction, Settings, Table

VARIANTS: dict[str, dict[str, Any]] = {
    "whole": {},
    "without shadow": {"use_shadow": False},
    "without adaptive radius": {"adapt_radius": False},
    "without backtracking": {"backtrack": False},
    "predictor constant_velocity": {"predictor": "constant_velocity"},
    "predictor none": {"predictor": "none"},
    "predictor supervised": {"predictor": "supervised"},
    "predictor rl": {"predictor": "rl"},
}
WORLDS: dict[str, dict[str, Any]] = {
    "500 still obstacles": {"scenario": hd_bug_tables.field(500, 10.0)},
    "maze": {"scenario": "maze", "overrides": {"time.limit": 600.0}},
    "rooms": {"scenario": "rooms", "overrides": {"time.limit": 600.0}},
    "movers up to 0.75 m/s": {"scenario": hd_bug_dynamic.field(0.75)},
    "dynamic": {"scenario": "dynamic"},
    "rush": {"scenario": "rush"},
}
SEEDS = 100


def reproduce(settings: Settings) -> Reproduction:
    """Drive every variant through the same worlds."""
    entries = [{"name": "hd_bug", "label": label, "parameters": changed} for label, changed in VARIANTS.items()]
    scenarios = [{**described, "label": label} for label, described in WORLDS.items()]
    seeds = settings.seeds or SEEDS
    # Seeds beyond those of the claims.
    rows = run(entries, scenarios, seeds, settings, name="hd-bug-ablation", first=2 * FIRST_SEED)
    lines, data = [], {}
    for world in WORLDS:
        whole = of(rows, policy="whole", scenario=world)
        for variant in VARIANTS:
            mine = of(rows, policy=variant, scenario=world)
            reached = [row for row in mine if row.success]
            gap = paired_difference(mine, whole, "success")
            ratio = mean([path_ratio(row) for row in reached])
            lines.append(
                [world, variant, as_percent(mine), str(sum(row.outcome == "collision" for row in mine)),
                 f"{mean([row.time for row in reached]):.2f}", f"{ratio:.3f}" if ratio == ratio else "-",
                 "" if variant == "whole" else f"{100 * gap.mean:+.1f} [{100 * gap.low:+.1f}, {100 * gap.high:+.1f}]"]
            )  # fmt: skip
            data[f"{world}, {variant}"] = numbers(mine)
    header = [
        "worlds",
        "HD-BUG",
        "reached [%]",
        "collisions",
        "time [s]",
        "path / shortest",
        "success minus whole's [%]",
    ]
    table = Table(f"What each part is worth, {seeds} worlds a line", header, lines)
    return Reproduction("hd-bug-ablation", [table], NOTES, {"results": data}, None)


NOTES = ["Seeds from 20,000 on, on which no parameter was set.", "path / shortest leaves moving goals out."]
