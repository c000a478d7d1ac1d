"""Worlds in which every obstacle is written down."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal

import numpy as np

from bug_gym.schema.errors import wrong
from bug_gym.schema.motions import Motion, Replay, Waypoints
from bug_gym.schema.movers import Mover, Target
from bug_gym.schema.polygons import Polygon
from bug_gym.schema.robot import Robot
from bug_gym.schema.values import Disc, Goal, Start
from bug_gym.worlds.clearance import is_clear, obstacles_of
from bug_gym.worlds.family import Crew, Family, Rng
from bug_gym.worlds.layout import Layout
from bug_gym.worlds.layout import Mover as PlacedMover
from bug_gym.worlds.moving import drawn_goal_room, goal_room, target_motion, target_place, with_direction
from bug_gym.worlds.places import border_of, draw_both, finish


class ExplicitWorld(Family):
    """Every obstacle written down."""

    family: Literal["explicit"]
    circles: tuple[Disc, ...] = ()
    """Still circles x, y, radius [m]."""
    polygons: tuple[Polygon, ...] = ()
    """Still polygons: corners x, y [m], or `{shell, holes}`."""
    movers: tuple[Mover, ...] = ()
    """Moving circles and polygons."""
    start: Start
    """x [m], y [m], heading [rad], or a region to draw from."""
    goal: Goal | None = None
    """x, y [m], or a region to draw from."""
    target: Target | None = None
    """A moving goal, instead of `goal`."""

    def obstruction(self, discs: tuple[tuple[float, float, float], ...]) -> str:
        """What discs (x, y, radius) [m] touch: the border, an obstacle or a mover where it starts; or ""."""
        outside = super().obstruction(discs)
        if outside:
            return outside
        still = [(f"circles.{index}", circle) for index, circle in enumerate(self.circles)]
        moving = [
            (f"movers.{index}", (*mover.at, mover.shape.circle))
            for index, mover in enumerate(self.movers)
            if mover.shape.circle is not None and mover.is_there
        ]
        for name, (x, y, radius) in [*still, *moving]:
            if any(math.dist((x, y), disc[:2]) < radius + disc[2] for disc in discs):
                return name
        return self._touched_polygon(discs)

    def _touched_polygon(self, discs: tuple[tuple[float, float, float], ...]) -> str:
        still = [(f"polygons.{index}", polygon.geometry()) for index, polygon in enumerate(self.polygons)]
        moving = [
            (f"movers.{index}", mover.shape.polygon.geometry(mover.at))
            for index, mover in enumerate(self.movers)
            if mover.shape.polygon is not None and mover.is_there
        ]
        if not still and not moving:
            return ""
        import shapely  # slow to load, and most scenarios need none

        for x, y, radius in discs:
            centre = shapely.Point(x, y)
            for name, outline in [*still, *moving]:
                if outline.distance(centre) < radius or outline.contains(centre):
                    return name
        return ""

    def motions(self) -> Iterator[tuple[str, Motion]]:
        """Of movers and of the goal."""
        yield from ((f"movers.{index}.motion", mover.motion) for index, mover in enumerate(self.movers))
        if self.target is not None:
            yield "target.motion", self.target.motion

    def check(self, robot: Robot) -> None:
        """Start, goal and movers lie within the bounds, start and goal clear of all obstacles, and no mover in a polygon."""
        if (self.goal is None) == (self.target is None):
            raise wrong("expected one of goal and target, got " + ("none" if self.goal is None else "both"), "goal")
        for index, mover in enumerate(self.movers):
            if not self._holds_mover(mover):
                reason = (
                    f"got {list(mover.at)}, expected a place in {list(self.box)} at which it reaches over no border"
                )
                raise wrong(reason, f"movers.{index}.at")
            self.check_motion(mover.motion, f"movers.{index}.motion")
        self._check_walled_in()
        self.check_start(self.start, robot)
        self.check_goal(self.goal)
        self.check_target(self.target)

    def _holds_mover(self, mover: Mover) -> bool:
        """Whether all of a mover lies within the border as it begins."""
        (x, y), polygon = mover.at, mover.shape.polygon
        corners = () if polygon is None else tuple((x + along_x, y + along_y) for along_x, along_y in polygon.shell)
        # 1e-9: what touches when it starts is free, whatever the rounding
        return self.holds(x, y, mover.shape.circle or 0.0) and (not corners or self.holds_polygon(corners, 1e-9))

    def _check_walled_in(self) -> None:
        """No mover that still obstacles turn back begins inside a polygon: its edges would keep it in there, unseen."""
        turned_back = [
            (index, mover.at)
            for index, mover in enumerate(self.movers)
            if not isinstance(mover.motion, (Waypoints, Replay))
        ]
        if not turned_back or not self.polygons:
            return
        import shapely  # slow to load, and most scenarios need none

        for number, polygon in enumerate(self.polygons):
            outline = polygon.geometry()
            shapely.prepare(outline)
            for index, at in turned_back:
                if outline.contains(shapely.Point(at)):
                    raise wrong(f"got {list(at)}, expected a place outside of polygons.{number}", f"movers.{index}.at")

    def layout(self, crew: Crew, rng: Rng) -> Layout:
        """Every obstacle written down; start and goal may be drawn from regions."""
        circles = np.array(self.circles, dtype=np.float64).reshape(-1, 3)
        polygons = tuple(
            tuple(np.array(ring, dtype=np.float64) for ring in (polygon.shell, *polygon.holes))
            for polygon in self.polygons
        )
        movers = []
        for mover in self.movers:
            shape, motion = mover.shape, with_direction(mover.motion, rng)
            assert motion is not None
            outline = shape.circle if shape.polygon is None else np.array(shape.polygon.shell, dtype=np.float64)
            assert outline is not None
            movers.append(PlacedMover(outline, mover.at, motion))
        border = border_of(self)
        in_the_way = obstacles_of(circles, polygons, movers)
        start_free = is_clear(*in_the_way, border, crew.robot.reach)
        goal_free = is_clear(*in_the_way, border, drawn_goal_room(crew, self.target))
        place = target_place(self, self.goal, self.target)
        start, goal = draw_both(crew, self, self.start, place, rng, start_free, goal_free, 0.0)
        return finish(
            crew,
            self,
            start,
            goal,
            circles=circles,
            polygons=polygons,
            movers=tuple(movers),
            target=target_motion(self.target, rng),
            goal_room=goal_room(crew, self.target),
        )
