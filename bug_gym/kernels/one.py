"""The step of one world with one robot, for a face of one: numbers in, numbers out, no array changes hands."""

from __future__ import annotations

from bug_gym.compiling import kernel
from bug_gym.kernels.addresses import arguments_at, call_at
from bug_gym.kernels.layout import Footprint, Regions
from bug_gym.kernels.step import STEP

Numbers = tuple[int, float, float, float, float, float, float, float, float, float, float, float]


@kernel
def step_one(table: int, first: float, second: float, footprint: Footprint, regions: Regions) -> Numbers:
    """Do what a STEP of `run_rows` does in a world of one robot, whose `address_table` lies at `table`.

    Returns its outcome, reward, path_length, time, min_clearance, goal_distance and the six reward terms; what it observes
    is written where `run_rows` writes it.
    """
    handed = arguments_at(table, STEP, footprint, regions)
    floats, ints, spec, actions = handed[1], handed[2], handed[4], handed[10]
    actions[0, 0, 0] = first
    actions[0, 0, 1] = second
    call_at(table, handed)
    f, k, s = floats[0], ints[0], spec[0]
    return (
        k[s.outcome],
        f[s.reward],
        f[s.path_length],
        f[s.time],
        f[s.min_clearance],
        f[s.goal_distance],
        f[s.terms],
        f[s.terms + 1],
        f[s.terms + 2],
        f[s.terms + 3],
        f[s.terms + 4],
        f[s.terms + 5],
    )
