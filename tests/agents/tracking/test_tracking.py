"""The tracker: closed forms of one mover, still worlds without movers, truth in moving ones, symmetries."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tracked import STEP, disc, last_tracks, track, world_of

from bug_gym.agents.tracking.layout import (
    AT_X,
    AT_Y,
    DISC,
    GOES_X,
    GOES_Y,
    MOVER,
    MOVES,
    NUMBER,
    OF_RADIUS,
    TRACKS,
    UNSEEN,
    VX,
    VY,
    X,
    Y,
)
from bug_gym.agents.tracking.tracker import Tracker, TrackerMemory, Tracks
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View

F64 = NDArray[np.float64]


def movers_of(simulation: Simulation) -> tuple[F64, F64]:
    """True places (M, 2) and outer radii (M,) of what moves."""
    layout = simulation.world.layout(0)
    outer = [
        mover.outline if mover.is_circle else np.hypot(*np.transpose(mover.outline)).max() for mover in layout.movers
    ]
    return np.array([mover.at for mover in layout.movers]).reshape(-1, 2), np.array(outer, dtype=np.float64)


def in_world(simulation: Simulation, start: F64, points: F64) -> F64:
    """Points (..., 2) of the odometry frame in the world."""
    cos, sin = math.cos(start[2]), math.sin(start[2])
    turned: F64 = points @ np.array([[cos, sin], [-sin, cos]])
    return start[:2] + turned


def is_moving_beam(tracks: Tracks) -> NDArray[np.bool_]:
    """Whether each beam's hit is put down to a mover (B,)."""
    moving = np.append(tracks.moving, False)
    return np.asarray(moving[tracks.beam_track])


WAYS = [((4.0, -1.0), (0.0, 0.5)), ((5.0, 0.5), (-0.5, 0.0)), ((2.5, 0.0), (0.5, 0.0)), ((3.0, 2.0), (-0.4, -0.3))]


@pytest.mark.parametrize(("at", "velocity"), WAYS)
def test_the_velocity_of_a_disc_is_known_to_a_tenth_after_a_second_and_a_half(
    at: tuple[float, float], velocity: tuple[float, float]
) -> None:
    for seed in range(5):
        tracks = last_tracks(world_of([disc(at, velocity)], noise=0.02), 1.5, seed=seed)
        (index,) = np.flatnonzero(tracks.moving)
        assert math.dist(tracks.velocity[index], velocity) < 0.1, (seed, tracks.velocity)


@pytest.mark.parametrize(("at", "velocity"), WAYS)
def test_the_disc_itself_is_found(at: tuple[float, float], velocity: tuple[float, float]) -> None:
    *_, (_, view, tracks) = track(world_of([disc(at, velocity)], noise=0.01), 3.0)
    (index,) = np.flatnonzero(tracks.moving)
    place = np.array(at) + 3.0 * np.array(velocity)
    # half the distance between two beams there, and the noise
    room = 0.5 * np.hypot(*place) * 2.0 * math.pi / len(view.ranges) + 0.02
    assert math.dist(tracks.position[index], place) < room
    assert abs(tracks.radius[index] - 0.3) < room


def test_a_polygon_that_moves_is_a_mover() -> None:
    square = {
        "shape": {"polygon": [[-0.4, -0.4], [0.4, -0.4], [0.4, 0.4], [-0.4, 0.4]]},
        "at": [3.0, -1.5],
        "motion": {"law": "bounce", "velocity": [0.0, 0.6]},
    }
    tracks = last_tracks(world_of([square], noise=0.01), 2.5)
    (index,) = np.flatnonzero(tracks.moving)
    assert math.dist(tracks.velocity[index], (0.0, 0.6)) < 0.15
    assert math.dist(tracks.position[index], (3.0, 0.0)) < 0.3


def test_a_mover_that_turns_back_is_followed() -> None:
    back = {
        "shape": {"circle": 0.4},
        "at": [3.0, -2.0],
        "motion": {"law": "waypoints", "points": [[3.0, 0.0], [3.0, -6.0]], "speed": 1.0, "stop": True},
    }
    ids = set()
    for simulation, _, tracks in track(world_of([back], noise=0.01), 3.0):
        if simulation.world.time[0] > 1.0:
            ids |= set(tracks.id[tracks.moving].tolist())
    assert len(ids) == 1
    (index,) = np.flatnonzero(tracks.moving)
    assert math.dist(tracks.velocity[index], (0.0, -1.0)) < 0.15


