"""The compiled simulation beside slow plain oracles, over thousands of worlds: scans, clearances, contacts, movers.

Worlds of every scenario of one robot take turns, each with the scenario's own settings but without noise of the scan, and
of some of them with a robot that goes 2 m in a step. It is driven through each by random actions. Ranges of some beams are
compared with shapely's and with closed forms of circles; the smallest clearance with shapely's distance from the chords of
the body to all that stands and moves; where a robot is stopped by something it has to touch it just then. Movers are
compared with the closed form of their law, and those that go through nothing must not: neither a robot nor a mover is on
the other side of a thing after a step.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from measured import free_room, rings_of, slow_scan
from numpy.typing import NDArray
from soak import commit, tell

import bug_gym
from bug_gym.config import Bounce, Crowd, Evade, RandomWalk, Replay, Scenario, Waypoints, load, scenario_names
from bug_gym.files import machine
from bug_gym.geometry import wrap
from bug_gym.simulation import Simulation
from bug_gym.worlds.layout import Layout, Mover

F64 = NDArray[np.float64]

STEPS = 20
"""Steps of a world."""
HELD = 4
"""Steps for which an action is held."""
LOOKS = (0, 10, 20)
"""After how many steps ranges are compared."""
BEAMS = 12
"""Beams that are compared at a look, drawn from all."""
PIECES = 64
"""Chords of the way of a circle beside the robot's origin in a step: it leaves them by less than a micrometre."""
PIECES_OF_ARC = 512
"""Chords of the way of a robot that goes on arcs: it leaves them likewise."""
EDGE = 1e-6
"""A beam that passes an edge within this angle may see either side of it [rad]."""

FAST = 20.0
"""Speed of robots for which walls are thin [m/s]."""
MADE_FAST = ("static", "dynamic", "maze", "rooms", "forest", "jackal")
"""Scenarios that are driven through by such ones, too."""
WITHOUT_SCENARIO = {"warehouse": {"world": {"family": "warehouse"}}}
"""Families without a scenario of one robot. Those that read somebody's files are not compared: they lay out circles, rings
and records as the others do."""

BOUNDS = {
    "range": 1e-4,
    "clearance": 1e-9,
    "clearance of a body that swings": 1.1e-5,
    "contact": 1e-9,
    "contact of a body that swings": 1.1e-5,
    "clearance of a body on an arc": 2.1e-5,
    "contact of a body on an arc": 2.1e-5,
    "robot within a thing": 1e-9,
    "mover within a thing": 1e-6,
    "crowd within one another": 1e-12,
    "waypoints": 1e-9,
    "replay": 1e-12,
    "bounce, free": 1e-9,
    "bounce, reflected": 1e-7,
    "random_walk, free": 1e-9,
    "crowd, evade": 1e-9,
    "speed of a mover": 1e-9,
}
"""Greatest deviation of each kind that is allowed [m]: those of the tests of each kind. A body that swings is stopped by up
to 1e-5 m too early (SWING of kernels/body.py) by what stands beyond its arc; what stands within it, which these worlds leave
little room for, may do so by twice that (tests/kernels/test_footprint.py), as may what stands within the arc of a robot."""

GOES_THROUGH = (Waypoints, Replay)
"""Laws of movers that mind nothing."""


@dataclass
class Tally:
    """What was compared, and how far it was off."""

    count: dict[str, int] = field(default_factory=lambda: dict.fromkeys(BOUNDS, 0))
    """Comparisons of each kind."""
    worst: dict[str, float] = field(default_factory=lambda: dict.fromkeys(BOUNDS, 0.0))
    """Greatest deviation of each kind [m]."""
    edges: int = 0
    """Beams that saw the other side of an edge that they pass within EDGE."""
    broken: list[str] = field(default_factory=list)
    """Where a bound was broken."""

    def add(self, kind: str, deviations: Any, where: str) -> None:
        """Count some deviations [m] of a kind; one that is no number breaks the bound."""
        values = np.abs(np.atleast_1d(np.asarray(deviations, dtype=np.float64)))
        if not values.size:
            return
        greatest = float(np.nan_to_num(values, nan=math.inf).max())
        self.count[kind] += values.size
        self.worst[kind] = max(self.worst[kind], greatest)
        if greatest > BOUNDS[kind]:
            self.broken.append(f"{where}: {kind}, {greatest:.3g} m")

    def within(self, kind: str, depths: Any, where: str) -> None:
        """Count how far some things are within others [m], which those that are clear of them aren't."""
        self.add(kind, np.maximum(np.asarray(depths, dtype=np.float64), 0.0), where)


