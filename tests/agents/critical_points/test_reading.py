"""What a scan shows besides still things: movers, what they will cover, and beams without a return."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import pytest
from episodes import scene

from bug_gym.agents.critical_points.meeting import Mover, Times, virtual_obstacle
from bug_gym.agents.critical_points.moving import LEAST_LOOK, SAME_WAY, OpenPointSets, TrackSets
from bug_gym.agents.critical_points.reading import Scanner
from bug_gym.agents.tracking.layout import AT_X, AT_Y, GOES_X, MOVES, NUMBER, OF_RADIUS, THING_ROWS, UNSEEN
from bug_gym.geometry import F64
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View


def seen(scenario: dict[str, Any], reach: float = 40.0) -> tuple[Scanner, View]:
    """How it is seen from the start, with an eye that sees all walls whole."""
    simulation = Simulation(scenario, 1, overrides={"lidar.range": reach, "lidar.beams": 720})
    sensors = Sensors.of(simulation.scenario)
    return Scanner(sensors, radius=0.25, jump=0.5), View(simulation.reset(seeds=[0])[0, 0], sensors)


DISC = (4.0, 0.0, 0.4)
"""What moves in these scenes, before the far wall."""


def beams_at_disc(view: View) -> Any:
    """Whether each beam ends at it (B,)."""
    x, y = view.sensors.beam_directions * view.ranges
    return np.hypot(x - DISC[0], y - DISC[1]) < DISC[2] + 0.01


def test_before_a_whole_wall_something_still_has_two_ends_and_a_mover_none() -> None:
    """Nor has the wall behind it, of which it hides a part."""
    scanner, view = seen(scene(circles=[[*DISC]]))
    still, moving = scanner.read(view, None, ()), scanner.read(view, beams_at_disc(view), ())
    assert sorted(end.side for end in still.ends) == [-1, 1]
    assert moving.ends == []
    near = [int((np.hypot(one.x - DISC[0], one.y - DISC[1]) < 0.5).sum()) for one in (still, moving)]
    assert near[0] > 5 and near[1] == 0


def test_a_mover_does_not_hide_its_own_virtual_obstacle() -> None:
    """The capsule lies behind it, and is wider to both sides."""
    scanner, view = seen(scene(circles=[[*DISC]]))
    mover = Mover(3, (6.0, -4.0), (0.0, 1.0), DISC[2])
    virtual = virtual_obstacle(mover, Times(4.0, 3.0, 5.0))
    reading = scanner.read(view, beams_at_disc(view), [virtual])
    assert [(end.side, end.virtual) for end in sorted(reading.ends)] == [(-1, virtual), (1, virtual)]
    face = np.array([y for x, y in zip(reading.x, reading.y, strict=True) if abs(x - 5.6) < 1e-3])
    assert face.min() < -0.9 and face.max() > 0.9
    assert np.diff(np.sort(face)).max() < 0.1


@pytest.mark.parametrize("middle", [0, 100, 719])
@pytest.mark.parametrize(("missing", "is_gap"), [(3, False), (40, True)])
def test_a_wall_with_up_to_three_beams_missing_in_a_row_is_whole_where_the_scan_begins_and_ends_too(
    middle: int, missing: int, is_gap: bool
) -> None:
    scanner, view = seen(scene())
    ranges = view.ranges.copy()
    ranges[(middle - missing // 2 + np.arange(missing)) % len(ranges)] = scanner.sensors.range
    reading = scanner.read(view.with_ranges(ranges), None, ())
    assert bool(reading.ends) == is_gap
    assert len(reading.x) == (len(ranges) - missing if is_gap else len(ranges))


def test_where_the_scan_is_no_full_circle_its_ends_are_no_neighbours() -> None:
    simulation = Simulation(scene(), 1, overrides={"lidar.range": 40.0, "lidar.beams": 271, "lidar.fov": 1.5 * math.pi})
    sensors = Sensors.of(simulation.scenario)
    view = View(simulation.reset(seeds=[0])[0, 0], sensors)
    assert view.ranges[0] == pytest.approx(view.ranges[-1], abs=0.01)
    ranges = view.ranges.copy()
    ranges[0] = sensors.range
    reading = Scanner(sensors, radius=0.25, jump=0.5).read(view.with_ranges(ranges), None, ())
    assert len(reading.x) == 270


def test_a_bearing_belongs_to_the_beam_nearest_to_it() -> None:
    scanner, view = seen(scene())
    angles = view.sensors.angles
    for share in (-0.4, 0.0, 0.4):
        bearings = angles + share * view.sensors.beam_spacing
        found = [scanner._beam_at(math.atan2(math.sin(one), math.cos(one))) for one in bearings.tolist()]
        assert found == list(range(len(angles)))


# ------------------------------------------------------------------------------------------------ what moves


RULES = np.array([0.05, 0.5, LEAST_LOOK, SAME_WAY])


def thing_at(x: float, *, moving: bool = True, unseen: float = 0.0) -> F64:
    """What is told of one thing (THING_ROWS, 1)."""
    thing = np.zeros((THING_ROWS, 1))
    thing[[NUMBER, AT_X, GOES_X, OF_RADIUS, UNSEEN, MOVES], 0] = 1.0, x, 1.0, 0.4, unseen, moving
    return thing


@pytest.mark.parametrize(
    ("seen_as", "count"),
    [({}, 1), ({"moving": False}, 0), ({"unseen": 0.1}, 0)],
    ids=["seen", "no free space", "unseen"],
)
def test_dynamic_is_what_shifts_twice_in_sight_into_space_that_was_free(seen_as: dict[str, Any], count: int) -> None:
    """The view of a long thing shifts too, and what is out of sight is only thought to go on."""
    sets = TrackSets()
    movers: list[Mover] = []
    for step in range(11):
        movers, is_dynamic = sets.update(thing_at(0.1 * step, **seen_as), 0.1 * step, RULES)
        assert is_dynamic.tolist() == [len(movers) > 0, False]
    assert len(movers) == count
    assert count == 0 or movers == [Mover(1, (1.0, 0.0), (1.0, 0.0), 0.4)]


def sorted_by_hand(looks: dict[int, tuple[float, complex, complex, int]], things: F64, time: float) -> set[int]:
    """The rule of the sets, thing by thing: numbers of what is dynamic; `looks` has time, place, shift and set of each."""
    threshold, interval = RULES[:2]
    known = {}
    for number, x, y, unseen in things[[NUMBER, AT_X, AT_Y, UNSEEN]].T.tolist():
        place = complex(x, y)
        then, before, last_shift, shifts = looks.get(number, (time, place, 0j, 0))
        passed, shift = time - then + 1e-6, place - before
        due = passed >= interval or (passed >= LEAST_LOOK and abs(shift) > threshold)
        if unseen == 0.0 and due:
            turned = abs(cmath.phase(shift * last_shift.conjugate()))
            shifts = 0 if abs(shift) <= threshold else 2 if shifts and turned <= math.radians(60.0) else 1
            then, before, last_shift = time, place, shift
        known[number] = then, before, last_shift, shifts
    looks.clear()
    looks.update(known)
    moves = things[MOVES] > 0.0
    return {int(number) for number in things[NUMBER, moves].tolist() if known[number][3] == 2}


@pytest.mark.parametrize("seed", range(4))
def test_the_sets_are_sorted_as_thing_by_thing(seed: int) -> None:
    """Things that stand, go on, turn, go out of sight, come and go: the compiled looks follow the rule."""
    random, sets = np.random.default_rng(seed), TrackSets()
    looks: dict[int, tuple[float, complex, complex, int]] = {}
    things = np.zeros((THING_ROWS, 12))
    things[NUMBER], things[OF_RADIUS] = np.arange(1, 13), 0.3
    heading, speed = random.uniform(0.0, 6.3, 12), random.choice([0.0, 0.02, 0.2, 1.0], 12)
    found: set[int] = set()
    for step in range(120):
        heading += random.choice([0.0, 0.0, 0.0, 2.0], 12)
        things[[AT_X, AT_Y]] += 0.1 * speed * np.array([np.cos(heading), np.sin(heading)])
        things[UNSEEN] = random.choice([0.0, 0.0, 0.1], 12)
        things[MOVES] = random.choice([0.0, 1.0, 1.0], 12)
        there = np.ascontiguousarray(things[:, random.uniform(size=12) > 0.05])
        movers, is_dynamic = sets.update(there, 0.1 * step, RULES)
        numbers = {mover.number for mover in movers}
        assert numbers == sorted_by_hand(looks, there, 0.1 * step)
        assert numbers == set(there[NUMBER, is_dynamic[:-1]].tolist())
        found |= numbers
    assert 3 <= len(found) < 12


def test_by_the_printed_rule_a_shift_of_more_than_a_second_ago_is_forgotten() -> None:
    for later, count in ((0.2, 1), (2.0, 0)):
        sets = OpenPointSets()
        sets.update([((0.0, 0.0), 0.3)], 0.0, 0.05)
        assert sets.update([((0.1, 0.0), 0.3)], 0.1, 0.05) == []
        sets.update([], later - 0.01, 0.05)
        assert len(sets.update([((0.2, 0.0), 0.3)], later, 0.05)) == count
