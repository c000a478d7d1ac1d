"""What teams of bugs share: their memories, what each robot's law gets to see, and the rule by which the others stop.

The stop rule is that of Oni and Wang, "Improved Bug Algorithms for Robot Navigation in Unknown Environments", section
3.2: a robot wins that goes to the goal, sees nothing between it and the goal, and is nearer to it than every partner.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.teams.hidden import ROUNDING
from bug_gym.agents.teams.partners import (
    ROOM,
    Seen,
    SeeThrough,
    away_from,
    closes,
    farthest_blocker,
    gap,
    least_gap,
    look_at_partners,
    now_of,
    way_asked,
    who_goes,
)
from bug_gym.agents.walls.boundary_bug import BoundaryBug
from bug_gym.agents.walls.contour import TARGET_MOVED, BugMemory
from bug_gym.geometry import Point, velocity_along
from bug_gym.kinematics import asked_velocity, steering
from bug_gym.policy import STANDING, Drawing, MisfitError, Velocity, braking_radius
from bug_gym.team_policy import TeamMemory, TeamPolicy
from bug_gym.view import Sensors, View

HOLD, GO = 1.5, 2.0
"""How near to one another robots hold, and from where on they go on (Oni and Wang, section 3.2) [m]."""

PATIENCE = 10.0
"""How long a robot waits in one encounter before it goes round its partner [s]."""

AT_ONE_PLACE = 2
"""How often it does so from one place at most: it has come back to where it was, and will again."""

SAME_DISTANCE = 1e-6
"""Distances to the goal that differ by less are equal [m]."""

SAME_PLACE = 1e-3
"""Rounding of an observed distance [m]."""

OWN_GOAL = 0.5
"""How far apart goals lie, as an episode begins, that are not one [m]."""

ARRIVING = 2.0
"""How many steps from its goal a robot that falls silent has arrived."""


def distances(sensors: Sensors, hold: float | None = None, go: float | None = None) -> tuple[float, float]:
    """Distances between centres [m] to hold at, and to go on from: those asked for, else the paper's.

    Robots that would touch one another by then, or in the next step, hold half a metre before they go on, too, but farther off.

    Raises:
        ValueError: one to hold at that is negative, or beyond that to go on from.
    """
    wider = max(least_gap(sensors) + 2.0 * sensors.step_length - HOLD, 0.0)
    hold, go = HOLD + wider if hold is None else hold, GO + wider if go is None else go
    if not 0.0 <= hold <= go:
        raise ValueError(f"hold_distance must be from 0 to go_distance ({go:g}), got {hold:g}")
    return hold, go


def is_between(view: View, radius: float) -> bool:
    """Whether what stands is nearer than a radius [m] on two sides, a third of a turn apart or more."""
    points = np.stack(view.points)
    away = np.hypot(*points)
    toward = points[:, away < radius] / np.maximum(away[away < radius], 1e-9)
    return bool((toward.T @ toward < -0.5).any())


@dataclass
class BugTeamMemory(TeamMemory):
    """Memory of one robot of a team of bugs."""

    own: Any = field(default_factory=BugMemory)
    """Memory of its law."""
    eyes: BugMemory = field(default_factory=BugMemory)
    """Glances at what moves that is no partner."""
    waited: float = 0.0
    """How long it has waited in this encounter [s]."""
    is_detouring: bool = False
    """Whether it goes round its partners as round obstacles."""
    detoured: bool = False
    """Whether it has ever."""
    squeezed: bool = False
    """Whether it has gone through a gap then that its law does not go into, or had its hand on a partner that has given up."""
    detours: list[Point] = field(default_factory=list)
    """Where it began to, on its way to this goal, odometry frame [m]."""
    detour_goal: Point | None = None
    """Where the goal was then, odometry frame [m]."""
    has_own_goal: bool = False
    """Whether the robots go to goals of their own, so that nobody's arrival is of use to another."""


