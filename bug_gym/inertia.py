"""What a robot with inertia may ask for, so that it can always stop before what it sees.

A robot whose acceleration is limited goes on where it does not want to. So a command is cut until the step that it leads to
ends where braking straight on keeps clear of every point of the scan: from there the next command can do just that. Among
things that stand still it then never touches what its scan shows. (The dynamic window of Fox, Burgard and Thrun 1997, here
applied to what an algorithm wants.)

Where commands act later than they are given, the step that one leads to begins where those before it, which nobody can take
back, will have brought the robot.

What stands between two beams shows only when they are so near together as it is wide. So the robot goes no faster than lets
it stop from there before a post. Where one scan shows less of a thing than another, since beams are few, are lost or scatter,
those before the last one count as well: a tip that has come to lie between two beams is where it was.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bug_gym import kernels, kinematics
from bug_gym.kernels.stopping import FAST
from bug_gym.kinematics import Drive
from bug_gym.view import Sensors, Shown, View

SHARES = 8
"""In how many parts a command is cut."""

LEAST_ROOM = 0.005
"""What is kept about the body in any case, beside the noise of a range [m]."""

POST = 0.15
"""Width of the thinnest thing that the robot is slow enough to see in time between two beams: a post of BARN's [m]."""

LATELY = 0.3
"""For how long what scans showed counts beside what the last one shows [s]."""

UNSURE = 0.025
"""What noise and gaps between the beams may hide from a robot that stops at once [m]; beyond that it takes care, too."""

CREEP = 0.25
"""Share of a long step that a robot takes in any case where more may lie between its beams."""

NEIGHBOURS = 2.1
"""How many beams' spacings points may lie apart that are taken for ones of the same thing: between them one may be lost."""

EVASIONS = 16
"""In how many directions a robot tries to get away that can no longer stop in time."""

LESS = (0.0, 0.01, 0.02, 0.03, 0.04, 0.06, 0.08)
"""What it keeps less then [m], more and more until a way is left: it may be that things are smaller than they seem."""

SLIDES = (0.0, 0.4, -0.4, 0.8, -0.8, 1.2, -1.2)
"""Angles [rad] by which a wish is turned whose least part leads too near to what may lie between beams; positive: away."""

TURNS = (0.0, 0.5, -0.5, 1.0, -1.0)
"""How fast a robot turns that has to stop, as shares of how fast it can: the first that lets it stop in time."""

LEAST_PACE = 0.25
"""Share of its top speed below which that is not worth it: so few beams show a post too late at any pace."""

FACE_SPACING = 0.05
"""How far apart points of a face are that is not seen [m]."""

STANDS = 1e-6
"""Speed below which a robot stands [m/s]."""

NO_FACES = np.zeros((2, 0))

Velocity = tuple[float, float]


class Motion(NamedTuple):
    """A step, and the way on which the robot then comes to stand; in its frame before the step."""

    x: float
    """Where the step ends [m]."""
    y: float
    turn: float
    """How far it turns in the step [rad]."""
    way_x: float
    """The way after it [m]."""
    way_y: float


class Ahead(NamedTuple):
    """Where a robot will be when a command of now begins to act; in its frame of now."""

    x: float
    """[m]"""
    y: float
    turn: float
    """How far it will have turned [rad]."""
    velocity: Velocity
    """The velocity of its body then, as it is observed [m/s, and rad/s or m/s]."""
    faces: NDArray[np.float64] = NO_FACES
    """Points (2, k) of what it may meet there behind corners before it sees it, in its frame of now [m]."""


remembered = functools.lru_cache(maxsize=64)
"""What follows from sensors alone is worked out once."""


@remembered
def needs_care(sensors: Sensors) -> bool:
    """Whether what an algorithm asks for may lead into something.

    The robot has inertia, its scan is noisy, or in the way of a step much lies between two beams.
    """
    return sensors.drive.has_inertia or sensors.range_noise > 0.0 or _steps_wide(sensors)


@remembered
def _steps_wide(sensors: Sensors) -> bool:
    """Whether at the end of a step much may lie between two beams, where the robot stops at once."""
    return not sensors.drive.has_inertia and _is_sparse(sensors)


