"""The map that planners read: still obstacles as polygons and discs within a border, and ground that costs more.

One frozen object, whether it comes from a world (live.py), from a map of ROS's map_server or from a recorded scan. Where
a disc robot may be is asked of it with the obstacles grown by the robot's radius (Lozano-Perez 1983).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
import shapely.ops
from numpy.typing import ArrayLike, NDArray

from bug_gym.geometry import F64, Point
from bug_gym.schema.polygons import WeightedRegion
from bug_gym.shortest_path import Path as ShortestPath
from bug_gym.shortest_path import free_space, reachable, shortest_path
from bug_gym.worlds.layout import Layout, Rings
from bug_gym.worlds.ros_files import load_ros_map
from bug_gym.worlds.ros_outlines import load_outlines

QUARTER = 8
"""Chords of a quarter of the arc about a grown corner."""

Pose = tuple[float, float, float]
"""x, y [m], heading [rad]."""


class Ground(NamedTuple):
    """A region that is dear to cross."""

    factor: float
    """What a metre in it costs, in metres of open ground."""
    disc: tuple[float, float, float] | None
    """x, y, radius [m]; None: it is a polygon."""
    rings: Rings
    """Rings (k, 2) of the polygon [m], none for a disc."""


class Grown(NamedTuple):
    """A map for the centre of a disc robot."""

    inside: shapely.Polygon | shapely.MultiPolygon
    """What is left within the border."""
    obstacles: NDArray[np.object_]
    """A polygon (n,) an obstacle: the discs in their order, then the polygons."""


@dataclass(frozen=True)
class PlanningMap:
    """What stands in a world. All coordinates are in one frame [m]; whose frame it is, says who made the map.

    Its arrays cannot be written to: what is read-only here may still be written by who owns it elsewhere.
    """

    border: F64
    """Corners (k, 2) of the simple polygon around all; outside is wall."""
    discs: F64
    """Round obstacles (n, 3): x, y, radius."""
    polygons: tuple[Rings, ...] = ()
    """The other obstacles, each a tuple of rings (k, 2): the shell, then its holes, which are free."""
    regions: tuple[Ground, ...] = ()
    """Ground that is dear to cross."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "border", read_only(self.border))
        object.__setattr__(self, "discs", read_only(self.discs))
        object.__setattr__(self, "polygons", tuple(tuple(map(read_only, rings)) for rings in self.polygons))
        regions = (one._replace(rings=tuple(map(read_only, one.rings))) for one in self.regions)
        object.__setattr__(self, "regions", tuple(regions))

    @classmethod
    def of_layout(cls, layout: Layout, regions: Sequence[WeightedRegion] = ()) -> PlanningMap:
        """The still obstacles of a layout, in the frame of its world."""
        return cls(layout.border, layout.circles, layout.polygons, tuple(map(ground_of, regions)))

    @classmethod
    def of_ros(cls, path: str | Path, *, unknown_is_wall: bool = False) -> PlanningMap:
        """The occupied cells of a map of ROS's map_server, within the outline of its picture.

        Args:
            path: the map's .yaml.
            unknown_is_wall: whether cells that are neither occupied nor free are walls too.

        Raises:
            ValueError: no such map.
        """
        where = str(Path(path).expanduser().absolute())
        rows, columns = load_ros_map(where).cells.shape
        corners = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]], dtype=np.float64)
        border = load_ros_map(where).to_world(corners)
        return cls(border, np.zeros((0, 3)), load_outlines(where, unknown_is_wall=unknown_is_wall))

    @classmethod
    def of_scan(cls, angles: ArrayLike, ranges: ArrayLike, *, reach: float) -> PlanningMap:
        """What a recorded scan saw, from there: a disc for each hit, as wide as the beam; unseen ground counts as free.

        Args:
            angles: (B,) bearing of each beam [rad].
            ranges: (B,) [m]; one of `reach` or more, or none that is finite, is no hit.
            reach: range that means "nothing seen" [m]; the border is the square about the circle of this radius.

        Raises:
            ValueError: angles and ranges of different lengths, or a reach that is not above 0.
        """
        bearings, lengths = (np.atleast_1d(np.asarray(values, dtype=np.float64)) for values in (angles, ranges))
        if bearings.shape != lengths.shape or bearings.ndim != 1 or len(bearings) == 0:
            raise ValueError(f"expected as many ranges as angles, got shapes {lengths.shape} and {bearings.shape}")
        if not (reach > 0.0 and math.isfinite(reach)):
            raise ValueError(f"reach must be above 0 m, got {reach!r}")
        spacing = float(np.abs(np.diff(bearings)).min()) if len(bearings) > 1 else 0.0
        hit = (lengths >= 0.0) & (lengths < reach)
        away, along = lengths[hit], bearings[hit]
        discs = np.column_stack([away * np.cos(along), away * np.sin(along), 0.5 * spacing * away])
        border = reach * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        return cls(border, discs)

    def seen_from(self, pose: Pose) -> PlanningMap:
        """The same map in the frame of a pose: its place the origin, its heading the x-axis."""
        moved = tuple(tuple(in_frame(ring, pose) for ring in rings) for rings in self.polygons)
        regions = tuple(moved_ground(one, pose) for one in self.regions)
        return PlanningMap(in_frame(self.border, pose), moved_discs(self.discs, pose), moved, regions)

    def with_obstacles(self, discs: F64, polygons: tuple[Rings, ...] = ()) -> PlanningMap:
        """The same map with more obstacles (n, 3) x, y, radius, and polygons: movers where they are now, say."""
        return replace(self, discs=np.concatenate([self.discs, discs]), polygons=(*self.polygons, *polygons))

    @cached_property
    def box(self) -> tuple[float, float, float, float]:
        """xmin, ymin, xmax, ymax of the border [m]."""
        (xmin, ymin), (xmax, ymax) = self.border.min(axis=0).tolist(), self.border.max(axis=0).tolist()
        return xmin, ymin, xmax, ymax

    @cached_property
    def span(self) -> float:
        """Diagonal of that box [m]."""
        xmin, ymin, xmax, ymax = self.box
        return math.hypot(xmax - xmin, ymax - ymin)

    def shapes(self) -> NDArray[np.object_]:
        """The obstacles (n,) as polygons around them, the discs first."""
        return self.grown(0.0).obstacles

    def grown(self, margin: float) -> Grown:
        """The obstacles with all that is nearer to them than a margin [m]: where the centre of a robot must not be.

        Round corners become polygons around the arcs, so a straight way past them keeps the margin, and up to half a per
        cent more.

        Raises:
            ValueError: a margin below 0, or that is not finite.
        """
        if not (margin >= 0.0 and math.isfinite(margin)):
            raise ValueError(f"a margin is at least 0 m, got {margin!r}")
        # Chords of a circle larger by this lie around it.
        circumscribed = 1.0 / math.cos(0.25 * math.pi / QUARTER)
        points = shapely.points(self.discs[:, :2])
        discs = shapely.buffer(points, circumscribed * (self.discs[:, 2] + margin), quad_segs=QUARTER)
        polygons = self._solids
        if margin > 0.0:
            polygons = shapely.buffer(polygons, circumscribed * margin, quad_segs=QUARTER)
        # A border shrinks without arcs where it is convex; where it is not, the same holds as of obstacles.
        inside = shapely.buffer(self._inside, -circumscribed * margin, quad_segs=QUARTER)
        return Grown(inside, np.concatenate([discs, polygons]))

    def clearance_at(self, place: Point) -> float:
        """Distance from a place to the nearest obstacle or to the border [m]; 0 in an obstacle or outside."""
        point = shapely.Point(place)
        if not self._inside.contains(point):
            return 0.0
        away = [self._inside.exterior.distance(point), *shapely.distance(self._solids, point)]
        discs = np.hypot(*(self.discs[:, :2] - place).T) - self.discs[:, 2]
        return max(float(min([*away, *discs])), 0.0)

    def is_clear(self, places: F64, radius: float) -> bool:
        """Whether a disc touches nothing along a chain of straight pieces; it begins within the border.

        Args:
            places: (k, 2) of its centre [m].
            radius: of the disc [m].
        """
        chain = shapely.LineString(places)
        if len(self._solids_tree.query(chain, predicate="dwithin", distance=radius)):
            return False
        away = shapely.distance(chain, self._disc_centres) - self.discs[:, 2]
        return not (away < radius).any() and self._inside.exterior.distance(chain) >= radius

    def free_place_near(self, place: Point, *, radius: float, reach: float) -> Point | None:
        """The nearest place to one where a disc fits; None where there is none within reach.

        Args:
            place: to begin with [m].
            radius: of the disc [m].
            reach: how far away it may be [m].
        """
        if self.clearance_at(place) >= radius:
            return place
        free = free_space(self.discs, self.polygons, self.border, radius=radius)
        point = shapely.Point(place)
        if free.is_empty or free.distance(point) > reach:
            return None
        nearest, _ = shapely.ops.nearest_points(free, point)
        return nearest.x, nearest.y

    def free_part(self, place: Point, *, radius: float, reach: float) -> shapely.Geometry:
        """All that a disc can come to from a place; empty where it has no room within reach of it.

        Args:
            place: where from [m].
            radius: of the disc [m].
            reach: how far from there it may begin [m].
        """
        free = shapely.get_parts(free_space(self.discs, self.polygons, self.border, radius=radius))
        away = shapely.distance(free, shapely.Point(place))
        nearest = int(away.argmin()) if len(free) else -1
        return free[nearest] if nearest >= 0 and away[nearest] <= reach else shapely.Polygon()

    @cached_property
    def _inside(self) -> shapely.Polygon:
        return shapely.Polygon(self.border)

    @cached_property
    def _solids(self) -> NDArray[np.object_]:
        """The polygons as shapely's (n,)."""
        return np.array([shapely.Polygon(shell, holes) for shell, *holes in self.polygons], dtype=object)

    @cached_property
    def _solids_tree(self) -> shapely.STRtree:
        return shapely.STRtree(self._solids)

    @cached_property
    def _disc_centres(self) -> NDArray[np.object_]:
        return np.asarray(shapely.points(self.discs[:, :2]))

    def shortest_path(self, start: Point, goal: Point, *, radius: float) -> ShortestPath:
        """The project's own shortest path of a disc robot, see `bug_gym.shortest_path`, with its errors."""
        return shortest_path(self.discs, self.polygons, self.border, start, goal, radius=radius)

    def joins(self, start: Point, goal: Point, *, radius: float) -> bool:
        """Whether a disc robot can come from one place to another, see `bug_gym.shortest_path.reachable`, with its errors.

        No is certain; yes may be a gap of 1.98 radii.
        """
        return reachable(self.discs, self.polygons, self.border, start, goal, radius=radius)


