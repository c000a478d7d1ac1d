"""Com1-Rev3: one robot drives by Com1, its partner by Rev3, until one of them is known to arrive first.

Source: Oni and Wang, "Improved Bug Algorithms for Robot Navigation in Unknown Environments", sections 3.2 and 3.3,
figure 3; laws as in `bugs/com1.py` and `bugs/rev3.py`. Sensing assumed: as theirs, and where partners are (`peers`).
Told: place by odometry, velocity, distance to the goal, state, and what is seen behind the own body. Memory kept: that of
each law, and the trace of the own way. States: those of the laws, hold, waiting, making_room, following, stopped. Guarantee:
some robot reaches the goal, or Com1, which is complete, declares it unreachable, where none has to go round a partner: that
may lead it back again, or through a gap behind which a lap proves nothing, and who would go round one from one place for the
third time is "looping". Length: the winner's is the shorter of the two laws' ways, or near it; the sum at most twice that.

*Stop rule.* A robot wins that (1) goes to the goal, (2) sees nothing between it and the goal, and (3) is nearer to it
than every partner; all as of one instant, and of equals the first. The partners stop. If its way turns out to be
blocked, or it falls silent on it, they go on. Robots that have goals of their own stop for nobody's arrival, and give up
each for itself.

*Collision control.* The paper has Rev3 stop below 1.5 m and go on at 2 m "to allow the Com1 robot to pass", and
presupposes the room for it. Where there is none the robots here make it: a robot waits whose next step would bring it
within a hand's breadth of another, and the partner in its way moves along its own way, on or back, whichever leads
away; where neither does it steps aside, and who is in its way makes room in turn. So Com1 drives the curve that it
drives alone, at other times. What waits longer than 10 s goes round its partner as round an obstacle (the paper's own
rule), and says so: `detoured`. In a pocket it would meet the same partner again in each lap; so one that Com1 has gone
round comes after it until it leaves the boundary, and from the second time on for good.

With more than two robots half drive by Com1 and half by Rev3, of either half the turns alternate (section 5); a robot
holds for all that come before it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.bugs.com1 import Com1
from bug_gym.agents.bugs.rev3 import Rev3
from bug_gym.agents.parameters import Length
from bug_gym.agents.teams.bug_team import PATIENCE, BugTeam, BugTeamMemory, distances
from bug_gym.agents.teams.partners import (
    ROOM,
    closes,
    distance_to_segment,
    farthest_blocker,
    least_gap,
    nearer_than,
    now_of,
    place_after,
)
from bug_gym.agents.walls.boundary import LeaveRule
from bug_gym.agents.walls.contour import BugMemory
from bug_gym.geometry import Point, velocity_along
from bug_gym.policy import STANDING, Velocity
from bug_gym.team_policy import TeamMemory
from bug_gym.view import Sensors, View

Sides = Literal["right_left", "left_right", "left", "right"]
PartnerRule = Literal["solo", "paper", "ghost"]

AHEAD = 1.0
"""How far along its own way a robot that makes room compares on and back [m]."""

HEADINGS = 16
"""How many headings a robot tries that steps aside."""

FOR_GOOD = 2
"""Who has been gone round so often follows as long as that one goes."""

NO_NEARER = 0.01
"""Who has come nearer by less, as a robot does that is held up by what stands beside its way, has not [m]."""

TURNS: dict[str, tuple[tuple[str, str], tuple[str, str]]] = {
    "right_left": (("right", "left"), ("left", "right")),
    "left_right": (("left", "right"), ("right", "left")),
    "left": (("left", "left"), ("left", "left")),
    "right": (("right", "right"), ("right", "right")),
}
"""First turns of the Com1 robots, in turn, and of the Rev3 robots."""


@dataclass
class Com1Rev3Memory(BugTeamMemory):
    """Memory of one robot of the team."""

    trace: list[Point] = field(default_factory=list)
    """Places where its law decided, odometry frame [m]."""
    at: int = 0
    """Number of the place of the trace where it stands; less than the last one after it has made room."""
    pending: Velocity | None = None
    """What its law wants while it waits, robot's frame [m/s]."""
    holding_for: set[int] = field(default_factory=set)
    """Robots that it has come too near to, and not yet far enough from."""
    waiting_for: set[int] = field(default_factory=set)
    """Robots that its next step would bring it too near to."""
    room: int = 0
    """+1 while it makes room on along its way, -1 back, 0 while it does not."""
    aside: list[Point] = field(default_factory=list)
    """Places that lead back to its way after it has stepped aside, the next one last, odometry frame [m]."""
    shut_out: float = 0.0
    """How long it has not come nearer to its way, back to which it is going [s]."""
    before: BugMemory | None = None
    """The memory of its law as it began to go round its partners."""
    came_within: float = math.inf
    """Nearer than this is nearer than it has come to the next place on that way [m]."""
    passing: set[int] = field(default_factory=set)
    """Robots that it goes round."""
    passing_since: int = 0
    """Number of the place of the trace from which on it does."""
    following: int | None = None
    """A robot that has gone round it, and whose way it goes until that leaves the boundary; after the second time for good."""
    gone_round: int = 0
    """How often it has begun to."""
    tail: int = 0
    """Number of the place of that one's trace that it goes to."""
    on_behalf: int = 0
    """The foremost robot for which it waits, or makes room."""