def _is_sparse(sensors: Sensors) -> bool:
    """Whether at the end of a step much may lie between two beams."""
    steps = 1 + sensors.drive.latency
    return hidden_at(sensors, sensors.radius + steps * sensors.step_length) > UNSURE


def stopping_radius(sensors: Sensors, room: float = 0.0) -> float:
    """How near its middle a point of the scan may lie [m] that a robot with inertia may pass, which wants room beside it."""
    if not sensors.drive.has_inertia:
        return sensors.radius + room
    return (sensors.radius + _margin(sensors, room)) / (1.0 - 0.5 * sensors.beam_spacing)


def passing_radius(sensors: Sensors) -> float:
    """The same without room where beams are so few that much may lie between two of them even beside the body; else its own.

    A way on which a robot would stand is none.
    """
    is_wide = 0.5 * sensors.beam_spacing * sensors.radius > UNSURE
    return stopping_radius(sensors) if is_wide else sensors.radius


@remembered
def _fast_gap(sensors: Sensors) -> float:
    """The gap [rad] that counts where a robot with inertia goes fast: half of the angle between two beams, or all of it.

    What one beam meets may go on up to the next one, which goes past: the tip lies nearer to that one than half a gap.
    """
    return (1.0 if sensors.drive.has_inertia and _is_sparse(sensors) else 0.5) * sensors.beam_spacing


def hidden_at(sensors: Sensors, distance: float) -> float:
    """Half of what lies between two beams at a distance [m], between which one may be lost."""
    spacing = sensors.beam_spacing * (2.0 if sensors.dropout > 0.0 else 1.0)
    return 0.5 * spacing * distance


@remembered
def scans_kept(sensors: Sensors) -> int:
    """How many scans before the last one count: none where each shows all that matters.

    Of a robot that stops at once one step alone can be at fault: the more it takes.
    """
    drive, hidden = sensors.drive, hidden_at(sensors, sensors.radius)
    if drive.has_inertia:
        is_unsure = sensors.dropout > 0.0 or max(hidden, sensors.range_noise) > LEAST_ROOM
    else:
        is_unsure = max(sensors.range_noise, sensors.dropout) > 0.0 and hidden + sensors.range_noise > UNSURE
    return max(round(LATELY / drive.step), 1) if is_unsure else 0


def shown_points(view: View) -> NDArray[np.float64]:
    """The points (2, k) that a scan shows, odometry frame [m]."""
    (x, y, heading), (ahead, left) = view.pose, view.points
    cos, sin = math.cos(heading), math.sin(heading)
    return np.stack([x + cos * ahead - sin * left, y + sin * ahead + cos * left])


def speed_within(drive: Drive, way: float) -> float:
    """The greatest speed [m/s] at which the robot drives one step and then comes to stand within a way [m].

    With latency it drives on for so many steps more, until the command to brake acts.
    """
    if not drive.has_inertia or math.isinf(way):
        return drive.max_speed
    free = 1 + drive.latency
    if math.isinf(drive.max_acceleration):
        return min(way / (drive.step * free), drive.max_speed)
    loss = drive.max_acceleration * drive.step
    # Speeds v, ... v, v - loss, v - 2 loss ... of whole steps until nothing is left: the inverse of kernels.stopping_way.
    twice = 2.0 * free - 1.0
    steps = math.floor(0.5 * (math.sqrt(twice * twice + 8.0 * way / (drive.step * loss)) - twice))
    return min((way / drive.step + 0.5 * loss * steps * (steps + 1)) / (steps + free), drive.max_speed)


@remembered
def pace_in_sight(sensors: Sensors) -> float:
    """The greatest speed [m/s] at which the robot comes to stand before a post that two beams do not meet until it is near.

    A disc of radius R may lie R / sin(A / 2) away and between two beams that are an angle A apart. From there the robot must
    stop. Top speed where it has no inertia, or where it would have to creep.
    """
    drive = sensors.drive
    if not drive.has_inertia:
        return drive.max_speed
    met = 0.5 * POST / math.sin(min(0.5 * sensors.beam_spacing, 0.5 * math.pi))
    way = met - 0.5 * POST - sensors.radius - LEAST_ROOM - sensors.range_noise
    pace = speed_within(drive, max(way, 0.0))
    return pace if pace >= LEAST_PACE * drive.max_speed else drive.max_speed


