"""Visibility graph: the exact shortest way, round the corners of obstacles grown by the body (a map planner).

Source: Lozano-Perez and Wesley (1979); here the project's own shortest path (bug_gym/shortest_path.py), which finds it
by A* over the corners at which a taut string can bend. Sensing assumed: the map, own place on it. Memory kept: the way.
States: planning, following, waiting. Guarantee: reaches the goal in still worlds or says that there is no way at all.
Length: the shortest of all ways that keep the margin. What others' ways are measured by.
"""

from __future__ import annotations

from bug_gym.agents.planning.follow import Scene
from bug_gym.agents.planning.planner import (
    MapPlanner,
    Plan,
    PlannerMemory,
    exact_way,
    is_shut_in,
    live_of,
    mover_discs,
    no_way,
)

NEAREST = 0.99
"""A shortest path comes as near to obstacles as this share of the radius it is asked for."""


class VisibilityGraph(MapPlanner):
    """The exact planner; its parameters are those of MapPlanner."""

    def plan(self, scene: Scene, memory: PlannerMemory) -> Plan:
        """The shortest way with as much room as there is."""
        live = live_of(memory)
        plan = live.still if scene.moving is None else live.still.with_obstacles(mover_discs(scene.moving))
        for room in self.rooms:
            radius = room.growth / NEAREST
            places = exact_way(plan, scene.pose[:2], scene.goal, radius=radius, goal_radius=self.sensors.goal_radius)
            if places is not None:
                return Plan(places, room.margin)
        if scene.moving is None and is_shut_in(plan, scene.pose[:2], scene.goal, self.sensors):
            return Plan(None, reason=no_way(plan, scene, self.sensors), verdict="unreachable")
        reason = no_way(live.still, scene, self.sensors, beside=self.rooms[-1].margin)
        return Plan(None, reason=reason, verdict="stuck" if scene.moving is None else "")
