"""Roll-outs of desired velocities among predicted tracks: closed forms, a plain oracle, the simulation's own robot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import norm

from bug_gym.agents.hd_bug.roll_out import FADING, RollOut, Velocities, hit_risks
from bug_gym.kinematics import TURN_IN_PLACE, Drive, steering
from bug_gym.simulation import Simulation

F64 = NDArray[np.float64]

STEP, COUNT = 0.1, 30
TIMES = STEP * np.arange(1, COUNT + 1, dtype=np.float64)
RADIUS, SPREAD = 0.2, 0.1
HOLONOMIC = Drive("holonomic", 1.0, 0.3, 1.5, STEP)
DIFFERENTIAL = Drive("differential", 1.0, 0.3, 1.5, STEP)


def rolled(
    directions: Any,
    speeds: Any,
    *,
    drive: Drive = HOLONOMIC,
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
    free: Any = 99.0,
    places: F64 | None = None,
    radii: Any = 0.3,
    spread: Any = SPREAD,
    compare: int = COUNT - 1,
    times: F64 = TIMES,
    goal: tuple[float, float, float] = (99.0, 0.0, 0.1),
) -> RollOut:
    """A roll-out; places (T, K, 2), radii a number or (T,), spread a number or (T, K)."""
    directions = np.atleast_1d(np.asarray(directions, dtype=float))
    speeds = np.broadcast_to(np.asarray(speeds, dtype=float), directions.shape).copy()
    free = np.broadcast_to(np.asarray(free, dtype=float), directions.shape).copy()
    places = np.empty((0, len(times), 2)) if places is None else places
    radii = np.broadcast_to(np.asarray(radii, dtype=float), places.shape[:1]).copy()
    spread = np.broadcast_to(np.asarray(spread, dtype=float), places.shape[:2]).copy()
    velocities = Velocities(directions, speeds, free)
    return hit_risks(drive, pose, RADIUS, velocities, places, radii, spread, times, compare, goal)


def moving(place: tuple[float, float], velocity: tuple[float, float]) -> F64:
    """The places (1, K, 2) of a mover of constant velocity."""
    places: F64 = (np.array(place) + TIMES[:, None] * np.array(velocity))[None]
    return places


@pytest.mark.parametrize("approach", [0.0, 0.5, 1.3])
@pytest.mark.parametrize("speed", [0.25, 1.0])
def test_head_on_it_meets_a_mover_when_the_gap_is_closed(speed: float, approach: float) -> None:
    away = 2.03
    result = rolled(0.0, speed, places=moving((away, 0.0), (-approach, 0.0)))
    when = (away - RADIUS - 0.3) / (speed + approach)
    expected = math.ceil(when / STEP - 1e-9) * STEP if when <= TIMES[-1] else math.inf
    assert result.contact[0] == pytest.approx(expected)


@pytest.mark.parametrize("speed", [0.25, 1.0])
def test_what_goes_ahead_as_fast_is_not_met(speed: float) -> None:
    result = rolled(0.0, speed, places=moving((0.6, 0.0), (speed, 0.0)))
    assert result.contact[0] == math.inf


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("beside", [-0.1, 0.0, 0.1, 0.2])
def test_the_chance_to_be_hit_by_what_it_passes_is_that_of_a_normal_deviation(side: float, beside: float) -> None:
    away = 1.5
    result = rolled(0.0, 1.0, places=moving((away, side * (RADIUS + 0.3 + beside)), (0.0, 0.0)))
    # A little before it is abreast it is nearly as near and less faded.
    chance = 0.5 * math.erfc(beside / (math.sqrt(2.0) * SPREAD))
    assert result.nearness[0] * math.exp(away / FADING) == pytest.approx(chance, rel=0.12)
    assert (result.contact[0] < math.inf) == (beside <= 0.0)


def test_the_sooner_a_hit_the_dearer_it_is() -> None:
    costs = [rolled(0.0, 1.0, places=moving((away, 0.0), (0.0, 0.0))).nearness[0] for away in (0.6, 1.0, 2.0, 3.0)]
    assert costs == sorted(costs, reverse=True) and costs[-1] > 0.0


def plain(
    direction: float, speed: float, free: float, places: F64, radii: F64, spread: F64
) -> tuple[float, float, F64]:
    """Contact, nearness and places (K, 2) of a holonomic robot, from their definitions."""
    at = np.minimum(speed * TIMES, free)[:, None] * np.array([math.cos(direction), math.sin(direction)])
    gaps = np.hypot(*(places - at).transpose(2, 0, 1)) - RADIUS - radii[:, None]
    met = np.flatnonzero((gaps <= 0.0).any(axis=0))
    chances = np.where(gaps > 4.0 * spread, 0.0, norm.sf(gaps / spread)) * np.exp(-TIMES / FADING)
    return (float(TIMES[met[0]]) if len(met) else math.inf), float(chances.max(axis=1).sum()), at


@pytest.mark.parametrize("seed", range(5))
def test_a_holonomic_robot_fares_as_the_definitions_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tracks, many = 8, 60
    velocities = rng.uniform(-0.8, 0.8, (tracks, 1, 2))
    away, turn = rng.uniform(0.8, 2.0, (tracks, 1)), rng.uniform(-math.pi, math.pi, (tracks, 1))
    first = away[:, :, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    places = first + TIMES[None, :, None] * velocities
    radii, spread = rng.uniform(0.1, 0.3, tracks), 0.02 + 0.1 * TIMES * rng.random((tracks, 1))
    directions, speeds, free = rng.uniform(-4.0, 4.0, many), rng.uniform(0.0, 1.0, many), rng.uniform(0.0, 3.0, many)
    result = rolled(directions, speeds, free=free, places=places, radii=radii, spread=spread, compare=12)
    for i in range(many):
        contact, nearness, at = plain(directions[i], speeds[i], free[i], places, radii, spread)
        assert result.contact[i] == contact
        assert result.nearness[i] == pytest.approx(nearness, abs=1e-9)
        np.testing.assert_allclose(result.end[i, :2], at[12], atol=1e-9)
    assert np.isfinite(result.contact).any() and not np.isfinite(result.contact).all()


def simulated(velocity: tuple[float, float], steps: int) -> F64:
    """Where the simulation's differential robot is (2,) after holding a desired velocity, from (0, 0) ahead along x."""
    overrides = {"robot.kinematics": "differential", "time.step": STEP, "world.bounds": [-20, -20, 20, 20]}
    simulation = Simulation("empty", 1, overrides=overrides)
    simulation.reset(seeds=[0])
    for _ in range(steps):
        heading = simulation.world.pose[0, 0, 2]
        cos, sin = math.cos(heading), math.sin(heading)
        desired = (cos * velocity[0] + sin * velocity[1], cos * velocity[1] - sin * velocity[0])
        simulation.step(steering(DIFFERENTIAL, desired)[None, None])
    place: F64 = simulation.world.pose[0, 0, :2].copy()
    return place


