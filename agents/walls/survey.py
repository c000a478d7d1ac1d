"""The last resort of bugs with a range sensor: to leave straight from the nearest point of a lap, as Bug1 does.

Source: Lumelsky and Stepanov (1987) for the test of reachability.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from bug_gym.agents.walls.boundary import Boundary
from bug_gym.agents.walls.contour import CLOSER, Contour, Gate
from bug_gym.agents.walls.laps import shows_no_way
from bug_gym.view import View


@dataclass
class Survey:
    """What a bug learns of a lap that offers no other place to leave: the nearest point to the goal, as in Bug1."""

    distance: float = math.inf
    """From that point to the goal [m]."""
    is_open: bool = False
    """Whether the goal lies away from the wall there."""
    next_wall: float = math.inf
    """Distance to the goal at the end of the free way from there straight toward it [m]; infinite without one."""
    before: float = math.inf
    """Distance to the goal at the last decision [m]."""
    is_second_lap: bool = False
    """Whether the lap is closed, and the robot on its way to that point."""
    gate: Gate | None = None
    """Where the lap began."""


def survey_lap(
    boundary: Boundary, view: View, contour: Contour, survey: Survey, hit_distance: float
) -> Literal["", "leave", "unreachable"]:
    """Whether to leave straight from the nearest point of a lap, as Bug1 does, or to give up.

    A lap without any place to leave means that there is no way. But a scan may take two obstacles for one, or an
    obstacle may stand so near to the next that no leave point is seen: the nearest point tells for sure. There the
    goal lies away from the wall, unless the obstacle shuts the goal or the robot in. In an acute corner one of two
    walls may let it pass for open; then the lap that begins there finds no place nearer.

    Args:
        boundary: the robot's settings at walls.
        view: the observation.
        contour: the boundary followed.
        survey: what is known of the lap, changed in place.
        hit_distance: distance to the goal at the hit point [m]; to leave, the nearest point must be nearer.

    Returns:
        "leave": leave straight toward the goal, now; "unreachable": two laps or one have shown that there is no
        way; "": go on.
    """
    if survey.gate is not contour.gate:  # something moved, and the lap begins anew
        survey.gate, survey.distance, survey.is_second_lap = contour.gate, math.inf, False
    distance, before = view.goal_distance, survey.before
    survey.before = distance
    is_there = survey.is_second_lap and before <= distance <= survey.distance + 0.5 * boundary.step
    if is_there and boundary.free_way(view, view.goal_bearing, distance) > 0.0:
        return "leave"
    if contour.is_lap_closed:
        is_nearer = survey.distance < hit_distance - CLOSER * boundary.step
        if survey.is_second_lap or not (survey.is_open and is_nearer):
            return "unreachable" if shows_no_way(contour) else ""
        survey.is_second_lap = True
    elif distance < survey.distance and contour.gate is not None and not survey.is_second_lap:
        survey.distance, survey.is_open = distance, boundary.is_open(view, contour)
        way = boundary.free_way(view, view.goal_bearing, distance)
        survey.next_wall = distance - way if way > 0.0 else math.inf
    return ""
