"""The BARN benchmark's worlds (Perille et al. 2020): success and the benchmark's scores, for bugs of three robots.

Needs the benchmark's worlds (`--data`: a .jsonl or a folder of `world_N.world` files). The score of a run is
success x OT / clip(AT, 2 OT, 8 OT), AT the time taken and OT the time of the reference path at 2 m/s: at most 0.5. Until
February 2024 it was success x OT / clip(AT, 4 OT, 8 OT), at most 0.25; both are printed. The benchmark's own figures come
from Gazebo's physics: context, not a rival.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
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
PARAMETERS: dict[str, dict[str, Any]] = {
    "holonomic": {"clearance": 0.295},
    "jackal": {"clearance": 0.345},
    "faithful": {"clearance": 0.345},
}
"""All of the worlds are open at a clearance of 0.35 m, not all at 0.40. Cylinders of 0.075 m on a grid of 0.15 m leave
gaps of 0.52, 0.60, 0.61, 0.66 and 0.70 m and none between. A gap of a little less than twice the clearance may count
either way: none is of that kind for the holonomic robot; for the others, which need more room to brake, 0.66 is."""

COMMON = {"lidar.beams": 720, "lidar.range": 10.0, "goal.radius": 1.0, "time.limit": 1000.0}
SCORED = 100.0
"""A run that takes longer scores nothing in the benchmark; here it goes on, to see whether it arrives, but for the faithful
robot [s]."""
HALF_LENGTH, HALF_WIDTH = 0.229, 0.208
"""Of the rectangle that holds the Jackal's chassis and wheels, about the middle of its axles [m]."""
PARTS = 4
"""Into how many parts each side of the rectangle is cut; each cell at its rim is covered by a circle."""


def rectangle() -> list[list[float]]:
    """The Jackal's rectangle as circles x, y, radius [m]: they hold all of its rim, and stick out by at most 0.026 m."""
    radius = math.hypot(HALF_LENGTH, HALF_WIDTH) / PARTS
    middles = [(2 * part + 1) / PARTS - 1.0 for part in range(PARTS)]
    outer = {middles[0], middles[-1]}
    return [[HALF_LENGTH * a, HALF_WIDTH * b, radius] for a in middles for b in middles if {a, b} & outer]


ROBOTS: dict[str, dict[str, Any]] = {
    "holonomic": {"kinematics": "holonomic", "radius": 0.2, "max_speed": 1.0},
    "jackal": {
        "kinematics": "differential",
        "radius": 0.25,
        "max_speed": 2.0,
        "max_reverse": 0.5,
        "max_turn_rate": 3.0,
    },
    "faithful": {
        "kinematics": "differential",
        "circles": rectangle(),
        "max_speed": 2.0,
        "max_reverse": 2.0,
        "max_turn_rate": 4.0,
        "max_acceleration": 20.0,
    },
}
"""The last is the benchmark's, by its own files: jackal_urdf, jackal_control's control.yaml."""
STEPS = {"holonomic": 0.1, "jackal": 0.05, "faithful": 0.05}
OWN: dict[str, dict[str, Any]] = {
    "faithful": {
        "lidar.range": 30.0,
        "lidar.min_range": 0.1,
        "lidar.fov": 4.71238,
        "lidar.noise": 0.001,
        "time.limit": SCORED,
    }
}
"""What is not COMMON for a robot; the benchmark's scanner is a Hokuyo UST-10."""

SUCCESS_ASKED = {"holonomic": 1.0, "jackal": 0.95}
"""Shares of the worlds that every bug has to reach; nothing is claimed of the faithful robot, it is measured."""
BEST_SPEED = 2.0
"""At which the benchmark takes its reference path [m/s]."""
LEAST_TIMES = {"score_2024": 2.0, "score_2022": 4.0}
"""Times of the reference path below which a run scores no more, by the metric of 2024 and the one before it."""
MOST_TIMES = 8.0
"""Times of the reference path above which a run scores no less."""
DWA = (
    "ROS's DWA, map unknown, as printed there (Gazebo): success 88.0 %, collisions 4.8 %, 33.47 s, score 0.1693 by the "
    "metric of 2022. By that of 2024: six planners of ROS 0.1656 to 0.4354, the winner of 2024 0.4762."
)


