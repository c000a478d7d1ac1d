"""How a tracker weighs whether a thing moves: the sums against a plain account, the clues against mirrors and closed forms."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compiled import for_python
from tracked import constant_network, disc, track, world_of

from bug_gym.agents.tracking import layout, motion
from bug_gym.agents.tracking.evidence import LAGS, MOST_PASSES, PLACE
from bug_gym.agents.tracking.motion import (
    FEW,
    FORGOTTEN_IN,
    LEAST_FORGOTTEN,
    MOST_ADDED,
    MOST_EVIDENCE,
    OF_SLOW,
    STILL_OF_FEW,
    STILL_SURE,
    SURELY_MOVES,
    SURELY_OF_FEW,
    Network,
)
from bug_gym.agents.tracking.tracker import Tracker, TrackerMemory
from bug_gym.view import View


def tracked(
    scenario: dict[str, Any], seconds: float, network: Network | None = None
) -> Iterator[tuple[View, Tracker, TrackerMemory]]:
    """Updates of a tracker of a robot that stands, with its memory after each."""
    tracker = memory = None
    for simulation, view, _ in track(scenario, seconds):
        tracker = tracker or Tracker(view.sensors, network)
        memory = memory or tracker.start()
        tracker.update(memory, view, float(simulation.world.time[0]))
        yield view, tracker, memory


def only_track(memory: TrackerMemory) -> int:
    """The place of the one track there is."""
    (place,) = np.flatnonzero(memory.numbers[:, layout.ID])
    return int(place)


def test_answers_are_what_two_layers_of_rectified_units_say() -> None:
    answers, network = for_python(motion.answers), motion.shipped()
    rng = np.random.default_rng(0)
    for clue in rng.normal(0.0, 2.0, (50, layout.CLUES)):
        first = np.maximum(clue @ network.first + network.first_offset, 0.0)
        second = np.maximum(first @ network.second + network.second_offset, 0.0)
        odds, gate = second @ network.last + network.last_offset
        added, forgotten = answers(clue, network, rng.normal(size=(2, len(network.last))))
        assert added == pytest.approx(MOST_ADDED * math.tanh(odds / MOST_ADDED), rel=1e-9, abs=1e-9)
        assert forgotten == pytest.approx(LEAST_FORGOTTEN + (1.0 - LEAST_FORGOTTEN) / (1.0 + math.exp(-gate)), rel=1e-9)


@pytest.mark.parametrize("log_odds", [-30.0, -1.0, 0.0, 2.0, 30.0])
@pytest.mark.parametrize(
    ("gate", "forgotten"), [(math.inf, 1.0), (0.0, 0.5 * (1.0 + LEAST_FORGOTTEN)), (-math.inf, LEAST_FORGOTTEN)]
)
def test_evidence_is_a_bounded_sum_that_is_forgotten_of_bounded_terms(
    log_odds: float, gate: float, forgotten: float
) -> None:
    """Counted in the second update in a row and after; of a thing without speed a term is OF_SLOW, and forgotten fast."""
    expected, kinds = 0.0, set()
    network = constant_network(log_odds, gate)
    for number, (_, _, memory) in enumerate(tracked(world_of([disc((3.0, -1.0), (0.0, 0.6))]), 2.0, network)):
        state = memory.state[only_track(memory)]
        is_slow = math.hypot(state[layout.VX], state[layout.VY]) <= motion.LEAST_SPEED
        if number:
            kinds.add(is_slow)
            added = OF_SLOW if is_slow else MOST_ADDED * math.tanh(log_odds / MOST_ADDED)
            expected *= math.exp(-0.1 * (1.0 if is_slow else forgotten) / FORGOTTEN_IN)
            expected = min(max(expected + added, -MOST_EVIDENCE), MOST_EVIDENCE)
        assert state[layout.EVIDENCE] == pytest.approx(expected, abs=1e-9)
    assert False in kinds


def test_a_thing_is_a_mover_from_one_bound_on_until_another() -> None:
    is_mover = for_python(motion.is_mover)
    state, numbers = np.zeros(layout.STATE), np.zeros(layout.NUMBERS, dtype=np.int64)
    state[[layout.VXX, layout.VYY]] = 0.01
    cases = product((0, 1), (0, 1), (0, 1), (1, FEW - 1, FEW, 40), (0.2, 0.6))
    for confirmed, moving, has_moved, beams, speed in cases:
        numbers[layout.IS_CONFIRMED], numbers[layout.IS_MOVING], numbers[layout.BEAMS] = confirmed, moving, beams
        numbers[layout.HAS_MOVED], state[layout.VX] = has_moved, speed
        if moving:  # its speed is beyond 4 standard deviations, or is not
            bound = STILL_OF_FEW if beams < FEW and speed > 4.0 * 0.1 else STILL_SURE
        else:
            bound = SURELY_OF_FEW if beams < FEW and not has_moved else SURELY_MOVES
        for evidence in np.linspace(STILL_OF_FEW - 2.0, SURELY_OF_FEW + 2.0, 61).tolist():
            state[layout.EVIDENCE] = evidence
            assert is_mover(state, numbers) == ((moving or confirmed) and evidence >= bound)


@pytest.mark.parametrize(("away", "is_told"), [(2.0, True), (6.0, False)])
def test_of_what_one_or_two_beams_meet_more_is_asked(away: float, is_told: bool) -> None:
    """Log odds come to 8; the disc is met by three beams or more where it is near, and always by fewer where it is far."""
    added = 8.0 * (1.0 - math.exp(-0.1 / FORGOTTEN_IN))
    network = constant_network(MOST_ADDED * math.atanh(added / MOST_ADDED))
    beams, told = [], False
    for _, _, memory in tracked(world_of([disc((away, -0.5), (0.0, 0.5))], beams=64), 2.5, network):
        seen = memory.numbers[memory.numbers[:, layout.BEAMS] > 0]
        beams += seen[:, layout.BEAMS].tolist()
        told = told or bool(seen[:, layout.IS_MOVING].any())
    assert told == is_told
    assert max(beams) >= FEW if is_told else 0 < max(beams) < FEW


def test_no_tenth_of_a_second_alone_tells_a_mover() -> None:
    """However sure the network is: twice as much does."""
    assert MOST_ADDED < SURELY_MOVES < MOST_ADDED * (1.0 + math.exp(-0.1 / FORGOTTEN_IN))
    moving = [
        bool(memory.numbers[only_track(memory), layout.IS_MOVING])
        for _, _, memory in tracked(world_of([disc((3.0, -1.0), (0.0, 0.6))]), 0.5, constant_network(99.0))
    ]
    assert not any(moving[:2]) and all(moving[3:])


def test_what_is_hidden_keeps_its_evidence_and_so_does_its_first_sight_after() -> None:
    scenario = world_of([disc((3.5, -2.5), (0.0, 0.8))], noise=0.01, circles=[[1.8, 0.0, 0.5]])
    hidden = first_sights = 0
    before: dict[int, tuple[float, bool]] = {}
    for _, _, memory in tracked(scenario, 6.0):
        now = {}
        for place in np.flatnonzero(memory.numbers[:, layout.ID]):
            number, is_seen = int(memory.numbers[place, layout.ID]), bool(memory.numbers[place, layout.HITS] & 1)
            now[number] = (float(memory.state[place, layout.EVIDENCE]), is_seen)
            if number in before and not (is_seen and before[number][1]):
                assert now[number][0] == before[number][0]
                hidden += not is_seen
                first_sights += is_seen
        before = now
    assert hidden > 3 and first_sights > 0


def test_a_mirrored_world_gives_the_same_clues() -> None:
    """Beams, bodies and what moves are mirrored at the robot's heading; one passes before it, where beams begin and end."""

    def clues(side: float) -> list[np.ndarray[Any, np.dtype[np.float64]]]:
        movers = [disc((3.0, -1.0 * side), (0.1, 0.5 * side)), disc((-2.0, 2.0 * side), (0.3, 0.1 * side), 0.5)]
        found = []
        for _, tracker, memory in tracked(world_of(movers, circles=[[2.5, 2.5 * side, 0.4]], beams=90), 3.0):
            places = np.flatnonzero(memory.numbers[:, layout.ID])
            order = places[np.argsort(memory.state[places, layout.X])]
            found.append(tracker.clues[order].copy())
        return found

    compared = 0
    for one, other in zip(clues(1.0), clues(-1.0), strict=True):
        assert one == pytest.approx(other, abs=2e-3)  # ranges are float32
        compared += int(np.abs(one).any(axis=1).sum())
    assert compared > 30