@dataclass(frozen=True)
class Com1Rev3Parameters:
    """Parameters of Com1-Rev3."""

    clearance: Length | None = None
    """Distance from a robot's centre to a wall while following it [m]; None: the body's radius and one step, or what a
    differential robot's brake needs if that is more."""
    leave_rule: LeaveRule = "front"
    """Where a free heading counts: "front" within 90 degrees of the direction of travel, "any" everywhere."""
    sides: Sides = "right_left"
    """First turns of Com1 and of Rev3: one each way, or both "left" (the paper's examples) or "right"."""
    hold_distance: Length | None = None
    """Distance to a robot that comes before it, below which a robot holds [m]; None: 1.5 m, or what large bodies need."""
    go_distance: Length | None = None
    """Distance from which on it goes on [m]; None: 2 m, or half a metre more than large bodies need."""
    partner_rule: PartnerRule = "solo"
    """What a robot that comes first does about one in its way: "solo" keeps its curve and waits for room, "paper" goes
    round it, "ghost" passes through it (for worlds in which robots have no bodies to one another)."""


class Decision(NamedTuple):
    """One decision of the team, in which the robots choose in turn."""

    team: Sequence[int]
    """Robots that answer, and have not given up; those that come before others first."""
    memories: Sequence[Com1Rev3Memory]
    """One a robot."""
    wanted: list[Velocity]
    """What each has chosen, robot's frame [m/s]; of those that have yet to choose STANDING."""
    near: Mapping[int, Mapping[int, float]]
    """For each of the team those near it, and how near they are [m]."""


