"""HD-BUG aims: at the goal, or at where a moving one can be met ("predictive interception")."""

from __future__ import annotations

import math

from bug_gym.agents.hd_bug.memory import HDBugMemory
from bug_gym.agents.hd_bug.moving_goal import LEADS, meeting_time
from bug_gym.view import View

GOAL_STANDS = 0.02
"""A goal slower than this stands [m/s]."""


def aim(view: View, memory: HDBugMemory, top: float, *, leads: bool) -> None:
    """Set where to: the goal, or where a moving one can be met whose velocity has foretold its way.

    Args:
        view: what the robot sees now.
        memory: its goal is set.
        top: speed of the robot [m/s].
        leads: whether a moving goal is led.
    """
    goal = view.goal_position
    memory.goal = goal
    memory.moving_goal.update(goal, view.sensors.drive.step)
    vx, vy = memory.moving_goal.velocity
    if not leads or math.hypot(vx, vy) < GOAL_STANDS:
        return
    met = meeting_time(view.position, goal, (vx, vy), top, 0.5 * max(view.sensors.goal_radius, 1e-3))
    trusted = memory.moving_goal.trusted_lead()
    if trusted < LEADS[0]:
        return  # it goes to and fro; or it stands, and what moves is the frame, as odometry drifts
    lead = min(met, trusted)
    memory.goal = goal[0] + vx * lead, goal[1] + vy * lead
