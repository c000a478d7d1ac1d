"""A map planner in unknown terrain that avoids what moves: what grew out of HD-BUG here, and is no longer its paper's.

Source: this package; the HD-BUG paper (Hasibuzzaman, Jan and Wu) gave the detection radius, the prediction of movers and the
meeting of a moving target. Sensing assumed: ranges all round, goal, own position; the terrain around where the scenario has
regions. Memory kept: points of still obstacles (mapping.point_map), tracks of what moves. States: direct, following,
avoidance, leaving, emergency, turning, giving_way, backing_out, waiting. Guarantee: among still obstacles it reaches the goal
or declares it unreachable, for every way with the clearance (see mapping.point_map); where cells that it could not pass are
all that shuts the goal off it says "stuck", as in 29 of 1,000 shut worlds of thin cylinders (docs/results/cylinder-claims.md).
Length: that of the shortest way among what it has seen, planned again as it sees more.

It keeps a map and plans on it, so bugs are no fair opponents: other planners in unknown terrain are, and networks.

A decision is to perceive, to aim, to plan, and to follow the way or, among movers, to avoid: a file each.

1. Way. The shortest one among all remembered points, unseen ground taken for free; planned again when it is blocked, soon
   after points were taken away, and every fifty steps. The robot goes straight from node to node.
2. No way. The goal is unreachable when the remembered points close it off, at the least clearance the body allows, for
   `patience` decisions in a row, and nothing moved meanwhile. Else the robot waits, and forgets what may have moved; where
   the goal itself moves, all after 10 s.
   A cell of the map before which the swept disc was turned back three times counts as blocked: cells are open up to half
   their diagonal too near to a point. Where only such cells close the goal off the verdict is "stuck".
3. Movers. Each candidate is two velocities, one held for 0.4 s (24 headings, two speeds, to stand, to back out) and another up
   to the horizon (12 headings, to stand, or to follow the way), rolled out with the robot's kinematics in 24 futures of the
   movers: each goes as predicted until it turns, at random, to wherever it likes (hd_bug/futures.py). What is left to go, and
   the mean of hits and near misses over the futures cost (hd_bug/sequences.py); the first velocity of the cheapest two is
   driven. Where there is no way out at all it heads for the place within the detection radius r' that is farthest from
   everything; r' climbs and descends a ladder (hd_bug/ladder.py). What comes nearer than it goes to anything itself it
   leaves, known to move or not (leave.py).
4. Moving target. Its velocity is that of the last half second; the goal is the point where the robot can meet it, led by
   no longer than its velocity has foretold where it went. The goal radius grows with what it moves in a step.
5. Weighted regions. Factors seen are remembered; ground beyond the field's reach is supposed to go on as it is seen for
   as far again, so that a wide region is not entered because only its near edge is known. What is seen or supposed from
   nearer counts, else it would change with the heading, and the side to go round a region with it.
6. Long bodies. The way is planned for the disc about the body, which can turn anywhere; where there is none, poses are
   planned (poses) until there is room again, and else the way for the disc at the least clearance. Where the body cannot turn
   on the spot poses alone lead on, and without any it backs out straight to where it can. Where a mover would be met on them
   it gives way (give_way). "Unreachable" is a goal that not even one of the circles of the body comes to, else it is "stuck".
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.frames import in_odometry
from bug_gym.agents.hd_bug.shown import labelled
from bug_gym.agents.hd_bug_map.aim import aim
from bug_gym.agents.hd_bug_map.avoid import Avoidance
from bug_gym.agents.hd_bug_map.follow_way import follow_way
from bug_gym.agents.hd_bug_map.give_way import give_way
from bug_gym.agents.hd_bug_map.leave import STOOD, arc_out, can_leave, is_pressed, sidestep, start_of
from bug_gym.agents.hd_bug_map.memory import HDBugMapMemory
from bug_gym.agents.hd_bug_map.parameters import HDBugMapParameters, measures_of
from bug_gym.agents.hd_bug_map.perceive import Perception, Scene
from bug_gym.agents.hd_bug_map.plan import Planner
from bug_gym.agents.mapping.way import Way
from bug_gym.agents.prediction import make_predictor
from bug_gym.agents.prediction.predictor import Predictor
from bug_gym.agents.tracking.tracker import Tracker
from bug_gym.geometry import velocity_along
from bug_gym.kinematics import differential_action
from bug_gym.policy import Drawing, Memory, ScriptedPolicy, Velocity
from bug_gym.steering import Course, corner_cut
from bug_gym.view import Sensors, View

SEEN_NODES = 6
"""How many places of the way the robot looks at to round its corners."""

TURNED_ASIDE = math.sin(math.radians(3.0))
"""Sine of the angle from which on a velocity leads aside from the way."""


class HDBugMap(ScriptedPolicy):
    """The map planner.

    Args:
        sensors: what a driver knows of the robot.
        discrete: whether actions are numbers of the discrete table.
        **parameters: see HDBugMapParameters.

    Raises:
        TypeError: an unknown parameter.
        ValueError: an unknown predictor, a clearance not above the radius, a parameter that cannot be.
    """

    Parameters = HDBugMapParameters
    parameters: HDBugMapParameters

    def __init__(self, sensors: Sensors, *, discrete: bool = False, **parameters: Any) -> None:
        super().__init__(sensors, discrete=discrete, **parameters)
        self.predictor: Predictor = make_predictor(self.parameters.predictor, sensors)
        self.tracker = Tracker(sensors)
        self.measures = measures_of(sensors, self.parameters)
        self.perception = Perception(sensors, self.parameters, self.measures, self.tracker)
        self.planner = Planner(self.measures, self.parameters.patience)
        self.avoidance = Avoidance(sensors, self.parameters, self.measures)
        self.leaves = can_leave(sensors)

    def start(self) -> HDBugMapMemory:
        """Memory of a new episode."""
        return HDBugMapMemory(mode="direct", tracker=self.tracker.start())

    def act(self, view: View, memory: HDBugMapMemory) -> Velocity:
        """One decision."""
        scene = self.look(view, memory)
        memory.backs_out = memory.backs_out and self.planner.can_back_out(scene, memory)
        if memory.backs_out:
            return self._wait(scene, memory)
        if memory.turns is not None:
            velocity = self.planner.turn_through(scene, memory, memory.turns)
            if velocity is not None:
                return self._turn(scene, memory, velocity)
        way = self.planner.plan(scene, memory)
        if way is None:
            return self._wait(scene, memory)
        if memory.turns is not None:
            return self._turn(scene, memory, self.planner.turn_through(scene, memory, memory.turns) or (0.0, 0.0))
        return self.drive(scene, memory, way)

    def look(self, view: View, memory: HDBugMapMemory) -> Scene:
        """What is there, and where to."""
        memory.is_backing, memory.arc = False, None
        memory.has_stood = memory.steps > 0 and math.dist(memory.pose[:2], view.position) < STOOD
        scene = self.perception.perceive(view, memory)
        aim(scene, memory, self.measures.top, leads=self.parameters.lead)
        return scene

    def drive(self, scene: Scene, memory: HDBugMapMemory, way: Way) -> Velocity:
        """Along the way, or among movers what costs least, and away from what comes up on it."""
        near = self.avoidance.near_movers(scene, self.predictor)
        if near is not None:
            direction, speed, _ = self.avoidance.avoid(scene, memory, way, near)
        else:
            direction, speed = follow_way(scene, memory, way, self.measures)
        return self.go(scene, memory, direction, speed)

    def go(self, scene: Scene, memory: HDBugMapMemory, direction: float, speed: float) -> Velocity:
        """In a direction [rad] at a speed [m/s], away from what comes up on it."""
        memory.direction = direction
        return self._or_leave(scene, memory, velocity_along(direction - scene.view.heading, speed))

    def _turn(self, scene: Scene, memory: HDBugMapMemory, velocity: Velocity) -> Velocity:
        """On with the poses of a long body, or out of the way of what moves."""
        near = self.avoidance.near_movers(scene, self.predictor)
        if near is None or memory.turns is None:
            return velocity
        return give_way(scene, memory, memory.turns, velocity, near.movers, self.avoidance.times, self.measures)

    def _or_leave(self, scene: Scene, memory: HDBugMapMemory, velocity: Velocity) -> Velocity:
        """The velocity, or another that leads away from what has come up on it."""
        view, knows_movers = scene.view, memory.moved_at > 0
        if not self.leaves or not (knows_movers or memory.has_stood) or not is_pressed(view, knows_movers=knows_movers):
            return velocity
        if self.sensors.drive.kinematics == "holonomic":
            away = sidestep(view, velocity, self.measures.top)
        else:
            memory.arc = arc_out(view, self.measures.top)
            away = start_of(memory.arc, self.sensors.drive.step)
        if away is None:
            return velocity
        memory.mode = "leaving"
        return away

    def _wait(self, scene: Scene, memory: HDBugMapMemory) -> Velocity:
        """Stand, but for what comes near: there is no way now; a long body that cannot turn goes back to where it can."""
        if memory.verdict:
            return 0.0, 0.0
        near = self.avoidance.near_movers(scene, self.predictor)
        if near is None and self.planner.can_back_out(scene, memory):
            memory.mode, memory.backs_out, memory.is_backing = "backing_out", True, True
            return -self.sensors.drive.max_reverse, 0.0
        if near is None:
            return self._or_leave(scene, memory, (0.0, 0.0))
        view = scene.view
        gap = math.dist(view.position, memory.goal)
        straight = Way(np.array([view.position, memory.goal]), np.array([gap, 0.0]))
        direction, speed, _ = self.avoidance.avoid(scene, memory, straight, near)
        memory.mode = "waiting"
        return self._or_leave(scene, memory, velocity_along(direction - view.heading, speed))

    def course(self, view: View, memory: HDBugMapMemory, velocity: Velocity) -> Course | None:
        """The planned way, where nothing moves and no step is turned aside from it."""
        way = memory.way
        if way is None or memory.mode not in ("direct", "following"):
            return None
        places = np.array([view.to_robot(x, y) for x, y in way.places[:SEEN_NODES].tolist()])
        x, y = places[1]
        if abs(x * velocity[1] - y * velocity[0]) > TURNED_ASIDE * math.hypot(x, y) * math.hypot(*velocity):
            return None
        return Course(places, corner_cut(self.sensors.drive))

    def last_word(self, view: View, memory: Memory, action: NDArray[Any]) -> NDArray[Any]:
        """Straight back, where it has to, and out of the way of what comes up on it."""
        if not isinstance(memory, HDBugMapMemory) or memory.verdict or self.discrete:
            return action
        if memory.arc is not None:
            return differential_action(self.sensors.drive, *memory.arc)
        if memory.is_backing:
            return differential_action(self.sensors.drive, -self.sensors.drive.max_reverse, 0.0)
        return action

    def draw(self, memory: HDBugMapMemory) -> Drawing:
        """Light and shadow areas, velocities among movers by cost, the planned way, tracks."""
        if memory.light is None:
            return Drawing()
        areas = [(in_odometry(memory.pose, memory.light.light_ring()), "light")]
        areas += [(in_odometry(memory.pose, ring), "shadow") for ring in memory.light.shadow_rings()]
        points = labelled(memory.candidates, memory.costs)
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
