"""The step of one world with one robot, for a face of one: numbers in, numbers out, no array changes hands."""

from __future__ import annotations

from bug_gym.compiling import kernel
from bug_gym.kernels.addresses import arrays_at, call_at

Numbers = tuple[int, float, float, float, float, float, float, float, float, float, float, float]


@kernel
def step_one(table: int, first: float, second: float) -> Numbers:
    """Do what `step_rows` does in a world of one robot, whose arrays stand in the `address_table` that lies at `table`.

    Returns its outcome, reward, path_length, time, min_clearance, goal_distance and the six reward terms; what it observes
    is written where `step_rows` writes it.
    """
    arrays = arrays_at(table)
    floats, ints, spec, actions = arrays[0], arrays[1], arrays[3], arrays[9]
    actions[0, 0, 0] = first
    actions[0, 0, 1] = second
    call_at(table, arrays)
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
