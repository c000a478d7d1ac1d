"""The shortest path of a disc robot among circles and polygons, and whether there is one.

The robot shrinks to its centre and the obstacles grow by its radius (Lozano-Perez 1983). Shapely grows them into
polygons and cuts the free space into triangles. A* goes over the corners around which a taut string can bend, and looks
from each through the triangles (Bungiu et al. 2014), only into the wedge into which a string leaves that corner.

A path no longer than L stays in the ellipse about start and goal whose points have distances to them of L in sum. So
the first search is among the obstacles near the straight line; where the path that it finds is so long that others could
be in its way, the next one is among more of them.

The path is the exact shortest one among polygons whose chords stand for arcs and which let the robot come as near as
0.99 times its radius (see `free_space`). So its length lies between the true shortest for 0.99 times the radius and
that for the radius. As long as the same gaps are open, lengths grow at most in proportion to the radius: the path is at
most 1 % too short. A gap of exactly two radii is open; one between 1.98 and 2 radii may be.

Short is meant in metres: what weighted regions cost a robot that crosses them doesn't count.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from bug_gym.checks import shortened

SLACK = 0.002  # share of the radius by which obstacles grow less, so that a gap of exactly two radii is open
SAGITTA = 0.005  # largest distance of a circle from its chords, as a share of the robot's radius
LEAST_SAGITTA = 1e-4  # the same as a share of the circle's own radius: no finer, however small the robot
CORNER_SEGMENTS = 12  # chords in a quarter of the arc around a polygon's corner
GRID = 1e-6  # coordinates of the free space are multiples of this [m]
ON_LINE = 1e-9  # a point is on a line of sight if their cross product is at most this [m^2]

FIRST_REACH = 1.1  # how long a path is looked for at first, as a share of the straight line
REACH_GROWTH = 1.5  # how much longer the next one may be

WALL = -1  # what lies behind a side without a neighbour
START, GOAL = -2, -1  # where the two points stand in the lists of corners

Beam = tuple[int, float, float, float, float]
"""The half-edge by which sight enters a triangle, then its left and its right limit as directions (x, y)."""


class Path(NamedTuple):
    """A path of the robot's centre; infinitely long and without points where there is none."""

    length: float
    """Length [m]."""
    points: NDArray[np.float64]
    """(k, 2) way-points from start to goal [m]."""


def shortest_path(
    circles: ArrayLike,
    polygons: Sequence[Sequence[ArrayLike]],
    border: ArrayLike,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    radius: float,
) -> Path:
    """Find the shortest path of the centre of a disc robot from start to the goal point.

    Args:
        circles: (n, 3) x, y, radius [m].
        polygons: Each a sequence of rings (k, 2): the shell, then its holes, which are free inside; either orientation.
        border: (k, 2) simple polygon around the world, a wall.
        start: (2,) centre of the robot [m].
        goal: (2,) where the centre is to arrive [m].
        radius: Radius of the robot [m]; a point (0) does not pass between obstacles that touch.

    Raises:
        ValueError: If the robot doesn't fit at start or goal, or a shape is malformed.
    """
    source, target = _point(start, "start"), _point(goal, "goal")
    inside, obstacles = _grown(circles, polygons, border, radius)
    detour = shapely.distance(obstacles, source) + shapely.distance(obstacles, target)
    reach = FIRST_REACH * source.distance(target)
    while True:
        near = obstacles[detour <= reach]
        room = _common_room(_free(inside, near), source, target)
        if room is None:
            return Path(math.inf, np.empty((0, 2)))
        points = _search(_triangulate(room, source, target))
        length = float(np.hypot(*np.diff(points, axis=0).T).sum())
        if length <= reach or len(near) == len(obstacles):
            return Path(length, points)
        reach = max(length, REACH_GROWTH * reach)


def reachable(
    circles: ArrayLike,
    polygons: Sequence[Sequence[ArrayLike]],
    border: ArrayLike,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    radius: float,
) -> bool:
    """Tell whether a disc robot can get from start to goal; arguments and errors as in `shortest_path`."""
    source, target = _point(start, "start"), _point(goal, "goal")
    return _common_room(free_space(circles, polygons, border, radius=radius), source, target) is not None


def free_space(
    circles: ArrayLike, polygons: Sequence[Sequence[ArrayLike]], border: ArrayLike, *, radius: float
) -> shapely.Geometry:
    """Return where the centre of a disc robot may be: a polygon, or several; arguments as in `shortest_path`.

    Its boundary is between 0.99 and 1 radii from the nearest obstacle, to the grid of a micrometre: the grown obstacles
    are polygons inside the true ones. Circles of over 50 times the robot's radius may come out 0.01 % smaller.
    """
    return _free(*_grown(circles, polygons, border, radius))