# ------------------------------------------------------------------------------------------------------------- distances


class Still(NamedTuple):
    """What stands in a world: lines of the border and of polygons, and circles."""

    lines: Any
    """The rings as one MultiLineString."""
    centres: Any
    """Points of the circles (n,)."""
    radii: F64
    """Radii of the circles (n,) [m]."""

    @classmethod
    def of(cls, layout: Layout) -> Still:
        """What stands in a layout."""
        rings = [ring for ring, place in rings_of(layout) if place is None]
        lines = shapely.multilinestrings([shapely.linestrings(np.vstack([ring, ring[:1]])) for ring in rings])
        return cls(lines, shapely.points(layout.circles[:, :2]), layout.circles[:, 2])

    def gaps(self, shapes: Any) -> F64:
        """Distances (n,) from shapely's shapes (n,) to the nearest thing [m]; 0 where they meet a line."""
        nearest: F64 = shapely.distance(shapes, self.lines)
        if self.radii.size:
            nearest = np.minimum(nearest, (shapely.distance(shapes[:, None], self.centres) - self.radii).min(axis=1))
        return nearest


def body_ways(before: F64, after: F64, footprint: F64, pieces: int, *, on_arc: bool = False) -> F64:
    """Places (C, pieces + 1, 2) of a body's circles while the robot turns evenly between two poses, straight or on an arc."""
    share = np.linspace(0.0, 1.0, pieces + 1)[:, None]
    turn = wrap(after[2] - before[2])
    heading = before[2] + share[:, 0] * turn
    origin = before[:2] + share * (after[:2] - before[:2])
    if on_arc:  # the chord of a share is turned back by half of what is left to turn
        back = -0.5 * (1.0 - share[:, 0]) * turn
        longer = np.sinc(0.5 * share * turn / np.pi) / np.sinc(0.5 * turn / np.pi)
        dx, dy = (longer * share * (after[:2] - before[:2])).T
        chords = [np.cos(back) * dx - np.sin(back) * dy, np.sin(back) * dx + np.cos(back) * dy]
        origin = before[:2] + np.column_stack(chords)
    cos, sin, x, y = np.cos(heading), np.sin(heading), footprint[:, :1], footprint[:, 1:2]
    ways: F64 = origin + np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
    return ways


def gap_on_the_way(still: Still, movers: Sequence[tuple[Mover, Mover]], ways: F64, radii: F64, end: float) -> float:
    """Smallest distance [m] between a body and all things while it and the movers go on their chords.

    Args:
        still: what stands.
        movers: those that are there, before and after the step.
        ways: of the body's circles (C, pieces + 1, 2), up to the fraction `end` of the step [m].
        radii: of the circles (C,) [m].
        end: fraction of the step after which the robot stands; the movers go on, which no longer counts.
    """
    smallest = float((still.gaps(shapely.linestrings(ways)) - radii).min())
    share = end * np.linspace(0.0, 1.0, ways.shape[1])[:, None]
    for old, new in movers:
        seen_from_it = shapely.linestrings(ways - (np.array(old.at) + share * (np.array(new.at) - old.at)))
        outline, radius = (shapely.Point(0, 0), float(old.outline)) if old.is_circle else (ring_of(old), 0.0)
        smallest = min(smallest, float((shapely.distance(seen_from_it, outline) - radius - radii).min()))
    return smallest


def ring_of(mover: Mover) -> Any:
    """The outline of a polygonal mover about its place."""
    return shapely.LinearRing(np.asarray(mover.outline))


# ---------------------------------------------------------------------------------------------------------------- movers


def tour(mover: Mover, motion: Waypoints, times: F64) -> F64:
    """Places (T, 2) on a line of way-points at some times [s]."""
    gone = motion.speed * times
    points = np.array([mover.at, *motion.points])
    rounds = 0 if motion.stop else 1 + int(gone[-1] / max(float(np.hypot(*np.diff(points, axis=0).T).sum()), 1e-3))
    points = np.vstack([points, *[motion.points] * rounds])
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    places: F64 = np.column_stack([np.interp(gone, length, points[:, axis]) for axis in range(2)])
    return places


