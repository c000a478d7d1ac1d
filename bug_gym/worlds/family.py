"""What all families of worlds share: a border, checks of what is written, and what a layout is made for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from bug_gym.limits import CELL_BYTES, MOST_CELLS, told_bytes
from bug_gym.schema.errors import shortened, wrong
from bug_gym.schema.motions import Crowd, Motion
from bug_gym.schema.movers import Target
from bug_gym.schema.polygons import Bounds, WeightedRegion
from bug_gym.schema.robot import Robot, Robots
from bug_gym.schema.values import Goal, NotNegative, Part, Region, Start, StartRegion
from bug_gym.worlds.layout import Layout

Rng = np.random.Generator


@dataclass(frozen=True)
class Crew:
    """Whom a world is made for: all that a layout knows of the scenario beside its own family."""

    robot: Robot
    """The body that needs room."""
    robots: Robots
    """How many there are, and their own places."""
    goal_radius: float
    """Distance from the goal within which it is reached [m]."""
    time_limit: float
    """Longest duration of an episode, as the scenario says it [s]; episodes may be cut off before."""

    @property
    def goal_room(self) -> float:
        """Distance from still obstacles at which a goal can always be reached [m]."""
        return max(self.goal_radius, self.robot.reach)


def check_cells(columns: int, rows: int, key: str) -> None:
    """Raises where a world has more cells than one can be drawn of; `key` is what says how many."""
    cells = columns * rows
    if cells > MOST_CELLS:
        memory = f"they would take {told_bytes(CELL_BYTES * cells)} while they are drawn"
        raise wrong(f"got {columns:,} x {rows:,} cells, expected at most {MOST_CELLS:,} in all: {memory}", key)


def _rectangle(xmin: float, ymin: float, xmax: float, ymax: float) -> tuple[tuple[float, float], ...]:
    """Corners x, y of a box."""
    return (xmin, ymin), (xmax, ymin), (xmax, ymax), (xmin, ymax)


class Family(Part):
    """What all families of worlds share."""

    has_own_goals: ClassVar[bool] = False
    """Whether its layouts have a goal for each robot."""

    bounds: Bounds = (-10.0, -10.0, 10.0, 10.0)
    """xmin, ymin, xmax, ymax, or the corners x, y of a simple polygon [m]; the border is always a wall."""
    regions: tuple[WeightedRegion, ...] = ()
    """Ground that slows robots down, the same in each world: `{polygon: ..., factor: 2.5}`."""

    @property
    def box(self) -> tuple[float, float, float, float]:
        """xmin, ymin, xmax, ymax of the bounds, or of what holds them [m]."""
        match self.bounds:
            case (float(xmin), float(ymin), float(xmax), float(ymax)):
                return xmin, ymin, xmax, ymax
            case corners:
                x, y = zip(*corners, strict=True)
                return min(x), min(y), max(x), max(y)

    @property
    def corners(self) -> tuple[tuple[float, float], ...]:
        """Corners x, y of the border [m]."""
        match self.bounds:
            case (float(xmin), float(ymin), float(xmax), float(ymax)):
                return _rectangle(xmin, ymin, xmax, ymax)
            case corners:
                return corners

    def obstruction(self, discs: tuple[tuple[float, float, float], ...]) -> str:
        """What discs (x, y, radius) [m] touch of all that the scenario fixes, or "" where they are clear."""
        return "" if all(self.holds(*disc) for disc in discs) else f"the border of {shortened(list(self.bounds))}"

    def holds(self, x: float, y: float, radius: float = 0.0) -> bool:
        """Whether a disc [m] lies within the border."""
        xmin, ymin, xmax, ymax = self.box
        inside = xmin + radius <= x <= xmax - radius and ymin + radius <= y <= ymax - radius
        if not inside or self.corners == _rectangle(*self.box):
            return inside
        import shapely  # slow to load, and most scenarios need none

        outline, centre = shapely.Polygon(self.corners), shapely.Point(x, y)
        return bool(outline.covers(centre) and outline.exterior.distance(centre) >= radius)

    def holds_box(self, box: tuple[float, float, float, float]) -> bool:
        """Whether a rectangle xmin, ymin, xmax, ymax [m] lies within the border."""
        return self.holds_polygon(_rectangle(*box))

    def holds_polygon(self, corners: tuple[tuple[float, float], ...], slack: float = 0.0) -> bool:
        """Whether a polygon, corners x, y, reaches over the border nowhere by more than `slack` [m]."""
        if self.corners == _rectangle(*self.box):
            return all(self.holds(*corner, -slack) for corner in corners)
        import shapely  # slow to load, and most scenarios need none

        return bool(shapely.Polygon(self.corners).buffer(slack).covers(shapely.Polygon(corners)))

    def data_files(self) -> tuple[Path, ...]:
        """The files that its worlds are read from."""
        return ()

    def check(self, robot: Robot) -> None:
        """Raises where this robot can't live in this world."""

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """One world of the family; those of a `field` have none, compiled code places them (kernels.place_fields).

        Raises:
            ValueError: start, goal or obstacles found no place.
        """
        raise NotImplementedError(f"{type(self).__name__} has no layout")

    def check_start(self, start: tuple[float, float, float] | StartRegion | None, robot: Robot) -> None:
        """Raises where a start has no room for the robot, or is drawn from beyond the bounds."""
        if isinstance(start, tuple):
            touched = self.obstruction(robot.body(start))
            if touched:
                raise wrong(f"got {list(start)}, expected room for the robot; in its way: {touched}", "start")
        elif start is not None:
            self.check_region(start.region, "start.region")

    def check_goal(self, goal: tuple[float, float] | Region | None) -> None:
        """Raises where a goal isn't free, or is drawn from beyond the bounds."""
        if isinstance(goal, tuple):
            self.check_point(goal, "goal")
        elif goal is not None:
            self.check_region(goal.region, "goal.region")

    def check_target(self, target: Target | None) -> None:
        """Raises where a moving goal starts or goes out of bounds."""
        if target is None:
            return
        self.check_motion(target.motion, "target.motion")
        if target.at is not None:
            self.check_point(target.at, "target.at")
        if target.region is not None:
            self.check_region(target.region, "target.region")

    def check_point(self, point: tuple[float, float], key: str) -> None:
        """Raises where something fixed stands on a point that the scenario names by `key`."""
        touched = self.obstruction(((*point, 0.0),))
        if touched:
            raise wrong(f"got {list(point)}, expected a free point; in its way: {touched}", key)

    def check_region(self, region: tuple[float, float, float, float], key: str) -> None:
        """Raises where a rectangle [m] reaches beyond the bounds."""
        xmin, ymin, xmax, ymax = self.box
        if region[0] < xmin or region[1] < ymin or region[2] > xmax or region[3] > ymax:
            raise wrong(f"got {list(region)}, expected a rectangle within bounds {list(self.box)}", key)

    def check_holds(self, needed: tuple[float, float, float, float], what: str) -> None:
        """Raises where the border does not hold a rectangle [m] about `what` the family is made of."""
        if not self.holds_box(needed):
            came = shortened(list(self.bounds))
            raise wrong(f"got {came}, expected bounds that hold the {what}: {list(needed)}", "bounds")

    def check_width(self, width: float, robot: Robot, key: str) -> None:
        """Raises where the robot is too wide for a passage of some width [m]."""
        if width <= 2.0 * robot.reach:
            raise wrong(f"got {width:g}, expected more than the robot's width ({2 * robot.reach:g})", key)

    def check_clearance(self, clearance: float | None, robot: Robot, key: str) -> None:
        """Raises where this robot needs more room than a promised clearance [m]."""
        if clearance is not None and clearance < robot.reach:
            raise wrong(f"got {clearance:g}, expected at least the robot's reach ({robot.reach:g})", key)

    def check_separation(
        self,
        separation: float,
        start: tuple[float, float, float] | StartRegion | None,
        goal: tuple[float, float] | Region | None,
    ) -> None:
        """Raises where start and goal can't be so far apart [m].

        Where a scenario says both as points and no separation, its default gives way: the world asks for none.
        """
        xmin, ymin, xmax, ymax = self.box
        most = math.hypot(xmax - xmin, ymax - ymin)
        are_said = False
        if isinstance(start, tuple) and isinstance(goal, tuple):
            most, are_said = math.dist(start[:2], goal), hasattr(self, "start")  # a maze asks about two of its cells
        if separation <= most:
            return
        expected = f"expected at most {most:g}, all that there is"
        if "separation" not in type(self).model_fields or "separation" in self.model_fields_set:
            raise wrong(f"got {separation:g}, {expected}", "separation")
        if not are_said:
            raise wrong(f"got {separation:g}, the default, {expected}: set world.separation", "separation")
        # It is frozen, and whoever draws the world asks for so much; what has been accepted before keeps its digest.
        object.__setattr__(self, "separation", 0.0)

    def motions(self) -> Iterator[tuple[str, Motion]]:
        """How bodies move of which that is said, each by its key."""
        yield from ()

    def check_motion(self, motion: Motion, key: str) -> None:
        """Raises where a motion leads out of the bounds."""
        name = "goals" if isinstance(motion, Crowd) else "points"
        points: Iterable[tuple[float, ...]] = getattr(motion, name, None) or ()
        for index, point in enumerate(points):
            x, y = point[-2:]
            if Family.obstruction(self, ((x, y, 0.0),)):
                raise wrong(f"got {[x, y]}, expected a point in {list(self.box)}", f"{key}.{name}.{index}")


class DrawnPlaces(Family):
    """Families whose worlds are drawn anew for each seed, start and goal wherever there is room."""

    start: Start | None = None
    """x [m], y [m], heading [rad], or a region to draw from; none: anywhere."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from; none: anywhere."""
    separation: NotNegative = 8.0
    """Least distance from start to goal [m]; unless it is said, points that are said may lie nearer."""

    def check(self, robot: Robot) -> None:
        """Start and goal lie within the bounds, and far enough apart."""
        self.check_start(self.start, robot)
        self.check_goal(self.goal)
        self.check_separation(self.separation, self.start, self.goal)
