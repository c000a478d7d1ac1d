"""The bounds and guarantees of the Bug family, checked in random still worlds that are solvable at the clearance.

Bug1 walks at most D + 1.5 sum(p), Bug2 at most D + sum(n p) / 2 (Lumelsky and Stepanov 1987); nobody is shorter than
the shortest path; the complete ones arrive always, never touch anything, and their distances at hit and leave points
fall.
p is the perimeter of an obstacle grown by the clearance, D the distance from start to goal, n the crossings of the line
between them with that perimeter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import shapely

from bug_gym.agents import make_policy
from bug_gym.config import load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.progress import progress_bar
from bug_gym.evaluation.rollout import Rollout
from bug_gym.intervals import wilson_interval
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.workers import each, starred
from bug_gym.worlds.layout import Layout

COMPLETE = ("bug1", "bug2", "com1", "class1", "alg1", "alg2", "dist_bug", "tangent_bug", "vis_bug_21", "vis_bug_22")
NEARLY = {"rev3": 0.99}
"""Success asked of policies without a proof."""
PARAMETERS: dict[str, dict[str, Any]] = {"rev3": {"guard": True}}
"""Rev3 as printed cycles in some mazes; its guard makes it look for a better take-off at a repeated hit point."""
FALLING = ("bug1", "bug2", "com1", "class1", "alg1", "alg2")
"""Policies whose distances at hit and leave points fall, and that record both."""

SEEDS = 500
CLEARANCE = 0.3
TOLERANCE = 0.05

ROBOT = {"robot.kinematics": "holonomic", "lidar.beams": 360, "lidar.noise": 0.0, "time.limit": 3000.0}
WORLDS: dict[str, tuple[str, dict[str, Any]]] = {
    "field 20": ("static", {**ROBOT, "world.shapes": "polygons"}),
    "field 60": ("static", {**ROBOT, "world.obstacles": 60}),
    "maze": ("maze", {**ROBOT, "world.bounds": [-6.0, -6.0, 6.0, 6.0]}),
}
"""Seeds are shared out over these in turn. All are solvable at CLEARANCE by construction, without narrower gaps."""


@dataclass(frozen=True)
class Contours:
    """What the bounds are made of, in one world."""

    distance: float
    """Start to goal [m]."""
    perimeters: tuple[float, ...]
    """Of each contour that a bug can meet: those that reach into the disc round the goal through the start [m]."""
    crossings: tuple[int, ...]
    """How often the straight way crosses each of these."""

    @classmethod
    def of(cls, layout: Layout, clearance: float) -> Contours:
        """The contours of a layout: each connected piece of the boundary of what the robot's centre may not enter."""
        start, goal = shapely.Point(layout.starts[0, :2]), shapely.Point(layout.goals[0])
        shapes = [shapely.Point(x, y).buffer(radius, quad_segs=64) for x, y, radius in layout.circles]
        shapes += [shapely.Polygon(rings[0], rings[1:]) for rings in layout.polygons]
        grown = shapely.union_all([shape.buffer(clearance, quad_segs=32) for shape in shapes])
        room = shapely.Polygon(layout.border).buffer(-clearance, join_style="mitre").difference(grown)
        room = next(part for part in shapely.get_parts(room) if part.intersects(start))
        rings = [room.exterior, *room.interiors]
        near = [ring for ring in rings if ring.distance(goal) <= start.distance(goal)]
        way = shapely.LineString([start, goal])
        crossings = [len(shapely.get_parts(ring.intersection(way))) if ring.intersects(way) else 0 for ring in near]
        return cls(start.distance(goal), tuple(ring.length for ring in near), tuple(crossings))

    @property
    def bug1(self) -> float:
        """D + 1.5 sum(p) [m]."""
        return self.distance + 1.5 * math.fsum(self.perimeters)

    @property
    def bug2(self) -> float:
        """D + sum(n p) / 2 [m]."""
        return self.distance + 0.5 * math.fsum(n * p for n, p in zip(self.crossings, self.perimeters, strict=True))


@dataclass(frozen=True)
class Found:
    """What one policy did in one world."""

    policy: str
    world: str
    seed: int
    outcome: str
    verdict: str
    length: float
    shortest: float
    bug1: float
    bug2: float
    falls: bool

    @property
    def faults(self) -> list[str]:
        """The claims that it breaks."""
        faults = []
        if self.outcome == "collision":
            faults.append("collision")
        if self.outcome != "success":
            faults.append(f"{self.outcome} {self.verdict}".strip())
            return faults
        if self.length < 0.99 * self.shortest:
            faults.append("shorter than the shortest path")
        if self.policy == "bug1" and self.length > (1.0 + TOLERANCE) * self.bug1:
            faults.append("longer than D + 1.5 sum(p)")
        if self.policy == "bug2" and self.length > (1.0 + TOLERANCE) * self.bug2:
            faults.append("longer than D + sum(n p) / 2")
        if self.policy in FALLING and not self.falls:
            faults.append("distances at hit and leave points do not fall")
        return faults


