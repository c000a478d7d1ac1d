"""HD-BUG: doors from light into shadow, a cost, a list of light areas, and prediction of what moves.

Source: Hasibuzzaman, Jan and Wu, "Dynamic Path Planning in the Unknown Environment with Mobile Target and Obstacles".
Sensing assumed: ranges all round, goal, own position. Memory kept: the double linked list of light areas that it has
navigated (path_list), the doors of each; tracks of what moves; while it circumnavigates, TangentBug's few registers.
States: direct, candidates, backtracking, circumnavigation, anticipation, reaction, emergency. Guarantee: reaches the goal
or declares it unreachable among still obstacles; the paper gives none. Length: between two falls of the least distance d
to the goal at most `patience` (d + 2 m) by doors, and TangentBug's.

It keeps no map of points and plans on none. A list of light areas is a memory of the ground all the same: n times 180
numbers, not the few registers of a bug; a topological map, as of the SRT method (Oriolo, Vendittelli, Freda and Troso) or
of gap navigation trees (LaValle, Planning Algorithms, 12.3.4).

A decision is to perceive, to aim, to explore or to circumnavigate, and among movers to avoid: a file each.

Where the paper contradicts itself or is silent, this package decides:

1. Light and shadow (Procedure 2). The light area of a place is how far the robot's disc can go along each heading; each
   node of the list keeps its own. Shadow is what no node has lit. (light)
2. Candidates (eq. 7, Procedure 3, Table 1). Doors: from a place v in the light to q in the shadow beside it, where the
   light jumps behind the end of an obstacle ("vertices") and where the beams end ("end point at r_max"). They are looked
   for every pace. None leads into a wall that a node has seen from nearby; a door is closed when q is lit, or when it
   leads into an obstacle. (doors, explore)
3. Cost (eq. 8 and Table 1). J = alpha (C(s, v) + D(v, g)) + beta risk(v): C is the way over the list, D goes over q and
   on straight, risk is narrowness and movers. The least J over the whole list is chosen, and kept until it is closed or
   another is better by far. (explore)
4. Backtracking. A door out of sight is reached over the list: over the links between nodes in each other's light, never
   back along the way. (explore, path_list)
5. Tangential circumnavigation. No door left, no progress within `patience`, no way on, or the goal right behind what is in
   the way: it goes round that as TangentBug does, until it is nearer to the goal than ever. "No door left" never says that
   there is no way; only a closed lap does. So a livelock among doors ends, and no verdict rests on how finely doors are
   seen. (circumnavigate)
6. Detection radius (eq. 6, Table 1). The ladder of radii r' bounds what lies ahead among movers: at r' the ends of the
   grid of velocities are compared. What is remembered is as far as the beams saw. (ladder)
7. Velocity (eq. 9). v_max where the way to the next place is clear, v_base where an obstacle is nearer than a pace ahead,
   v_min in a passage narrower than two bodies; never faster than it can stop. (drive)
8. Two-phase avoidance, with the prediction's spread as the chance of a hit. (avoid)
9. Emergency points. Where nothing lets it go on, the place on the ring of radius r' that is farthest from everything.
10. Moving target. Met where its velocity, as far as that has foretold its way, leads. (aim)
11. Deep reinforcement learning (named in the conclusion): a predictor beside "none", "constant_velocity" and "kalman".

A long body goes as the disc about it; what ground costs is not looked at: hd_bug_map does both.
"""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray

from bug_gym.agents.hd_bug.aim import aim
from bug_gym.agents.hd_bug.avoid import Avoidance
from bug_gym.agents.hd_bug.circumnavigate import Circumnavigation
from bug_gym.agents.hd_bug.drive import TURNING, Motion
from bug_gym.agents.hd_bug.explore import Explorer
from bug_gym.agents.hd_bug.memory import HDBugMemory
from bug_gym.agents.hd_bug.parameters import HDBugParameters
from bug_gym.agents.hd_bug.perceive import Perception, Scene
from bug_gym.agents.hd_bug.shown import labelled, light_ring
from bug_gym.geometry import Point, velocity_along
from bug_gym.kinematics import differential_action
from bug_gym.policy import Drawing, Memory, ScriptedPolicy, Velocity
from bug_gym.steering import Course
from bug_gym.view import Sensors, View

TRIES = 3
"""Doors that are tried in one decision where the way to the first is blocked."""

