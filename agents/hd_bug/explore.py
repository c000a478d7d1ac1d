"""HD-BUG explores: doors from the light into the shadow, the cost that chooses among them, and the way back to one.

Source: Hasibuzzaman, Jan and Wu, Procedure 3 and eqs. (7) and (8): candidates, cost, backtracking over the list.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.doors import LEAST_JUMP, MOST_DOORS, are_near, find_doors, rooms_along, thin_out
from bug_gym.agents.hd_bug.light import SLACK, are_lit
from bug_gym.agents.hd_bug.memory import Closing, HDBugMemory, Walls
from bug_gym.agents.hd_bug.parameters import HDBugParameters
from bug_gym.agents.hd_bug.path_list import Door, PathList, PathNode
from bug_gym.agents.hd_bug.perceive import Perception, Scene
from bug_gym.agents.walls.boundary import Boundary
from bug_gym.geometry import F64, Point
from bug_gym.kernels.free_way import free_distances
from bug_gym.view import Sensors

CLOSED_ABOUT, THINNED, SAME_DOOR = 0.2, 0.25, 0.3
"""No door this near to a closed one; none this near to another of its node; an older one this near is the same [m]."""

SOLID = 0.6
"""A door with a scan point this near to the way from v to q leads into an obstacle, in clearances."""

BEFORE_WALL = 1.3
"""An end of sight this near behind where another node's light ends at a wall is none, in clearances."""

NEAR_WALL = 1.5
"""What a node sees so near by is known so well that there is no door into it [m]."""

BEHIND_WALL = 2.0
"""How far behind such a wall no door is, in clearances."""

VISITED = 0.35
"""Without shadow: a door this near to where it has been is no more one [m]."""

LEAST_GAIN = 0.3
"""By how much another door must be better than the one that it heads for, at least [m]."""

SUCCESSOR = 1.5
"""A door this near to the one that has been closed carries on with it: the way round the same obstacle [m]."""

SAFE = 1.0
"""Room about a door above which it is without risk [m]."""

KEPT_CLOSED = 5.0
"""How long a door stays closed that led nowhere while something moved near it [s]."""

MOVED_NEAR = 1.0
"""How near to a door what moves makes it one that may open again [m]."""

PASSED = 1.5
"""Nearer than this to a node of the way back it is passed, in steps."""


