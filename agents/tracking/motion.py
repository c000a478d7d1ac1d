"""How a track's update is weighed: clues of whether it moves, and the network that makes log odds of them.

The clues are the same in a mirrored, turned or shifted world. Two hidden layers of rectified units make of them what an
update adds to the log odds that the track moves, and how fast earlier ones are forgotten: what is met by a beam or two says
little, and should not undo what is known. That is a sequential test whose terms are learnt: `docs/train_tracker.py` makes
the weights, of drives whose truth is known.

Source: Wald 1945, Sequential Tests of Statistical Hypotheses.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bug_gym.agents.tracking.filter import mahalanobis
from bug_gym.agents.tracking.layout import (
    AGE,
    ANGLE_STEP,
    BEAMS,
    BEAMS_OF,
    BORN,
    CLUES,
    COMPARED_SCANS,
    DISTANCE,
    EVIDENCE,
    EXPLAINED,
    HAS_MOVED,
    HIDDEN_ENDS,
    HIDDEN_ENDS_OF,
    HITS,
    HITS_OF_FIVE,
    INNOVATION,
    INNOVATION_OF,
    IS_CONFIRMED,
    IS_MOVING,
    MOVED_OFF,
    NOISE,
    NOISE_OF,
    NOW,
    OWN_ENDS,
    OWN_ENDS_OF,
    PASSED,
    PASSED_NOW,
    PASSED_THEN,
    POSE_X,
    POSE_Y,
    RADIUS,
    RADIUS_OF,
    RADIUS_SPREAD,
    RADIUS_VARIANCE,
    ROBOT_ACROSS,
    ROBOT_ALONG,
    SHAPE_OF,
    SHAPE_VARIANCE,
    SIGNIFICANCE,
    SPACING,
    SPEED,
    SPEED_ACROSS,
    SPEED_ALONG,
    SPREAD_ACROSS,
    SPREAD_ALONG,
    STEP_OF,
    STOOD_OFF,
    VX,
    VXX,
    VXY,
    VY,
    VYY,
    WHOLE,
    WHOLE_OF,
    Scan,
    X,
    Y,
)
from bug_gym.compiling import called, inlined
from bug_gym.files import from_json
from bug_gym.kernels.layout import Floats, Integers

WEIGHTS = Path(__file__).resolve().parents[1] / "trained" / "tracker" / "weights.json"
FORGOTTEN_IN, LEAST_FORGOTTEN = 0.4, 0.1
"""In this time evidence falls to its e-th part [s], or so many times slower, where the network says so."""
MOST_EVIDENCE = 12.0
"""Bound of the log odds."""
MOST_ADDED = 4.0
"""Log odds that a tenth of a second may add or take: no scan alone tells a mover."""
OF_SLOW = -2.0
"""What a tenth of a second adds to a track that hardly has a speed."""
LEAST_SPEED = 0.05
"""Of a track that may move, by its filter [m/s]."""
SURELY_MOVES, STILL_SURE = 5.5, 3.0
"""Log odds from which on a track is a mover, and until which it stays one."""
FEW, SURELY_OF_FEW, STILL_OF_FEW = 3, 9.0, -1.5
"""Where fewer beams than FEW meet it these are asked instead, either way: a beam that slides along the edge of a wall looks
like a mover for long, and a mover met by one beam now and then stands as long as that beam meets it."""
SURE_SPEED = 16.0
"""Squared Mahalanobis distance of a speed from standing, from which on a mover stays one until STILL_OF_FEW."""
LEAST_GAP = 0.005
"""What is added to distances before their logarithm is taken [m]."""
MOST_WHOLE = 10
"""A track is no more whole than after so many measurements."""


class Network(NamedTuple):
    """Weights (inputs, outputs) and offsets (outputs,) of two hidden layers of H units and of what follows from them."""

    first: Floats
    """(CLUES, H)."""
    first_offset: Floats
    second: Floats
    """(H, H)."""
    second_offset: Floats
    last: Floats
    """(H, 2): of what is added, and of what is forgotten."""
    last_offset: Floats
    """(2,)."""


class Weighing(NamedTuple):
    """What an update works with."""

    clues: Floats
    """What is told of each track (TRACKS, CLUES)."""
    hidden: Floats
    """Scratch, of both hidden layers (2, H)."""
    robot: Floats
    """Velocity of the robot in the odometry frame (2,) [m/s]."""
    network: Network


@cache
def shipped() -> Network:
    """The network that comes with the package."""
    return network_of(WEIGHTS)


def network_of(path: Path) -> Network:
    """The network of a file.

    Raises:
        ValueError: other weights than those of a Network.
    """
    told = from_json(path.read_bytes())
    if not isinstance(told, dict) or set(told) != set(Network._fields):
        raise ValueError(f"{path} is no tracker's network: expected {', '.join(Network._fields)}")
    network = Network(**{name: np.array(values, dtype=np.float64) for name, values in told.items()})
    units = len(network.last)
    shapes = ((CLUES, units), (units,), (units, units), (units,), (units, 2), (2,))
    if any(array.shape != shape for array, shape in zip(network, shapes, strict=True)):
        raise ValueError(f"{path}: expected arrays of {shapes}, got {tuple(array.shape for array in network)}")
    return network


@inlined
def may_move(s: Floats, n: Integers) -> bool:
    """Whether a track is seen twice in a row and has a speed, so that its update is weighed."""
    return bool((n[HITS] & 3) == 3 and s[VX] * s[VX] + s[VY] * s[VY] > LEAST_SPEED * LEAST_SPEED)


@called
def sum_up(s: Floats, n: Integers, clue: Floats, scan: Scan, weighing: Weighing) -> None:
    """Add to a track's evidence what this update says; in what is not seen, or was not just before, nothing is changed."""
    if (n[HITS] & 3) != 3:
        return
    added, forgotten = OF_SLOW, 1.0
    if may_move(s, n):
        finish_clues(s, n, clue, scan, weighing.robot)
        added, forgotten = answers(clue, weighing.network, weighing.hidden)
    kept = s[EVIDENCE] * math.exp(-forgotten * scan.pose[PASSED] / FORGOTTEN_IN)
    s[EVIDENCE] = min(max(kept + 10.0 * scan.pose[PASSED] * added, -MOST_EVIDENCE), MOST_EVIDENCE)