def _grown(
    circles: ArrayLike, polygons: Sequence[Sequence[ArrayLike]], border: ArrayLike, radius: float
) -> tuple[shapely.Geometry, NDArray[np.object_]]:
    """Return the world shrunk by the radius, and the obstacles (n,) grown by it."""
    if not 0.0 <= radius < math.inf:
        raise ValueError(f"radius must be finite and not negative, got {radius}")
    growth = radius * (1.0 - SLACK)
    solids = np.array([_polygon(rings, f"polygon {i}") for i, rings in enumerate(polygons)], dtype=object)
    obstacles = np.concatenate(
        [shapely.buffer(solids, growth, quad_segs=CORNER_SEGMENTS), _grow_circles(circles, growth)]
    )
    return shapely.buffer(_polygon([border], "border"), -growth, quad_segs=CORNER_SEGMENTS), obstacles


def _free(inside: shapely.Geometry, obstacles: NDArray[np.object_]) -> shapely.Geometry:
    return shapely.difference(inside, shapely.union_all(obstacles), grid_size=GRID)


def _grow_circles(circles: ArrayLike, growth: float) -> NDArray[np.object_]:
    """Return (m,) the grown circles as regular polygons inside them; a point that does not grow is left out."""
    disc = np.asarray(circles, dtype=float)
    if disc.size == 0:
        return np.empty(0, dtype=object)
    if disc.ndim != 2 or disc.shape[1] != 3 or not np.isfinite(disc).all() or (disc[:, 2] < 0.0).any():
        raise ValueError(f"circles must be finite rows (x, y, radius >= 0), got {shortened(circles)}")
    disc = disc[disc[:, 2] + growth > 0.0]
    rim = disc[:, 2] + growth
    sagitta = np.maximum(SAGITTA * growth / rim, LEAST_SAGITTA)
    quarters = np.ceil(np.pi / 4.0 / np.arccos(1.0 - sagitta)).astype(int)
    grown = np.empty(len(disc), dtype=object)
    for quarter in np.unique(quarters):
        same = quarters == quarter
        grown[same] = shapely.buffer(shapely.points(disc[same, :2]), rim[same], quad_segs=int(quarter))
    return grown


def _polygon(rings: Sequence[ArrayLike], name: str) -> shapely.Polygon:
    """Build a valid polygon from its shell and holes."""
    arrays = [np.asarray(ring, dtype=float) for ring in rings]
    if not arrays or any(r.ndim != 2 or r.shape[1] != 2 or len(r) < 3 or not np.isfinite(r).all() for r in arrays):
        raise ValueError(f"{name} must be rings of at least 3 finite points (x, y), got {shortened(rings)}")
    polygon = shapely.Polygon(arrays[0], arrays[1:])
    if not polygon.is_valid:
        raise ValueError(f"{name} is not a simple polygon: {shapely.is_valid_reason(polygon)}")
    return polygon


def _point(value: ArrayLike, name: str) -> shapely.Point:
    position = np.asarray(value, dtype=float)
    if position.shape != (2,) or not np.isfinite(position).all():
        raise ValueError(f"{name} must be two finite numbers (x, y), got {shortened(value)}")
    return shapely.Point(position)


def _common_room(free: shapely.Geometry, start: shapely.Point, goal: shapely.Point) -> shapely.Polygon | None:
    """Return the connected part of the free space that holds both points, None if they are apart."""
    rooms = shapely.get_parts(free)
    holds = {}
    for name, point in (("start", start), ("goal", goal)):
        holds[name] = shapely.dwithin(rooms, point, GRID)
        if not holds[name].any():
            where = f"{name} ({point.x:g}, {point.y:g})"
            raise ValueError(f"{where} lies in an obstacle grown by the robot's radius, or outside the inset border")
    common = rooms[holds["start"] & holds["goal"]]
    return common[0] if len(common) else None


