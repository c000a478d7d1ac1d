"""Returns of the two policies that reference scores of datasets are taken of, in the first worlds of some of our scenarios.

Driving them takes seconds each time; what they get is known, and lies in reference_returns.json. It holds for scenarios of
the same digest; `python docs/make_reference_returns.py` writes it anew, and a test drives some of it again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bug_gym.evaluation.demonstrations import demonstrate
from bug_gym.evaluation.entries import PolicyEntry, ScenarioEntry
from bug_gym.files import from_json

FLOOR = "random"
"""The policy whose mean return is the lowest score."""
EXPERT = "hd_bug_map"
"""The policy whose mean return is the highest score, unless another is asked for."""
WORLDS = 100
"""How many are known of each scenario, from seed 0 on."""

PATH = Path(__file__).with_suffix(".json")


def known_returns(entry: PolicyEntry, scenario: ScenarioEntry) -> NDArray[np.float64] | None:
    """What a policy gets in the worlds of a scenario (n,), where all of them are known."""
    told = _table().get(entry.name, {}).get(scenario.scenario.digest)
    seeds = scenario.seeds
    is_ours = entry.policy_class is None and not entry.reference
    if told is None or not is_ours or entry.parameters or seeds.stop > WORLDS:
        return None
    return np.array(told["returns"][seeds.start : seeds.stop])


@cache
def _table() -> Mapping[str, Any]:
    return dict(from_json(PATH.read_bytes()))


def driven_returns(policy: str, scenario: ScenarioEntry, seeds: Sequence[int]) -> list[float]:
    """What a policy gets in some worlds, driven now."""
    return [float(one) for one in demonstrate(PolicyEntry.of(policy), scenario, seeds).returns()]
