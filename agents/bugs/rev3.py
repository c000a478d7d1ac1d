"""Rev3: change sides at each hit; where one of the last two hits is met again, leave only nearer to the goal than both.

Source: Oni and Wang, "Improved Bug Algorithms for Robot Navigation in Unknown Environments", figure 2. Sensing assumed:
contact (here the scan within the clearance), goal, own position. Memory kept: the last hit point, the one before, and
which of them is nearer to the goal. States: motion_to_goal, boundary_following, follow_wall_to_better_take_off.
Guarantee: none proven; it can cycle over more than two hit points, and then calls itself looping. Length bound: none.

The paper calls the goal unreachable where the last hit point is met while looking for a better take-off; so does
`literal=True`. A hit point on another obstacle may be nearer to a goal that can be reached than anything on this one, so
else a lap on which the way was free somewhere only lowers the demand to the nearest such place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from bug_gym.agents.walls.boundary_bug import BoundaryBug, BoundaryParameters, alternating_side
from bug_gym.agents.walls.contour import BugMemory, Contour
from bug_gym.agents.walls.laps import is_proof
from bug_gym.agents.walls.marks import Mark, is_at, passes
from bug_gym.checks import shortened
from bug_gym.geometry import Point
from bug_gym.policy import Velocity
from bug_gym.view import Sensors, View

SAVED = ("two", "all")
BETTER = "follow_wall_to_better_take_off"


@dataclass
class Rev3Memory(BugMemory):
    """Memory of Rev3."""

    last_hit: Mark | None = None
    """Last hit point (the paper's LHP)."""
    hit_before: Mark | None = None
    """Hit point before the last (HPBL)."""
    marks: list[Mark] = field(default_factory=list)
    """All hit points; the paper's robot keeps none but the last two."""
    is_searching: bool = False
    """Whether it follows the wall to a better take-off."""
    is_repeating: bool = False
    """Whether the guard found the last hit point and its side among earlier ones."""
    nearest_free: Point | None = None
    """Of the places of this search nearer to the goal than the last hit point, where the way was free, the nearest."""
    is_lowered: bool = False
    """Whether a lap without a better take-off has lowered the demand to that place."""
    progress_hits: int = 0
    """How many hit points there were when it last left nearer to the goal than all of them: no cycle holds those."""


@dataclass(frozen=True)
class Rev3Parameters(BoundaryParameters):
    """Parameters of Rev3."""

    mspdg: Literal["two", "all"] = "two"
    """A better take-off is nearer to the goal than the last "two" hit points (the paper), or "all"."""
    early_stop: bool = False
    """Whether a lap without any free heading is enough to call the goal unreachable; the paper's robot walks a second
    one."""
    literal: bool = False
    """Whether a lap in search of a better take-off that ends without one is enough to call the goal unreachable, as the
    paper says, even where the way to the goal was free somewhere on it."""
    guard: bool = False
    """Whether a hit point met again with the same side, however long ago, starts the search for a take-off nearer to
    the goal than all hit points. The paper's robot has no such memory."""


class Rev3(BoundaryBug):
    """Rev3.

    Raises:
        TypeError: an unknown parameter.
        ValueError: an unknown mspdg; and what BoundaryBug refuses.
    """

    Parameters = Rev3Parameters
    parameters: Rev3Parameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        if self.parameters.mspdg not in SAVED:
            raise ValueError(f"mspdg must be one of {list(SAVED)}, got {shortened(self.parameters.mspdg)}")

    def start(self) -> Rev3Memory:
        """Memory of a new episode."""
        return Rev3Memory(mode="motion_to_goal")

    def act(self, view: View, memory: Rev3Memory) -> Velocity:
        """One decision."""
        boundary = self.boundary
        boundary.advance(view, memory)
        if memory.contour is not None:
            self._watch(view, memory, memory.contour)
        if memory.contour is None:
            velocity = boundary.go_until_hit(view, memory, alternating_side(memory, self.side), view.goal_bearing)
            if velocity is not None:
                memory.mode = "motion_to_goal"
                return velocity
            self._hit(view, memory)
        memory.mode = BETTER if memory.is_searching else "boundary_following"
        return boundary.follow(view, memory)

    def _hit(self, view: View, memory: Rev3Memory) -> None:
        """Save the hit point; one met again after free flight starts the search at once."""
        boundary = self.boundary
        side = alternating_side(memory, self.side)
        contour = boundary.hit(view, memory, side, view.goal_bearing)
        here = Mark(contour.hit, contour.wall)
        met = [is_at(boundary, mark, here.place, here.wall) for mark in memory.marks]
        same_side = zip(met, memory.hit_sides, strict=False)
        memory.is_repeating = self.parameters.guard and any(is_met and other == side for is_met, other in same_side)
        memory.is_searching = memory.is_repeating or any(met[-2:])
        memory.marks.append(here)
        memory.hit_before, memory.last_hit = memory.last_hit, here
        memory.nearest_free = None
        memory.is_lowered = False
        if self._is_looping(memory):
            memory.verdict = "looping"

    def _is_looping(self, memory: Rev3Memory) -> bool:
        """Whether the last two hit points, which decide all that follows, come in this order for the third time."""
        hits = list(zip(memory.hits, memory.hit_sides, strict=True))[memory.progress_hits :]
        repeats = sum(self._is_same(hits[k - 1 : k + 1], hits[-2:]) for k in range(1, len(hits) - 1))
        return repeats >= 2

    def _is_same(self, first: list[tuple[Point, int]], second: list[tuple[Point, int]]) -> bool:
        """Whether two sequences of hit points and sides are the same."""
        reach = self.boundary.gate_half_width
        return all(a[1] == b[1] and math.dist(a[0], b[0]) <= reach for a, b in zip(first, second, strict=True))

    def _watch(self, view: View, memory: Rev3Memory, contour: Contour) -> None:
        """Leave the boundary, begin to search, or give up, where the last step allows it or demands it."""
        boundary = self.boundary
        is_free = boundary.is_free(view, view.goal_bearing, view.goal_distance, contour)
        if is_free and (not memory.is_searching or view.goal_distance < self._demand(view, memory)):
            if memory.is_searching and not memory.is_lowered and self._compares_all(memory):
                memory.progress_hits = len(memory.hits)
            boundary.leave(view, memory)
            return
        if memory.is_searching and boundary.may_leave(
            view, contour, is_nearer=view.goal_distance < self._demand(view, memory)
        ):
            boundary.leave(view, memory)
            return
        if is_free:
            self._note_free(view, memory)
        if contour.is_lap_closed:
            self._close_lap(memory, contour)
        elif memory.hit_before is not None and passes(boundary, contour, memory.hit_before):
            memory.is_searching = True

    def _demand(self, view: View, memory: Rev3Memory) -> float:
        """How near to the goal a better take-off must be [m]."""
        goal, progress = view.goal_position, self.boundary.progress
        saved = memory.marks if self._compares_all(memory) else memory.marks[-2:]
        demand = min(math.dist(mark.place, goal) for mark in saved) - progress
        if memory.is_lowered and memory.nearest_free is not None:
            demand = max(demand, math.dist(memory.nearest_free, goal) + progress)
        return demand

    def _compares_all(self, memory: Rev3Memory) -> bool:
        """Whether the take-off must be nearer to the goal than all hit points, or than the last two."""
        return self.parameters.mspdg == "all" or memory.is_repeating

    def _note_free(self, view: View, memory: Rev3Memory) -> None:
        """Keep the place, if it is nearer to the goal than the last hit point and than the one kept."""
        assert memory.last_hit is not None
        best = memory.last_hit.place if memory.nearest_free is None else memory.nearest_free
        if view.goal_distance < math.dist(best, view.goal_position):
            memory.nearest_free = view.position

    def _close_lap(self, memory: Rev3Memory, contour: Contour) -> None:
        """The last hit point is met again."""
        if not memory.is_searching:
            memory.is_searching = True
            if self.parameters.early_stop:
                memory.verdict = "unreachable"
        elif self.parameters.literal:
            memory.verdict = "unreachable"
        elif memory.nearest_free is None:
            if is_proof(contour):
                memory.verdict = "unreachable"
        elif memory.is_lowered:
            memory.verdict = "looping"
        else:
            memory.is_lowered = True