class Explorer:
    """The choice among doors.

    Args:
        sensors: what a driver knows of the robot.
        parameters: of HD-BUG.
        perception: what lights up the ground.
        boundary: radii of the discs that are to pass.
    """

    def __init__(
        self, sensors: Sensors, parameters: HDBugParameters, perception: Perception, boundary: Boundary
    ) -> None:
        self.perception = perception
        self.hit_radius = boundary.hit_radius
        self.sensors = sensors
        self.parameters = parameters
        self.without = parameters.without
        self.clearance = boundary.inner
        self.step = sensors.step_length
        self._found = np.empty((MOST_DOORS, 5))

    # ------------------------------------------------------------------------------------------------------ looking

    def look(self, scene: Scene, memory: HDBugMemory) -> bool:
        """Every pace, and where it must: store the light area, close doors, find new ones; whether it looked."""
        if not memory.must_look and memory.odometer - memory.looked_at < self.parameters.r_base:
            return False
        memory.must_look, memory.looked_at = False, memory.odometer
        if self.without == "path_list":
            memory.path = PathList()
        memory.light, walls = self.perception.light_up(scene)
        memory.walls = walls
        node = memory.path.visit(scene.view.position, memory.odometer, memory.light)
        if self.without == "path_list" and memory.door is not None:  # it goes on to its door: that needs no list
            memory.door.owner = node.number
            node.doors.append(memory.door)
        self._close(scene, memory, walls, node)
        if self.without != "candidates":
            self._open(scene, memory, walls, node)
        if memory.door is not None and memory.door not in memory.path.nodes[memory.door.owner].doors:
            memory.door, memory.way = None, []
        return True

    def _close(self, scene: Scene, memory: HDBugMemory, walls: Walls, here: PathNode) -> None:
        """Close the doors whose q is light by now, or inside an obstacle."""
        doors = memory.path.doors
        if not doors:
            return
        outside = np.array([door.outside for door in doors])
        closed, solid = self._is_light(memory, outside), self._is_solid(walls, doors)
        if self.without == "backtracking":
            closed |= np.array([door.owner != here.number and door is not memory.door for door in doors])
        for door, is_closed, is_solid in zip(doors, closed.tolist(), solid.tolist(), strict=True):
            if is_solid:
                # From elsewhere it would seem to be a door again.
                memory.closed.append(self._closing(scene, memory, door))
            if is_solid or is_closed:
                memory.path.nodes[door.owner].doors.remove(door)

    def _is_light(self, memory: HDBugMemory, outside: F64) -> NDArray[np.bool_]:
        """Which of some places (m, 2) lie in the light about the robot."""
        here = np.array([memory.pose[:2]])
        lit: NDArray[np.bool_] = np.hypot(*(outside - here).T) < VISITED
        if self.without != "shadow":
            farthest = np.array([memory.light.max()])
            are_lit(here, memory.light[None], farthest, outside, SLACK, lit)
        return lit

    def _is_solid(self, walls: Walls, doors: list[Door]) -> NDArray[np.bool_]:
        """Which of some doors lead into or along a still obstacle, as it turns out."""
        x, y = walls.x[walls.still], walls.y[walls.still]
        least = SOLID * self.clearance
        room = np.empty(len(doors))
        rooms_along(x, y, np.array([(*door.inside, *door.outside) for door in doors]), room)
        solid: NDArray[np.bool_] = room < least
        return solid

    def _open(self, scene: Scene, memory: HDBugMemory, walls: Walls, node: PathNode) -> None:
        """Find the doors of a node that lead into the shadow."""
        x, y = scene.view.position
        reach, found = self.sensors.range, self._found
        toward = math.atan2(memory.goal[1] - y, memory.goal[0] - x)
        jumps, count = find_doors(memory.light, x, y, walls.x, walls.y, self.clearance, reach, toward, found)
        outside = found[:count, 2:4]
        dark = self._is_shadow(memory.path, outside)
        # Where sight ends right before a wall that is known from elsewhere there is no door.
        dark[jumps:] &= ~memory.path.is_before_wall(outside[jumps:], reach, BEFORE_WALL * self.clearance)
        # Farther off beams meet a wall so far apart that there seem to be gaps.
        dark &= ~memory.path.is_behind_wall(outside, reach, NEAR_WALL, LEAST_JUMP, BEHIND_WALL * self.clearance)
        found = found[:count][dark]
        dropped = np.zeros(len(found), dtype=np.bool_)
        are_near(found[:, 2:4], self._taken(memory), CLOSED_ABOUT, dropped)
        thin_out(found[:, 2:4], THINNED, dropped)
        new = [Door((vx, vy), (qx, qy), room, node.number) for vx, vy, qx, qy, room in found[~dropped].tolist()]
        self._take_over(memory, found[~dropped, 2:4])
        node.doors += new

    def _is_shadow(self, path: PathList, outside: F64) -> NDArray[np.bool_]:
        """Which of some places (m, 2) no light area of the list holds; without shadow: which it has not been near to."""
        if self.without == "shadow":
            away = np.hypot(outside[:, 0, None] - path.places[:, 0], outside[:, 1, None] - path.places[:, 1])
            unseen: NDArray[np.bool_] = away.min(axis=1) >= VISITED
            return unseen
        return ~path.is_lit(outside)

    def _taken(self, memory: HDBugMemory) -> F64:
        """Places (k, 2) about which there is no new door: of doors that led nowhere, and of the one it heads for."""
        memory.closed = [closing for closing in memory.closed if memory.steps < closing.until]
        places = [closing.place for closing in memory.closed]
        if memory.door is not None:
            places.append(memory.door.outside)
        return np.array(places).reshape(-1, 2)

    def _take_over(self, memory: HDBugMemory, outside: F64) -> None:
        """Drop the doors of older nodes that are the same as new ones with these q (m, 2)."""
        doors = memory.path.doors
        same = np.zeros(len(doors), dtype=np.bool_)
        are_near(np.array([door.outside for door in doors]).reshape(-1, 2), outside, SAME_DOOR, same)
        for k in np.flatnonzero(same):
            if doors[k] is not memory.door:
                memory.path.nodes[doors[k].owner].doors.remove(doors[k])

    # ------------------------------------------------------------------------------------------------------ choosing

    def choose(self, scene: Scene, memory: HDBugMemory) -> None:
        """Choose the door of least cost; keep the one that it heads for unless another is better by far."""
        doors = memory.path.doors
        if not doors:
            memory.door, memory.way = None, []
            memory.candidates, memory.costs = np.empty((0, 2)), np.empty(0)
            return
        cost = self._costs(scene, memory, doors)
        best = int(cost.argmin())
        memory.candidates, memory.costs = np.array([door.inside for door in doors]), cost
        if not math.isfinite(cost[best]):
            memory.door, memory.way = None, []
            return
        kept = self._kept(memory, doors, cost)
        if kept is not None:
            gain = max(LEAST_GAIN, self.parameters.hysteresis * float(cost[kept]))
            if not cost[best] < cost[kept] - gain:
                best = kept
        if doors[best] is not memory.door:
            memory.door, memory.heading_to, memory.is_passing = doors[best], doors[best].outside, False
            memory.way = self._way_back(memory.path, doors[best])
        self._skip(scene, memory, doors[best])

    def _kept(self, memory: HDBugMemory, doors: list[Door], cost: F64) -> int | None:
        """Number of the door that it heads for; where that is closed, of the cheapest one about it; None without one."""
        if memory.door is not None:
            return doors.index(memory.door)
        away = np.array([math.dist(door.outside, memory.heading_to) for door in doors])
        near = np.flatnonzero((away < SUCCESSOR) & np.isfinite(cost))
        return int(near[cost[near].argmin()]) if len(near) else None

    def _costs(self, scene: Scene, memory: HDBugMemory, doors: list[Door]) -> F64:
        """J (m,) of eq. (8) for doors [m]: alpha (travel to v, and over q to the goal) + beta risk."""
        path = memory.path
        assert path.here is not None
        inside, outside = (np.array([getattr(door, name) for door in doors]) for name in ("inside", "outside"))
        owners = np.array([door.owner for door in doors])
        lengths, _ = path.ways_from(path.here.number)
        position = np.array(scene.view.position)
        travel = lengths[owners] + np.hypot(*(inside - path.places[owners]).T)
        straight = np.hypot(*(inside - position).T)
        travel = np.where((owners == path.here.number) | self._in_sight(scene, memory, inside), straight, travel)
        travel += np.hypot(*(outside - inside).T)
        rest = np.hypot(*(outside - np.array(memory.goal)).T)
        risk = self._risks(scene, doors, outside, travel)
        if self.without == "travel":
            travel = np.where(np.isfinite(travel), 0.0, np.inf)
        if self.without == "goal":
            rest[:] = 0.0
        cost: F64 = self.parameters.alpha * (travel + rest)
        return cost if self.without == "risk" else cost + self.parameters.beta * risk

    def _risks(self, scene: Scene, doors: list[Door], outside: F64, travel: F64) -> F64:
        """Risk (m,) of doors: narrow ones, and those where a mover will be when it gets there."""
        radius = self.sensors.radius
        room = np.array([door.room for door in doors])
        risk: F64 = np.clip(1.0 - (room - radius) / SAFE, 0.0, 1.0) ** 2
        tracks = scene.tracks
        when = np.minimum(travel / self.sensors.drive.max_speed, self.parameters.horizon)
        for t in np.flatnonzero(tracks.moving):
            there = tracks.position[t] + when[:, None] * tracks.velocity[t]
            gap = np.hypot(*(outside - there).T) - radius - tracks.radius[t]
            risk += 2.0 * np.exp(-(np.maximum(gap, 0.0) ** 2) / (0.5 * SAFE) ** 2)
        return risk

    def _way_back(self, path: PathList, door: Door) -> list[int]:
        """The way over the list to the node that has a door's v in its light."""
        assert path.here is not None
        return path.way_to(path.here.number, door.owner)

    def _skip(self, scene: Scene, memory: HDBugMemory, door: Door) -> None:
        """Go straight to the farthest node of the way in the light, or to v; never back along the way."""
        if not memory.way:
            return
        places = np.array([door.inside, *(memory.path.nodes[number].place for number in memory.way)])
        seen = self._in_sight(scene, memory, places)
        memory.way = [] if seen[0] else memory.way[int(np.flatnonzero(seen[1:]).max(initial=0)) :]

    def _in_sight(self, scene: Scene, memory: HDBugMemory, places: F64) -> NDArray[np.bool_]:
        """Which of some places (m, 2) one can go to straight, as the present scan shows."""
        walls, (x, y) = memory.walls, scene.view.position
        assert walls is not None
        away, free = np.hypot(*(places - (x, y)).T), np.empty(len(places))
        angles = np.arctan2(places[:, 1] - y, places[:, 0] - x)
        free_distances(walls.x - x, walls.y - y, angles, self.hit_radius, self.sensors.range, free)
        sight: NDArray[np.bool_] = away <= free
        return sight

    # ------------------------------------------------------------------------------------------------------ going

    def next_place(self, scene: Scene, memory: HDBugMemory) -> Point | None:
        """Where to go for the door that was chosen, odometry frame [m]; None where it is passed or gone."""
        door = memory.door
        if door is None:
            return None
        position, path = scene.view.position, memory.path
        while memory.way and math.dist(path.nodes[memory.way[0]].place, position) < PASSED * self.step:
            memory.way.pop(0)
        if memory.way:
            memory.mode = "backtracking"
            return path.nodes[memory.way[0]].place
        memory.mode = "candidates"
        memory.is_passing |= math.dist(door.inside, position) < self.step
        if not memory.is_passing:
            return door.inside
        if math.dist(door.outside, position) >= self.step:
            return door.outside
        self.give_up(scene, memory)
        return None

    def give_up(self, scene: Scene, memory: HDBugMemory) -> None:
        """Close the door that it heads for: it is there, or cannot get there; or cut the way back that is blocked."""
        door, path = memory.door, memory.path
        memory.must_look = True
        if door is None:
            return
        if memory.way and path.here is not None:
            path.cut(path.here.number, memory.way[0])
        else:
            memory.closed.append(self._closing(scene, memory, door))
            path.nodes[door.owner].doors.remove(door)
        memory.door, memory.way, memory.is_passing = None, [], False

    def _closing(self, scene: Scene, memory: HDBugMemory, door: Door) -> Closing:
        """That a door leads nowhere: for a while where something moves near it, else for ever."""
        tracks = scene.tracks
        gaps = np.hypot(*(tracks.position - np.array(door.outside)).T) - tracks.radius
        is_disturbed = bool((tracks.moving & (gaps < MOVED_NEAR)).any())
        kept = memory.steps + KEPT_CLOSED / self.sensors.drive.step if is_disturbed else math.inf
        return Closing(door.outside, kept)
