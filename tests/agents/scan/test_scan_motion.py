"""Motion between two scans: seen where there is some, never among still obstacles, however they are looked at."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bug_gym.agents.scan.motion import STILL, has_moved
from bug_gym.config import load
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

REACH = 3.0
Circles = Sequence[tuple[float, float, float]]


def sensors_of(beams: int = 180, **lidar: Any) -> Sensors:
    """The sensors of a robot with so many beams."""
    return Sensors.of(load({"lidar": {"beams": beams, "range": 5.0, **lidar}, "world": {"family": "empty"}}))


def ranges_to(circles: Circles, place: tuple[float, float], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Ranges (B,) from a place to circles, beam by beam from the quadratic equation, at most 5 m."""
    found = np.full(len(angles), 5.0)
    for x, y, radius in circles:
        dx, dy = x - place[0], y - place[1]
        along = dx * np.cos(angles) + dy * np.sin(angles)
        root = radius**2 - (dx**2 + dy**2 - along**2)
        hit = along - np.sqrt(np.maximum(root, 0.0))
        found = np.where((root > 0.0) & (hit > 0.0), np.minimum(found, hit), found)
    return found


def view_of(circles: Circles, pose: tuple[float, float, float], sensors: Sensors) -> View:
    """What a robot at a pose sees of circles."""
    ranges = ranges_to(circles, pose[:2], sensors.angles + pose[2])
    return View(np.array([*ranges, 9.0, 0.0, *pose, 0.0, 0.0], dtype=np.float32), sensors)


@pytest.mark.parametrize("bearing", [0.0, 1.3, 3.1])
@pytest.mark.parametrize("direction", [0.0, 0.5 * math.pi, math.pi])
def test_a_disc_that_comes_goes_or_passes_by_is_seen_to_move(bearing: float, direction: float) -> None:
    sensors = sensors_of()
    x, y, way = 1.5 * math.cos(bearing), 1.5 * math.sin(bearing), 0.4
    moved = x + way * math.cos(bearing + direction), y + way * math.sin(bearing + direction)
    before = view_of([(x, y, 0.4)], (0.0, 0.0, 0.0), sensors)
    now = view_of([(*moved, 0.4)], (0.1, -0.2, 0.7), sensors)
    assert has_moved(before, now, REACH)


def test_what_moves_out_of_reach_does_not_count() -> None:
    sensors = sensors_of()
    before, now = (view_of([(4.0, y, 0.4)], (0.0, 0.0, 0.0), sensors) for y in (0.0, 0.6))
    assert not has_moved(before, now, REACH)
    assert has_moved(before, now, 4.5)


@pytest.mark.parametrize("shift", [0.0, 0.9 * STILL])
def test_a_shift_within_the_tolerance_is_no_motion(shift: float) -> None:
    sensors = sensors_of()
    before, now = (view_of([(1.5 + x, 0.0, 0.4)], (0.0, 0.0, 0.0), sensors) for x in (0.0, shift))
    assert not has_moved(before, now, REACH)


def test_a_post_that_fell_between_two_beams_has_not_moved() -> None:
    """From 2.2 m it is narrower than the gap between two beams; from 0.5 m several beams meet it."""
    sensors = sensors_of(beams=36)
    between = 0.5 * (sensors.angles[0] + sensors.angles[1])
    post = (2.2 * math.cos(between), 2.2 * math.sin(between), 0.12)
    before = view_of([post], (0.0, 0.0, 0.0), sensors)
    now = view_of([post], (post[0] - 0.5, post[1], 0.0), sensors)
    assert (before.ranges == 5.0).all() and (now.ranges < 1.0).sum() >= 2
    assert not has_moved(before, now, REACH)


@pytest.mark.parametrize("fov", [2.0, 2.0 * math.pi])
def test_what_was_outside_the_field_of_view_has_not_appeared(fov: float) -> None:
    sensors = sensors_of(fov=fov)
    disc = [(-1.5, 0.0, 0.4)]
    before, now = (view_of(disc, (0.0, 0.0, heading), sensors) for heading in (0.0, math.pi))
    assert not has_moved(before, now, REACH)


def test_a_beam_that_may_have_been_lost_shows_no_free_sight_and_one_that_met_something_does() -> None:
    sensors = replace(sensors_of(), dropout=0.1)
    disc, far = (1.5, 0.0, 0.4), (4.5, 0.0, 2.0)
    before, now = (view_of(circles, (0.0, 0.0, 0.0), sensors) for circles in ([], [disc]))
    assert has_moved(without_loss(before), without_loss(now), REACH)
    assert not has_moved(before, now, REACH)
    before, now = (view_of(circles, (0.0, 0.0, 0.0), sensors) for circles in ([far], [disc, far]))
    assert has_moved(before, now, REACH)


def without_loss(view: View) -> View:
    """The same with a scanner that loses no beam."""
    return View(view.flat, replace(view.sensors, dropout=0.0))


def test_one_beam_sees_no_motion() -> None:
    sensors = sensors_of(beams=1)
    before, now = (view_of([(x, 0.0, 0.4)], (0.0, 0.0, 0.0), sensors) for x in (1.0, 2.0))
    assert not has_moved(before, now, REACH)


@pytest.mark.parametrize("beams", [32, 180])
@pytest.mark.parametrize("scenario", ["static", "maze"])
def test_among_still_obstacles_nothing_moves_whatever_the_noise_and_dropout(scenario: str, beams: int) -> None:
    overrides = {"lidar.beams": beams, "lidar.noise": 0.02, "lidar.dropout": 0.01}
    simulation = Simulation(scenario, 20, overrides=overrides)
    sensors = Sensors.of(simulation.scenario)
    rng = np.random.default_rng(0)
    views: list[list[View]] = []
    flat = simulation.reset(seeds=range(20))
    for _ in range(60):
        views.append([View(row, sensors) for row in flat[:, 0]])
        flat = simulation.step(rng.uniform([0.5, -1.0], 1.0, (20, 1, 2)).astype(np.float32)).observation
    assert not any(
        has_moved(before, now, REACH)
        for k in range(20, 60, 5)
        for before, now in zip(views[k - 20], views[k], strict=True)
    )
