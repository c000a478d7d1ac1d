"""What a closed lap proves: that there is no way, if the goal lies on the wall's side of it."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import pytest

from bug_gym.agents import make_policy
from bug_gym.agents.walls.boundary import Boundary
from bug_gym.agents.walls.contour import BugMemory, Contour
from bug_gym.agents.walls.laps import is_proof
from bug_gym.config import load
from bug_gym.view import Sensors

BOUNDARY = Boundary(Sensors.of(load("disc")))
STEP = 0.1


def walked(
    goal: tuple[float, float],
    side: int,
    around: int,
    laps: int = 1,
    nook: float = 0.0,
    been: tuple[float, float] | None = None,
) -> tuple[Contour, list[bool]]:
    """A contour after laps round a circle of 2 m, counter-clockwise with `around` 1, and what each step proved.

    A nook of so many metres is walked into in the first eighth of a lap only. `been` is where it was before.
    """
    angle = STEP / 2.0
    contour, proofs = Contour(side, (2.0, 0.0), (0.0, 0.0), (2.0, 0.0), goal, around * 0.5 * math.pi, been=been), []
    for step in range(1, math.ceil(laps * 2.0 * math.pi / angle) + 8):
        radius = 2.0 + nook * math.sin(8.0 * step * angle) ** 2 if 8.0 * step * angle < math.pi else 2.0
        place = radius * math.cos(around * step * angle), radius * math.sin(around * step * angle)
        view: Any = SimpleNamespace(position=place, goal_position=goal, nearest=lambda: (BOUNDARY.clearance, 0.0))
        BOUNDARY.laps.advance(view, contour)
        proofs.append(is_proof(contour))
    return contour, proofs


@pytest.mark.parametrize("side", [1, -1])
def test_nobody_is_shut_in_by_a_lap_that_does_not_hold_where_it_has_been(side: int) -> None:
    """A closed curve is at most half as wide as it is long, here six metres; what one has gone round says nothing of it."""
    goal, outside, inside = (9.0, 0.0), (12.0, 3.0), (-1.5, 1.0)
    for been, proves in ((None, True), (inside, True), (outside, False)):
        contour, proofs = walked(goal, side, side, been=been)
        assert any(proofs) == proves and contour.vain_laps == (not proves)
        assert any(walked((0.0, 0.0), side, -side, been=been)[1])


@pytest.mark.parametrize("is_disturbed", [False, True])
def test_a_gate_passed_over_and_over_without_a_turn_is_gone_round_in_vain(is_disturbed: bool) -> None:
    """The way is a figure of eight, which turns by nothing in all; where something moves it says nothing."""
    contour = Contour(1, (0.0, 4.0), (0.0, 5.0), (0.0, 4.0), (90.0, 0.0), math.pi)
    angle, rounds = STEP / 2.0, 0
    for step in range(1, 2000):
        along = math.pi + step * angle
        turn = 1.0 if along % (4.0 * math.pi) < 2.0 * math.pi else -1.0
        place = (2.0 * math.sin(along), turn * 2.0 * (1.0 - math.cos(along)))
        view: Any = SimpleNamespace(
            position=place, goal_position=(90.0, 0.0), nearest=lambda: (BOUNDARY.clearance, 0.0)
        )
        contour.is_disturbed = is_disturbed
        BOUNDARY.laps.advance(view, contour)
        assert not contour.is_lap_closed
        rounds = int(along / (4.0 * math.pi))
        if contour.vain_laps > 1:
            break
    assert (contour.vain_laps == 2) is not is_disturbed and rounds >= 2


@pytest.mark.parametrize("name", ["bug1", "bug2", "alg2", "class1", "com1", "dist_bug", "tangent_bug", "vis_bug_21"])
def test_a_complete_bug_begins_anew_three_times_before_it_calls_itself_looping(name: str) -> None:
    policy: Any = make_policy(name, "disc")
    boundary = policy.vision.boundary if name == "vis_bug_21" else policy.boundary
    memory, unseen = BugMemory(), cast(Any, None)
    for starts in range(5):
        memory.contour = walked((9.0, 0.0), 1, -1, laps=2)[0]
        assert boundary.follow(unseen, memory) == (0.0, 0.0)
        assert (memory.fresh_starts, memory.verdict) == (min(starts + 1, 3), "looping" if starts > 2 else "")
        if memory.verdict:
            break
        assert memory.is_fresh and memory.contour is None
    assert starts == 3


GOALS = {True: [(0.0, 0.0), (1.2, -1.0), (-1.9, 0.3)], False: [(9.0, 0.0), (2.3, -1.0), (-1.0, 2.2)]}
"""Within the circle, and outside of it."""


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("is_within", [True, False])
def test_round_an_obstacle_the_goal_must_lie_within_and_in_a_room_outside(side: int, is_within: bool) -> None:
    """With the wall on the right one goes round an obstacle clockwise, and round a room the other way."""
    for goal in GOALS[is_within]:
        assert any(walked(goal, side, -side)[1]) == is_within
        assert any(walked(goal, side, side)[1]) != is_within


def test_who_closes_two_laps_that_do_not_part_it_from_the_goal_is_looping() -> None:
    contour, proofs = walked((9.0, 0.0), 1, -1, laps=2)
    assert not any(proofs) and contour.vain_laps == 2
    memory = BugMemory(contour=contour)
    unseen: Any = None
    assert BOUNDARY.follow(unseen, memory) == (0.0, 0.0) and memory.verdict == "looping"


@pytest.mark.parametrize("side", [1, -1])
def test_a_car_that_turns_by_backing_has_turned_as_its_heading_has(side: int) -> None:
    """Round a square, each corner a quarter of a circle backwards: the way leads back there, and says nothing of a turn."""
    car, goal, radius = Boundary(Sensors.of(load("ackermann"))), (3.0, -side * 3.0), 0.5
    contour = Contour(side, (0.0, 0.0), (0.0, -side * 0.3), (0.0, 0.0), goal, 0.0)
    x, y, heading, closed = 0.0, 0.0, 0.0, []
    for _ in range(5):
        for step in range(61):
            along, left = (STEP, 0.0) if step < 60 else (-radius, side * radius)
            heading -= side * 0.5 * math.pi * (step == 60)
            before = heading + side * 0.5 * math.pi * (step == 60)
            x += math.cos(before) * along - math.sin(before) * left
            y += math.sin(before) * along + math.cos(before) * left
            view: Any = SimpleNamespace(
                position=(x, y), heading=heading, goal_position=goal, nearest=lambda: (car.clearance, 0.0)
            )
            car.laps.advance(view, contour)
            assert contour.turned == pytest.approx(heading, abs=1e-9)
            if contour.is_lap_closed:
                closed.append(is_proof(contour))
    assert closed == [True]


@pytest.mark.parametrize("nook", [0.5, 1.0, 2.0])
def test_a_gate_in_a_nook_that_is_passed_by_later_stands_anew(nook: float) -> None:
    """A younger one is passed before the third lap ends, so that the fourth is closed."""
    contour, proofs = walked((0.0, 0.0), 1, -1, laps=1, nook=nook)
    assert contour.gate is not None and math.hypot(*contour.gate.place) > 2.3 and not any(proofs)
    contour, proofs = walked((0.0, 0.0), 1, -1, laps=4, nook=nook)
    assert contour.lost_gates == 1 and any(proofs)
    assert math.hypot(*contour.gate.place) == pytest.approx(2.0) if contour.gate else False


@pytest.mark.parametrize("lead", [3.0, 11.0, 40.0])
def test_a_way_that_goes_round_without_a_turn_is_found_out_wherever_its_gate_is(lead: float) -> None:
    """From a straight way of so many metres, on which the gate is, it comes to a figure of eight that does not lead there."""
    contour = Contour(1, (-lead, 0.0), (0.0, -1.0), (-lead, 0.0), (90.0, 0.0), 0.0)
    straight, angle, eight = round(lead / STEP), STEP / 2.0, round(8.0 * math.pi / STEP)
    for step in range(1, straight + 20 * eight):
        along = max(step - straight, 0) * angle
        turn = 1.0 if along % (4.0 * math.pi) < 2.0 * math.pi else -1.0
        place = (2.0 * math.sin(along), turn * 2.0 * (1.0 - math.cos(along)))
        if step < straight:
            place = ((step - straight) * STEP, 0.0)
        view: Any = SimpleNamespace(
            position=place, goal_position=(90.0, 0.0), nearest=lambda: (BOUNDARY.clearance, 0.0)
        )
        BOUNDARY.laps.advance(view, contour)
        assert not contour.is_lap_closed
        if contour.vain_laps > 1:
            break
    # A gate is set where it has come twice as far: within two rounds and the way before; then it is passed three times.
    assert contour.vain_laps == 2 and contour.odometer <= 2.0 * (lead + 8.0 * math.pi) + 4.0 * 8.0 * math.pi


@pytest.mark.parametrize("is_known", [True, False])
def test_else_a_lap_that_comes_by_one_is_no_proof_yet(is_known: bool) -> None:
    contour, _ = walked((0.0, 0.0), 1, -1)
    contour.is_lap_closed, contour.takes_less, contour.way_out, contour.has_no_other = True, False, 5.0, is_known
    assert is_proof(contour) == is_known
