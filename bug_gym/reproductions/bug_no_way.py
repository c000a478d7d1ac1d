"""Whether bugs tell rightly that there is no way: odd and enclosed goals in mazes, fields and traps.

A complete algorithm arrives where there is a way, and says "unreachable" where there is none (Lumelsky and Stepanov
1987). Whether there is one is asked of the configuration space, made with shapely: where the robot's centre may be, at
its radius and at the clearance. No world is drawn in which the two answer differently or differ in their gaps: a gap
between twice the radius and twice the clearance may count either way. Nor are there needles that a scanner misses. The
incomplete algorithms must come to an end, and must not call a goal unreachable that isn't.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from bug_gym.agents import make_policy
from bug_gym.config import Scenario, load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.progress import progress_bar
from bug_gym.evaluation.rollout import Rollout
from bug_gym.reproductions.bug_bounds import CLEARANCE, COMPLETE
from bug_gym.reproductions.replayable import Replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.scenarios import polygon_data
from bug_gym.workers import each, starred
from bug_gym.worlds.grid import carve
from bug_gym.worlds.maze import MazeWorld, maze_walls
from bug_gym.worlds.polygons import as_polygons

PROVEN = COMPLETE
INCOMPLETE = (
    *("bug0", "bug0_plus", "rev2", "rev3", "point_bug", "k_bug", "e_bug", "critical_point_bug"),
    *("modified_critical_point_bug", "operative_critical_point_bug"),
    *("apf", "apf_wall_following", "minimum_risk", "hd_bug_map"),
)
"""All others that end by themselves in still worlds they know nothing of; `hd_bug_map` claims more, but for "stuck" where cells
alone shut a goal off."""
WITHOUT_CLEARANCE = ("apf", "minimum_risk")
"""Keep what their field or their grid of risks makes them keep."""

SEEDS = 500
HALF = 6.0
"""Half the side of a world [m]."""
RADIUS, GOAL_RADIUS = 0.2, 0.3
ROBOT: dict[str, Any] = {
    "robot": {"kinematics": "holonomic", "radius": RADIUS},
    "lidar": {"beams": 360, "range": 10.0, "noise": 0.0},
    "goal": {"radius": GOAL_RADIUS},
    "time": {"limit": 1000.0},
}
MARGIN = 0.1
"""By how much the places nearest to a goal must be nearer, or farther away, than the goal's radius [m]."""
SPARE = 0.02
"""No gap is wider than twice the radius less this and narrower than twice the clearance and this [m]."""
THIN, HIDDEN = 0.005, 0.05
"""How thin half a needle is that stands unseen between two beams near the robot, and how long such a tip may be [m]."""
PLACES = 30
"""Starts and goals tried in a drawn world before the next one is drawn."""

Rng = np.random.Generator
Circle = tuple[float, float, float]
"""x, y, radius [m]."""


class Solids(NamedTuple):
    """What stands in a world."""

    circles: list[Circle]
    walls: shapely.Geometry
    """All the rest."""


# ---------------------------------------------------------------------------------------------- drawing worlds


def maze(rng: Rng) -> Solids:
    """A maze with a block of cells that is walled up, in every second one but for one passage."""
    world = MazeWorld(family="maze", bounds=(-HALF, -HALF, HALF, HALF))
    columns, rows = world.cells
    open_right, open_up = carve(columns, rows, float(rng.choice([0.0, 0.2])), rng)
    width, height = rng.integers(1, 4, 2)
    left, low = rng.integers(0, columns - width + 1), rng.integers(0, rows - height + 1)
    block = np.zeros((columns, rows), dtype=bool)
    block[left : left + width, low : low + height] = True
    passages = [(open_right, place) for place in np.argwhere(np.diff(block, axis=0) & open_right)]
    passages += [(open_up, place) for place in np.argwhere(np.diff(block, axis=1) & open_up)]
    kept = rng.integers(len(passages)) if rng.random() < 0.5 else -1
    for number, (is_open, place) in enumerate(passages):
        is_open[tuple(place)] = number == kept
    walls = [shapely.Polygon(rings[0], rings[1:]) for rings in maze_walls(world, open_right, open_up)]
    return Solids([], shapely.union_all(walls))


