"""The step of a row, from the actions to what the robots see; how rows begin, start again and are read.

What robots see is most of what is compiled, so all that makes them look anew goes through one kernel, `run_rows`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bug_gym.compiling import called, inlined, is_ready, kernel
from bug_gym.kernels.contact import find_near_polygons, settle_robots
from bug_gym.kernels.drive import apply_motion, clear_pending, drive, exchange_pending
from bug_gym.kernels.geometry import clip, length
from bug_gym.kernels.laws import begin_steered, steer_bodies
from bug_gym.kernels.layout import (
    COLLISION,
    CROWD,
    ENDED,
    RANDOM_WALK,
    RUNNING,
    STILL,
    SUCCESS,
    TERMS,
    TIMEOUT,
    Floats,
    Footprint,
    Integers,
    Ranges,
    Record,
    Regions,
)
from bug_gym.kernels.motion import move_bodies, plan_body, take_heading
from bug_gym.kernels.sensing import clearance_at, observe
from bug_gym.kernels.vectors import NEAR, prefetch


def is_compiled(types: tuple[Any, ...]) -> bool:
    """Whether `run_rows` is ready for arguments of these types: in this process, or kept on disk by numba's cache."""
    return is_ready(run_rows, types)


@inlined
def judge(f: Floats, k: Integers, s: Record, r: int, verdict: int, first: float, second: float) -> None:
    """Outcome, reward terms (in the order of TERMS) and their weighted sum for robot r after its motion."""
    g = k[s.goal_body + r]
    distance = length(f[s.body_x + g] - f[s.pose + 3 * r], f[s.body_y + g] - f[s.pose + 3 * r + 1])
    clearance = max(f[s.clearance + r], 0.0)
    f[s.min_clearance + r] = min(f[s.min_clearance + r], clearance)
    if verdict == RUNNING and k[s.steps] >= s.limit_steps:
        verdict = TIMEOUT
    k[s.outcome + r] = verdict
    if verdict in (SUCCESS, COLLISION):  # out of time it would go on, and what learns from it needs that
        f[s.velocity + 2 * r] = 0.0
        f[s.velocity + 2 * r + 1] = 0.0
    t = s.terms + TERMS * r
    d1, d2 = first - f[s.command + 2 * r], second - f[s.command + 2 * r + 1]
    f[t] = s.weight_progress * (f[s.goal_distance + r] - distance)
    f[t + 1] = s.weight_goal if verdict == SUCCESS else 0.0
    f[t + 2] = s.weight_collision if verdict == COLLISION else 0.0
    f[t + 3] = s.weight_step
    f[t + 4] = s.weight_clearance * max(0.0, 1.0 - clearance / s.clearance_scale)
    f[t + 5] = s.weight_smoothness * (d1 * d1 + d2 * d2)
    f[s.reward + r] = f[t] + f[t + 1] + f[t + 2] + f[t + 3] + f[t + 4] + f[t + 5]
    f[s.goal_distance + r] = distance
    f[s.command + 2 * r] = first
    f[s.command + 2 * r + 1] = second


@inlined
def step_row(
    f: Floats,
    k: Integers,
    s: Record,
    footprint: Footprint,
    regions: Regions,
    scratch: Floats,
    scratch_int: Integers,
    actions: Floats,
) -> None:
    """One step of one world, but for what the robots see; `actions` (R, 2) in [-1, 1]."""
    k[s.steps] += 1
    start = f[s.time]
    end = k[s.steps] * s.step
    f[s.time] = end
    move_bodies(f, k, s, start, end)
    robots = s.robots
    for r in range(robots):
        if k[s.outcome + r] == RUNNING:
            first, second = clip(actions[r, 0], -1.0, 1.0), clip(actions[r, 1], -1.0, 1.0)
            if s.latency > 0:
                first, second = exchange_pending(f, k, s, r, first, second)
            drive(f, s, regions, r, first, second)
        else:
            for i in range(3):
                f[s.next_pose + 3 * r + i] = f[s.pose + 3 * r + i]
    stops, verdicts = scratch[:robots], scratch_int[:robots]
    settle_robots(f, k, s, footprint, stops, verdicts, scratch_int[robots:])
    for r in range(robots):
        if k[s.outcome + r] == RUNNING:
            apply_motion(f, k, s, r, stops[r])
            judge(f, k, s, r, verdicts[r], clip(actions[r, 0], -1.0, 1.0), clip(actions[r, 1], -1.0, 1.0))
        else:
            f[s.reward + r] = 0.0
            for i in range(TERMS):
                f[s.terms + TERMS * r + i] = 0.0
    if s.first_ends:
        end_mission(k, s)


