"""What the tests of policies share: one episode as data, and the closed forms of the canonical worlds.

Closed forms are of an ideal point that follows the rounded contour (obstacle grown by a disc of the clearance c), see
the formulas of each world below.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents import make_policy
from bug_gym.simulation import Simulation


@dataclass(frozen=True)
class Episode:
    """What came of one episode."""

    outcome: str
    verdict: str
    length: float
    """Length of the way [m]."""
    goal_distance: float
    """Distance to the goal at the end [m]."""
    min_clearance: float
    """Smallest distance of the body to anything [m]."""
    path: NDArray[np.float64]
    """True poses (T, 3)."""
    memory: Any
    """The policy's memory at the end."""
    modes: tuple[str, ...]
    """The memory's mode after each decision."""
    simulation: Simulation

    @property
    def full_length(self) -> float:
        """Way and the rest of it to the goal [m], which the closed forms give."""
        return self.length + self.goal_distance


def run_episode(
    policy: str,
    scenario: Any,
    overrides: Mapping[str, Any] | None = None,
    *,
    seed: int = 0,
    max_steps: int = 100_000,
    **parameters: Any,
) -> Episode:
    """Run a policy in a world until the episode ends or the policy gives a verdict."""
    simulation = Simulation(scenario, 1, overrides=overrides)
    agent = make_policy(policy, simulation, **parameters)
    observation = simulation.reset(seeds=[seed])
    state: tuple[Any, ...] | None = None
    path = [simulation.world.pose[0, 0].copy()]
    modes = []
    for _ in range(max_steps):
        action, state = agent.predict(observation[:, 0], state)
        assert state is not None
        modes.append(state[0].mode)
        if state[0].verdict:
            break
        step = simulation.step(action[:, None])
        observation = step.observation
        path.append(simulation.world.pose[0, 0].copy())
        if step.terminated.any() or step.truncated.any():
            break
    info = simulation.info()
    assert state is not None
    return Episode(
        outcome=info["outcome"][0, 0],
        verdict=state[0].verdict,
        length=float(info["path_length"][0, 0]),
        goal_distance=float(info["goal_distance"][0, 0]),
        min_clearance=float(info["min_clearance"][0, 0]),
        path=np.array(path),
        memory=state[0],
        modes=tuple(modes),
        simulation=simulation,
    )


CLOSED_FORM_SENSORS = {"lidar.beams": 360, "lidar.range": 10.0, "time.limit": 600.0}
"""A point bug's world as a robot of radius 0.2 m sees it: 360 beams, steps of 0.1 m."""


OTHER = {"left": "right", "right": "left"}
"""The other turn."""

CANONICAL_POLYGONS: dict[str, list[list[float]]] = {
    "slab": [[8, -3], [12, -3], [12, 5], [8, 5]],
    "u_trap": [[5, -4], [12, -4], [12, 4], [5, 4], [5, 3], [11, 3], [11, -3], [5, -3]],
}


def in_world(episode: Episode, places: Any) -> NDArray[np.float64]:
    """Places (k, 2) of the odometry frame, which has no error here, in the world."""
    x, y, heading = episode.path[0]
    cos, sin = math.cos(heading), math.sin(heading)
    points: NDArray[np.float64] = np.asarray(places).reshape(-1, 2) @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
    return points


def goal_distances(episode: Episode, places: Any = None) -> NDArray[np.float64]:
    """Distances to the goal (k,) of places (k, 2) of the odometry frame, or of each place of the way [m]."""
    points = episode.path[:, :2] if places is None else in_world(episode, places)
    return np.asarray(np.linalg.norm(points - episode.simulation.world.layout(0).goals[0], axis=1))


def canonical_world(world: str, *, angle: float = 0.0, mirrored: bool = False) -> dict[str, Any]:
    """A canonical world, mirrored about the line from start to goal, then turned about the start."""
    mirror = np.array([1.0, -1.0 if mirrored else 1.0])
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, sin], [-sin, cos]])

    def place(points: Any) -> Any:
        return ((np.asarray(points, dtype=float) * mirror) @ turn).tolist()

    shapes: dict[str, Any] = {"circles": [[*place([10.0, 0.0]), 3.0]]} if world == "disc" else {}
    if world in CANONICAL_POLYGONS:
        shapes = {"polygons": [place(CANONICAL_POLYGONS[world])]}
    bounds = [-35, -35, 35, 35]
    explicit = {"family": "explicit", "bounds": bounds, "start": [0, 0, angle], "goal": place([20, 0]), **shapes}
    return {"lidar": {"beams": 360, "range": 10.0}, "time": {"limit": 600.0}, "world": explicit}


