"""The bounds and guarantees of the Bug family, checked in random still worlds that are solvable at the clearance.

With p the perimeter of an obstacle grown by the clearance, D the distance from start to goal, n the crossings of the line
between them with that perimeter, m the local minima of the distance to the goal on it, a way is at most as long as

- Bug1: D + 1.5 sum(p); Bug2: D + sum(n p) / 2 (Lumelsky and Stepanov 1987), and VisBug-21, which is meant to be no longer
  than Bug2 (Lumelsky and Skewis 1990);
- Alg1, Alg2 (Sankaranarayanan and Vidyasagar 1990), Rev1 (Horiuchi and Noborio 2001): D + 2 sum(p);
- Com1, Class1: D and a perimeter for each hit;
- DistBug (Kamon and Rivlin 1997): not over D / STEP hits and the first, a lap each, from whose end the goal is half a lap
  farther at most: D + 1.5 p for each hit, a perimeter more where its last resort took a second lap;
- TangentBug (Kamon, Rimon and Rivlin 1998): D + sum(p) + sum(p m).

VisBug-22 and HD-BUG claim none. Sums run over obstacles that reach into the disc round the goal through the start. Nobody
is shorter than the shortest path; the complete ones arrive always, never touch anything, and their distances at hit and
leave points fall.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from bug_gym.agents import make_policy
from bug_gym.agents.bugs.dist_bug import DistBugParameters
from bug_gym.config import load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.progress import progress_bar
from bug_gym.evaluation.rollout import Rollout
from bug_gym.intervals import wilson_interval
from bug_gym.reproductions.replayable import Replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.workers import each, starred
from bug_gym.worlds.layout import Layout

COMPLETE = (
    *("bug1", "bug2", "com1", "class1", "alg1", "alg2", "dist_bug", "tangent_bug", "vis_bug_21", "vis_bug_22"),
    *("rev1", "hd_bug"),
)
NEARLY = {"rev3": 0.99}
"""Success asked of policies without a proof."""
PARAMETERS: dict[str, dict[str, Any]] = {"rev3": {"guard": True}}
"""Rev3 as printed cycles in some mazes; its guard makes it look for a better take-off at a repeated hit point."""
FALLING = ("bug1", "bug2", "com1", "class1", "alg1", "alg2")
"""Policies whose distances at hit and leave points fall, and that record both."""

SEEDS = 500
STEP = DistBugParameters().step
CLEARANCE = 0.3
TOLERANCE = 0.05
"""Share by which a robot that steps may be longer than a bound."""
RIPPLE = 0.01
"""Least depth of a local minimum of the distance to the goal on a contour [m]; arcs are polygons here."""

ROBOT = {"robot.kinematics": "holonomic", "lidar.beams": 360, "lidar.noise": 0.0, "time.limit": 3000.0}
WORLDS: dict[str, tuple[str, dict[str, Any]]] = {
    "field 20": ("static", {**ROBOT, "world.shapes": "polygons"}),
    "field 60": ("static", {**ROBOT, "world.obstacles": 60}),
    "maze": ("maze", {**ROBOT, "world.bounds": [-6.0, -6.0, 6.0, 6.0]}),
}
"""Seeds are shared out over these in turn. All are solvable at CLEARANCE by construction, without narrower gaps."""


def local_minima(ring: shapely.LinearRing, goal: shapely.Point) -> int:
    """How many local minima deeper than RIPPLE the distance to the goal has on a contour."""
    corners = shapely.get_coordinates(ring)[:-1] - shapely.get_coordinates(goal)
    along = np.roll(corners, -1, axis=0) - corners
    # The nearest point of each edge and its first corner: between them the distance rises or falls all the way.
    share = np.clip(-(corners * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-12), 0.0, 1.0)
    nearest = corners + share[:, None] * along
    distances = np.hypot(*np.stack([corners, nearest], axis=1).reshape(-1, 2).T)
    count, is_falling, turn = 0, True, float(distances.max())
    for distance in np.roll(distances, -int(distances.argmax())).tolist() + [float(distances.max())]:
        turn = min(turn, distance) if is_falling else max(turn, distance)
        if is_falling and distance > turn + RIPPLE:
            count, is_falling, turn = count + 1, False, distance
        elif not is_falling and distance < turn - RIPPLE:
            is_falling, turn = True, distance
    return max(count, 1)


@dataclass(frozen=True)
class Hit:
    """A hit point, and the way along the wall from there."""

    perimeter: float
    """Of the contour that was hit [m]."""
    walked: float
    """Along it until it was left [m]."""


@dataclass(frozen=True)
class Contours:
    """What the bounds are made of, in one world."""

    distance: float
    """Start to goal [m]."""
    perimeters: tuple[float, ...]
    """Of each contour that a bug can meet: those that reach into the disc round the goal through the start [m]."""
    crossings: tuple[int, ...]
    """How often the straight way crosses each of these."""
    minima: tuple[int, ...]
    """Local minima of the distance to the goal on each of these."""
    rings: tuple[shapely.LinearRing, ...]
    """All contours."""

    @classmethod
    def of(cls, layout: Layout, clearance: float) -> Contours:
        """The contours of a layout: each connected piece of the boundary of what the robot's centre may not enter."""
        start, goal = shapely.Point(layout.starts[0, :2]), shapely.Point(layout.goals[0])
        shapes = [shapely.Point(x, y).buffer(radius, quad_segs=64) for x, y, radius in layout.circles]
        shapes += [shapely.Polygon(rings[0], rings[1:]) for rings in layout.polygons]
        grown = shapely.union_all([shape.buffer(clearance, quad_segs=32) for shape in shapes])
        room = shapely.Polygon(layout.border).buffer(-clearance, join_style="mitre").difference(grown)
        room = next(part for part in shapely.get_parts(room) if part.intersects(start))
        rings = (room.exterior, *room.interiors)
        near = [ring for ring in rings if ring.distance(goal) <= start.distance(goal)]
        way = shapely.LineString([start, goal])
        crossings = [len(shapely.get_parts(ring.intersection(way))) if ring.intersects(way) else 0 for ring in near]
        minima = [local_minima(ring, goal) for ring in near]
        perimeters = [ring.length for ring in near]
        return cls(start.distance(goal), tuple(perimeters), tuple(crossings), tuple(minima), rings)

    def bug1(self, hits: list[Hit]) -> float:
        """D + 1.5 sum(p) [m]."""
        return self.distance + 1.5 * math.fsum(self.perimeters)

    def bug2(self, hits: list[Hit]) -> float:
        """D + sum(n p) / 2 [m]."""
        return self.distance + 0.5 * math.fsum(n * p for n, p in zip(self.crossings, self.perimeters, strict=True))

    def twice(self, hits: list[Hit]) -> float:
        """D + 2 sum(p) [m]."""
        return self.distance + 2.0 * math.fsum(self.perimeters)

    def tangent_bug(self, hits: list[Hit]) -> float:
        """D + sum(p) + sum(p m) [m]."""
        return self.distance + math.fsum((1 + m) * p for m, p in zip(self.minima, self.perimeters, strict=True))

    def each_hit(self, hits: list[Hit]) -> float:
        """D and a perimeter for each hit [m]."""
        return self.distance + math.fsum(hit.perimeter for hit in hits)

    def dist_bug(self, hits: list[Hit]) -> float:
        """D and 1.5 perimeters for each hit, 2.5 where a second lap was walked [m]; infinite is no bound."""
        laps = [2 if hit.walked > (1.0 + TOLERANCE) * hit.perimeter else 1 for hit in hits]
        return self.distance + math.fsum((0.5 + lap) * hit.perimeter for lap, hit in zip(laps, hits, strict=True))


