"""ORCA: robots that see one another each do half of what keeps them apart, around the way that a bug finds.

Source: van den Berg, Guy, Lin and Manocha (2011), "Reciprocal n-Body Collision Avoidance", sections 4 and 5; robots that
cannot go sideways by a larger radius: Alonso-Mora et al. (2013), "Optimal Reciprocal Collision Avoidance for Multiple
Non-Holonomic Robots".
Sensing assumed: ranges all round, goal, own position; of the other robots place and velocity (`peers`), and that they are
like this one and do the same. What else moves is tracked in the scan, and all of the avoidance is this robot's. Memory
kept: the bug's, the tracker's, and how far others held the robot up in the last decision. States: go (nobody changes
what it would do), avoid. Guarantee: two robots that both run it never touch, with exact `peers`: none closes more than
half of the gap between them in a step. It proves nothing about arriving, nor about movers that do not look. Length:
none given.

The way: among walls ORCA by itself stops in every dead end. So the wish is what a bug would do if no one else were
there: it sees the scan without the bodies of the others.

Who is held up turns to the right, by an angle that is drawn: by symmetry all would stop for ever otherwise (the
authors' program perturbs the wish for the same reason).
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from bug_gym import kinematics
from bug_gym.agents.bugs.tangent_bug import TangentBug
from bug_gym.agents.hd_bug.policy import HDBug
from bug_gym.agents.parameters import Length
from bug_gym.agents.reciprocal.bodies import BODY, PX, VY, find_bodies
from bug_gym.agents.reciprocal.half_planes import drawn_share, reciprocal_velocity, speed_before_bodies
from bug_gym.agents.teams.partners import BODY_MARGIN
from bug_gym.agents.tracking.layout import MOVER, TRACKS
from bug_gym.agents.tracking.tracker import Tracker, TrackerMemory
from bug_gym.checks import shortened
from bug_gym.geometry import F64, velocity_along
from bug_gym.policy import Drawing, Memory, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View

SKIN = 0.02
"""Room that robots leave between them [m]."""

MAX_SIDESTEP = 1.5
"""How far at most a robot that is held up turns to its right [rad]."""

SIDESTEP_LEG = 1.0
"""For how long it keeps to the angle that it has drawn [s]."""

TRACK_MARGIN = 0.1
"""How far from a tracked mover's edge a hit is still taken for the mover's, beside three times the range noise [m]."""

WALL_STEPS = 2.0
"""How many steps before a wall a robot begins to slow down."""

NONE = np.empty((0, MOVER))
"""No movers."""
NO_BODIES = np.empty((0, BODY))
"""Nor others."""

Way = Literal["goal", "tangent_bug", "hd_bug"]

BUGS: dict[str, Callable[[Sensors], ScriptedPolicy]] = {
    "tangent_bug": lambda sensors: TangentBug(sensors).without_course(),
    "hd_bug": HDBug,
}


@dataclass
class OrcaMemory(Memory):
    """Memory of ORCA."""

    bug: Memory | None = None
    """Of the bug that finds the way."""
    tracker: TrackerMemory | None = None
    """Of what moves and is no robot."""
    steps: int = 0
    """Decisions so far."""
    seed: int = 0
    """Tells this robot from the others, whose angles to the right differ."""
    at_rest: F64 | None = None
    """For how long each of the other robots has been at rest (R - 1,) [s]."""
    held_up: float = 0.0
    """How much of the wish the others left nothing of in the last decision, from 0 to 1."""
    was_disturbed: bool = False
    """Whether others have changed what the robot did since the bug began."""
    wish: Velocity = (0.0, 0.0)
    """The last wish, in the robot's frame [m/s]."""
    bodies: F64 | None = None
    """The bodies of the last decision (n, BODY), in the robot's frame."""
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """From where they were seen: odometry x, y [m], heading [rad]."""