def record(motion: Replay, times: F64) -> F64:
    """Places (T, 2) of a record at some times [s], NaN before it begins and after it ends."""
    points = np.array(motion.points)
    places: F64 = np.column_stack(
        [np.interp(times, points[:, 0], points[:, axis], left=np.nan, right=np.nan) for axis in (1, 2)]
    )
    return places


def reflected(still: Still, place: F64, velocity: F64, radius: float, seconds: float) -> F64:
    """Where a disc ends that is reflected by what stands, its contacts found by bisection with shapely."""
    left = seconds
    for _ in range(32):
        if gap_ahead(still, place, velocity * left) >= radius:
            return place + velocity * left
        free, touching = 0.0, left
        while touching - free > 1e-15 * seconds:
            middle = 0.5 * (free + touching)
            if middle in (free, touching):
                break
            clear = gap_ahead(still, place, velocity * middle) >= radius
            free, touching = (middle, touching) if clear else (free, middle)
        place, left = place + velocity * free, left - free
        normal = away_from_nearest(still, place)
        if velocity @ normal < 0.0:
            velocity = velocity - 2.0 * (velocity @ normal) * normal
        place = place + 1e-12 * normal  # off the wall, so that the next contact is another one
    raise ArithmeticError("32 reflections in a step")


def gap_ahead(still: Still, place: F64, way: F64) -> float:
    """Distance from a chord to the nearest thing that stands [m]."""
    return float(still.gaps(np.array([shapely.LineString([place, place + way])]))[0])


def away_from_nearest(still: Still, place: F64) -> F64:
    """Unit vector (2,) from the nearest point of what stands to a place."""
    point = shapely.Point(place)
    foot, nearest = shapely.shortest_line(still.lines, point), float(still.lines.distance(point))
    from_there = place - shapely.get_coordinates(foot)[0]
    if still.radii.size:
        gaps = shapely.distance(point, still.centres) - still.radii
        if gaps.min() < nearest:
            from_there = place - shapely.get_coordinates(still.centres[gaps.argmin()])[0]
    unit: F64 = from_there / np.hypot(*from_there)
    return unit


def is_convex(mover: Mover) -> bool:
    """Whether a polygonal mover has no notch."""
    shape = shapely.Polygon(np.asarray(mover.outline))
    return bool(shape.convex_hull.area - shape.area < 1e-9)


def swept(old: Mover, new: Mover, shrunk: float) -> list[Any]:
    """What polygonal movers cover on a chord, less a rim [m]; one with a notch what it covers at both ends."""
    shape = shapely.Polygon(np.asarray(old.outline)).buffer(-shrunk, join_style="mitre")
    ends = [shapely.transform(shape, lambda corners, at=one.at: corners + at) for one in (old, new)]
    return [shapely.union_all(ends).convex_hull] if is_convex(old) else ends


class Bodies(NamedTuple):
    """Movers of a world at a time."""

    movers: tuple[Mover, ...]
    velocity: F64
    """Their velocities (M, 2) [m/s]."""

    @classmethod
    def of(cls, simulation: Simulation, layout: Layout) -> Bodies:
        """The movers of the first row."""
        world = simulation.world
        circles = sum(mover.is_circle for mover in layout.movers)
        first = int(world.spec["discs"][0])
        numbers = [*range(circles), *range(first, first + len(layout.movers) - circles)]
        pair = [world.array(name)[0, numbers] for name in ("body_vx", "body_vy")]
        return cls(layout.movers, np.column_stack(pair))


def compare_step(tally: Tally, still: Still, old: Bodies, new: Bodies, step: float, where: str) -> None:
    """How movers have gone in a step, beside their laws and what stands."""
    for number, (before, after) in enumerate(zip(old.movers, new.movers, strict=True)):
        motion, way = before.motion, np.array(after.at) - before.at
        if isinstance(motion, GOES_THROUGH):
            continue
        here = f"{where}, mover {number}"
        begins, ends = old.velocity[number], new.velocity[number]
        if isinstance(motion, (Crowd, Evade)):
            tally.add("crowd, evade", np.hypot(*(way - step * ends)), here)
            tally.within("speed of a mover", step * (np.hypot(*ends) - motion.speed), here)
        else:
            compare_straight(tally, still, before, way, begins, ends, step, here)
        tally.within("mover within a thing", depth(still, before, after), here)


