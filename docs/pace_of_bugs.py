"""How much of a holonomic robot's pace bugs keep on a differential one, with rounded corners and without.

Time of the holonomic robot over that of the differential one, of all worlds where both arrive by ways whose lengths differ by
less than a quarter; the first 0.3 m, with the turn that a differential robot begins with, do not count. Prints a table.

    python docs/pace_of_bugs.py --worlds 12
"""

import argparse
import math

import gymnasium as gym

from bug_gym.agents import make_policy

FAMILIES = ("Maze", "Rooms", "Static")
LIMIT = 1500.0
"""Of an episode [s]."""
SET_OUT = 0.3
"""Way from which on time counts [m]: by then it has turned."""


def drive(policy: str, world: str, seed: int, kinematics: str, **parameters: bool) -> tuple[bool, int, float]:
    """Whether an episode succeeds, its steps once it has set out, and its way [m]."""
    env = gym.make(f"BugGym/{world}-v0", overrides={"robot.kinematics": kinematics, "time.limit": LIMIT})
    observation, info = env.reset(seed=seed)
    driver, state, steps, way = make_policy(policy, env, **parameters), None, 0, 0.0
    place = observation["pose"][:2]
    while True:
        action, state = driver.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        way += math.dist(place, observation["pose"][:2])
        place = observation["pose"][:2]
        steps += way >= SET_OUT
        if terminated or truncated or state[0].verdict:
            return bool(info["is_success"]), steps, way


def pace(policy: str, world: str, worlds: int, *, rounds: bool) -> str:
    """The share of the pace that is kept, and in how many worlds it was measured."""
    steps = {"holonomic": 0, "differential": 0}
    used = 0
    for seed in range(worlds):
        one = drive(policy, world, seed, "holonomic")
        other = drive(policy, world, seed, "differential", round_corners=rounds)
        if one[0] and other[0] and abs(other[2] / one[2] - 1.0) < 0.25:
            used += 1
            steps["holonomic"] += one[1]
            steps["differential"] += other[1]
    return f"{steps['holonomic'] / steps['differential']:.2f} ({used})" if used else "-"


parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--worlds", type=int, default=12, help="worlds of each family")
parser.add_argument("--policies", default="bug1,bug2,alg1,rev3,dist_bug,tangent_bug")
arguments = parser.parse_args()
for policy in arguments.policies.split(","):
    shares = [pace(policy, world, arguments.worlds, rounds=rounds) for world in FAMILIES for rounds in (False, True)]
    print(f"| {policy} | {' | '.join(shares)} |", flush=True)