@pytest.mark.parametrize("bearing", [-170.0, -80.0, -10.0, 0.0, 25.0, 95.0, 179.0])
@pytest.mark.parametrize(("speed", "steps"), [(1.0, 30), (0.4, 12)])
def test_a_differential_robot_goes_where_the_simulations_own_goes(bearing: float, speed: float, steps: int) -> None:
    direction = math.radians(bearing)
    result = rolled(direction, speed, drive=DIFFERENTIAL, compare=steps - 1)
    expected = simulated((speed * math.cos(direction), speed * math.sin(direction)), steps)
    # The chord of an arc of at most 0.15 rad is 0.1 % shorter than the arc; actions are single precision.
    np.testing.assert_allclose(result.end[0, :2], expected, atol=0.001 * speed * steps * STEP + 1e-5)


@pytest.mark.parametrize("error", [1.0, 2.0, 3.0])
def test_a_differential_robot_turns_before_it_goes(error: float) -> None:
    turning = (error - TURN_IN_PLACE) / DIFFERENTIAL.max_turn_rate
    before = int(turning / STEP)
    ends = [rolled(error, 1.0, drive=DIFFERENTIAL, compare=k).end[0, :2] for k in (before - 1, before + 2)]
    np.testing.assert_array_equal(ends[0], [0.0, 0.0])
    assert math.hypot(*ends[1]) > 0.05


@pytest.mark.parametrize("drive", [HOLONOMIC, DIFFERENTIAL], ids=["holonomic", "differential"])
@pytest.mark.parametrize("free", [0.0, 0.35, 1.7])
def test_it_stops_where_the_free_way_ends(drive: Drive, free: float) -> None:
    result = rolled(0.0, 1.0, drive=drive, free=free)
    np.testing.assert_allclose(result.end[0, :2], [free, 0.0], atol=1e-9)


