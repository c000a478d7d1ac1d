"""HD-BUG and the map planner after a moving target: intercepted how often and how soon, beside pure pursuit.

40 m x 40 m with 40 still obstacles; the target moves at 0.5 m/s, or flees at 0.8 of the robot's speed. `time_ratio` is the
earliest time at which a straight run, obstacles left aside, could have met the target where it was, over the time taken.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from bug_gym.config import dump, load
from bug_gym.reproductions.claims import CLEARANCE, FIRST_SEED, ROBOT, as_percent, mean, numbers, of, paired, run, told
from bug_gym.reproductions.replayable import replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.scenarios import as_explicit
from bug_gym.simulation import Simulation

POLICIES: tuple[dict[str, Any], ...] = (
    {"name": "hd_bug"},
    {"name": "hd_bug_map", "parameters": {"clearance": CLEARANCE}},
    {"name": "hd_bug_map", "label": "pure pursuit", "parameters": {"clearance": CLEARANCE, "lead": False}},
)
SEEDS = 200
SPEED, FLIGHT = 0.5, 0.8
WAY_POINTS = 6
"""Of a target that goes from one to the next."""
WAY_CLEARANCE = 0.5
"""Free space about its ways [m]."""
SUCCESS_ASKED, TIME_RATIO_ASKED = 0.98, 0.8

TARGETS: dict[str, dict[str, Any]] = {
    "constant velocity": {"law": "bounce", "speed": SPEED},
    "waypoints": {"law": "waypoints", "speed": SPEED},
    "random_walk": {"law": "random_walk", "speed": SPEED},
    "evade": {"law": "evade", "speed": FLIGHT},
}


def scenes(target: str, seeds: int) -> list[dict[str, Any]]:
    """A suite's scenarios with a target of this kind: one for all seeds, or one a seed for way-points."""
    motion = TARGETS[target]
    world: dict[str, Any] = {
        "family": "field",
        "bounds": [-20.0, -20.0, 20.0, 20.0],
        "obstacles": 40,
        "solvable": 0.3,
        "separation": 15.0,
    }
    scene = {
        "robot": ROBOT,
        "lidar": {"beams": 180, "range": 10.0, "noise": 0.01},
        "time": {"limit": 300.0},
        "world": world,
    }
    if motion["law"] != "waypoints":
        return [{"scenario": {**scene, "world": {**world, "target_motion": motion}}, "label": target}]
    return [
        {"scenario": with_way_points(scene, seed), "label": f"{target} {seed}", "seeds": {"first": seed, "count": 1}}
        for seed in range(FIRST_SEED, FIRST_SEED + seeds)
    ]


def with_way_points(scene: dict[str, Any], seed: int) -> dict[str, Any]:
    """The world of a seed with a target that goes round over free way-points, with free ways between them."""
    described = load(scene)
    simulation = Simulation(described)
    simulation.reset(seeds=[seed])
    layout = simulation.world.layout(0)
    free = (
        shapely.box(*described.world.box)
        .buffer(-WAY_CLEARANCE)
        .difference(
            shapely.union_all(
                [shapely.Point(x, y).buffer(r + WAY_CLEARANCE) for x, y, r in layout.circles.tolist()]
                + [shapely.Polygon(rings[0], rings[1:]).buffer(WAY_CLEARANCE) for rings in layout.polygons]
            )
        )
    )
    rng = np.random.default_rng(seed)
    start = [float(value) for value in layout.goals[0]]
    points = [start]
    while len(points) < WAY_POINTS:
        place = rng.uniform(-18.0, 18.0, 2).tolist()
        if shapely.LineString([points[-1], place]).within(free) and math.dist(points[-1], place) > 2.0:
            points.append(place)
    # There and back, so that the last way is free too.
    points += points[-2:0:-1]
    explicit = dump(as_explicit(described, layout))
    explicit["world"].pop("goal", None)
    explicit["world"]["target"] = {"at": start, "motion": {"law": "waypoints", "speed": SPEED, "points": points}}
    return explicit


def reproduce(settings: Settings) -> Reproduction:
    """Hunt each kind of target."""
    seeds = settings.seeds or SEEDS
    lines, data, differences, episodes, holds = [], {}, {}, [], True
    for target in TARGETS:
        worlds = scenes(target, seeds)
        rows = run(POLICIES, worlds, seeds, settings, name="hd-bug-targets")
        episodes += replayable(rows, POLICIES, worlds, target)
        rows = [replace(row, scenario=target) for row in rows]
        pursuit = of(rows, policy="pure pursuit")
        for label in ("hd_bug", "hd_bug_map", "pure pursuit"):
            mine = of(rows, policy=label)
            reached = [row for row in mine if row.success]
            ratio = mean([row.time_ratio for row in reached])
            time = f"{mean([row.time for row in reached]):.2f}"
            data[f"{target}, {label}"] = numbers(mine)
            gap = ["", "", ""]
            if label != "pure pursuit":
                differences[f"{target}, {label}"] = found = paired(mine, pursuit)
                gap = told(found["time"])
            lines.append([target, label, as_percent(mine), time, f"{ratio:.3f}", *gap])
            if label == "hd_bug_map":
                enough = len(reached) >= SUCCESS_ASKED * len(mine) and ratio >= TIME_RATIO_ASKED
                holds = holds and enough and is_sooner(found["time"])
    header = [
        "target",
        "policy",
        "intercepted [%]",
        "time [s]",
        "time_ratio",
        "minus pure pursuit's [s]",
        "95 %",
        "p (sign)",
    ]
    title = f"Moving targets among 40 still obstacles, {seeds} worlds a line"
    kept = {"results": data, "paired": differences}
    return Reproduction("hd-bug-targets", [Table(title, header, lines)], NOTES, kept, holds, episodes=episodes)


def is_sooner(difference: Mapping[str, Any]) -> bool:
    """Whether a difference of times that `paired` found is below 0 with its whole interval."""
    high = difference["interval"][1]
    return high is not None and bool(high < 0.0)


NOTES = [
    "pure pursuit: hd_bug_map heading for where the target is instead of where it can be met.",
    f"The target moves at {SPEED} m/s, the evading one flees at {FLIGHT} m/s from a robot of 1 m/s that it sees at 5 m.",
]