def nearest_number(choices: NDArray[np.float64], wish: Velocity | NDArray[np.float32]) -> int:
    """Number of the choice (m, 2) that comes nearest to a wish."""
    return int(((choices[:, 0] - wish[0]) ** 2 + (choices[:, 1] - wish[1]) ** 2).argmin())


def stoppable_number(view: View, choices: NDArray[np.float64], wish: Velocity, room: float) -> int:
    """Number of the choice nearest to a desired velocity of those from which the robot can stop before what it sees.

    None of them is to stand: where none will do, it is the one that keeps clear with most. For robots that are no cars.

    Args:
        view: the observation.
        choices: the velocities of discrete actions (m, 2) [m/s].
        wish: what an algorithm asks for, in the robot's frame [m/s].
        room: what it keeps about the body [m].
    """
    drive = view.sensors.drive
    if drive.kinematics == "holonomic" and not needs_care(view.sensors):
        return nearest_number(choices, wish)
    ahead = foreseen(view)
    (x, y, wide), margin, gap = _seen_from(view, ahead, room)
    order = np.argsort((choices[:, 0] - wish[0]) ** 2 + (choices[:, 1] - wish[1]) ** 2, kind="stable").tolist()
    for kept, hidden in ((margin, gap), *((LEAST_ROOM - less, 0.0) for less in LESS)):
        for number in order:
            asked = float(choices[number, 0]), float(choices[number, 1])
            if drive.kinematics == "holonomic":
                motion = _slide(drive, ahead.velocity, asked)
            else:
                motion = _arc(drive, ahead.velocity[0], kinematics.turning(drive, asked))
            if kernels.keeps_clear(x, y, view.sensors.circles, *motion, kept, hidden, wide):
                return int(number)
    return int(order[0])


def _within(velocity: Velocity, speed: float) -> Velocity:
    """A velocity cut to a speed [m/s]."""
    length = math.hypot(*velocity)
    if length <= speed:
        return velocity
    share = speed / length
    return share * velocity[0], share * velocity[1]


def stoppable_action(view: View, velocity: Velocity, room: float) -> NDArray[np.float32]:
    """The action (2,) nearest to a desired velocity of those from which the robot can stop before what it sees.

    Args:
        view: the observation.
        velocity: what an algorithm asks for, in the robot's frame [m/s].
        room: what it keeps about the body [m].
    """
    drive = view.sensors.drive
    velocity = _within(velocity, pace_in_sight(view.sensors))
    if drive.kinematics == "holonomic":
        if _steps_wide(view.sensors):
            velocity = _slid_in_sight(view, velocity)
            if view.sensors.range_noise == 0.0:
                return kinematics.steering(drive, velocity)
        ahead = foreseen(view)
        for kept, share in itertools.product(_rooms(drive, room), _shares()):
            asked = share * velocity[0], share * velocity[1]
            if _is_clear(view, ahead, _slide(drive, ahead.velocity, asked), kept, is_fast=share > FAST):
                return kinematics.steering(drive, asked)
        return kinematics.steering(drive, _evasion(view, ahead, room))
    return kinematics.differential_action(drive, *_stoppable_part(view, kinematics.turning(drive, velocity), room))


def stoppable_arc(view: View, wish: Velocity, room: float) -> Velocity:
    """The speed [m/s] and turn rate [rad/s] nearest to wished ones from which a differential robot can stop in time."""
    pace = pace_in_sight(view.sensors)
    if abs(wish[0]) > pace:
        keeps_arc = view.sensors.drive.kinematics == "ackermann"
        wish = math.copysign(pace, wish[0]), wish[1] * (pace / abs(wish[0]) if keeps_arc else 1.0)
    return _stoppable_part(view, wish, room)


