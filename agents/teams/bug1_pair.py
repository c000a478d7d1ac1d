"""Bug1 for two: go round an obstacle in both directions, meet behind it, leave it from the nearer nearest point.

Source: Kandathil, Mathew and Hiremath 2020, "Development and analysis of a novel obstacle avoidance strategy for a
multi-robot system inspired by the Bug-1 algorithm", as Oni and Wang describe it (sections 2 and 4.2) to compare theirs
with; law as in `bugs/bug1.py`. Sensing assumed: as Bug1's, and where the partner is (`peers`). Told: place by odometry,
direction along the wall, nearest point and the way back to it, what is seen behind the own body. Memory kept: Bug1's, and
where its half of the lap began. States: those of Bug1, hold, waiting, stopped. Guarantee: one reaches the goal, or both
declare it unreachable, as Bug1, where neither has to go round the other. Length: of both on one obstacle 2 s + P + 2 lambda +
g, with s to the hit, P the perimeter, lambda from the meeting to the nearest point and g from there; up to 2 s + 3 P
until they know that there is no way.

*Meeting.* Both have followed the wall for a while, in opposite directions, or each waits for the other round a
corner; they are a hand's breadth apart with no wall between, and have a hand on the same wall. They have walked half
the perimeter each then, so the shorter way to the nearest point is that on which it was found: its finder goes back,
the partner behind it. From there the finder goes on; where it sees the goal it goes alone (the stop rule of
`bug_team`), else the partner follows 2 m behind.

*Niches.* Where the nearest point lies in a niche the finder's next wall leads it back to its partner behind it. That goes
ahead then, and the finder follows when it is 4 m away: both walk whole laps in one direction, as Bug1.

*No way.* What lies between their hit points neither of them has walked: a door may be there. So the two halves prove
that there is no way only where the robots hit one wall a hand's breadth apart, with no gap between that one fits
through. Else both turn round where they meet, and go back and on with the other hand on the wall, until they meet again:
these halves have one beginning, and make a lap.

One that has no partner on its obstacle walks a whole lap, as Bug1. Who is in the other's way waits, and after 10 s goes
round it as round an obstacle. Where they are not 2 m apart 20 s later the one behind stands, for 20 s at most, until the
other is 4 m ahead, or of two that circle the second one. A lap on which a robot went round its partner proves nothing, nor does
one along a partner that has given up; who would for the third time from one place, or for the ninth in all, is "looping". Two
that have goals of their own drive by Bug1 each for itself: nearer than 2 m the second one stands, and the first goes round it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bug_gym.agents.bugs.bug1 import Bug1, Bug1Memory
from bug_gym.agents.parameters import Length
from bug_gym.agents.teams.bug_team import PATIENCE, SAME_DISTANCE, BugTeam, BugTeamMemory, distances
from bug_gym.agents.teams.partners import ROOM, Seen, are_linked, closes, gap, least_gap, now_of, points_told
from bug_gym.agents.walls.contour import CLOSER, Contour
from bug_gym.agents.walls.laps import is_parting
from bug_gym.geometry import Point, velocity_along
from bug_gym.kinematics import TURN_IN_PLACE, speed_and_error
from bug_gym.policy import STANDING, Velocity
from bug_gym.view import Sensors, View

AHEAD = 2.0
"""How many times as far as the second robot follows behind the first one that one must have come that goes round the same wall
before its partner, until that follows: where it comes out of a niche that is half as deep it meets it."""

OPPOSITE = -0.5
"""Cosine between two directions of travel below which they are opposite."""

LONG_WAY = 20.0
"""After so long of going round a partner that does not get away one of the two stands [s]."""

RETURNS = ("return_to_closest", "return_along_wall")
"""Modes of Bug1 on its way back to the nearest point."""

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
    """Whether it follows its partner back to the nearest point and from there, or lets it ahead along a wall."""
    meetings: int = 0
    """How often the two have met behind an obstacle."""
    lap: Contour | None = None
    """The boundary that its law follows."""
    hand: Point | None = None
    """Where its hand lay as that began, team's frame [m]."""
    detoured_for: float = 0.0
    """How long it has gone round its partner now [s]."""
    is_joined: bool = False
    """Whether its partner's half of the lap begins where its own does."""


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
    most_robots = 2
    wants_room = True
    most_detours = 8

    def __init__(self, sensors: Sensors, *, agents: Sequence[str], discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, agents=agents, discrete=discrete, **parameters)
        self.by_side = {
            side: Bug1(sensors, clearance=self.parameters.clearance, turn=turn).driven_late()
            for side, turn in ((1, "left"), (-1, "right"))
        }
        self.laws = [self.by_side[1], self.by_side[-1]]
        _, self.behind = distances(sensors)
        """How far behind the first robot the second one leaves an obstacle [m]."""
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
        if len(team) == 2 and not memories[0].has_own_goal:
            self._note_halves(seen, *memories)
            if self._meet(seen[0], *memories):
                self._compare(seen, *memories)
        wanted = [STANDING] * len(memories)
        for robot in sorted(team, key=lambda robot: memories[robot].is_behind):
            self.watch(robot, memories[robot], seen[robot].still)
            wanted[robot] = self._wanted(robot, seen[robot].view, team, memories, wanted)
        self.share_verdicts(memories, complete=len(memories))
        self.look_for_winner(team, seen, memories)
        return self.off_partners(self.unless_stopped(wanted, memories), memories)

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
        if (gap(memory, other) if stands_there else distance) >= self.behind:
            memory.is_detouring = False
            lets_ahead = memory.is_behind and memory.own.mode == "boundary_following"
            memory.waited = memory.waited if lets_ahead else 0.0  # it does so for 20 s at most
        memory.detoured_for = memory.detoured_for + self.sensors.drive.step if memory.is_detouring else 0.0
        if distance < self.behind and memory.detoured_for > LONG_WAY and not memory.has_own_goal:
            self._stop_circling(robot, memory, other)
        if memory.has_own_goal and distance < self.behind:
            if robot == 1:
                return self._hold(memory)
            memory.is_detouring = True
        if memory.is_behind and memory.own.mode not in RETURNS:
            memory.waited += self.sensors.drive.step
            if (
                distance < self.behind * (1.0 if memory.own.contour is None else AHEAD)
                and memory.waited <= 2.0 * PATIENCE
            ):
                return self._hold(memory)
            memory.is_behind = False  # the finder has gone, or does not get away
        if distance < self.behind and self._is_asked_back(memory, other):
            self._go_ahead(memory, other, view)
        if memory.pending is None:
            memory.pending = self._decide(robot, view, team, memories)
        if (distance < math.inf or stands_there) and self._is_in_the_way(memory, other, wanted[1 - robot]):
            memory.mode = "waiting"
            memory.waited += self.sensors.drive.step
            if memory.is_detouring and memory.waited > 2.0 * PATIENCE and not memory.has_own_goal:
                memory.is_detouring, memory.waited = False, 0.0  # there is no way round: it waits again
            elif memory.waited > PATIENCE:
                if not memory.is_detouring:
                    self.begin_detour(robot, view, memory)
                memory.pending = None
            return STANDING
        velocity, memory.pending, memory.mode = memory.pending, None, memory.own.mode
        return velocity

    def _decide(self, robot: int, view: View, team: Sequence[int], memories: Sequence[Bug1PairMemory]) -> Velocity:
        """What its law wants."""
        memory, other = memories[robot], memories[1 - robot]
        velocity = self._law(robot, team, memories).act(view, memory.own)
        self._forget_detour(memory)
        own = memory.own
        if own.contour is not None:
            own.contour.is_disturbed |= memory.is_detouring
            memory.squeezed |= self.is_at_body(own.contour.wall, memory, other)
        return velocity

    def _is_asked_back(self, memory: Bug1PairMemory, other: Bug1PairMemory) -> bool:
        """Whether a robot that follows its partner back to the nearest point is in its way: a wall leads that back."""
        contour = other.own.contour
        if not memory.is_behind or memory.own.mode != "return_to_closest" or memory.is_detouring:
            return False
        if contour is None or other.own.mode != "boundary_following":
            return False
        return other.mode == "waiting" if contour.heading is None else self._travels_toward(other, memory)

    def _stop_circling(self, robot: int, memory: Bug1PairMemory, other: Bug1PairMemory) -> None:
        """End a long detour: the one behind stands, the one ahead goes on; of two that circle the second stands."""
        is_one_way = self._go_one_way(memory, other)
        stands = self._travels_toward(memory, other) if is_one_way else robot == 1 and other.is_detouring
        if is_one_way or stands:
            memory.is_detouring, memory.waited, memory.is_behind = False, 0.0, stands
            other.is_behind = other.is_behind and not stands

    def _hold(self, memory: Bug1PairMemory) -> Velocity:
        """Stand while the partner is near."""
        memory.mode = "hold"
        memory.holds += memory.held == 0.0
        memory.held += self.sensors.drive.step
        return STANDING

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
        if memory.has_own_goal and memory.is_detouring and other.mode == "hold":
            return False  # it stays, and what is seen of it is nearer than a disc about a long body
        least = least_gap(self.sensors) - (0.8 * ROOM if memory.is_detouring else 0.0)
        if self.sensors.drive.kinematics != "holonomic" and abs(speed_and_error(velocity)[1]) > TURN_IN_PLACE:
            velocity = STANDING  # it has to turn first
        return closes(memory, memory.pending, other, velocity, gap(memory, other), least)

    def _forget_detour(self, memory: Bug1PairMemory) -> None:
        """What a robot finds out while its partner is an obstacle to it proves nothing."""
        if memory.is_detouring and memory.own.verdict:
            memory.own.verdict, memory.is_detouring, memory.waited = "", False, 0.0

    # --------------------------------------------------------------------------------------------- the meeting

    def _note_halves(self, seen: Mapping[int, Seen], one: Bug1PairMemory, other: Bug1PairMemory) -> None:
        """Note where halves of a lap begin, and whether both begin at one place of one wall."""
        is_new = False
        for memory in (one, other):
            contour = memory.own.contour
            if contour is not memory.lap:
                assert memory.frame is not None
                memory.lap, is_new = contour, True
                memory.hand = memory.frame.to_team(contour.wall) if contour is not None else None
        if is_new:
            one.is_joined = other.is_joined = self._begin_together(seen, one, other)

    def _begin_together(self, seen: Mapping[int, Seen], one: Bug1PairMemory, other: Bug1PairMemory) -> bool:
        """Whether the two, of which one has just met a wall, have met it at one place."""
        if one.lap is None or other.lap is None or one.lap.side == other.lap.side:
            return False
        assert one.frame is not None and other.frame is not None and one.hand is not None and other.hand is not None
        apart = math.dist(one.frame.to_team(one.lap.hit), other.frame.to_team(other.lap.hit))
        return apart <= self.meeting_gap and self._is_one_wall(one.hand, other.hand, seen, (one, other))

    def _is_one_wall(
        self, hand: Point, other_hand: Point, seen: Mapping[int, Seen], memories: Sequence[Bug1PairMemory]
    ) -> bool:
        """Whether the wall goes on from one hand to another, as both see it, without a gap that a robot fits through.

        The bodies of the two are no wall: who goes round its partner sees it, and may have its hand on it.
        """
        bodies, reach = np.array([now_of(memory).place for memory in memories]), self.see_through.reach
        if np.linalg.norm(np.array([hand, other_hand])[:, None] - bodies, axis=-1).min() <= reach:
            return False
        points = np.concatenate([points_told(memory, seen[robot].view) for robot, memory in enumerate(memories)])
        points = points[np.linalg.norm(points[:, None] - bodies, axis=-1).min(axis=-1) > reach]
        aside = 2.0 * self.laws[0].boundary.clearance
        return are_linked(hand, other_hand, points, link=2.0 * self.sensors.radius, aside=aside)

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
        here, there = now_of(one), now_of(other)
        walls = math.dist(here.frame.to_team(first.wall), there.frame.to_team(second.wall))
        do_meet = math.cos(_turn(one, other)) < OPPOSITE or self._face_at_a_corner(one, other)
        if not do_meet or walls > self.meeting_gap + 2.0 * boundary.clearance:
            return False
        x, y = seen.view.to_robot(*here.frame.to_odometry(there.place))
        return seen.view.free_distance(math.atan2(y, x), SIGHT) >= math.hypot(x, y)

    def _face_at_a_corner(self, one: Bug1PairMemory, other: Bug1PairMemory) -> bool:
        """Whether each of two robots that follow a wall waits for the other one, toward which it travels."""
        return all(
            memory.mode == "waiting" and not memory.is_detouring and self._travels_toward(memory, partner)
            for memory, partner in ((one, other), (other, one))
        )

    def _travels_toward(self, memory: Bug1PairMemory, other: Bug1PairMemory) -> bool:
        """Whether the wall that a robot follows leads it nearer to another one."""
        contour, here, (x, y) = memory.own.contour, now_of(memory), now_of(other).place
        assert contour is not None and contour.heading is not None
        cos, sin = velocity_along(contour.heading + here.frame.heading, 1.0)
        return cos * (x - here.place[0]) + sin * (y - here.place[1]) > 0.0

    def _go_one_way(self, one: Bug1PairMemory, other: Bug1PairMemory) -> bool:
        """Whether two that follow walls with the same hand go the same way: they have got past one another."""
        first, second = one.own.contour, other.own.contour
        if first is None or second is None or first.side != second.side:
            return False
        return first.heading is not None and second.heading is not None and math.cos(_turn(one, other)) > -OPPOSITE

    def _compare(self, seen: Mapping[int, Seen], one: Bug1PairMemory, other: Bug1PairMemory) -> None:
        """Choose the nearer of the nearest points; its finder leads back to it. Without one, look whether there is no way."""
        finder = self._finder(one, other)
        if finder is None:
            self._end_halves(seen, one, other)
            return
        one.meetings += 1
        other.meetings += 1
        follower = other if finder is one else one
        closest = finder.own.closest
        assert closest is not None and finder.frame is not None and follower.frame is not None
        finder.own.way_back = finder.own.trace[closest.index :]
        follower.own.way_back = [
            follower.frame.to_odometry(finder.frame.to_team(place)) for place in finder.own.way_back
        ]
        place = follower.frame.to_odometry(finder.frame.to_team(closest.place))
        follower.own.closest = replace(closest, place=place)  # its own may lie elsewhere, or it has none
        for memory in (finder, follower):
            memory.own.mode, memory.pending = "return_to_closest", None
            memory.is_behind = memory is follower

    def _finder(self, one: Bug1PairMemory, other: Bug1PairMemory) -> Bug1PairMemory | None:
        """Who has found the nearer nearest point, of equals the first; None where no way leads on from there.

        It is nearer to the goal than both hit points, and the way between them is not: it may be left for it even where
        nobody has walked that way.
        """
        near, nearer = one.own.closest, other.own.closest
        if near is None or (nearer is not None and nearer.distance < near.distance - SAME_DISTANCE):
            finder, closest = other, nearer
        else:
            finder, closest = one, near
        hit = min(one.own.hit_distance, other.own.hit_distance)
        if closest is None or not closest.is_open or closest.distance >= hit - CLOSER * self.step:
            return None
        return finder

    def _end_halves(self, seen: Mapping[int, Seen], one: Bug1PairMemory, other: Bug1PairMemory) -> None:
        """There is no way where the halves make a lap that parts the two from the goal; else they turn round."""
        half, other_half = one.own.contour, other.own.contour
        assert half is not None and other_half is not None and one.frame is not None and other.frame is not None
        hands = one.frame.to_team(half.wall), other.frame.to_team(other_half.wall)
        if not self._is_one_wall(*hands, seen, (one, other)):
            return
        one.meetings += 1
        other.meetings += 1
        is_lap = one.is_joined and not any(lap.is_disturbed or lap.lost_gates for lap in (half, other_half))
        if is_lap and part_from_goal(half, other_half):
            one.own.verdict = other.own.verdict = "unreachable"
            return
        for robot, memory in enumerate((one, other)):
            self._turn_round(memory, seen[robot].view, vain=is_lap)
            memory.is_joined = True

    def _turn_round(self, memory: Bug1PairMemory, view: View, *, vain: bool) -> None:
        """Begin a half of a lap with the other hand on the wall; `vain`: that which ends here was one that proves nothing."""
        before = memory.own.contour
        assert before is not None
        x, y = view.to_robot(*before.wall)
        self._lay_hand(memory, view, -before.side, math.atan2(y, x), vain=vain)

    def _go_ahead(self, memory: Bug1PairMemory, other: Bug1PairMemory, view: View) -> None:
        """Go along the wall before its partner, which has it behind itself and comes back: both walk whole laps, as Bug1."""
        assert other.own.contour is not None
        self._lay_hand(memory, view, other.own.contour.side, view.nearest()[1])
        own = memory.own
        own.mode, own.hit_distance = "boundary_following", min(own.hit_distance, other.own.hit_distance)
        memory.is_joined = other.is_joined = False
        memory.is_behind, other.is_behind = False, True

    def _lay_hand(self, memory: Bug1PairMemory, view: View, side: int, bearing: float, *, vain: bool = False) -> None:
        """Begin a lap, or half of one, with a hand on the wall at a bearing [rad]."""
        own, before = memory.own, memory.own.contour
        assert before is not None and memory.frame is not None
        contour = self.by_side[side].boundary.lay_hand(view, side, bearing)
        contour.been, contour.hit_distance = before.been, before.hit_distance
        contour.vain_laps = before.vain_laps + vain
        own.contour = memory.lap = contour
        own.gate, own.trace, own.closest, memory.pending = None, [], None, None
        memory.hand = memory.frame.to_team(contour.wall)


def _turn(one: Bug1PairMemory, other: Bug1PairMemory) -> float:
    """From the direction in which the other one goes along a wall to that in which the first one does [rad]."""
    first, second = one.own.contour, other.own.contour
    assert first is not None and first.heading is not None and second is not None and second.heading is not None
    return first.heading + now_of(one).frame.heading - second.heading - now_of(other).frame.heading


def part_from_goal(one: Contour, other: Contour) -> bool:
    """Whether two halves of a lap, walked in opposite directions, part the two from the goal."""
    return is_parting(
        turned=one.side * one.turned + other.side * other.turned,
        wound=one.wound - other.wound,
        length=one.odometer + other.odometer,
        farthest=max(math.dist(half.been or half.hit, half.hit) for half in (one, other)),
    )
