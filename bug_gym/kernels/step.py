"""The step of a row, from the actions to what the robots see; how rows begin, start again and are read.

What robots see is most of what is compiled, so all that makes them look anew goes through one kernel, `run_rows`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bug_gym.compiling import called, inlined, is_ready, kernel
from bug_gym.kernels.contact import settle_robots
from bug_gym.kernels.drive import apply_motion, clear_pending, drive, exchange_pending
from bug_gym.kernels.geometry import clip, length
from bug_gym.kernels.laws import begin_steered, steer_bodies
from bug_gym.kernels.layout import (
    COLLISION,
    CROWD,
    ENDED,
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
from bug_gym.kernels.motion import (
    UNPLANNED,
    begin_motion,
    bring_forward,
    follow_goal,
    move_goals,
    set_line,
)
from bug_gym.kernels.neighbours import (
    BLOCK,
    COLUMNS,
    in_eights,
    keep_list,
    list_from_here,
    listed_walls,
    move_list,
    move_lookers,
    near_bodies,
)
from bug_gym.kernels.observation import observe
from bug_gym.kernels.rays import find_near_discs
from bug_gym.kernels.sensing import clearance_at, look_from
from bug_gym.kernels.vectors import LANES, NEAR, prefetch


def is_compiled(types: tuple[Any, ...]) -> bool:
    """Whether `run_rows` is ready for arguments of these types: in this process, or kept on disk by numba's cache."""
    return is_ready(run_rows, types)


@inlined
def judge(f: Floats, k: Integers, s: Record, r: int, verdict: int, first: float, second: float) -> None:
    """Outcome, reward terms (in the order of TERMS) and their weighted sum for robot r after its motion."""
    distance = length(f[s.goal_place + 2 * r] - f[s.pose + 3 * r], f[s.goal_place + 2 * r + 1] - f[s.pose + 3 * r + 1])
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
    columns: Floats,
    scratch: Floats,
    scratch_int: Integers,
    actions: Floats,
) -> None:
    """One step of one world, but for what the robots see; `actions` (R, 2) in [-1, 1]."""
    k[s.steps] += 1
    start = f[s.time]
    end = k[s.steps] * s.step
    f[s.time] = end
    if k[s.steered_count] > 0:
        move_lookers(f, k, s, start, end)
    if k[s.moving_goals] > 0:
        move_goals(f, k, s, end)
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
    if f[s.listed_until] < math.inf or f[s.next_event] <= end:
        keep_list(f, k, s, end, columns)
    near = near_bodies(f, k, s, columns)
    stops, verdicts = scratch[:robots], scratch_int[:robots]
    settle_robots(f, k, s, footprint, near, stops, verdicts, scratch_int[robots:])
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


# Many rows don't stay in the processor's cache, and which walls a step needs is known only when the list of the near
# polygons has come, whose length comes with the row. So a row is asked for two steps before its own; one of many walls
# three, what it lists two, and its near walls one.
MANY_WALLS, MANY_ROWS = 128, 16
FETCHED = 4  # blocks of the list, or walls of the border; the processor has seen by then that it goes on


@inlined
def fetch_row(f: Floats, k: Integers, s: Record) -> None:
    """Asks for what a step reads of every row."""
    for line in range(0, min(s.near + FETCHED * BLOCK, s.near_event), 8):
        prefetch(f, line)
    for line in range(0, s.near_number, 8):
        prefetch(k, line)
    for line in range(s.corner, s.corner + 2 * FETCHED, 8):  # of the border, where there are no polygons
        prefetch(f, line)


@called
def fetch_next_body(f: Floats, k: Integers, s: Record) -> None:
    """Asks for what is kept of the body whose event comes next, in as many places as there are arrays of bodies."""
    b = k[s.next_body]
    for first in range(s.body_x, s.leg_min, s.bodies):
        prefetch(f, first + b)
    for first in range(s.body_law, s.polygon_first, s.bodies):
        prefetch(k, first + b)
    for line in range(s.near_event, s.body_x, 8):
        prefetch(f, line)


