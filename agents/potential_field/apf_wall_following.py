"""APF with wall following: a potential field until a local minimum, a wall until the turning along it says leave.

Source: "potential field with wall following", whose switching conditions use the cumulative inner and outer angle and a
reset point; its displayed formulas are lost, the conditions are rebuilt from the text (turning.py). Sensing assumed: a
scan all round, goal, gyroscope, wheels. Memory kept: the angles of the wall that it follows, the reset point, a gate.
States: potential_field, wall_following. Guarantee: none; in a lap that shuts the goal in, or itself, it says
"unreachable", after two others "looping". Length bound: none.

A local minimum (local_minimum.py) makes it follow the wall toward the target, on the side where that wall lies. It leaves
where it faces the target again by the angles, the way is free, and it has come nearer in projection. A target that moves
is faced by the unwrapped angle, and projected on where it is, as directions kept from the entry mean nothing then.

The proof of "unreachable" is ours and takes two angles of a closed lap: its turning tells whether the wall was walked
round from outside (inward, a full turn) or from within, the turning of the target's direction whether the lap encloses the
target. Shut in is a target enclosed by a lap from outside, and one not enclosed by a lap from within. As the expected
direction leads past gaps that are hardly wider than the robot, such a lap is walked once more with a hand that takes them
all, as the complete bugs walk it (walls/laps.py). Who does not see a corner just passed (some 217 degrees) may have lost
the wall there, and says "looping".

Reported: paths shorter than those of the minimum risk method, TangentBug and Bug2, one scene each (the table is lost), and
no harm by odometry that drifts. Found: shorter than minimum risk and Bug2 in three scenes made in its manner, against
TangentBug it depends on the scene and on how far that sees; drift does little harm while the target is sensed, but for
noise of over 0.1 m/sqrt(m), which Bug2 stands better; with the target by odometry it fails as Bug2 and TangentBug do. In
mazes and some traps it does not arrive. Rebuilt, as no formula can be read: all conditions; with the projection (condition
3) all 24 ways of the map of Oni and Wang arrive, without it three cycle; the reset point, whose worth a figure of the paper
is to prove, changes no length there, and in 500 traps at random fewer arrive with it than without (88 and 96 %). Numbers:
docs/results/apf-wall-following.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from bug_gym.agents.parameters import Length, Weight
from bug_gym.agents.potential_field.field import Field, FieldMemory, FieldParameters, Forces
from bug_gym.agents.potential_field.local_minimum import MinimumMemory, is_caught, travel_direction
from bug_gym.agents.potential_field.turning import Turning
from bug_gym.agents.potential_field.wall_follower import WallFollower
from bug_gym.agents.walls.boundary import Boundary, LeaveRule
from bug_gym.agents.walls.contour import TARGET_MOVED, BugMemory, Contour, Gate
from bug_gym.agents.walls.laps import is_proof
from bug_gym.checks import shortened
from bug_gym.geometry import Point, wrap
from bug_gym.policy import STANDING, Drawing, MisfitError, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View

HEAD_ON = 0.2
"""Sine of the angle between travel and wall below which the travel does not tell the side."""

EVEN = 0.05
"""Angle between the wall's bearing and the target's below which that does not tell it either [rad]."""

FACING = math.radians(20.0)
"""Angle between heading and target that the rule "heading" calls facing it [rad]."""

MOST_TURNS = 5.0
"""Full turns along one wall after which a robot that drifts past its gate is going in circles."""

ALPHAS = (45.0, 135.0)
"""Between these alpha must lie [degrees]: beyond them the robot runs into the wall, or away from it."""

LEAST_FIELD_OF_VIEW = math.pi
"""Of a scanner that can follow walls [rad]: it must see the wall beside it."""


@dataclass(frozen=True)
class ApfWallFollowingParameters(FieldParameters):
    """Parameters of APF with wall following."""

    clearance: Length | None = None
    """Distance from the robot's centre to a wall while following it [m]; None: the body's radius and one step, or what a
    differential robot's brake needs if that is more."""
    turn: Literal["near", "left", "right"] = "near"
    """Which way to turn at a wall: "near" to the side where it does not lie, left where that says nothing."""
    leave_rule: LeaveRule = "any"
    """Where a free heading counts: "front" within 90 degrees of the direction of travel, "any" everywhere."""
    alpha: Weight = 91.0
    """Angle between the repulsion of the wall and the direction along it, 45 to 135 [degrees]."""
    alpha_gain: Weight = 60.0
    """Change of alpha with the distance beyond the clearance [degrees/m]; 0: alpha is constant."""
    approach: Literal["field", "straight"] = "field"
    """How to go to the target: in the "field", or "straight" until contact, as the lengths of closed forms assume."""
    leave: Literal["angle", "free", "distance", "heading"] = "angle"
    """When to leave a wall: by the "angle"; as soon as the way is "free"; or by rules that the paper calls too simple, as
    the "distance" to the target falls, or as the "heading" faces it."""
    reset: bool = True
    """Whether condition 1 sets the angles to zero."""
    projection: bool = True
    """Whether condition 3 asks for progress in projection."""
    form: Literal["cumulative", "unwrapped"] = "cumulative"
    """Which angle tells that the target is faced; after a target that moves always the unwrapped one."""