def field(rng: Rng) -> Solids:
    """Circles and polygons, convex and concave, about a crooked ring, every second one with a door."""
    line = shapely.LinearRing(star(rng.uniform(-3.0, 3.0, 2), rng.uniform(1.0, 2.4, 9), rng))
    walls = line.buffer(rng.uniform(0.05, 0.3), join_style="mitre", mitre_limit=2.0)
    if rng.random() < 0.5:
        walls = walls.difference(door(line, rng))
    circles: list[Circle] = []
    for place, size in zip(rng.uniform(-HALF, HALF, (30, 2)), rng.uniform(0.3, 1.0, 30), strict=True):
        polygon = shapely.Polygon(star(place, size * rng.uniform(0.3, 1.0, 7), rng))
        if rng.random() < 0.5:
            add_circle(circles, walls, (*place.tolist(), float(size)))
        elif polygon.is_valid and is_seen(polygon) and is_apart(polygon, circles, walls):
            walls = walls.union(polygon)
    return Solids(circles, walls)


def u_trap(rng: Rng) -> Solids:
    """A U among circles, its mouth open, shut, or shut but for a door."""
    half, depth, thick = rng.uniform(0.8, 2.0), rng.uniform(1.5, 4.0), rng.uniform(0.1, 0.6)
    corners = [(-0.5 * depth, half), (0.5 * depth, half), (0.5 * depth, -half), (-0.5 * depth, -half)]
    walls = shapely.LineString(corners).buffer(0.5 * thick, cap_style="square", join_style="mitre")
    mouth, kind = shapely.LineString([corners[3], corners[0]]), rng.integers(3)
    if kind > 0:
        lid = mouth.buffer(0.5 * thick, cap_style="square")
        walls = walls.union(lid.difference(door(mouth, rng)) if kind == 1 else lid)
    walls = shapely.affinity.rotate(walls, rng.uniform(0.0, 360.0), origin=(0.0, 0.0))
    walls = shapely.affinity.translate(walls, *rng.uniform(-1.5, 1.5, 2))
    circles: list[Circle] = []
    for x, y, radius in rng.uniform((-HALF, -HALF, 0.2), (HALF, HALF, 0.8), (12, 3)).tolist():
        add_circle(circles, walls, (x, y, radius))
    return Solids(circles, walls)