class BugTeam(TeamPolicy):
    """A team of bugs that stop for the first of them that is known to arrive.

    Raises:
        MisfitError: discrete actions of robots with inertia; and what TeamPolicy refuses.
    """

    laws: Sequence[BoundaryBug]
    """Law of each robot."""
    most_detours: float = math.inf
    """How often one may begin to go round its partners on the way to one goal."""

    def __init__(self, sensors: Sensors, *, agents: Sequence[str], discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, agents=agents, discrete=discrete, **parameters)
        if discrete and sensors.drive.has_inertia:
            name = type(self).__name__
            raise MisfitError(
                f"{name} keeps robots that cannot stop at once apart by braking, which no discrete action does"
            )
        self.step = sensors.step_length
        self.goal_sight = sensors.range + sensors.goal_radius
        """How near a goal is that a scan may show to be free [m]."""
        self.see_through = SeeThrough(sensors, len(agents))
        self._braking_radius = braking_radius(sensors)
        self._is_braked = sensors.drive.kinematics == "differential" and not discrete

    def draw(self, memory: BugTeamMemory) -> Drawing:
        """What the robot's law shows."""
        return self.laws[0].draw(memory.own)

    def _checked(self, state: Any, rows: int) -> list[TeamMemory]:
        """The memories of a state.

        Raises:
            ValueError: memories of another team or policy, or of robots that drive by another law.
        """
        memories: list[Any] = super()._checked(state, rows)
        for number, memory in enumerate(memories):
            own, kind = memory.own, type(self.laws[number % self.robots].start())
            if type(own) is not kind:
                raise ValueError(f"got the memory of another law: {type(own).__name__}, expected {kind.__name__}")
        return memories

    def going(self, memories: Sequence[BugTeamMemory]) -> list[int]:
        """Robots that answer, and have not given up."""
        return [robot for robot, memory in enumerate(memories) if memory.is_heard and not memory.own.verdict]

    def listen(self, views: Sequence[View | None], memories: Sequence[Any]) -> None:
        """Let each robot tell where it is, and who is heard for the first time whether it seeks the goal of the others."""
        known = [memory for memory in memories if memory.word is not None]
        silent = [memory for memory in memories if memory.word is None]
        super().listen(views, memories)
        look_at_partners(memories)
        came = [memory for memory in silent if memory.word is not None]
        if not came or memories[0].has_own_goal:
            return
        # Of those who have told before, who answers now: as the two see their goals at one instant, drift is in both.
        goal = min(known or came, key=lambda memory: not memory.is_heard).word.goal
        if any(math.dist(memory.word.goal, goal) > OWN_GOAL for memory in came):
            for memory in memories:
                memory.has_own_goal, memory.winner = True, None

    # ------------------------------------------------------------------------------------------- what a law sees

    def goes_round(self, robot: int, memory: BugTeamMemory) -> bool:
        """Whether partners are obstacles to a robot's law."""
        return memory.is_detouring

    def seen(self, robots: Sequence[int], memories: Sequence[BugTeamMemory]) -> dict[int, Seen]:
        """What the laws of robots get to see: no bodies of partners that go on, but for one that goes round them."""
        answering: list[BugTeamMemory] = []
        heard, looks, partners = [], [], []
        for robot, memory in enumerate(memories):
            if memory.is_heard:
                heard.append(robot)
                answering.append(memory)
                looks.append(robot in robots and not self.goes_round(robot, memory))
                partners.append(not memory.own.verdict)
        if not heard:
            return {}
        seen = zip(heard, self.see_through.seen(answering, looks, partners), strict=True)
        return {robot: one for robot, one in seen if robot in robots}

    def watch(self, robot: int, memory: BugTeamMemory, still: Callable[[], View]) -> None:
        """Look for what moves in place of the law, which would take partners for it; it spoils the law's lap.

        Args:
            robot: which one looks.
            memory: its own.
            still: gives what it sees without what its partners hide, when it is time for a glance.
        """
        boundary, own = self.laws[robot].boundary, memory.own
        if memory.is_detouring and not memory.squeezed:
            memory.squeezed = is_between(still(), boundary.inner)
        if boundary.looks_now(memory.eyes) and boundary.has_moved(still(), memory.eyes) and own.contour is not None:
            own.contour.is_disturbed = True
        if not own.glances:  # the law's own glances are never due
            own.glances, own.glance_age = [still()], -math.inf

    def is_at_body(self, wall: Point, memory: BugTeamMemory, other: BugTeamMemory) -> bool:
        """Whether what a robot has its hand on, a place of its odometry frame [m], is the body of one that has given up."""
        if not other.own.verdict or other.word is None:
            return False
        assert memory.frame is not None
        return math.dist(memory.frame.to_team(wall), now_of(other).place) <= self.see_through.reach

    # -------------------------------------------------------------------------------- who is braked beside a partner

    def off_partners(self, wanted: Sequence[Velocity], memories: Sequence[BugTeamMemory]) -> list[Velocity]:
        """The velocities; of robots that would be braked to nothing for the body of a partner such that lead off it.

        Their laws do not see partners. They start so near to one another, none comes so near on its way.
        """
        chosen = list(wanted)
        if not self._is_braked:
            return chosen
        near = self._braking_radius + self.sensors.radius + ROUNDING
        for robot, (memory, wish) in enumerate(zip(memories, wanted, strict=True)):
            if wish == STANDING or memory.view is None or not memory.is_heard or memory.own.contour is not None:
                continue
            if memory.view.nearest()[0] <= self._braking_radius + ROUNDING and self._goes_nowhere(memory.view, wish):
                chosen[robot] = self._off(robot, wish, chosen, memories, near)
        return chosen

    def _goes_nowhere(self, view: View, velocity: Velocity) -> bool:
        """Whether a robot that heads for where it wants to is braked to nothing."""
        free = view.free_distance(math.atan2(velocity[1], velocity[0]), self._braking_radius)
        return free <= self._braking_radius - self.sensors.radius

    def _off(
        self, robot: int, wish: Velocity, chosen: Sequence[Velocity], memories: Sequence[BugTeamMemory], near: float
    ) -> Velocity:
        """A velocity straight off the partners that are near, where nothing stands in that way; else what a robot wishes."""
        memory = memories[robot]
        others = {k: other for k, other in enumerate(memories) if k != robot and other.word is not None}
        bearing = away_from(memory, list(others.values()), within=near)
        if bearing is None:
            return wish
        velocity = velocity_along(bearing, self.sensors.drive.max_speed)
        assert memory.view is not None
        if self._goes_nowhere(memory.view, velocity):
            return wish
        least = least_gap(self.sensors)
        is_shut = any(
            closes(memory, velocity, other, chosen[k], gap(memory, other), least) for k, other in others.items()
        )
        return wish if is_shut else velocity

    # ------------------------------------------------------------------------------------ who cannot stop at once

    def last_word(
        self, views: Sequence[View | None], memories: Sequence[Any], actions: list[NDArray[Any]]
    ) -> list[NDArray[Any]]:
        """Actions of robots with inertia after which all can still stop without touching one another.

        Each could before; so who may not go as it wishes brakes.
        """
        drive = self.sensors.drive
        heard = [robot for robot, view in enumerate(views) if view is not None]
        if not drive.has_inertia or len(heard) < 2:
            return actions
        # Straight on: who turns while it brakes, to get round what is before it, leaves the way that was foreseen.
        stops = [steering(drive, STANDING) for _ in views]
        ways = [
            [way_asked(memories[robot], asked_velocity(drive, each[robot])) for robot in heard]
            for each in (actions, stops)
        ]
        least = least_gap(self.sensors) - 0.8 * ROOM
        goes = who_goes(*ways, reach=farthest_blocker(self.sensors), least=least)
        sent = list(actions)
        for robot, does_go in zip(heard, goes, strict=True):
            if not does_go:
                sent[robot] = stops[robot]
        return sent

    # ------------------------------------------------------------------------------------------------- the end

    def is_stopped(self, robot: int, memories: Sequence[BugTeamMemory]) -> bool:
        """Whether a robot stands because another one will arrive first."""
        winner = memories[robot].winner
        return winner is not None and winner != robot

    def unless_stopped(self, wanted: Sequence[Velocity], memories: Sequence[BugTeamMemory]) -> list[Velocity]:
        """The velocities, of robots that have stopped none."""
        if memories[0].winner is None:  # as of all: they know it together
            return list(wanted)
        return [STANDING if self.is_stopped(robot, memories) else wish for robot, wish in enumerate(wanted)]

    def look_for_winner(self, team: Sequence[int], seen: Mapping[int, Seen], memories: Sequence[BugTeamMemory]) -> None:
        """The stop rule, of robots that seek one goal; a winner whose way turns out to be blocked wins no longer."""
        going = [robot for robot in team if not memories[robot].own.verdict]
        if not going or memories[going[0]].has_own_goal:
            return
        winner = memories[going[0]].winner
        if winner is None:
            winner = self._first_that_sees_goal(going, seen, memories)
            if winner is None:
                return
        elif winner in seen and memories[winner].own.contour is not None:
            winner = None
        for robot, memory in enumerate(memories):
            memory.winner = winner
            if winner is not None and robot != winner and not memory.verdict:
                memory.mode = "stopped"

    def _first_that_sees_goal(
        self, going: Sequence[int], seen: Mapping[int, Seen], memories: Sequence[BugTeamMemory]
    ) -> int | None:
        """Who is nearest to the goal and sees it free; of equals the first."""
        distances = [seen[robot].view.goal_distance for robot in going]
        nearest = min(distances)
        if nearest > self.goal_sight:
            return None
        first = (robot for robot, distance in zip(going, distances, strict=True) if distance <= nearest + SAME_DISTANCE)
        return next((robot for robot in first if self._sees_goal(robot, seen[robot], memories[robot])), None)

    def _sees_goal(self, robot: int, seen: Seen, memory: BugTeamMemory) -> bool:
        """Whether a robot goes to the goal, and sees it free."""
        view, distance = seen.view, seen.view.goal_distance
        if memory.own.contour is not None or distance > self.goal_sight:
            return False
        boundary, bearing = self.laws[robot].boundary, view.goal_bearing
        # It leaves a corner that it still has to pass, nearer than it follows walls but not nearer than `inner`. Where it has
        # passed it the way leads off the wall: no point ahead lies nearer to the way than the wall to the robot. Along a round
        # obstacle a fixed radius would still touch points ahead, for sqrt(2 m R) more at m less than that radius.
        passes = 0.5 * (boundary.clearance + boundary.inner)
        radius = min(max(view.nearest()[0], boundary.hit_radius), passes)
        is_free = view.free_distance(bearing, radius) >= distance
        return is_free or boundary.can_reach_goal(view, bearing, distance)

    def begin_detour(self, robot: int, view: View, memory: BugTeamMemory) -> bool:
        """Have a robot take partners for obstacles; who would at one place for the third time goes in circles behind them.

        So does who would more than `most_detours` times on the way to one goal.

        Returns:
            Whether it begins; else it is "looping".
        """
        if memory.detour_goal is None or math.dist(memory.detour_goal, view.goal_position) > TARGET_MOVED:
            memory.detour_goal, memory.detours = view.goal_position, []
        memory.detours.append(view.position)
        reach = self.laws[robot].boundary.gate_half_width
        again = sum(math.dist(place, view.position) <= reach for place in memory.detours) > AT_ONE_PLACE
        if again or len(memory.detours) > self.most_detours:
            memory.own.verdict = "looping"
            return False
        memory.is_detouring = memory.detoured = True
        return True

    def check_winner(self, memories: Sequence[BugTeamMemory]) -> None:
        """A winner that fell silent has arrived, or will not."""
        winner = memories[0].winner
        if winner is not None and not memories[winner].is_heard and not self.has_arrived(memories[winner]):
            for memory in memories:
                memory.winner = None

    def share_verdicts(self, memories: Sequence[BugTeamMemory], complete: int) -> None:
        """The mission ends where a complete robot proves that there is no way, or where no robot has one left.

        A robot that goes to a goal of its own gives up alone. Going round a partner one gets through gaps that it would not
        go into by itself; a lap in there proves nothing of what lies outside.

        Args:
            memories: one a robot.
            complete: how many robots' laws are complete; they come first.
        """
        if not any(memory.own.verdict for memory in memories):
            return
        for memory in memories:
            if memory.squeezed and memory.own.verdict == "unreachable":
                memory.own.verdict = "looping"
        heard = [memory for memory in memories if memory.is_heard]
        proven = any(memory.own.verdict == "unreachable" for memory in memories[:complete] if memory.is_heard)
        has_own, nobody_goes = memories[0].has_own_goal, all(memory.own.verdict for memory in heard)
        for memory in heard:
            if has_own or proven or nobody_goes:
                memory.verdict = "unreachable" if proven and not has_own else memory.own.verdict

    def has_arrived(self, memory: TeamMemory) -> bool:
        """Whether a robot is at its goal, or was about to be when it was heard last."""
        within = self.sensors.goal_radius + (SAME_PLACE if memory.is_heard else ARRIVING * self.step)
        return memory.word is not None and memory.word.goal_distance <= within