def test_clues_of_a_disc_that_crosses_are_its_own_numbers() -> None:
    """A disc of 0.3 m goes aside at 0.6 m/s, 3 m ahead: how fast, which way, how large, and beams that passed."""
    for _, tracker, memory in tracked(world_of([disc((3.0, -0.9), (0.0, 0.6))], beams=360), 1.5):
        clue, age = tracker.clues[only_track(memory)], memory.time - memory.state[only_track(memory), layout.BORN]
    assert clue[layout.SPEED] == pytest.approx(0.6, abs=0.05)
    assert clue[layout.SPEED_ACROSS] == pytest.approx(0.6, abs=0.05)
    assert abs(clue[layout.SPEED_ALONG]) < 0.1
    assert clue[layout.DISTANCE] == pytest.approx(3.0, abs=0.05)
    assert clue[layout.RADIUS_OF] == pytest.approx(0.3, abs=0.05)
    assert clue[layout.OWN_ENDS_OF] == 2 and clue[layout.HIDDEN_ENDS_OF] == 0
    assert clue[layout.AGE] == pytest.approx(math.log(age))
    assert clue[layout.ROBOT_ALONG] == clue[layout.ROBOT_ACROSS] == 0.0
    spacing = math.radians(1.0)
    assert math.exp(clue[layout.BEAMS_OF]) == pytest.approx(2.0 * math.asin(0.3 / 3.0) / spacing, abs=2.0)
    for k, lag in enumerate((0.2, 0.5, 1.2)):
        # as it moved it lies on what was seen of it, and less so in place the longer ago that is
        assert clue[layout.MOVED_OFF + k] < math.log(0.04)
        assert clue[layout.STOOD_OFF + k] > clue[layout.MOVED_OFF + k]
        passed = min(0.6 * lag / (3.0 * spacing), MOST_PASSES)
        for column in (layout.PASSED_NOW, layout.PASSED_THEN):
            assert 0.2 * passed <= round(math.expm1(clue[column + k])) <= MOST_PASSES
        # A hit lies where something was if the outlines of then and now are less than PLACE apart along the normal.
        explained = min(PLACE / (0.6 * lag), 1.0) if 0.6 * lag < 2.0 * 0.3 else 0.0
        assert clue[layout.EXPLAINED + k] == pytest.approx(explained, abs=0.1)


