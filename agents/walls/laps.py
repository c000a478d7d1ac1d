"""Laps round an obstacle: when one is closed, and when a robot goes round in circles.

A lap begins at a gate across the contour, once the robot goes along the wall, and is closed where that gate is passed
again after a full turn. A lap in which something moved proves nothing, and begins anew.
Where the way no longer leads through the gate, a younger one tells (`Contour.check`): after a full turn a lap begins there,
without one the robot goes round in vain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bug_gym.agents.walls.contour import TARGET_MOVED, BugMemory, Contour, Gate
from bug_gym.geometry import Point, wrap
from bug_gym.view import View

LONGEST_ALIGNING = 10
"""Steps after which a lap begins where the robot is, aligned with the wall or not."""

LONGEST_ROUNDING = 60
"""The same for a robot that rounds corners, which takes up the contour in an arc."""

WHIRLING = 3.0 * math.pi
"""Turning without a lap from which on a robot that rounds corners keeps to the contour exactly: it may whirl in a small room
past whose door its arcs lead; or be deep in a spiral, out of which it turns back [rad]."""

MOST_CROSSINGS = 2
"""How often a robot may pass its gate without a full turn before it is taken to go round in vain."""

WIDEST = 0.625
"""How wide what a closed curve holds can be at most, over its length: half of it, and of the gap that a gate leaves, which is a
quarter of the shortest lap."""

OFF_HEADING = math.radians(10.0)
"""How far the course of a robot that goes along a wall may differ from the wall's [rad]."""


def is_proof(contour: Contour) -> bool:
    """Whether the last step ended a lap that proves that there is no way.

    One that came by places where a bug would have left if less were asked (`Contour.way_out`) proves nothing yet: the robot
    goes round once more, and leaves there. Nor does one that does not part the robot from the goal: somewhere the hand took
    another wall, as where a gap is hardly one, and the bug loops where that goes on.
    """
    if not contour.is_lap_closed:
        return False
    if not shows_no_way(contour):
        contour.takes_less = True
        return False
    if contour.takes_less or contour.has_no_other or math.isinf(contour.way_out):
        return True
    contour.takes_less = True
    return False


def shows_no_way(contour: Contour) -> bool:
    """Whether a lap, just closed without a way found, parts the robot from the goal; else it is counted as vain."""
    if parts_from_goal(contour):
        return True
    contour.vain_laps += 1
    return False


def parts_from_goal(contour: Contour) -> bool:
    """Whether a closed lap has the goal on the side of the wall.

    It is a closed curve. Round an obstacle it turns toward the wall by a full turn, and the goal must lie within it; in a
    room it turns away from the wall, and the goal must lie outside. The robot has always been in a room that shuts it in:
    where it has been farther off than a lap of this length can hold, it came through a gap that it takes for none now.
    """
    assert contour.gate is not None
    farthest = max(math.dist(place, contour.gate.place) for place in (contour.hit, contour.been or contour.hit))
    return is_parting(
        turned=contour.side * (contour.turned - contour.gate.turned),
        wound=contour.wound - contour.gate.wound,
        length=contour.odometer - contour.gate.odometer,
        farthest=farthest,
    )


def is_parting(*, turned: float, wound: float, length: float, farthest: float) -> bool:
    """Whether a closed curve along walls parts the robot from the goal.

    Args:
        turned: how far it turns away from the wall [rad].
        wound: how far the bearing of the goal goes round on it [rad].
        length: of the curve [m].
        farthest: how far off it the robot has been [m].
    """
    is_shut_in, is_goal_within = turned > 0.0, abs(wound) > math.pi
    if is_shut_in and farthest > WIDEST * (length / max(round(turned / (2.0 * math.pi)), 1)):
        return False
    return is_goal_within != is_shut_in


def _bearing(place: Point, other: Point) -> float:
    """Direction from one place to another [rad]."""
    return math.atan2(other[1] - place[1], other[0] - place[0])