def test_a_mover_behind_another_keeps_its_number() -> None:
    near, far = disc((2.5, -2.0), (0.0, 0.8), 0.4), disc((4.0, 2.0), (0.0, -0.5), 0.3)
    numbers: dict[str, set[int]] = {"near": set(), "far": set()}
    for simulation, _, tracks in track(world_of([near, far], noise=0.01), 6.0):
        time = float(simulation.world.time[0])
        if time < 1.5:
            continue
        truth = {"near": (2.5, -2.0 + 0.8 * time), "far": (4.0, 2.0 - 0.5 * time)}
        for name, place in truth.items():
            gaps = np.hypot(*(tracks.position - np.array(place)).T)
            assert gaps.min() < 0.4, (time, name)
            numbers[name].add(int(tracks.id[gaps.argmin()]))
    assert len(numbers["near"]) == len(numbers["far"]) == 1
    assert numbers["near"] != numbers["far"]


@pytest.mark.parametrize("scenario", ["crowd", "rush"])
def test_innovations_are_as_large_as_the_filter_expects(scenario: str) -> None:
    squares = []
    for seed in range(6):
        for _, _, tracks in track(scenario, 20.0, seed=seed, policy="bug2"):
            squares += tracks.innovation[tracks.moving & (tracks.age > 1.0) & (tracks.unseen == 0.0)].tolist()
    # Two degrees of freedom: 2 in the mean.
    assert 1.5 <= np.mean(squares) <= 2.5, np.mean(squares)


@pytest.mark.parametrize("policy", ["bug2", "random"])
def test_hardly_a_beam_of_a_still_world_is_put_down_to_a_mover(policy: str) -> None:
    hits = wrong = 0
    for seed in range(20):
        overrides = {"lidar.noise": 0.01}
        for _, view, tracks in track("static", 15.0, seed=seed, policy=policy, overrides=overrides):
            hits += int((view.ranges < view.sensors.range).sum())
            wrong += int(is_moving_beam(tracks).sum())
    assert wrong <= 0.001 * hits, (wrong, hits)


@pytest.mark.parametrize("scenario", ["rooms", "maze", "u_trap", "ring"])
def test_walls_do_not_move(scenario: str) -> None:
    hits = wrong = 0
    for seed in range(2):
        for _, view, tracks in track(scenario, 20.0, seed=seed, policy="bug2", overrides={"lidar.noise": 0.01}):
            hits += int((view.ranges < view.sensors.range).sum())
            wrong += int(is_moving_beam(tracks).sum())
    assert wrong <= 0.005 * hits, (wrong, hits)


def test_movers_that_are_near_and_in_sight_are_known() -> None:
    known = seen = 0
    for seed in range(24):  # six worlds alone give from 0.970 to 0.989
        before, start = None, None
        since: dict[int, float] = {}
        for simulation, view, tracks in track("crowd", 20.0, seed=seed, policy="bug2"):
            start = simulation.world.pose[0, 0].copy() if start is None else start
            places, radii = movers_of(simulation)
            speeds = np.zeros(len(places)) if before is None else np.hypot(*(places - before).T) / STEP
            before = places
            x, y, heading = view.pose
            directions = np.stack(
                [np.cos(heading + view.sensors.angles), np.sin(heading + view.sensors.angles)], axis=1
            )
            points = in_world(simulation, start, np.array([x, y]) + view.ranges[:, None] * directions)
            gaps = np.hypot(*(points[:, None] - places).transpose(2, 0, 1)) - radii
            owner = np.where(gaps.min(axis=1) < 0.05, gaps.argmin(axis=1), -1)
            centres = in_world(simulation, start, tracks.position[tracks.moving])
            away = np.hypot(*(places - simulation.world.pose[0, 0, :2]).T) - radii
            for mover in range(len(places)):
                if mover not in owner or speeds[mover] < 0.3:
                    since.pop(mover, None)
                    continue
                first = since.setdefault(mover, float(simulation.world.time[0]))
                if simulation.world.time[0] - first > 0.5 and away[mover] < 2.5:
                    seen += 1
                    known += bool((np.hypot(*(centres - places[mover]).T) < radii[mover] + 0.3).any())
    assert seen > 5000
    assert known >= 0.97 * seen, (known, seen)


def test_a_mover_that_is_gone_is_let_go() -> None:
    leaving = {
        "shape": {"circle": 0.4},
        "at": [3.0, -1.0],
        "motion": {"law": "replay", "points": [[-1.0, 3.0, -1.5], [3.0, 3.0, 0.5]]},
    }
    for simulation, _, tracks in track(world_of([leaving], noise=0.01), 5.0):
        if 2.0 < simulation.world.time[0] < 2.9:
            assert tracks.moving.any()
    assert not tracks.moving.any()