def scene(**shapes: Any) -> dict[str, Any]:
    """A world from (0, 0) to (10, 0) of shapes, walls all round at 8 m."""
    world = {"family": "explicit", "bounds": [-3, -8, 13, 8], "start": [0, 0, 0], "goal": [10, 0], **shapes}
    return {"lidar": {"beams": 360, "range": 10.0}, "time": {"limit": 120.0}, "world": world}


def with_mover(at: Sequence[float], velocity: Sequence[float], radius: float = 0.4, **shapes: Any) -> dict[str, Any]:
    """That world with a disc that goes straight."""
    motion = {"law": "bounce", "velocity": [*velocity]}
    return scene(movers=[{"shape": {"circle": radius}, "at": [*at], "motion": motion}], **shapes)


def slab_and_target_that_leaves() -> dict[str, Any]:
    """A target goes from 10 to 26 m while the robot is at the slab, of which no place is nearer to it than to its old one."""
    motion = {"law": "waypoints", "points": [[18.0, 0.0], [34.0, 0.0]], "speed": 0.8, "stop": True}
    scenario = canonical_world("slab")
    del scenario["world"]["goal"]
    scenario["world"] |= {"target": {"at": [18.0, 0.0], "motion": motion}, "bounds": [-5, -20, 40, 20]}
    return scenario


def tolerance(expected: float, step_length: float = 0.1) -> float:
    """How far a robot may be from the closed form [m]: 1.5 % or three steps."""
    return max(0.015 * expected, 3.0 * step_length)


@dataclass(frozen=True)
class Slab:
    """Rectangle [x1, x2] x [-right, left] across the line from (0, 0) to (distance, 0); clearance c."""

    x1: float = 8.0
    x2: float = 12.0
    left: float = 5.0
    right: float = 3.0
    distance: float = 20.0
    c: float = 0.5

    def side(self, turn: str) -> float:
        """How far the slab reaches to the side of the turn [m]."""
        return self.left if turn == "left" else self.right

    @property
    def perimeter(self) -> float:
        """Of the rounded contour [m]."""
        return 2.0 * (self.x2 - self.x1 + self.left + self.right) + 2.0 * math.pi * self.c

    def until_free(self, turn: str) -> float:
        """Bug0: round the slab until the straight way to the goal is tangent to the far corner's arc."""
        h, c, x = self.side(turn), self.c, self.distance - self.x2
        k = math.hypot(x, h)
        psi = math.atan2(h, x) + math.asin(c / k)
        return self.x1 - c + h + 0.5 * math.pi * c + self.x2 - self.x1 + c * psi + math.sqrt(k * k - c * c)

    def until_line(self, turn: str) -> float:
        """Bug2: round the slab until the line to the goal is met again behind it."""
        h, c = self.side(turn), self.c
        return self.x1 - c + 2.0 * h + math.pi * c + self.x2 - self.x1 + self.distance - self.x2 - c

    def full_lap(self, turn: str, *, same_way: bool) -> float:
        """Bug1: a lap, then to the nearest point of the contour by the shorter or by the same way."""
        h = self.side(turn) if same_way else min(self.left, self.right)
        s, g = self.x1 - self.c, self.distance - self.x2 - self.c
        return s + self.perimeter + self.x2 - self.x1 + math.pi * self.c + 2.0 * h + g

    def shortest(self, turn: str) -> float:
        """The taut string round one side: tangent, arc, edge, arc, tangent."""
        h, c = self.side(turn), self.c
        total = self.x2 - self.x1
        for x in (self.x1, self.distance - self.x2):
            k = math.hypot(x, h)
            total += math.sqrt(k * k - c * c) + c * (math.atan2(h, x) + math.asin(c / k))
        return total