def compare_straight(
    tally: Tally, still: Still, mover: Mover, way: F64, begins: F64, ends: F64, step: float, where: str
) -> None:
    """How a mover that bounces or walks at random has gone in a step."""
    assert isinstance(mover.motion, (Bounce, RandomWalk))
    place, radius, speed = np.array(mover.at), radius_of(mover), float(np.hypot(*begins))
    tally.add("speed of a mover", step * (np.hypot(*ends) - speed), where)
    tally.within("speed of a mover", np.hypot(*way) - step * speed, where)
    bounces = isinstance(mover.motion, Bounce)
    if gap_ahead(still, place, step * begins) >= radius:
        if bounces or bool((begins == ends).all()):
            tally.add(f"{mover.motion.law}, free", np.hypot(*(way - step * begins)), where)
    elif bounces and float(still.gaps(np.array([shapely.Point(place)]))[0]) >= radius - BOUNDS["mover within a thing"]:
        end = reflected(still, place, begins, radius, step)
        tally.add("bounce, reflected", np.hypot(*(place + way - end)), where)


def radius_of(mover: Mover) -> float:
    """Radius of the disc that a law takes a mover for: of a polygon the one about its place that holds it [m]."""
    return float(mover.outline) if mover.is_circle else float(np.hypot(*np.asarray(mover.outline).T).max())


def depth(still: Still, before: Mover, after: Mover) -> float:
    """How far a mover on a chord is within a thing that stands [m]: of a polygon, whether by more than its rim."""
    if before.is_circle:
        return float(before.outline) - gap_ahead(still, np.array(before.at), np.array(after.at) - before.at)
    rim = BOUNDS["mover within a thing"]
    gap = float(still.gaps(np.array(swept(before, after, rim))).min())
    return rim - gap if gap > 0.0 else math.inf


def depth_of_crowd(old: Sequence[Mover], new: Sequence[Mover]) -> F64:
    """How far any two discs of a crowd are within one another on their chords [m]."""
    pairs = [(a, b) for a, b in zip(old, new, strict=True) if isinstance(a.motion, Crowd) and a.is_circle]
    if len(pairs) < 2:
        return np.zeros(0)
    ways, radii = np.array([[a.at, b.at] for a, b in pairs]), np.array([float(a.outline) for a, _ in pairs])
    one, two = np.triu_indices(len(pairs), 1)
    apart: F64 = shapely.distance(shapely.linestrings(ways[one] - ways[two]), shapely.Point(0, 0))
    depths: F64 = radii[one] + radii[two] - apart
    return depths


def compare_places(tally: Tally, places: F64, start: Layout, step: float, where: str) -> None:
    """Places (T, M, 2) of movers from the start of an episode on, beside laws with a closed form for all times."""
    times = step * np.arange(len(places), dtype=np.float64)
    for number, mover in enumerate(start.movers):
        if isinstance(mover.motion, Waypoints):
            away = np.hypot(*(places[:, number] - tour(mover, mover.motion, times)).T)
            tally.add("waypoints", away, f"{where}, mover {number}")
        elif isinstance(mover.motion, Replay):
            away = np.hypot(*(places[:, number] - record(mover.motion, times)).T)
            tally.add("replay", away[~np.isnan(away)], f"{where}, mover {number}")


# ---------------------------------------------------------------------------------------------------------------- robots


def angles_of(scenario: Scenario) -> F64:
    """Angles of the beams (B,) from the heading, as the contract has them [rad]."""
    lidar = scenario.lidar
    if lidar.is_full_circle:
        return np.linspace(0.0, 2.0 * np.pi, lidar.beams, endpoint=False, dtype=np.float64)
    return np.linspace(-0.5 * lidar.fov, 0.5 * lidar.fov, lidar.beams, dtype=np.float64)


