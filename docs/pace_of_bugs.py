"""How much of a holonomic robot's pace bugs keep on a differential one, with rounded corners and without.

Time of the holonomic robot over that of the differential one, of all worlds where both arrive by ways whose lengths differ by
less than a quarter; the first 0.3 m, with the turn that a differential robot begins with, do not count. Third, what turning
allows: the same share for the holonomic robot's way along walls, where outer corners are turned on the contour as fast as
the robot turns, and inner ones are cut at full speed. Prints a table.

    python docs/pace_of_bugs.py --worlds 12
"""

import argparse
import math
from dataclasses import dataclass, field
from itertools import groupby, pairwise

import gymnasium as gym

from bug_gym.agents import make_policy
from bug_gym.geometry import wrap
from bug_gym.kinematics import Drive

FAMILIES = ("Maze", "Rooms", "Static")
LIMIT = 1500.0
"""Of an episode [s]."""
SET_OUT = 0.3
"""Way from which on time counts [m]: by then it has turned."""
SHARPEST = 0.5 * math.pi
"""What is cut of an inner corner is counted as in one of a right angle at most [rad]."""


@dataclass
class Trip:
    """How an episode went."""

    success: bool = False
    steps: int = 0
    """Since it has set out."""
    way: float = 0.0
    """Its length [m]."""
    turns: list[tuple[float, float]] = field(default_factory=list)
    """Along walls: the turn of each step, away from the wall positive [rad], and its length [m]."""

    def lost_to_turning(self, drive: Drive) -> float:
        """How much longer a robot would take that turns as fast as a drive [s]."""
        lost = 0.0
        for is_inner, steps in groupby(self.turns, key=lambda turn: math.copysign(turn[0] != 0.0, turn[0])):
            angle, length = map(sum, zip(*steps, strict=True))
            if is_inner > 0.0:
                angle = min(angle, SHARPEST)
                lost -= drive.fast_bend * (2.0 * math.tan(0.5 * angle) - angle) / drive.max_speed
            else:
                lost += max(-angle / drive.max_turn_rate - length / drive.max_speed, 0.0)
        return lost


def travel(policy: str, world: str, seed: int, kinematics: str, **parameters: bool) -> tuple[Trip, Drive]:
    """An episode, and what it was driven with."""
    env = gym.make(f"BugGym/{world}-v0", overrides={"robot.kinematics": kinematics, "time.limit": LIMIT})
    observation, info = env.reset(seed=seed)
    driver, state, trip = make_policy(policy, env, **parameters), None, Trip()
    places = [tuple(observation["pose"][:2])]
    while True:
        action, state = driver.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        places.append(tuple(observation["pose"][:2]))
        trip.way += math.dist(*places[-2:])
        trip.steps += trip.way >= SET_OUT
        contour = getattr(state[0], "contour", None)
        if contour is not None and len(places) > 2 and len(set(places[-3:])) == 3:
            before, now = (math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(places[-3:]))
            turn = contour.side * wrap(now - before)
            trip.turns.append((turn if abs(turn) > 0.05 else 0.0, math.dist(*places[-2:])))
        if terminated or truncated or state[0].verdict:
            trip.success = bool(info["is_success"])
            return trip, driver.sensors.drive


def pace(policy: str, world: str, worlds: int) -> str:
    """The share of the pace that is kept without and with rounding, in how many worlds, and what turning allows."""
    free = [travel(policy, world, seed, "holonomic")[0] for seed in range(worlds)]
    cells = []
    allowed = 0.0
    for rounds in (False, True):
        pairs = []
        for seed, one in enumerate(free):
            other, drive = travel(policy, world, seed, "differential", round_corners=rounds)
            if one.success and other.success and abs(other.way / one.way - 1.0) < 0.25:
                pairs.append((one, other))
                allowed += rounds * (one.steps * drive.step + one.lost_to_turning(drive))
        kept = sum(one.steps for one, _ in pairs)
        cells.append(f"{kept / sum(other.steps for _, other in pairs):.2f} ({len(pairs)})" if pairs else "-")
    cells.append(f"{kept * drive.step / allowed:.2f}" if allowed else "-")
    return " | ".join(cells)


parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--worlds", type=int, default=12, help="worlds of each family")
parser.add_argument("--policies", default="bug1,bug2,alg1,com1,rev3,dist_bug,tangent_bug")
arguments = parser.parse_args()
for policy in arguments.policies.split(","):
    print(f"| {policy} | {' | '.join(pace(policy, world, arguments.worlds) for world in FAMILIES)} |", flush=True)