class _Mesh(NamedTuple):
    r"""A room cut into triangles, as lists of plain numbers, since the search reads them one by one.

    Half-edges 3 t, 3 t + 1, 3 t + 2 run counter-clockwise around triangle t. A half-edge also stands for entering its
    triangle there; seen so, its origin is on the left::

               apex
               /  \
         left /    \ right
             /      \
       origin -------> end
                ^ sight
    """

    apex: list[int]
    """Corner opposite a half-edge."""
    left: list[int]
    """Half-edge by which sight goes on into the next triangle through the side to the left of the apex, or WALL."""
    right: list[int]
    """The same to the right of the apex."""
    x: list[float]
    y: list[float]
    """Position of each corner, of the start and of the goal [m]. Where walls touch, each side has its own corner."""
    previous: list[int]
    following: list[int]
    """Neighbours of each corner along the walls, the free space on their left."""
    arriving: list[int]
    leaving: list[int]
    """Half-edges along the walls that end and that start in each corner."""
    start_edges: list[int]
    goal_edges: frozenset[int]
    """Half-edges of the triangles that hold the start and the goal; several triangles if a side or corner does."""


def _triangulate(room: shapely.Polygon, start: shapely.Point, goal: shapely.Point) -> _Mesh:
    """Cut a polygon with holes into triangles that have all their corners on its walls."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(room))
    position = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    if not shapely.is_ccw(shapely.get_exterior_ring(triangles[0])):
        position = position[:, ::-1]
    position = np.ascontiguousarray(position).reshape(-1, 2)
    edge = np.arange(len(position))
    after = edge + 1 - 3 * (edge % 3 == 2)
    before = after[after]
    twin = _twins(position, after)
    corner = _corners(twin, after)
    wall = edge[twin == WALL]
    place = np.empty((len(wall), 2))  # a corner has one wall that leaves it
    place[corner] = position
    x, y = np.concatenate([place, [(start.x, start.y), (goal.x, goal.y)]]).T.tolist()
    leaving, arriving = wall[np.argsort(corner[wall])], wall[np.argsort(corner[after[wall]])]
    return _Mesh(
        apex=corner[before].tolist(),
        left=twin[before].tolist(),
        right=twin[after].tolist(),
        x=x,
        y=y,
        previous=corner[arriving].tolist(),
        following=corner[after[leaving]].tolist(),
        arriving=arriving.tolist(),
        leaving=leaving.tolist(),
        start_edges=_edges_around(triangles, start),
        goal_edges=frozenset(_edges_around(triangles, goal)),
    )


def _twins(position: NDArray[np.float64], after: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return for each half-edge the one that runs the other way between the same two points, or WALL."""
    point = np.unique(position.view(complex), return_inverse=True)[1].ravel()
    forth, back = point * len(point) + point[after], point[after] * len(point) + point
    order = np.argsort(forth)
    found = order[np.searchsorted(forth, back, sorter=order) % len(order)]
    return np.where(forth[found] == back, found, WALL)