def _stoppable_part(view: View, wish: Velocity, room: float) -> Velocity:
    """The same for a wish that is slow enough for what two beams may leave out."""
    drive, ahead = view.sensors.drive, foreseen(view)
    (fast, rate), keeps_arc, speed = wish, drive.kinematics == "ackermann", ahead.velocity[0]
    body, most, step = view.sensors.circles, drive.max_acceleration, drive.step
    if _steps_wide(view.sensors):
        fast, rate = _arc_in_sight(view, fast, rate)
        if view.sensors.range_noise == 0.0:
            return fast, rate
    rooms = _rooms(drive, room)
    for kept in rooms:
        (x, y, wide), margin, gap = _seen_from(view, ahead, kept)
        seen, gaps = (x, y, body), (gap, wide, _fast_gap(view.sensors))
        part = kernels.clear_part(*seen, speed, fast, rate, keeps_arc, most, step, margin, *gaps, SHARES)
        # Standing is always clear to who stands: it is no answer while there is less room to ask for.
        if part > 0 or (part == 0 and (fast == 0.0 or kept == rooms[-1])):
            share = part / SHARES
            return share * fast, share * rate if keeps_arc else rate
    return _stopping(view, ahead, wish, room)


def _stopping(view: View, ahead: Ahead, wish: Velocity, room: float) -> Velocity:
    """What a robot asks for of whose wish nothing leaves it a way to stop in time."""
    drive, speed = view.sensors.drive, ahead.velocity[0]
    if drive.latency > 0 and wish != (0.0, 0.0):
        away = _straight_away(view)
        if _is_clear(view, ahead, _arc(drive, speed, away), 0.0):
            return away
    if speed == 0.0 or drive.kinematics == "ackermann":
        return 0.0, 0.0
    return _first_clear(view, ahead, [(0.0, turn * drive.max_turn_rate) for turn in TURNS], room)


@remembered
def are_cut_at_once(sensors: Sensors) -> bool:
    """Whether `stoppable_actions` serves robots with these sensors.

    They need care, are differential and told in time, and one scan shows all.
    """
    drive = sensors.drive
    is_plain = drive.kinematics == "differential" and drive.latency == 0 and not _steps_wide(sensors)
    return is_plain and needs_care(sensors) and scans_kept(sensors) == 0


def stoppable_actions(
    views: Sequence[View], rows: Sequence[int], velocities: Sequence[Velocity], room: float
) -> list[NDArray[np.float32]]:
    """`stoppable_action` for some of several robots whose scans were read at once; see `are_cut_at_once`.

    Args:
        views: of all of them, in the order in which they were read.
        rows: which are asked for (k,).
        velocities: what these want, in their frames [m/s].
        room: what they keep about the body [m].
    """
    sensors, scans = views[0].sensors, views[0].scans
    assert scans is not None
    drive, pace = sensors.drive, pace_in_sight(sensors)
    wishes = []
    for row, velocity in zip(rows, velocities, strict=True):
        wishes.append((views[row].velocity[0], *kinematics.speed_and_error(_within(velocity, pace))))
    kept = _margin(sensors, room), 0.5 * sensors.beam_spacing, _fast_gap(sensors), SHARES
    actions, cut = np.empty((len(wishes), 2), dtype=np.float32), np.empty(len(wishes), dtype=np.int64)
    known = scans.points, scans.counts, np.array(rows), sensors.circles, np.array(wishes), drive.limits
    kernels.stoppable_levers(*known, *kept, actions, cut)
    for number, (row, part) in enumerate(zip(rows, cut.tolist(), strict=True)):
        if part < 0:
            wish = kinematics.turning(drive, _within(velocities[number], pace))
            told = _stopping(views[row], foreseen(views[row]), wish, room)
            actions[number] = kinematics.differential_action(drive, *told)
    return list(actions)


def _margin(sensors: Sensors, room: float) -> float:
    """What is kept about the body of a robot that wants room beside it [m]."""
    return max(room, LEAST_ROOM + sensors.range_noise)


def _evasion(view: View, ahead: Ahead, room: float) -> Velocity:
    """What a holonomic robot asks for that is to stand: that, or where it cannot stop in time a way past what is seen."""
    drive, (vx, vy) = view.sensors.drive, ahead.velocity
    change = drive.max_acceleration * drive.step
    if not math.isfinite(change):
        return 0.0, 0.0
    back = math.atan2(-vy, -vx)
    turns = sorted((2.0 * math.pi * number / EVASIONS - math.pi for number in range(EVASIONS)), key=abs)
    ways = [(vx + change * math.cos(back + turn), vy + change * math.sin(back + turn)) for turn in turns]
    return _first_clear(view, ahead, [(0.0, 0.0), *ways], room)