@called
def fetch_polygons(f: Floats, k: Integers, s: Record) -> None:
    """Asks for the listed polygons of a row whose counts have come."""
    listed = in_eights(k[s.near_polygons])
    block = s.near + s.disc_room // LANES * BLOCK
    for line in range(block, block + listed // LANES * BLOCK, 8):
        prefetch(f, line)
    walls = s.near_walls + s.disc_room
    for line in range(walls, walls + listed, 8):
        prefetch(k, line)


@called
def fetch_near_walls(f: Floats, k: Integers, s: Record, columns: Floats, index: Integers) -> None:
    """Asks for the walls of the border, and of the polygons near the first robot."""
    border = s.corner + 2 * k[s.border_first]
    for line in range(border, border + 2 * FETCHED, 8):
        prefetch(f, line)
    polygons = move_list(f, s, s.disc_room, k[s.near_polygons], f[s.time], columns)
    near = find_near_discs(polygons, f[s.pose], f[s.pose + 1], s.reach, index)
    for j in range(near):
        walls = listed_walls(k, s, np.uint64(index[np.uint64(NEAR) + j]))
        first = s.corner + 2 * walls.first
        for line in range(first, first + 2 * walls.total, 8):
            prefetch(f, line)


@called
def begin_robot(f: Floats, k: Integers, s: Record, footprint: Footprint, r: int) -> None:
    """Start the run of robot r at the pose that it has."""
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
    dx, dy = f[s.goal_place + 2 * r] - f[s.pose + 3 * r], f[s.goal_place + 2 * r + 1] - f[s.pose + 3 * r + 1]
    f[s.goal_distance + r] = length(dx, dy)
    f[s.clearance + r] = clearance_at(f, k, s, footprint, r)
    f[s.min_clearance + r] = f[s.clearance + r]


@called
def begin_world(f: Floats, k: Integers, s: Record, footprint: Footprint, columns: Floats) -> None:
    """Start the episode of a row whose obstacles, poses and goals have been placed, but for what the robots see.

    Bodies that look have begun before (`steer_rows`).
    """
    f[s.time] = 0.0
    k[s.steps] = 0
    fastest, steered = 0.0, 0
    for b in range(s.bodies):
        law = k[s.body_law + b]
        if law == STILL or (k[s.disc_count] <= b < s.discs):
            f[s.body_event + b] = math.inf
            continue
        fastest = max(fastest, f[s.body_speed + b])
        if law >= CROWD:
            steered += 1
            f[s.body_turned + b] = -1.0
            set_line(f, s, b, 0.0)
        else:
            f[s.body_event + b] = UNPLANNED
            f[s.body_quiet + b] = -1.0
    f[s.fastest] = fastest
    k[s.steered_count] = steered
    k[s.moving_goals] = 0
    for g in range(s.discs + s.polygons, s.discs + s.polygons + s.goals):
        k[s.moving_goals] += int(k[s.body_law + g] != STILL)
        if k[s.body_law + g] < CROWD:
            begin_motion(f, k, s, g)
    for r in range(s.robots):
        follow_goal(f, k, s, r)
        f[s.goal_way + 2 * r], f[s.goal_way + 2 * r + 1] = 0.0, 0.0
    for r in range(s.robots):
        begin_robot(f, k, s, footprint, r)
    list_from_here(f, k, s, columns)


@called
def bring_all_forward(f: Floats, k: Integers, s: Record) -> None:
    """Bring all bodies to now."""
    for b in range(s.discs + s.polygons):
        moves = b < k[s.moving_disc_count] or s.discs <= b < s.discs + k[s.moving_polygon_count]
        if moves and k[s.body_law + b] < CROWD:
            bring_forward(f, k, s, b, f[s.time])


@kernel
def locate_bodies(floats: Floats, ints: Integers, spec: Record) -> None:
    """Bring all bodies of all rows to now, for who reads where they are."""
    for n in range(len(floats)):
        bring_all_forward(floats[n], ints[n], spec[0])


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
        if spec.size > 1:
            s = spec[rows[i]]
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
        spec: one record of SPEC, or N.
        beams: as `rays.Beams`.
        footprint: the robots' body.
        regions: of the ground.
        scratch: working memory.
        scratch_int: likewise.
        actions: (n, R, 2), read only in a STEP.
        rows: numbers of the worlds.
    """
    s = spec[0]
    columns = scratch[scratch.size - 4 * s.wall_room - COLUMNS * (s.disc_room + s.polygon_room) :]
    many = rows.size >= MANY_ROWS
    many_walls = many and s.walls >= MANY_WALLS
    ahead = 3 if many_walls else 2
    for i in range(-ahead, rows.size):
        if many and i + ahead < rows.size:
            fetch_row(floats[rows[i + ahead]], ints[rows[i + ahead]], s)
        if many_walls and 0 <= i + 2 < rows.size:
            fetch_polygons(floats[rows[i + 2]], ints[rows[i + 2]], s)
        if many_walls and 0 <= i + 1 < rows.size:
            fetch_near_walls(floats[rows[i + 1]], ints[rows[i + 1]], s, columns, scratch_int)
        if many and 0 <= i + 1 < rows.size:
            g = floats[rows[i + 1]]
            if g[s.next_event] <= g[s.time] + s.step:
                fetch_next_body(g, ints[rows[i + 1]], s)
        if i < 0:
            continue
        n = rows[i]
        f, k = floats[n], ints[n]
        if spec.size > 1:
            s = spec[n]
        if task == STEP:
            step_row(f, k, s, footprint, regions, columns, scratch, scratch_int, actions[i])
        elif task == BEGIN:
            begin_world(f, k, s, footprint, columns)
        else:
            list_from_here(f, k, s, columns)
        if task != STEP:
            near_bodies(f, k, s, columns)
        for r in range(s.robots):
            look = look_from(f, s, beams, columns, scratch, scratch_int, r)
            observe(f, k, s, observation[n, r], look, footprint, regions)


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
        if spec.size > 1:
            s = spec[n]
        bring_all_forward(f, k, s)
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
    """Copy how the robots of the worlds `rows` (n,) are doing.

    `numbers` (STATUS + TERMS, at least n R) has those of a row's robots side by side, `outcome` is (n, R).
    """
    s = spec[0]
    for i in range(rows.size):
        f, k = floats[rows[i]], ints[rows[i]]
        for r in range(s.robots):
            at = s.robots * i + r
            outcome[i, r] = k[s.outcome + r]
            numbers[0, at] = f[s.reward + r]
            numbers[1, at] = f[s.path_length + r]
            numbers[2, at] = f[s.time]
            numbers[3, at] = f[s.min_clearance + r]
            numbers[4, at] = f[s.goal_distance + r]
            for term in range(TERMS):
                numbers[STATUS + term, at] = f[s.terms + TERMS * r + term]
