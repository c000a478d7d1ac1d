"""Bug1 for two: go round an obstacle in both directions, meet behind it, leave it from the nearer nearest point.

Source: Kandathil, Mathew and Hiremath 2020, "Development and analysis of a novel obstacle avoidance strategy for a
multi-robot system inspired by the Bug-1 algorithm", as Oni and Wang describe it (sections 2 and 4.2) to compare theirs
with; law as in `bugs/bug1.py`. Sensing assumed: as Bug1's. Told: place by odometry, direction along the wall, nearest
point and the way back to it, what is seen behind the own body. Memory kept: Bug1's. States: those of Bug1, hold,
waiting, stopped. Guarantee: one reaches the goal, or both declare it unreachable, as Bug1. Length: of both on one
obstacle 2 s + P + 2 lambda + g, with s to the hit, P the perimeter, lambda from the meeting to the nearest point and g
from there.

*Meeting.* Both have followed the wall for a while, in opposite directions, are a hand's breadth apart with no wall
between, and have a hand on the same wall. They have walked half the perimeter each then, so the shorter way to the
nearest point is that on which it was found: its finder goes back, the partner behind it. From there the finder goes
on; where it sees the goal it goes alone (the stop rule of `bug_team`), else the partner follows 2 m behind.

One that has no partner on its obstacle walks a whole lap, as Bug1. Who is in the other's way waits, and after 10 s goes
round it as round an obstacle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from bug_gym.agents.bugs.bug1 import Bug1, Bug1Memory
from bug_gym.agents.parameters import Length
from bug_gym.agents.teams.bug_team import PATIENCE, SAME_DISTANCE, BugTeam, BugTeamMemory
from bug_gym.agents.teams.partners import ROOM, Seen, closes, gap, least_gap
from bug_gym.agents.walls.contour import CLOSER
from bug_gym.kinematics import TURN_IN_PLACE, speed_and_error
from bug_gym.policy import STANDING, MisfitError, Velocity
from bug_gym.view import Sensors, View

BEHIND = 2.0
"""How far behind the first robot the second one leaves an obstacle [m]."""

OPPOSITE = -0.5
"""Cosine between two directions of travel below which they are opposite."""

SIGHT = 0.05
"""Radius of the disc that must pass between two robots that meet [m]."""


@dataclass
class Bug1PairMemory(BugTeamMemory):
    """Memory of one robot of the pair."""

    own: Bug1Memory = field(default_factory=Bug1Memory)
    """Memory of its law."""
    pending: Velocity | None = None
    """What its law wants while it waits, robot's frame [m/s]."""
    is_behind: bool = False
    """Whether it follows its partner back to the nearest point, and from there."""
    meetings: int = 0
    """How often the two have met behind an obstacle."""


@dataclass(frozen=True)
class Bug1PairParameters:
    """Parameters of the pair."""

    clearance: Length | None = None
    """Distance from a robot's centre to a wall while following it [m]; None: the body's radius and one step, or what a
    differential robot's brake needs if that is more."""


