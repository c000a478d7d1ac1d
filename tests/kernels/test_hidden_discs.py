"""Scans among so many discs that most are hidden: those that are left out would not have shortened any range."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.kernels import rays
from bug_gym.simulation import Simulation

F64 = NDArray[np.float64]

WORLDS, PLACES, HALF = 8, 12, 10.0  # rows, poses of their robots one after the other, half the side of a world [m]


def plain_scan(discs: F64, pose: F64, angles: F64, reach: float) -> F64:
    """Ranges (B,) to all discs (M, 3) and the border by their closed forms, beam by beam and disc by disc."""
    x, y, heading = pose
    along_x, along_y = np.cos(heading + angles)[:, None], np.sin(heading + angles)[:, None]
    dx, dy, radius = discs[:, 0] - x, discs[:, 1] - y, discs[:, 2]
    if (dx * dx + dy * dy <= radius * radius).any():
        return np.zeros(len(angles))
    middle, aside = dx * along_x + dy * along_y, dx * along_y - dy * along_x
    under = radius * radius - aside * aside
    hits = np.where((under >= 0.0) & (middle > 0.0), middle - np.sqrt(np.maximum(under, 0.0)), math.inf).min(axis=1)
    with np.errstate(divide="ignore"):
        border = np.minimum(*((HALF * np.sign(c[:, 0]) - o) / c[:, 0] for o, c in ((x, along_x), (y, along_y))))
    ranges: F64 = np.minimum(np.minimum(hits, border), reach)
    return ranges


def small(low: float, high: float) -> dict[str, Any]:
    """Circles all over, half of them moving."""
    field = {"family": "field", "shapes": "circles", "obstacles": 400, "sizes": (low, high), "moving": 0.5}
    return field | {"separation": 2.0}


def large_among_small() -> dict[str, Any]:
    """A few circles that are wide even from afar."""
    rng = np.random.default_rng(5)
    circles = np.column_stack([rng.uniform(-9.0, 9.0, (400, 2)), rng.uniform(0.02, 0.06, 400)])
    circles[:8] = np.column_stack([8.0 * np.cos(np.arange(8)), 8.0 * np.sin(np.arange(8)), rng.uniform(1.5, 3.0, 8)])
    return {"family": "explicit", "start": [0.0, 0.0, 0.0], "goal": [-9.0, -9.0], "circles": circles.tolist()}


@pytest.mark.parametrize(
    "world", [small(0.05, 0.3), small(0.2, 0.9), large_among_small()], ids=["small", "all", "large"]
)
@pytest.mark.parametrize(("beams", "fov"), [(1, 6.28), (37, 1.5), (180, 2.0 * math.pi), (363, 4.0)])
@pytest.mark.parametrize("reach", [6.0, 15.0])
def test_a_scan_among_many_discs_is_that_of_all_discs(
    world: dict[str, Any], beams: int, fov: float, reach: float
) -> None:
    scenario: dict[str, Any] = {"lidar": {"beams": beams, "fov": fov, "range": reach}, "world": world}
    simulation = Simulation(scenario, WORLDS)
    simulation.reset(seeds=range(WORLDS))
    rng = np.random.default_rng(beams)
    spec, state = simulation.world.spec, simulation.world
    angles = float(spec["first_angle"][0]) + float(spec["angle_step"][0]) * np.arange(beams)
    crowded, free = 0, 0
    for _ in range(PLACES):
        state.pose[:, 0] = rng.uniform([-6.0, -6.0, -math.pi], [6.0, 6.0, math.pi], (WORLDS, 3))
        simulation.step(np.zeros((WORLDS, 1, 2)))
        crowded += int((state.array("near_discs") >= rays.CROWDED).sum())
        for row in range(WORLDS):
            discs = np.column_stack([state.disc_position[row], state.disc_radius[row]])
            expected = plain_scan(discs, state.pose[row, 0], angles, reach)
            assert np.abs(state.ranges[row, 0] - expected).max() < 1e-5
            free += int(expected.min() > 0.0)
    assert crowded > 0.8 * WORLDS * PLACES
    assert free > 0.05 * WORLDS * PLACES


@pytest.mark.parametrize("octant", range(8))
@pytest.mark.parametrize("at_end", [False, True])
def test_a_wide_disc_is_seen_beside_what_hides_its_middle(octant: int, at_end: bool) -> None:
    """Its middle lies at one end of an octant; a row of discs hides the octant and half of each one beside it, no more."""
    eighth = 0.25 * math.pi
    ahead = eighth * (octant + (0.99 if at_end else 0.01))  # direction of the wide disc's middle
    hidden = eighth * np.linspace(octant - 0.52, octant + 1.52, 30)
    row = np.column_stack([1.5 * np.cos(hidden), 1.5 * np.sin(hidden), np.full(30, 0.05)])
    behind = eighth * (octant + np.random.default_rng(octant).uniform(0.0, 1.0, 270))
    specks = np.column_stack([2.5 * np.cos(behind), 2.5 * np.sin(behind), np.full(270, 0.01)])
    wide = [[7.5 * math.cos(ahead), 7.5 * math.sin(ahead), 3.3]]
    discs = np.concatenate([specks, wide, row])
    far = {"bounds": [-12, -12, 12, 12], "start": [0.0, 0.0, 0.7], "goal": [-11.0, -11.0]}
    world = {"family": "explicit", "circles": discs.tolist(), **far}
    simulation = Simulation({"lidar": {"beams": 720, "range": 8.0}, "world": world})
    simulation.reset(seeds=[0])
    expected = plain_scan(discs, simulation.world.pose[0, 0], 2.0 * math.pi * np.arange(720) / 720, 8.0)
    assert np.abs(simulation.world.ranges[0, 0] - expected).max() < 1e-5
    assert ((expected > 4.0) & (expected < 8.0)).any(), "a part of the wide disc is in sight"
