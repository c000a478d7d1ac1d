"""A Simulation of what a robot has seen, to try plans in: discs where scans met something still, movers on straight ways.

It stands in the robot's frame of now: the robot at the origin, looking along x. Its steps are coarser than the robot's, as a
plan need not be finer than what is known.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from bug_gym import kernels
from bug_gym.geometry import F64
from bug_gym.schema.motions import Waypoints
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View
from bug_gym.worlds.layout import Layout, Mover

EDGE = 1000.0
"""Half the side of the world [m]: nothing comes near its border."""
TOUCHING = 1e-3
"""What is left between the body and a disc that would overlap it [m]."""
SLOWEST = 1e-3
"""What moves no faster than this stands [m/s]."""


class Worth(NamedTuple):
    """What makes a way dear."""

    keep: float
    """A clearance below this costs [m]."""
    clearance: float
    """A second at clearance 0 costs as much as being so much farther from the goal [m]."""
    contact: float
    """Each second of the horizon after a contact costs as much as being so much farther from the goal [m]."""


class RollOut(NamedTuple):
    """What came of some plans (n,)."""

    costs: F64
    """(n,) [m s]"""
    touches: F64
    """1 for each (n,) that ends in a contact, else 0."""
    places: F64
    """Places (T + 1, m, 2) of the first m, in the frame in which they began [m]."""


class KnownWorld:
    """The model.

    Args:
        sensors: what a driver knows of the robot.
        samples: how many plans are tried at once.
        steps: of a plan, T.
        step: time of each [s].
        worth: what makes a way dear.
    """

    def __init__(self, sensors: Sensors, samples: int, steps: int, step: float, worth: Worth) -> None:
        self.sensors = sensors
        self.step = step
        self.worth = worth
        drive = sensors.drive
        robot: dict[str, Any] = {
            "kinematics": drive.kinematics,
            "radius": sensors.radius,
            "max_speed": drive.max_speed,
            "max_reverse": drive.max_reverse,
            "max_turn_rate": drive.max_turn_rate,
            **({"wheelbase": drive.wheelbase, "max_steering": drive.max_steering} if drive.wheelbase else {}),
            "max_acceleration": drive.max_acceleration if math.isfinite(drive.max_acceleration) else None,
        }
        world = {"family": "explicit", "bounds": [-EDGE, -EDGE, EDGE, EDGE], "start": [0, 0, 0], "goal": [EDGE / 2, 0]}
        scenario = {
            "robot": robot,
            "lidar": {"beams": 1, "range": 0.1},  # nobody reads it
            "goal": {"radius": sensors.goal_radius},
            "time": {"step": step, "limit": 2.0 * steps * step},
            "world": world,
        }
        self.one = Simulation(scenario)
        self.one.reset(seeds=[0])  # nothing in it is drawn
        self.many = self.one.branches(samples)
        self._from = np.zeros(samples, dtype=np.int64)

    def begin(self, view: View, still: F64, movers: F64) -> None:
        """Let it stand as it is now.

        Args:
            view: what the robot sees.
            still: discs (n, 3) x, y, radius [m], robot's frame.
            movers: discs that move (m, 5) x, y [m], vx, vy [m/s], radius [m], robot's frame.
        """
        body = self.sensors.radius
        still, movers = clear_of(still, still[:, 2], body), clear_of(movers, movers[:, 4], body)
        layout = Layout(
            border=EDGE * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]),
            starts=np.zeros((1, 3)),
            goals=np.array([view.goal]),
            circles=still,
            movers=tuple(self._mover(*mover) for mover in movers.tolist()),
        )
        self.one.place([layout])
        self.one.world.velocity[0, 0] = view.velocity

    def _mover(self, x: float, y: float, vx: float, vy: float, radius: float) -> Mover:
        """A mover that goes on as it does, through whatever stands there."""
        speed = max(math.hypot(vx, vy), SLOWEST)
        time = self.one.scenario.time.limit
        # What the model may be told was checked when it was measured.
        motion = Waypoints.model_construct(
            law="waypoints", points=((x + vx * time, y + vy * time),), speed=speed, stop=True
        )
        return Mover(radius, (x, y), motion)

    def try_all(self, actions: F64, shown: int) -> RollOut:
        """What comes of plans (samples, T, 2), each in a branch of its own; it stands as before then."""
        self.many.copy_rows(self.one, self._from)
        return self._roll_out(self.many, actions, shown)

    def try_one(self, actions: F64) -> RollOut:
        """What comes of a plan (1, T, 2); begin it anew before the next."""
        return self._roll_out(self.one, actions, 1)

    def _roll_out(self, simulation: Simulation, actions: F64, shown: int) -> RollOut:
        world, worth = simulation.world, self.worth
        costs = np.zeros(simulation.count)
        pose, places = world.pose[:shown, 0, :2], np.empty((actions.shape[1] + 1, shown, 2))
        distance, clearance = world.array("goal_distance")[:, 0], world.array("clearance")[:, 0]
        outcome = world.outcome[:, 0]
        places[0] = pose
        for number in range(actions.shape[1]):
            simulation.advance(actions[:, number, None])
            nearness = np.maximum(1.0 - clearance / worth.keep, 0.0)
            touches = outcome == kernels.COLLISION
            costs += np.maximum(distance - self.sensors.goal_radius, 0.0)
            costs += worth.clearance * nearness * nearness * (outcome == kernels.RUNNING)
            costs += worth.contact * touches
            places[number + 1] = pose
        return RollOut(self.step * costs, touches.astype(np.float64), places)


def clear_of(discs: F64, radii: F64, body: float) -> F64:
    """Discs (n, k) that stand clear of a body about the origin: the last number, a radius, is cut where they would not.

    Args:
        discs: x, y first, the radius last [m].
        radii: the radii (n,) [m].
        body: its radius [m].
    """
    room = np.hypot(discs[:, 0], discs[:, 1]) - body - TOUCHING
    there = room > TOUCHING
    return np.column_stack([discs[there, :-1], np.minimum(radii, room)[there]])
