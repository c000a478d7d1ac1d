"""Bug0 and Bug2 against closed forms and the map of Oni and Wang."""

from __future__ import annotations

from typing import Any

import pytest
from episodes import CLOSED_FORM_SENSORS, OTHER, Disc, Slab, UTrap, canonical_world, run_episode, tolerance

SLAB, DISC, TRAP = Slab(), Disc(), UTrap()

CASES = [
    ("bug0", "slab", SLAB.until_free),
    ("bug2", "slab", SLAB.until_line),
    ("bug0", "disc", lambda turn: DISC.until_free()),
    ("bug2", "disc", lambda turn: DISC.until_line()),
    ("bug0", "u_trap", lambda turn: TRAP.until_free()),
    ("bug2", "u_trap", lambda turn: TRAP.until_line()),
]


@pytest.mark.parametrize("turn", ["left", "right"])
@pytest.mark.parametrize("angle", [0.0, 0.83])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("policy", "world", "length"), CASES, ids=lambda case: case if isinstance(case, str) else "")
def test_the_way_has_the_length_of_its_closed_form(
    policy: str, world: str, length: Any, turn: str, angle: float, mirrored: bool
) -> None:
    scenario = canonical_world(world, angle=angle, mirrored=mirrored)
    episode = run_episode(policy, scenario, turn=turn, clearance=0.5)
    expected = length(OTHER[turn] if mirrored else turn)
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))


@pytest.mark.parametrize("turn", ["left", "right"])
def test_bug0_that_leaves_in_any_direction_stays_in_the_trap(turn: str) -> None:
    episode = run_episode("bug0", canonical_world("u_trap"), turn=turn, clearance=0.5, leave_rule="any")
    assert episode.verdict == "looping"


# Ideal lengths on the map of Oni and Wang at a clearance of 1 m, turning left, rounded contour (None: cycles for ever).
BUG0_ROUTES = {"AB": 17.10, "AC": None, "AD": 42.82, "BA": None, "BC": None, "BD": 31.68}
BUG0_ROUTES |= {"CA": None, "CB": 10.90, "CD": None, "DA": 44.90, "DB": 57.24, "DC": None}
BUG2_ROUTES = {"AB": 19.14, "AC": 137.57, "AD": 53.29, "BA": 133.42, "BC": 118.42, "BD": 34.14}
BUG2_ROUTES |= {"CA": 145.57, "CB": 12.14, "CD": 62.28, "DA": 48.14, "DB": 59.28, "DC": 90.28}


@pytest.mark.parametrize("route", BUG0_ROUTES)
@pytest.mark.parametrize(("policy", "routes"), [("bug0", BUG0_ROUTES), ("bug2", BUG2_ROUTES)], ids=["bug0", "bug2"])
def test_the_routes_of_oni_and_wang(policy: str, routes: dict[str, float | None], route: str) -> None:
    places = {"world.start": route[0], "world.goal": route[1]}
    episode = run_episode(policy, "oni_wang", {**CLOSED_FORM_SENSORS, **places}, clearance=1.0)
    expected = routes[route]
    if expected is None:
        assert episode.verdict == "looping"
        return
    assert episode.outcome == "success"
    assert episode.full_length == pytest.approx(expected, abs=tolerance(expected))