def test_hits_belong_to_the_track_they_lie_on() -> None:
    scenario = world_of([disc((4.0, -1.0), (0.0, 0.5))], circles=[[-3.0, 0.0, 0.6]], noise=0.01)
    *_, (_, view, tracks) = track(scenario, 3.0)
    for index in range(len(tracks.id)):
        beams = np.flatnonzero(tracks.beam_track == index)
        hits = view.ranges[beams, None] * view.sensors.beam_directions[:, beams].T
        gaps = np.hypot(*(hits - tracks.position[index]).T) - tracks.radius[index]
        assert len(beams) and np.abs(gaps).max() < 0.1
    assert len(tracks.id) == 2


def test_history_holds_the_last_centres_with_their_times() -> None:
    *_, (simulation, _, tracks) = track(world_of([disc((4.0, -1.0), (0.0, 0.5))]), 4.0)
    index = int(np.flatnonzero(tracks.moving)[0])
    times = tracks.history_times[index]
    assert times[-1] == pytest.approx(simulation.world.time[0])
    assert np.diff(times) == pytest.approx(np.full(len(times) - 1, STEP))
    truth = np.stack([np.full(len(times), 4.0), -1.0 + 0.5 * times], axis=1)
    assert np.abs(tracks.history[index] - truth).max() < 0.15


def test_a_young_tracks_history_repeats_its_oldest_centre() -> None:
    tracks = last_tracks(world_of([disc((4.0, -1.0), (0.0, 0.5))]), 0.4)
    ((times, places, age),) = zip(tracks.history_times, tracks.history, tracks.age, strict=True)
    passed = times - times[0]
    assert passed[-1] == pytest.approx(age) and age >= 0.3
    assert passed == pytest.approx(np.maximum(age + STEP * np.arange(1 - len(times), 1), 0.0))
    assert np.abs(places - np.stack([np.full(len(times), 4.0), -1.0 + 0.5 * times], axis=1)).max() < 0.15


def test_a_turned_and_shifted_world_gives_the_same_tracks_in_the_robots_frame() -> None:
    def turned(angle: float, x: float, y: float) -> Tracks:
        def place(px: float, py: float) -> tuple[float, float]:
            return x + math.cos(angle) * px - math.sin(angle) * py, y + math.sin(angle) * px + math.cos(angle) * py

        velocity = (-0.47 * math.sin(angle), 0.47 * math.cos(angle))
        still = [*place(3.0, 2.0), 0.5]
        scenario = world_of([disc(place(4.03, -1.02), velocity)], circles=[still], start=[x, y, angle])
        scenario["world"]["bounds"] = [-40.0, -40.0, 40.0, 40.0]  # out of sight
        return last_tracks(scenario, 2.0)

    plain, other = turned(0.0, 0.0, 0.0), turned(1.0, 5.0, -7.0)
    assert plain.id.tolist() == other.id.tolist() and plain.moving.any()
    # Ranges are float32, so the last digits differ.
    for name in ("position", "velocity", "radius", "covariance", "history"):
        assert getattr(plain, name) == pytest.approx(getattr(other, name), abs=1e-3), name


@pytest.mark.parametrize("scenario", ["rush", "crowd", "replay"])
def test_tracks_are_finite_and_their_covariances_positive(scenario: str) -> None:
    overrides = {"lidar.dropout": 0.05, "lidar.noise": 0.03}
    for _, _, tracks in track(scenario, 15.0, seed=3, policy="random", overrides=overrides):
        for name in ("position", "velocity", "radius", "covariance", "age", "unseen", "innovation", "history"):
            assert np.isfinite(getattr(tracks, name)).all(), name
        if len(tracks.id):
            assert np.linalg.eigvalsh(tracks.covariance).min() > -1e-9
        assert len(set(tracks.id.tolist())) == len(tracks.id)


def test_the_same_episode_gives_the_same_tracks() -> None:
    first, second = (list(track("rush", 6.0, seed=1, policy="bug2")) for _ in range(2))
    for (_, _, one), (_, _, other) in zip(first, second, strict=True):
        for name in Tracks._fields:
            assert np.array_equal(getattr(one, name), getattr(other, name)), name


def test_a_copied_memory_goes_on_alike_and_leaves_the_first_alone() -> None:
    steps = [(view, float(simulation.world.time[0])) for simulation, view, _ in track("rush", 4.0, policy="bug2")]
    tracker = Tracker(steps[0][0].sensors)
    memory = tracker.start()
    for view, time in steps[:20]:
        tracker.update(memory, view, time)
    twin: TrackerMemory = copy.deepcopy(memory)
    for view, time in steps[20:]:
        expected = tracker.update(memory, view, time)
    for view, time in steps[20:]:
        got = tracker.update(twin, view, time)
    assert np.array_equal(expected.position, got.position) and np.array_equal(expected.id, got.id)


