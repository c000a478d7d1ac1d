"""How a row is laid out: the codes in it, its named arrays, and what the records that describe it hold."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Ranges = npt.NDArray[np.float32]
Flags = npt.NDArray[np.bool_]
Record = Any  # of SPEC or FIELD; numba reads its fields as attributes

# Of the two ways to say what most worlds have, None is the one for which less is compiled: numba leaves out what stands
# behind `is not None`.
Footprint = Floats | None
"""Circles x, y, radius (C, 3) of a robot's body; None: one robot, a disc about its origin."""
Regions = Floats | None
"""Weighted regions, as `ground` reads them; None: there are none."""


RUNNING, SUCCESS, COLLISION, TIMEOUT, ENDED = 0, 1, 2, 3, 4
HOLONOMIC, DIFFERENTIAL, ACKERMANN = 0, 1, 2
STILL, BOUNCE, WAYPOINTS, RANDOM_WALK, CROWD, EVADE, REPLAY = 0, 1, 2, 3, 4, 5, 6
TERMS = 6  # progress, goal, collision, step, clearance, smoothness
BORDER = -1  # polygon number of the border's wall segments
MAX_VERTICES = 7  # of a polygon made by place_field
TERRAIN_HEADINGS, TERRAIN_RINGS, TERRAIN_STEP = 32, 16, 0.25  # samples of the ground: bearings, and distances [m]

# Streams of the counter-based random numbers: one for each use, so that none shares numbers with another.
STREAM_WORLD, STREAM_RANGES, STREAM_ODOMETRY, STREAM_WALK, STREAM_POLICY = 1, 2, 3, 4, 5
STREAM_CROWD, STREAM_SIDESTEP, STREAM_EVADE, STREAM_DRAWS = 6, 7, 8, 9

# The named arrays of a row in the order in which they lie there: an array has so many numbers for each of a count of
# the world. To add one, add its line; `record.SPEC`, World and `places` take it from here.
FLOAT_ARRAYS: dict[str, tuple[int, str]] = {
    "time": (1, "row"),  # since the start of the episode [s]
    "fastest": (1, "row"),  # greatest speed of a body [m/s]
    "closing": (1, "row"),  # how much nearer to a robot any body may have come since the start of the episode [m]
    "listed_until": (1, "row"),  # `closing` up to which the lists of near bodies hold
    "listed_reach": (1, "row"),  # from a robot's centre to a body's edge [m]: so far they have all
    "next_event": (1, "row"),  # of a listed body [s]
    "listed_turn": (1, "row"),  # when listed bodies last met events, or were listed [s]
    "pose": (3, "robots"),  # x, y [m], heading [rad]
    "velocity": (2, "robots"),  # of the body [m/s, rad/s or m/s]
    "next_pose": (3, "robots"),  # where the step would end without a contact
    "odometry": (3, "robots"),  # the robot's own estimate, in the frame of the start
    "origin": (3, "robots"),  # pose at the start
    "command": (2, "robots"),  # the last action
    "goal_distance": (1, "robots"),  # [m]
    "path_length": (1, "robots"),  # [m]
    "clearance": (1, "robots"),  # least of the last step [m]
    "min_clearance": (1, "robots"),  # least of the episode [m]
    "reward": (1, "robots"),
    "terms": (TERMS, "robots"),  # of the reward
    "seen": (2, "robots"),  # where the robots were when `closing` was last told [m]
    "goal_place": (2, "robots"),  # of each robot's own [m]
    "goal_way": (2, "robots"),  # of it in this step [m]
    "near": (5, "listed"),  # the bodies near a robot, in blocks of eight: line_x, line_y, body_vx, body_vy, body_radius
    "near_event": (1, "listed"),
    "body_x": (1, "bodies"),  # place [m], see `motion` for when
    "body_y": (1, "bodies"),
    "line_x": (1, "bodies"),  # where it would have been at time 0, had it always gone as it goes now [m]
    "line_y": (1, "bodies"),
    "body_wake": (1, "bodies"),  # `closing` at which it may come near
    "body_vx": (1, "bodies"),  # velocity [m/s]
    "body_vy": (1, "bodies"),
    "body_radius": (1, "bodies"),  # of the disc, or of one that holds the polygon [m]
    "body_event": (1, "bodies"),  # when its velocity changes next [s]
    "body_quiet": (1, "bodies"),  # until when one whose first event is not planned has none [s]; -1: nobody knows
    "body_turned": (1, "bodies"),  # end of the last step in which it changed [s]; -1: not yet
    "last_x": (1, "bodies"),  # place at the start of that step [m]
    "last_y": (1, "bodies"),
    "body_nx": (1, "bodies"),  # normal of the reflection that is due; 0, 0: another event
    "body_ny": (1, "bodies"),
    "body_speed": (1, "bodies"),  # greatest [m/s]
    "leg_min": (1, "bodies"),  # shortest and longest time between two headings of a random walker [s]
    "leg_max": (1, "bodies"),
    "way_x": (1, "ways"),  # way-points, goals and records, body after body [m]
    "way_y": (1, "ways"),
    "way_time": (1, "ways"),  # of a record [s]
    "corner": (2, "walls"),  # x, y where each wall begins [m]; relative to the body's place where it moves
    "body_goal_x": (1, "lookers"),  # where it is going [m]
    "body_goal_y": (1, "lookers"),
    "body_patience": (1, "lookers"),  # when it gives its goal up [s]
    "body_foresight": (1, "lookers"),  # how far ahead it avoids [s], or how far an evader sees [m]
    "body_calm": (1, "lookers"),  # speed of an evader that sees no robot [m/s]
    "pending": (2, "delayed"),  # actions that have yet to act, robot after robot, each where its step falls in the ring
}
INT_ARRAYS: dict[str, tuple[int, str]] = {
    "seed": (1, "row"),
    "episode": (1, "row"),  # number of the episode of this seed
    "steps": (1, "row"),  # since the start of the episode
    "disc_count": (1, "row"),  # how many of them count; moving ones come first, here and below
    "moving_disc_count": (1, "row"),
    "polygon_count": (1, "row"),
    "moving_polygon_count": (1, "row"),
    "wall_count": (1, "row"),
    "moving_wall_count": (1, "row"),
    "steered_count": (1, "row"),  # bodies that look before each step
    "near_discs": (1, "row"),  # how many are listed
    "near_polygons": (1, "row"),
    "moving_goals": (1, "row"),
    "next_body": (1, "row"),  # whose event `next_event` is
    "border_first": (1, "row"),  # where its walls begin
    "border_walls": (1, "row"),
    "outcome": (1, "robots"),  # RUNNING and its neighbours
    "goal_body": (1, "robots"),  # number of the body that is the robot's goal
    "near_number": (1, "listed"),  # of the disc or polygon
    "near_walls": (1, "listed"),  # of the polygon: see `neighbours.ListedWalls`
    "body_law": (1, "bodies"),  # STILL and its neighbours
    "body_leg": (1, "bodies"),  # how many headings or goals it has drawn
    "way_first": (1, "bodies"),  # where its way-points begin
    "way_count": (1, "bodies"),
    "way_next": (1, "bodies"),
    "way_loops": (1, "bodies"),
    "polygon_first": (1, "polygons"),  # where its walls begin
    "polygon_walls": (1, "polygons"),
    "polygon_side": (1, "polygons"),  # 1 or -1: on which side of its walls the inside lies
    "wall_next": (1, "walls"),  # number of the wall that begins where it ends
}
ALIGNED = 16  # rows and their corners begin at a multiple of so many: processors fetch lines of 64 bytes in pairs