def star(place: NDArray[np.float64], reaches: NDArray[np.float64], rng: Rng) -> NDArray[np.float64]:
    """The corners (n, 2) of a polygon about a place, each so far from it [m]."""
    angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, len(reaches)))
    corners: NDArray[np.float64] = place + reaches[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return corners


def door(line: shapely.Geometry, rng: Rng) -> shapely.Geometry:
    """What to cut out of a wall along a line for a door of 0.8 to 1.4 m."""
    return line.interpolate(rng.uniform(0.0, 1.0), normalized=True).buffer(rng.uniform(0.4, 0.7))


def add_circle(circles: list[Circle], walls: shapely.Geometry, circle: Circle) -> None:
    """Add a circle, unless it would be too near to others or to the walls."""
    x, y, radius = circle
    if is_apart(shapely.Point(x, y).buffer(radius, quad_segs=32), circles, walls):
        circles.append(circle)


def is_seen(polygon: shapely.Polygon) -> bool:
    """Whether a polygon has no needles: a scanner of 360 beams misses their tips, and no algorithm knows of them."""
    thick = polygon.buffer(-THIN).buffer(THIN)
    return all(thick.distance(shapely.Point(corner)) <= HIDDEN for corner in polygon.exterior.coords)


def is_apart(solid: shapely.Geometry, circles: Iterable[Circle], walls: shapely.Geometry) -> bool:
    """Whether a robot passes between a solid and everything else."""
    room = min([solid.distance(shapely.Point(x, y)) - radius for x, y, radius in circles], default=math.inf)
    return bool(min(room, solid.distance(walls)) > 2.0 * (CLEARANCE + SPARE))


KINDS: dict[str, Callable[[Rng], Solids]] = {"maze": maze, "field": field, "u_trap": u_trap}
"""Seeds are shared out over these in turn."""


# ---------------------------------------------------------------------------------------------- the oracle


def free_space(solids: Solids, room: float) -> shapely.Geometry:
    """The places at least so far from everything [m]."""
    grown = [shapely.Point(x, y).buffer(radius + room, quad_segs=64) for x, y, radius in solids.circles]
    grown.append(solids.walls.buffer(room, quad_segs=32))
    return shapely.box(-HALF, -HALF, HALF, HALF).buffer(-room, join_style="mitre").difference(shapely.union_all(grown))


def holes(space: shapely.Geometry) -> Counter[int]:
    """How many parts a space has with so many holes each; it changes where a gap closes."""
    return Counter(len(part.interiors) for part in shapely.get_parts(space))


def has_way(solids: Solids, start: shapely.Point, goal: shapely.Point) -> bool | None:
    """Whether the robot gets from a start to a goal; None where that depends on a few centimetres."""
    answers = set()
    for room, reach in ((CLEARANCE, GOAL_RADIUS - MARGIN), (RADIUS, GOAL_RADIUS + MARGIN)):
        part = next(part for part in shapely.get_parts(free_space(solids, room)) if part.intersects(start))
        answers.add(part.distance(goal) <= reach)
    return answers.pop() if len(answers) == 1 else None


@dataclass(frozen=True)
class Problem:
    """A world with its answer."""

    kind: str
    seed: int
    scenario: Scenario
    has_way: bool


def problem(seed: int) -> Problem:
    """The world of a seed, start and goal anywhere out of sight in it: every second one of a kind has a way."""
    kind, wanted = list(KINDS)[seed % len(KINDS)], seed // len(KINDS) % 2 == 0
    rng = np.random.default_rng(seed)
    while True:
        solids = KINDS[kind](rng)
        wide, beside = free_space(solids, CLEARANCE + SPARE), free_space(solids, SPARE)
        if holes(wide) != holes(free_space(solids, RADIUS - SPARE)):
            continue
        for x, y, u, v in rng.uniform(-HALF, HALF, (PLACES, 4)).tolist():
            start, goal = shapely.Point(x, y), shapely.Point(u, v)
            is_free = wide.contains(start) and beside.contains(goal)
            is_odd = not wide.contains(shapely.LineString([start, goal]))
            if is_free and is_odd and has_way(solids, start, goal) is wanted:
                pose = (x, y, float(rng.uniform(-math.pi, math.pi)))
                return Problem(kind, seed, written_out(solids, pose, (u, v)), wanted)


def written_out(solids: Solids, start: tuple[float, float, float], goal: tuple[float, float]) -> Scenario:
    """A drawn world as a scenario."""
    world: dict[str, Any] = {"family": "explicit", "bounds": [-HALF, -HALF, HALF, HALF], "start": start, "goal": goal}
    world |= {"circles": solids.circles, "polygons": [polygon_data(rings) for rings in as_polygons(solids.walls)]}
    return load({**ROBOT, "world": world})


# ---------------------------------------------------------------------------------------------- the claims


class Answer(NamedTuple):
    """What a policy made of a world."""

    policy: str
    kind: str
    seed: int
    has_way: bool
    outcome: str
    verdict: str

    @property
    def is_right(self) -> bool:
        """Whether it ended as it may: a complete algorithm as the world is, others by themselves and without a lie."""
        if self.policy not in PROVEN and self.outcome == "gave_up":
            return not (self.has_way and self.verdict == "unreachable")
        ending = ("success", "") if self.has_way else ("gave_up", "unreachable")
        return (self.outcome, self.verdict) == ending


def parameters(policy: str) -> dict[str, Any]:
    """What a policy is made with here."""
    return {} if policy in WITHOUT_CLEARANCE else {"clearance": CLEARANCE}


def answers(seed: int, policies: Iterable[str]) -> list[Answer]:
    """What each policy makes of the world of a seed."""
    found, one = [], problem(seed)
    world = ScenarioEntry(one.kind, one.scenario, range(seed, seed + 1))
    for policy in policies:
        rollout = Rollout(PolicyEntry(policy, policy, parameters(policy)), world, [seed], slots=1)
        ((row,),) = rollout.worlds()
        found.append(Answer(policy, one.kind, seed, one.has_way, row.outcome, row.verdict))
    return found


def reproduce(settings: Settings) -> Reproduction:
    """Drive every policy through every world and compare what it says with the configuration space."""
    seeds = settings.seeds or SEEDS
    policies = settings.policies or (*PROVEN, *INCOMPLETE)
    for policy in policies:
        make_policy(policy, load(ROBOT), **parameters(policy))  # an unknown one is found out before the work
    jobs = [(seed, policies) for seed in range(seeds)]
    with progress_bar(shown=settings.progress) as track:
        work = each(partial(starred, answers), jobs, settings.workers)
        found = [answer for chunk in track(work, "worlds", len(jobs)) for answer in chunk]
    found.sort()
    wrong = [answer for answer in found if not answer.is_right]
    counted = {policy: counts([answer for answer in found if answer.policy == policy]) for policy in policies}
    header = ["policy", "complete", *counted[policies[0]]]
    lines = [
        [policy, "yes" if policy in PROVEN else "no", *map(str, numbers.values())]
        for policy, numbers in counted.items()
    ]
    notes = [f"wrong: a collision, no end within {ROBOT['time']['limit']:g} s, or not as the configuration space says."]
    notes += [f"{one.policy}, {one.kind}, seed {one.seed}: {one.outcome} {one.verdict}" for one in wrong[:40]]
    data = {"seeds": seeds, "clearance": CLEARANCE, "policies": counted, "wrong": [one._asdict() for one in wrong]}
    title = f"Ways and no ways in {seeds} worlds at a clearance of {CLEARANCE:g} m"
    episodes = [as_replayable(one, parameters(one.policy), partial(drawn, one.seed)) for one in found]
    notes += not_tried(found)
    return Reproduction("bug-no-way", [Table(title, header, lines)], notes, data, held(found), episodes=episodes)


def held(found: Sequence[Answer]) -> bool | None:
    """Whether verdicts held in worlds with a way and without; None: there were none of one kind, so nothing was shown."""
    if not all(one.is_right for one in found):
        return False
    return True if {one.has_way for one in found} == {True, False} else None


def not_tried(found: Sequence[Answer]) -> list[str]:
    """A note where `held` is None."""
    return (
        [] if held(found) is not None else ["not tried: more seeds are needed for worlds with a way and without one."]
    )


def drawn(seed: int) -> Scenario:
    """The scenario of a seed."""
    return problem(seed).scenario


def as_replayable(one: Answer, parameters: Mapping[str, Any], world: Any) -> Replayable:
    """An answer, for the page, with the parameters of its policy and its scenario."""
    driver = {"name": one.policy, "parameters": dict(parameters)}
    return Replayable(one.policy, one.kind, one.seed, one.is_right, one.outcome, one.verdict, driver, world)


def counts(found: Sequence[Answer]) -> dict[str, int]:
    """How often one policy ended in which way."""
    verdicts = Counter(one.verdict for one in found)
    return {
        "with a way": sum(one.has_way for one in found),
        "reached": sum(one.outcome == "success" for one in found),
        "without": sum(not one.has_way for one in found),
        "unreachable": verdicts["unreachable"],
        "looping": verdicts["looping"],
        "stuck": verdicts["stuck"],
        "wrong": sum(not one.is_right for one in found),
    }