def _first_clear(view: View, ahead: Ahead, asked: Sequence[Velocity], room: float) -> Velocity:
    """The first of some velocities that keeps clear with all that is to be kept; else with as much as any keeps clear with.

    Of a robot that turns: speeds and turn rates.
    """
    drive = view.sensors.drive
    is_holonomic = drive.kinematics == "holonomic"
    motions = [
        _slide(drive, ahead.velocity, one) if is_holonomic else _arc(drive, ahead.velocity[0], one) for one in asked
    ]
    (x, y, wide), margin, gap = _seen_from(view, ahead, room)
    for kept, hidden in ((margin, gap), *((LEAST_ROOM - less, 0.0) for less in LESS)):
        for one, motion in zip(asked, motions, strict=True):
            if kernels.keeps_clear(x, y, view.sensors.circles, *motion, kept, hidden, wide):
                return one
    return asked[0]


def _slid_in_sight(view: View, velocity: Velocity) -> Velocity:
    """What of a holonomic robot's wish leads past nothing that the beams may leave out; where nothing does, it slides aside.

    It tries the side away from what is nearest first.
    """
    drive, away = view.sensors.drive, _side_away(view)
    for turn in SLIDES if velocity != (0.0, 0.0) else SLIDES[:1]:
        cos, sin = math.cos(away * turn), math.sin(away * turn)
        x, y = cos * velocity[0] - sin * velocity[1], sin * velocity[0] + cos * velocity[1]
        share = _share_in_sight(view, functools.partial(_part_of_slide, drive, view.velocity, (x, y)))
        if share > 0.0:
            return share * x, share * y
    return 0.0, 0.0


def _arc_in_sight(view: View, speed: float, rate: float) -> Velocity:
    """The same of the speed and turn rate that a robot wishes which turns; where nothing does, it turns away."""
    drive, now = view.sensors.drive, view.velocity[0]
    keeps_arc = drive.kinematics == "ackermann"
    share = _share_in_sight(view, lambda part: _arc(drive, now, (part * speed, part * rate if keeps_arc else rate)))
    if share > 0.0 or speed == 0.0 or keeps_arc:
        return share * speed, share * rate if keeps_arc else rate
    rate = _side_away(view) * drive.max_turn_rate
    share = _share_in_sight(view, lambda part: _arc(drive, now, (part * speed, rate)))
    return share * speed, rate


def _side_away(view: View) -> float:
    """1 where what is nearest lies to the right, else -1: the way to turn to get away from it."""
    return 1.0 if view.nearest()[1] < 0.0 else -1.0


def _share_in_sight(view: View, motion: Callable[[float], Motion]) -> float:
    """The share of a step on which nothing lies that the beams may leave out; CREEP, after which they show more, if none does.

    Things may go on beside a point that a beam meets until the next beam, which misses them. Half as much is kept of any share,
    and what a corner needs between two beams that meet its sides.
    """
    body, margin, gap = view.sensors.circles, LEAST_ROOM + view.sensors.range_noise, view.sensors.beam_spacing
    is_exact, met, wide_as = view.sensors.range_noise == 0.0, view.points_met, 2.0 * view.sensors.radius
    apart = NEIGHBOURS * gap
    x, y, wide = view.points_of_late
    if is_exact and view.sensors.dropout == 0.0:
        kernels.are_between(x, y, wide_as, apart, between := np.empty(x.size, dtype=np.bool_))
        order = np.argsort(between, kind="stable")
        x, y, wide = x[order], y[order], int(np.count_nonzero(~between))
    for share in (*_shares(), 0.0):
        kept, asked = (margin, gap) if share > CREEP else (0.0, 0.5 * gap), motion(share)
        if not kernels.keeps_clear(x, y, body, *asked, *kept, wide):
            continue
        if kernels.passes_corners(*met, body, *asked[:3], wide_as, apart, LEAST_ROOM, is_exact):
            return share
    return 0.0


