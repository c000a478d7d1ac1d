"""Bug0, also called Com: go to the goal; at a wall turn one way and follow it until the way to the goal is free.

Source: Lumelsky and Stepanov (1986), there without a name; "Com" in Sankaranarayanan and Vidyasagar (1990).
Sensing assumed: contact (here the scan within the clearance), goal bearing. Memory kept: none beyond the boundary it is
on. States: motion_to_goal, boundary_following. Guarantee: none, it can cycle for ever; a full lap without any free
heading does prove that the goal is shut in. Length bound: none.
"""

from __future__ import annotations

from bug_gym.agents.walls.boundary_bug import BoundaryBug
from bug_gym.agents.walls.contour import BugMemory
from bug_gym.agents.walls.laps import is_proof
from bug_gym.policy import Velocity
from bug_gym.view import View


class Bug0(BoundaryBug):
    """Bug0 (Com); its parameters are those of BoundaryBug."""

    def start(self) -> BugMemory:
        """Memory of a new episode."""
        return BugMemory(mode="motion_to_goal")

    def act(self, view: View, memory: BugMemory) -> Velocity:
        """One decision."""
        boundary = self.boundary
        boundary.advance(view, memory)
        bearing = view.goal_bearing
        contour = memory.contour
        if contour is not None:
            if boundary.may_leave(view, contour, is_nearer=True):
                boundary.leave(view, memory)
                memory.mode = "motion_to_goal"
            elif is_proof(contour):
                memory.verdict = "unreachable"
        if memory.contour is None:
            velocity = boundary.go_until_hit(view, memory, self.side, bearing)
            if velocity is not None:
                return velocity
            boundary.hit(view, memory, self.side, bearing)
            memory.mode = "boundary_following"
            if boundary.laps.is_looping(memory):
                memory.verdict = "looping"
        return boundary.follow(view, memory)
