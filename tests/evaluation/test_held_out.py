"""One episode in each of many worlds, a few hundred at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bug_gym.agents import make_policy
from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.evaluation.suites import load_suite, suite_names
from bug_gym.held_out import ENDS, TEST_SEEDS, TRAINING_SEEDS, VALIDATION_SEEDS, Played, play
from bug_gym.intervals import wilson_interval
from bug_gym.task import OUTCOMES

SHORT = load("rush", {"time.limit": 12.0})


class Counting:
    """Drives ahead for as many steps as its memory of the row has counted, then stands; numbers of discrete actions."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[np.ndarray[Any, Any], Any]:
        (steps,) = state or (np.zeros(len(observation), dtype=np.int64),)
        steps[episode_start] = 0
        steps += 1
        return np.where(steps <= 10, 3, 64), (steps,)


@pytest.mark.parametrize("slots", [1, 3, 50])
def test_episodes_end_as_in_an_evaluation_however_many_run_side_by_side(slots: int) -> None:
    rows = evaluate(["go_to_goal"], SHORT, episodes=9, seed=4)
    played = play(make_policy("go_to_goal", SHORT), SHORT, range(4, 13), slots=slots)
    assert [OUTCOMES[outcome] for outcome in played.outcome[:, 0]] == [row.outcome for row in rows]
    assert len({row.outcome for row in rows}) > 1
    np.testing.assert_allclose(played.time[:, 0], [row.time for row in rows], atol=1e-9)
    np.testing.assert_allclose(played.path_length[:, 0], [row.path_length for row in rows], atol=1e-4)


def test_a_row_that_takes_the_next_world_is_told_that_an_episode_starts() -> None:
    alone = [play(Counting(), SHORT, [seed]) for seed in range(6)]
    together = play(Counting(), SHORT, range(6), slots=2)
    np.testing.assert_array_equal(together.path_length, [one.path_length[0] for one in alone])


def test_every_robot_of_a_world_has_an_end_of_its_own() -> None:
    scenario = load("crossing_robots", {"robots.count": 4, "time.limit": 30.0})
    played = play(make_policy("go_to_goal", scenario), scenario, range(3))
    assert played.outcome.shape == (3, 4)
    assert np.isin(played.outcome, [OUTCOMES.index(end) for end in ENDS]).all()
    rows = evaluate(["go_to_goal"], scenario, episodes=3)
    assert [OUTCOMES[outcome] for outcome in played.outcome.ravel()] == [row.outcome for row in rows]
    np.testing.assert_allclose(played.time.ravel(), [row.time for row in rows], atol=1e-9)


def test_a_summary_counts_what_ended_how() -> None:
    outcome = np.array([1, 1, 1, 2, 3])[:, None]
    summary = Played(outcome, np.array([2.0, 3.0, 4.0, 9.0, 9.0])[:, None], np.zeros((5, 1))).summary()
    low, high = wilson_interval(3, 5)
    assert summary == {
        "n": 5,
        "success": 0.6,
        "collision": 0.2,
        "timeout": 0.2,
        "low": pytest.approx(low, abs=1e-6),
        "high": pytest.approx(high, abs=1e-6),
        "time": 3.0,
    }
    assert Played(outcome[3:], np.ones((2, 1)), np.ones((2, 1))).summary()["time"] is None


@pytest.mark.parametrize("first_ends, won", [(False, 1), (True, 3)])
def test_a_summary_of_several_robots_counts_missions(first_ends: bool, won: int) -> None:
    ends = [("success", "success"), ("success", "collision"), ("timeout", "success"), ("timeout", "collision")]
    outcome = np.array([[OUTCOMES.index(end) for end in robots] for robots in ends])
    time = np.array([[2.0, 4.0], [6.0, 1.0], [9.0, 8.0], [9.0, 1.0]])
    summary = Played(outcome, time, np.zeros((4, 2)), first_ends).summary()
    low, high = wilson_interval(won, 4)
    assert summary["n"] == 4
    assert (summary["low"], summary["high"]) == (pytest.approx(low, abs=1e-6), pytest.approx(high, abs=1e-6))
    shares = {"success": 0.75, "collision": 0.25, "timeout": 0.0}
    shares = shares if first_ends else {"success": 0.25, "collision": 0.5, "timeout": 0.25}
    assert {end: summary[end] for end in ENDS} == shares
    assert summary["time"] == 5.0


@pytest.mark.parametrize("name", suite_names())
def test_no_suite_has_a_seed_of_training_or_validation(name: str) -> None:
    suite = load_suite(name)
    for seeds in (suite.seeds, *(scenario.seeds for scenario in suite.scenarios if scenario.seeds)):
        assert seeds.first >= TEST_SEEDS and seeds.first + seeds.count < min(TRAINING_SEEDS, VALIDATION_SEEDS)