def compare_scan(tally: Tally, simulation: Simulation, layout: Layout, rng: np.random.Generator, where: str) -> None:
    """Some beams of a scan beside the slow one."""
    lidar = simulation.scenario.lidar
    assert isinstance(lidar.range, float) and isinstance(lidar.min_range, float)
    some = rng.choice(lidar.beams, min(BEAMS, lidar.beams), replace=False)
    angles, seen = angles_of(simulation.scenario)[some], simulation.world.ranges[0, 0, some].astype(np.float64)
    here = Layout(**{**vars(layout), "movers": tuple(mover for mover in layout.movers if mover.is_there)})

    def slow(turned: float) -> F64:
        pose = simulation.world.pose[0, 0]
        scan = slow_scan(here, np.zeros((0, 3)), pose, angles + turned, float(lidar.range))
        away: F64 = np.abs(seen - np.maximum(scan, float(lidar.min_range)))
        return away

    deviations = slow(0.0)
    if deviations.max() > BOUNDS["range"]:
        beside = np.minimum(slow(-EDGE), slow(EDGE))
        at_edge = (deviations > BOUNDS["range"]) & (beside <= BOUNDS["range"])
        tally.edges += int(at_edge.sum())
        deviations = np.where(at_edge, beside, deviations)
    tally.add("range", deviations, where)


def actions(rng: np.random.Generator) -> Iterator[F64]:
    """Actions (1, 1, 2), each held for some steps, the first number mostly ahead."""
    while True:
        action = np.array([[[rng.uniform(-0.2, 1.0), rng.uniform(-1.0, 1.0)]]])
        for _ in range(HELD):
            yield action


class World:
    """One world, and how far its episode has been compared."""

    def __init__(self, simulation: Simulation, seed: int, tally: Tally, where: str) -> None:
        self.simulation, self.tally, self.where = simulation, tally, where
        self.rng = np.random.default_rng(seed)
        simulation.reset(seeds=[seed])
        self.start = self.layout = simulation.world.layout(0)
        self.still = Still.of(self.layout)
        self.bodies = Bodies.of(simulation, self.layout)
        self.places = [[mover.at for mover in self.layout.movers]]
        self.goes_on_arcs = simulation.scenario.goes_on_arcs
        self.swings = "" if (simulation.world.footprint[:, :2] == 0.0).all() else " of a body that swings"
        self.swings = " of a body on an arc" if self.goes_on_arcs else self.swings
        pose = simulation.world.pose[0, 0]
        self.smallest = self.gap(pose, pose, self.layout, 1.0)

    def gap(self, before: F64, after: F64, later: Layout, end: float) -> float:
        """Smallest distance between the body and all things on the ways of a step [m]."""
        footprint = self.simulation.world.footprint
        pieces = PIECES_OF_ARC if self.goes_on_arcs else PIECES if self.swings else 1
        ways = body_ways(before, after, footprint, pieces, on_arc=self.goes_on_arcs)
        there = [pair for pair in zip(self.layout.movers, later.movers, strict=True) if pair[0].is_there]
        return gap_on_the_way(self.still, [pair for pair in there if pair[1].is_there], ways, footprint[:, 2], end)

    def run(self) -> str:
        """Drive the robot and compare; returns how it stands with it in the end."""
        outcome = "running"
        for number, action in zip(range(STEPS + 1), actions(self.rng), strict=False):
            where = f"{self.where}, step {number}"
            if number in LOOKS:
                compare_scan(self.tally, self.simulation, self.layout, self.rng, where)
            if number == STEPS or outcome != "running":
                break
            outcome = self.step(action, where)
        step = float(self.simulation.scenario.time.step)
        compare_places(self.tally, np.array(self.places).reshape(len(self.places), -1, 2), self.start, step, self.where)
        self.compare_room()
        return outcome

    def step(self, action: F64, where: str) -> str:
        """One step, compared."""
        world = self.simulation.world
        before = world.pose[0, 0].copy()
        self.simulation.step(action)
        later, outcome = world.layout(0), str(self.simulation.info()["outcome"][0, 0])
        after, wanted = world.pose[0, 0].copy(), world.array("next_pose")[0, :3]
        way, whole = math.dist(before[:2], after[:2]), math.dist(before[:2], wanted[:2])
        if self.goes_on_arcs:
            way /= float(np.sinc(0.5 * wrap(after[2] - before[2]) / np.pi))
            whole /= float(np.sinc(0.5 * (wanted[2] - before[2]) / np.pi))
        end = 1.0 if outcome == "running" else min(way / whole, 1.0)
        gap = self.gap(before, after, later, end)
        if outcome == "collision":
            self.tally.add(f"contact{self.swings}", gap, where)
            gap = 0.0
        self.smallest = min(self.smallest, gap)
        reached = float(world.array("min_clearance")[0, 0])
        self.tally.add(f"clearance{self.swings}", reached - self.smallest, where)
        bodies = Bodies.of(self.simulation, later)
        step = float(self.simulation.scenario.time.step)
        compare_step(self.tally, self.still, self.bodies, bodies, step, where)
        self.tally.within("crowd within one another", depth_of_crowd(self.layout.movers, later.movers), where)
        self.layout, self.bodies = later, bodies
        self.places.append([mover.at for mover in later.movers])
        return outcome

    def compare_room(self) -> None:
        """That the body is neither inside what stands nor outside the border."""
        body = self.simulation.scenario.robot.body(tuple(self.simulation.world.pose[0, 0].tolist()))
        depths = [radius - free_room(self.layout, (x, y)) for x, y, radius in body]
        self.tally.within("robot within a thing", depths, self.where)


