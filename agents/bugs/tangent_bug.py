"""TangentBug: go round what blocks the goal by the shorter tangent; follow a wall only out of a local minimum.

Source: Kamon, Rimon and Rivlin (1998); side commitment and the registers' exact meaning for a disc are ours.
Sensing assumed: ranges up to r_max all round, goal, own position. Memory kept: the side committed to, the distance from
the goal to the wall followed (d_followed), a gate on it. States: motion_to_goal, boundary_following, leaving (for a
place nearer to the goal than that wall), leaving_straight (see survey_lap). Guarantee: reaches the goal or
declares it unreachable. Length: at most D + sum(p_i) + sum(p_i m_i) over the obstacles nearer to the goal than the
start, m_i the number of local minima of the distance to the goal on obstacle i.

While it goes to the goal its distance falls in every step, for it heads only for places nearer to the goal. It leaves
a wall only for a place nearer to the goal than all it has seen of that wall. d_followed is measured on the wall itself
and d_reach where the robot's centre can be: a place at the wall is at least a clearance farther away than the wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from bug_gym.agents.walls.boundary import FRESH_STARTS, LeaveRule, Turn
from bug_gym.agents.walls.boundary_bug import BoundaryBug, BoundaryParameters
from bug_gym.agents.walls.contour import TARGET_MOVED, BugMemory
from bug_gym.agents.walls.survey import Survey, survey_lap
from bug_gym.agents.walls.tangent_graph import Node, TangentGraph
from bug_gym.geometry import Point
from bug_gym.policy import Drawing, Velocity
from bug_gym.view import Sensors, View

COMMITMENT = 0.2
"""How much shorter the way round the other side must look to change sides, as a share."""

TOUCH = 1.5
"""How much farther from a wall than the clearance is at the wall, in steps."""

CLOSER = 0.1
"""How much nearer to the goal is nearer while the robot goes to it, in steps."""


@dataclass
class TangentBugMemory(BugMemory):
    """Memory of TangentBug."""

    side: int = 0
    """The side committed to; 0: none."""
    passed_wall: Point | None = None
    """The point of a wall that it passes on that side on its way to the goal, odometry frame [m]."""
    destination: Point | None = None
    """Where it goes now: the goal, a node, the wall, or nearer to the goal than the wall; odometry frame [m]."""
    chosen_at: Point = (0.0, 0.0)
    """Where it chose that, odometry frame [m]."""
    target: Point | None = None
    """Where the target was when the distances below were measured, odometry frame [m]."""
    hit_distance: float = math.inf
    """Distance to the goal where the last following began [m]."""
    best: float = math.inf
    """The least of those [m]."""
    followed: float = math.inf
    """d_followed: distance from the goal to the nearest point seen of the wall followed [m]."""
    wall: Point = (0.0, 0.0)
    """The point of the wall where it will touch it, odometry frame [m]."""
    way: float = 0.0
    """How far it was to the destination when the robot chose to leave for it [m]."""
    trust: float = math.inf
    """How far the scan is believed [m]."""
    survey: Survey = field(default_factory=Survey)
    """What is known of this lap."""


@dataclass(frozen=True)
class TangentBugParameters(BoundaryParameters):
    """Parameters of TangentBug."""

    turn: Turn = "left"
    """Which way to turn at a wall that has no end in sight, or equally near ones."""
    leave_rule: LeaveRule = "any"
    """Where a wall may be left: "any" for a place in any direction (the algorithm as published), "front" only within 90
    degrees of the direction of travel."""
    r_max: float | None = None
    """How far to look [m]; None: as far as the LIDAR sees."""


class TangentBug(BoundaryBug):
    """TangentBug.

    Raises:
        TypeError: an unknown parameter.
        ValueError: an r_max not above the clearance; and what BoundaryBug refuses.
    """

    Parameters = TangentBugParameters
    parameters: TangentBugParameters
    fresh_starts = FRESH_STARTS

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        r_max = self.parameters.r_max
        if r_max is not None and not r_max > self.boundary.clearance:
            raise ValueError(f"r_max must be above the clearance of {self.boundary.clearance:g} m, got {r_max!r}")
        self.r_max = sensors.range if r_max is None else min(r_max, sensors.range)

    def start(self) -> TangentBugMemory:
        """Memory of a new episode."""
        return TangentBugMemory(mode="motion_to_goal")

    def act(self, view: View, memory: TangentBugMemory) -> Velocity:
        """One decision."""
        self.boundary.advance(view, memory)
        self._watch_target(view, memory)
        graph = TangentGraph(view, self.boundary.inner, reach=self.r_max)
        if memory.mode == "boundary_following":
            self._look_for_leave(view, memory, graph)
        velocity = None
        if memory.mode == "leaving":
            velocity = self._leave(view, memory, graph)
        if memory.mode == "motion_to_goal":
            velocity = self._go(view, memory, graph)
        if memory.mode == "leaving_straight":
            velocity = self._go_straight(view, memory, graph)
        if velocity is not None:
            return velocity
        return self._follow(view, memory, graph)

    def _watch_target(self, view: View, memory: TangentBugMemory) -> None:
        """Forget distances to a place that the target has left, or that led round walls in vain."""
        if memory.is_fresh:
            memory.target, memory.is_fresh = None, False
        if memory.target is not None and math.dist(memory.target, view.goal_position) <= TARGET_MOVED:
            return
        memory.target = view.goal_position
        memory.followed = memory.best = memory.hit_distance = math.inf
        memory.survey = Survey()
        memory.destination = None
        if memory.contour is None:
            memory.mode = "motion_to_goal"

    # -------------------------------------------------------------------------------------------- motion to goal

    def _go(self, view: View, memory: TangentBugMemory, graph: TangentGraph) -> Velocity | None:
        """Velocity to the goal or to a node nearer to it; None at a local minimum, where following has begun."""
        if memory.destination is None or self._has_gone_on(view, memory, memory.destination):
            memory.chosen_at = view.position
            memory.destination = self._destination(view, memory, graph)
            if memory.destination is None:
                self._begin_following(view, memory, graph)
                return None
        velocity = self._go_to(view, memory.destination)
        if velocity is None:
            bearing, _ = self._bearing_and_distance(view, memory.destination)
            self._begin_following(view, memory, graph)
            self._lay_hand(view, memory, bearing)
        return velocity

    def _has_gone_on(self, view: View, memory: TangentBugMemory, destination: Point) -> bool:
        """Whether to choose anew; a robot that only turns sees the same otherwise, and would turn to and fro."""
        _, distance = self._bearing_and_distance(view, destination)
        return distance <= CLOSER * self.boundary.step or (
            math.dist(memory.chosen_at, view.position) >= 0.5 * self.boundary.step
        )

    def _destination(self, view: View, memory: TangentBugMemory, graph: TangentGraph) -> Point | None:
        """The goal or a node, odometry frame [m]; None at a local minimum."""
        run = graph.blocking_run
        if run < 0 or self.boundary.sees_goal(view, self.r_max):
            memory.side, memory.passed_wall = 0, None
            return view.goal_position
        node = self._choose(view, memory, graph, run)
        if node is None:
            return None
        memory.side, memory.passed_wall = node.side, view.to_odometry(*node.contact)
        return view.to_odometry(*node.place)

    def _bearing_and_distance(self, view: View, place: Point) -> tuple[float, float]:
        """Of a place of the odometry frame [rad], [m]."""
        x, y = view.to_robot(*place)
        return math.atan2(y, x), math.hypot(x, y)

    def _go_to(self, view: View, place: Point) -> Velocity | None:
        """Velocity straight to a place of the odometry frame; None where the way is blocked."""
        return self.boundary.go(view, *self._bearing_and_distance(view, place))

    def _choose(self, view: View, memory: TangentBugMemory, graph: TangentGraph, run: int) -> Node | None:
        """The node to go to: nearer to the goal, on the shortest way; or None at a local minimum.

        It keeps to the side that it has taken of an obstacle until another way looks shorter by COMMITMENT.
        """
        limit = graph.goal_distance - CLOSER * self.boundary.step
        nearer = [node for node in self._ends(graph, run) if graph.distance_to_goal(node) < limit]
        best = min(nearer, key=graph.way_past, default=None)
        if memory.passed_wall is None:
            return best
        kept_run = graph.run_at(view.to_robot(*memory.passed_wall))
        kept = graph.end(kept_run, memory.side)
        if kept is None or (best is not None and graph.way_past(best) < (1.0 - COMMITMENT) * graph.way_past(kept)):
            return best
        if graph.distance_to_goal(kept) < limit:
            return kept
        return None if kept_run == run else best

    def _ends(self, graph: TangentGraph, run: int) -> list[Node]:
        """The end nodes of a run, that of the side of the first turn first."""
        ends = (graph.end(run, side) for side in (self.side, -self.side))
        return [node for node in ends if node is not None]

    # ---------------------------------------------------------------------------------------- boundary following

    def _begin_following(self, view: View, memory: TangentBugMemory, graph: TangentGraph) -> None:
        """At a local minimum: choose a side, and where to touch the wall."""
        run = graph.blocking_run
        if memory.side == 0:
            best = min(self._ends(graph, run), key=graph.way_past, default=None)
            memory.side = self.side if best is None else best.side
        memory.mode = "boundary_following"
        memory.hits.append(view.position)
        memory.hit_sides.append(memory.side)
        memory.hit_odometers.append(memory.odometer)
        memory.hit_distance = view.goal_distance
        memory.best = min(memory.best, view.goal_distance)
        memory.followed = min(graph.goal_distance_of(run), view.goal_distance)
        memory.passed_wall = None
        self._begin_lap(memory)
        # Where the scan has been wrong, and where all around is wall: straight on to what blocks the goal.
        last = graph.last_heading(run, memory.side) if memory.trust == math.inf else None
        place, wall = graph.touch(last if last is not None else 0)
        memory.destination, memory.wall = view.to_odometry(*place), view.to_odometry(*wall)

    def _begin_lap(self, memory: TangentBugMemory) -> None:
        """Nothing is known of this lap yet."""
        memory.contour = None
        memory.survey = Survey()

    def _lay_hand(self, view: View, memory: TangentBugMemory, bearing: float) -> None:
        """Follow the wall that blocks a bearing [rad] from here on."""
        memory.contour = self.boundary.lay_hand(view, memory.side, bearing)

    def _follow(self, view: View, memory: TangentBugMemory, graph: TangentGraph) -> Velocity:
        """Velocity to the place where it will touch the wall, or along the wall."""
        if memory.contour is None:
            velocity = self._approach(view, memory, graph)
            if velocity is not None:
                return velocity
        return self.boundary.follow(view, memory)

    def _approach(self, view: View, memory: TangentBugMemory, graph: TangentGraph) -> Velocity | None:
        """Velocity to the wall; None where it has been touched."""
        assert memory.destination is not None
        bearing, distance = self._bearing_and_distance(view, memory.destination)
        run = graph.run_at(view.to_robot(*memory.wall))
        wall = graph.nearest_of(run)
        is_there = distance <= 0.5 * self.boundary.step
        if wall is not None:
            is_there |= math.hypot(*wall) <= self.boundary.clearance + TOUCH * self.boundary.step
        if not is_there:
            velocity = self._go_to(view, memory.destination)
            if velocity is not None:
                return velocity
        elif wall is not None:
            bearing = math.atan2(wall[1], wall[0])
        self._lay_hand(view, memory, bearing)
        assert memory.contour is not None
        if graph.run_at(view.to_robot(*memory.contour.wall)) != run:
            self._lose_trust(view, memory)
        return None

    # ---------------------------------------------------------------------------------------------------- leaving

    def _look_for_leave(self, view: View, memory: TangentBugMemory, graph: TangentGraph) -> None:
        """Bring d_followed and d_reach up to date; leave, or give up after a lap."""
        contour = memory.contour
        run = graph.run_at(view.to_robot(*(contour.wall if contour is not None else memory.wall)))
        memory.followed = min(memory.followed, graph.goal_distance_of(run))
        place = self._reach(view, memory, graph, run)
        if place is not None:
            memory.destination, memory.way = view.to_odometry(*place), math.hypot(*place)
            memory.contour = None
            memory.mode = "leaving"
        elif contour is not None:
            advice = survey_lap(self.boundary, view, contour, memory.survey, memory.hit_distance)
            if advice == "leave":
                self.boundary.leave(view, memory)
                memory.mode = "leaving_straight"
            elif advice:
                memory.verdict = advice

    def _go_straight(self, view: View, memory: TangentBugMemory, graph: TangentGraph) -> Velocity | None:
        """Velocity toward the goal; None at the next wall, which it follows: a lap must lead nearer than the last one did."""
        velocity = self.boundary.go(view, view.goal_bearing, view.goal_distance)
        if velocity is None:
            nearest = memory.survey.distance  # it was left a little beside that point, and farther from the goal
            self._begin_following(view, memory, graph)
            memory.hit_distance = min(memory.hit_distance, nearest)
            self._lay_hand(view, memory, view.goal_bearing)
        return velocity

    def _reach(self, view: View, memory: TangentBugMemory, graph: TangentGraph, run: int) -> Point | None:
        """A place to leave for, nearer to the goal than the wall followed; robot's frame [m]."""
        if self.boundary.sees_goal(view, min(self.r_max, memory.trust)):
            place = view.goal
        else:
            distance, place = graph.nearest_to_goal(without=run, limit=memory.trust)
            if distance >= memory.followed - self.boundary.progress:
                return None
        direction = math.atan2(place[1], place[0]) + view.heading
        return place if self.boundary.may_head(memory.contour, direction) else None

    def _leave(self, view: View, memory: TangentBugMemory, graph: TangentGraph) -> Velocity | None:
        """Velocity to the place left for; None where it is near enough to the goal, or the way is blocked after all."""
        assert memory.destination is not None
        if view.goal_distance < memory.followed:
            memory.leaves.append(view.position)
            if view.goal_distance < memory.best:
                memory.trust = math.inf
            memory.side, memory.destination = 0, None
            memory.mode = "motion_to_goal"
            return None
        self._turn_aside(view, memory, graph)
        velocity = self._go_to(view, memory.destination)
        if velocity is None:
            bearing, _ = self._bearing_and_distance(view, memory.destination)
            self._lose_trust(view, memory)
            memory.mode = "boundary_following"
            self._begin_lap(memory)
            self._lay_hand(view, memory, bearing)
        return velocity

    def _lose_trust(self, view: View, memory: TangentBugMemory) -> None:
        """The scan promised more than there was: believe it half as far until a wall has been left."""
        memory.trust = 0.5 * min(memory.trust, self.r_max)
        memory.hit_distance = max(memory.hit_distance, view.goal_distance)

    def _turn_aside(self, view: View, memory: TangentBugMemory, graph: TangentGraph) -> None:
        """Choose another place that will do where a corner has come into the way, seen better from near."""
        assert memory.destination is not None
        bearing, distance = self._bearing_and_distance(view, memory.destination)
        if view.free_distance(bearing, self.boundary.inner) >= distance:
            return
        # Each new place is nearer than the last one was, so that this comes to an end.
        limit = min(memory.trust, memory.way - 0.25 * self.boundary.step)
        goal_distance, place = graph.nearest_to_goal(limit=limit)
        if goal_distance < memory.followed:
            memory.destination, memory.way = view.to_odometry(*place), math.hypot(*place)

    def draw(self, memory: TangentBugMemory) -> Drawing:
        """Hit and leave points, and where it goes."""
        drawing = super().draw(memory)
        if memory.destination is None or memory.contour is not None:
            return drawing
        return Drawing(points=[*drawing.points, (*memory.destination, "candidate")])