def places(table: dict[str, tuple[int, str]], counts: dict[str, int]) -> dict[str, tuple[int, int]]:
    """Where each array of a table begins, and its size, in a row with these counts."""
    result = {}
    begin = 0
    for name, (numbers, count) in table.items():
        if name in ("corner", "near"):
            begin = rounded_up(begin)
        size = numbers * counts[count]
        result[name] = (begin, size)
        begin += size
    return result


def rounded_up(count: int) -> int:
    """The next multiple of ALIGNED."""
    return -(-count // ALIGNED) * ALIGNED


# What the record of a row (SPEC) holds beside the places of arrays and of the observation's fields.
COUNTS = (
    "robots",
    "disc_room",
    "polygon_room",
    "wall_room",
    "discs",
    "polygons",
    "goals",
    "bodies",
    "walls",
    "ways",
    "beams",
    "footprint",
    "width",
)
INT_CONSTANTS = ("kinematics", "arcs", "limit_steps", "first_ends", "goal_by_odometry", "regions", "latency")
FLOAT_CONSTANTS = (
    "step",
    "max_speed",
    "max_reverse",
    "max_turn_rate",
    "max_steering",
    "wheelbase",
    "max_acceleration",
    "full_speed",
    "full_reverse",
    "full_turn_rate",
    "full_steering",
    "body_reach",
    "goal_radius",
    "reach",
    "no_return",
    "min_range",
    "first_angle",
    "angle_step",
    "range_noise",
    "dropout",
    "translation_noise",
    "rotation_noise",
    "translation_bias",
    "rotation_bias",
    "clearance_scale",
    "clearance_reach",
    "span",
    "margin",
    "largest_factor",
    "weight_progress",
    "weight_goal",
    "weight_collision",
    "weight_step",
    "weight_clearance",
    "weight_smoothness",
)

# What `place_fields` needs to know of a `field` scenario.
FIELD = np.dtype(
    [
        (name, np.int64)
        for name in (
            "discs",
            "moving_discs",
            "pedestrians",
            "polygons",
            "moving_polygons",
            "squares",
            "laws",
            "target_law",
        )
    ]
    + [
        (name, np.float64)
        for name in (
            "xmin",
            "ymin",
            "xmax",
            "ymax",
            "size_min",
            "size_max",
            "speed_min",
            "speed_max",
            "gap",
            "separation",
            "start_clearance",
            "goal_clearance",
            "start_edge",
            "goal_edge",
            "start_xmin",
            "start_ymin",
            "start_xmax",
            "start_ymax",
            "start_heading",
            "goal_xmin",
            "goal_ymin",
            "goal_xmax",
            "goal_ymax",
            "target_speed",
            "target_vx",
            "target_vy",
            "leg_min",
            "leg_max",
            "pedestrian_radius",
            "pedestrian_speed_min",
            "pedestrian_speed_max",
            "horizon",
            "target_foresight",
            "target_calm",
        )
    ]
)
BOUNCE_BIT, WALK_BIT, CROWD_BIT = 1, 2, 4  # of FIELD.laws
