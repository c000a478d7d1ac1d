"""What can be set of HD-BUG, and what it comes to on one robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from bug_gym.agents.parameters import Length, Weight, require_numbers
from bug_gym.spaces import require_one_of

Part = Literal[
    "",
    "path_list",
    "backtracking",
    "shadow",
    "candidates",
    "travel",
    "goal",
    "risk",
    "velocity_rule",
    "phase_1",
    "phase_2",
    "prediction",
    "spread",
    "radius_ladder",
]
"""What can be taken away from HD-BUG, one at a time."""


@dataclass(frozen=True)
class HDBugParameters:
    """Parameters of HD-BUG; the paper's values where it gives them."""

    predictor: str = "kalman"
    """How tracks are predicted: see `prediction.predictor_names()`."""
    clearance: Length | None = None
    """Centre to wall that it keeps [m]; None: the body's radius and one step, as the other bugs."""
    r_base: Length = 0.5
    """Base detection radius r [m], also the pace of the path list (eq. 6, Table 1)."""
    alpha: Weight = 1.0
    """Weight of the distances in the cost (eq. 8)."""
    beta: Weight = 0.5
    """Weight of the risk in the cost (eq. 8) [m]."""
    v_max: float = 1.0
    """Speed with a clear way, as a share of the robot's top speed (eq. 9)."""
    v_base: float = 0.5
    """Speed near an obstacle ahead, as a share of the top speed (Table 1: base 0.5, max 1.0)."""
    v_min: float = 0.25
    """Speed in a narrow passage, as a share of the top speed; the paper gives none."""
    hysteresis: Weight = 0.0
    """By which share of its cost, and by 0.3 m, another candidate must be better than the one that it heads for."""
    patience: Weight = 10.0
    """How far it goes by candidates without coming nearer to the goal, as a share of the way to it and 2 m (10: tenfold)."""
    horizon: Length = 3.0
    """How far ahead movers are predicted [s]."""
    margin: Length = 0.3
    """Passing a mover nearer than this starts the first phase of avoidance [m]."""
    lead: bool = True
    """Whether a moving goal is met where it will be; else the robot heads for where it is: pure pursuit."""
    without: Part = ""
    """A part that is taken away, to see what it is worth; "": none."""

    def __post_init__(self) -> None:
        require_one_of("without", self.without, get_args(Part))
        require_numbers(
            self,
            positive=("r_base", "v_max", "v_base", "v_min", "horizon", "margin", "patience"),
            not_negative=("alpha", "beta", "hysteresis"),
            shares=("v_max", "v_base", "v_min"),
        )
