"""RRT*: a tree of straight pieces to random places, each time drawn shorter (a map planner).

Source: Karaman and Frazzoli (2011); once there is a way, samples are drawn from the ellipse that can hold a shorter one:
Gammell, Srinivasa and Barfoot (2014), Informed RRT*. Sensing assumed: the map, own place on it. Memory kept: the way.
States: planning, following, waiting. Guarantee: with ever more samples a way if there is one, ever nearer to the shortest;
with a number of them none, and where it has found none several times it says "stuck". That there is no way no number of
samples tells; where they find none the map is asked. Length: of the best way that the tree came to in `samples` samples. A
place that is rewired later is not tried for the goal again, which was worth at most 0.3 % in 48 trees of 500 samples.

Pieces are tried exactly against the map. Samples are numbers drawn from the parameter `seed` and the number of the plan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from bug_gym.agents.parameters import AtMost, Length
from bug_gym.agents.planning.follow import Scene
from bug_gym.agents.planning.grid import Nodes
from bug_gym.agents.planning.map import PlanningMap
from bug_gym.agents.planning.planner import (
    MapPlanner,
    Plan,
    PlannerMemory,
    PlannerParameters,
    Room,
    is_shut_in,
    live_of,
    mover_discs,
    no_way,
)
from bug_gym.agents.planning.smoothing import Solids, is_clear, pulled
from bug_gym.compiling import called, inlined, kernel
from bug_gym.geometry import F64, Point
from bug_gym.kernels.geometry import length
from bug_gym.kernels.layout import Floats

GOAL_SHARE = 0.05
"""Share of the samples that are the goal itself, until there is a way."""

WIDER = 1.1
"""How much wider than the least for which RRT* is proven the circle is in which the tree is drawn shorter."""

SMOOTH_STEP = 0.1
"""How far apart the places are from which a way is pulled straight [m]."""

PATIENCE, MOST_PLACES = 50, 3
"""How many times as many samples the policy draws where it is narrow, see `rrt_star`, and how many times as many places
its tree may have then: in a maze few samples can be joined, and those that can lie in dead ends."""

TRIES = 4
"""Plans without a way after which the policy says so."""


class Tree(NamedTuple):
    """The places that are reached (n,), the first one the start."""

    x: Floats
    y: Floats
    parent: Nodes
    """Number of the place from which each is reached."""


class Grown(NamedTuple):
    """What has come of samples."""

    places: F64
    """The best way (k, 2) [m], none where none was found."""
    lengths: F64
    """Its length after each sample (n,) [m], infinite before the first way."""


def rrt_star(
    solids: Solids,
    box: tuple[float, float, float, float],
    start: Point,
    goal: Point,
    *,
    samples: int,
    seed: int | tuple[int, ...] = 0,
    step: float = 5.0,
    patience: int = 1,
) -> Grown:
    """The best way of a tree of random places.

    Args:
        solids: what pieces keep clear of.
        box: xmin, ymin, xmax, ymax of where places are drawn until there is a way [m].
        start: root of the tree [m].
        goal: where to [m].
        samples: how many places are drawn.
        seed: what they are drawn from.
        step: the longest piece [m].
        patience: how many times as many are drawn while there is no way and the tree has fewer than three times so many
            places; from the first way on, `samples` more.

    Raises:
        ValueError: the start or the goal is not clear.
    """
    for name, place in (("start", start), ("goal", goal)):
        if not solids.is_clear(place, place):
            where = f"({place[0]:g}, {place[1]:g})"
            raise ValueError(f"the {name} {where} lies in an obstacle, or nearer to one than {solids.growth:g} m")
    draws = np.random.default_rng(seed).random((samples * patience, 3))
    room = (MOST_PLACES + 1) * samples + 1
    tree = Tree(np.empty(room), np.empty(room), np.zeros(room, dtype=np.int32))
    lengths, near = np.full(len(draws), np.inf), np.empty(room, dtype=np.int32)
    ends, around = np.array([*start, *goal]), np.array(box)
    last, drawn = grow(
        tree, ends, around, draws, samples, step, solids.edges, solids.discs, solids.growth, lengths, near
    )
    lengths = lengths[:drawn]
    if last < 0:
        return Grown(np.zeros((0, 2)), lengths)
    chain = [int(last)]
    while chain[-1] != 0:
        chain.append(int(tree.parent[chain[-1]]))
    places = [(float(tree.x[node]), float(tree.y[node])) for node in reversed(chain)]
    return Grown(np.array([*places, goal]), lengths)


@kernel
def grow(
    tree: Tree,
    ends: Floats,
    box: Floats,
    draws: Floats,
    samples: int,
    step: float,
    edges: Floats,
    discs: Floats,
    growth: float,
    lengths: Floats,
    near: Nodes,
) -> tuple[int, int]:
    """Grow a tree by samples. Returns the place from which the goal is reached, or -1, and how many draws were used.

    Args:
        tree: room for it; written here.
        ends: x, y of the start and of the goal (4,) [m].
        box: see rrt_star (4,) [m].
        draws: three numbers from 0 to 1 a sample (n, 3).
        samples: how many of them are used, and more where rrt_star's patience says so.
        step: the longest piece [m].
        edges: what pieces keep clear of (e, 4).
        discs: the same (d, 3).
        growth: how far they keep clear of it [m].
        lengths: of the best way after each sample (n,) [m]; written here.
        near: working memory, as long as the tree has room.
    """
    tree.x[0], tree.y[0], tree.parent[0] = ends[0], ends[1], 0
    count, last, number, end = 1, -1, 0, samples
    apart = length(ends[2] - ends[0], ends[3] - ends[1])
    if apart <= step and is_clear(ends[0], ends[1], ends[2], ends[3], edges, discs, growth):
        last = 0
    while number < end or (last < 0 and count < MOST_PLACES * samples and number < len(draws)):
        best = length_by(tree, last, ends)
        draw, lengths[number] = draws[number], best
        number += 1
        x, y = place_in_box(draw, ends, box) if last < 0 else place_in_ellipse(draw, ends, best)
        nearest, away = nearest_to(tree, count, x, y)
        if away == 0.0:
            continue
        if away > step:
            x = tree.x[nearest] + step / away * (x - tree.x[nearest])
            y = tree.y[nearest] + step / away * (y - tree.y[nearest])
        if not is_clear(tree.x[nearest], tree.y[nearest], x, y, edges, discs, growth):
            continue
        area = (box[2] - box[0]) * (box[3] - box[1])
        if last >= 0:
            area = min(0.25 * math.pi * best * math.sqrt(max(best * best - apart * apart, 0.0)), area)
        reach = min(WIDER * 2.0 * math.sqrt(1.5 * area / math.pi * math.log(count + 1.0) / (count + 1.0)), step)
        found = places_near(tree, count, x, y, reach, near)
        join(tree, count, x, y, nearest, near, found, edges, discs, growth)
        count += 1
        rewire(tree, count - 1, near, found, edges, discs, growth)
        rest = length(ends[2] - x, ends[3] - y)
        is_shorter = rest <= step and cost_to(tree, count - 1) + rest < length_by(tree, last, ends)
        if is_shorter and is_clear(x, y, ends[2], ends[3], edges, discs, growth):
            if last < 0 and number > samples:
                end = min(number + samples, len(draws))
            last = count - 1
        lengths[number - 1] = length_by(tree, last, ends)
    return last, number


@inlined
def place_in_box(draw: Floats, ends: Floats, box: Floats) -> tuple[float, float]:
    """A random place anywhere; now and then the goal."""
    if draw[2] < GOAL_SHARE:
        return ends[2], ends[3]
    return box[0] + draw[0] * (box[2] - box[0]), box[1] + draw[1] * (box[3] - box[1])


@inlined
def place_in_ellipse(draw: Floats, ends: Floats, longest: float) -> tuple[float, float]:
    """A random place of the ellipse of ways no longer than `longest` [m]."""
    u, v = draw[0], draw[1]
    dx, dy = ends[2] - ends[0], ends[3] - ends[1]
    apart = length(dx, dy)
    if apart == 0.0:
        return ends[2], ends[3]
    ahead = 0.5 * longest * math.sqrt(u) * math.cos(2.0 * math.pi * v)
    aside = 0.5 * math.sqrt(max(longest * longest - apart * apart, 0.0)) * math.sqrt(u) * math.sin(2.0 * math.pi * v)
    x = 0.5 * (ends[0] + ends[2]) + (ahead * dx - aside * dy) / apart
    y = 0.5 * (ends[1] + ends[3]) + (ahead * dy + aside * dx) / apart
    return x, y


@inlined
def nearest_to(tree: Tree, count: int, x: float, y: float) -> tuple[int, float]:
    """The place of the tree that is nearest to another, and how far it is [m]."""
    best, least = 0, np.inf
    for node in range(count):
        dx, dy = tree.x[node] - x, tree.y[node] - y
        if dx * dx + dy * dy < least:
            best, least = node, dx * dx + dy * dy
    return best, math.sqrt(least)


@inlined
def places_near(tree: Tree, count: int, x: float, y: float, reach: float, near: Nodes) -> int:
    """Write the places of the tree within reach of another; returns how many there are."""
    found = 0
    for node in range(count):
        dx, dy = tree.x[node] - x, tree.y[node] - y
        if dx * dx + dy * dy <= reach * reach:
            near[found] = node
            found += 1
    return found


@called
def cost_to(tree: Tree, node: int) -> float:
    """Length of the way through the tree to one of its places [m]."""
    total = 0.0
    while node != 0:
        up = tree.parent[node]
        total += length(tree.x[node] - tree.x[up], tree.y[node] - tree.y[up])
        node = up
    return total


@inlined
def length_by(tree: Tree, last: int, ends: Floats) -> float:
    """Length of the way whose last place but the goal is `last` [m], infinite for none."""
    if last < 0:
        return np.inf
    return cost_to(tree, last) + length(ends[2] - tree.x[last], ends[3] - tree.y[last])


@called
def join(
    tree: Tree,
    node: int,
    x: float,
    y: float,
    nearest: int,
    near: Nodes,
    found: int,
    edges: Floats,
    discs: Floats,
    growth: float,
) -> None:
    """Put a place into the tree, reached from the one near it from which the whole way is shortest."""
    parent = nearest
    least = cost_to(tree, nearest) + length(x - tree.x[nearest], y - tree.y[nearest])
    for index in range(found):
        other = near[index]
        total = cost_to(tree, other) + length(x - tree.x[other], y - tree.y[other])
        if total < least and is_clear(tree.x[other], tree.y[other], x, y, edges, discs, growth):
            parent, least = other, total
    tree.x[node], tree.y[node], tree.parent[node] = x, y, parent


@called
def rewire(tree: Tree, node: int, near: Nodes, found: int, edges: Floats, discs: Floats, growth: float) -> None:
    """Reach the places near a new one through it, where that is shorter."""
    x, y = tree.x[node], tree.y[node]
    so_far = cost_to(tree, node)
    for index in range(found):
        other = near[index]
        total = so_far + length(x - tree.x[other], y - tree.y[other])
        is_shorter = other != 0 and total < cost_to(tree, other) - 1e-12
        if is_shorter and is_clear(x, y, tree.x[other], tree.y[other], edges, discs, growth):
            tree.parent[other] = node


@dataclass(frozen=True)
class RRTStarParameters(PlannerParameters):
    """Parameters of RRT*."""

    samples: Annotated[int, AtMost(20_000)] = 4000
    """Number of places that are drawn for a plan; up to 50 times as many where few can be joined to the tree."""
    step: Length = 5.0
    """The longest piece of the tree [m]."""
    seed: Annotated[int, AtMost(2**63 - 1)] = 0
    """Number that the draws are a function of."""
    smooth: bool = True
    """Whether ways are pulled straight."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.01 <= self.step < math.inf:
            raise ValueError(f"step must be finite and at least 0.01 m, got {self.step!r}")
        if self.samples < 1:
            raise ValueError(f"samples must be at least 1, got {self.samples!r}")
        if self.seed < 0:
            raise ValueError(f"seed must not be negative, got {self.seed!r}")