class Bug1Pair(BugTeam):
    """Bug1 for two.

    Raises:
        MisfitError: another number of robots than two.
    """

    Parameters = Bug1PairParameters
    parameters: Bug1PairParameters
    wants_room = True
    may_part = False

    def __init__(self, sensors: Sensors, *, agents: Sequence[str], discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, agents=agents, discrete=discrete, **parameters)
        if self.robots != 2:
            raise MisfitError(f"Bug1Pair drives 2 robots, the scenario has {self.robots}")
        self.by_side = {
            side: Bug1(sensors, clearance=self.parameters.clearance, turn=turn).driven_late()
            for side, turn in ((1, "left"), (-1, "right"))
        }
        self.laws = [self.by_side[1], self.by_side[-1]]
        self.meeting_gap = least_gap(sensors) + 2.0 * self.step
        """How near to one another the two meet [m]."""

    def start(self, robots: int) -> tuple[Bug1PairMemory, ...]:
        """Memories of a new episode."""
        return tuple(Bug1PairMemory(mode="motion_to_goal", own=self.by_side[1].start()) for _ in range(robots))

    def act(self, views: Sequence[View | None], memories: Sequence[Bug1PairMemory]) -> list[Velocity]:
        """One decision of both."""
        team = self.going(memories)
        self.check_winner(memories)
        seen = self.seen(team, memories)
        if len(team) == 2 and self._meet(seen[0], *memories):
            self._compare(*memories)
        wanted = [STANDING] * len(memories)
        for robot in sorted(team, key=lambda robot: memories[robot].is_behind):
            self.watch(robot, memories[robot], seen[robot].still)
            wanted[robot] = self._wanted(robot, seen[robot].view, team, memories, wanted)
        self.share_verdicts(memories, complete=len(memories))
        self.look_for_winner(team, seen, memories)
        return self.unless_stopped(wanted, memories)

    def _wanted(
        self,
        robot: int,
        view: View,
        team: Sequence[int],
        memories: Sequence[Bug1PairMemory],
        wanted: Sequence[Velocity],
    ) -> Velocity:
        """The velocity of one robot."""
        memory, other = memories[robot], memories[1 - robot]
        if self.is_stopped(robot, memories):
            return STANDING
        distance = gap(memory, other) if len(team) == 2 else math.inf
        stands_there = not other.is_heard and other.word is not None
        if (gap(memory, other) if stands_there else distance) >= BEHIND:
            memory.waited, memory.is_detouring = 0.0, False
        if memory.is_behind and memory.own.contour is None:
            if distance < BEHIND:
                memory.mode = "hold"
                memory.holds += memory.held == 0.0
                memory.held += self.sensors.drive.step
                return STANDING
            memory.is_behind = False
        if memory.pending is None:
            memory.pending = self._law(robot, team, memories).act(view, memory.own)
            self._forget_detour(memory)
        if (distance < math.inf or stands_there) and self._is_in_the_way(memory, other, wanted[1 - robot]):
            memory.mode = "waiting"
            memory.waited += self.sensors.drive.step
            if memory.waited > PATIENCE:
                memory.is_detouring = memory.detoured = True
                memory.pending = None
            return STANDING
        velocity, memory.pending, memory.mode = memory.pending, None, memory.own.mode
        return velocity

    def _law(self, robot: int, team: Sequence[int], memories: Sequence[Bug1PairMemory]) -> Bug1:
        """Bug1 to a side: the partner's other one while that is at a wall, else the one that lies away from it."""
        memory, other = memories[robot], memories[1 - robot]
        if memory.own.contour is not None:
            return self.by_side[memory.own.contour.side]
        if len(team) < 2 or memory.word is None or other.word is None:
            return self.by_side[1 if robot == 0 else -1]
        if other.own.contour is not None:
            return self.by_side[-other.own.contour.side]
        (x, y), (ox, oy), (gx, gy) = memory.word.place, other.word.place, memory.word.goal
        left = (gx - x) * (y - oy) - (gy - y) * (x - ox)
        if abs(left) < SAME_DISTANCE:
            return self.by_side[1 if robot == 0 else -1]
        return self.by_side[1 if left > 0.0 else -1]

    def _is_in_the_way(self, memory: Bug1PairMemory, other: Bug1PairMemory, velocity: Velocity) -> bool:
        """Whether the next step of a robot would bring it too near to the other, which has a velocity already."""
        assert memory.pending is not None
        least = least_gap(self.sensors) - (0.8 * ROOM if memory.is_detouring else 0.0)
        if self.sensors.drive.kinematics != "holonomic" and abs(speed_and_error(velocity)[1]) > TURN_IN_PLACE:
            velocity = STANDING  # it has to turn first
        return closes(memory, memory.pending, other, velocity, gap(memory, other), least)

    def _forget_detour(self, memory: Bug1PairMemory) -> None:
        """What a robot finds out while its partner is an obstacle to it proves nothing."""
        if memory.is_detouring and memory.own.verdict:
            memory.own.verdict, memory.is_detouring, memory.waited = "", False, 0.0

    # --------------------------------------------------------------------------------------------- the meeting

    def _meet(self, seen: Seen, one: Bug1PairMemory, other: Bug1PairMemory) -> bool:
        """Whether the two meet behind an obstacle, as one of them sees it."""
        first, second = one.own.contour, other.own.contour
        if first is None or second is None or one.own.mode != other.own.mode or one.own.mode != "boundary_following":
            return False
        if first.side == second.side or first.heading is None or second.heading is None:
            return False
        boundary = self.laws[0].boundary
        if min(first.odometer, second.odometer) <= boundary.arming_length or gap(one, other) > self.meeting_gap:
            return False
        assert one.frame is not None and other.frame is not None and one.word is not None and other.word is not None
        turn = first.heading + one.frame.heading - second.heading - other.frame.heading
        walls = math.dist(one.frame.to_team(first.wall), other.frame.to_team(second.wall))
        if math.cos(turn) >= OPPOSITE or walls > self.meeting_gap + 2.0 * boundary.clearance:
            return False
        x, y = seen.view.to_robot(*one.frame.to_odometry(other.word.place))
        return seen.view.free_distance(math.atan2(y, x), SIGHT) >= math.hypot(x, y)

    def _compare(self, one: Bug1PairMemory, other: Bug1PairMemory) -> None:
        """Choose the nearer of the nearest points; its finder leads back to it, or there is no way."""
        one.meetings += 1
        other.meetings += 1
        found = [memory for memory in (one, other) if memory.own.closest is not None]
        if not found:
            return
        finder = min(found, key=lambda memory: memory.own.closest.distance if memory.own.closest else math.inf)
        if finder is other and one.own.closest is not None and other.own.closest is not None:
            is_equal = one.own.closest.distance <= other.own.closest.distance + SAME_DISTANCE
            finder = one if is_equal else other
        follower = other if finder is one else one
        closest = finder.own.closest
        assert closest is not None and finder.frame is not None and follower.frame is not None
        hit = min(one.own.hit_distance, other.own.hit_distance)
        if not closest.is_open or closest.distance >= hit - CLOSER * self.step:
            one.own.verdict = other.own.verdict = "unreachable"
            return
        finder.own.way_back = finder.own.trace[closest.index :]
        follower.own.way_back = [
            follower.frame.to_odometry(finder.frame.to_team(place)) for place in finder.own.way_back
        ]
        for memory in (finder, follower):
            memory.own.mode, memory.pending = "return_to_closest", None
            memory.is_behind = memory is follower