def _straight_away(view: View) -> Velocity:
    """Slowly straight back from what is nearest, or straight on: for who stands so near to it that he cannot turn.

    A scanner that does not look behind does not see what is there.
    """
    drive = view.sensors.drive
    is_ahead = math.cos(view.nearest()[1]) > 0.0
    return (-drive.max_reverse if is_ahead else drive.max_speed) / SHARES, 0.0


def _rooms(drive: Drive, room: float) -> tuple[float, ...]:
    """What is kept about the body [m], and what at least where that lets nothing through.

    Commands that act late bring a robot nearer to walls than it means to come; there it would stand for ever.
    """
    return (room, 0.0) if drive.latency > 0 else (room,)


def foreseen(view: View) -> Ahead:
    """Where a command of now will find the robot: here, or with latency where those under way will have brought it.

    Where nobody kept them it is supposed to go on as it goes.
    """
    drive = view.sensors.drive
    ahead = Ahead(0.0, 0.0, 0.0, view.velocity)
    if drive.latency == 0:
        return ahead
    for velocity in _asked_before(view):
        ahead = after(drive, ahead, velocity)
    if drive.latency > 0 and drive.kinematics == "holonomic":
        ahead = ahead._replace(faces=_hidden_faces(view, math.hypot(ahead.x, ahead.y)))
    return ahead


def _asked_before(view: View) -> list[Velocity]:
    """What the commands under way ask for, the first one first."""
    drive = view.sensors.drive
    if view.under_way is None:
        return [view.velocity] * drive.latency
    asked = [kinematics.asked_velocity(drive, action) for action in view.under_way]
    return [(0.0, 0.0)] * (drive.latency - len(asked)) + asked


def way_to_stand(view: View, asked: Velocity) -> NDArray[np.float64]:
    """Where a robot is now and after each step (k, 2) that asks for a velocity once and then to stand, until it does.

    Args:
        view: what it sees.
        asked: ahead and to the left [m/s], or ahead [m/s] and a turn rate [rad/s].

    Returns:
        Places in its frame of now [m].
    """
    drive, ahead = view.sensors.drive, Ahead(0.0, 0.0, 0.0, view.velocity)
    places = [(0.0, 0.0)]
    for velocity in (*_asked_before(view), asked):
        ahead = after(drive, ahead, velocity)
        places.append((ahead.x, ahead.y))
    speed = math.hypot(*ahead.velocity) if drive.kinematics == "holonomic" else abs(ahead.velocity[0])
    while speed > STANDS and math.isfinite(drive.max_acceleration):
        ahead = after(drive, ahead, (0.0, 0.0))
        places.append((ahead.x, ahead.y))
        speed -= drive.max_acceleration * drive.step
    return np.array(places)


def farthest_way(sensors: Sensors) -> float:
    """The longest way [m] that a robot may drive before it stands, if it wants to from the next command on."""
    drive = sensors.drive
    braking = float(kernels.stopping_way(drive.max_speed, drive.max_acceleration, drive.step))
    return sensors.step_length * (1 + drive.latency) + braking


def _hidden_faces(view: View, reach: float) -> NDArray[np.float64]:
    """Points (2, k) of faces that what is seen may have behind its ends, as far as a robot comes that cannot look first [m].

    One that slides round a corner with commands that act late meets its other face a step after that has come into sight.
    The farthest that it may lie ahead is along the beam that sees the end.

    Args:
        view: what is seen.
        reach: how far the commands under way bring the robot [m].
    """
    sensors, ranges = view.sensors, view.ranges
    if reach == 0.0:
        return NO_FACES
    beyond = np.maximum(np.roll(ranges, 1), np.roll(ranges, -1))
    if not sensors.is_full_circle and ranges.size > 1:
        beyond[0], beyond[-1] = ranges[1], ranges[-2]
    is_end = (beyond - ranges > 2.0 * sensors.radius) & (ranges < min(2.0 * reach + sensors.radius, sensors.range))
    (ends,) = is_end.nonzero()
    deep = FACE_SPACING * np.arange(1, math.ceil(reach / FACE_SPACING) + 1)
    away = np.minimum(ranges[ends, None] + deep, beyond[ends, None])
    return np.reshape(sensors.beam_directions[:, ends, None] * away, (2, -1))