def read_only(array: F64) -> F64:
    """The same numbers, which cannot be written through what is returned."""
    view = array.view()
    view.flags.writeable = False
    return view


def ground_of(region: WeightedRegion) -> Ground:
    """A region of a scenario."""
    if region.polygon is None:
        return Ground(region.factor, region.circle, ())
    return Ground(region.factor, None, tuple(np.array(ring) for ring in (region.polygon.shell, *region.polygon.holes)))


def in_frame(places: F64, pose: Pose) -> F64:
    """Places (k, 2) in the frame of a pose [m]."""
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    turned: F64 = (places - (x, y)) @ np.array([[cos, -sin], [sin, cos]])
    return turned


def inverse(pose: Pose) -> Pose:
    """The pose of a frame's origin in the frame of a pose: `in_frame` with it leads back."""
    x, y, heading = pose
    cos, sin = math.cos(heading), math.sin(heading)
    return -cos * x - sin * y, sin * x - cos * y, -heading


def moved_discs(discs: F64, pose: Pose) -> F64:
    """Discs (n, 3) x, y, radius in the frame of a pose [m]."""
    return np.column_stack([in_frame(discs[:, :2], pose), discs[:, 2]])


def moved_ground(ground: Ground, pose: Pose) -> Ground:
    """A region in the frame of a pose."""
    disc = None if ground.disc is None else tuple(moved_discs(np.array([ground.disc]), pose)[0].tolist())
    return Ground(ground.factor, disc, tuple(in_frame(ring, pose) for ring in ground.rings))
