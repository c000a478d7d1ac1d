"""What a reset is asked for reaches all rows of a training, whatever worlds they are of."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")

from bug_gym.agents.learning.vec_envs import CurriculumVecEnv, SameWorlds, join
from bug_gym.config import load
from bug_gym.simulation import Simulation

SCENARIOS = ("static", "rush")
SEED = 4


def shortest_lengths() -> list[float]:
    """Of the worlds of two rows of each scenario [m], as they are told one by one."""
    lengths = []
    for first, name in zip((SEED, SEED + 2), SCENARIOS, strict=True):
        simulation = Simulation(name, 2)
        simulation.reset(seeds=[first, first + 1])
        lengths += [simulation.shortest_length(row) for row in range(2)]
    return lengths


def rows_of_both(kind: str) -> SameWorlds | CurriculumVecEnv:
    """Two rows of each scenario, as they are or as the one stage of a curriculum."""
    scenarios = [load(name) for name in SCENARIOS]
    if kind == "joined":
        return join(scenarios, 4, "continuous")
    return CurriculumVecEnv([[(scenario, 2) for scenario in scenarios]], "continuous")


@pytest.mark.parametrize("kind", ["joined", "curriculum"])
@pytest.mark.parametrize("asked", [[True] * 4, [False, True, True, False]])
def test_each_row_tells_of_a_reset_what_was_asked_of_it(kind: str, asked: list[bool]) -> None:
    env = rows_of_both(kind)
    env.seed(SEED)
    env.set_options([{"shortest_path": wanted} for wanted in asked])
    env.reset()
    told: list[Any] = [info.get("shortest_path_length") for info in env.reset_infos]
    expected = [length if wanted else None for length, wanted in zip(shortest_lengths(), asked, strict=True)]
    assert told == expected
    env.reset()
    assert all("shortest_path_length" not in info for info in env.reset_infos), "asked once"
    env.close()
