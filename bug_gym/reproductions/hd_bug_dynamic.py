"""Among moving obstacles: HD-BUG, and the map planner with each predictor; the paper says 99.8 % of collisions avoided.

Fields of 40 m x 40 m with 40 obstacles, half of them moving, by each law in turn. Two speeds: up to the robot's base
speed of 0.5 m/s, and up to 0.75 m/s. Where nearly all arrive predictors can't be told apart, so a third line is
`BugGym/Rush-v0`: 20 movers as fast as the robot in a quarter of the area, a moving goal, a differential robot and a
LIDAR of 64 beams and 5 m. Collisions that no control could have avoided are counted apart, by the rule of `avoidable`.
"""

from __future__ import annotations

from typing import Any

from bug_gym.reproductions.avoidable import is_avoidable
from bug_gym.reproductions.claims import CLEARANCE, ROBOT, as_percent, mean, numbers, of, paired, run, told
from bug_gym.reproductions.replayable import replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table

PREDICTORS = ("kalman", "constant_velocity", "none", "supervised", "rl")
SEEDS = 500
LAWS = ("bounce", "random_walk", "crowd")


def field(speed: float, laws: tuple[str, ...] = LAWS) -> dict[str, Any]:
    """The scenario with movers of up to this speed [m/s]."""
    return {
        "robot": ROBOT,
        "lidar": {"beams": 180, "range": 10.0, "noise": 0.01},
        "time": {"limit": 180.0},
        "world": {
            "family": "field",
            "bounds": [-20.0, -20.0, 20.0, 20.0],
            "obstacles": 40,
            "moving": 0.5,
            "speeds": [0.1, speed],
            "laws": list(laws),
            "solvable": 0.3,
            "separation": 25.0,
        },
    }


WORLDS: dict[str, tuple[str | dict[str, Any], float]] = {
    "up to 0.5 m/s": (field(0.5), 0.99),
    "up to 0.75 m/s": (field(0.75), 0.95),
    "rush": ("rush", 0.0),
}
"""Scenario by its label, and the success asked of "kalman"."""


PAPER = "hd_bug"
"""HD-BUG itself, with "kalman"; the other lines are the map planner, whose parameters are the predictors."""


def entry(line: str) -> dict[str, Any]:
    """HD-BUG, or the map planner with a predictor, as a policy of a suite."""
    if line == PAPER:
        return {"name": PAPER}
    return {"name": "hd_bug_map", "label": line, "parameters": {"predictor": line, "clearance": CLEARANCE}}


def reproduce(settings: Settings) -> Reproduction:
    """Drive with each predictor through the same worlds."""
    predictors = settings.policies or (PAPER, *PREDICTORS)
    seeds = settings.seeds or SEEDS
    entries = [entry(predictor) for predictor in predictors]
    lines, pairs, data, differences, episodes, holds = [], [], {}, {}, [], True
    for label, (scenario, asked) in WORLDS.items():
        worlds = [{"scenario": scenario, "label": label}]
        rows = run(entries, worlds, seeds, settings, name="hd-bug-dynamic")
        episodes += replayable(rows, entries, worlds)
        for predictor in predictors:
            mine = of(rows, policy=predictor)
            hits = of(mine, outcome="collision")
            avoidable = sum(is_avoidable(entry(predictor), scenario, row) for row in hits)
            reached = [row for row in mine if row.success]
            others = len(mine) - len(reached) - len(hits)
            time = f"{mean([row.time for row in reached]):.2f}"
            lines.append([label, predictor, as_percent(mine), str(len(hits)), str(avoidable), str(others), time])
            data[f"{label}, {predictor}"] = {**numbers(mine), "avoidable_collisions": avoidable}
            if predictor == "kalman":
                holds = holds and len(reached) / len(mine) >= asked
            elif "kalman" in predictors:
                differences[f"{label}, {predictor}"] = gap = paired(mine, of(rows, policy="kalman"))
                pairs.append([label, predictor, *told(gap["success"], 100.0, 1), *told(gap["time"])])
    header = [
        "movers",
        "hd_bug, or hd_bug_map with",
        "reached [%]",
        "collisions",
        "of them avoidable",
        "neither",
        "time [s]",
    ]
    tables = [Table(f"{seeds} worlds a line, 20 of 40 obstacles moving", header, lines)]
    if pairs:
        tables.append(Table("Minus kalman, in the same worlds", PAIRED, pairs))
    data = {"results": data, "paired": differences}
    claimed = holds if "kalman" in predictors else None
    return Reproduction("hd-bug-dynamic", tables, NOTES, data, claimed, episodes=episodes)


PAIRED = ["movers", "line", "success [%]", "95 %", "p (McNemar)", "time [s]", "95 %", "p (sign test)"]
NOTES = [
    f"hd_bug, and hd_bug_map with each predictor, keep {CLEARANCE:g} m from walls where there is room.",
    "Movers don't make way, but for those of the crowd law; a third of them each bounce, walk at random, or are a crowd.",
    "avoidable: from the state two seconds before, at least one of 1,000 control sequences survives.",
]
