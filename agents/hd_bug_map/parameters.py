"""What can be set of the map planner, and what it comes to on one robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from bug_gym.agents.parameters import AtMost, Length, Weight, require_numbers
from bug_gym.geometry import F64
from bug_gym.view import Sensors

LEAST_CELL = 0.01
"""The smallest side of a cell of the map [m]: smaller ones would take gigabytes, and a thinner robot keeps as much."""


@dataclass(frozen=True)
class HDBugMapParameters:
    """Parameters of the map planner; the HD-BUG paper's values where it gives them."""

    predictor: str = "kalman"
    """How tracks are predicted: see `prediction.predictor_names()`."""
    clearance: Length | None = None
    """Centre to wall that a way keeps [m]; None: the radius, a quarter of it, and twice the range noise."""
    r_base: Length = 0.5
    """Base detection radius r [m] (eq. 6, Table 1)."""
    alpha: Weight = 1.0
    """Weight of the distances in the cost (eq. 8)."""
    beta: Weight = 0.5
    """Weight of the risk in the cost (eq. 8)."""
    v_max: float = 1.0
    """Speed, as a share of the robot's top speed."""
    v_turning: float = 0.25
    """Speed of a long body where it has to turn, as a share of the top speed."""
    horizon: Length = 3.0
    """How far ahead movers are predicted [s]."""
    margin: Length = 0.3
    """Passing a mover nearer than this is risky [m]."""
    spread: Length = 0.08
    """How fast the predicted discs of movers grow [m/s]: they don't keep their course."""
    mover_turns: Weight = 1.0
    """How often a mover turns to wherever it likes in the futures that are looked at [1/s]; 0: never."""
    patience: Annotated[int, AtMost(1e6)] = 20
    """Decisions in a row without any way before the goal counts as unreachable."""
    lead: bool = True
    """Whether a moving goal is met where it will be; else the robot heads for where it is: pure pursuit."""
    adapt_radius: bool = True
    """Whether the detection radius adapts; else it is 4 r_base."""
    remember: bool = True
    """Whether anything is remembered; else the way is planned in the present scan alone."""

    def __post_init__(self) -> None:
        require_numbers(
            self,
            positive=("r_base", "alpha", "v_max", "v_turning", "horizon", "margin"),
            not_negative=("beta", "spread", "mover_turns"),
            shares=("v_max", "v_turning"),
        )
        if self.patience < 1:
            raise ValueError(f"patience must be at least 1, got {self.patience!r}")


@dataclass(frozen=True)
class Measures:
    """Lengths and speeds of one robot."""

    radius: float
    """Of the disc about the body [m]."""
    footprint: F64
    """The body as circles x, y, radius (F, 3) [m]."""
    clearance: float
    """Centre to wall that a way keeps [m]."""
    tight: float
    """The least clearance that a way is tried at [m]."""
    cell: float
    """Side of a cell of the map [m]."""
    top: float
    """Speed [m/s]."""
    slow: float
    """Speed of a long body where it has to turn [m/s]."""


def measures_of(sensors: Sensors, parameters: HDBugMapParameters) -> Measures:
    """The lengths and speeds that the parameters mean on a robot.

    Raises:
        ValueError: a clearance not above the radius.
    """
    radius, clearance = sensors.radius, parameters.clearance
    kept = 1.25 * radius + 2.0 * sensors.range_noise if clearance is None else clearance
    if not kept > radius:
        raise ValueError(f"clearance must be above the robot's radius of {radius:g} m, got {clearance!r}")
    # Nowhere larger than what ways keep: a point in a corner of a cell would not block it, and walls would have holes.
    cell = min(max(radius / 2.0, 0.05), max(radius, LEAST_CELL), 0.4)
    tight = max(radius + 0.1 * (kept - radius), cell)
    return Measures(
        radius=radius,
        footprint=np.array(sensors.footprint, dtype=np.float64).reshape(-1, 3),
        clearance=max(kept, tight),
        tight=tight,
        cell=cell,
        top=parameters.v_max * sensors.drive.max_speed,
        slow=parameters.v_turning * sensors.drive.max_speed,
    )