def test_where_another_mover_was_is_no_place_where_something_stood() -> None:
    """One follows another by 0.66 m at 0.6 m/s: 1.2 s ago, 0.72 m back, the first was nearly where the second is now."""
    movers = [disc((3.0, y), (0.0, 0.6), 0.25) for y in (-0.5, -1.16)]
    *_, (_, tracker, memory) = tracked(world_of(movers, beams=360), 2.0)
    places = np.flatnonzero(memory.numbers[:, layout.ID])
    last, first = places[np.argsort(memory.state[places, layout.Y])]
    assert memory.numbers[[last, first], layout.IS_MOVING].all()
    assert tracker.clues[last, layout.EXPLAINED + 2] == 0.0
    assert tracker.clues[last, layout.STOOD_OFF + 2] == pytest.approx(
        tracker.clues[first, layout.STOOD_OFF + 2], abs=0.1
    )


def test_beside_a_robot_that_drives_its_own_velocity_is_told() -> None:
    scenario = world_of([], circles=[[3.0, 2.0, 0.4]])
    tracker = memory = None
    told = 0
    for simulation, view, _ in track(scenario, 2.0, policy="go_to_goal"):
        tracker = tracker or Tracker(view.sensors)
        memory = memory or tracker.start()
        tracker.update(memory, view, float(simulation.world.time[0]))
        place = only_track(memory)
        if not tracker.clues[place].any():
            continue
        clue = tracker.clues[place]
        speed = math.hypot(*view.own_velocity)
        if memory.time > LAGS[-1]:  # it stands
            assert (clue[layout.EXPLAINED : layout.EXPLAINED + layout.COMPARED_SCANS] > 0.5).all()
        assert math.hypot(clue[layout.ROBOT_ALONG], clue[layout.ROBOT_ACROSS]) == pytest.approx(speed, abs=1e-6)
        told += speed > 0.5
    assert told > 0


@pytest.mark.parametrize("change", ["missing", "more", "shape", "list"])
def test_other_weights_are_refused(change: str, tmp_path: Path) -> None:
    told: Any = {name: array.tolist() for name, array in motion.shipped()._asdict().items()}
    if change == "missing":
        del told["second"]
    elif change == "more":
        told["third"] = [0.0]
    elif change == "shape":
        told["last"] = told["last"][1:]
    else:
        told = [told]
    path = tmp_path / "weights.json"
    path.write_text(json.dumps(told))
    with pytest.raises(ValueError, match="expected"):
        motion.network_of(path)
