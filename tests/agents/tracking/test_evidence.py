"""What a tracker leaves out of its evidence could not have changed what it takes a track for."""

from __future__ import annotations

import numpy as np
from compiled import for_python

from bug_gym.agents.tracking import evidence, layout


def evidence_after(before: float, passes: int) -> float:
    """The rule: half a point a beam, at most two at once, from two beams on; half a point less without; 0 to 4."""
    return min(max(before + (min(0.5 * passes, 2.0) if passes > 1 else -0.5), 0.0), 4.0)


def test_beams_are_counted_as_long_as_one_more_changes_the_evidence() -> None:
    most_passes, state = for_python(evidence.most_passes), np.zeros(layout.STATE)
    for before in np.arange(0.0, 4.5, 0.5).tolist():
        state[layout.EVIDENCE] = before
        most = most_passes(state)
        assert {evidence_after(before, passes) for passes in range(most, 40)} == {evidence_after(before, most)}
        assert evidence_after(before, most - 1) < evidence_after(before, most)


def test_no_track_begins_to_move_of_which_nobody_asked_how_its_hits_lie() -> None:
    may_begin, is_mover = for_python(evidence.may_begin_to_move), for_python(evidence.is_mover)
    rng = np.random.default_rng(0)
    begun = asked = 0
    for _ in range(15_000):
        state, numbers = np.zeros(layout.STATE), np.zeros(layout.NUMBERS, dtype=np.int64)
        state[[layout.VX, layout.VY]] = rng.normal(0.0, 0.3, 2)
        state[[layout.VXX, layout.VYY]] = rng.uniform(0.003, 0.2, 2)
        state[layout.EVIDENCE] = 0.5 * rng.integers(0, 9)
        numbers[layout.HITS], numbers[layout.WHOLE] = rng.integers(0, 32), rng.integers(0, 6)
        numbers[layout.BEAMS], numbers[layout.IS_CONFIRMED] = rng.integers(1, 6), rng.integers(0, 2)
        is_asked = may_begin(state, numbers)
        # whatever this update adds to its evidence, and however well its hits fit the motion
        state[layout.EVIDENCE] = evidence_after(state[layout.EVIDENCE], int(rng.integers(0, 8)))
        state[layout.AS_STILL] = 1.0
        has_begun = is_mover(state, numbers)
        assert is_asked or not has_begun
        begun, asked = begun + has_begun, asked + is_asked
    assert 200 < begun < asked < 3000
