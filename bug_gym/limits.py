"""How far, how long, how fast and how many: what keeps numbers finite, memory sane and foreign files readable."""

from __future__ import annotations

import stat
from pathlib import Path

FAR = 1e5
"""Greatest length and coordinate [m]: bodies that are not there wait at 1e6 (kernels.laws.AWAY), out of all reach."""
SMALL = 1e-6
"""Least length, time and speed that is not zero [m, s, m/s]: squares and quotients of smaller ones are lost."""
LONG = 1e7
"""Greatest time [s], four months."""
LONGEST_STEP = 1e3
"""Greatest time from one action to the next [s]."""
EPOCH = 1e10
"""Greatest time stamp of a recording [s]: seconds since 1970 are below it."""
FAST = 1e4
"""Greatest speed [m/s]."""
FASTEST_TURN = 1e3
"""Greatest turn rate [rad/s]: a longest step turns by no more than STEEP."""
STEEP = 1e6
"""Greatest angle [rad]: the kernels' sine and cosine reduce those up to 1.6e6 exactly."""
STEEPEST_STEERING = 1.5
"""Greatest steering angle [rad], 86 degrees: the arc's radius is the wheelbase over its tangent."""
WIDEST_SWING = 100.0
"""Turn of a body in a step times the root of the radius on which what is farthest out turns [rad sqrt(m)]: 11,000 chords stand
for it."""
FLATTEST_ARC = 0.003
"""How far the arc of a step may lie beside its chord at most, for the chord to stand for it [m]."""
MOST_TURNS = 1_000_000
"""Way-points and legs of a body in a step (1 / kernels.motion.SHORTEST)."""
STRONG = 1e6
"""Greatest acceleration [m/s^2], and what a metre of ground may cost at most [1]."""
HEAVY = 1e9
"""Greatest weight of a term of a reward [1]."""
DRIFT = 100.0
"""Greatest noise and bias of odometry, in its units."""

MOST = 1_000_000_000
"""Greatest count of what takes no memory."""
MOST_BEAMS, BEAM_BYTES = 100_000, 28
"""Beams of a scan, and what one takes: a range, its cosine and sine, and working memory."""
MOST_ROBOTS, PEER_BYTES = 1_000, 16
"""Robots of a world, and what one takes that sees another."""
MOST_OBSTACLES, OBSTACLE_BYTES = 20_000, 450
"""Obstacles of a world of one kind, and what a polygon takes, the largest of them."""
MOST_DELAYED = 100
"""Actions of a robot that are under way at once."""
MOST_CELLS, CELL_BYTES = 40_000, 2_000
"""Cells of a maze, rooms or blocks of a world, and what the walls of one take while they are joined."""
MOST_CORNERS, CORNER_BYTES = 1_000, 40
"""Corners of an obstacle that is drawn."""
MOST_WORKERS = 1_000
"""Processes, or threads, that share some work."""
MOST_SEEDS = 1_000_000
"""Seeds of each claim of a reproduction."""
MOST_TRAININGS = 10_000
"""Models that are trained one after the other."""
MOST_EPISODES, ROW_BYTES = 10_000_000, 1_000
"""Episodes of an evaluation, all policies and scenarios together, and what the row of one takes."""
MOST_SAMPLES, SAMPLE_BYTES = 100_000_000, 600
"""Samples that a training keeps or takes at a time, and what one takes: two observations of 70 numbers."""
MOST_WIDTH, WEIGHT_BYTES = 16_384, 16
"""Neurons of a layer, and what one of its weights takes, with the optimiser's memory of it."""
MEMORY = 64 * 2**30
"""What worlds side by side, or their pictures, may take together [bytes]."""

TEXT = 2_000_000
"""Longest text of YAML [bytes]."""
MOST_NODES, MOST_DEPTH, MOST_ALIASES = 1_000_000, 50, 100
"""Values of a scenario and of a text of YAML, how deep they may be nested, and aliases."""
DATA = 64_000_000
"""Largest file of worlds, of a recording or of a map's picture [bytes]."""


def told_bytes(count: int) -> str:
    """A number of bytes as `2.8 GB`."""
    units = ("bytes", "kB", "MB", "GB", "TB", "PB")
    for power, unit in enumerate(units):
        if count < 1000 ** (power + 1):
            return f"{count / 1000**power:,.1f} {unit}" if power else f"{count} {unit}"
    return "more than 1,000 PB"


def read_file(path: Path, most: int) -> bytes:
    """The bytes of a regular file.

    Raises:
        ValueError: a device, a pipe or a folder, more than `most` bytes, or a path that none can have.
        OSError: it can't be read.
    """
    # A pipe would make the reader wait, a device may go on for ever.
    if not stat.S_ISREG(path.stat().st_mode):
        raise ValueError(f"{path}: not a regular file")
    with path.open("rb") as file:
        raw = file.read(most + 1)
    if len(raw) > most:
        raise ValueError(f"{path}: got {told_bytes(path.stat().st_size)}, expected at most {told_bytes(most)}")
    return raw