@dataclass(frozen=True)
class OrcaParameters:
    """Parameters of ORCA."""

    way: Way = "tangent_bug"
    """Whose way the robot takes among walls: a bug's, or straight to the goal."""
    horizon: Length = 3.0
    """For so long no contact with another body is to be ahead [s]."""
    enlargement: Length | None = None
    """By how much the radius of a differential robot is enlarged [m]; None: how far it gets off the line that it wants while
    it turns."""
    sees_movers: bool = True
    """Whether what moves in the scan and is no robot is avoided, too."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.horizon) and self.horizon > 0.0):
            raise ValueError(f"horizon must be positive, got {shortened(self.horizon)}")
        if self.enlargement is not None and not (math.isfinite(self.enlargement) and self.enlargement >= 0.0):
            raise ValueError(f"enlargement must be at least 0, got {shortened(self.enlargement)}")
        if self.way not in ("goal", *BUGS):
            raise ValueError(f"way must be one of {['goal', *BUGS]}, got {shortened(self.way)}")


class Orca(ScriptedPolicy):
    """Reciprocal avoidance around a bug's way.

    Raises:
        TypeError: an unknown parameter.
        ValueError: a horizon that is not positive, a negative enlargement, or an unknown way.
    """

    Parameters = OrcaParameters
    parameters: OrcaParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        own, drive = self.parameters, sensors.drive
        self.bug = BUGS[own.way](sensors) if own.way in BUGS else None
        self.tracker = Tracker(sensors) if own.sees_movers else None
        seen = next((field for field in sensors.fields if field.name == "peers"), None)
        self.peers = seen.shape[0] if seen is not None else 0
        """How many other robots it sees."""
        self._peers_at = slice(seen.begin, seen.end) if seen is not None else slice(0)
        enlargement = own.enlargement if own.enlargement is not None else off_the_line(sensors)
        self.margin = SKIN + (0.0 if drive.kinematics == "holonomic" else 2.0 * enlargement)
        """Kept between this robot and another body, as far as there is room [m]."""
        self.wall_margin = SKIN + 2.0 * sensors.range_noise
        numbers = (
            sensors.radius,
            self.wall_margin,
            self.margin,
            drive.max_speed,
            own.horizon,
            drive.step,
            drive.max_acceleration,
            WALL_STEPS * drive.step,
        )
        self._robot = np.array(numbers)
        beams, most = len(sensors.angles), self.peers + TRACKS
        self._lines, self._spare = np.empty((2, 3 * (beams + 2 * most)))
        self._bodies = np.empty((most, BODY))
        self._directions = np.ascontiguousarray(sensors.beam_directions)
        self._cos, self._sin = self._directions
        noise = 3.0 * sensors.range_noise
        scanner = sensors.range, float(np.float32(sensors.range)), BODY_MARGIN + noise, TRACK_MARGIN + noise
        self._known = np.array((sensors.radius, drive.step, *scanner, sensors.bridged_gap, sensors.is_full_circle))

    def start(self) -> OrcaMemory:
        """Memory of a new episode."""
        bug = None if self.bug is None else self.bug.start()
        return OrcaMemory(mode="go", bug=bug, tracker=None if self.tracker is None else self.tracker.start())

    def act(self, view: View, memory: OrcaMemory) -> Velocity:
        """One decision."""
        bodies, clean = self.who_is_there(view, memory)
        memory.wish = wish = self._wish(clean, memory)
        memory.bodies, memory.pose = bodies, view.pose
        memory.steps += 1
        if memory.verdict:
            return 0.0, 0.0
        x, y, is_disturbed = self._keep_clear(view, clean, bodies, self._sidestep(wish, memory))
        memory.mode = "avoid" if is_disturbed else "go"
        memory.was_disturbed |= is_disturbed
        memory.held_up = 1.0 - share_kept(wish, (x, y)) if is_disturbed else 0.0
        return self._slowed(bodies, (x, y))

    def who_is_there(self, view: View, memory: OrcaMemory) -> tuple[F64, View]:
        """The bodies to be avoided, and what the robot would see if no one else were there.

        Returns:
            (n, BODY): the other robots, then what else moves; and the view without them, but with those of them that count
            as still things.
        """
        told = view.flat[self._peers_at]
        if memory.at_rest is None:
            memory.at_rest = np.zeros(self.peers)
        if memory.steps == 0 and self.peers:
            memory.seed = zlib.crc32(told.tobytes())
        movers = NONE
        if self.tracker is not None and memory.tracker is not None:
            movers = self.tracker.take_in(memory.tracker, view, memory.steps * self.sensors.drive.step)
        if not self.peers and not len(movers):
            return NO_BODIES, view
        ranges, points = np.empty(view.ranges.shape), np.empty(self._directions.shape)
        seen = view.ranges, self._directions
        count, taken, shown = find_bodies(
            told, memory.at_rest, movers, view.pose, self._known, *seen, self._bodies, ranges, points
        )
        clean = view.showing(ranges, (points[0, :shown], points[1, :shown])) if taken else view
        return self._bodies[:count].copy(), clean

    # ------------------------------------------------------------------------------------------------------ the wish

    def _wish(self, view: View, memory: OrcaMemory) -> Velocity:
        """What the robot would do if no one else were there."""
        if self.bug is None or memory.bug is None:
            drive = self.sensors.drive
            return velocity_along(view.goal_bearing, min(drive.max_speed, view.goal_distance / drive.step))
        velocity = self.bug.act(view, memory.bug)
        if memory.bug.verdict and memory.was_disturbed:
            # What it has found out among others who pushed the robot about proves nothing.
            memory.bug, memory.was_disturbed = self.bug.start(), False
            velocity = self.bug.act(view, memory.bug)
        memory.verdict = memory.bug.verdict
        return velocity

    def _sidestep(self, wish: Velocity, memory: OrcaMemory) -> Velocity:
        """The wish, turned to the right where others held the robot up."""
        if memory.held_up == 0.0:
            return wish
        leg = int(memory.steps * self.sensors.drive.step / SIDESTEP_LEG)
        angle = -MAX_SIDESTEP * memory.held_up * float(drawn_share(memory.seed, leg))
        cos, sin = math.cos(angle), math.sin(angle)
        return cos * wish[0] - sin * wish[1], sin * wish[0] + cos * wish[1]

    # ------------------------------------------------------------------------------------------------ keeping clear

    def _keep_clear(self, view: View, clean: View, bodies: F64, wish: Velocity) -> tuple[float, float, bool]:
        """The velocity nearest to the wish that keeps clear, and whether bodies change what it would be."""
        velocity = view.own_velocity
        chosen: tuple[float, float, bool] = reciprocal_velocity(
            view.ranges,
            clean.ranges,
            self._cos,
            self._sin,
            self.sensors.range,
            bodies,
            len(bodies),
            self._robot,
            velocity,
            wish,
            self._lines,
            self._spare,
        )
        return chosen

    def _slowed(self, bodies: F64, velocity: Velocity) -> Velocity:
        """The velocity, slowed down for a differential robot, which goes ahead while it turns toward it."""
        drive, speed = self.sensors.drive, math.hypot(*velocity)
        if drive.kinematics == "holonomic" or speed == 0.0:
            return velocity
        error = math.atan2(velocity[1], velocity[0])
        if abs(error) > kinematics.TURN_IN_PLACE:
            return velocity
        chord = 0.5 * kinematics.turn_rate(drive, error) * drive.step
        slow = speed_before_bodies(bodies, len(bodies), self._robot, chord, speed)
        # A vanishing speed keeps the direction, so that the robot goes on turning.
        share = max(slow / speed, 1e-6)
        return velocity[0] * share, velocity[1] * share

    def draw(self, memory: OrcaMemory) -> Drawing:
        """What the bug shows, the bodies that are avoided with their velocities, and the wish."""
        shown = Drawing() if self.bug is None else self.bug.draw(memory.bug)
        x, y, heading = memory.pose
        cos, sin = math.cos(heading), math.sin(heading)

        def place(ahead: float, left: float) -> tuple[float, float]:
            return x + cos * ahead - sin * left, y + sin * ahead + cos * left

        arrows = [(*place(0.0, 0.0), *place(*memory.wish), "wish")]
        for px, py, vx, vy in [] if memory.bodies is None else memory.bodies[:, PX : VY + 1].tolist():
            arrows.append((*place(px, py), *place(px + vx, py + vy), "velocity"))
        return Drawing(shown.points, [*shown.segments, *arrows], shown.areas)


def share_kept(wish: Velocity, velocity: Velocity) -> float:
    """What of a wish a velocity does, from 0 to 1."""
    square = wish[0] ** 2 + wish[1] ** 2
    kept = (velocity[0] * wish[0] + velocity[1] * wish[1]) / square if square > 0.0 else 1.0
    return min(max(kept, 0.0), 1.0)


def off_the_line(sensors: Sensors) -> float:
    """How far a differential robot gets off the line that it wants while it turns toward it [m].

    It stands while the error is above TURN_IN_PLACE; from there on the error fades by TURN_GAIN, so that at top speed it
    gets off by v e / k.
    """
    return sensors.drive.max_speed * kinematics.TURN_IN_PLACE / kinematics.TURN_GAIN
