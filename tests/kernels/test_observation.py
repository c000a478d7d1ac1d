"""The table of the observation's fields, and the kernel that is made out of it."""

from pathlib import Path

import numpy as np
import pytest

from bug_gym import kernels
from bug_gym.simulation import Simulation

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("scenario", ["dynamic", "terrain", "crossing_robots"])
def test_every_number_of_the_observation_is_written_in_each_step(scenario: str) -> None:
    simulation = Simulation(scenario, 2)
    simulation.reset(seeds=[0, 1])
    simulation.world.observation[:] = np.nan
    simulation.step(np.zeros((2, simulation.robots, 2)))
    assert np.isfinite(simulation.world.observation).all()


def test_fields_lie_one_after_another_in_the_order_of_the_table() -> None:
    for scenario in ("dynamic", "terrain", "crossing_robots"):
        simulation = Simulation(scenario)
        names = [field.name for field in simulation.fields]
        assert names == [name for name in kernels.OBSERVATION if name in names]
        assert [field.begin for field in simulation.fields] == [0, *(field.end for field in simulation.fields[:-1])]
        for field in simulation.fields:
            assert simulation.world.common[f"see_{field.name}"] == field.begin


def test_the_guide_has_a_line_for_each_field() -> None:
    guide = (ROOT / "docs" / "guide" / "environments.md").read_text(encoding="utf-8")
    assert [name for name in kernels.OBSERVATION if f"| `{name}` | (" not in guide] == []
