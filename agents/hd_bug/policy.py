"""HD-BUG: candidates in the light area, a cost, a list of the path, and prediction of what moves.

Source: Hasibuzzaman, Jan and Wu, "Dynamic Path Planning in the Unknown Environment with Mobile Target and Obstacles".
Sensing assumed: ranges all round, goal, own position; the terrain around where the scenario has regions. Memory kept:
points of still obstacles (mapping.point_map), the double linked list of the path (path_list), tracks of what moves.
States: direct, candidates, backtracking, avoidance, emergency, turning, waiting. Guarantee: among still obstacles it
reaches the goal or declares it unreachable, for every way with the clearance (see mapping.point_map); the paper gives none.

A decision is to perceive, to aim, to plan, and to choose or, among movers, to avoid: a file each.

Where the paper contradicts itself or is silent, this module decides:

1. Light and shadow (Procedure 2). A point is in the light area when a disc of the robot's clearance can go there
   straight, nearer than the detection radius r'; in the shadow area when it lies within r' and out of sight.
2. Detection radius (eq. 6, Table 1). One ladder r' = r 2^k, k = 0 to 3, so r'_max = 8 r. Density is the share of beams
   shorter than r'. Dense for three steps: k + 1, count2 + 1; sparse for ten: k - 1, count1 + 1; it begins at k = 2,
   where the grid of Procedure 3 (four radii of 0.5 m) is met exactly. r' bounds candidates, risk and horizon; what lies
   farther is still remembered.
3. Candidates (eq. 7, Procedure 3, Table 1). 32 headings x 4 radii j r'/4; vertices: where the disc just passes the end of
   a cluster of scan points; centres: the middle of the gap between the ends of neighbouring clusters (the mean of an
   obstacle's vertices, as printed, lies inside it); and the next node of the planned path. Delta of the half-plane
   filter is the direction of that node.
4. Cost (eq. 8 and Table 1). J(v) = alpha (C(s, v) + D(v, g)) + beta risk(v). The straight distance for D drives into
   every wall, so D(v, g) is what is left over the planned path: a straight way to one of its nodes, and on along it.
   C counts terrain. Among movers C is left out and v is where the robot would be after one horizon, as in eq. (8), so
   that slower is dearer.
5. Global and local path (HDPathPlanner). The global path is the shortest one among all remembered points, planned again
   when it is blocked, soon after points were taken away, and every fifty steps. Dead ends are left by it: the nodes of the path
   list between the dead end and where the new path leaves the old are closed, the state is "backtracking".
6. No way. The goal is unreachable when the remembered points close it off, at the least clearance the body allows, for
   `patience` decisions in a row, and nothing moved meanwhile. Else the robot waits, and forgets what may have moved.
7. Velocity (eq. 9). v_max where the next node is in the light; v_base where an obstacle is nearer than a step of the
   detection radius in that direction; v_min in a passage narrower than two bodies; never faster than it can stop in
   the free way.
8. Two-phase avoidance. Phase 1: each candidate is a velocity, rolled out with the robot's kinematics against the
   predicted tracks; near misses cost. Phase 2: when the best one meets something within `reaction` seconds, the one that
   meets it last is taken, whatever it costs: that is the tangential circumnavigation. While movers are near, the edges
   of shadows count as near misses too: another may come out of them. A differential robot may also back out.
9. Moving target. Its velocity is that of the last half second; the goal is the point where the robot can meet it, led by
   no longer than its velocity has foretold where it went. The goal radius grows with what it moves in a step.
10. Deep reinforcement learning (mentioned in the conclusion): a predictor beside "none", "constant_velocity" and
   "kalman"; see agents.prediction.
11. Weighted regions. Factors seen are remembered; ground beyond the field's reach is supposed to go on as it is seen for
   as far again, so that a wide region is not entered because only its near edge is known. What is seen or supposed from
   nearer counts, else it would change with the heading, and the side to go round a region with it.
12. Long bodies (section 3.1). The way is planned for the disc about the body, which can turn anywhere; where there is
   none, poses are planned (poses) until there is room again.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.aim import aim
from bug_gym.agents.hd_bug.avoid import Avoidance
from bug_gym.agents.hd_bug.choose import Candidates
from bug_gym.agents.hd_bug.frames import in_odometry
from bug_gym.agents.hd_bug.memory import HDBugMemory
from bug_gym.agents.hd_bug.parameters import HDBugParameters, measures_of
from bug_gym.agents.hd_bug.path_list import PathList
from bug_gym.agents.hd_bug.perceive import Perception, Scene
from bug_gym.agents.hd_bug.plan import Planner
from bug_gym.agents.mapping.way import Way
from bug_gym.agents.prediction import make_predictor
from bug_gym.agents.prediction.predictor import Predictor
from bug_gym.agents.tracking.tracker import Tracker
from bug_gym.geometry import F64, velocity_along
from bug_gym.kinematics import differential_action
from bug_gym.policy import Drawing, Memory, ScriptedPolicy, Velocity
from bug_gym.view import Sensors, View


class HDBug(ScriptedPolicy):
    """HD-BUG.

    Args:
        sensors: what a driver knows of the robot.
        discrete: whether actions are numbers of the discrete table.
        **parameters: see HDBugParameters.

    Raises:
        TypeError: an unknown parameter.
        ValueError: an unknown predictor, a clearance not above the radius, a parameter that cannot be.
    """

    Parameters = HDBugParameters
    parameters: HDBugParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        self.predictor: Predictor = make_predictor(self.parameters.predictor, sensors)
        self.tracker = Tracker(sensors)
        self.measures = measures_of(sensors, self.parameters)
        self.perception = Perception(sensors, self.parameters, self.measures, self.tracker)
        self.planner = Planner(self.measures, self.parameters.patience)
        self.candidates = Candidates(self.parameters, self.measures)
        self.avoidance = Avoidance(sensors, self.parameters, self.measures)

    def start(self) -> HDBugMemory:
        """Memory of a new episode."""
        return HDBugMemory(mode="direct", tracker=self.tracker.start(), path=PathList(self.parameters.r_base))

    def act(self, view: View, memory: HDBugMemory) -> Velocity:
        """One decision."""
        scene = self.perception.perceive(view, memory)
        aim(scene, memory, self.measures.top, leads=self.parameters.lead)
        if memory.turns is not None:
            velocity = self.planner.turn_through(scene, memory, memory.turns)
            if velocity is not None:
                return velocity
        way = self.planner.plan(scene, memory)
        if way is None:
            return self._wait(scene, memory)
        if memory.turns is not None:
            return self.planner.turn_through(scene, memory, memory.turns) or (0.0, 0.0)
        memory.is_backing = False
        movers = self.avoidance.near_movers(scene, self.predictor)
        if movers is not None:
            direction, speed = self.avoidance.avoid(scene, memory, way, movers)
        else:
            direction, speed = self.candidates.choose(scene, memory, way)
        memory.direction = direction
        return velocity_along(direction - view.heading, speed)

    def _wait(self, scene: Scene, memory: HDBugMemory) -> Velocity:
        """Stand, but for movers that come near: there is no way now."""
        if memory.verdict:
            return 0.0, 0.0
        movers = self.avoidance.near_movers(scene, self.predictor)
        if movers is None:
            return 0.0, 0.0
        view = scene.view
        gap = math.dist(view.position, memory.goal)
        straight = Way(np.array([view.position, memory.goal]), np.array([gap, 0.0]))
        direction, speed = self.avoidance.avoid(scene, memory, straight, movers)
        memory.mode = "waiting"
        return velocity_along(direction - view.heading, speed)

    def _action(self, flat: NDArray[np.float32], memory: Memory) -> NDArray[Any]:
        action = super()._action(flat, memory)
        if isinstance(memory, HDBugMemory) and memory.is_backing and not memory.verdict and not self.discrete:
            return differential_action(self.sensors.drive, -self.sensors.drive.max_reverse, 0.0)
        return action

    def draw(self, memory: HDBugMemory) -> Drawing:
        """Light and shadow areas, candidates by cost, the planned path and the list of the passed one, tracks."""
        if memory.light is None:
            return Drawing()
        areas = [(in_odometry(memory.pose, memory.light.light_ring()), "light")]
        areas += [(in_odometry(memory.pose, ring), "shadow") for ring in memory.light.shadow_rings()]
        points = labelled(memory.candidates, memory.costs)
        points += [(*node.place, "closed") for node in memory.path if node.is_closed]
        points.append((*memory.chosen, "chosen"))
        segments: list[tuple[float, float, float, float, str]] = []
        if memory.way is not None:
            places = memory.way.places.tolist()
            segments += [(*a, *b, "way") for a, b in zip(places, places[1:], strict=False)]
        for future in memory.forecast:
            segments += [
                (*a, *b, "forecast") for a, b in zip(future[:-1:4].tolist(), future[4::4].tolist(), strict=False)
            ]
        return Drawing(points=points, segments=segments, areas=areas)


def labelled(candidates: F64, costs: F64) -> list[tuple[float, float, str]]:
    """Candidates (m, 2) with a label for their costs (m,): the share of the way from the least to the highest."""
    finite = costs[np.isfinite(costs)]
    if len(finite) == 0:
        return []
    low, high = float(finite.min()), float(finite.max())
    points = []
    for (px, py), cost in zip(candidates.tolist(), costs.tolist(), strict=True):
        share = (cost - low) / (high - low) if high > low and math.isfinite(cost) else 1.0
        points.append((px, py, "cheap" if share < 0.25 else "candidate" if share < 0.6 else "dear"))
    return points