@called
def end_mission(k: Integers, s: Record) -> None:
    """Where one robot has arrived, the runs of the others end with it."""
    has_arrived = False
    for r in range(s.robots):
        has_arrived |= k[s.outcome + r] == SUCCESS
    for r in range(s.robots):
        if has_arrived and k[s.outcome + r] == RUNNING:
            k[s.outcome + r] = ENDED


# Rows of many walls don't stay in the processor's cache, and which walls a step needs is known only when the places of
# the obstacles have come. So the places of the row after next are asked for before a row is worked on, and the near
# walls of the next one.
MANY_WALLS, MANY_ROWS = 128, 16


@inlined
def fetch_row(f: Floats, k: Integers, s: Record) -> None:
    """Asks for what a step reads of every row."""
    for line in range(0, s.body_turned, 8):
        prefetch(f, line)
    for line in range(0, s.goal_body, 8):
        prefetch(k, line)
    for line in range(s.polygon_first, s.border_first, 8):
        prefetch(k, line)


@inlined
def fetch_near_walls(f: Floats, k: Integers, s: Record, index: Integers) -> None:
    """Asks for the walls of the polygons near the first robot."""
    near = find_near_polygons(f, s, k[s.polygon_count], f[s.pose], f[s.pose + 1], s.reach, index)
    for j in range(near):
        number = index[np.uint64(NEAR) + j]
        first = s.wall + 4 * k[s.polygon_first + number]
        for line in range(first, first + 4 * k[s.polygon_walls + number], 8):
            prefetch(f, line)


@called
def begin_robot(f: Floats, k: Integers, s: Record, footprint: Footprint, r: int) -> None:
    """Start the run of robot r at the pose that it has."""
    g = k[s.goal_body + r]
    k[s.outcome + r] = RUNNING
    for i in range(3):
        f[s.origin + 3 * r + i] = f[s.pose + 3 * r + i]
        f[s.odometry + 3 * r + i] = 0.0
    for i in range(2):
        f[s.velocity + 2 * r + i] = 0.0
        f[s.command + 2 * r + i] = 0.0
    f[s.path_length + r] = 0.0
    f[s.reward + r] = 0.0
    for i in range(TERMS):
        f[s.terms + TERMS * r + i] = 0.0
    clear_pending(f, s, r)
    f[s.goal_distance + r] = length(f[s.body_x + g] - f[s.pose + 3 * r], f[s.body_y + g] - f[s.pose + 3 * r + 1])
    f[s.clearance + r] = clearance_at(f, k, s, footprint, r)
    f[s.min_clearance + r] = f[s.clearance + r]


@called
def begin_world(f: Floats, k: Integers, s: Record, footprint: Footprint) -> None:
    """Start the episode of a row whose obstacles, poses and goals have been placed, but for what the robots see.

    Bodies that look have begun before (`steer_rows`).
    """
    f[s.time] = 0.0
    k[s.steps] = 0
    fastest, steered = 0.0, 0
    for b in range(s.bodies):
        f[s.body_turned + b] = -1.0
        law = k[s.body_law + b]
        if law == STILL or (k[s.disc_count] <= b < s.discs):
            f[s.body_event + b] = math.inf
            continue
        fastest = max(fastest, f[s.body_speed + b])
        if law >= CROWD:
            steered += 1
            continue
        if law == RANDOM_WALK:
            f[s.body_event + b] = take_heading(f, k, s, b)
        plan_body(f, k, s, b, 0.0)
    f[s.fastest] = fastest
    k[s.steered_count] = steered
    for r in range(s.robots):
        begin_robot(f, k, s, footprint, r)


STEP, BEGIN, LOOK = 0, 1, 2  # what is done with a row before its robots look