def falls(memory: Any, goal: tuple[float, float], slack: float) -> bool:
    """Whether the distances to the goal at hit 1, leave 1, hit 2, leave 2 ... fall, each within `slack` [m]."""
    hits, leaves = (
        [math.dist(place, goal) for place in memory.hits],
        [math.dist(place, goal) for place in memory.leaves],
    )
    order = [distance for pair in zip(hits, leaves, strict=False) for distance in pair]
    order += hits[len(leaves) :][:1]
    return all(after <= before + slack for before, after in zip(order, order[1:], strict=False))


def drive(policy: str, world: str, seed: int, parameters: dict[str, Any]) -> Found:
    """One policy in one world."""
    name, overrides = WORLDS[world]
    scenario = load(name, overrides)
    entry = ScenarioEntry(world, scenario, range(seed, seed + 1))
    rollout = Rollout(PolicyEntry(policy, policy, parameters), entry, [seed], slots=1)
    layout = rollout.simulation.world.layout(0)
    shortest = rollout.simulation.shortest_path(0, 0).length
    contours = Contours.of(layout, CLEARANCE)
    x, y, heading = layout.starts[0]
    dx, dy = layout.goals[0] - (x, y)
    goal = (math.cos(heading) * dx + math.sin(heading) * dy, math.cos(heading) * dy - math.sin(heading) * dx)
    ((row,),) = rollout.worlds()
    memory = rollout.memory()
    step = scenario.robot.max_speed * scenario.time.step
    return Found(
        policy,
        world,
        seed,
        row.outcome,
        row.verdict,
        row.path_length + row.goal_distance,
        shortest,
        contours.bug1,
        contours.bug2,
        falls(memory, goal, step) if policy in FALLING else True,
    )


def world_of(seed: int) -> str:
    """The kind of world of a seed."""
    return list(WORLDS)[seed % len(WORLDS)]


def reproduce(settings: Settings) -> Reproduction:
    """Drive every policy through every world and check every claim."""
    seeds = settings.seeds or SEEDS
    policies = settings.policies or (*COMPLETE, *NEARLY)
    for policy in policies:
        make_policy(policy, load("static"), clearance=CLEARANCE)  # an unknown one is found out before the work
    jobs = [
        (policy, world_of(seed), seed, {"clearance": CLEARANCE, **PARAMETERS.get(policy, {})})
        for policy in policies
        for seed in range(seeds)
    ]
    with progress_bar(shown=settings.progress) as track:
        work = each(partial(starred, drive), jobs, settings.workers)
        found: list[Found] = list(track(work, "episodes", len(jobs)))
    lines, faulty, holds = [], [], True
    for policy in policies:
        mine = [one for one in found if one.policy == policy]
        reached = [one for one in mine if one.outcome == "success"]
        low, high = wilson_interval(len(reached), len(mine))
        faults = [one for one in mine if one.faults]
        faulty += faults
        enough = len(reached) >= NEARLY.get(policy, 1.0) * len(mine)
        broken = [one for one in faults if one.outcome in ("success", "collision")]
        holds = holds and enough and not broken
        ratio = math.fsum(one.length / one.shortest for one in reached) / max(len(reached), 1)
        bound = {"bug1": "bug1", "bug2": "bug2"}.get(policy)
        share = max((one.length / getattr(one, bound) for one in reached), default=math.nan) if bound else math.nan
        lines.append(
            [
                policy,
                str(len(mine)),
                f"{100.0 * len(reached) / len(mine):.1f} [{100.0 * low:.1f}, {100.0 * high:.1f}]",
                str(sum(one.outcome == "collision" for one in mine)),
                f"{ratio:.2f}",
                f"{share:.2f}" if bound else "-",
                str(len(faults)),
            ]
        )
    header = ["policy", "worlds", "success [%]", "collisions", "path / shortest", "largest share of bound", "faults"]
    notes = ["rev3 with its guard; as printed it cycles in some mazes."]
    notes += [f"{one.policy}, {one.world}, seed {one.seed}: {', '.join(one.faults)}" for one in faulty[:40]]
    data = {
        "seeds": seeds,
        "clearance": CLEARANCE,
        "policies": {line[0]: dict(zip(header[1:], line[1:], strict=True)) for line in lines},
        "faults": [
            {"policy": one.policy, "world": one.world, "seed": one.seed, "faults": one.faults} for one in faulty
        ],
    }
    title = f"Guarantees and bounds in {seeds} worlds at a clearance of {CLEARANCE:g} m"
    return Reproduction("bug-bounds", [Table(title, header, lines)], notes, data, holds)