def as_it_will_lie(view: View, velocity: Velocity) -> Velocity:
    """A velocity of the robot's frame of now in the one in which a command of now finds it [m/s].

    Else it would turn on for as long as commands take, and back, and for ever to and fro.
    """
    cos, sin = math.cos(turn := foreseen(view).turn), math.sin(turn)
    return cos * velocity[0] + sin * velocity[1], cos * velocity[1] - sin * velocity[0]


def after(drive: Drive, ahead: Ahead, asked: Velocity) -> Ahead:
    """Where a step more brings the robot that asks for a velocity."""
    if drive.kinematics == "holonomic":
        motion = _slide(drive, ahead.velocity, asked)
        velocity = motion.x / drive.step, motion.y / drive.step
    else:
        motion = _arc(drive, ahead.velocity[0], asked)
        limit = drive.max_acceleration * drive.step
        speed = min(max(asked[0], ahead.velocity[0] - limit), ahead.velocity[0] + limit)
        velocity = speed, kernels.rate_at(speed, *asked, drive.kinematics == "ackermann")
    cos, sin = math.cos(ahead.turn), math.sin(ahead.turn)
    x, y = ahead.x + cos * motion.x - sin * motion.y, ahead.y + sin * motion.x + cos * motion.y
    return Ahead(x, y, ahead.turn + motion.turn, velocity)


def _shares() -> Iterator[float]:
    return (part / SHARES for part in range(SHARES, 0, -1))


def _is_clear(view: View, ahead: Ahead, motion: Motion, room: float, *, is_fast: bool = False) -> bool:
    """Whether the body keeps clear of what is seen on a motion that begins where it will be."""
    (x, y, wide), margin, gap = _seen_from(view, ahead, room)
    gap = _fast_gap(view.sensors) if is_fast else gap
    return bool(kernels.keeps_clear(x, y, view.sensors.circles, *motion, margin, gap, wide))


def _seen_from(view: View, ahead: Ahead, room: float) -> tuple[Shown, float, float]:
    """What was seen of late from where the robot will be, what is kept about the body [m] and half a beam's gap [rad]."""
    x, y, wide = view.points_of_late
    gap = 0.5 * view.sensors.beam_spacing
    margin = _margin(view.sensors, room)
    if view.sensors.drive.latency > 0:
        x, y = np.append(x, ahead.faces[0]), np.append(y, ahead.faces[1])
        cos, sin = math.cos(ahead.turn), math.sin(ahead.turn)
        dx, dy = x - ahead.x, y - ahead.y
        x, y = cos * dx + sin * dy, cos * dy - sin * dx
        # What lies between two beams is as wide as it is from here.
        margin += _fast_gap(view.sensors) * math.hypot(ahead.x, ahead.y)
    return Shown(x, y, wide), margin, gap


def _slide(drive: Drive, velocity: Velocity, asked: Velocity) -> Motion:
    """How a holonomic robot moves that has a velocity and asks for another (kernels.drive)."""
    scale = drive.max_speed / max(drive.max_speed, math.hypot(*asked))
    dx, dy = scale * asked[0] - velocity[0], scale * asked[1] - velocity[1]
    change = math.hypot(dx, dy)
    share = min(drive.max_acceleration * drive.step / change, 1.0) if change > 0.0 else 1.0
    vx, vy = velocity[0] + share * dx, velocity[1] + share * dy
    speed = math.hypot(vx, vy)
    time = kernels.stopping_way(speed, drive.max_acceleration, drive.step) / speed if speed > 0.0 else 0.0
    return Motion(vx * drive.step, vy * drive.step, 0.0, vx * time, vy * time)


def _part_of_slide(drive: Drive, velocity: Velocity, asked: Velocity, part: float) -> Motion:
    """The same where it asks for a part of that."""
    return _slide(drive, velocity, (part * asked[0], part * asked[1]))


def _arc(drive: Drive, speed: float, asked: Velocity) -> Motion:
    """How a robot that turns moves that has a speed and asks for another, and for a turn rate (kernels.drive)."""
    keeps_arc = drive.kinematics == "ackermann"
    return Motion(*kernels.arc_and_stop(speed, *asked, keeps_arc, drive.max_acceleration, drive.step))