@dataclass
class ApfWallFollowingMemory(BugMemory):
    """Memory of APF with wall following."""

    felt: FieldMemory = field(default_factory=FieldMemory)
    """Of the forces."""
    minimum: MinimumMemory = field(default_factory=MinimumMemory)
    """Of the watch for local minima."""
    turning: Turning | None = None
    """The angles along the present wall; None in the field."""
    is_at_wall: bool = False
    """Whether it has come to the wall that it follows; a lap begins there."""
    gate: Gate | None = None
    """Where the present lap began."""
    gate_angles: tuple[float, float] = (0.0, 0.0)
    """How far robot and target's direction had turned there [rad]."""
    is_close: bool = False
    """Whether its hand stays on the present wall through every gap, to prove that there is no way."""
    laps: int = 0
    """How often the gate was passed again."""
    course: float | None = None
    """Direction of travel, odometry frame [rad]."""
    goal: Point = (0.0, 0.0)
    """Where the target was when the wall was met, odometry frame [m]."""
    has_target_moved: bool = False
    """Whether it has moved since."""
    goal_distance: float = math.inf
    """Distance to the goal at the last decision [m]."""
    phi: list[float] = field(default_factory=list)
    """phi_0 at each entry [rad]."""
    reset_places: list[Point] = field(default_factory=list)
    """Where the angles were set to zero, odometry frame [m]."""


