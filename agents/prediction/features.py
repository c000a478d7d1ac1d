"""What a learned predictor sees of a tracked mover, and what its answer means.

Everything is seen from the mover: its place is the origin and its velocity points along x, so that neither the place
nor the direction of a walk has to be learnt. The answer is a mean velocity over each of four horizons, as a difference
from the velocity that the Kalman filter has: zero says what the filter says.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.prediction.surroundings import describe_surroundings
from bug_gym.agents.tracking.tracker import Tracks
from bug_gym.geometry import F32, F64

HORIZONS = np.array([0.8, 1.6, 3.2, 4.8])
"""Times ahead that a predictor answers for [s]."""
LAGS = np.array([0.2, 0.4, 0.6, 0.8, 1.1, 1.5, 2.0, 2.5, 3.0])
"""Ages of the centres that it is told [s]."""
SECTORS = 24
"""Directions about the mover in which it is told what is near."""
SIGHT = 4.0
"""How far about the mover it is told [m]."""
HEADINGS = np.radians([0.0, 15.0, -15.0, 30.0, -30.0, 50.0, -50.0])
"""Directions from its velocity in which it is told how far the mover could go [rad]."""
HEADING_VECTORS = np.stack([np.cos(HEADINGS), np.sin(HEADINGS)], axis=1)
WALL_REACH = 0.8
"""Hits this near to the one that it would touch first say how the wall runs there [m]."""
OTHERS = 3
"""Nearest other tracks that it is told of."""
TOP_SPEED = 1.5
"""Speed in which velocities are measured, and the most that an answer differs from the filter's velocity [m/s]."""

OWN, TO_ROBOT, TOUCH, PER_OTHER = 6, 3, 4, 6
WIDTH = OWN + 2 * len(LAGS) + TO_ROBOT + SECTORS + len(HEADINGS) + TOUCH + PER_OTHER * OTHERS
"""Numbers that a predictor is told of a mover."""
ANSWERS = 2 * len(HORIZONS)
"""Numbers of its answer, each in [-1, 1]."""


def frames(tracks: Tracks) -> tuple[F64, F64]:
    """Directions (T, 2) of the velocities, which are the x axes of the movers' frames, and the speeds (T,) [m/s]."""
    speed = np.hypot(tracks.velocity[:, 0], tracks.velocity[:, 1])
    still = speed < 1e-9
    axes = np.where(still[:, None], [1.0, 0.0], tracks.velocity / np.where(still, 1.0, speed)[:, None])
    return axes, speed


def into_frames(vectors: F64, axes: F64) -> F64:
    """Vectors (T, ..., 2) of the odometry frame in the movers' frames (T, 2)."""
    shape = (len(axes),) + (1,) * (vectors.ndim - 2)
    cos, sin = axes[:, 0].reshape(shape), axes[:, 1].reshape(shape)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)


def out_of_frames(vectors: F64, axes: F64) -> F64:
    """The inverse of `into_frames`."""
    return into_frames(vectors, axes * [1.0, -1.0])


def nearness(distance: F64) -> F64:
    """Encoding of a distance [m]: 1 at contact, 0 at the end of sight."""
    end = 0.3 / (SIGHT + 0.3)
    near: F64 = (0.3 / (np.clip(distance, 0.0, SIGHT) + 0.3) - end) / (1.0 - end)
    return near


