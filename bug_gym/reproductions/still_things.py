"""Whether scripted policies ever touch what stands still: in many worlds, with robots and scanners of many kinds.

Each seed is a world of its own and a robot of its own: fields, thin cylinders, mazes and rooms in turn; 0.5 to 2 m/s, with
an acceleration limit of 0.5 to 5 m/s^2 or none, holonomic or differential, steps of 0.05 to 0.2 s; 32 to 360 beams over 270
degrees or all around, noise up to 0.03 m, up to 5 % of the beams lost. Nothing moves but the robot, so that every contact is
the policy's own. One that refuses a robot when it is made (`bug_gym.agents.sight`) drives nothing, and touches nothing. The
cylinders are thinner than any body: of few beams none may meet them.

The floors are not among them: `random` takes no care, and `go_to_goal` is refused no robot. In these worlds it touches
something with 50 of 2,000 (`--policies go_to_goal`), each of them holonomic with a blind side, as all others refuse.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from bug_gym.agents import AGENTS, agent
from bug_gym.config import Scenario, load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.progress import progress_bar
from bug_gym.evaluation.rollout import Rollout
from bug_gym.evaluation.summary import PRIVILEGED
from bug_gym.policy import MisfitError
from bug_gym.references import is_reference
from bug_gym.reproductions.kept import kept_runs
from bug_gym.reproductions.replayable import Replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.workers import each, starred

SEEDS = 2000
BLOCK = 8
"""Worlds that one process drives a policy through at a time."""
DRIVING = ("bug", "mapper", "planner", "local", "reciprocal", "field")
"""Families of policies whose business it is to touch nothing."""
POLICIES = tuple(name for name, line in AGENTS.items() if line.family in DRIVING and name not in ("com", "ocpb"))
"""All of them, under one name each."""
WORLDS = ("static", "cellular_automaton", "maze", "rooms")
"""Scenarios in which nothing moves; seeds are shared out over them in turn."""
LIMIT = 60.0
"""Time of an episode [s]."""
SPEEDS, ACCELERATIONS = (0.5, 2.0), (0.5, 5.0)
"""Least and greatest speed [m/s] and acceleration [m/s^2]."""
STEPS = (0.05, 0.1, 0.2)
"""[s]"""
BEAMS = (32, 64, 180, 360)
VIEWS = (270.0, 360.0)
"""Angles over which the beams are spread [degrees]."""
MOST_NOISE, MOST_DROPOUT = 0.03, 0.05
"""Greatest standard deviation of a range [m], and share of beams that are lost."""
REFUSED = "refused"
"""What is said of a policy that does not take the robot."""


def robot(seed: int) -> dict[str, Any]:
    """The robot, scanner and step of a seed, by dotted key."""
    random = np.random.default_rng([seed, len(WORLDS)])
    acceleration = None if random.random() < 1.0 / 3.0 else float(np.exp(random.uniform(*np.log(ACCELERATIONS))))
    return {
        "robot.kinematics": str(random.choice(["holonomic", "differential"])),
        "robot.max_speed": float(random.uniform(*SPEEDS)),
        "robot.max_acceleration": acceleration,
        "lidar.beams": int(random.choice(BEAMS)),
        "lidar.fov": math.radians(random.choice(VIEWS)),
        "lidar.noise": float(random.choice([0.0, random.uniform(0.0, MOST_NOISE)])),
        "lidar.dropout": float(random.choice([0.0, random.uniform(0.0, MOST_DROPOUT)])),
        "time.step": float(random.choice(STEPS)),
        "time.limit": LIMIT,
    }


def world(seed: int) -> str:
    """The scenario of a seed."""
    return WORLDS[seed % len(WORLDS)]


def scenario(seed: int) -> Scenario:
    """World and robot of a seed."""
    return load(world(seed), robot(seed))


class Drive(NamedTuple):
    """What a policy made of a seed."""

    policy: str
    seed: int
    outcome: str
    """How it ended, or REFUSED."""
    said: str
    """Its verdict, or why it was refused."""
    steps: int


def drives(policy: str, seeds: Sequence[int]) -> list[Drive]:
    """What a policy makes of some seeds."""
    return [drive(policy, seed) for seed in seeds]


def drive(policy: str, seed: int) -> Drive:
    """What a policy makes of a seed."""
    where = ScenarioEntry(world(seed), scenario(seed), range(seed, seed + 1))
    try:
        rollout = Rollout(PolicyEntry.of(policy), where, [seed], slots=1)
    except MisfitError as reason:
        return Drive(policy, seed, REFUSED, str(reason), 0)
    ((row,),) = rollout.worlds()
    return Drive(policy, seed, row.outcome, row.verdict, row.steps)


def reproduce(settings: Settings) -> Reproduction:
    """Drive every policy through every seed, and count what is touched.

    `data` is a file of what was found so far: that is not driven again, and what is new is added as it comes.
    """
    seeds = range(settings.seeds or SEEDS)
    policies = settings.policies or POLICIES
    for policy in policies:
        if not is_reference(policy):
            agent(policy)  # an unknown one is found out before the work
    blocks = [seeds[first : first + BLOCK] for first in range(0, len(seeds), BLOCK)]
    with kept_runs(settings.data, Drive, lambda one: (one.policy, one.seed), policies) as kept:
        asked = [
            (policy, [seed for seed in block if (policy, seed) not in kept]) for block in blocks for policy in policies
        ]
        jobs = [(policy, block) for policy, block in asked if block]
        with progress_bar(shown=settings.progress) as track:
            work = each(partial(starred, drives), jobs, settings.workers)
            for chunk in track(work, "blocks of worlds", len(jobs)):
                kept.add(chunk)
    found = sorted(one for one in kept.found.values() if one.policy in policies and one.seed in seeds)
    touched = [one for one in found if one.outcome == "collision"]
    counted = {policy: counts([one for one in found if one.policy == policy]) for policy in policies}
    shares = {title: by_kind(found, kind) for title, kind in KINDS.items()}
    header = ["policy", *next(iter(counted.values()))]
    lines = [[marked(policy), *map(str, line.values())] for policy, line in counted.items()]
    parts = [[title, kind, *map(str, line.values())] for title, kinds in shares.items() for kind, line in kinds.items()]
    notes = [
        f"an episode ends after {LIMIT:g} s, which is short for a maze: that a policy arrives is asked elsewhere.",
        *(f"{one.policy}, seed {one.seed} ({world(one.seed)})" for one in touched[:40]),
    ]
    data = {
        "seeds": len(seeds),
        "policies": counted,
        "kinds": {
            policy: {
                title: by_kind([one for one in found if one.policy == policy], kind) for title, kind in KINDS.items()
            }
            for policy in policies
        },
        "touched": [one._asdict() | {"world": world(one.seed), "robot": robot(one.seed)} for one in touched],
    }
    tables = [
        Table(f"What is touched in {len(seeds)} still worlds, each with a robot of its own", header, lines),
        Table("By kind of world and robot, all policies together", ["", "", *header[1:]], parts),
    ]
    episodes = [
        Replayable(
            *(one.policy, world(one.seed), one.seed, one.outcome != "collision", one.outcome, one.said, one.policy),
            partial(scenario, one.seed),
            steps=one.steps,
        )
        for one in found
        if one.outcome != REFUSED
    ]
    return Reproduction("still-things", tables, notes, data, not touched, episodes=episodes)


def marked(policy: str) -> str:
    """A policy with the mark of those that are given the map, as an evaluation has it."""
    return policy + PRIVILEGED if PolicyEntry.of(policy).is_privileged else policy


def counts(found: Sequence[Drive]) -> dict[str, int]:
    """How often something was touched, and how it ended otherwise."""
    ends = Counter(one.outcome for one in found)
    return {
        "driven": len(found) - ends[REFUSED],
        REFUSED: ends[REFUSED],
        "touched": ends["collision"],
        "arrived": ends["success"],
        "gave up": ends["gave_up"],
        "out of time": ends["timeout"],
    }


def by_kind(found: Sequence[Drive], kind: Callable[[int], str]) -> dict[str, dict[str, int]]:
    """The counts of all policies, by what a seed's world or robot is like."""
    kinds = {seed: kind(seed) for seed in {one.seed for one in found}}
    return {
        name: counts([one for one in found if kinds[one.seed] == name]) for name in sorted(set(kinds.values()), key=len)
    }


def inertia(seed: int) -> str:
    """Whether a robot's acceleration is limited."""
    return "none" if robot(seed)["robot.max_acceleration"] is None else "limited"


def noise(seed: int) -> str:
    """Whether ranges scatter or beams are lost."""
    values = robot(seed)
    return "exact" if values["lidar.noise"] == values["lidar.dropout"] == 0.0 else "noise or dropout"


def value(key: str, form: str, factor: float, seed: int) -> str:
    """A value of a robot, in words."""
    told = robot(seed)[key]
    return told if isinstance(told, str) else format(factor * told, form)


KINDS: dict[str, Callable[[int], str]] = {
    "world": world,
    "kinematics": partial(value, "robot.kinematics", "", 1.0),
    "acceleration": inertia,
    "ranges": noise,
    "beams": partial(value, "lidar.beams", ".0f", 1.0),
    "field of view [degrees]": partial(value, "lidar.fov", ".0f", 180.0 / math.pi),
    "step [s]": partial(value, "time.step", "g", 1.0),
}
"""What the counts are told apart by."""
