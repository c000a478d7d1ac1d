"""How a row is laid out: the codes in it, its named arrays, and the records that describe it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Ranges = npt.NDArray[np.float32]
Flags = npt.NDArray[np.bool_]
Record = Any  # of SPEC or FIELD; numba reads its fields as attributes


RUNNING, SUCCESS, COLLISION, TIMEOUT = 0, 1, 2, 3
HOLONOMIC, DIFFERENTIAL = 0, 1
STILL, BOUNCE, WAYPOINTS, RANDOM_WALK, CROWD, EVADE, REPLAY = 0, 1, 2, 3, 4, 5, 6
TERMS = 6  # progress, goal, collision, step, clearance, smoothness
BORDER = -1  # polygon number of the border's wall segments
MAX_VERTICES = 7  # of a polygon made by place_field
TERRAIN_HEADINGS, TERRAIN_RINGS, TERRAIN_STEP = 32, 16, 0.25  # samples of the ground: bearings, and distances [m]

# Streams of the counter-based random numbers: one for each use, so that none shares numbers with another.
STREAM_WORLD, STREAM_RANGES, STREAM_ODOMETRY, STREAM_WALK, STREAM_POLICY = 1, 2, 3, 4, 5
STREAM_CROWD, STREAM_SIDESTEP, STREAM_EVADE = 6, 7, 8

# Arrays with one number a body in worlds where some look before each step, and none in the others.
STEERED_ARRAYS = ("body_goal_x", "body_goal_y", "body_patience", "body_foresight", "body_calm")

# The record that describes a row. Fields named like an array of the row hold the index where that array begins.
FLOAT_ARRAYS = (
    "time",
    "fastest",
    "pose",
    "velocity",
    "next_pose",
    "odometry",
    "origin",
    "command",
    "goal_distance",
    "path_length",
    "clearance",
    "min_clearance",
    "reward",
    "terms",
    "body_x",
    "body_y",
    "body_vx",
    "body_vy",
    "body_radius",
    "body_event",
    "body_turned",
    "last_x",
    "last_y",
    "body_nx",
    "body_ny",
    "body_speed",
    "leg_min",
    "leg_max",
    "way_x",
    "way_y",
    "way_time",
    "wall",
    *STEERED_ARRAYS,
)
INT_ARRAYS = (
    "seed",
    "episode",
    "steps",
    "disc_count",
    "moving_disc_count",
    "polygon_count",
    "moving_polygon_count",
    "wall_count",
    "moving_wall_count",
    "steered_count",
    "outcome",
    "goal_body",
    "body_law",
    "body_leg",
    "way_first",
    "way_count",
    "way_next",
    "way_loops",
    "polygon_first",
    "polygon_walls",
    "polygon_side",
    "border_first",
    "border_walls",
)
COUNTS = ("robots", "discs", "polygons", "goals", "bodies", "walls", "ways", "beams", "footprint", "width")
INT_CONSTANTS = ("kinematics", "limit_steps", "goal_by_odometry", "regions")
FLOAT_CONSTANTS = (
    "step",
    "max_speed",
    "max_reverse",
    "max_turn_rate",
    "max_acceleration",
    "body_reach",
    "goal_radius",
    "reach",
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
    "span",
    "weight_progress",
    "weight_goal",
    "weight_collision",
    "weight_step",
    "weight_clearance",
    "weight_smoothness",
)
SPEC = np.dtype(
    [(name, np.int64) for name in FLOAT_ARRAYS + INT_ARRAYS + COUNTS + INT_CONSTANTS]
    + [(name, np.float64) for name in FLOAT_CONSTANTS]
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