@pytest.mark.parametrize("ranges", [0.0, 10.0, 5.0])
def test_a_scan_all_at_one_range_is_no_error(ranges: float) -> None:
    sensors = Sensors.of(Simulation(world_of([])).scenario)
    flat = np.zeros(len(sensors.angles) + 7, dtype=np.float32)
    flat[: len(sensors.angles)] = ranges
    tracker = Tracker(sensors)
    memory = tracker.start()
    for step in range(10):
        assert not tracker.update(memory, View(flat, sensors), STEP * step).moving.any()


@pytest.mark.parametrize("lidar", [{"lidar.beams": 1}, {"lidar.beams": 2}, {"lidar.beams": 9, "lidar.fov": 1.0}])
def test_any_scanner_will_do(lidar: dict[str, Any]) -> None:
    for _, _, tracks in track("dynamic", 5.0, policy="random", overrides=lidar):
        assert len(tracks.beam_track) == lidar["lidar.beams"]


def test_a_narrow_scanner_tracks_what_it_sees() -> None:
    scenario = world_of([disc((4.0, -1.0), (0.0, 0.5))], noise=0.01)
    scenario["lidar"] |= {"beams": 60, "fov": 2.0}
    tracks = last_tracks(scenario, 2.5)
    (index,) = np.flatnonzero(tracks.moving)
    assert math.dist(tracks.velocity[index], (0.0, 0.5)) < 0.1


def test_selected_tracks_keep_their_beams() -> None:
    scenario = world_of([disc((4.0, -1.0), (0.0, 0.5)), disc((-3.0, 1.0), (0.0, -0.5))], noise=0.01)
    tracks = last_tracks(scenario, 2.0)
    chosen = tracks.select(np.array([1]))
    assert chosen.id.tolist() == [tracks.id[1]]
    assert np.array_equal(chosen.beam_track == 0, tracks.beam_track == 1)
    assert np.array_equal(chosen.beam_track == -1, tracks.beam_track != 1)


@pytest.mark.parametrize("scenario", ["rush", "static"])
def test_what_is_told_of_things_is_what_their_tracks_say(scenario: str) -> None:
    tracker: Tracker | None = None
    seen = 0
    for simulation, view, tracks in track(scenario, 6.0, policy="random"):
        if tracker is None:
            tracker = Tracker(view.sensors)
            memory = tracker.start()
        things, beam_thing = tracker.things(memory, view, float(simulation.world.time[0]))
        assert np.array_equal(beam_thing, tracks.beam_track)
        assert np.array_equal(
            things[[NUMBER, OF_RADIUS, UNSEEN, MOVES]], [tracks.id, tracks.radius, tracks.unseen, tracks.moving]
        )
        assert np.array_equal(things[[AT_X, AT_Y]].T, tracks.position)
        assert np.array_equal(things[[GOES_X, GOES_Y]].T, tracks.velocity)
        seen += len(tracks.id)
    assert seen > 20


def test_time_must_go_forward() -> None:
    steps = list(track(world_of([]), 0.1))
    tracker = Tracker(steps[0][1].sensors)
    memory = tracker.start()
    tracker.update(memory, steps[0][1], 1.0)
    with pytest.raises(ValueError, match="forward"):
        tracker.update(memory, steps[0][1], 1.0)


def test_a_scan_of_another_scanner_is_refused() -> None:
    sensors = Sensors.of(Simulation(world_of([], beams=90)).scenario)
    view = next(track(world_of([]), 0.1))[1]
    tracker = Tracker(sensors)
    with pytest.raises(ValueError, match="90 beams"):
        tracker.update(tracker.start(), view, 0.0)


def test_what_moves_is_told_alone_as_among_all_tracks() -> None:
    steps = [(view, float(simulation.world.time[0])) for simulation, view, _ in track("rush", 4.0, policy="bug2")]
    tracker = Tracker(steps[0][0].sensors)
    memory, twin, movers, room = tracker.start(), tracker.start(), 0, np.empty((TRACKS, MOVER))
    for view, time in steps:
        tracks = tracker.update(memory, view, time)
        moving = room[: tracker.take_in(twin, view, time, room)]
        assert np.array_equal(moving[:, X : Y + 1], tracks.position[tracks.moving])
        assert np.array_equal(moving[:, VX : VY + 1], tracks.velocity[tracks.moving])
        assert np.array_equal(moving[:, DISC], tracks.radius[tracks.moving])
        movers += len(moving)
    assert movers > 0