@dataclass(frozen=True)
class Laps:
    """How far a robot has come along boundaries, and whether it has been there before."""

    step: float
    """The way of one step [m]."""
    clearance: float
    """Distance to a wall while following it [m]."""
    touch: float
    """How much nearer than that still counts as on the contour [m]."""
    gate_half_width: float
    """Half the width of a gate, and how near to each other two hit points are one [m]."""
    arming_length: float
    """Way after which a gate may fire [m]."""
    goes_back: bool = False
    """Whether the robot turns in several moves, ahead and back: its heading tells of its turning then, not its way."""

    def advance(self, view: View, contour: Contour) -> None:
        """Odometer, turning and gate of a contour after the last step."""
        contour.is_lap_closed = False
        contour.before = contour.position
        length = math.dist(contour.position, view.position)
        if length < 1e-3 * self.step:
            return
        heading = math.atan2(view.position[1] - contour.position[1], view.position[0] - contour.position[0])
        if self.goes_back:
            heading = view.heading
        contour.heading_before = heading if contour.heading is None else contour.heading
        change = contour.sweep + wrap(heading - contour.heading_before - contour.sweep)
        contour.sweep, contour.asked, contour.asked_for = 0.0, None, 0
        contour.turned += change
        contour.odometer += length
        wound = contour.wound
        contour.wound += wrap(_bearing(view.position, contour.goal) - _bearing(contour.before, contour.goal))
        contour.position = view.position
        contour.heading = heading
        contour.steps += 1
        # Where the step began: the next lap may turn back in a dead end up to a step before where it ended.
        gate = Gate(contour.before, heading, contour.odometer - length, contour.turned, wound)
        if contour.gate is None:
            contour.aligned = contour.aligned + 1 if self._is_aligned(view, contour, change) else 0
            longest = LONGEST_ALIGNING if contour.foot is None else LONGEST_ROUNDING
            if contour.aligned > 2 or contour.steps > longest:
                contour.gate = gate
            return
        has_target_moved = math.dist(view.goal_position, contour.goal) > TARGET_MOVED
        is_closed = not has_target_moved and self.closes(contour, contour.gate)
        if has_target_moved or (is_closed and contour.is_disturbed):
            contour.goal = view.goal_position
            contour.gate, contour.check = gate, None
            contour.is_disturbed = False
            return
        contour.is_lap_closed = is_closed
        if not (is_closed or contour.is_disturbed) and any(self._crosses(contour, one) for one in self._gates(contour)):
            contour.crossings, contour.crossed = contour.crossings + 1, contour.odometer
            if contour.crossings > MOST_CROSSINGS:
                contour.vain_laps = max(contour.vain_laps, 2)
        if not is_closed and contour.check is not None and self.closes(contour, contour.check):
            contour.gate, contour.check = gate, None
            contour.lost_gates += 1
            return
        if is_closed:
            contour.check = None  # the next step sets it beyond the gate
        elif contour.check is None or contour.odometer > 2.0 * contour.check.odometer:
            contour.check = gate
        is_wound = abs(contour.turned - contour.gate.turned) > WHIRLING
        contour.is_exact = is_wound or contour.vain_laps + contour.crossings + contour.lost_gates > 0

    def _is_aligned(self, view: View, contour: Contour, change: float) -> bool:
        """Whether a robot whose course has just changed by an angle [rad] goes along the wall, as it will on each lap."""
        if contour.foot is not None and contour.heading is not None:
            x, y, heading = contour.foot
            is_near = math.dist(contour.position, (x, y)) <= 1.5 * self.step
            return is_near and abs(wrap(contour.heading - heading)) <= OFF_HEADING
        # In a wedge the hit point lies deeper than a lap will lead, and next to a corner the way comes from behind.
        is_on_contour = view.nearest()[0] >= self.clearance - self.touch
        return is_on_contour and contour.side * change <= OFF_HEADING

    def closes(self, contour: Contour, gate: Gate) -> bool:
        """Whether the last step passed a gate after a lap: far enough, in its direction, with a full turn made."""
        if abs(contour.turned - gate.turned) < math.pi:
            return False  # a corridor walked back, or a wall met on its other side: no lap
        return self._passes(contour, gate)

    def _crosses(self, contour: Contour, gate: Gate) -> bool:
        """Whether the last step passed a gate without a lap, and long since it did last."""
        if contour.odometer - contour.crossed <= self.arming_length or abs(contour.turned - gate.turned) >= math.pi:
            return False
        return self._passes(contour, gate)

    def _gates(self, contour: Contour) -> list[Gate]:
        """Where a way that crosses itself is seen: the lap's gate, and a younger one."""
        return [gate for gate in (contour.gate, contour.check) if gate is not None]

    def _passes(self, contour: Contour, gate: Gate) -> bool:
        """Whether the last step passed a gate in its direction, far enough from where it was placed."""
        if contour.odometer - gate.odometer <= self.arming_length:
            return False
        return gate.is_passed(contour.before, contour.position, self.gate_half_width, contour.heading_before)

    def is_looping(self, memory: BugMemory) -> bool:
        """Whether the last hit repeats earlier ones, side included: the third time at the same place."""
        *earlier, (place, side, odometer) = zip(memory.hits, memory.hit_sides, memory.hit_odometers, strict=True)
        matches = 0
        for other, other_side, other_odometer in earlier:
            is_same = other_side == side and math.dist(other, place) <= self.gate_half_width
            matches += is_same and odometer - other_odometer > self.arming_length
        return matches >= 2