Heading = tuple[float, float]
"""Direction in the odometry frame [rad] and speed [m/s]."""


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
        own = self.parameters
        self.circumnavigation = Circumnavigation(sensors, own.clearance, own.patience, is_driven_alone=discrete)
        self.boundary = self.circumnavigation.boundary
        self.perception = Perception(sensors, own, self.boundary.inner)
        self.explorer = Explorer(sensors, own, self.perception, self.boundary)
        self.motion = Motion(own, self.boundary)
        self.avoidance = Avoidance(sensors, own, self.motion)

    def start(self) -> HDBugMemory:
        """Memory of a new episode."""
        return HDBugMemory(mode="direct", tracker=self.perception.tracker.start())

    def act(self, view: View, memory: HDBugMemory) -> Velocity:
        """One decision."""
        memory.is_backing = memory.rounds_corners = False
        scene = self.perception.perceive(view, memory)
        aim(view, memory, self.motion.speeds[0], leads=self.parameters.lead)
        self.circumnavigation.measure(view, memory)
        heading = self._go(scene, memory)
        if memory.verdict:
            return 0.0, 0.0
        movers = self.avoidance.near_movers(scene)
        if movers is not None:
            memory.rounds_corners = False
            heading = self.avoidance.avoid(scene, memory, movers, heading, memory.chosen)
        memory.direction = heading[0]
        return velocity_along(heading[0] - view.heading, heading[1])

    # ------------------------------------------------------------------------------------------- where nothing moves

    def _go(self, scene: Scene, memory: HDBugMemory) -> Heading:
        """Direction and speed to the goal, to a door, or round what is in the way."""
        is_exploring = memory.follow is None
        memory.must_look |= is_exploring and memory.door is None
        place = self._place_in_sight(scene, memory)
        if place is not None:
            heading = self._go_straight(scene, memory, place)
            if heading is not None:
                return heading
        has_looked = self.explorer.look(scene, memory)
        if is_exploring:
            heading = self._explore(scene, memory, has_looked=has_looked)
            if heading is not None:
                return heading
            self.circumnavigation.begin(memory)
        return self._circumnavigate(scene, memory)

    def _place_in_sight(self, scene: Scene, memory: HDBugMemory) -> Point | None:
        """The goal, or where it can be met, if the way there is free as far as is seen; None else."""
        view = scene.view
        if memory.goal != view.goal_position:
            ahead, left = view.to_robot(*memory.goal)
            free = view.free_distance(math.atan2(left, ahead), self.boundary.inner)
            if min(math.hypot(ahead, left), self.sensors.range) <= free:
                return memory.goal
        return view.goal_position if self.boundary.sees_goal(view) else None

    def _go_straight(self, scene: Scene, memory: HDBugMemory, place: Point) -> Heading | None:
        """To the goal in sight; None where something is in the way after all."""
        heading = self.motion.toward(scene, place)
        if heading is None or self.circumnavigation.stands_still(scene.view, memory):
            return None
        memory.mode, memory.chosen = "direct", place
        memory.door, memory.way, memory.is_passing, memory.follow = None, [], False, None
        return heading

    def _explore(self, scene: Scene, memory: HDBugMemory, *, has_looked: bool) -> Heading | None:
        """Toward the door of least cost; None where none is left, or they have had their time."""
        if self.circumnavigation.is_due(scene.view, memory):
            return None
        for _ in range(TRIES):
            if has_looked or memory.door is None:
                self.explorer.choose(scene, memory)
            if memory.door is None:
                return None
            place = self.explorer.next_place(scene, memory)
            heading = None if place is None else self.motion.toward(scene, place)
            if place is not None and heading is not None:
                memory.chosen = place
                return heading
            if place is not None:
                self.explorer.give_up(scene, memory)
            has_looked = self.explorer.look(scene, memory)
        return None

    def _circumnavigate(self, scene: Scene, memory: HDBugMemory) -> Heading:
        """Round what is in the way; to an emergency point where nothing lets it go on."""
        view = scene.view
        velocity = self.circumnavigation.velocity(view, memory)
        speed = math.hypot(*velocity)
        if speed <= 0.0 and not memory.verdict:
            memory.mode = "emergency"
            return self.motion.emergency_point(view, memory.reach)
        direction = math.atan2(velocity[1], velocity[0]) + view.heading
        x, y = view.position
        memory.chosen = x + memory.reach * math.cos(direction), y + memory.reach * math.sin(direction)
        memory.rounds_corners = memory.follow is not None
        return direction, max(speed, TURNING)

    def course(self, view: View, memory: Any, velocity: Velocity) -> Course | None:
        """Along the obstacle that it goes round, where no mover is in the way."""
        return self.circumnavigation.course(view, memory, velocity) if memory.rounds_corners else None

    def last_word(self, view: View, memory: Memory, action: NDArray[Any]) -> NDArray[Any]:
        """Straight back, where it has to."""
        if isinstance(memory, HDBugMemory) and memory.is_backing and not memory.verdict and not self.discrete:
            return differential_action(self.sensors.drive, -self.sensors.drive.max_reverse, 0.0)
        return action

    # ------------------------------------------------------------------------------------------- what it shows

    def draw(self, memory: HDBugMemory) -> Drawing:
        """Light areas and the list, candidates by cost, the way back, closed doors, the wall, tracks."""
        if memory.steps == 0:
            return Drawing()
        path = memory.path
        areas = [(light_ring(place, light), "light") for place, light in zip(path.places, path.lights, strict=True)]
        points = labelled(memory.candidates, memory.costs)
        points += [(*closing.place, "closed") for closing in memory.closed]
        points.append((*memory.chosen, "chosen"))
        followed = self.circumnavigation.draw(memory)
        segments = [(*a.came_from.place, *a.place, "list") for a in path if a.came_from is not None]
        way = [memory.pose[:2], *(path.nodes[number].place for number in memory.way)]
        segments += [(*a, *b, "way") for a, b in zip(way, way[1:], strict=False)]
        for future in memory.forecast:
            segments += [
                (*a, *b, "forecast") for a, b in zip(future[:-1:4].tolist(), future[4::4].tolist(), strict=False)
            ]
        return Drawing(points=[*points, *followed.points], segments=segments, areas=areas)