@pytest.mark.parametrize("compare", [0, 7, 29])
def test_the_end_is_where_it_is_at_the_time_to_be_compared(compare: int) -> None:
    result = rolled([0.3, -2.0], [0.5, 1.0], compare=compare)
    way = np.array([0.5, 1.0]) * TIMES[compare]
    expected = way[:, None] * np.column_stack([np.cos([0.3, -2.0]), np.sin([0.3, -2.0])])
    np.testing.assert_allclose(result.end[:, :2], expected, atol=1e-9)


def test_times_twice_as_dense_find_the_same_contact_up_to_a_step() -> None:
    fine = 0.5 * STEP * np.arange(1, 2 * COUNT + 1, dtype=np.float64)
    coarse_contact = rolled(0.0, 1.0, places=moving((1.7, 0.1), (-0.4, 0.0))).contact[0]
    places = (np.array([1.7, 0.1]) + fine[:, None] * np.array([-0.4, 0.0]))[None]
    fine_contact = rolled(0.0, 1.0, places=places, times=fine).contact[0]
    assert coarse_contact - STEP < fine_contact <= coarse_contact


def test_a_larger_disc_is_met_no_later() -> None:
    radii = np.linspace(0.1, 0.9, 9)
    place = moving((1.5, 0.4), (-0.3, -0.1))
    contacts = [rolled(0.0, 0.8, places=place, radii=radius).contact[0] for radius in radii]
    assert contacts == sorted(contacts, reverse=True)


def test_what_it_touches_already_is_met_at_once() -> None:
    result = rolled([0.0, math.pi], 1.0, places=moving((0.45, 0.0), (0.0, 0.0)))
    assert result.contact[0] == pytest.approx(STEP) and result.contact[1] == math.inf


def test_without_tracks_nothing_is_met_or_near() -> None:
    result = rolled(np.linspace(-3.0, 3.0, 7), 1.0)
    assert np.isinf(result.contact).all() and (result.nearness == 0.0).all()


@pytest.mark.parametrize("drive", [HOLONOMIC, DIFFERENTIAL], ids=["holonomic", "differential"])
def test_a_turned_and_shifted_scene_fares_alike(drive: Drive) -> None:
    rng = np.random.default_rng(3)
    places = rng.uniform(-2.0, 2.0, (4, 1, 2)) + TIMES[None, :, None] * rng.uniform(-0.5, 0.5, (4, 1, 2))
    directions = np.linspace(-3.0, 3.0, 16)
    angle, shift = 0.9, np.array([3.0, -1.0])
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    first = rolled(directions, 0.7, drive=drive, places=places)
    pose = (float(shift[0]), float(shift[1]), angle)
    second = rolled(directions + angle, 0.7, drive=drive, pose=pose, places=places @ turn + shift)
    np.testing.assert_array_equal(first.contact, second.contact)
    np.testing.assert_allclose(first.nearness, second.nearness, atol=1e-9)
    np.testing.assert_allclose(first.end[:, :2] @ turn + shift, second.end[:, :2], atol=1e-9)


@pytest.mark.parametrize("drive", [HOLONOMIC, DIFFERENTIAL], ids=["holonomic", "differential"])
def test_a_robot_that_has_been_at_its_goal_is_not_hit_any_more(drive: Drive) -> None:
    mover = moving((2.0, 0.0), (0.0, 0.0))
    far, near = (rolled(0.0, 1.0, drive=drive, places=mover, goal=(x, 0.0, 0.25)) for x in (9.0, 1.0))
    assert far.contact[0] == pytest.approx(1.5) and far.early[0] == 0.0 and far.nearness[0] > 0.0
    assert near.contact[0] == math.inf and near.nearness[0] < 1e-6
    assert near.end[0, 0] == pytest.approx(0.8) and near.early[0] == pytest.approx(TIMES[-1] - 0.8)


def test_a_roll_out_ends_with_the_heading_that_it_has_then() -> None:
    for drive, turned in ((HOLONOMIC, 0.0), (DIFFERENTIAL, 1.5 * 4 * STEP)):  # it turns at 1.5 rad/s
        assert rolled(math.pi - 0.1, 0.5, drive=drive, compare=3).end[0, 2] == pytest.approx(turned)
