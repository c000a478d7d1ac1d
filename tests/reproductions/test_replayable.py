"""The episodes that reproductions name for their pages: each is what their tables counted, driven once more."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

import pytest

from bug_gym.evaluation.rollout import Rollout
from bug_gym.reproductions import REPRODUCTIONS, reproduction
from bug_gym.reproductions.replayable import MOST, TYPICAL, Replayable, played
from bug_gym.reproductions.result import Settings

TRAININGS = {"ppo-curve", "offline"}
"""Reproductions whose rows are trainings: there is no episode to play."""
SMALL = {
    "hd-bug-traps": Settings(seeds=1, policies=("bug2",)),
    "bug-bounds": Settings(seeds=3, policies=("bug2",)),
    "bug-no-way": Settings(seeds=6, policies=("bug2", "bug0")),
    "cylinder-claims": Settings(seeds=4, policies=("bug2",)),
    "hd-bug-targets": Settings(seeds=1),
    "lidar-density": Settings(seeds=1, policies=("bug0",)),
    "learned": Settings(seeds=8, policies=("ppo_rush",)),
    "tracking": Settings(seeds=1),
}
"""Small runs of reproductions that name their episodes in ways of their own."""
OF_ALL = {"hd-bug-traps", "bug-bounds", "bug-no-way", "cylinder-claims"}
"""Those of them that hold if every episode ended as it should, be it that there is no way."""


def ended(policy: str, scenario: str, seed: int, *, success: bool, steps: int = 0) -> Replayable:
    """An episode."""
    end = "success" if success else "collision"
    return Replayable(policy, scenario, seed, success, end, "", policy, scenario, steps=steps)


@pytest.mark.parametrize("name", SMALL)
def test_an_episode_to_watch_ends_as_the_tables_say(name: str) -> None:
    result = reproduction(name)(SMALL[name])
    episodes, shown = result.episodes, played(result.episodes)
    assert 0 < len(shown) <= MOST and all(one in episodes for one in shown)
    has_failed = not all(one.success for one in episodes)
    assert shown[0].success is not has_failed
    if name in OF_ALL:
        assert result.holds is not has_failed
    for one in shown[:4]:
        wanted = one.wanted()
        assert (wanted.key, wanted.policy.label) == ((one.policy, one.scenario, one.seed), one.policy)
        ((row, *_),) = Rollout(wanted.policy, wanted.scenario, [wanted.seed]).worlds()
        if name != "tracking":  # it counts what the tracker does
            broken = one.verdict if one.outcome == "success" else ""  # a claim about what a policy did on its way
            assert (row.outcome, row.verdict or broken) == (one.outcome, one.verdict)
        assert one.steps in (0, row.steps)


@pytest.mark.parametrize("name", REPRODUCTIONS)
def test_every_reproduction_that_drives_names_its_episodes(name: str) -> None:
    source = Path(str(importlib.import_module(f"bug_gym.reproductions.{REPRODUCTIONS[name]}").__file__))
    made = [
        call
        for call in ast.walk(ast.parse(source.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "Reproduction"
    ]
    names = [any(keyword.arg == "episodes" for keyword in call.keywords) for call in made]
    assert names == [name not in TRAININGS]


def test_failures_are_watched_each_kind_once_beside_who_did_well_there() -> None:
    episodes = [
        *(ended("weak", "box", seed, success=seed % 2 == 0) for seed in range(6)),
        *(ended("strong", "box", seed, success=seed != 4) for seed in range(6)),
    ]
    assert [(one.policy, one.seed) for one in played(episodes)] == [
        ("strong", 4), ("weak", 4), ("weak", 1), ("strong", 1)
    ]  # fmt: skip
    many = [ended("weak", f"box {number}", 0, success=False) for number in range(2 * MOST)]
    assert played(many) == many[:MOST]


def test_without_failures_the_first_policies_are_watched_in_the_world_that_took_one_the_median_time() -> None:
    steps = [50, 10, 30, 90, 20]
    episodes = [
        ended(policy, scenario, seed, success=True, steps=count)
        for scenario in ("box", "maze", "rooms")
        for policy in ("one", "two", "three")
        for seed, count in enumerate(steps)
    ]
    assert [(one.scenario, one.policy, one.seed) for one in played(episodes)] == [
        ("box", "one", 2), ("box", "two", 2), ("maze", "one", 2), ("maze", "two", 2)
    ]  # fmt: skip
    alone = [ended(policy, "box", 0, success=True) for policy in "abcdef"]
    assert played(alone) == alone[:TYPICAL] and played([]) == []
