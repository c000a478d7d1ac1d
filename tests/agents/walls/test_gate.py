"""The door across a contour that tells a lap."""

from __future__ import annotations

import math

import pytest

from bug_gym.agents.walls.contour import Gate


@pytest.mark.parametrize("rounding", [0.0, 1e-9, -1e-9])
@pytest.mark.parametrize("heading", [0.0, 0.7, math.pi, -2.0])
def test_who_goes_to_and_fro_from_its_place_passes_it_once_each_time(heading: float, rounding: float) -> None:
    gate = Gate((3.0, -2.0), heading, 0.0, 0.0)
    ahead = 3.0 + 0.1 * math.cos(heading), -2.0 + 0.1 * math.sin(heading)
    place = 3.0 + rounding * math.cos(heading), -2.0 + rounding * math.sin(heading)
    assert gate.is_passed(place, ahead, 0.05, heading)
    assert not gate.is_passed(ahead, place, 0.05, heading + math.pi)


@pytest.mark.parametrize("offset", [0.0, 0.03, 0.05, 0.1 - 1e-9])
def test_a_way_through_it_passes_in_one_step(offset: float) -> None:
    gate = Gate((0.0, 0.0), 0.0, 0.0, 0.0)
    places = [(0.1 * number - offset, 0.01) for number in range(-5, 6)]
    passed = [gate.is_passed(before, after, 0.05, 0.0) for before, after in zip(places, places[1:], strict=False)]
    assert sum(passed) == 1
