"""The task of the robots: reach the goal, touch nothing, in time. Names of reward terms and outcomes.

The arithmetic is compiled (kernels.step.judge); this is its vocabulary and what a scenario's weights mean.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bug_gym import kernels
from bug_gym.schema.task import Reward


def named_terms(progress: Any, goal: Any, collision: Any, step: Any, clearance: Any, smoothness: Any) -> dict[str, Any]:
    """Reward terms by name; their order here is the order in which the core writes them."""
    return {
        "progress": progress,
        "goal": goal,
        "collision": collision,
        "step": step,
        "clearance": clearance,
        "smoothness": smoothness,
    }


REWARD_TERMS = tuple(named_terms(*range(kernels.TERMS)))
"""Reward terms, in the order in which the core writes them. Each is weighted by the scenario's key of that name:

- progress: metres by which the distance to the goal has shrunk in this step.
- goal: 1 in the step that reaches the goal.
- collision: 1 in the step that touches something.
- step: 1 each step.
- clearance: 1 - clearance / CLEARANCE_SCALE where the body came nearer to an obstacle than that scale, else 0.
- smoothness: squared change of the action since the last step.
"""

CLEARANCE_SCALE = 0.5
"""Clearance [m] below which the reward's clearance term begins."""

OUTCOMES = ("running", "success", "collision", "timeout", "ended")
"""Outcome of a robot, by the core's code. Success and collision terminate; the time limit truncates, and so does, where
the first arrival is the mission, that of another robot ("ended"). That end is the mission's rule, but no state of the robot
whom it meets: what it observes does not tell it, and what it did has not brought it about. So its own task counts as cut
off, as by a clock, and learners bootstrap from its last observation. Who trains a team for the first arrival
alone, after which nothing is worth anything, takes `info["outcome"] == "ended"` for a termination."""

OUTCOME_NAMES = np.array(OUTCOMES, dtype=object)

assert OUTCOMES.index("success") == kernels.SUCCESS and OUTCOMES.index("timeout") == kernels.TIMEOUT
assert OUTCOMES.index("ended") == kernels.ENDED


def weights(reward: Reward) -> dict[str, float]:
    """The weight of each reward term."""
    return {name: float(getattr(reward, name)) for name in REWARD_TERMS}