@inlined
def is_mover(s: Floats, n: Integers) -> bool:
    """Whether a track moves."""
    is_few = n[BEAMS] < FEW
    if n[IS_MOVING] > 0:
        goes_on = is_few and mahalanobis(s[VX], s[VY], s[VXX], s[VXY], s[VYY]) > SURE_SPEED
        return bool(s[EVIDENCE] >= (STILL_OF_FEW if goes_on else STILL_SURE))
    surely = SURELY_OF_FEW if is_few and n[HAS_MOVED] == 0 else SURELY_MOVES
    return bool(n[IS_CONFIRMED] > 0 and s[EVIDENCE] >= surely)


@inlined
def finish_clues(s: Floats, n: Integers, clue: Floats, scan: Scan, robot: Floats) -> None:
    """Write the clues of a track's update beside what the past scans say of it.

    Args:
        s, n: the track.
        clue: (CLUES,); its first columns hold sums over the track's hits, which become means.
        scan: of now.
        robot: velocity of the robot in the odometry frame (2,) [m/s].
    """
    noise, beams = scan.settings[NOISE], max(n[BEAMS], 1)
    for k in range(COMPARED_SCANS):
        clue[STOOD_OFF + k] = math.log(clue[STOOD_OFF + k] / beams + LEAST_GAP)
        clue[MOVED_OFF + k] = math.log(clue[MOVED_OFF + k] / beams + LEAST_GAP)
        clue[EXPLAINED + k] = clue[EXPLAINED + k] / beams
        clue[PASSED_NOW + k] = math.log1p(clue[PASSED_NOW + k])
        clue[PASSED_THEN + k] = math.log1p(clue[PASSED_THEN + k])
    dx, dy = s[X] - scan.pose[POSE_X], s[Y] - scan.pose[POSE_Y]
    away = max(math.hypot(dx, dy), 1e-6)
    ux, uy = dx / away, dy / away
    across = uy * s[VX] - ux * s[VY]
    side = 1.0 if across >= 0.0 else -1.0
    vxx, vxy, vyy = s[VXX], s[VXY], s[VYY]
    clue[SPEED] = math.hypot(s[VX], s[VY])
    clue[SIGNIFICANCE] = math.log1p(max(mahalanobis(s[VX], s[VY], vxx, vxy, vyy), 0.0))
    clue[SPEED_ALONG], clue[SPEED_ACROSS] = ux * s[VX] + uy * s[VY], side * across
    clue[SPREAD_ALONG] = 0.5 * math.log(max(ux * ux * vxx + 2.0 * ux * uy * vxy + uy * uy * vyy, 1e-6))
    clue[SPREAD_ACROSS] = 0.5 * math.log(max(uy * uy * vxx - 2.0 * ux * uy * vxy + ux * ux * vyy, 1e-6))
    clue[ROBOT_ALONG] = ux * robot[0] + uy * robot[1]
    clue[ROBOT_ACROSS] = side * (uy * robot[0] - ux * robot[1])
    clue[DISTANCE], clue[SPACING] = away, math.log(away * scan.settings[ANGLE_STEP])
    clue[NOISE_OF], clue[BEAMS_OF] = math.log(noise + LEAST_GAP), math.log(beams)
    clue[OWN_ENDS_OF], clue[HIDDEN_ENDS_OF] = n[OWN_ENDS], n[HIDDEN_ENDS]
    clue[WHOLE_OF] = math.log1p(min(n[WHOLE], MOST_WHOLE))
    clue[SHAPE_OF] = 0.5 * math.log(s[SHAPE_VARIANCE] + 1e-6)
    clue[RADIUS_OF], clue[RADIUS_SPREAD] = s[RADIUS], 0.5 * math.log(s[RADIUS_VARIANCE])
    clue[AGE] = math.log(max(scan.pose[NOW] - s[BORN], 0.01))
    clue[HITS_OF_FIVE] = bits(n[HITS])
    clue[INNOVATION_OF] = math.log1p(max(s[INNOVATION], 0.0))
    clue[STEP_OF] = math.log(max(scan.pose[PASSED], 0.01))