class ApfWallFollowing(ScriptedPolicy):
    """APF with wall following.

    Raises:
        TypeError: an unknown parameter.
        ValueError: what `Field` and `Boundary` refuse, an alpha outside 45 to 135 degrees, a negative gain, or an unknown
            word; a field of view below 180 degrees (MisfitError).
    """

    Parameters = ApfWallFollowingParameters
    parameters: ApfWallFollowingParameters
    foresight = True

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        own = self.parameters
        check_words(own)
        check_follower(own, sensors)
        self.boundary = Boundary(sensors, clearance=own.clearance, leave_rule=own.leave_rule, foresees=self.foresees)
        alpha, gain = math.radians(own.alpha), math.radians(own.alpha_gain)
        self.follower = WallFollower(self.boundary, alpha=alpha, gain=gain)
        self.field = Field(own, sensors, safe_radius=self.boundary.safe_radius)
        self.lost = sensors.radius + own.influence + self.boundary.clearance
        """Distance beyond which there is no wall to follow any more [m]."""

    def start(self) -> ApfWallFollowingMemory:
        """Memory of a new episode."""
        return ApfWallFollowingMemory(mode="potential_field")

    def act(self, view: View, memory: ApfWallFollowingMemory) -> Velocity:
        """One decision."""
        forces = self.field.feel(view, memory.felt)
        direction = travel_direction(view, memory.minimum)
        self._advance(view, memory)
        if memory.contour is not None and memory.turning is not None:
            self._watch(view, memory, memory.contour, memory.turning)
        if memory.verdict:
            return STANDING
        if memory.contour is None:
            velocity = self._approach(view, memory, forces, direction)
            if velocity is not None:
                return velocity
            self._enter(view, memory, forces, direction)
        memory.goal_distance = view.goal_distance
        if memory.verdict:
            return STANDING
        return self.boundary.follow(view, memory) if memory.is_close else self.follower.follow(view, memory)

    # ------------------------------------------------------------------------------------------------------- the angles

    def _advance(self, view: View, memory: ApfWallFollowingMemory) -> None:
        """Bring course, angles and contour up to the present."""
        sweep = memory.contour.sweep if memory.contour is not None else 0.0
        course, change = self._course(view, memory, sweep)
        self.boundary.advance(view, memory)
        self._hold_gate(view, memory)
        memory.course = course
        turning = memory.turning
        if turning is None:
            return
        memory.has_target_moved |= math.dist(memory.goal, view.goal_position) > TARGET_MOVED
        target, resets = view.heading + view.goal_bearing, turning.resets
        turning.advance(view.position, target, course, change, resets=self.parameters.reset)
        if turning.resets > resets:
            memory.reset_places.append(view.position)

    def _course(self, view: View, memory: ApfWallFollowingMemory, sweep: float) -> tuple[float, float]:
        """Direction of travel in the odometry frame, and how far it has turned since the last decision [rad].

        It is the heading of the gyroscope; a holonomic robot does not turn its body, and travels where its wheels say.
        """
        drive = self.sensors.drive
        if drive.kinematics != "holonomic":
            last = view.heading if memory.course is None else memory.course
            return view.heading, wrap(view.heading - last)
        if math.hypot(*view.velocity) < 0.01 * drive.max_speed:
            return (view.heading if memory.course is None else memory.course), 0.0
        course = view.heading + math.atan2(view.velocity[1], view.velocity[0])
        last = course if memory.course is None else memory.course
        return course, sweep + wrap(course - last - sweep)

    def _hold_gate(self, view: View, memory: ApfWallFollowingMemory) -> None:
        """Let a lap begin no sooner than at the wall: the field is left farther from it than a lap will lead."""
        contour, clearance = memory.contour, self.boundary.clearance
        if contour is None or memory.is_at_wall:
            return
        memory.is_at_wall = math.dist(contour.wall, view.position) < clearance + self.boundary.gate_half_width / 3.0
        contour.gate, contour.steps, contour.aligned = None, 0, 0

    # -------------------------------------------------------------------------------------------------------- the field

    def _approach(
        self, view: View, memory: ApfWallFollowingMemory, forces: Forces, direction: float
    ) -> Velocity | None:
        """Velocity toward the target; None where a wall must be followed."""
        heading = self.boundary.goal_heading(view)
        if heading is not None:
            return self.field.safe_step(view, heading, self.sensors.drive.max_speed)
        if self.parameters.approach == "straight":
            return self.boundary.go(view, view.goal_bearing, view.goal_distance)
        if is_caught(view, memory.minimum, forces, direction) and not self._has_just_left(view, memory):
            return None
        return self.field.velocity(view, forces)

    def _has_just_left(self, view: View, memory: ApfWallFollowingMemory) -> bool:
        """Whether the last wall was left less than two clearances ago, and nothing blocks the way at once."""
        if not memory.leaves or math.dist(memory.leaves[-1], view.position) > 2.0 * self.boundary.clearance:
            return False
        if memory.minimum.why == "swing":
            return False
        return view.free_distance(view.goal_bearing, self.boundary.safe_radius) > self.boundary.step

    # --------------------------------------------------------------------------------------------------------- the wall

    def _enter(self, view: View, memory: ApfWallFollowingMemory, forces: Forces, direction: float) -> None:
        """Begin to follow the wall that is in the way, with the angle to the target that it has there."""
        bearing = self._blocking_bearing(view, forces)
        side = self._side(view, bearing, direction)
        contour = self.boundary.hit(view, memory, side, bearing)
        x, y = view.to_robot(*contour.wall)
        along = view.heading + math.atan2(y, x) + side * 0.5 * math.pi
        course = view.heading if memory.course is None else memory.course
        target = view.heading + view.goal_bearing
        memory.turning = Turning(side, along, view.position, course, target)
        memory.phi.append(memory.turning.first)
        memory.is_at_wall = memory.has_target_moved = False
        memory.goal = view.goal_position
        memory.mode = "wall_following"
        if self.boundary.laps.is_looping(memory):
            memory.verdict = "looping"

    def _blocking_bearing(self, view: View, forces: Forces) -> float:
        """Bearing in which the wall to follow lies [rad]: the target's where that is blocked, else of what is nearest."""
        free = view.free_distance(view.goal_bearing, self.boundary.hit_radius)
        if self.parameters.approach == "straight" or free <= min(self.field.gains.influence, view.goal_distance):
            return view.goal_bearing
        still = [one for one in forces.obstacles if not one.is_moving] or forces.obstacles
        x, y = min(still, key=lambda one: one.distance).place
        return math.atan2(y, x)

    def _side(self, view: View, bearing: float, direction: float) -> int:
        """+1 to keep the wall on the right, -1 on the left."""
        if self.parameters.turn != "near":
            return 1 if self.parameters.turn == "left" else -1
        across = math.sin(wrap(bearing - direction))
        if abs(across) >= HEAD_ON:
            return 1 if across < 0.0 else -1
        _, nearest = view.nearest(bearing, 0.5 * math.pi)
        offset = wrap(view.goal_bearing - nearest)
        return -1 if offset < -EVEN else 1

    def _watch(self, view: View, memory: ApfWallFollowingMemory, contour: Contour, turning: Turning) -> None:
        """Leave the wall, or give up, where it is time."""
        if math.dist(contour.wall, view.position) > self.lost or self._may_leave(view, memory, contour, turning):
            self._leave(view, memory)
            return
        if contour.gate is not memory.gate:
            memory.gate, memory.laps = contour.gate, 0
            memory.gate_angles = turning.total, turning.target_turned
        if contour.is_lap_closed:
            memory.laps += 1
            memory.verdict = self._end_lap(memory, contour, turning)
        elif abs(turning.total) > MOST_TURNS * 2.0 * math.pi:
            memory.verdict = "looping"

    def _end_lap(self, memory: ApfWallFollowingMemory, contour: Contour, turning: Turning) -> str:
        """The verdict of a lap that is closed, "" for none yet."""
        turned, target_turned = (
            (now - then) / memory.laps
            for now, then in zip((turning.total, turning.target_turned), memory.gate_angles, strict=True)
        )
        verdict = lap_verdict(turned, target_turned, memory.laps)
        if verdict != "unreachable":
            return verdict
        if not memory.is_close:
            memory.is_close = True
            contour.gate, contour.check, contour.steps, contour.aligned = None, None, 0, 0
            return ""
        if not is_proof(contour):
            return ""
        return verdict if self.boundary.sees_corners else "looping"  # it may have lost the wall at a corner

    def _leave(self, view: View, memory: ApfWallFollowingMemory) -> None:
        """Back to the field."""
        self.boundary.leave(view, memory)
        memory.turning = None
        memory.is_close = False
        memory.minimum = MinimumMemory()
        memory.mode = "potential_field"

    def _may_leave(self, view: View, memory: ApfWallFollowingMemory, contour: Contour, turning: Turning) -> bool:
        """Conditions 2 and 3; or that a goal by walls is within reach, whatever the angles say."""
        own = self.parameters
        if self.boundary.way_in(view, view.goal_distance) is not None:
            return True
        if not self.boundary.is_free(view, view.goal_bearing, view.goal_distance, contour):
            return False
        if own.leave == "distance":
            return view.goal_distance < memory.goal_distance
        if own.leave == "heading":
            return abs(wrap(turning.target - turning.course)) < FACING
        is_unwrapped = memory.has_target_moved or own.form == "unwrapped"
        if own.leave == "angle" and not turning.faces_target(unwrapped=is_unwrapped):
            return False
        toward = turning.target if memory.has_target_moved else turning.first_target
        return not own.projection or turning.has_come_nearer(view.position, toward)

    def draw(self, memory: ApfWallFollowingMemory) -> Drawing:
        """Forces; hit, leave and reset points; the angles of the present wall."""
        drawing = self.boundary.draw(memory)
        points = [*drawing.points, *((*place, "reset") for place in memory.reset_places)]
        turning, segments = memory.turning, self.field.segments(memory.felt)
        if turning is not None:
            angles = {"entry": turning.along, "target": turning.first_target, "angle": turning.along}
            angles["angle"] -= turning.side * turning.cumulative
            x, y = turning.place
            segments += [(x, y, x + math.cos(angle), y + math.sin(angle), name) for name, angle in angles.items()]
        return Drawing(points=points, segments=segments)


