"""`orca` where everyone is in everyone's way: robots that change places across a circle, and crowds that cross.

The first part is the example "Circle" of RVO2, the library of van den Berg, Guy, Snape, Lin and Manocha, with 2 to 16
robots, of either kinematics: at least 500 runs of robots a line. What is claimed of `orca`: no two robots touch, and all
arrive. The time and the way by which they arrive are printed beside it.

The second part sets robots that know of one another beside ones that do not: the same worlds with `orca`, and with each
robot alone with `hd_bug` and with `ppo_rush`, which see the others as movers with their scanners only.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bug_gym.evaluation.missions import missions
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.intervals import means, stratified_bootstrap, wilson_interval
from bug_gym.reproductions.claims import mean, numbers, of, run
from bug_gym.reproductions.replayable import Replayable, replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table

ROBOTS = (2, 4, 8, 16)
KINEMATICS = ("holonomic", "differential")
RUNS = 500
"""Runs of robots for each line of the first part, at least."""
CROWDS: dict[str, tuple[str, int, int]] = {
    "random_crossings, 4": ("random_crossings", 4, 25),
    "circle_swap, 8": ("circle_swap", 8, 25),
    "warehouse_team, 8": ("warehouse_team", 8, 25),
}
"""Scenario, robots and worlds of the second part, by label; differential robots as in `rush`."""
ALONE = ("hd_bug", "ppo_rush")


def reproduce(settings: Settings) -> Reproduction:
    """Drive robots across circles, then crowds with each policy."""
    circles, lines, episodes = {}, [], []
    for kinematics in KINEMATICS:
        for robots in ROBOTS:
            worlds = min(math.ceil(RUNS / robots), settings.seeds or RUNS)
            rows, shown = drive(["orca"], "circle_swap", robots, kinematics, worlds, settings)
            episodes += shown
            circles[f"{kinematics}, {robots}"] = told = measured(rows)
            lines.append([kinematics, str(robots), str(len(rows)), *words(rows, told), f"{told['longest']:.1f}"])
    holds = all(told["contacts"] == 0 and told["success"] == 1.0 for told in circles.values())
    crowds, compared, shown = crossing_crowds(settings)
    header = ["kinematics", "robots", "runs", *HEADER, "longest [s]"]
    tables = [
        Table("Changing places across a circle of 4 m with orca", header, lines),
        Table("Crowds that cross", ["worlds", "policy", *HEADER, "success minus orca's [%]"], compared),
    ]
    data = {"circles": circles, "crowds": crowds}
    return Reproduction("circle-swap", tables, NOTES, data, holds, episodes=[*episodes, *shown])


HEADER = (
    "reached [%]",
    "all arrive [%]",
    "contacts",
    "least gap [m]",
    "time [s]",
    "way over straight",
    "decision [us]",
)


def crossing_crowds(settings: Settings) -> tuple[dict[str, Any], list[list[str]], list[Replayable]]:
    """Numbers by scenario and policy, lines of a table, and the episodes."""
    data, lines, episodes = {}, [], []
    policies = settings.policies or ("orca", *ALONE)
    for label, (scenario, robots, most) in CROWDS.items():
        worlds = min(most, settings.seeds or most)
        rows, shown = drive(policies, scenario, robots, "differential", worlds, settings)
        episodes += shown
        for policy in policies:
            mine = of(rows, policy=policy)
            data[f"{label}, {policy}"] = told = measured(mine)
            against = ""
            if policy != "orca" and "orca" in policies:
                against = share_minus(mine, of(rows, policy="orca"))
            lines.append([label, policy, *words(mine, told), against])
    return data, lines, episodes


def share_minus(mine: list[EpisodeRow], other: list[EpisodeRow]) -> str:
    """Share of the robots that arrive minus the other policy's [%], with its 95 % interval: a bootstrap of worlds."""
    ours, theirs = (
        np.array([np.mean([row.success for row in mission.rows]) for mission in missions(rows)])
        for rows in (mine, other)
    )
    gaps = 100.0 * (ours - theirs)
    interval = stratified_bootstrap([gaps], means)
    return f"{gaps.mean():+.1f} [{interval.low:+.1f}, {interval.high:+.1f}]"


def drive(
    policies: list[str] | tuple[str, ...], scenario: str, robots: int, kinematics: str, worlds: int, settings: Settings
) -> tuple[list[EpisodeRow], list[Replayable]]:
    """Episodes of several robots with some policies, each robot by itself."""
    overrides = {"robots.count": robots, "robot.kinematics": kinematics}
    entry = {"scenario": scenario, "label": scenario, "overrides": overrides}
    rows = run(list(policies), [entry], worlds, settings, name="circle-swap")
    return rows, replayable(rows, policies, [entry], f"{{}}, {robots} {kinematics}")


def measured(rows: list[EpisodeRow]) -> dict[str, Any]:
    """What JSON keeps of the runs of one policy's robots, and of their worlds: those in which all arrive."""
    worlds = missions(rows)
    won = sum(mission.success for mission in worlds)
    told = numbers(rows)
    del told["success_interval"]  # robots of a world are not independent
    return {
        **told,
        "worlds": len(worlds),
        "all_arrive": won / len(worlds),
        "all_arrive_interval": list(wilson_interval(won, len(worlds))),
        "contacts": sum(row.outcome == "collision" for row in rows),
        "least_gap": min(row.min_clearance for row in rows),
        "longest": max(row.time for row in rows),
    }


def words(rows: list[EpisodeRow], told: dict[str, Any]) -> list[str]:
    """The columns of HEADER."""
    reached = [row for row in rows if row.success]
    time, ratio = mean([row.time for row in reached]), told["path_ratio"]
    low, high = told["all_arrive_interval"]
    return [
        f"{100.0 * told['success']:.1f}",
        f"{100.0 * told['all_arrive']:.1f} [{100.0 * low:.1f}, {100.0 * high:.1f}]",
        str(told["contacts"]),
        f"{told['least_gap']:.3f}",
        f"{time:.1f}",
        "-" if ratio is None else f"{ratio:.3f}",
        f"{1e6 * told['decision_time_mean']:.0f}",
    ]


NOTES = [
    "Each robot's start lies within 0.1 m of its place on the circle, which is turned at random.",
    "least gap: the smallest distance of a body to anything, robots and walls; a contact counts for both robots.",
    "way over straight: over the shortest path of the robot alone.",
    "Intervals count worlds, since robots that share one are not independent.",
]
