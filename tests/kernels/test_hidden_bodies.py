"""Scans among so many bodies that most are hidden: those that are left out would not have shortened any range."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.kernels import rays
from bug_gym.simulation import Simulation

F64 = NDArray[np.float64]

WORLDS, PLACES = 8, 12  # rows, and poses of their robots one after the other


def plain_scan(discs: F64, walls: F64, pose: F64, angles: F64, reach: float) -> F64:
    """Ranges (B,) to all discs (M, 3) and walls (S, 4) by their closed forms, beam by beam and body by body."""
    x, y, heading = pose.tolist()
    along_x, along_y = np.cos(heading + angles)[:, None], np.sin(heading + angles)[:, None]
    dx, dy, radius = discs[:, 0] - x, discs[:, 1] - y, discs[:, 2]
    if (dx * dx + dy * dy <= radius * radius).any():
        return np.zeros(len(angles))
    middle, aside = dx * along_x + dy * along_y, dx * along_y - dy * along_x
    under = radius * radius - aside * aside
    hits = np.where((under >= 0.0) & (middle > 0.0), middle - np.sqrt(np.maximum(under, 0.0)), math.inf)
    ax, ay, bx, by = (walls - np.array([x, y, x, y])).T
    past_a, past_b = ax * along_y - ay * along_x, bx * along_y - by * along_x  # of other signs: the beam goes between
    with np.errstate(divide="ignore", invalid="ignore"):
        lengths = (ax * by - ay * bx) / (past_a - past_b)
    crossings = np.where((past_a * past_b <= 0.0) & (lengths > 0.0), lengths, math.inf)
    ranges: F64 = np.minimum(np.concatenate([hits, crossings], axis=1).min(axis=1), reach)
    return ranges


def everywhere(shapes: str, low: float, high: float) -> dict[str, Any]:
    """Bodies all over, half of them moving."""
    field = {"family": "field", "shapes": shapes, "obstacles": 400, "sizes": (low, high), "moving": 0.5}
    return field | {"separation": 2.0}


def large_among_small() -> dict[str, Any]:
    """A few circles that are wide even from afar."""
    rng = np.random.default_rng(5)
    circles = np.column_stack([rng.uniform(-9.0, 9.0, (400, 2)), rng.uniform(0.02, 0.06, 400)])
    circles[:8] = np.column_stack([8.0 * np.cos(np.arange(8)), 8.0 * np.sin(np.arange(8)), rng.uniform(1.5, 3.0, 8)])
    return {"family": "explicit", "start": [0.0, 0.0, 0.0], "goal": [-9.0, -9.0], "circles": circles.tolist()}


CROWDS = {
    "small circles": everywhere("circles", 0.05, 0.3),
    "circles": everywhere("circles", 0.2, 0.9),
    "large among small circles": large_among_small(),
    "squares": everywhere("squares", 0.1, 0.7),
    "polygons": everywhere("polygons", 0.05, 1.0),
    "circles and polygons": everywhere("mixed", 0.05, 0.3) | {"obstacles": 800},
}


@pytest.mark.parametrize("crowd", CROWDS)
@pytest.mark.parametrize(("beams", "fov"), [(1, 6.28), (37, 1.5), (180, 2.0 * math.pi), (363, 4.0)])
@pytest.mark.parametrize("reach", [6.0, 15.0])
def test_a_scan_in_a_crowd_is_that_of_all_bodies(crowd: str, beams: int, fov: float, reach: float) -> None:
    scenario: dict[str, Any] = {"lidar": {"beams": beams, "fov": fov, "range": reach}, "world": CROWDS[crowd]}
    simulation = Simulation(scenario, WORLDS)
    simulation.reset(seeds=range(WORLDS))
    rng = np.random.default_rng(beams)
    spec, world = simulation.world.spec, simulation.world
    angles = float(spec["first_angle"][0]) + float(spec["angle_step"][0]) * np.arange(beams)
    crowded, free = 0, 0
    for _ in range(PLACES):
        world.pose[:, 0] = rng.uniform([-6.0, -6.0, -math.pi], [6.0, 6.0, math.pi], (WORLDS, 3))
        simulation.step(np.zeros((WORLDS, 1, 2)))
        listed = np.maximum(world.array("near_discs"), world.array("near_polygons"))
        crowded += int((listed > rays.CROWDED).sum())
        walls = world.wall
        for row in range(WORLDS):
            discs = np.column_stack([world.disc_position[row], world.disc_radius[row]])
            expected = plain_scan(
                discs, walls[row, : world.wall_count[row]], world.pose[row, 0], angles.astype(np.float64), reach
            )
            assert np.abs(world.ranges[row, 0] - expected).max() < 1e-5
            free += int(expected.min() > 0.0)
    assert crowded > 0.8 * WORLDS * PLACES
    assert free > 0.05 * WORLDS * PLACES


@pytest.mark.parametrize("octant", range(8))
@pytest.mark.parametrize("at_end", [False, True])
@pytest.mark.parametrize("shape", ["circle", "square"])
def test_a_wide_body_is_seen_beside_what_hides_its_middle(octant: int, at_end: bool, shape: str) -> None:
    """Its middle lies at one end of an octant; a row of bodies hides the octant and half of each one beside it, no more."""
    eighth = 0.25 * math.pi
    ahead = eighth * (octant + (0.99 if at_end else 0.01))  # direction of the wide body's middle
    hidden = eighth * np.linspace(octant - 0.52, octant + 1.52, 30)
    row = np.column_stack([1.5 * np.cos(hidden), 1.5 * np.sin(hidden), np.full(30, 0.05)])
    behind = eighth * (octant + np.random.default_rng(octant).uniform(0.0, 1.0, 270))
    specks = np.column_stack([2.5 * np.cos(behind), 2.5 * np.sin(behind), np.full(270, 0.01)])
    wide = [[7.5 * math.cos(ahead), 7.5 * math.sin(ahead), 3.3]]
    bodies = np.concatenate([specks, wide, row])
    far = {"bounds": [-12, -12, 12, 12], "start": [0.0, 0.0, 0.7], "goal": [-11.0, -11.0]}
    squares = [square(x, y, radius, 1 if at_end else -1) for x, y, radius in bodies.tolist()]
    what = {"circles": bodies.tolist()} if shape == "circle" else {"polygons": squares}
    scenario: dict[str, Any] = {"lidar": {"beams": 720, "range": 8.0}, "world": {"family": "explicit", **what, **far}}
    simulation = Simulation(scenario)
    simulation.reset(seeds=[0])
    world, angles = simulation.world, 2.0 * math.pi * np.arange(720) / 720
    discs = bodies if shape == "circle" else np.zeros((0, 3))
    expected = plain_scan(discs, world.wall[0, : world.wall_count[0]], world.pose[0, 0], angles, 8.0)
    assert np.abs(world.ranges[0, 0] - expected).max() < 1e-5
    assert ((expected > 4.0) & (expected < 8.0)).any(), "a part of the wide body is in sight"


def square(x: float, y: float, radius: float, side: int) -> list[list[float]]:
    """Corners of a square in a circle, one of them where it is touched on one side (1: the left) from the origin."""
    touched = math.atan2(y, x) + side * (math.asin(radius / math.hypot(x, y)) + 0.5 * math.pi)
    turns = [touched + 0.5 * math.pi * corner for corner in range(4)]
    return [[x + radius * math.cos(turn), y + radius * math.sin(turn)] for turn in turns]