BOUNDS: dict[str, tuple[str, Callable[[Contours, list[Hit]], float]]] = {
    "bug1": ("D + 1.5 sum(p)", Contours.bug1),
    "bug2": ("D + sum(n p) / 2", Contours.bug2),
    "vis_bug_21": ("D + sum(n p) / 2", Contours.bug2),
    **dict.fromkeys(("alg1", "alg2", "rev1"), ("D + 2 sum(p)", Contours.twice)),
    **dict.fromkeys(("com1", "class1"), ("D and a perimeter for each hit", Contours.each_hit)),
    "dist_bug": ("D and 1.5 perimeters for each hit", Contours.dist_bug),
    "tangent_bug": ("D + sum(p) + sum(p m)", Contours.tangent_bug),
}
"""What each algorithm claims of its length, in words and as a number."""
BY_HITS = ("com1", "class1", "dist_bug")
"""Those whose bound counts hits."""


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
    bound: float
    """Infinite without one [m]."""
    falls: bool
    is_hit_too_often: bool
    """Whether DistBug hits walls more often than D / STEP and once."""

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
        if self.length > (1.0 + TOLERANCE) * self.bound:
            faults.append(f"longer than {BOUNDS[self.policy][0]}")
        if self.is_hit_too_often:
            faults.append("more hits than D / STEP")
        if self.policy in FALLING and not self.falls:
            faults.append("distances at hit and leave points do not fall")
        return faults


