"""ORCA: robots that see one another each do half of what keeps them apart, around the way that a bug finds.

Source: van den Berg, Guy, Lin and Manocha (2011), "Reciprocal n-Body Collision Avoidance", sections 4 and 5; robots that
cannot go sideways by a larger radius: Alonso-Mora et al. (2013), "Optimal Reciprocal Collision Avoidance for Multiple
Non-Holonomic Robots".
Sensing assumed: ranges all round, goal, own position; of the other robots place and velocity (`peers`), and that they are
like this one and do the same. What else moves is tracked in the scan, and all of the avoidance is this robot's. Memory kept:
the bug's, the tracker's, the borders to the others where it cannot change its speed at once, and how far others held the
robot up in the last decision. States: go (nobody changes what it would do), avoid. Guarantee: two robots that both run it
never touch, with exact `peers`, where they can change their speed at once and stand: none closes more than half of the gap
between them in a step. Nor do they where acceleration is limited or commands act late, with exact odometry and continuous
actions: neither crosses a border that both work out (late.py). It proves nothing about arriving, nor about movers that do not
look. Length: none given.

The way: among walls ORCA by itself stops in every dead end. So the wish is what a bug would do if no one else were
there: it sees the scan without the bodies of the others.

Who is held up turns to the right, by an angle that is drawn: by symmetry all would stop for ever otherwise (the
authors' program perturbs the wish for the same reason).

There is no other rule of the road. Two that come exactly head-on are as near to the left of one another as to the
right; the tie goes to the right, as in the authors' program, but a heading that is rounded in its last digit breaks it either
way. Neither side costs more.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym import kinematics
from bug_gym.agents.bugs.tangent_bug import TangentBug
from bug_gym.agents.hd_bug.policy import HDBug
from bug_gym.agents.parameters import Length
from bug_gym.agents.reciprocal.bodies import BODIES, BODY, PX, VY, find_bodies
from bug_gym.agents.reciprocal.half_planes import CHOSEN, choose_velocities, drawn_share
from bug_gym.agents.reciprocal.late import LateRobots
from bug_gym.agents.teams.partners import BODY_MARGIN
from bug_gym.agents.tracking.layout import MOVER, TRACKS
from bug_gym.agents.tracking.tracker import Tracker, TrackerMemory
from bug_gym.checks import shortened
from bug_gym.foresight import as_it_lies, seen_then
from bug_gym.geometry import F64, velocity_along
from bug_gym.inertia import as_it_will_lie
from bug_gym.policy import STANDING, Drawing, Memory, ScriptedPolicy, Velocity
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

NO_BODIES = np.empty((0, BODY))
"""Nobody else is there."""

Way = Literal["goal", "tangent_bug", "hd_bug"]

BUGS: dict[str, Callable[[Sensors], ScriptedPolicy]] = {
    "tangent_bug": lambda sensors: TangentBug(sensors).driven_late(),
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
    borders: F64 | None = None
    """To each of the other robots (R - 1, BORDER), where it cannot change its speed at once."""
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


class Others(NamedTuple):
    """Who is there for each of r robots, and what they would see if no one were."""

    ranges: F64
    """What they see (r, B) [m]."""
    clean: F64
    """The same without the others (r, B) [m]."""
    bodies: F64
    """(r, n, BODY), of each the first ones."""
    counts: NDArray[np.int64]
    """How many (r,)."""
    of_each: list[F64]
    """The same one by one: the other robots, then what else moves (k, BODY)."""
    views: Sequence[View]
    """Without those who do not count as still things."""


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
        keeps_borders = drive.has_inertia and self.peers > 0 and not discrete
        self.late = LateRobots(sensors, self.peers, SKIN) if keeps_borders else None
        """What it does where it cannot change its speed at once; discrete commands are kept by nobody."""
        numbers = (
            sensors.radius,
            self.wall_margin,
            self.margin,
            drive.max_speed,
            own.horizon,
            drive.step,
            drive.max_acceleration,
            WALL_STEPS * drive.step,
            0.0 if drive.kinematics == "holonomic" else drive.max_turn_rate,
        )
        self._robot = np.array(numbers)
        beams, most = len(sensors.angles), self.peers + TRACKS + (0 if self.late is None else self.peers)
        self._lines, self._spare = np.empty((2, 3 * (beams + 2 * most)))
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
        (velocity,) = self.act_each([view], [memory])
        return velocity

    def act_each(self, views: Sequence[View], memories: Sequence[OrcaMemory]) -> Sequence[Velocity]:
        """Decisions of several robots: who is there, and what keeps clear, is worked out for all of them at once."""
        if not views:
            return []
        there = self.who_is_there(views, memories)
        wishes = []
        for view, clean, bodies, memory in zip(views, there.views, there.of_each, memories, strict=True):
            memory.wish = self._wish(clean, memory)
            memory.bodies, memory.pose = bodies, view.pose
            memory.steps += 1
            wishes.append(self._sidestep(memory))
        if self.late is None:
            chosen = self._keep_clear(there, [view.own_velocity for view in views], wishes)
        else:
            chosen = self._keep_clear_late(self.late, views, memories, there, wishes)
        velocities: list[Velocity] = []
        for memory, (x, y, is_disturbed, slow_x, slow_y) in zip(memories, chosen, strict=True):
            if memory.verdict:
                velocities.append(STANDING)
                continue
            memory.mode = "avoid" if is_disturbed else "go"
            memory.was_disturbed |= is_disturbed > 0.0
            memory.held_up = 1.0 - share_kept(memory.wish, (x, y)) if is_disturbed else 0.0
            velocities.append((slow_x, slow_y))
        return velocities

    def who_is_there(self, views: Sequence[View], memories: Sequence[OrcaMemory]) -> Others:
        """The bodies to be avoided, and what the robots would see if no one else were there."""
        robots, (_, beams) = len(views), self._directions.shape
        movers, ranges = np.empty((robots, TRACKS, MOVER)), rows_of([view.ranges for view in views])
        bodies, found = np.empty((robots, self.peers + TRACKS, BODY)), np.zeros((robots, 3), dtype=np.int64)
        found[:, BODIES] = moving = self._look_for_movers(views, memories, movers)
        if not self.peers and not any(moving):
            return Others(ranges, ranges, bodies, found[:, BODIES], [NO_BODIES] * robots, views)
        told, at_rest = [], []
        for view, memory in zip(views, memories, strict=True):
            told.append(seen := view.flat[self._peers_at])
            if memory.at_rest is None:
                memory.at_rest, memory.seed = np.zeros(self.peers), zlib.crc32(seen.tobytes()) if self.peers else 0
            at_rest.append(memory.at_rest)
        rested, poses = rows_of(at_rest), np.array([view.pose for view in views])
        clean, points = np.empty((robots, beams)), np.empty((robots, 2, beams))
        find_bodies(
            rows_of(told),
            rested,
            movers,
            poses,
            self._known,
            ranges,
            self._directions,
            bodies,
            clean,
            points,
            found,
        )
        of_each, without = [], []
        for robot, (count, taken, left) in enumerate(found.tolist()):
            view, memories[robot].at_rest = views[robot], rested[robot]
            of_each.append(bodies[robot, :count])
            if taken:
                view = view.showing(clean[robot], (points[robot, 0, :left], points[robot, 1, :left]))
            without.append(view)
        return Others(ranges, clean, bodies, found[:, BODIES], of_each, without)

    def _look_for_movers(self, views: Sequence[View], memories: Sequence[OrcaMemory], movers: F64) -> list[int]:
        """How many things move in each scan; `movers` (r, TRACKS, MOVER) is filled as far as there are any."""
        if self.tracker is None:
            return [0] * len(views)
        moving = []
        for view, memory, lines in zip(views, memories, movers, strict=True):
            assert memory.tracker is not None
            moving.append(self.tracker.take_in(memory.tracker, view, memory.steps * self.sensors.drive.step, lines))
        return moving

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

    def _sidestep(self, memory: OrcaMemory) -> Velocity:
        """The wish, turned to the right where others held the robot up."""
        if memory.held_up == 0.0:
            return memory.wish
        leg = int(memory.steps * self.sensors.drive.step / SIDESTEP_LEG)
        angle = -MAX_SIDESTEP * memory.held_up * float(drawn_share(memory.seed, leg))
        cos, sin = math.cos(angle), math.sin(angle)
        return cos * memory.wish[0] - sin * memory.wish[1], sin * memory.wish[0] + cos * memory.wish[1]

    # ------------------------------------------------------------------------------------------------ keeping clear

    def _keep_clear_late(
        self,
        late: LateRobots,
        views: Sequence[View],
        memories: Sequence[OrcaMemory],
        there: Others,
        wishes: Sequence[Velocity],
    ) -> list[list[float]]:
        """The same where a command of now will find the robots; velocities in their frames of now (r, CHOSEN)."""
        most, (robots, beams) = 2 * self.peers + TRACKS, there.ranges.shape
        ranges, clean, bodies = np.empty((robots, beams)), np.empty((robots, beams)), np.empty((robots, most, BODY))
        counts, velocities = np.empty(robots, dtype=np.int64), []
        for row, (view, without, memory) in enumerate(zip(views, there.views, memories, strict=True)):
            then, around = seen_then(view), there.of_each[row]
            velocities.append(then.own_velocity)
            ranges[row] = then.ranges
            clean[row] = then.ranges if without is view else seen_then(without).ranges
            memory.borders = late.borders(view, around, memory.borders)
            found = late.bodies_then(view, around, memory.borders)
            counts[row], bodies[row, : len(found)] = len(found), found
        asked = [as_it_will_lie(view, wish) for view, wish in zip(views, wishes, strict=True)]
        later = there._replace(ranges=ranges, clean=clean, bodies=bodies, counts=counts)
        chosen = self._keep_clear(later, velocities, asked)
        for view, numbers in zip(views, chosen, strict=True):
            x, y, _, slow_x, slow_y = numbers
            numbers[:2], numbers[3:] = as_it_lies(view, (x, y)), as_it_lies(view, (slow_x, slow_y))
        return chosen

    def last_word(self, view: View, memory: OrcaMemory, action: NDArray[Any]) -> NDArray[Any]:
        """The action; where it cannot change its speed at once, none that leads over a border."""
        if self.late is None or memory.borders is None:
            return action
        return self.late.kept_back(view, action, memory.borders)

    def _keep_clear(
        self, there: Others, velocities: Sequence[Velocity], wishes: Sequence[Velocity]
    ) -> list[list[float]]:
        """The velocities nearest to the wishes that keep clear (r, CHOSEN), of robots that have `velocities`."""
        chosen = np.empty((len(velocities), CHOSEN))
        choose_velocities(
            there.ranges,
            there.clean,
            self._cos,
            self._sin,
            self.sensors.range,
            there.bodies,
            there.counts,
            self._robot,
            np.array(velocities),
            np.array(wishes),
            self._lines,
            self._spare,
            chosen,
        )
        numbers: list[list[float]] = chosen.tolist()
        return numbers

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


def rows_of(arrays: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """Arrays of one length as rows (r, k)."""
    return arrays[0].reshape(1, -1) if len(arrays) == 1 else np.array(arrays)


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
