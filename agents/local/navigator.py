"""The velocity-obstacle navigator: among movers, the velocity nearest to a preferred one that leads to no contact.

Source: Sellers et al. 2026, section 5; Fiorini and Shiller 1998, "Motion Planning in Dynamic Environments Using
Velocity Obstacles". Reciprocal variants: van den Berg, Lin and Manocha 2008 (rvo); van den Berg, Guy, Lin and Manocha
2011 (orca), whose half planes are solved as those of the crowd are (bug_gym/kernels/avoidance.py).

Velocity obstacles know discs that move. What stands is kept off by what the scan shows: a velocity is admissible only
if the robot can stop before it meets a point of the scan, and meets no still one within a horizon of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.local.velocities import HEADINGS, ORCA, PLAIN, RECIPROCAL, Around, Robot, Wish, choose_velocity
from bug_gym.agents.parameters import AtMost, Length, require_numbers
from bug_gym.checks import shortened
from bug_gym.geometry import F64
from bug_gym.policy import Velocity, braking_radius
from bug_gym.view import Sensors, View

Avoidance = Literal["vo", "rvo", "orca"]
RULES: dict[str, int] = {"vo": PLAIN, "rvo": RECIPROCAL, "orca": ORCA}

ON_MOVER = 0.1
"""A point of the scan no farther outside a mover's disc than this is the mover's [m]."""
ROOM = 0.02
"""What is kept from still points: corners lie between the beams [m]."""
SWING = 0.1
"""How much larger a robot that has to turn first is taken to be, as it does not drive what it is told at once [m]."""


@dataclass(frozen=True)
class NavigatorParameters:
    """Parameters of the velocity-obstacle navigator."""

    avoidance: Avoidance = "vo"
    """"vo": movers go on as they do; "rvo", "orca": they do half of the avoiding, the latter with half planes."""
    horizon: Length = 3.0
    """tau: how far ahead contact with movers counts [s]."""
    still_horizon: Length = 1.0
    """How far ahead contact with what stands counts, beside the time to stop [s]."""
    mover_margin: Length = 0.2
    """What is kept from movers beside the bodies [m]; less where that leaves no velocity."""
    contact_weight: Annotated[float, AtMost(1e6)] = 1.0
    """Weight of 1 / time to contact where every velocity leads to one [m]."""
    steadiness: Annotated[float, AtMost(1.0)] = 0.4
    """Weight of a change of velocity, beside 1 of the distance to the preferred one; without, it may sway between the
    two sides of what comes straight toward it."""

    def __post_init__(self) -> None:
        if self.avoidance not in RULES:
            raise ValueError(f"avoidance must be one of {list(RULES)}, got {shortened(self.avoidance)}")
        if not 0.0 < self.horizon < math.inf:
            raise ValueError(f"horizon must be above 0 s, got {shortened(self.horizon)}")
        require_numbers(self, not_negative=("still_horizon", "mover_margin", "contact_weight", "steadiness"))


class Navigator:
    """Chooses velocities.

    Args:
        sensors: what a driver knows of the robot.
        parameters: horizons and margins.
    """

    def __init__(self, sensors: Sensors, parameters: NavigatorParameters) -> None:
        drive = sensors.drive
        swing = 0.0 if drive.kinematics == "holonomic" else SWING
        self.sensors = sensors
        self.robot = Robot(
            radius=braking_radius(sensors) + ROOM,
            body=sensors.radius,
            margin=parameters.mover_margin + swing,
            max_speed=drive.max_speed,
            step=drive.step,
            acceleration=drive.max_acceleration,
            horizon=parameters.horizon,
            still_horizon=parameters.still_horizon,
            weight=parameters.contact_weight,
            steadiness=parameters.steadiness,
            rule=RULES[parameters.avoidance],
            is_steered=drive.kinematics == "ackermann",
        )
        self._free = np.empty((HEADINGS, 2))

    def velocity(self, view: View, wish: Velocity, way: float, movers: F64, *, room: float = ROOM) -> Velocity:
        """The velocity to drive [m/s].

        Args:
            view: what is seen now.
            wish: preferred velocity in the robot's frame [m/s].
            way: how far it is to where the robot wants to be; what stands beyond does not matter [m].
            movers: (n, 5) x, y [m], vx, vy [m/s], radius [m] in the robot's frame.
            room: what is kept from still points beside the radius to brake with [m].
        """
        robot = self.robot._replace(radius=braking_radius(self.sensors) + room)
        x, y = view.points
        count = len(movers)
        around = Around(
            np.ascontiguousarray(x),
            np.ascontiguousarray(y),
            on_movers(x, y, movers),
            np.ascontiguousarray(movers, dtype=np.float64),
            self._free,
            np.empty(3 * count + 3),
            np.empty(3 * count + 3),
        )
        own = view.own_velocity
        speed, most = math.hypot(*wish), robot.max_speed
        if robot.is_steered:
            most = min(most, math.hypot(*own) + robot.acceleration * robot.step)
        share = min(1.0, most / speed) if speed > 0.0 else 0.0
        vx, vy, _ = choose_velocity(robot, around, Wish(share * wish[0], share * wish[1], way, *own))
        return vx, vy


def on_movers(x: F64, y: F64, movers: F64) -> F64:
    """1 for each point (k,) that lies on a mover of some (n, 5), else 0."""
    if len(movers) == 0 or len(x) == 0:
        return np.zeros(len(x))
    square = (x[:, None] - movers[:, 0]) ** 2 + (y[:, None] - movers[:, 1]) ** 2
    return np.asarray((square <= (movers[:, 4] + ON_MOVER) ** 2).any(axis=1), dtype=np.float64)


def in_robot_frame(view: View, position: F64, velocity: F64, radius: NDArray[np.float64]) -> F64:
    """Movers (n, 5) in the robot's frame, of places (n, 2) and velocities (n, 2) in the odometry frame."""
    cos, sin = math.cos(view.heading), math.sin(view.heading)
    turn = np.array([[cos, -sin], [sin, cos]])
    return np.column_stack([(position - view.position) @ turn, velocity @ turn, radius])
