"""What a scan lights up, against shapely, and the edges of its shadows."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from bug_gym.agents.hd_bug.ladder import density
from bug_gym.agents.hd_bug_map.light_area import LightArea

F64 = NDArray[np.float64]

SENSOR_RANGE, RADIUS, REACH = 5.0, 0.25, 2.0
FULL = np.linspace(0.0, 2.0 * math.pi, 90, endpoint=False)
AHEAD = np.linspace(-0.25 * math.pi, 0.25 * math.pi, 31)
SCANS = [(angles, seed) for angles in (FULL, AHEAD) for seed in range(6)]


def random_ranges(angles: F64, seed: int) -> F64:
    """Clusters of several beams each, a third of them out of range."""
    rng = np.random.default_rng(seed)
    widths = rng.integers(1, 9, len(angles))
    levels = np.where(rng.random(len(angles)) < 0.33, SENSOR_RANGE, rng.uniform(0.3, 4.5, len(angles)))
    ranges = np.repeat(levels, widths)[: len(angles)]
    slope = np.repeat(rng.uniform(-0.05, 0.05, len(angles)), widths)[: len(angles)] * np.arange(len(angles)) % 0.4
    return np.where(ranges < SENSOR_RANGE, np.clip(ranges + slope, 0.3, 4.9), SENSOR_RANGE)


def area(angles: F64, ranges: F64, *, radius: float = RADIUS, reach: float = REACH) -> LightArea:
    return LightArea(angles, ranges, SENSOR_RANGE, radius, reach)


def is_light(light: LightArea, places: F64) -> NDArray[np.bool_]:
    """Which places (m, 2) the disc can go to straight, within the detection radius."""
    away = np.hypot(*places.T)
    lit: NDArray[np.bool_] = away <= np.minimum(light.free(np.arctan2(places[:, 1], places[:, 0])), light.reach) + 1e-6
    return lit


def random_places(seed: int, count: int = 400) -> F64:
    """Places (count, 2) within 1.2 times the detection radius."""
    rng = np.random.default_rng(seed)
    away, turn = 1.2 * REACH * np.sqrt(rng.random(count)), rng.uniform(-math.pi, math.pi, count)
    return np.column_stack([away * np.cos(turn), away * np.sin(turn)])


def hits(angles: F64, ranges: F64) -> F64:
    seen = ranges < SENSOR_RANGE
    return np.column_stack([ranges[seen] * np.cos(angles[seen]), ranges[seen] * np.sin(angles[seen])])


# ------------------------------------------------------------------------------------------------- light and shadow


@pytest.mark.parametrize(("angles", "seed"), SCANS)
def test_light_is_where_the_disc_can_go_straight(angles: F64, seed: int) -> None:
    ranges = random_ranges(angles, seed)
    places, points = random_places(seed), hits(angles, ranges)
    expected = []
    for place in places:
        ahead = points[points @ place > 0.0]  # what lies behind doesn't hinder
        gap = shapely.distance(shapely.LineString([(0.0, 0.0), place]), shapely.points(ahead)).min(initial=math.inf)
        expected.append(bool(gap >= RADIUS) and math.hypot(*place) <= REACH)
    found = is_light(area(angles, ranges), places)
    assert 0.02 <= np.mean(found) <= 0.98
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("angles", [FULL, AHEAD])
def test_out_of_range_all_is_light_within_the_detection_radius(angles: F64) -> None:
    light = area(angles, np.full(len(angles), SENSOR_RANGE))
    places = random_places(0)
    np.testing.assert_array_equal(is_light(light, places), np.hypot(*places.T) <= REACH)
    assert density(light.ranges, light.reach) == 0.0 and light.shadow_rings() == []


def test_in_contact_all_round_nothing_is_light() -> None:
    light = area(FULL, np.full(len(FULL), 1e-3))
    places = random_places(0)
    away = np.hypot(*places.T)
    assert not is_light(light, places[away > 1e-3]).any()
    assert density(light.ranges, light.reach) == 1.0


@pytest.mark.parametrize("away", [0.1, 1.0, SENSOR_RANGE])
def test_one_beam_is_no_error(away: float) -> None:
    light = area(np.zeros(1), np.array([away]))
    assert not is_light(light, np.array([[1.5, 0.0]]))[0] or away == SENSOR_RANGE
    assert density(light.ranges, light.reach) == float(away < REACH)
    assert all(np.isfinite(ring).all() for ring in [light.light_ring(), *light.shadow_rings()])


def test_beams_that_do_not_count_hinder_nobody_but_are_dense() -> None:
    ranges = np.full(len(FULL), 1.0)
    light = LightArea(FULL, ranges, SENSOR_RANGE, RADIUS, REACH, is_still=np.zeros(len(FULL), dtype=np.bool_))
    place = np.array([[1.5, 0.0]])
    assert is_light(light, place)[0] and density(light.ranges, light.reach) == 1.0


def test_the_detection_radius_is_not_above_the_range() -> None:
    light = area(FULL, np.full(len(FULL), SENSOR_RANGE), reach=9.0)
    np.testing.assert_array_equal(is_light(light, np.array([[4.9, 0.0], [5.1, 0.0]])), [True, False])


@pytest.mark.parametrize("seed", range(4))
def test_density_is_the_share_of_short_beams(seed: int) -> None:
    ranges = random_ranges(FULL, seed)
    assert density(ranges, REACH) == pytest.approx(sum(r < REACH for r in ranges) / len(ranges))


# ------------------------------------------------------------------------------------------------------------- rings


@pytest.mark.parametrize(("angles", "seed"), SCANS)
def test_rings_are_simple_and_hold_what_they_should(angles: F64, seed: int) -> None:
    ranges = random_ranges(angles, seed)
    light = area(angles, ranges)
    lit = shapely.Polygon(light.light_ring())
    dark = [shapely.Polygon(ring) for ring in light.shadow_rings()]
    assert lit.is_valid and all(ring.is_valid for ring in dark)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    inner = slice(None) if angles is FULL else slice(1, -1)
    half_way = 0.5 * np.minimum(ranges, REACH)[:, None] * directions
    assert shapely.contains_xy(lit, half_way[inner]).all()
    shadow = shapely.union_all(dark)
    between = 0.5 * (ranges + REACH)[:, None] * directions
    short = ranges < REACH - 1e-3
    assert shapely.contains_xy(shadow, between[short]).all()
    assert not shapely.contains_xy(shadow, half_way).any()
    assert not shapely.contains_xy(shadow, 0.99 * REACH * directions[ranges >= REACH]).any()


@pytest.mark.parametrize("away", [0.0, 0.5])
@pytest.mark.parametrize("angles", [FULL, AHEAD])
def test_shadow_all_round_is_drawn_as_simple_rings(angles: F64, away: float) -> None:
    rings = [shapely.Polygon(ring) for ring in area(angles, np.full(len(angles), away)).shadow_rings()]
    assert all(ring.is_valid for ring in rings)
    share = 1.0 if angles is FULL else len(angles) * (AHEAD[1] - AHEAD[0]) / (2.0 * math.pi)
    assert sum(ring.area for ring in rings) == pytest.approx(share * math.pi * (REACH**2 - away**2), rel=0.01)