@dataclass(frozen=True)
class Disc:
    """Disc of radius r centred on the line, s before and g behind its contour of radius r + c."""

    x: float = 10.0
    r: float = 3.0
    distance: float = 20.0
    c: float = 0.5

    @property
    def rc(self) -> float:
        """Radius of the contour [m]."""
        return self.r + self.c

    @property
    def s(self) -> float:
        """Start to contour [m]."""
        return self.x - self.rc

    @property
    def g(self) -> float:
        """Contour to goal [m]."""
        return self.distance - self.x - self.rc

    def until_free(self) -> float:
        """Bug0: round the disc until the tangent to the goal."""
        rc, g = self.rc, self.g
        phi = math.acos(rc / (rc + g))
        return self.s + rc * (math.pi - phi) + math.sqrt((rc + g) ** 2 - rc**2)

    def until_line(self) -> float:
        """Bug2: half round."""
        return self.s + math.pi * self.rc + self.g

    def full_lap(self) -> float:
        """Bug1: a lap, and half of one to the nearest point."""
        return self.s + 3.0 * math.pi * self.rc + self.g

    def shortest(self) -> float:
        """Tangent, arc, tangent."""
        rc, a, b = self.rc, self.s + self.rc, self.g + self.rc
        arc = math.pi - math.acos(rc / a) - math.acos(rc / b)
        return math.sqrt(a * a - rc * rc) + math.sqrt(b * b - rc * rc) + rc * arc


@dataclass(frozen=True)
class UTrap:
    """U that opens toward the start: inner half width b, wall t, mouth at x0, depth a; goal at `distance`."""

    x0: float = 5.0
    b: float = 3.0
    t: float = 1.0
    a: float = 6.0
    distance: float = 20.0
    c: float = 0.5

    @property
    def pocket(self) -> float:
        """From the start to the inner side of the base, up to the corner, and back out to the mouth's edge [m]."""
        inner = self.x0 + self.a - self.c
        return inner + (self.b - self.c) + (inner - self.x0)

    @property
    def tip(self) -> float:
        """Round the end of an arm: two quarter arcs and the thickness [m]."""
        return math.pi * self.c + self.t

    def until_free(self) -> float:
        """Bug0 with the front rule: out of the pocket, round the arm, along it, then tangent to the goal."""
        c, h, x = self.c, self.b + self.t, self.distance - (self.x0 + self.a + self.t)
        k = math.hypot(x, h)
        psi = math.atan2(h, x) + math.asin(c / k)
        return self.pocket + self.tip + self.a + self.t + c * psi + math.sqrt(k * k - c * c)

    def until_line(self) -> float:
        """Bug2: the same, then down the back to the line."""
        back = 0.5 * math.pi * self.c + self.b + self.t
        return self.pocket + self.tip + self.a + self.t + back + self.distance - (self.x0 + self.a + self.t) - self.c

    @property
    def perimeter(self) -> float:
        """Of the rounded contour: four convex corners at the tips, two at the back, two concave inside [m]."""
        outer = 2.0 * (self.a + self.t) + 2.0 * (self.b + self.t) + math.pi * self.c
        inner = 2.0 * (self.a - self.c) + 2.0 * (self.b - self.c)
        return outer + 2.0 * self.tip + inner

    def full_lap(self) -> float:
        """Bug1: the nearest contour point lies opposite the hit point, half a lap away."""
        inner = self.x0 + self.a - self.c
        return inner + 1.5 * self.perimeter + self.distance - (self.x0 + self.a + self.t) - self.c

    def shortest(self) -> float:
        """Round the outside of one arm: the taut string round a slab with the U's outer sides."""
        c = self.c
        slab = Slab(self.x0, self.x0 + self.a + self.t, self.b + self.t, self.b + self.t, self.distance, c)
        return slab.shortest("left")


@dataclass(frozen=True)
class Ring:
    """Square ring about (10, 0), half sides 3.5 and 4, round the goal (10.3, 0.2) or round the start; clearance c."""

    c: float = 0.5

    @property
    def first(self) -> float:
        """From the start outside to the contour; Pythagoras for the goal 0.2 m aside [m]."""
        return (10.0 - 4.0 - self.c) * math.hypot(10.3, 0.2) / 10.3

    @property
    def lap(self) -> float:
        """Of the rounded contour outside [m]."""
        return 4.0 * 8.0 + 2.0 * math.pi * self.c

    @property
    def first_inside(self) -> float:
        """From the start in the middle to the contour [m]."""
        return 3.5 - self.c

    @property
    def lap_inside(self) -> float:
        """Of the contour inside, which has concave corners only [m]."""
        return 8.0 * (3.5 - self.c)


RING_ROUND_THE_START = {"family": "ring", "bounds": [-15, -15, 25, 15], "centre": [10, 0], "inside": "start"}
RING_ROUND_THE_START |= {"start": [10, 0, 0], "goal": [0, 0]}
"""The world of the scenario "ring" with the ring round the start."""