def score(row: EpisodeRow, reference_length: float | None, metric: str = "score_2024") -> float:
    """The benchmark's score of a run, by a metric of LEAST_TIMES.

    Without a reference path [m], OT is the time of the shortest path for the body, which is about an eighth shorter.
    """
    if not row.success or row.time > SCORED:
        return 0.0
    best = (row.shortest_path_length if reference_length is None else reference_length) / BEST_SPEED
    return best / min(max(row.time, LEAST_TIMES[metric] * best), MOST_TIMES * best)


def scenario(robot: str, path: str, world: int) -> dict[str, Any]:
    """One of the benchmark's worlds for a robot of ROBOTS, as a suite's scenario."""
    return {
        "scenario": {"robot": ROBOTS[robot], "world": {"family": "barn", "path": path, "world": world}},
        "overrides": {**COMMON, **OWN.get(robot, {}), "time.step": STEPS[robot]},
        "label": f"world {world}",
    }


def summed_up(rows: Sequence[EpisodeRow], references: Mapping[str, float | None]) -> dict[str, Any]:
    """Numbers of a policy's runs in worlds whose reference paths have these lengths [m]."""
    reached = [row for row in rows if row.success]
    low, high = wilson_interval(len(reached), len(rows))
    scores = {
        metric: math.fsum(score(row, references[row.scenario], metric) for row in rows) / len(rows)
        for metric in LEAST_TIMES
    }
    return {
        "worlds": len(rows),
        "success": len(reached) / len(rows),
        "in_time": sum(row.time <= SCORED for row in reached) / len(rows),
        "success_interval": [low, high],
        "collisions": sum(row.outcome == "collision" for row in rows),
        **scores,
        "time": math.fsum(row.time for row in reached) / max(len(reached), 1),
        "missed": {row.scenario: f"{row.outcome} {row.verdict}".strip() for row in rows if not row.success},
    }


def line(policy: str, robot: str, found: Mapping[str, Any]) -> list[str]:
    """The line of a table that says these numbers."""
    low, high = found["success_interval"]
    return [
        policy,
        robot,
        f"{100.0 * found['success']:.0f} [{100.0 * low:.0f}, {100.0 * high:.0f}]",
        f"{100.0 * found['in_time']:.0f}",
        str(found["collisions"]),
        *(f"{found[metric]:.4f}" for metric in LEAST_TIMES),
        f"{found['time']:.1f}",
    ]


HEADER = [
    *("policy", "robot", "success [%]", f"in {SCORED:g} s [%]", "collisions", "score", "score of 2022"),
    "time of successes [s]",
]


def reproduce(settings: Settings) -> Reproduction:
    """Drive through all worlds of the file with every robot.

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
            found = summed_up([row for row in rows if row.policy == policy], references)
            holds = holds and found["success"] >= SUCCESS_ASKED.get(robot, 0.0)
            holds = holds and (robot != "holonomic" or found["collisions"] == 0)
            data[f"{robot} {policy}"] = found
            lines.append(line(policy, robot, found))
    title = f"{len(worlds)} worlds of the BARN benchmark"
    return Reproduction(
        "barn", [Table(title, HEADER, lines)], notes(references), {"results": data}, holds, rows=episodes
    )


def notes(references: Mapping[str, float | None]) -> list[str]:
    """What has to be said beside the table."""
    unknown = sum(length is None for length in references.values())
    return [
        DWA,
        "score: OT / clip(AT, 2 OT, 8 OT), at most 0.5. score of 2022: OT / clip(AT, 4 OT, 8 OT), at most 0.25.",
        *(
            [f"OT of {unknown} worlds, whose file tells no reference path, is that of our shortest path."]
            * (unknown > 0)
        ),
        f"A run of over {SCORED:g} s is a failure in the benchmark, and scores nothing here; it goes on to its end, "
        "but for the faithful robot.",
        "holonomic: radius 0.2 m, 1 m/s. jackal: the benchmark's robot as a disc of 0.25 m, differential, 2 m/s.",
        "faithful: its limits (2 m/s, 4 rad/s, 20 m/s^2), its rectangle of 0.458 m x 0.416 m, its scanner (270 degrees, 30 m, "
        "noise of 1 mm). Not modelled: latency, a limit of angular acceleration, slip, the scanner's place 0.055 m ahead.",
        "AT is counted from the start of the episode; the benchmark's clock starts 0.1 m later.",
    ]
