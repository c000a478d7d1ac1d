"""HD-BUG aims: at the goal, or at where a moving one can be met ("predictive interception")."""

from __future__ import annotations

import math

from bug_gym.agents.hd_bug.moving_goal import meeting_time
from bug_gym.agents.hd_bug_map.memory import HDBugMapMemory
from bug_gym.agents.hd_bug_map.perceive import Scene

GOAL_STANDS = 0.02
"""A goal slower than this stands [m/s]."""

NEAR = 0.8
"""How near to a goal its way must lead, in its radius."""

HALF_CELL = math.sqrt(0.5)
"""Of the diagonal of a cell, in its side."""

LEADS_TRIED = 5
"""How often the lead is halved until nothing stands in the goal's way."""


def aim(scene: Scene, memory: HDBugMapMemory, top: float, *, leads: bool) -> None:
    """Set where to: the goal, or where a moving one can be met.

    Args:
        scene: what is seen and remembered.
        memory: its goal and goal radius are set.
        top: speed of the robot [m/s].
        leads: whether a moving goal is led.
    """
    view = scene.view
    step, radius = view.sensors.drive.step, max(view.sensors.goal_radius, 1e-3)
    goal = view.goal_position
    near = radius + HALF_CELL * scene.grid.cells.size if memory.is_goal_by_wall else NEAR * radius
    memory.goal, memory.goal_radius = goal, near
    memory.moving_goal.update(goal, step)
    velocity = memory.moving_goal.velocity
    if not leads or math.hypot(*velocity) < GOAL_STANDS:
        return
    met = meeting_time(view.position, goal, velocity, top, 0.5 * radius)
    lead = min(met, memory.moving_goal.trusted_lead())
    for _ in range(LEADS_TRIED):
        memory.goal = goal[0] + velocity[0] * lead, goal[1] + velocity[1] * lead
        if scene.grid.is_open(goal, memory.goal):
            break
        # It will have to turn before it gets there.
        lead *= 0.5
    memory.goal_radius = max(near, 2.0 * math.hypot(*velocity) * step)