class Com1Rev3(BugTeam):
    """Com1-Rev3.

    Raises:
        MisfitError: fewer than two robots.
        ValueError: a distance to hold at that is negative or beyond that to go on from; and what the laws refuse.
    """

    Parameters = Com1Rev3Parameters
    parameters: Com1Rev3Parameters
    wants_room = True

    def __init__(self, sensors: Sensors, *, agents: Sequence[str], discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, agents=agents, discrete=discrete, **parameters)
        own = self.parameters
        self.hold, self.go = distances(sensors, own.hold_distance, own.go_distance)
        self.leaders = (self.robots + 1) // 2
        """How many robots drive by Com1; they come first."""
        self.least_gap = least_gap(sensors)
        """How near to one another the robots' centres may come [m]."""
        self.sight = max(self.go, farthest_blocker(sensors))
        """How near to one another robots are to mind one another [m]."""
        turns = TURNS[own.sides]
        settings: dict[str, Any] = {"clearance": own.clearance, "leave_rule": own.leave_rule}
        self.laws = [
            Com1(sensors, turn=turns[0][robot % 2], **settings).driven_late()
            if robot < self.leaders
            else Rev3(sensors, turn=turns[1][(robot - self.leaders) % 2], **settings).driven_late()
            for robot in range(self.robots)
        ]

    def start(self, robots: int) -> tuple[Com1Rev3Memory, ...]:
        """Memories of a new episode."""
        owns = [law.start() for law in self.laws[:robots]]
        return tuple(Com1Rev3Memory(mode=own.mode, own=own) for own in owns)

    def act(self, views: Sequence[View | None], memories: Sequence[Com1Rev3Memory]) -> list[Velocity]:
        """One decision of all."""
        team = self.going(memories)
        self.check_winner(memories)
        seen = self.seen(team, memories)
        decision = Decision(team, memories, [STANDING] * len(memories), nearer_than(self.sight, team, memories))
        self._look_for_encounters(decision)
        for memory in memories:
            if memory.own.verdict:
                memory.mode = "stopped"
        for robot in team:
            self.watch(robot, memories[robot], seen[robot].still)
            decision.wanted[robot] = self._wanted(robot, seen[robot].view, decision)
        self.share_verdicts(memories, complete=self.leaders)
        self.look_for_winner(team, seen, memories)
        return self.off_partners(self.unless_stopped(decision.wanted, memories), memories)

    def last_word(
        self, views: Sequence[View | None], memories: Sequence[Any], actions: list[NDArray[Any]]
    ) -> list[NDArray[Any]]:
        """Those after which all can still stop without touching one another, unless they pass through one another."""
        return actions if self.parameters.partner_rule == "ghost" else super().last_word(views, memories, actions)

    # ------------------------------------------------------------------------------------------------ one robot

    def goes_round(self, robot: int, memory: BugTeamMemory) -> bool:
        """Whether partners are obstacles to a robot's law."""
        return memory.is_detouring or (self.parameters.partner_rule == "paper" and robot < self.leaders)

    def _wanted(
        self,
        robot: int,
        view: View,
        decision: Decision,
    ) -> Velocity:
        """The velocity of one robot; those that come before it have theirs."""
        memory = decision.memories[robot]
        if self.is_stopped(robot, decision.memories):
            memory.mode, memory.waiting_for = "stopped", set()
            return STANDING
        if memory.holding_for or self._asking(robot, decision):
            return self._hold(robot, view, decision)
        memory.room, memory.on_behalf = 0, robot
        velocity = self._go_on(robot, view, decision)
        blockers = self._blockers(robot, velocity, decision)
        memory.waiting_for = blockers
        if blockers:
            memory.pending, memory.mode = velocity, "waiting"
            memory.waited += self.sensors.drive.step
            if memory.is_detouring and memory.waited > 2.0 * PATIENCE:
                self._give_up_detour(robot, decision)  # nobody makes room for one that goes round: now they may again
            elif memory.waited > PATIENCE:
                if not memory.is_detouring:
                    before = kept(memory.own)
                    if self.begin_detour(robot, view, memory):
                        memory.before, memory.passing, memory.passing_since = before, blockers, len(memory.trace)
                memory.pending = None
            return STANDING
        memory.pending, memory.mode = None, memory.own.mode if memory.following is None else "following"
        return velocity

    def _go_on(self, robot: int, view: View, decision: Decision) -> Velocity:
        """What the law wants; first back to where it decided last, where the robot has made room since."""
        memory = decision.memories[robot]
        if memory.pending is not None:
            return memory.pending
        while memory.aside and math.dist(memory.aside[-1], view.position) < 0.3 * self.step:
            memory.aside.pop()
            memory.came_within = math.inf
        if memory.aside:
            gap = math.dist(memory.aside[-1], view.position)
            memory.shut_out = 0.0 if gap < memory.came_within else memory.shut_out + self.sensors.drive.step
            if memory.shut_out == 0.0:
                memory.came_within = gap - NO_NEARER
            if memory.shut_out <= PATIENCE:
                return self.laws[robot].boundary.step_to(view, memory.aside[-1]) or STANDING
            memory.aside.clear()  # what stands there stays, such as a partner that has arrived
            memory.shut_out, memory.came_within = 0.0, math.inf
        if memory.following is not None:
            if self._is_led(robot, decision):
                return self._follow(robot, view, memory, decision.memories[memory.following])
            memory.following, memory.shut_out = None, 0.0
        back = self._along_trace(robot, view, memory, 1) if memory.at < len(memory.trace) - 1 else None
        if back is not None:
            return back
        velocity = self.laws[robot].act(view, memory.own)
        if (contour := memory.own.contour) is not None:
            memory.squeezed |= any(self.is_at_body(contour.wall, memory, other) for other in decision.memories)
        if memory.is_detouring and memory.own.verdict:
            self._give_up_detour(robot, decision)
            return STANDING
        memory.trace.append(view.position)
        memory.at = len(memory.trace) - 1
        return velocity

    def _give_up_detour(self, robot: int, decision: Decision) -> None:
        """What a robot finds out while its partner is an obstacle to it proves nothing: it waits again."""
        memory = decision.memories[robot]
        memory.own.verdict = ""
        self._end_detour(memory)
        self._be_followed(robot, decision)
        memory.waited = 0.0
        if memory.own.contour is not None:
            memory.own.contour.waited = 0.0

    def _end_detour(self, memory: Com1Rev3Memory) -> None:
        """A boundary that it met while its partners were obstacles is none: they go on, and the hand would slip off them."""
        memory.is_detouring = False
        assert memory.before is not None
        before, contour = memory.before.contour, memory.own.contour
        if contour is None:
            return
        if before is contour:
            before.is_disturbed = True  # what lies behind the partner it has not gone along
            return
        if before is None:
            memory.own = memory.before
        memory.own.contour, memory.own.mode = None, "motion_to_goal"

    def _be_followed(self, robot: int, decision: Decision) -> None:
        """Have those that a robot has gone round come after it, if it is complete: it would meet them again each lap."""
        memory = decision.memories[robot]
        passed, memory.passing = memory.passing, set()
        if robot >= self.leaders or memory.has_own_goal:
            return
        for other in passed & set(decision.team):
            behind = decision.memories[other]
            if other > robot:
                places = memory.trace[memory.passing_since :]
                here = now_of(memory).frame.to_odometry(now_of(behind).place)
                nearest = min(range(len(places)), key=lambda number: math.dist(places[number], here), default=0)
                behind.following, behind.tail = robot, memory.passing_since + nearest
                behind.gone_round += 1
                behind.pending, behind.room, behind.shut_out = None, 0, 0.0
                behind.own = self.laws[other].start()

    def _is_led(self, robot: int, decision: Decision) -> bool:
        """Whether the robot that it follows goes along a boundary, or has only just left it, and nothing is in the way."""
        memory = decision.memories[robot]
        assert memory.following is not None
        first = decision.memories[memory.following]
        is_for_good = memory.gone_round >= FOR_GOOD
        has_left = (
            not is_for_good
            and first.own.contour is None
            and decision.near[robot].get(memory.following, math.inf) > self.go
        )
        goes = first.is_heard and not first.own.verdict and memory.winner is None
        return goes and not has_left and memory.shut_out <= PATIENCE

    def _follow(self, robot: int, view: View, memory: Com1Rev3Memory, first: Com1Rev3Memory) -> Velocity:
        """Velocity along the way of the robot that has gone round this one, but for those parts of it that lead back here."""
        theirs, ours = now_of(first).frame, now_of(memory).frame
        here = theirs.to_odometry(ours.to_team(view.position))
        gaps = [math.dist(place, here) for place in first.trace[memory.tail :]]
        near = [number for number, gap in enumerate(gaps) if gap < self.sensors.radius]
        if not near and memory.at < len(memory.trace) - 1:
            return self._along_trace(robot, view, memory, 1) or STANDING
        del memory.trace[memory.at + 1 :]
        if near:
            memory.tail += near[-1] + (gaps[near[-1]] < 0.3 * self.step)
        if memory.tail >= len(first.trace):
            return STANDING
        places = [ours.to_odometry(theirs.to_team(place)) for place in first.trace[memory.tail :]]
        boundary = self.laws[robot].boundary
        velocity = boundary.step_to(view, places[0])
        if velocity is None and (number := nearest_in_sight(view, places, boundary.safe_radius)) is not None:
            memory.tail += number
            velocity = boundary.step_to(view, places[number])
        memory.shut_out = memory.shut_out + self.sensors.drive.step if velocity is None else 0.0
        if velocity is not None:
            memory.trace.append(view.position)
            memory.at = len(memory.trace) - 1
        return velocity or STANDING

    def _along_trace(self, robot: int, view: View, memory: Com1Rev3Memory, direction: int) -> Velocity | None:
        """Velocity to the next place of the trace, on (+1) or back (-1); None at its end, or where something stands."""
        end = max(len(memory.trace) - 1, 0) if direction > 0 else 0
        while memory.at != end and math.dist(memory.trace[memory.at + direction], view.position) < 0.3 * self.step:
            memory.at += direction
        if memory.at == end:
            return None
        return self.laws[robot].boundary.step_to(view, memory.trace[memory.at + direction])

    # ---------------------------------------------------------------------------------------------- encounters

    def _look_for_encounters(self, decision: Decision) -> None:
        """Who holds for whom: from below the one distance on until the other is reached; for no one after a win."""
        for robot in decision.team:
            memory, near = decision.memories[robot], decision.near[robot]
            gaps = {other: distance for other, distance in near.items() if distance < self.go} if near else near
            held = memory.holding_for
            if not gaps:
                memory.waited = 0.0
                if memory.is_detouring:
                    self._end_detour(memory)
                    self._be_followed(robot, decision)
                held.clear()
                continue
            held.intersection_update(gaps)
            if memory.winner is not None:
                held.clear()
                continue
            was_held = bool(held)
            for other, distance in gaps.items():
                if other < robot and distance < self.hold:
                    held.add(other)
            memory.holds += bool(held) and not was_held
            memory.held += self.sensors.drive.step if held else 0.0

    def _blockers(
        self,
        robot: int,
        velocity: Velocity,
        decision: Decision,
    ) -> set[int]:
        """Robots that a step at a velocity would bring a robot too near to."""
        near = decision.near[robot]
        if not near or self.parameters.partner_rule == "ghost" or velocity == STANDING:
            return set()
        memories, wanted = decision.memories, decision.wanted
        memory, least = memories[robot], self.least_gap
        if self.goes_round(robot, memory):
            least -= 0.8 * ROOM
        blockers = set()
        for other, now in near.items():
            if closes(memory, velocity, memories[other], wanted[other], now, least):
                blockers.add(other)
        return blockers

    def _asking(self, robot: int, decision: Decision) -> list[int]:
        """Robots that wait for this one, for themselves or for another one that comes before it; the foremost first."""
        memories = decision.memories
        asking: list[int] = []
        for other in decision.team:
            memory = memories[other]
            if memory.waiting_for and robot in memory.waiting_for and memory.on_behalf < robot and other != robot:
                asking.append(other)
        return sorted(asking, key=lambda other: memories[other].on_behalf) if len(asking) > 1 else asking

    def _hold(
        self,
        robot: int,
        view: View,
        decision: Decision,
    ) -> Velocity:
        """Stand, or make room for a robot that waits: on along the own way, back, or aside."""
        memories, memory = decision.memories, decision.memories[robot]
        memory.waiting_for, memory.mode, memory.on_behalf = set(), "hold", robot
        asking = self._asking(robot, decision)
        going_round = (memories[other] for other in decision.team if memories[other].is_detouring)
        if self.parameters.partner_rule != "solo" or any(not one.holding_for for one in going_round):
            memory.room = 0
            return STANDING
        if asking:
            memory.on_behalf = memories[asking[0]].on_behalf
            memory.room = memory.room or self._better_way(memory, view, memories[asking[0]])
        if memory.room == 0:
            return STANDING
        for direction in (memory.room, -memory.room) if not memory.aside else ():
            velocity = self._make_room(robot, view, decision, direction)
            if velocity is not None and self._has_room(robot, velocity, decision):
                memory.room, memory.mode, memory.pending = direction, "making_room", None
                return velocity
        return self._step_aside(robot, view, asking, decision) if asking else STANDING

    def _has_room(
        self,
        robot: int,
        velocity: Velocity,
        decision: Decision,
    ) -> bool:
        """Whether a robot that makes room can take a step; who is in its way is asked for room in turn."""
        blockers = self._blockers(robot, velocity, decision)
        decision.memories[robot].waiting_for |= blockers
        return not blockers

    def _make_room(self, robot: int, view: View, decision: Decision, direction: int) -> Velocity | None:
        """Velocity on or back along the own way; None at the start of the trace."""
        memory = decision.memories[robot]
        if direction < 0:
            return self._along_trace(robot, view, memory, -1)
        velocity = self._go_on(robot, view, decision)
        if memory.following is not None:
            return None if velocity == STANDING else velocity
        memory.pending = velocity  # the law has decided for this place, whether the step is taken or not
        return None if memory.own.verdict or velocity == STANDING else velocity

    def _step_aside(
        self,
        robot: int,
        view: View,
        asking: Sequence[int],
        decision: Decision,
    ) -> Velocity:
        """Leave the own way for as long as a robot asks, to where the asking one's way leads least near."""
        memory, other = decision.memories[robot], decision.memories[asking[0]]
        speed = self.sensors.drive.max_speed
        safe = self.laws[robot].boundary.safe_radius
        begin, end = now_of(other).place, place_after(other, other.pending or STANDING)
        ahead = AHEAD / max(math.dist(begin, end), 1e-9)
        end = (begin[0] + ahead * (end[0] - begin[0]), begin[1] + ahead * (end[1] - begin[1]))
        ways = []
        for number in range(HEADINGS):
            bearing = 2.0 * math.pi * number / HEADINGS
            after = place_after(memory, velocity_along(bearing, AHEAD / self.sensors.drive.step))
            ways.append((distance_to_segment(after, begin, end), bearing))
        for _, bearing in sorted(ways, reverse=True):
            velocity = velocity_along(bearing, speed)
            is_free = view.free_distance(bearing, safe) >= self.step
            if is_free and self._has_room(robot, velocity, decision):
                memory.aside.append(view.position)
                memory.came_within = math.inf
                memory.mode, memory.pending = "making_room", None
                return velocity
        return STANDING

    def _better_way(self, memory: Com1Rev3Memory, view: View, asking: TeamMemory) -> int:
        """+1 or -1: whether the gap to a robot that asks for room is larger after 1 m on, or back."""
        frame, place = now_of(memory).frame, now_of(asking).place
        gaps = [math.dist(frame.to_team(self._place_along(memory, view, direction)), place) for direction in (1, -1)]
        return 1 if gaps[0] >= gaps[1] else -1

    def _place_along(self, memory: Com1Rev3Memory, view: View, direction: int) -> Point:
        """About where the own way leads after AHEAD, odometry frame [m]; beyond its end straight on."""
        place, left, at = view.position, AHEAD, memory.at
        while 0 <= at + direction < len(memory.trace):
            at += direction
            length = math.dist(place, memory.trace[at])
            place, left = memory.trace[at], left - length
            if left <= 0.0:
                return place
        if direction < 0:
            return place
        contour = memory.own.contour
        heading = view.heading + view.goal_bearing
        if contour is not None and contour.heading is not None:
            heading = contour.heading
        x, y = velocity_along(heading, left)
        return place[0] + x, place[1] + y


def nearest_in_sight(view: View, places: Sequence[Point], radius: float) -> int | None:
    """Number of the nearest place (odometry frame) to which a disc of a radius [m] can go straight; None: to none."""
    there = np.array([view.to_robot(*place) for place in places])
    gaps, bearings = np.hypot(*there.T), np.arctan2(there[:, 1], there[:, 0])
    free = np.flatnonzero(view.free_distances(bearings, radius) >= gaps)
    return int(free[np.argmin(gaps[free])]) if len(free) else None


def kept(memory: BugMemory) -> BugMemory:
    """A law's memory as it is now, whatever becomes of its lists."""
    lists: dict[str, Any] = {
        one.name: list(value) for one in fields(memory) if isinstance(value := getattr(memory, one.name), list)
    }
    return replace(memory, **lists)
