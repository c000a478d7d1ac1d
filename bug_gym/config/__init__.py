"""What a scenario is: the schema of its YAML files and of the dicts that say the same, and the loader that checks them.

Here is all that a scenario may be written in; it lives in `bug_gym.schema` (values, motions, robot, task) and
`bug_gym.worlds` (the families). Defaults live in the models, a YAML file holds the differences from them. Lengths are in
metres, times in seconds, angles in radians.
"""

from bug_gym.config.errors import checked
from bug_gym.config.loading import (
    SCENARIO_FOLDER,
    dump,
    expanded,
    from_folder,
    load,
    names_file,
    read_yaml,
    scenario_names,
    to_yaml,
)
from bug_gym.config.scenario import Scenario
from bug_gym.schema.errors import ScenarioError
from bug_gym.schema.faults import EXPECTED, explain
from bug_gym.schema.motions import LAWS, Bounce, Crowd, Evade, Motion, RandomWalk, Replay, Waypoints
from bug_gym.schema.movers import SAME_PLACE, Mover, Shape, Target
from bug_gym.schema.own import ObservationField, RewardTerm
from bug_gym.schema.polygons import Bounds, Polygon, Ring, WeightedRegion
from bug_gym.schema.robot import FULL_TURN, FULL_TURN_TOLERANCE, Lidar, Odometry, Place, Robot, Robots
from bug_gym.schema.task import GoalSettings, Reward, Time
from bug_gym.schema.values import (
    AtLeastOne,
    AtLeastThree,
    Box,
    CornerCounts,
    Count,
    Disc,
    ExistingPath,
    Flag,
    Goal,
    NotNegative,
    Number,
    Part,
    Point,
    Pose,
    Positive,
    Record,
    Region,
    Rotation,
    Share,
    Sizes,
    Speeds,
    Start,
    StartRegion,
    Velocity,
)
from bug_gym.schema.yaml_text import parse_yaml
from bug_gym.worlds import FAMILIES, WorldFamily
from bug_gym.worlds.barn import BarnWorld
from bug_gym.worlds.beach import BeachWorld
from bug_gym.worlds.corridor import CorridorWorld
from bug_gym.worlds.crossing import CrossingWorld
from bug_gym.worlds.dynabarn import DynaBarnWorld
from bug_gym.worlds.empty import EmptyWorld
from bug_gym.worlds.explicit import ExplicitWorld
from bug_gym.worlds.family import DrawnPlaces, Family
from bug_gym.worlds.field import FieldWorld
from bug_gym.worlds.forest import ForestWorld
from bug_gym.worlds.hook import HookWorld
from bug_gym.worlds.maze import MazeWorld
from bug_gym.worlds.oni_wang import ONI_WANG_PLACES, ONI_WANG_POLYGON, OniWangWorld
from bug_gym.worlds.replay import ReplayWorld
from bug_gym.worlds.ring import RingWorld
from bug_gym.worlds.rooms import RoomsWorld
from bug_gym.worlds.ros_map import RosMapWorld
from bug_gym.worlds.u_trap import UTrapWorld
from bug_gym.worlds.urban import UrbanWorld

__all__ = [
    "AtLeastOne",
    "AtLeastThree",
    "BarnWorld",
    "BeachWorld",
    "Bounce",
    "Bounds",
    "Box",
    "CornerCounts",
    "CorridorWorld",
    "Count",
    "CrossingWorld",
    "Crowd",
    "Disc",
    "DrawnPlaces",
    "DynaBarnWorld",
    "EXPECTED",
    "EmptyWorld",
    "Evade",
    "ExistingPath",
    "ExplicitWorld",
    "FAMILIES",
    "FULL_TURN",
    "FULL_TURN_TOLERANCE",
    "Family",
    "FieldWorld",
    "Flag",
    "ForestWorld",
    "Goal",
    "GoalSettings",
    "HookWorld",
    "LAWS",
    "Lidar",
    "MazeWorld",
    "Motion",
    "Mover",
    "NotNegative",
    "Number",
    "ONI_WANG_PLACES",
    "ONI_WANG_POLYGON",
    "Odometry",
    "ObservationField",
    "OniWangWorld",
    "Part",
    "Place",
    "Point",
    "Polygon",
    "Pose",
    "Positive",
    "RandomWalk",
    "Record",
    "Region",
    "Replay",
    "ReplayWorld",
    "Reward",
    "RewardTerm",
    "Ring",
    "RingWorld",
    "Robot",
    "Robots",
    "RoomsWorld",
    "RosMapWorld",
    "Rotation",
    "SAME_PLACE",
    "SCENARIO_FOLDER",
    "Scenario",
    "ScenarioError",
    "Shape",
    "Share",
    "Sizes",
    "Speeds",
    "Start",
    "StartRegion",
    "Target",
    "Time",
    "UTrapWorld",
    "UrbanWorld",
    "Velocity",
    "Waypoints",
    "WeightedRegion",
    "WorldFamily",
    "checked",
    "dump",
    "expanded",
    "explain",
    "from_folder",
    "load",
    "names_file",
    "parse_yaml",
    "read_yaml",
    "scenario_names",
    "to_yaml",
]
