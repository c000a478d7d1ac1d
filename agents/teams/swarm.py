"""SwarmCom, SwarmBug1, SwarmBug2: robots that drive by one law each for itself, and stop when one of them has arrived.

Source: named by Oni and Wang (section 2) after Johansson and Markdahl, "Swarm Bug Algorithms for Path Generation in
Unknown Environments" (2023); here the plain baseline of teams: the robots take their first turns to either side, and
are obstacles to one another. Two that came near would follow each other's bodies for ever, so the later one stands
below 1.5 m and goes on at 2 m, as in `com1_rev3`, and the earlier one goes round it. Sensing assumed: as the law's, and
where partners are (`peers`). Told: place by odometry, so that a partner that comes by does not spoil a lap as other movers
do; that one has arrived. States: those of the law, hold, stopped. Guarantee: where the law is complete some robot arrives,
or calls the goal unreachable, unless they get in one another's way: one whose lap led round a partner that was to go on
proves nothing by it, and is "stuck". Length: each robot's that of the law.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Literal

from bug_gym.agents.bugs.bug0 import Bug0
from bug_gym.agents.bugs.bug1 import Bug1
from bug_gym.agents.bugs.bug2 import Bug2
from bug_gym.agents.parameters import Length
from bug_gym.agents.teams.bug_team import BugTeam, BugTeamMemory, distances
from bug_gym.agents.teams.partners import Seen, gap, now_of
from bug_gym.agents.walls.boundary_bug import BoundaryBug
from bug_gym.agents.walls.contour import Contour
from bug_gym.policy import STANDING, Velocity
from bug_gym.view import Sensors, View

HAND = 0.1
"""How far off a partner's body the hand may lie that is on it: its place is of the step before, and noisy [m]."""


@dataclass(frozen=True)
class SwarmParameters:
    """Parameters of swarms."""

    clearance: Length | None = None
    """Distance from a robot's centre to a wall while following it [m]; None: the body's radius and one step, or what a
    differential robot's brake needs if that is more."""
    first: Literal["right", "left"] = "right"
    """Turn of the first robot; the next one turns the other way, and so on."""
    hold_distance: Length | None = None
    """Distance to an earlier robot below which a robot stands [m]; None: 1.5 m, or what large bodies need."""
    go_distance: Length | None = None
    """Distance from which on it goes on [m]; None: 2 m, or half a metre more than large bodies need."""


@dataclass
class SwarmMemory(BugTeamMemory):
    """Memory of one robot of a swarm."""

    is_holding: bool = False
    """Whether it stands for an earlier one to pass."""
    lap: Contour | None = None
    """The boundary that its law follows."""
    went_round: bool = False
    """Whether its hand has been on a partner there that had not given up."""


class Swarm(BugTeam):
    """A swarm.

    Raises:
        MisfitError: fewer than two robots.
        ValueError: a distance to hold at that is negative or beyond that to go on from.
    """

    Parameters = SwarmParameters
    parameters: SwarmParameters
    law: ClassVar[type[BoundaryBug]]
    wants_room = True

    def __init__(self, sensors: Sensors, *, agents: Sequence[str], discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, agents=agents, discrete=discrete, **parameters)
        self.hold, self.go = distances(sensors, self.parameters.hold_distance, self.parameters.go_distance)
        turns = ("right", "left") if self.parameters.first == "right" else ("left", "right")
        clearance = self.parameters.clearance
        laws = (self.law(sensors, clearance=clearance, turn=turns[robot % 2]) for robot in range(self.robots))
        self.laws = [law.driven_late() for law in laws]

    def start(self, robots: int) -> tuple[SwarmMemory, ...]:
        """Memories of a new episode."""
        owns = [law.start() for law in self.laws[:robots]]
        return tuple(SwarmMemory(mode=own.mode, own=own) for own in owns)

    def act(self, views: Sequence[View | None], memories: Sequence[SwarmMemory]) -> list[Velocity]:
        """One decision of all."""
        arrived = next((robot for robot, memory in enumerate(memories) if self.has_arrived(memory)), None)
        wanted = [STANDING] * len(memories)
        seen: dict[int, Seen] = {}
        for robot, (view, memory) in enumerate(zip(views, memories, strict=True)):
            memory.winner = None if memory.has_own_goal else arrived
            if view is None or self.is_stopped(robot, memories):
                memory.mode = "stopped"
                continue
            if self._holds(robot, memories):
                memory.mode = "hold"
                continue
            self.watch(robot, memory, partial(self._still, robot, memories, seen))
            self._note_partners(robot, memories)
            wanted[robot] = self.laws[robot].act(view, memory.own)
            if memory.own.verdict == "unreachable" and memory.went_round:
                memory.own.verdict = "stuck"
            memory.mode, memory.verdict = memory.own.mode, memory.own.verdict
            if memory.verdict:  # from now on it is in the way of those that come after it
                seen.clear()
        return wanted

    def _still(self, robot: int, memories: Sequence[SwarmMemory], seen: dict[int, Seen]) -> View:
        """What a robot sees without what its partners hide; keeps in `seen` what those see that come after it."""
        if robot not in seen:
            seen |= self.seen(range(robot, len(memories)), memories)
        return seen[robot].still()

    def _note_partners(self, robot: int, memories: Sequence[SwarmMemory]) -> None:
        """Note whether the hand of a robot's law lies on a partner that is still to go on."""
        memory = memories[robot]
        contour = memory.own.contour
        if contour is not memory.lap:
            memory.lap, memory.went_round = contour, False
        if contour is None or memory.went_round:
            return
        hand, near = now_of(memory).frame.to_team(contour.wall), self.sensors.radius + HAND
        partners = (memories[other] for other in self.going(memories) if other != robot)
        memory.went_round = any(math.dist(hand, now_of(partner).place) <= near for partner in partners)

    def _holds(self, robot: int, memories: Sequence[SwarmMemory]) -> bool:
        """Whether a robot stands for an earlier one that is near."""
        memory = memories[robot]
        earlier = [gap(memory, memories[other]) for other in self.going(memories) if other < robot]
        was_holding = memory.is_holding
        memory.is_holding = min(earlier, default=math.inf) < (self.go if was_holding else self.hold)
        memory.holds += memory.is_holding and not was_holding
        memory.held += self.sensors.drive.step if memory.is_holding else 0.0
        return memory.is_holding


class SwarmCom(Swarm):
    """Robots that drive by Com, which is Bug0."""

    law = Bug0


class SwarmBug1(Swarm):
    """Robots that drive by Bug1."""

    law = Bug1


class SwarmBug2(Swarm):
    """Robots that drive by Bug2."""

    law = Bug2