def encode(tracks: Tracks, beam_angles: F64, sensor_range: float) -> F32:
    """What a predictor is told of each track (T, WIDTH).

    Of its filter: speed, deviations of place and velocity, radius, age and time unseen. Its mean velocities since LAGS.
    The robot: direction and nearness. Of the hits that aren't its own: how near they are in each of SECTORS, from its
    velocity on, counter-clockwise; how long it could go on in each of HEADINGS; and of the first that it would touch
    how far it lies to the left and how the wall runs there. The nearest OTHERS: place, nearness, velocity, and whether
    there is one.
    """
    count = len(tracks.id)
    if count == 0:
        return np.zeros((0, WIDTH), dtype=np.float32)
    axes, speed = frames(tracks)
    p = tracks.covariance
    place_deviation = np.sqrt(0.5 * (p[:, 0, 0] + p[:, 1, 1]))
    speed_deviation = np.sqrt(0.5 * (p[:, 2, 2] + p[:, 3, 3]))
    own = np.stack(
        [
            speed / TOP_SPEED,
            4.0 * place_deviation,
            2.0 * speed_deviation,
            2.0 * tracks.radius - 1.0,
            np.minimum(tracks.age, 3.0) / 3.0,
            np.minimum(tracks.unseen, 2.0),
        ],
        axis=1,
    )
    robot = into_frames(np.array(tracks.pose[:2]) - tracks.position, axes)
    away = np.hypot(robot[:, 0], robot[:, 1])
    to_robot = np.column_stack([robot / np.maximum(away, 1e-6)[:, None], nearness(away - tracks.radius)])
    parts = [
        own,
        past_of(tracks, axes).reshape(count, -1),
        to_robot,
        *surroundings_of(tracks, axes, speed, beam_angles, sensor_range),
        others_of(tracks, axes).reshape(count, -1),
    ]
    features: F32 = np.clip(np.concatenate(parts, axis=1), -3.0, 3.0).astype(np.float32)
    return features


def past_of(tracks: Tracks, axes: F64) -> F64:
    """Mean velocities (T, LAGS, 2) from the centres of LAGS ago to the place of now, over TOP_SPEED."""
    ages = tracks.history_times[:, -1:] - tracks.history_times + tracks.unseen[:, None]
    rows = np.arange(len(ages))[:, None]
    # The youngest centre that is so old, or the oldest there is.
    index = np.maximum((ages[:, None] >= LAGS[:, None] - 1e-6).sum(axis=2) - 1, 0)
    ways = tracks.position[:, None] - tracks.history[rows, index]
    past: F64 = into_frames(ways / np.maximum(ages[rows, index], LAGS)[..., None], axes) / TOP_SPEED
    return past


def surroundings_of(
    tracks: Tracks, axes: F64, speed: F64, beam_angles: F64, sensor_range: float
) -> tuple[F64, F64, F64]:
    """What the hits about each track say, those on itself aside; see surroundings.

    Returns:
        Nearness (T, SECTORS); share (T, HEADINGS) of the last horizon for which it could go on; and what it would touch
        first (T, TOUCH).
    """
    x, y, heading = tracks.pose
    seen = np.flatnonzero(tracks.ranges < sensor_range)
    bearings, ranges = heading + beam_angles[seen], tracks.ranges[seen]
    hits = np.stack([x + ranges * np.cos(bearings), y + ranges * np.sin(bearings)], axis=1)
    count = len(axes)
    room, free, touch = np.empty((count, SECTORS)), np.empty((count, len(HEADINGS))), np.empty((count, TOUCH))
    describe_surroundings(
        hits, tracks.beam_track[seen], tracks.position, axes, tracks.radius, speed, HEADING_VECTORS, WALL_REACH,
        float(HORIZONS[-1]), room, free, touch,
    )  # fmt: skip
    return nearness(room), free, touch


def others_of(tracks: Tracks, axes: F64) -> F64:
    """The nearest other tracks (T, OTHERS, PER_OTHER): place over SIGHT, nearness, velocity over TOP_SPEED, 1."""
    count = len(axes)
    result = np.zeros((count, OTHERS, PER_OTHER))
    gaps = tracks.position[None] - tracks.position[:, None]
    distance = np.hypot(gaps[..., 0], gaps[..., 1])
    np.fill_diagonal(distance, np.inf)
    order = np.argsort(distance, axis=1, kind="stable")[:, :OTHERS]
    rows = np.arange(count)[:, None]
    chosen = distance[rows, order]
    place = into_frames(gaps[rows, order], axes)
    velocity = into_frames((tracks.velocity * tracks.moving[:, None])[order], axes)
    room = chosen - tracks.radius[:, None] - tracks.radius[order]
    found = np.concatenate(
        [place / SIGHT, nearness(room)[..., None], velocity / TOP_SPEED, np.ones_like(room)[..., None]], axis=-1
    )
    within = chosen < SIGHT
    result[:, : order.shape[1]] = np.where(within[..., None], found, 0.0)
    return result