def _corners(twin: NDArray[np.int64], after: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number the corners of the room; return for each half-edge the one it starts in."""
    edge = np.flatnonzero(twin != WALL)
    same = coo_array((np.ones(len(edge)), (edge, after[twin[edge]])), shape=(len(twin), len(twin)))
    corner: NDArray[np.int64] = connected_components(same, directed=False)[1]
    return corner


def _edges_around(triangles: NDArray[np.object_], point: shapely.Point) -> list[int]:
    """Return the half-edges of the triangles that hold a point."""
    holding = np.flatnonzero(shapely.dwithin(triangles, point, GRID))
    edges: list[int] = np.add.outer(3 * holding, [0, 1, 2]).ravel().tolist()
    return edges


def _search(mesh: _Mesh) -> NDArray[np.float64]:
    """Return the way-points (k, 2) of the shortest path, by A* over the corners at which a taut string can bend."""
    x, y = mesh.x, mesh.y
    to_goal = np.hypot(np.array(x) - x[GOAL], np.array(y) - y[GOAL]).tolist()
    length, came_from = [math.inf] * len(x), [START] * len(x)
    queue = [(to_goal[START], 0.0, START)]
    length[START] = 0.0
    while (best := heapq.heappop(queue))[2] != GOAL:
        _, travelled, at = best
        if travelled > length[at]:
            continue
        for corner in _look_around(mesh) if at == START else _look_past(mesh, at, came_from[at]):
            dx, dy = x[corner] - x[at], y[corner] - y[at]
            reached = travelled + math.sqrt(dx * dx + dy * dy)
            if reached < length[corner] and (corner == GOAL or _side(mesh, corner, dx, dy)):
                length[corner], came_from[corner] = reached, at
                heapq.heappush(queue, (reached + to_goal[corner], reached, corner))
    trail = [GOAL]
    while trail[-1] != START:
        trail.append(came_from[trail[-1]])
    return np.array([(x[corner], y[corner]) for corner in reversed(trail)])


def _side(mesh: _Mesh, corner: int, dx: float, dy: float) -> int:
    """Return on which side of a taut string in direction (dx, dy) a corner's obstacle is: 1 left, -1 right.

    0 means that no string bends here: the corner is hollow, or the string would run into the obstacle.
    """
    x, y = mesh.x[corner], mesh.y[corner]
    ax, ay = mesh.x[mesh.previous[corner]] - x, mesh.y[mesh.previous[corner]] - y
    bx, by = mesh.x[mesh.following[corner]] - x, mesh.y[mesh.following[corner]] - y
    if ax * by - ay * bx <= 0.0:
        return 0
    a, b = dx * ay - dy * ax, dx * by - dy * bx
    if a >= -ON_LINE and b >= -ON_LINE:
        return 1
    return -1 if a <= ON_LINE and b <= ON_LINE else 0


def _look_around(mesh: _Mesh) -> list[int]:
    """Return the corners that the start sees (and the goal)."""
    x, y = mesh.x, mesh.y
    x0, y0 = x[START], y[START]
    seen: list[int] = []
    beams: list[Beam] = []
    for edge in mesh.start_edges:
        left, right = mesh.apex[edge], mesh.apex[edge - 1 if edge % 3 else edge + 2]
        seen.append(left)
        if edge in mesh.goal_edges:
            seen.append(GOAL)
        lx, ly, rx, ry = x[left] - x0, y[left] - y0, x[right] - x0, y[right] - y0
        if mesh.right[edge] != WALL and rx * ly - ry * lx > 0.0:
            beams.append((mesh.right[edge], lx, ly, rx, ry))
    return seen + _look_along(mesh, START, beams)


def _look_past(mesh: _Mesh, at: int, origin: int) -> list[int]:
    """Return the corners (and the goal) that a taut string from `origin` can reach once it bends around corner `at`.

    It bends towards the obstacle, so it looks into the wedge between straight on and the obstacle's wall::

                 wall |   / straight on
             obstacle |  /
                      | /
                      at
                     /
              origin
    """
    x0, y0 = mesh.x[at], mesh.y[at]
    ux, uy = x0 - mesh.x[origin], y0 - mesh.y[origin]
    side = _side(mesh, at, ux, uy)
    onward, around = (mesh.left, mesh.right) if side > 0 else (mesh.right, mesh.left)
    edge, wall = (mesh.arriving[at], mesh.previous[at]) if side > 0 else (mesh.leaving[at], mesh.following[at])
    seen: list[int] = [wall]
    beams: list[Beam] = []
    ax, ay = mesh.x[wall] - x0, mesh.y[wall] - y0
    inside = True
    while inside and edge != WALL:
        apex = mesh.apex[edge]
        bx, by = mesh.x[apex] - x0, mesh.y[apex] - y0
        inside = side * (ux * by - uy * bx) >= -ON_LINE
        if inside:
            seen.append(apex)
        else:
            bx, by = ux, uy
        if edge in mesh.goal_edges:
            seen.append(GOAL)
        if onward[edge] != WALL:
            beams.append((onward[edge], ax, ay, bx, by) if side > 0 else (onward[edge], bx, by, ax, ay))
        edge, ax, ay = around[edge], bx, by
    return seen + _look_along(mesh, at, beams)


def _look_along(mesh: _Mesh, at: int, beams: list[Beam]) -> list[int]:
    """Return the corners (and the goal) that beams from `at` see; an apex inside a beam splits it in two."""
    x, y, goal_edges = mesh.x, mesh.y, mesh.goal_edges
    x0, y0, gx, gy = x[at], y[at], x[GOAL] - x[at], y[GOAL] - y[at]
    seen = []
    while beams:
        edge, lx, ly, rx, ry = beams.pop()
        apex, left, right = mesh.apex[edge], mesh.left[edge], mesh.right[edge]
        dx, dy = x[apex] - x0, y[apex] - y0
        from_left, from_right = lx * dy - ly * dx, rx * dy - ry * dx
        if from_left <= ON_LINE and from_right >= -ON_LINE:
            seen.append(apex)
        if edge in goal_edges and lx * gy - ly * gx <= ON_LINE and rx * gy - ry * gx >= -ON_LINE:
            seen.append(GOAL)
        if from_right > 0.0 and right != WALL:
            beams.append((right, dx, dy, rx, ry) if from_left < 0.0 else (right, lx, ly, rx, ry))
        if from_left < 0.0 and left != WALL:
            beams.append((left, lx, ly, dx, dy) if from_right > 0.0 else (left, lx, ly, rx, ry))
    return seen