def numbers_of(layout: Layout) -> bytes:
    """What tells two worlds apart: their numbers."""
    rings = [np.ravel(ring) for ring, _ in rings_of(layout)]
    at = [np.ravel([mover.at for mover in layout.movers])]
    return np.concatenate([*rings, layout.circles.ravel(), layout.starts.ravel(), layout.goals.ravel(), *at]).tobytes()


def single_robot_scenarios() -> dict[str, Simulation]:
    """A simulation of one world of each scenario of one robot, without noise of the scan."""
    quiet = {"lidar.noise": 0.0, "lidar.dropout": 0.0}
    scenarios = {name: load(name, quiet) for name in scenario_names()}
    scenarios |= {name: load(data, quiet) for name, data in WITHOUT_SCENARIO.items()}
    fast = {**quiet, "robot.max_speed": FAST}
    scenarios |= {f"{name} at {FAST:g} m/s": load(name, fast) for name in MADE_FAST}
    return {name: Simulation(one) for name, one in scenarios.items() if one.robots.count == 1}


def compare(worlds: int) -> dict[str, Any]:
    """Compare some worlds, the scenarios in turn, their seeds from 0 on; what came of it, for JSON."""
    tally, simulations, began = Tally(), single_robot_scenarios(), time.monotonic()
    ends: dict[str, int] = {}
    different: set[tuple[str, bytes]] = set()
    names = list(simulations)
    for number in range(worlds):
        seed, turn = divmod(number, len(names))
        name = names[turn]
        world = World(simulations[name], seed, tally, f"{name}, seed {seed}")
        different.add((name, numbers_of(world.start)))
        end = world.run()
        ends[end] = ends.get(end, 0) + 1
        if (number + 1) % 500 == 0:
            tell(f"{number + 1} worlds, {time.monotonic() - began:.0f} s, broken: {len(tally.broken)}")
    kinds = {
        kind: {"comparisons": tally.count[kind], "greatest": tally.worst[kind], "bound": bound}
        for kind, bound in BOUNDS.items()
    }
    return {
        "worlds": worlds, "different": len(different), "scenarios": names, "steps": STEPS, "beams": BEAMS,
        "seconds": round(time.monotonic() - began, 1), "outcomes": ends, "edge": EDGE, "beams_at_edges": tally.edges,
        "kinds": kinds, "broken": len(tally.broken), "first_broken": tally.broken[:20],
    }  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare, and write what came of it; 1 where a bound is broken."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--worlds", type=int, default=10_000, help="how many (default: 10000)")
    parser.add_argument("--out", type=Path, help="JSON to write (default: on the terminal only)")
    options = parser.parse_args(arguments)
    made_by = {"bug_gym": bug_gym.__version__, "commit": commit(), "python": platform.python_version()}
    found = compare(options.worlds)
    holds = found["broken"] == 0
    text = json.dumps({"name": "oracle", "holds": holds, **made_by, "machine": machine(), **found}, indent=1) + "\n"
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    print(text, end="")
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