@inlined
def answers(clue: Floats, network: Network, hidden: Floats) -> tuple[float, float]:
    """What the network says of some clues; `hidden` is scratch (2, H).

    Returns:
        What a tenth of a second adds to the log odds, and how fast earlier ones are forgotten, from LEAST_FORGOTTEN to 1.
    """
    first, second = hidden[0], hidden[1]
    for j in range(len(first)):
        first[j], second[j] = network.first_offset[j], network.second_offset[j]
    add_rows(clue, network.first, first)
    for i in range(len(first)):
        first[i] = max(first[i], 0.0)
    add_rows(first, network.second, second)
    odds, gate = network.last_offset[0], network.last_offset[1]
    for i in range(len(second)):
        value = max(second[i], 0.0)
        odds += value * network.last[i, 0]
        gate += value * network.last[i, 1]
    forgotten = LEAST_FORGOTTEN + (1.0 - LEAST_FORGOTTEN) / (1.0 + math.exp(-gate))
    return MOST_ADDED * math.tanh(odds / MOST_ADDED), forgotten


@called
def add_rows(values: Floats, weights: Floats, total: Floats) -> None:
    """Add to a total (H,) the rows of weights (K, H) times their values (K,), in order; those of 0 are left out.

    Two at a time, as most of what it takes is to read and write the total.
    """
    waiting = -1
    for i in range(len(values)):
        if values[i] == 0.0:
            continue
        if waiting < 0:
            waiting = i
            continue
        one, other, row, next_row = values[waiting], values[i], weights[waiting], weights[i]
        for j in range(len(total)):
            total[j] = (total[j] + one * row[j]) + other * next_row[j]
        waiting = -1
    if waiting >= 0:
        for j in range(len(total)):
            total[j] += values[waiting] * weights[waiting, j]


@inlined
def bits(value: int) -> int:
    """How many of the last five updates were hits."""
    total = 0
    for k in range(5):
        total += (value >> k) & 1
    return total
