"""OperativeCriticalPointBug in scenes in the manner of its paper's figures, beside other bugs; what each repair is worth.

The paper (Das, Dutta and Debnath 2020) gives no numbers, so its claims are tried. Its figures show still obstacles (1), five
obstacles in one scan (5, 7), a crossing and an oncoming obstacle (9, 10), the deviation with its safety margin (11) and a
course of boxes, one of them moving, from the foot to the top (12). Overtaking and several movers are our own scenes. Then
random worlds: with sub-goals as printed, with one formula for all bearings, with legs looked at again; without SAFE_POINT,
and with the printed ways to measure gaps, to tell what moves and to reckon when tracks meet.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from bug_gym.agents import make_policy
from bug_gym.agents.critical_points.memory import OperativeMemory
from bug_gym.config import load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.progress import progress_bar
from bug_gym.evaluation.rollout import Rollout
from bug_gym.geometry import F64
from bug_gym.reproductions.replayable import Replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.workers import each, starred

OURS = "operative_critical_point_bug"
POLICIES = (OURS, "modified_critical_point_bug", "critical_point_bug", "tangent_bug", "bug2", "bug1")
CLEARANCE = 0.4
SEEDS = 1000
"""Still worlds for the claim that no gap below the circle is taken, for both kinematics; repairs are tried in a fifth."""


def still(*rings: list[list[float]]) -> dict[str, Any]:
    """A world of polygons from (0, 0) to (10, 0)."""
    return {"family": "explicit", "bounds": [-3, -8, 13, 8], "start": [0, 0, 0], "goal": [10, 0], "polygons": rings}


def box(x: float, y: float, width: float, height: float) -> list[list[float]]:
    """A box about its middle [m]."""
    w, h = 0.5 * width, 0.5 * height
    return [[x - w, y - h], [x + w, y - h], [x + w, y + h], [x - w, y + h]]


def mover(at: list[float], velocity: list[float], radius: float = 0.4) -> dict[str, Any]:
    """A disc that goes straight."""
    return {"shape": {"circle": radius}, "at": at, "motion": {"law": "bounce", "velocity": velocity}}


COURSE = [box(-1.6, 3.0, 3.0, 0.8), box(2.2, 4.6, 2.0, 1.0), box(-0.6, 6.6, 2.4, 0.7), box(2.8, 8.2, 1.6, 1.2)]
FIVE = [
    *(box(3.5, -0.3, 0.8, 1.6), box(6.0, 2.6, 1.2, 1.2), box(4.0, 5.0, 1.5, 1.0)),
    *(box(5.0, -3.6, 1.4, 1.0), box(2.0, -4.5, 1.2, 1.2)),
]
"""None hides another one from the start."""
SCENES: dict[str, dict[str, Any]] = {
    "still obstacles (1)": still(box(3.0, 0.6, 1.0, 3.2), box(6.5, -0.9, 1.0, 3.6)),
    "five obstacles (5, 7)": still(*FIVE),
    "crossing (9)": {**still(), "movers": [mover([5.0, -5.0], [0.0, 1.0])]},
    "opposite (10)": {**still(), "movers": [mover([9.0, 0.0], [-0.6, 0.0])]},
    "deviation (11)": {**still(box(7.5, 3.0, 2.0, 2.0)), "movers": [mover([6.0, -3.0], [0.0, 0.5])]},
    "course (12)": {
        **still(*COURSE),
        "bounds": [-5, -1, 5, 12],
        "start": [0, 0, 1.5708],
        "goal": [0.5, 11],
        "movers": [
            {
                "shape": {"polygon": box(0.0, 0.0, 0.6, 0.6)},
                "at": [-3.0, 5.2],
                "motion": mover([0, 0], [0.4, 0.0])["motion"],
            }
        ],
    },
    "overtaking (ours)": {**still(), "movers": [mover([2.5, 0.0], [0.3, 0.0])]},
    "several movers (ours)": {
        **still(),
        "movers": [mover([4.0, -4.0], [0.0, 0.6]), mover([7.0, 5.0], [0.0, -0.6]), mover([9.5, -0.5], [-0.4, 0.0])],
    },
}
"""The number of the figure in brackets."""

SENSORS = {"lidar": {"beams": 360, "range": 10.0}, "time": {"limit": 200.0}}
FIELD = {"lidar.beams": 360, "lidar.noise": 0.0, "lidar.range": 10.0, "time.limit": 600.0, "world.shapes": "circles"}
FIELD |= {"robot.kinematics": "holonomic", "world.obstacles": 90, "world.solvable": None, "world.separation": 14.0}
"""Still discs, many gaps between them narrower than the circle."""
MOVING = {"robot.kinematics": "holonomic", "lidar.beams": 180, "lidar.range": 8.0}

WHOLE = ("all repairs", "all repairs, differential")
"""Settings of the claim, tried in all worlds."""
REPAIRS: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "all repairs": ("static", FIELD, {}),
    "all repairs, differential": ("static", {**FIELD, "robot.kinematics": "differential"}, {}),
    "sub_goal=perpendicular": ("static", FIELD, {"sub_goal": "perpendicular"}),
    "sub_goal=printed, gap_rule=leg": ("static", FIELD, {"sub_goal": "printed", "gap_rule": "leg"}),
    "sub_goal=printed": ("static", FIELD, {"sub_goal": "printed"}),
    "safe_point=False": ("static", FIELD, {"safe_point": False}),
    "gap_rule=two_nearest": ("static", FIELD, {"gap_rule": "two_nearest"}),
    "among movers, all repairs": ("dynamic", MOVING, {}),
    "among movers, classify=open_points": ("dynamic", MOVING, {"classify": "open_points"}),
    "among movers, timing=printed": ("dynamic", MOVING, {"timing": "printed"}),
}


@dataclass(frozen=True)
class Found:
    """What came of one episode."""

    label: str
    policy: str
    outcome: str
    """Or the verdict where it gave one."""
    length: float
    """[m]."""
    time: float
    """[s]."""
    clearance: float
    """Least distance of the body to anything [m]."""
    narrow: int
    """Passages of gaps below the circle."""
    iterations: int = 0
    """Critical points chosen."""
    rotation: float = 0.0
    """[rad]."""
    moving: float = 0.0
    """T_M [s]."""
    rotating: float = 0.0
    """T_R [s]."""
    detecting: float = 0.0
    """Sum of DOT [s]."""
    seen: int = 0
    """Moving obstacles found."""
    avoided: int = 0
    """Those of them that had a virtual obstacle."""


def narrow_passages(path: F64, circles: F64, width: float) -> int:
    """How often a way (k, 2) leads between two of some discs (n, 3) nearer to each other than a width [m]."""
    count = 0
    for (x, y, r), (u, v, s) in itertools.combinations(circles.tolist(), 2):
        apart = math.hypot(u - x, v - y)
        gap = apart - r - s
        if not 0.0 < gap < width - 1e-3:
            continue
        ahead = np.array([(u - x) / apart, (v - y) / apart])
        along = (path - (x, y)) @ ahead - r
        side = (path - (x, y)) @ np.array([-ahead[1], ahead[0]])
        crossed = side[:-1] * side[1:] < 0.0
        share = side[:-1] / np.where(crossed, side[:-1] - side[1:], 1.0)
        at = along[:-1] + share * (along[1:] - along[:-1])
        count += int((crossed & (at > 0.0) & (at < gap)).sum())
    return count


def drive(
    label: str, policy: str, scenario: Any, overrides: dict[str, Any], seed: int, parameters: dict[str, Any]
) -> Found:
    """One policy in one world."""
    loaded = load(scenario, overrides)
    entry = ScenarioEntry(label, loaded, range(seed, seed + 1))
    rollout = Rollout(PolicyEntry(policy, policy, parameters), entry, [seed], slots=1)
    path = [rollout.simulation.world.pose[0, 0, :2].copy()]
    circles = rollout.simulation.world.layout(0).circles
    worlds: list[Any] = []
    while not worlds:
        worlds = rollout.advance()
        path.append(rollout.simulation.world.pose[0, 0, :2].copy())
    ((row,),) = worlds
    memory = rollout.memory()
    found = Found(
        label,
        policy,
        row.verdict or row.outcome,
        row.path_length,
        row.time,
        row.min_clearance,
        narrow_passages(np.array(path), circles, 2.0 * CLEARANCE),
    )
    if not isinstance(memory, OperativeMemory):
        return found
    cost = memory.cost
    return Found(
        **{
            **asdict(found),
            "iterations": len(memory.critical_points),
            "rotation": cost.rotation,
            "moving": cost.moving,
            "rotating": cost.rotating,
            "detecting": cost.detecting,
            "seen": len(memory.movers),
            "avoided": len(memory.avoided),
        }
    )


Job = tuple[str, str, Any, dict[str, Any], int, dict[str, Any]]
"""The arguments of `drive`."""


def jobs_of(settings: Settings) -> list[Job]:
    """All episodes: scenes, sparse worlds, still worlds and repairs."""
    seeds, policies = settings.seeds or SEEDS, settings.policies or POLICIES
    few = max(seeds // 5, 1)
    clearance = {"clearance": CLEARANCE}
    jobs: list[Job] = []
    for name, world in SCENES.items():
        for policy in policies:
            for kinematics in ("holonomic", "differential") if policy == OURS else ("holonomic",):
                described = {**SENSORS, "world": world, "robot": {"kinematics": kinematics}}
                label = name if kinematics == "holonomic" else f"{name}, differential"
                jobs.append((label, policy, described, {}, 0, clearance))
    jobs += [("sparse", policy, "static", MOVING, seed, {}) for policy in policies for seed in range(few)]
    for label, (scenario, overrides, parameters) in REPAIRS.items():
        count = seeds if label in WHOLE else few
        own = clearance if scenario == "static" else {}
        jobs += [(label, OURS, scenario, overrides, seed, {**own, **parameters}) for seed in range(count)]
    return jobs


def mean(values: list[float]) -> float:
    """The mean; 0 of none."""
    return math.fsum(values) / len(values) if values else 0.0


def arrived(found: list[Found]) -> list[Found]:
    """Those that arrived."""
    return [one for one in found if one.outcome == "success"]


def scene_table(found: list[Found]) -> Table:
    """The scenes, each with each policy."""
    header = ["scene", "policy", "outcome", "length [m]", "time [s]", "least clearance [m]", "critical points"]
    header += ["rotation [rad]", "T_M [s]", "T_R [s]", "DOT [s]", "avoided / seen"]
    rows = []
    for one in found:
        row = [one.label, one.policy, one.outcome, f"{one.length:.2f}", f"{one.time:.1f}", f"{one.clearance:.2f}"]
        own = [f"{one.iterations}", f"{one.rotation:.2f}", f"{one.moving:.1f}", f"{one.rotating:.1f}"]
        own += [f"{one.detecting:.1f}", f"{one.avoided} / {one.seen}"]
        rows.append([*row, *(own if one.policy == OURS else ["-"] * 6)])
    return Table("Scenes in the manner of the figures, their numbers in brackets", header, rows)


def repair_numbers(found: list[Found]) -> dict[str, dict[str, float]]:
    """What each repair is worth, by its label."""
    numbers = {}
    for label in REPAIRS:
        mine = [one for one in found if one.label == label]
        numbers[label] = {
            "worlds": len(mine),
            "arrived": len(arrived(mine)),
            "collisions": sum(one.outcome == "collision" for one in mine),
            "gave up": sum(one.outcome in ("stuck", "looping") for one in mine),
            "worlds with a passage below 2 r": sum(one.narrow > 0 for one in mine),
            "mean length [m]": round(mean([one.length for one in arrived(mine)]), 2),
            "mean critical points": round(mean([one.iterations for one in arrived(mine)]), 2),
            "avoided": sum(one.avoided for one in mine),
            "seen": sum(one.seen for one in mine),
        }
    return numbers


def sparse_numbers(found: list[Found], policies: tuple[str, ...]) -> dict[str, dict[str, float]]:
    """Arrivals, length and time in worlds with few obstacles, by policy, over the seeds in which all arrive."""
    mine = {policy: [one for one in found if one.label == "sparse" and one.policy == policy] for policy in policies}
    common = [k for k in range(len(mine[policies[0]])) if all(mine[one][k].outcome == "success" for one in policies)]
    return {
        policy: {
            "worlds": len(rows),
            "arrived": len(arrived(rows)),
            "mean length [m]": round(mean([rows[k].length for k in common]), 2),
            "mean time [s]": round(mean([rows[k].time for k in common]), 2),
        }
        for policy, rows in mine.items()
    }


def claims(scenes: list[Found], repairs: dict[str, Any], sparse: dict[str, Any]) -> list[list[str]]:
    """What the paper says beside what was found."""
    first = {
        one.policy: one.length for one in scenes if one.label == "still obstacles (1)" and one.outcome == "success"
    }
    order = ", ".join(f"{policy} {length:.2f} m" for policy, length in sorted(first.items(), key=lambda one: one[1]))
    every, turning = (repairs[label] for label in WHOLE)
    without = repairs["safe_point=False"]
    crowd = repairs["among movers, all repairs"]
    times = ", ".join(f"{policy} {row['mean time [s]']:.2f} s" for policy, row in sparse.items())
    below = "worlds with a passage below 2 r"
    return [
        ["its figure 1: shorter than other bugs", order],
        [
            "narrow gaps are passed, too narrow ones avoided",
            f"gaps below the circle in {every[below]} of {every['worlds']} worlds, {turning[below]} of {turning['worlds']} "
            f"with a differential robot, without SAFE_POINT in {without[below]} of {without['worlds']}",
        ],
        ["in simple worlds about the same time as the others", times],
        ["only obstacles that may cause a collision are considered", f"{crowd['avoided']} of {crowd['seen']} movers"],
        ["few iterations", f"{every['mean critical points']} critical points on the way, dense; {crowd['mean critical points']}"
         " among movers"],
        ["source and goal are all it needs", "besides, the size of the body and a safety constant"],
    ]  # fmt: skip


def reproduce(settings: Settings) -> Reproduction:
    """Play the scenes, the still worlds and the repairs."""
    policies = settings.policies or POLICIES
    if OURS not in policies:
        policies = (OURS, *policies)
    settings = Settings(settings.seeds, settings.workers, settings.data, settings.progress, policies)
    for policy in policies:
        make_policy(policy, load("static"), clearance=CLEARANCE)  # an unknown one is found out before the work
    jobs = jobs_of(settings)
    with progress_bar(shown=settings.progress) as track:
        work = each(partial(starred, drive), jobs, settings.workers, in_order=True)
        found: list[Found] = list(track(work, "episodes", len(jobs)))
    named = {*SCENES, *(f"{name}, differential" for name in SCENES)}
    scenes = [one for one in found if one.label in named]
    repairs, sparse = repair_numbers(found), sparse_numbers(found, policies)
    told = claims(scenes, repairs, sparse)
    ours = [one for one in scenes if one.policy == OURS]
    holds = all(one.outcome == "success" for one in ours)
    for every in (repairs[label] for label in WHOLE):
        holds = holds and every["collisions"] == 0 and every["worlds with a passage below 2 r"] == 0
        holds = holds and every["arrived"] + every["gave up"] == every["worlds"]
    header = list(repairs[WHOLE[0]])
    return Reproduction(
        "operative-critical-points",
        [
            scene_table(scenes),
            Table("The paper's claims", ["claim", "found"], told),
            Table(
                "What each repair is worth",
                ["setting", *header],
                [[label, *(f"{value:g}" for value in row.values())] for label, row in repairs.items()],
            ),
            Table(
                "Few still obstacles, over the worlds in which all arrive",
                ["policy", *next(iter(sparse.values()))],
                [[policy, *(f"{value:g}" for value in row.values())] for policy, row in sparse.items()],
            ),
        ],
        ["Overtaking and several movers are our own scenes. Still worlds have gaps of any width: no way is promised."],
        {
            "clearance": CLEARANCE,
            "scenes": [asdict(one) for one in scenes],
            "claims": told,
            "repairs": repairs,
            "sparse": sparse,
        },
        holds,
        episodes=[as_replayable(*pair) for pair in zip(found, jobs, strict=True)],
    )


def as_replayable(one: Found, job: Job) -> Replayable:
    """An episode, for the page."""
    label, policy, scenario, overrides, seed, parameters = job
    driver = {"name": policy, "parameters": parameters}
    return Replayable(policy, label, seed, one.outcome == "success", one.outcome, "", driver, scenario, overrides)
