"""The last resort of bugs with a range sensor: after a lap, straight from its nearest point, or no way."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from bug_gym.agents.walls.contour import CLOSER, Contour, Gate
from bug_gym.agents.walls.survey import Survey, survey_lap

STEP = 0.1
LAP = (5.0, 4.0, 3.0, 4.0, 5.0)
"""Distances to the goal on a lap, at whose end it is closed [m]."""
AGAIN = (4.0, 3.0, 3.02, 4.0, 5.0)
"""Those of the lap after it: it passes the nearest point and goes away again [m]."""


def advice(hit_distance: float, *, is_open: bool = True, free: float = 1.0) -> list[str]:
    """What is advised on two laps round a goal that is shut in, with a free way from every place [m]; as far as the end."""
    contour = Contour(1, (9.0, 0.0), (0.0, 0.0), (9.0, 0.0), (0.0, 0.0), math.pi)
    contour.gate, contour.turned, contour.wound = Gate((9.0, 0.0), 0.0, 0.0, 0.0), -2.0 * math.pi, 2.0 * math.pi
    boundary: Any = SimpleNamespace(step=STEP, is_open=lambda *_: is_open, free_way=lambda *_: free)
    survey = Survey()
    told: list[str] = []
    for distances in (LAP, AGAIN):
        for number, distance in enumerate(distances):
            contour.is_lap_closed = number == len(distances) - 1
            view: Any = SimpleNamespace(goal_distance=distance, goal_bearing=0.0)
            told.append(survey_lap(boundary, view, contour, survey, hit_distance))
            if told[-1]:
                return told
    return told


def test_after_a_lap_it_leaves_where_it_passes_the_nearest_point_again() -> None:
    assert advice(3.5) == [""] * 7 + ["leave"]


@pytest.mark.parametrize(("nearer", "is_open", "leaves"), [(1.1, True, True), (0.9, True, False), (9.0, False, False)])
def test_a_nearest_point_that_is_shut_or_hardly_nearer_than_the_hit_point_says_that_there_is_no_way(
    nearer: float, is_open: bool, leaves: bool
) -> None:
    """In an acute corner one of two walls may let it pass for open; `nearer` is by how much, in what counts as nearer."""
    told = advice(3.0 + nearer * CLOSER * STEP, is_open=is_open)
    assert told == ([""] * 7 + ["leave"] if leaves else [""] * 4 + ["unreachable"])


def test_where_the_way_from_there_is_blocked_after_all_a_second_lap_is_the_proof() -> None:
    assert advice(3.5, free=0.0) == [""] * 9 + ["unreachable"]


def test_a_lap_that_begins_anew_begins_anew_with_what_it_knows() -> None:
    """Something has moved: the nearest point of the lap before means nothing."""
    contour = Contour(1, (9.0, 0.0), (0.0, 0.0), (9.0, 0.0), (0.0, 0.0), math.pi)
    boundary: Any = SimpleNamespace(step=STEP, is_open=lambda *_: True, free_way=lambda *_: 1.0)
    survey = Survey()
    for odometer, distance in ((0.0, 3.0), (1.0, 4.0)):
        contour.gate = Gate((9.0, 0.0), 0.0, odometer, 0.0)
        view: Any = SimpleNamespace(goal_distance=distance, goal_bearing=0.0)
        survey_lap(boundary, view, contour, survey, 9.0)
        assert (survey.distance, survey.next_wall) == (distance, distance - 1.0)
