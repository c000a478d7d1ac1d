"""Unknown terrain as a grid: what the scans have shown so far is blocked, all else counts as free.

The remembered points are those of agents/mapping, which also takes away what beams have passed since.
"""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.mapping.lazy_theta import Search
from bug_gym.agents.mapping.point_map import PointMap
from bug_gym.agents.planning.follow import Scene
from bug_gym.agents.planning.grid import Grid, Lattice, Nodes, make_grid, relink_nodes
from bug_gym.agents.planning.grid_planner import GridParameters
from bug_gym.agents.planning.map import in_frame, inverse
from bug_gym.agents.planning.planner import GOAL_MOVED, STRAYED, MapPlanner, PlannerMemory, Room
from bug_gym.agents.planning.route import Route
from bug_gym.agents.planning.smoothing import Solids
from bug_gym.geometry import Point
from bug_gym.policy import Velocity
from bug_gym.view import Sensors, View

NO_EDGES = np.zeros((0, 4))

SPAN = 10.0
"""Half of the side of the grid at first [m]; it grows by itself."""

STILL_FOR, MOST_WAITING = 10.0, 60.0
"""So long no ground may have turned out free before what has been seen counts as leaving no way, as what stands in the only
door may go on; after so long without a way it does in any case [s]."""

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
        self.room, *self._rooms = self._all_rooms
        self.points.forget_all()
        self.points.set_clearance(self._clearance)
        self.grid, self._solids = self._grid(), None
        self.go_on()
        return True

    def narrow(self) -> bool:
        """Plan for the next room from now on; False where there is none."""
        if not self._rooms:
            return False
        self.room = self._rooms.pop(0)
        self.points.set_clearance(self._clearance)
        self.grid, self._solids = self._grid(), None
        return True

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
    if memory.route is None:
        is_due = is_open or memory.pause <= 0.0
    else:
        is_new = (
            memory.route.advance(*scene.pose[:2]) > STRAYED or math.dist(memory.planned_for, scene.goal) > GOAL_MOVED
        )
        is_due = is_new or is_open or not seen.is_route_open(memory.route, scene.pose[:2])
    if is_due:
        planner.replace_route(scene, memory)
    if memory.route is not None:
        seen.go_on()
        return planner.follower.follow(memory.route, view, scene)
    seen.wait(step, is_open=is_open)
    if memory.verdict and not (seen.is_shut and is_final(seen, memory)):
        memory.verdict = ""
    return 0.0, 0.0


def is_final(seen: SeenGround, memory: PlannerMemory) -> bool:
    """Whether there is no way though nothing is left of what has gone; else a plan is due in what is seen now."""
    memory.pause = 0.0
    return not seen.forget()