@kernel
def steer_rows(
    task: int,
    floats: Floats,
    ints: Integers,
    spec: Record,
    footprint: Floats,
    scratch: Floats,
    scratch_int: Integers,
    rows: Integers,
) -> None:
    """What the bodies that look do first, when the worlds `rows` (n,) STEP or BEGIN: they take their velocities.

    Apart from `run_rows`, so that only who has such bodies waits until this is compiled.
    """
    s = spec[0]
    for i in range(rows.size):
        f, k = floats[rows[i]], ints[rows[i]]
        if task == BEGIN:
            for b in range(s.bodies):
                if k[s.body_law + b] >= CROWD and not k[s.disc_count] <= b < s.discs:
                    begin_steered(f, k, s, b)
        elif k[s.steered_count] > 0:
            steer_bodies(f, k, s, footprint, f[s.time], (k[s.steps] + 1) * s.step, scratch, scratch_int)


@kernel
def run_rows(
    task: int,
    floats: Floats,
    ints: Integers,
    observation: Ranges,
    spec: Record,
    beams: Floats,
    footprint: Footprint,
    regions: Regions,
    scratch: Floats,
    scratch_int: Integers,
    actions: Floats,
    rows: Integers,
) -> None:
    """Have the worlds `rows` (n,) do a task, after which their robots look.

    Everything but rows and actions is (N, ...) and changed in place.

    Args:
        task: STEP with the actions, BEGIN the episodes, or LOOK only.
        floats: the rows.
        ints: the rows.
        observation: (N, R, D), filled.
        spec: one record of SPEC.
        beams: as `rays.Beams`.
        footprint: the robots' body.
        regions: of the ground.
        scratch: working memory.
        scratch_int: likewise.
        actions: (n, R, 2), read only in a STEP.
        rows: numbers of the worlds.
    """
    s = spec[0]
    ahead = s.walls >= MANY_WALLS and rows.size >= MANY_ROWS
    for i in range(-2, rows.size):
        if ahead and i + 2 < rows.size:
            fetch_row(floats[rows[i + 2]], ints[rows[i + 2]], s)
        if ahead and 0 <= i + 1 < rows.size:
            fetch_near_walls(floats[rows[i + 1]], ints[rows[i + 1]], s, scratch_int)
        if i < 0:
            continue
        n = rows[i]
        f, k = floats[n], ints[n]
        if task == STEP:
            step_row(f, k, s, footprint, regions, scratch, scratch_int, actions[i])
        elif task == BEGIN:
            begin_world(f, k, s, footprint)
        for r in range(s.robots):
            observe(f, k, observation[n, r], s, beams, footprint, regions, scratch, scratch_int, r)


@kernel
def restart_robots(
    floats: Floats, ints: Integers, spec: Record, footprint: Footprint, starts: Floats, rows: Integers
) -> None:
    """Put robots of the worlds `rows` (n,) whose runs have ended back to `starts` (n, R, 3), where those are free.

    They have yet to LOOK.
    """
    s = spec[0]
    for i in range(rows.size):
        n = rows[i]
        f, k = floats[n], ints[n]
        for r in range(s.robots):
            if k[s.outcome + r] == RUNNING:
                continue
            x, y, heading = f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2]
            for j in range(3):
                f[s.pose + 3 * r + j] = starts[i, r, j]
            if clearance_at(f, k, s, footprint, r) > 0.0:
                begin_robot(f, k, s, footprint, r)
            else:
                f[s.pose + 3 * r], f[s.pose + 3 * r + 1], f[s.pose + 3 * r + 2] = x, y, heading


STATUS = 5  # numbers of a robot besides its reward terms: reward, path_length, time, min_clearance, goal_distance


@kernel
def read_status(
    floats: Floats, ints: Integers, spec: Record, rows: Integers, numbers: Floats, outcome: Integers
) -> None:
    """Copy how the robots of the worlds `rows` (n,) are doing: `numbers` (STATUS + TERMS, n, R), `outcome` (n, R)."""
    s = spec[0]
    for i in range(rows.size):
        f, k = floats[rows[i]], ints[rows[i]]
        for r in range(s.robots):
            outcome[i, r] = k[s.outcome + r]
            numbers[0, i, r] = f[s.reward + r]
            numbers[1, i, r] = f[s.path_length + r]
            numbers[2, i, r] = f[s.time]
            numbers[3, i, r] = f[s.min_clearance + r]
            numbers[4, i, r] = f[s.goal_distance + r]
            for term in range(TERMS):
                numbers[STATUS + term, i, r] = f[s.terms + TERMS * r + term]
