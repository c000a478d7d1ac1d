"""The BARN benchmark's worlds (Perille et al. 2020): success and the benchmark's scores, for every policy and three robots.

Needs the benchmark's worlds (`--data`: a .jsonl or a folder of `world_N.world` files). The score of a run is
success x OT / clip(AT, 2 OT, 8 OT), AT the time taken and OT the time of the reference path at 2 m/s: at most 0.5. Until
February 2024 it was success x OT / clip(AT, 4 OT, 8 OT), at most 0.25; both are printed. The benchmark's own figures come
from Gazebo's physics: context, not a rival.

Every policy of the table drives the benchmark's robot, as a disc and as it is (`jackal.yaml`: rectangle, scanner, limits,
latency), and a holonomic one; of some bugs something is claimed there. A learned policy drives the robot it was made for,
and is left out elsewhere. Planners that read the map are marked: they show what there is to be had.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from bug_gym.agents import AGENTS, make_policy, parameters_table, playable_names
from bug_gym.config import dump, load
from bug_gym.evaluation import evaluate
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.intervals import means, stratified_bootstrap, wilson_interval
from bug_gym.policy import MisfitError
from bug_gym.reproductions.claims import finite
from bug_gym.reproductions.replayable import replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.worlds.barn_files import load_barn

CLAIMED = (
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
"""Bugs of which something is claimed."""
PARAMETERS: dict[str, dict[str, Any]] = {
    "holonomic": {"clearance": 0.295},
    "jackal": {"clearance": 0.345},
    "faithful": {"clearance": 0.345},
}
"""Of all that keep one [m]. All of the worlds are open at a clearance of 0.35 m, not all at 0.40. Cylinders of 0.075 m on a
grid of 0.15 m leave gaps of 0.52, 0.60, 0.61, 0.66 and 0.70 m and none between. A gap of a little less than twice the
clearance may count either way: none is of that kind for the holonomic robot; for the others, which need more room to brake,
0.66 is."""

COMMON = {"lidar.beams": 720, "lidar.range": 10.0, "goal.radius": 1.0, "time.limit": 1000.0}
SCORED = 100.0
"""A run that takes longer scores nothing in the benchmark; here it goes on, to see whether it arrives, but for the faithful
robot [s]."""
ROBOTS: dict[str, dict[str, Any]] = {
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
FAITHFUL = "jackal"
"""The scenario whose robot is the benchmark's, by its own files."""

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
    """One of the benchmark's worlds for a robot of ROBOTS, or for the "faithful" one, as a suite's scenario."""
    family = {"family": "barn", "path": path, "world": world}
    if robot == "faithful":
        described, overrides = faithful(), {"time.limit": SCORED}
    else:
        described, overrides = {"robot": ROBOTS[robot]}, {**COMMON, "time.step": STEPS[robot]}
    return {"scenario": {**described, "world": family}, "overrides": overrides, "label": f"world {world}"}


@functools.cache
def faithful() -> dict[str, Any]:
    """The benchmark's robot with its scanner and clock: a scenario without its world."""
    described = dump(load(FAITHFUL))
    return {key: value for key, value in described.items() if key not in ("name", "world")}


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
        "score_2024_interval": interval([score(row, references[row.scenario]) for row in rows]),
        "collisions": sum(row.outcome == "collision" for row in rows),
        **scores,
        "time": math.fsum(row.time for row in reached) / max(len(reached), 1),
        "decision_time_mean": math.fsum(row.decision_time_mean for row in rows) / len(rows),
        "decision_time_p99": math.fsum(row.decision_time_p99 for row in rows) / len(rows),
        "missed": {row.scenario: f"{row.outcome} {row.verdict}".strip() for row in rows if not row.success},
    }


def interval(values: Sequence[float]) -> list[float | None]:
    """The 95 % interval of a mean by bootstrap; None of a single value."""
    return [finite(bound) for bound in stratified_bootstrap([values], means, resamples=1000, seed=0)]


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
    lines, data, refused, compared, episodes, holds = [], {}, {}, [], [], True
    for robot in (*ROBOTS, "faithful"):
        scenarios = [scenario(robot, str(settings.data), number) for number in worlds]
        asked = settings.policies or every_policy()
        refused[robot] = refusals(asked, scenarios[0])
        entries = [entry(name, robot) for name in asked if name not in refused[robot]]
        if not entries:
            continue
        suite = {"name": f"barn-{robot}", "scenarios": scenarios, "seeds": {"count": 1}}
        rows = evaluate(entries, suite, workers=settings.workers, progress=settings.progress)
        # A page shows robots beside one another; the number of the world stands where a seed does.
        numbers = {f"world {number}": number for number in worlds}
        compared += [replace(row, scenario=robot, seed=numbers[row.scenario]) for row in rows]
        found = replayable(rows, entries, scenarios)
        episodes += [one._replace(scenario=robot, seed=numbers[one.scenario], driven_seed=one.seed) for one in found]
        for policy in dict.fromkeys(row.policy for row in rows):
            told = summed_up([row for row in rows if row.policy == policy], references)
            holds = holds and is_as_claimed(robot, policy, told)
            data[f"{robot} {policy}"] = told
            lines.append(line(policy, robot, told))
    title = f"{len(worlds)} worlds of the BARN benchmark"
    remarks = [*notes(references), *(left_out(robot, mine) for robot, mine in refused.items() if mine)]
    data = {"results": data, "refused": refused}
    table = Table(title, HEADER, lines)
    return Reproduction("barn", [table], remarks, data, holds, rows=compared, episodes=episodes)


def every_policy() -> list[str]:
    """The policies of the table that can be played here, each once."""
    found: dict[tuple[str, str], str] = {}
    for name in playable_names():
        if name in AGENTS:
            found.setdefault((AGENTS[name].entry_point, AGENTS[name].model), name)
    return list(found.values())


def entry(policy: str, robot: str) -> dict[str, Any]:
    """A policy of a suite, at the clearance of all that keep one."""
    keeps = {name for name, parameter in parameters_table() if parameter.name == "clearance"}
    return {"name": policy, "parameters": PARAMETERS[robot] if policy in keeps else {}}


def refusals(policies: Sequence[str], described: Mapping[str, Any]) -> dict[str, str]:
    """Why policies were made for another robot than that of a scenario, by name."""
    source, found = load(described["scenario"], described["overrides"]), {}
    for policy in policies:
        if policy in AGENTS and AGENTS[policy].privileged:
            continue  # they need a live world, and drive any robot
        try:
            make_policy(policy, source)
        except MisfitError as error:
            found[policy] = str(error)
    return found


def left_out(robot: str, refused: Mapping[str, str]) -> str:
    """Who does not drive a robot, and why, in one line."""
    return f"{robot}: left out {', '.join(refused)}; made for another robot ({next(iter(refused.values()))})."


def is_as_claimed(robot: str, policy: str, found: Mapping[str, Any]) -> bool:
    """Whether a bug of which something is claimed reaches its share, and as the holonomic robot touches nothing."""
    if policy not in CLAIMED:
        return True
    return found["success"] >= SUCCESS_ASKED.get(robot, 0.0) and (robot != "holonomic" or found["collisions"] == 0)


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
        "noise of 1 mm), a latency of 0.1 s. Not modelled: a limit of angular acceleration, slip, the scanner's place 0.055 m "
        "ahead.",
        "AT is counted from the start of the episode; the benchmark's clock starts 0.1 m later.",
    ]