def lap_verdict(turned: float, target_turned: float, laps: int) -> str:
    """What closed laps prove: "unreachable", or after the second that all further ones would be the same, or nothing.

    In the second lap the angles are others than in the first, so that it may leave where it could not.

    Args:
        turned: toward the wall in a lap [rad]; a full turn, outward where it was walked from within.
        target_turned: how far the target's direction turned in a lap [rad]; a full turn where it encloses the target.
        laps: how many there were.
    """
    is_outside = turned > 0.0
    encloses_target = abs(target_turned) > math.pi
    if is_outside == encloses_target:
        return "unreachable"
    return "looping" if laps > 1 else ""


def check_words(own: ApfWallFollowingParameters) -> None:
    """Refuse words that are not among those of a parameter.

    Raises:
        ValueError: such a word.
    """
    known = {
        "turn": ("near", "left", "right"),
        "approach": ("field", "straight"),
        "leave": ("angle", "free", "distance", "heading"),
        "form": ("cumulative", "unwrapped"),
    }
    for name, words in known.items():
        if getattr(own, name) not in words:
            raise ValueError(f"{name} must be one of {list(words)}, got {shortened(getattr(own, name))}")


def check_follower(own: ApfWallFollowingParameters, sensors: Sensors) -> None:
    """Refuse what cannot follow walls.

    Raises:
        ValueError: an alpha outside 45 to 135 degrees, or a gain below 0.
        MisfitError: a field of view below 180 degrees.
    """
    low, high = ALPHAS
    if not low <= own.alpha <= high:
        raise ValueError(
            f"alpha must lie between {low:g} and {high:g} degrees (90: along the wall), got {shortened(own.alpha)}"
        )
    if not (own.alpha_gain >= 0.0 and math.isfinite(own.alpha_gain)):
        raise ValueError(f"alpha_gain must be 0 or above, got {shortened(own.alpha_gain)}")
    seen = float(sensors.angles[-1] - sensors.angles[0])
    # One beam has no field of view, and is refused for want of others (agents/sight.py).
    if len(sensors.angles) > 1 and seen < LEAST_FIELD_OF_VIEW and not sensors.is_full_circle:
        raise MisfitError(
            f"wall following needs a field of view of at least 180 degrees, the scanner has {math.degrees(seen):.4g}: "
            "set lidar.fov to pi or more"
        )