def hits_of(memory: Any, contours: Contours, start: NDArray[np.float64], goal: tuple[float, float]) -> list[Hit]:
    """The hits of an episode that has arrived.

    Args:
        memory: of a bug, its odometry without error.
        contours: of the world.
        start: pose (3,) in the world.
        goal: odometry frame [m].
    """
    cos, sin = math.cos(start[2]), math.sin(start[2])
    ends = zip([*memory.hits[1:], goal], [*memory.hit_odometers[1:], memory.odometer], strict=True)
    hits = []
    for place, odometer, leave, (end, end_odometer) in zip(
        memory.hits, memory.hit_odometers, memory.leaves, ends, strict=False
    ):
        there = shapely.Point(start[0] + cos * place[0] - sin * place[1], start[1] + sin * place[0] + cos * place[1])
        ring = min(contours.rings, key=there.distance)
        hits.append(Hit(ring.length, end_odometer - odometer - math.dist(leave, end)))
    return hits


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
    hits = hits_of(memory, contours, layout.starts[0], goal) if policy in BY_HITS else []
    step = scenario.robot.max_speed * scenario.time.step
    return Found(
        policy,
        world,
        seed,
        row.outcome,
        row.verdict,
        row.path_length + row.goal_distance,
        shortest,
        BOUNDS[policy][1](contours, hits) if policy in BOUNDS else math.inf,
        falls(memory, goal, step) if policy in FALLING else True,
        policy == "dist_bug" and len(memory.hits) > contours.distance / STEP + 1.0,
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
    jobs = [(policy, world_of(seed), seed, parameters_of(policy)) for policy in policies for seed in range(seeds)]
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
        share = max((one.length / one.bound for one in reached), default=math.nan)
        lines.append(
            [
                policy,
                str(len(mine)),
                f"{100.0 * len(reached) / len(mine):.1f} [{100.0 * low:.1f}, {100.0 * high:.1f}]",
                str(sum(one.outcome == "collision" for one in mine)),
                f"{ratio:.2f}",
                f"{share:.2f}" if policy in BOUNDS else "-",
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
    episodes = list(map(as_replayable, sorted(found, key=lambda one: one.seed)))
    return Reproduction("bug-bounds", [Table(title, header, lines)], notes, data, holds, episodes=episodes)


def parameters_of(policy: str) -> dict[str, Any]:
    """What a policy is made with."""
    return {"clearance": CLEARANCE, **PARAMETERS.get(policy, {})}


def as_replayable(one: Found) -> Replayable:
    """An episode, for the page; one that arrived may have broken a claim all the same."""
    verdict = ", ".join(one.faults) if one.outcome == "success" else one.verdict
    driver = {"name": one.policy, "parameters": parameters_of(one.policy)}
    end = (not one.faults, one.outcome, verdict)
    return Replayable(one.policy, one.world, one.seed, *end, driver, *WORLDS[one.world])
