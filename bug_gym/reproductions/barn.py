"""The BARN benchmark's worlds (Perille et al. 2020): success and the benchmark's score, for bugs of two robots.

Needs the benchmark's worlds (`--data`: a .jsonl or a folder of `world_N.world` files). The score of a run is
success x T0 / clip(T, 4 T0, 8 T0), T the time taken and T0 the time of the reference path at 2 m/s; at most 0.25. The
benchmark's own figures come from Gazebo's physics: context, not a rival.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from bug_gym.evaluation import evaluate
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.intervals import wilson_interval
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.worlds.barn_files import load_barn

POLICIES = (
    "bug1",
    "bug2",
    "com1",
    "class1",
    "alg1",
    "alg2",
    "dist_bug",
    "tangent_bug",
    "vis_bug_21",
    "vis_bug_22",
    "rev3",
)
PARAMETERS: dict[str, dict[str, Any]] = {"holonomic": {"clearance": 0.295}, "jackal": {"clearance": 0.345}}
"""All of the worlds are open at a clearance of 0.35 m, not all at 0.40. Cylinders of 0.075 m on a grid of 0.15 m leave
gaps of 0.52, 0.60, 0.61, 0.66 and 0.70 m and none between. A gap of a little less than twice the clearance may count
either way: none is of that kind for the holonomic robot; for the other one, which needs more room to brake, 0.66 is."""

COMMON = {"lidar.beams": 720, "lidar.range": 10.0, "goal.radius": 1.0, "time.limit": 1000.0}
SCORED = 100.0
"""A run that takes longer scores nothing in the benchmark; here it goes on, to see whether it arrives [s]."""
ROBOTS = {
    "holonomic": {"kinematics": "holonomic", "radius": 0.2, "max_speed": 1.0},
    "jackal": {
        "kinematics": "differential",
        "radius": 0.25,
        "max_speed": 2.0,
        "max_reverse": 0.5,
        "max_turn_rate": 3.0,
    },
}
STEPS = {"holonomic": 0.1, "jackal": 0.05}

SUCCESS_ASKED = {"holonomic": 1.0, "jackal": 0.95}
DWA = "ROS's DWA, map unknown, as printed there (Gazebo): success 88.0 %, collisions 4.8 %, score 0.1693, 33.47 s."


def score(row: EpisodeRow, reference_length: float | None) -> float:
    """The benchmark's score of a run; without a reference path, T0 is that of the shortest path for the body."""
    if not row.success or row.time > SCORED:
        return 0.0
    best = (row.shortest_path_length if reference_length is None else reference_length) / 2.0
    return best / min(max(row.time, 4.0 * best), 8.0 * best)


def scenario(robot: str, path: str, world: int) -> dict[str, Any]:
    """One of the benchmark's worlds for a robot of ROBOTS, as a suite's scenario."""
    return {
        "scenario": {"robot": ROBOTS[robot], "world": {"family": "barn", "path": path, "world": world}},
        "overrides": {**COMMON, "time.step": STEPS[robot]},
        "label": f"world {world}",
    }


def reproduce(settings: Settings) -> Reproduction:
    """Drive through all worlds of the file with both robots.

    Raises:
        ValueError: no data given, or a file that holds no such worlds.
    """
    if settings.data is None:
        raise ValueError("the BARN worlds are not part of this package: give them with --data (a .jsonl or a folder)")
    maps = load_barn(str(settings.data))
    worlds = sorted(maps)[: settings.seeds]
    references = {f"world {number}": maps[number].reference_length for number in worlds}
    policies = settings.policies or POLICIES
    lines, data, episodes, holds = [], {}, [], True
    for robot in ROBOTS:
        scenarios = [scenario(robot, str(settings.data), number) for number in worlds]
        suite = {"name": f"barn-{robot}", "scenarios": scenarios, "seeds": {"count": 1}}
        entries = [{"name": name, "parameters": PARAMETERS[robot]} for name in policies]
        rows = evaluate(entries, suite, workers=settings.workers, progress=settings.progress)
        # A page shows robots beside one another; the number of the world stands where a seed does.
        numbers = {f"world {number}": number for number in worlds}
        episodes += [replace(row, scenario=robot, seed=numbers[row.scenario]) for row in rows]
        for policy in policies:
            mine = [row for row in rows if row.policy == policy]
            reached = [row for row in mine if row.success]
            low, high = wilson_interval(len(reached), len(mine))
            collisions = sum(row.outcome == "collision" for row in mine)
            mean_score = math.fsum(score(row, references[row.scenario]) for row in mine) / len(mine)
            time = math.fsum(row.time for row in reached) / max(len(reached), 1)
            share = len(reached) / len(mine)
            holds = holds and share >= SUCCESS_ASKED[robot] and (robot != "holonomic" or collisions == 0)
            in_time = sum(row.time <= SCORED for row in reached) / len(mine)
            missed = {row.scenario: f"{row.outcome} {row.verdict}".strip() for row in mine if not row.success}
            data[f"{robot} {policy}"] = {
                "worlds": len(mine),
                "success": share,
                "in_time": in_time,
                "success_interval": [low, high],
                "collisions": collisions,
                "score": mean_score,
                "time": time,
                "missed": missed,
            }
            lines.append(
                [
                    policy,
                    robot,
                    f"{100.0 * share:.0f} [{100.0 * low:.0f}, {100.0 * high:.0f}]",
                    f"{100.0 * in_time:.0f}",
                    str(collisions),
                    f"{mean_score:.4f}",
                    f"{time:.1f}",
                ]
            )
    header = ["policy", "robot", "success [%]", f"in {SCORED:g} s [%]", "collisions", "score", "time of successes [s]"]
    title = f"{len(worlds)} worlds of the BARN benchmark"
    notes = [
        DWA,
        f"A run of over {SCORED:g} s is a failure in the benchmark, and scores nothing here; it goes on to its end.",
        "holonomic: radius 0.2 m, 1 m/s. jackal: the benchmark's robot as a disc of 0.25 m, differential, 2 m/s.",
    ]
    return Reproduction("barn", [Table(title, header, lines)], notes, {"results": data}, holds, rows=episodes)