class RRTStar(MapPlanner):
    """Informed RRT* on the map.

    Raises:
        TypeError: an unknown parameter.
        ValueError: what MapPlanner refuses; a step below a centimetre, no samples, a seed below 0.
    """

    Parameters: ClassVar[type[RRTStarParameters]] = RRTStarParameters
    parameters: RRTStarParameters

    def plan(self, scene: Scene, memory: PlannerMemory) -> Plan:
        """The best way of a tree with as much room as there is."""
        live = live_of(memory)
        plan = live.still if scene.moving is None else live.still.with_obstacles(mover_discs(scene.moving))
        for room in self.rooms:
            places = self._way(plan, room, scene, memory.plans)
            if len(places) > 0:
                return Plan(places, room.margin)
        if scene.moving is None and is_shut_in(plan, scene.pose[:2], scene.goal, self.sensors):
            return Plan(None, reason=no_way(plan, scene, self.sensors), verdict="unreachable")
        reason = f"no way was found by {self.parameters.samples} samples and more, which proves nothing"
        return Plan(None, reason=reason, verdict="stuck" if self.gives_up(scene, memory) else "")

    def gives_up(self, scene: Scene, memory: PlannerMemory) -> bool:
        """Whether it has drawn anew often enough."""
        return scene.moving is None and memory.plans >= TRIES

    def _way(self, plan: PlanningMap, room: Room, scene: Scene, number: int) -> F64:
        """The best way from the robot to the goal (k, 2), none where there is none.

        Patience is for the narrow: not for what is shut, and not for movers, who may soon be gone.
        """
        nowhere = np.zeros((0, 2))
        # A free place may be nearer to an obstacle by as much as a polygon's chords are to their arc.
        wider = 1.02 * room.growth
        start = plan.free_place_near(scene.pose[:2], radius=wider, reach=2.0 * wider)
        goal = plan.free_place_near(scene.goal, radius=wider, reach=0.9 * self.sensors.goal_radius)
        solids = Solids.of(plan, room.growth)
        if start is None or goal is None or not solids.is_clear(start, start) or not solids.is_clear(goal, goal):
            return nowhere
        own = self.parameters
        seed = (own.seed, number)
        grown = partial(rrt_star, solids, plan.box, start, goal, samples=own.samples, seed=seed, step=own.step)
        found = grown().places
        if len(found) == 0 and scene.moving is None and plan.joins(start, goal, radius=room.growth):
            found = grown(patience=PATIENCE).places
        if len(found) == 0:
            return nowhere
        places = pulled(found, SMOOTH_STEP, solids.is_clear) if own.smooth else found
        return np.concatenate([[scene.pose[:2]], places])
