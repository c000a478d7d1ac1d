"""What is known of the returns that reference scores are taken of is what driving gives today."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from bug_gym.config import load
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.evaluation.reference_returns import EXPERT, FLOOR, PATH, WORLDS, driven_returns, known_returns

AGAIN = """Where not: `python docs/make_reference_returns.py`."""


def test_the_scenarios_of_the_file_are_those_of_today() -> None:
    table: dict[str, dict[str, Any]] = json.loads(PATH.read_text(encoding="utf-8"))
    assert set(table) == {FLOOR, EXPERT}
    for lines in table.values():
        assert len(lines) >= 8
        for digest, told in lines.items():
            assert load(told["scenario"]).digest == digest, AGAIN
            assert len(told["returns"]) == WORLDS and np.isfinite(told["returns"]).all()


@pytest.mark.parametrize("policy", [FLOOR, EXPERT])
@pytest.mark.parametrize(
    ("name", "seed"), [("dynamic", 3), ("moving_target", 3), ("rooms", 3), ("rush", 6), ("rush", 17), ("crowd", 6)]
)
def test_driving_again_gives_what_is_known(policy: str, name: str, seed: int) -> None:
    """Among many movers too, where a planner that has changed a little drives otherwise."""
    worlds = ScenarioEntry(name, load(name), range(seed, seed + 1))
    known = known_returns(PolicyEntry.of(policy), worlds)
    assert known is not None and known == pytest.approx(driven_returns(policy, worlds, worlds.seeds), abs=1e-9), AGAIN


def test_nothing_is_known_of_other_worlds_and_policies() -> None:
    dynamic = ScenarioEntry("dynamic", load("dynamic"), range(WORLDS))
    assert known_returns(PolicyEntry.of(EXPERT), dynamic) is not None
    assert known_returns(PolicyEntry.of("bug2"), dynamic) is None
    assert known_returns(PolicyEntry.of(f"{FLOOR}:seed=1"), dynamic) is None
    assert known_returns(PolicyEntry.of(EXPERT), ScenarioEntry("later", dynamic.scenario, range(1, WORLDS + 1))) is None
    other = load("dynamic", {"world.obstacles": 3})
    assert known_returns(PolicyEntry.of(EXPERT), ScenarioEntry("other", other, range(1))) is None
