"""The map planner plans: the path among all that it remembers, and what it does where there is none."""

from __future__ import annotations

import math

import numpy as np

from bug_gym.agents.hd_bug_map.aim import HALF_CELL
from bug_gym.agents.hd_bug_map.memory import HDBugMapMemory
from bug_gym.agents.hd_bug_map.parameters import Measures
from bug_gym.agents.hd_bug_map.perceive import Scene
from bug_gym.agents.hd_bug_map.poses import Turns, find_poses, is_open
from bug_gym.agents.mapping.way import Way
from bug_gym.policy import Velocity, braking_radius

CONFIRM = 5
"""Where there was no way, every how many decisions one is looked for again."""

REPLAN, REPLAN_FREED, REPLAN_TERRAIN, REPLAN_POSES = 50, 10, 5, 10
"""Steps after which the way is planned again in any case, where remembered points were taken away, and where ground was
revised; and between two looks of a long body for a way without turns."""

LEFT_NODE = 0.05
"""Nearer than this to a node of the way it is passed, in robot radii."""

BARS_LIFTED = 2
"""How often cells that turned it back are tried again where points of the map have gone since."""

STILL_FOR = 10.0
"""Nothing may have moved for so long before a goal counts as unreachable [s]."""


class Planner:
    """The planner of the global path.

    Args:
        measures: of the robot.
        patience: decisions in a row without any way before the goal counts as unreachable.
    """

    def __init__(self, measures: Measures, patience: int) -> None:
        self.measures = measures
        self.patience = patience

    def plan(self, scene: Scene, memory: HDBugMapMemory) -> Way | None:
        """The planned path: the one there is, or a new one; None where there is none."""
        if memory.is_goal_by_wall and not self._is_by_wall(scene):  # what stood there has gone
            memory.is_goal_by_wall, memory.beside_goal, memory.way = False, 0, None
        if memory.is_goal_by_wall and self._is_beside_in_vain(scene, memory):
            memory.verdict = "stuck"
            return None
        if memory.way is not None:
            near = LEFT_NODE * self.measures.radius
            scene.grid.pass_nodes(memory.way, scene.view.position, near, cuts=not scene.grid.cells.is_weighted)
            if is_good(scene, memory, memory.way):
                return memory.way
        may_look = memory.way is not None or memory.closed_off % CONFIRM == 0
        memory.way = self._find_way(scene, memory) if may_look else None
        if memory.way is None:
            self._no_way(scene, memory)
            return None
        memory.closed_off = 0
        return memory.way

    def _find_way(self, scene: Scene, memory: HDBugMapMemory) -> Way | None:
        """A new path: to where the goal can be met, else to the goal, else over poses, else at the least clearance.

        Poses are planned with ways ahead alone. Where a long body cannot turn on the spot, as on its way through poses, they
        are the only way: driven as a disc it would turn into what is beside it.
        """
        view, grid = scene.view, scene.grid
        position, goal = view.position, view.goal_position
        memory.planned_at, memory.removed_then, memory.revised_then = memory.steps, grid.removed, grid.revised
        if memory.body_map is not None and self._is_cramped(scene):
            found = self._find_poses(scene, memory)
            if found is not None or self.can_back_out(scene, memory):
                return found
        radius = max(memory.goal_radius, 0.5 * self.measures.cell)
        found = grid.find_way(position, memory.goal, radius)
        if found is None and memory.goal != goal:
            found = grid.find_way(position, goal, radius)
        if found is None:
            found = self._find_poses(scene, memory)
        if found is not None:
            return found
        if grid.cells.clearance > self.measures.tight:
            grid.set_clearance(self.measures.tight)
            found = grid.find_way(position, goal, radius)
        return self._find_way_to_wall(scene, memory) if found is None else found

    def _find_poses(self, scene: Scene, memory: HDBugMapMemory) -> Way | None:
        """The way of the poses that lead a long body on; None for a round one, and where there are none."""
        if memory.body_map is None:
            return None
        near = max(memory.goal_radius, memory.body_map.cells.size)
        poses = find_poses(memory.body_map, self.measures.footprint, scene.view.pose, memory.goal, near)
        memory.turns = None if poses is None else Turns(poses, memory.body_map, memory.steps)
        return None if memory.turns is None else memory.turns.way

    def _is_cramped(self, scene: Scene) -> bool:
        """Whether what is seen or remembered lies so near to the robot that the body cannot turn on the spot."""
        points = scene.grid.points() - scene.view.position
        is_near = scene.view.nearest()[0] < braking_radius(scene.view.sensors)
        return is_near or bool((np.hypot(*points.T) < self.measures.radius).any())

    def can_back_out(self, scene: Scene, memory: HDBugMapMemory) -> bool:
        """Whether a long body that cannot turn where it is can go straight back for a step."""
        drive, (x, y, heading) = scene.view.sensors.drive, scene.view.pose
        if memory.body_map is None or drive.max_reverse <= 0.0 or not self._is_cramped(scene):
            return False
        way = drive.max_reverse * drive.step
        behind = [x - way * math.cos(heading), y - way * math.sin(heading), heading]
        return is_open(memory.body_map, self.measures.footprint, np.array([[x, y, heading], behind]))

    def _find_way_to_wall(self, scene: Scene, memory: HDBugMapMemory) -> Way | None:
        """The same to a goal by walls, at the least clearance: to where it may be that the body comes as near as counts."""
        if memory.is_goal_by_wall or not self._is_by_wall(scene):
            return None
        view, cells = scene.view, scene.grid.cells
        found = scene.grid.find_way(
            view.position, view.goal_position, view.sensors.goal_radius + HALF_CELL * cells.size
        )
        memory.is_goal_by_wall = found is not None
        return found

    def _is_by_wall(self, scene: Scene) -> bool:
        """Whether remembered points lie nearer to the goal than lets the body stand there."""
        points = scene.grid.points() - scene.view.goal_position
        return bool((np.hypot(*points.T) < self.measures.radius).any())

    def _is_beside_in_vain(self, scene: Scene, memory: HDBugMapMemory) -> bool:
        """Whether it has been near a goal by walls for so long that it comes no nearer: its way may end before a wall."""
        view = scene.view
        memory.beside_goal += view.goal_distance <= memory.goal_radius + 2.0 * self.measures.clearance
        return memory.goal_watch.has_settled and memory.beside_goal * view.sensors.drive.step > STILL_FOR

    def _no_way(self, scene: Scene, memory: HDBugMapMemory) -> None:
        """The remembered points close the goal off: wait, forget, or say so."""
        memory.closed_off += 1
        memory.mode = "waiting"
        long = STILL_FOR / scene.view.sensors.drive.step
        if not memory.goal_watch.has_settled:
            if memory.closed_off > long:  # where things move, what shut it off out of sight may be open by now
                scene.grid.forget_all()
                forget_bars(memory)
            return
        if memory.closed_off < self.patience:
            return
        if memory.steps - memory.moved_at > long:
            if not self._is_shut_by_bars(scene, memory):
                memory.verdict = "unreachable" if self._is_shut_for_body(scene, memory) else "stuck"
            elif memory.barred_then == scene.grid.removed or memory.bars_lifted == BARS_LIFTED:
                memory.verdict = "stuck"
            else:
                # What turned it back may have gone.
                memory.bars_lifted += 1
                forget_bars(memory)
        else:
            scene.grid.forget_all()
            forget_bars(memory)

    def _is_shut_by_bars(self, scene: Scene, memory: HDBugMapMemory) -> bool:
        """Whether only barred cells close the goal off; that the body was turned back there is no proof. Lifts the bars."""
        if memory.barred_then is None:
            return False
        scene.grid.set_clearance(scene.grid.cells.clearance)
        radius = max(memory.goal_radius, 0.5 * self.measures.cell)
        return scene.grid.find_way(scene.view.position, scene.view.goal_position, radius) is not None

    def _is_shut_for_body(self, scene: Scene, memory: HDBugMapMemory) -> bool:
        """Whether not even one of the circles of a long body passes: that the planner finds no poses is no proof."""
        if memory.body_map is None:
            return True
        radius = max(memory.goal_radius, memory.body_map.cells.size)
        return memory.body_map.find_way(scene.view.position, scene.view.goal_position, radius) is None

    def turn_through(self, scene: Scene, memory: HDBugMapMemory, turns: Turns) -> Velocity | None:
        """Follow the poses of a long body; None where it has room again, or they no longer lead on."""
        memory.mode = "turning"
        since = memory.steps - turns.planned_at
        velocity = None
        if not (since and since % REPLAN_POSES == 0) or self._has_to_turn(scene, memory, turns):
            velocity = turns.lead_on(scene.view, self.measures.slow)
        if velocity is None:
            memory.turns = memory.way = None
        else:
            memory.way = turns.way
        return velocity

    def _has_to_turn(self, scene: Scene, memory: HDBugMapMemory, turns: Turns) -> bool:
        """Whether a long body has no room to go as a disc, and its poses are still open."""
        view, grid = scene.view, scene.grid
        radius = max(memory.goal_radius, 0.5 * self.measures.cell)
        if not grid.is_blocked(view.position) and grid.find_way(view.position, memory.goal, radius) is not None:
            return False
        return turns.is_open(self.measures.footprint, view.pose)


def forget_bars(memory: HDBugMapMemory) -> None:
    """Look for ways again, with no cell barred."""
    memory.closed_off, memory.barred_then = 0, None
    memory.turned_back.clear()


def is_good(scene: Scene, memory: HDBugMapMemory, way: Way) -> bool:
    """Whether the path still leads to the goal, is not too old, and nothing new stands in it."""
    grid = scene.grid
    if math.dist(memory.goal, way.places[-1]) > 0.1:
        return False
    since = memory.steps - memory.planned_at
    if since >= REPLAN or (since >= REPLAN_TERRAIN and grid.revised != memory.revised_then):
        return False
    if since >= REPLAN_FREED and grid.removed != memory.removed_then:
        return False
    return grid.is_way_open(way, memory.goal_radius)