def decode(answers: NDArray[np.floating], tracks: Tracks, times: F64) -> F64:
    """Places (T, K, 2) in the odometry frame that answers (T, ANSWERS) stand for, at `times` (K,) [s] from now.

    Between the horizons the mean velocity is that between those of the two; before the first it nears the filter's.
    """
    axes, _ = frames(tracks)
    differences = TOP_SPEED * np.asarray(answers, dtype=np.float64).reshape(-1, len(HORIZONS), 2)
    known = np.concatenate([np.zeros((len(differences), 1, 2)), differences], axis=1)
    knots = np.concatenate([[0.0], HORIZONS])
    high = np.clip(np.searchsorted(knots, times, side="left"), 1, len(knots) - 1)
    share = np.clip((times - knots[high - 1]) / (knots[high] - knots[high - 1]), 0.0, 1.0)[:, None]
    mean = (1.0 - share) * known[:, high - 1] + share * known[:, high]
    velocity = tracks.velocity[:, None] + out_of_frames(mean, axes)
    return tracks.position[:, None] + velocity * times[:, None]


def answers_for(places: F64, tracks: Tracks) -> F64:
    """The answers (T, ANSWERS) that stand for true places (T, HORIZONS, 2); the inverse of `decode`, not cut to [-1, 1]."""
    axes, _ = frames(tracks)
    mean = (places - tracks.position[:, None]) / HORIZONS[:, None] - tracks.velocity[:, None]
    answers: F64 = into_frames(mean, axes).reshape(len(axes), ANSWERS) / TOP_SPEED
    return answers


KALMAN_ERRORS = np.array([0.2, 0.45, 1.1, 1.9])
"""About how far the Kalman filter's prediction is off at HORIZONS [m]; what a cost is measured in."""


def errors_of(given: NDArray[np.floating], right: NDArray[np.floating]) -> F64:
    """Distances (n, HORIZONS) of the places that answers (n, ANSWERS) stand for from those of the right ones [m]."""
    gaps = (np.clip(given, -1.0, 1.0) - right).reshape(len(given), len(HORIZONS), 2)
    errors: F64 = TOP_SPEED * HORIZONS * np.hypot(gaps[..., 0], gaps[..., 1])
    return errors


def cost_of(errors: F64) -> F64:
    """One number (n,) for distances (n, HORIZONS) [m]: their mean over KALMAN_ERRORS."""
    cost: F64 = (errors / KALMAN_ERRORS).mean(axis=-1)
    return cost


def _mirror() -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Which feature takes the place of each in the mirror, and with which sign."""
    order, sign = np.arange(WIDTH), np.ones(WIDTH, dtype=np.float32)
    robot = OWN + 2 * len(LAGS)
    sign[OWN + 1 : robot : 2] = -1.0
    sign[robot + 1] = -1.0
    sectors = robot + TO_ROBOT
    order[sectors : sectors + SECTORS] = sectors + (-np.arange(SECTORS)) % SECTORS
    headings = sectors + SECTORS
    order[headings : headings + len(HEADINGS)] = headings + np.abs(HEADINGS[:, None] + HEADINGS).argmin(axis=1)
    touch = headings + len(HEADINGS)
    sign[[touch, touch + 2]] = -1.0
    others = touch + TOUCH
    sign[others + 1 :: PER_OTHER] = -1.0
    sign[others + 4 :: PER_OTHER] = -1.0
    return order, sign


MIRROR_ORDER, MIRROR_SIGN = _mirror()


def mirrored_features(features: F32) -> F32:
    """What would be told (n, WIDTH) of the mirror images of movers."""
    mirrored: F32 = features[:, MIRROR_ORDER] * MIRROR_SIGN
    return mirrored


def mirrored_answers(answers: F32) -> F32:
    """The answers (n, ANSWERS) for the mirror images."""
    mirrored: F32 = answers * np.tile(np.array([1.0, -1.0], dtype=np.float32), len(HORIZONS))
    return mirrored
