"""What an evaluation measures: one row an episode, and the quantities in it.

Success weighted by path length (SPL) is that of Anderson et al. 2018, "On Evaluation of Embodied Navigation Agents";
paths are simplified by the rule of Douglas and Peucker 1973. What many rows say together is the matter of `summary`.
"""

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from math import inf, isfinite, isinf, isnan, nan, radians
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from bug_gym.geometry import F64
from bug_gym.schema.errors import shortened

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

OUTCOMES = ("success", "collision", "timeout", "ended", "gave_up")
MISSIONS = ("all", "first")
_MAY_BE_NAN = {"shortest_path_length", "spl", "time_ratio"}
_MAY_BE_INFINITE = {"shortest_path_length", "time_ratio", "min_clearance", "robots_gap"}

_TURN_TOLERANCE = 0.05
"""How far a path may stray from its simplification [m]: above odometry jitter, below a robot's radius."""
_TURN_ANGLE = radians(15.0)
"""The smallest change of heading that counts as a turn [rad]."""
_ROUNDING = 1e-9
"""Share of a sampling interval that a meeting may lie past its end: one exactly on a sample must not be lost."""


@dataclass(frozen=True, slots=True)
class EpisodeRow:
    """One episode of one robot. Checked when made: a wrong type or an impossible number is a ValueError."""

    policy: str
    """Name of the policy."""
    scenario: str
    """Name of the scenario."""
    seed: int
    """Seed of the world."""
    robot: int
    """Index of the robot in its world."""
    outcome: str
    """How the episode ended: one of OUTCOMES."""
    verdict: str
    """What the policy decided ("unreachable", "looping", "stuck"), "" where it decided nothing."""
    success: bool
    """Whether the outcome is "success"."""
    time: float
    """Duration [s]."""
    steps: int
    """Steps taken."""
    path_length: float
    """Length of the path driven [m]."""
    goal_distance: float
    """Distance to the goal at the end [m]."""
    shortest_path_length: float
    """Length of the shortest path [m]; NaN when not asked for, inf when there is none."""
    spl: float
    """Success weighted by path length, 0 to 1; NaN for a moving target and where no shortest path is known."""
    time_ratio: float
    """Earliest time at which a straight run meets the recorded target, over `time`; NaN unless the target moves."""
    min_clearance: float
    """Smallest clearance to an obstacle [m]; negative in a collision, inf where there is nothing to hit."""
    turns: int
    """Way-points of the path: changes of heading of more than 15 degrees once it is simplified."""
    total_turning: float
    """Sum of all changes of heading of the simplified path [rad]."""
    decision_time_mean: float
    """Mean time of a decision [s]."""
    decision_time_p99: float
    """99th percentile of the time of a decision [s]."""
    decision_time_total: float
    """Time of all decisions together [s]."""
    # Of robots that share their world; a row of a robot alone leaves them out.
    robots_gap: float = inf
    """Smallest distance to another robot, centre to centre [m]; inf for a robot alone."""
    holds: int = 0
    """How often it stopped for a partner to pass."""
    held_time: float = 0.0
    """How long it stood so [s]."""
    standing_time: float = 0.0
    """How long it had not moved when its run ended [s]."""
    mission: str = "all"
    """Whose arrival the mission asks for: of "all" robots of the world, or of the "first"."""

    def __post_init__(self) -> None:
        """Refuse what no episode can have."""
        for name, kind in FIELD_TYPES.items():
            _check_field(name, kind, getattr(self, name))
        if self.outcome not in OUTCOMES:
            raise ValueError(f"outcome must be one of {', '.join(OUTCOMES)}, came {shortened(self.outcome)}")
        if self.mission not in MISSIONS:
            raise ValueError(f"mission must be one of {', '.join(MISSIONS)}, came {shortened(self.mission)}")
        if self.success != (self.outcome == "success"):
            raise ValueError(f"success={self.success} contradicts outcome={shortened(self.outcome)}")
        if self.spl > 1.0:
            raise ValueError(f"spl must lie between 0 and 1, came {self.spl}")

    def as_dict(self) -> dict[str, Any]:
        """Fields in order, fit for strict JSON: NaN is None (null), infinity is the string "inf"."""
        alone = isinf(self.robots_gap)
        return {name: value for name, value in json_fields(self).items() if not (alone and name in AMONG_ROBOTS)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "EpisodeRow":
        """Undo `as_dict`, after a journey through JSON too: all keys and no others, types checked."""
        if not isinstance(data, Mapping):
            raise ValueError(f"a row must be a mapping, came {shortened(data)}")
        missing = [name for name in FIELD_TYPES if name not in data and name not in AMONG_ROBOTS]
        unknown = [name for name in data if name not in FIELD_TYPES]
        if missing or unknown:
            raise ValueError(
                f"a row needs the keys {', '.join(FIELD_TYPES)}; missing: {missing}, unknown: {shortened(unknown)}"
            )
        floats = {name: _float_of(data[name]) for name, kind in FIELD_TYPES.items() if kind is float and name in data}
        return cls(**{**data, **floats})


FIELD_TYPES: dict[str, Any] = {field.name: field.type for field in fields(EpisodeRow)}
"""Name and type of each field of a row, in order."""

AMONG_ROBOTS = tuple(field.name for field in fields(EpisodeRow) if field.default is not MISSING)
"""Fields that say something of robots that share their world only."""


def json_fields(record: "DataclassInstance") -> dict[str, Any]:
    """Fields of a dataclass in order; strict JSON has no NaN and no infinity, so None and "inf" stand for them."""
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    return {name: _json_number(value) if isinstance(value, float) else value for name, value in values.items()}


def spl(*, success: bool, shortest: float, taken: float) -> float:
    """Success weighted by path length of one episode: shortest / max(taken, shortest), 0 where it failed.

    NaN where no shortest path is known or there is none, whatever the outcome: whether a world counts in the mean must
    not depend on who drove in it.
    """
    if shortest < 0.0 or not (isfinite(taken) and taken >= 0.0):
        raise ValueError(f"lengths must be >= 0 and taken finite, came shortest={shortest}, taken={taken}")
    if not isfinite(shortest):
        return nan
    longest = max(taken, shortest)
    return 0.0 if not success else shortest / longest if longest > 0.0 else 1.0


def earliest_intercept(
    robot_start: ArrayLike, target_track: ArrayLike, times: ArrayLike, speed: float, *, capture_radius: float = 0.0
) -> float:
    """Earliest time [s] at which a straight run meets a recorded target; inf if never while it was recorded.

    The run starts at times[0], and the target moves straight between samples, so that on each of them the distance at
    time s, |offset + u s|, meets the growing reach, reach + speed s, at the smaller root of a quadratic.

    Args:
        robot_start: Where the run starts [m], (2,).
        target_track: Positions of the target [m], (T, 2).
        times: Their times [s], (T,), increasing.
        speed: Of the run [m/s].
        capture_radius: How near counts as met [m]: the goal's radius, where the record ends as the robot gets there.
    """
    start, track, clock = (np.asarray(array, dtype=np.float64) for array in (robot_start, target_track, times))
    if start.shape != (2,) or track.shape != (*clock.shape, 2) or clock.ndim != 1 or clock.size == 0:
        shapes = f"{start.shape}, {track.shape}, {clock.shape}"
        raise ValueError(f"expected shapes (2,), (T, 2), (T,) with T >= 1, came {shapes}")
    if not (np.isfinite(start).all() and np.isfinite(track).all() and np.isfinite(clock).all()):
        raise ValueError("robot_start, target_track and times must be finite")
    if (np.diff(clock) <= 0.0).any():
        raise ValueError("times must increase")
    if not (isfinite(speed) and speed > 0.0 and isfinite(capture_radius) and capture_radius >= 0.0):
        raise ValueError(f"expected speed > 0 and capture_radius >= 0, came {speed}, {capture_radius}")
    offset, reach = track - start, capture_radius + speed * (clock - clock[0])
    ahead = (offset * offset).sum(axis=1) - reach * reach
    if ahead[0] <= 0.0:
        return float(clock[0])
    duration = np.diff(clock)
    velocity = np.diff(track, axis=0) / duration[:, None]
    a = (velocity * velocity).sum(axis=1) - speed * speed
    b = (offset[:-1] * velocity).sum(axis=1) - speed * reach[:-1]
    waits = _smaller_root(a, b, ahead[:-1])
    met = np.flatnonzero(waits <= duration * (1.0 + _ROUNDING))
    return float(clock[met[0]] + min(waits[met[0]], duration[met[0]])) if met.size else inf


def _smaller_root(a: F64, b: F64, c: F64) -> F64:
    """Smaller positive root of a s^2 + 2 b s + c for c > 0, inf if none; the form holds for a of either sign and for 0.

    Samples after the first meeting may have c <= 0; what comes out for them is not looked at.
    """
    discriminant = b * b - a * c
    divisor = np.sqrt(np.maximum(discriminant, 0.0)) - b
    exists = (discriminant >= 0.0) & (divisor > 0.0)
    return np.asarray(np.divide(c, divisor, out=np.full(len(c), inf), where=exists), dtype=np.float64)


def turns_and_turning(path: ArrayLike, tolerance: float = _TURN_TOLERANCE) -> tuple[int, float]:
    """Count the turns of a path (T, 2) [m] and add up its changes of heading [rad].

    The path is simplified first, to within tolerance [m], so the jitter of a sensor is no turn. A turn is a change of
    heading of more than 15 degrees; changes below count in the sum only. Turning on the spot leaves no trace in a path.
    """
    points = np.asarray(path, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) == 0 or not np.isfinite(points).all():
        raise ValueError(f"path must be a finite array (T, 2) with T >= 1, came shape {points.shape}")
    if not (isfinite(tolerance) and tolerance >= 0.0):
        raise ValueError(f"tolerance must be >= 0, came {tolerance}")
    legs = np.diff(_simplify(points, tolerance), axis=0)
    before, after = legs[:-1], legs[1:]
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    changes = np.abs(np.arctan2(cross, (before * after).sum(axis=1)))
    return int((changes > _TURN_ANGLE).sum()), float(changes.sum())


def _simplify(points: F64, tolerance: float) -> F64:
    """Vertices of a path that keep it within tolerance: a span is cut at its farthest point while that is too far."""
    keep = np.zeros(len(points), dtype=bool)
    keep[[0, -1]] = True
    spans = [(0, len(points) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2:
            continue
        distances = _distances_to_segment(points[first + 1 : last], points[first], points[last])
        farthest = first + 1 + int(np.argmax(distances))
        if distances.max() > tolerance:
            keep[farthest] = True
            spans += [(first, farthest), (farthest, last)]
    return points[keep]


def _distances_to_segment(points: F64, start: F64, end: F64) -> F64:
    """Distance of points (K, 2) to a segment, not to its line: a path that comes back must not vanish."""
    along = end - start
    squared = float(along @ along)
    share = np.clip((points - start) @ along / squared, 0.0, 1.0) if squared > 0.0 else np.zeros(len(points))
    gaps = points - start - share[:, None] * along
    return np.asarray(np.hypot(gaps[:, 0], gaps[:, 1]), dtype=np.float64)


def _json_number(value: float) -> float | str | None:
    return None if isnan(value) else value if isfinite(value) else "inf" if value > 0.0 else "-inf"


def _float_of(value: Any) -> Any:
    """Undo `_json_number`; JSON writes a whole number either way, and what is no number is left to be refused."""
    if value is None:
        return nan
    if value == "inf":
        return inf
    if type(value) is int:
        # A whole number beyond all floats is left to be refused, too.
        return float(value) if abs(value) < 2**1000 else inf if value > 0 else -inf
    return value


def _check_field(name: str, kind: Any, value: Any) -> None:
    """Refuse a value of another type, and a number out of its range."""
    if not (isinstance(value, float) if kind is float else type(value) is kind):
        raise ValueError(f"{name} must be of type {kind.__name__}, came {shortened(value)}")
    if kind is float and isnan(value) and name not in _MAY_BE_NAN:
        raise ValueError(f"{name} must be a number, came NaN")
    if kind is float and isinf(value) and (value < 0.0 or name not in _MAY_BE_INFINITE):
        raise ValueError(f"{name} must be finite, came {value}")
    if kind in (int, float) and value < 0 and name != "min_clearance":
        raise ValueError(f"{name} must be >= 0, came {value}")
