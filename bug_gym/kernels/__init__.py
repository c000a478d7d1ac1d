"""The compiled world, by stage; here is what Python calls of it.

A kernel works on one row (one world) at a time. A row is two flat arrays, `floats` (Wf,) float64 and `ints` (Wi,)
int64; `spec` (one record of SPEC) says where each named array begins in them and holds the constants of the scenario.
World index first, always; a row never reads another row, so results depend neither on the batch nor on the threads.
Inside kernels f and k are a row's floats and ints, s is its record, r a robot, b a body, w a wall.

    layout  geometry  vectors                          what lies where; plane geometry; LLVM written by hand
    randomness  chords  ground  rays  noise  free_way  the scan and its noise; contact; regions; the way among points
    levers  arcs  stopping  scan_then                  what a robot is told; arcs; whether it can stop; the scan to come
    drive  body  motion  placing                       robots; circles that swing; still laws; worlds of family `field`
    generator  free_place  rooms                       NumPy's generator; places where there is room; walls of `rooms`
    neighbours                                         the bodies near the robots, side by side
    contact  avoidance                                 who touches what, when; half planes of velocities
    sensing  laws                                      the scan and the clearance; bodies that look
    observation  record                                the fields of the observation; the record of a row
    step                                               the sentence: run_rows, steer_rows, restart_robots, read_status
    addresses  one                                     arguments as addresses; the step of one world with one robot

Each line imports from those above it.

No fastmath: the same arithmetic in a batch of one and of thousands, bit for bit.
"""

from bug_gym.kernels.addresses import HAS_ADDRESSES, address_table
from bug_gym.kernels.arcs import free_turn, pursue, round_corners
from bug_gym.kernels.avoidance import steering_floats
from bug_gym.kernels.chords import point_wall_distance
from bug_gym.kernels.free_way import (
    bridged_points,
    free_distance,
    free_distances,
    nearest_point,
    nearest_within,
    read_scans,
    scan_points,
)
from bug_gym.kernels.ground import REGION_HEAD
from bug_gym.kernels.laws import AWAY, SAME_INSTANT
from bug_gym.kernels.layout import (
    ACKERMANN,
    ALIGNED,
    BORDER,
    BOUNCE,
    BOUNCE_BIT,
    COLLISION,
    CROWD,
    CROWD_BIT,
    DIFFERENTIAL,
    ENDED,
    EVADE,
    FIELD,
    FLOAT_ARRAYS,
    HOLONOMIC,
    INT_ARRAYS,
    MAX_VERTICES,
    RANDOM_WALK,
    REPLAY,
    RUNNING,
    STILL,
    STREAM_DRAWS,
    STREAM_POLICY,
    STREAM_WORLD,
    SUCCESS,
    TERMS,
    TERRAIN_HEADINGS,
    TERRAIN_RINGS,
    TIMEOUT,
    WALK_BIT,
    WAYPOINTS,
    Flags,
    Floats,
    Integers,
    Ranges,
    Record,
    places,
    rounded_up,
)
from bug_gym.kernels.levers import levers, speed_lever, turn_rate, turning
from bug_gym.kernels.manoeuvre import best_arc, free_arc
from bug_gym.kernels.neighbours import COLUMNS, list_room
from bug_gym.kernels.observation import OBSERVATION, observation_places
from bug_gym.kernels.one import step_one
from bug_gym.kernels.placing import ATTEMPTS, PLACED, place_fields
from bug_gym.kernels.randomness import hash64, uniform
from bug_gym.kernels.rays import beam_table, scratch_floats, scratch_integers
from bug_gym.kernels.record import SPEC
from bug_gym.kernels.scan_then import scan_then
from bug_gym.kernels.step import (
    BEGIN,
    LOOK,
    STATUS,
    STEP,
    is_compiled,
    locate_bodies,
    read_status,
    restart_robots,
    run_rows,
    steer_rows,
)
from bug_gym.kernels.stopping import (
    arc_and_stop,
    are_between,
    clear_part,
    keeps_clear,
    passes_corners,
    rate_at,
    stoppable_levers,
    stopping_way,
)

__all__ = [
    "are_between",
    "ATTEMPTS",
    "AWAY",
    "BORDER",
    "BOUNCE",
    "BOUNCE_BIT",
    "COLLISION",
    "COLUMNS",
    "CROWD",
    "CROWD_BIT",
    "ACKERMANN",
    "DIFFERENTIAL",
    "ENDED",
    "EVADE",
    "BEGIN",
    "LOOK",
    "PLACED",
    "STATUS",
    "STEP",
    "FIELD",
    "FLOAT_ARRAYS",
    "Flags",
    "Floats",
    "HAS_ADDRESSES",
    "HOLONOMIC",
    "INT_ARRAYS",
    "Integers",
    "MAX_VERTICES",
    "OBSERVATION",
    "RANDOM_WALK",
    "REGION_HEAD",
    "REPLAY",
    "RUNNING",
    "Ranges",
    "Record",
    "SAME_INSTANT",
    "SPEC",
    "ALIGNED",
    "levers",
    "observation_places",
    "places",
    "rounded_up",
    "STILL",
    "STREAM_DRAWS",
    "STREAM_POLICY",
    "STREAM_WORLD",
    "SUCCESS",
    "TERMS",
    "TERRAIN_HEADINGS",
    "TERRAIN_RINGS",
    "TIMEOUT",
    "WALK_BIT",
    "WAYPOINTS",
    "address_table",
    "arc_and_stop",
    "beam_table",
    "best_arc",
    "bridged_points",
    "clear_part",
    "free_arc",
    "free_distance",
    "free_distances",
    "free_turn",
    "pursue",
    "round_corners",
    "hash64",
    "is_compiled",
    "keeps_clear",
    "passes_corners",
    "list_room",
    "locate_bodies",
    "nearest_point",
    "nearest_within",
    "place_fields",
    "point_wall_distance",
    "rate_at",
    "read_scans",
    "read_status",
    "restart_robots",
    "run_rows",
    "scan_points",
    "scan_then",
    "scratch_floats",
    "scratch_integers",
    "speed_lever",
    "steer_rows",
    "steering_floats",
    "step_one",
    "stoppable_levers",
    "stopping_way",
    "turn_rate",
    "turning",
    "uniform",
]
