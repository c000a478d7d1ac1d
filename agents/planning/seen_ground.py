"""Unknown terrain as a grid: what the scans have shown so far is blocked, all else counts as free.

The remembered points are those of agents/mapping, which also takes away what beams have passed since.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bug_gym.agents.mapping.lazy_theta import Search
from bug_gym.agents.mapping.point_map import PointMap
from bug_gym.agents.planning.clear_step import ROOM as CLEAR_ROOM
from bug_gym.agents.planning.clear_step import clear_velocity
from bug_gym.agents.planning.follow import Scene, pose_to_be
from bug_gym.agents.planning.grid import Grid, Lattice, Nodes, make_grid, relink_nodes
from bug_gym.agents.planning.grid_planner import GridParameters
from bug_gym.agents.planning.map import PlanningMap, in_frame, inverse
from bug_gym.agents.planning.planner import GOAL_MOVED, STRAYED, MapPlanner, PlannerMemory, Room
from bug_gym.agents.planning.route import Route
from bug_gym.agents.planning.smoothing import Solids, spread
from bug_gym.geometry import F64, Point
from bug_gym.policy import Velocity
from bug_gym.view import Sensors, View

NO_EDGES = np.zeros((0, 4))

SPAN = 10.0
"""Half of the side of the grid at first [m]; it grows by itself."""

BEYOND = 2.0
"""Ground kept around all that has been seen [m], so that a way round it is there."""

ROUNDED = 1e-3
"""How far remembered points may lie beside what was hit [m]."""

LOOK_STEP, LEAST_LOOK = 0.05, 0.2
"""Between places of a way to where is looked, and the least length of one [m]."""

STILL_FOR, MOST_WAITING = 10.0, 60.0
"""So long no ground may have turned out free before what has been seen counts as leaving no way, as what stands in the only
door may go on; after so long without a way it does in any case [s]."""

SLOWLY = 4.0
"""The time to go where is looked, in times of that at top speed."""

HELD = 1e-3
"""Of which share of its velocity no more is left to a robot that is held up."""

FORGOTTEN = 2
"""How often all that has been seen is forgotten before that is the verdict, where something has moved: what has gone leaves
points that no beam has passed."""


class SeenGround:
    """What a robot has seen, as a grid in its odometry frame.

    Args:
        parameters: resolution, connectivity and corners of the grid.
        rooms: what ways are planned for in turn, until there is one.
    """

    def __init__(self, parameters: GridParameters, rooms: tuple[Room, ...]) -> None:
        self._parameters, self._all_rooms = parameters, rooms
        self.room, *self._rooms = rooms
        self.points = PointMap((0.0, 0.0), SPAN, parameters.resolution, self._clearance, Search())
        self.grid = self._grid()
        self._solids: Solids | None = None
        self._hits = np.zeros((0, 3))
        self._still = self._waited = 0.0
        self._forgotten = self._removed = 0

    def look(self, view: View, goal: Point) -> bool:
        """Remember what a scan shows. Returns whether ground has turned out free, or the grid has grown."""
        before = self.points.removed
        self._hits = np.column_stack([*view.points, np.zeros(len(view.points[0]))])
        self._hits[:, :2] = in_frame(self._hits[:, :2], inverse(view.pose))
        sensors = view.sensors
        still = np.ones(len(view.ranges), dtype=bool)
        self.points.cover(*goal, sensors.range)
        added = self.points.add_scan(
            view.position, view.heading, sensors.angles, view.ranges, sensors.range, sensors.range_noise, still
        )
        if self.points.cells.blocked.shape != (self.grid.lattice.rows - 2, self.grid.lattice.columns - 2):
            self.grid, self._solids = self._grid(), None
            return True
        if added == 0 and self.points.removed == before:
            return False
        self._solids = None
        return self._renew()

    def _renew(self) -> bool:
        """Take over which cells are blocked now. Returns whether one has turned out free."""
        cells = self.points.cells
        inner = self.grid.blocked[1:-1, 1:-1]
        now = cells.blocked > 0
        changed = np.flatnonzero(now != inner)
        if len(changed) == 0:
            return False
        rows, columns = np.divmod(changed, now.shape[1])
        # A new grid, so that a search can tell what has changed since it was asked last.
        self.grid = self.grid._replace(blocked=self.grid.blocked.copy(), links=self.grid.links.copy())
        self.grid.blocked[1:-1, 1:-1] = now
        nodes: Nodes = ((rows + 1) * self.grid.lattice.columns + columns + 1).astype(np.int32)
        relink_nodes(self.grid, nodes)
        return not bool(now[rows, columns].all())

    def wait(self, seconds: float, *, is_open: bool) -> None:
        """Count time without a way [s]; `is_open` says that ground has turned out free."""
        self._waited += seconds
        self._still = 0.0 if is_open else self._still + seconds

    def look_on(self, seconds: float) -> None:
        """Count time without a way that is spent on the way to look [s]."""
        self._waited += seconds
        self._still = 0.0

    def go_on(self) -> None:
        """Count from none again: there is a way."""
        self._still = self._waited = 0.0

    @property
    def is_shut(self) -> bool:
        """Whether there has been no way for so long that there is none."""
        return self._still >= STILL_FOR or self._waited >= MOST_WAITING

    def forget(self) -> bool:
        """Forget all, if something has moved since this was done last; False where that has been done often enough."""
        if self.points.removed == self._removed or self._forgotten == FORGOTTEN:
            return False
        self._removed, self._forgotten = self.points.removed, self._forgotten + 1
        self.forget_all()
        return True

    def forget_all(self) -> None:
        """Look at all anew: where a goal moves, what shut it off out of sight may be open by now."""
        self.room, *self._rooms = self._all_rooms
        self.points.forget_all()
        self.points.set_clearance(self._clearance)
        self.grid, self._solids = self._grid(), None
        self.go_on()

    def narrow(self) -> bool:
        """Plan for the next room from now on; False where there is none."""
        if not self._rooms:
            return False
        self.room = self._rooms.pop(0)
        self.points.set_clearance(self._clearance)
        self.grid, self._solids = self._grid(), None
        return True

    def standing(self, scene: Scene, sensors: Sensors) -> tuple[PlanningMap, float]:
        """The points seen, and the radius [m] of what certainly does not pass where they leave no way for it."""
        points = self.points.points()
        return map_of_hits(np.column_stack([points, np.zeros(len(points))]), scene), self._least_radius(sensors)

    def cleared(self, velocity: Velocity, view: View, scene: Scene) -> Velocity:
        """As much of a velocity as touches nothing that the last scan has hit: a follower cuts corners."""
        drive, radius = view.sensors.drive, view.sensors.radius
        speed = max(math.hypot(*velocity), math.hypot(*view.own_velocity))
        if radius + CLEAR_ROOM + speed * drive.step + 0.5 * speed * speed / drive.max_acceleration < view.ranges.min():
            return velocity
        return clear_velocity(map_of_hits(self._hits, scene), scene.pose, view.own_velocity, velocity, drive, radius)

    def way_to_look(self, scene: Scene, sensors: Sensors) -> F64 | None:
        """Toward where the body alone might pass between points seen, as far as cells leave room; None: it is there.

        From far away a wall is a row of points with gaps between them.
        """
        self.points.set_clearance(self._least_radius(sensors))
        way = self.points.find_way(scene.pose[:2], scene.goal, sensors.goal_radius)
        self.points.set_clearance(self._clearance)
        if way is None:
            return None
        places, solids = spread(way.places, LOOK_STEP), self.solids
        clear = 0
        while clear + 1 < len(places) and solids.is_clear(tuple(places[clear]), tuple(places[clear + 1])):
            clear += 1
        return places[: clear + 1] if clear * LOOK_STEP > LEAST_LOOK else None

    @staticmethod
    def _least_radius(sensors: Sensors) -> float:
        """Radius [m] of what does not pass where points leave no way for it, though they lie a little beside what was hit."""
        return max(sensors.radius - 4.0 * sensors.range_noise - ROUNDED, 0.5 * sensors.radius)

    def ends(self, scene: Scene, sensors: Sensors) -> tuple[int, int] | None:
        """The free cells in which a way begins and ends, None where there are none near enough."""
        size = self.grid.lattice.size
        start = self.grid.free_node_near(scene.pose[:2], 2.0 * self._growth)
        goal = self.grid.free_node_near(scene.goal, max(sensors.goal_radius - 0.5 * size, 0.0))
        if min(start, goal) < 0:
            return None
        (place,) = self.grid.lattice.places(np.array([start])).tolist()
        # Points may seem nearer than the body lets them be.
        body = max(sensors.radius - 4.0 * sensors.range_noise - 0.01, 0.5 * sensors.radius)
        return (start, goal) if self.solids.with_growth(body).is_clear(scene.pose[:2], (place[0], place[1])) else None

    def is_route_open(self, route: Route, here: Point) -> bool:
        """Whether the rest of a way keeps half its margin from what the last scan has hit; the rest was known before."""
        solids = Solids(self._hits, NO_EDGES, self.room.radius + 0.5 * self.room.margin)
        chain = [here, *((x, y) for x, y in route.ahead(math.inf)[1:].tolist())]
        return all(map(solids.is_clear, chain[:-1], chain[1:]))

    @property
    def solids(self) -> Solids:
        """What has been seen, point by point."""
        if self._solids is None:
            points = self.points.points()
            self._solids = Solids(np.column_stack([points, np.zeros(len(points))]), NO_EDGES, self._growth)
        return self._solids

    @property
    def _growth(self) -> float:
        """By how much points grow [m]: a cell remembers one of its points, others of the same wall are nearer."""
        return self.room.growth + 0.5 * self._parameters.resolution

    @property
    def _clearance(self) -> float:
        """From how near to a point on the centre of a cell is blocked [m], see GridPlanner.clearance_of."""
        return math.hypot(self._growth, math.sqrt(0.5) * self._parameters.resolution)

    def _grid(self) -> Grid:
        cells = self.points.cells
        rows, columns = cells.blocked.shape
        size = cells.size
        lattice = Lattice(cells.x - 0.5 * size, cells.y - 0.5 * size, size, rows + 2, columns + 2)
        blocked = np.pad((cells.blocked > 0).astype(np.uint8), 1, constant_values=1)
        own = self._parameters
        return make_grid(blocked, lattice, connectivity=own.connectivity, cut_corners=own.cut_corners)


def map_of_hits(hits: F64, scene: Scene) -> PlanningMap:
    """Hits (k, 3) x, y, 0 [m] as a map, whose border leaves way round them."""
    return PlanningMap(border_about(hits[:, :2], scene, BEYOND), hits)


def border_about(points: F64, scene: Scene, beyond: float) -> F64:
    """Corners (4, 2) of a rectangle about points (k, 2), the robot and its goal, and so far beyond them [m]."""
    places = np.concatenate([points, [scene.pose[:2], scene.goal]])
    low, high = places.min(axis=0) - beyond, places.max(axis=0) + beyond
    return np.array([low, (high[0], low[1]), high, (low[0], high[1])])


class SeeingPlanner(MapPlanner):
    """A planner that does without the map where it is asked to; its memory has `seen` then."""

    def standing(self, scene: Scene, memory: Any) -> tuple[PlanningMap, float]:
        """The map, or what has been seen."""
        seen: SeenGround | None = memory.seen
        return super().standing(scene, memory) if seen is None else seen.standing(scene, self.sensors)


def drive_in_seen(planner: MapPlanner, seen: SeenGround, view: View, memory: PlannerMemory) -> Velocity:
    """One decision of a planner that is not given the map: look, plan anew where what is seen asks for it, and follow.

    Args:
        planner: whose `plan` finds ways in what has been seen.
        seen: what has been seen; the scan is added.
        view: what is seen now.
        memory: of the episode.
    """
    scene = Scene(view.pose, view.goal_position, None)
    is_open, step = seen.look(view, scene.goal), view.sensors.drive.step
    memory.pause -= step
    memory.goal_watch.look(scene.goal, step)
    if memory.route is None:
        is_due = memory.pause <= 0.0
    else:
        is_new = (
            memory.route.advance(*pose_to_be(view, scene.pose)[:2]) > STRAYED
            or math.dist(memory.planned_for, scene.goal) > GOAL_MOVED
        )
        is_due = is_new or is_open or not seen.is_route_open(memory.route, scene.pose[:2])
        is_due |= memory.mode == "looking" and (memory.route.rest < LOOK_STEP or memory.pause <= 0.0)
    if is_due:
        planner.replace_route(scene, memory)
        if memory.verdict == "stuck" and not seen.is_shut:
            look_nearer(seen, scene, view.sensors, memory)
    if memory.route is not None:
        return follow_in_seen(planner, seen, view, memory, memory.route)
    seen.wait(step, is_open=is_open)
    is_asked = bool(memory.verdict) or not memory.goal_watch.has_settled
    if is_asked and not (seen.is_shut and is_final(seen, memory)):
        memory.verdict = ""
    return 0.0, 0.0


def follow_in_seen(planner: MapPlanner, seen: SeenGround, view: View, memory: PlannerMemory, route: Route) -> Velocity:
    """What drives along a way, as far as the scan lets it."""
    scene, step = Scene(view.pose, view.goal_position, None), view.sensors.drive.step
    wish = planner.follower.follow(route, view, scene)
    clear = wish if view.sensors.drive.latency > 0 else seen.cleared(wish, view, scene)
    if clear != wish:
        memory.planned_for = (math.inf, math.inf)
    if wish != (0.0, 0.0) and math.hypot(*clear) <= HELD * math.hypot(*wish):
        seen.wait(step, is_open=False)
        if seen.is_shut and is_final(seen, memory):
            memory.verdict, memory.reason = "stuck", "what is seen beside the way holds the body up"
    elif memory.mode == "looking":
        seen.look_on(step)
    else:
        seen.go_on()
    return clear


def look_nearer(seen: SeenGround, scene: Scene, sensors: Sensors, memory: PlannerMemory) -> None:
    """Follow the way to where the body might pass, if it is not there: what is seen from there may open or prove more."""
    places = seen.way_to_look(scene, sensors)
    if places is not None:
        memory.route, memory.verdict, memory.mode = Route(places, margin=seen.room.margin), "", "looking"
        memory.planned_for = scene.goal
        memory.pause = SLOWLY * memory.route.length / sensors.drive.max_speed + STILL_FOR


def is_final(seen: SeenGround, memory: PlannerMemory) -> bool:
    """Whether no way leads to a goal that stays, with nothing left of what has gone; else a plan is due in what is seen."""
    memory.pause = 0.0
    if memory.goal_watch.has_settled:
        return not seen.forget()
    seen.forget_all()
    return False
