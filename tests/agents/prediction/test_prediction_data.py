"""Worlds to learn prediction in: their laws, and that a track's future is the mover's."""

from __future__ import annotations

import numpy as np
import pytest
from tracked import disc, last_tracks, world_of

from bug_gym.agents.prediction.features import ANSWERS, HORIZONS, WIDTH
from bug_gym.agents.prediction.samples import (
    LAWS,
    STREET,
    displacement_errors,
    estimated_frame,
    frame_of,
    law_world,
    match,
    moments,
    movers_of,
    samples_of,
)
from bug_gym.config import load
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors, View


@pytest.mark.parametrize("law", LAWS)
def test_all_that_moves_follows_the_law(law: str) -> None:
    for seed in range(3):
        simulation = Simulation(law_world(law, seed))
        simulation.reset(seeds=[seed])
        movers = simulation.world.layout(0).movers
        assert movers and {mover.motion.law for mover in movers} == {law}


@pytest.mark.parametrize("law", LAWS)
def test_an_episode_teaches_the_same_again(law: str) -> None:
    first, second = (samples_of(law_world(law, 1), 1, every=10) for _ in range(2))
    assert np.array_equal(first.features, second.features) and np.array_equal(first.answers, second.answers)
    assert first.features.shape[1] == WIDTH and first.answers.shape == (len(first.features), ANSWERS)


def test_the_future_of_what_goes_straight_is_where_its_velocity_leads() -> None:
    scenario = load(world_of([disc((-2.0, 3.0), (0.4, 0.0)), disc((3.0, -2.0), (0.0, 0.5))], noise=0.01))
    seen = 0
    for tracks, places in moments(scenario, 0, every=5, seconds=4.0):
        steady = tracks.age > 1.5
        went = (places - tracks.position[:, None]) / HORIZONS[:, None]
        assert np.hypot(*(went - tracks.velocity[:, None])[steady].transpose(2, 0, 1)).max(initial=0.0) < 0.25
        seen += int(steady.sum())
    assert seen > 5


DRIFTS = {"odometry.rotation_bias": 0.3, "odometry.translation_bias": 0.2, "odometry.translation_noise": 0.05}


def test_what_a_robot_takes_for_the_odometry_frame_shows_movers_where_they_are_from_it() -> None:
    simulation = Simulation(load(law_world("bounce", 3), DRIFTS))
    observation = simulation.reset(seeds=[3])
    for _ in range(30):
        observation = simulation.step(np.array([[[0.5, 0.4]]])).observation
    view, (centres, _) = View(observation[0, 0], Sensors.of(simulation.scenario)), movers_of(simulation)
    from_robot = frame_of(*simulation.world.pose[0, 0].tolist())(centres)
    found = [view.to_robot(*place) for place in estimated_frame(simulation)(centres)]
    assert np.hypot(*(simulation.world.odometry[0, 0, :2] - view.position)) < 1e-4
    assert np.allclose(found, from_robot, atol=1e-4)


def test_with_drift_movers_are_still_learned_from_and_lie_where_their_tracks_are() -> None:
    exact, seen = law_world(STREET, 9), []
    for scenario in exact, load(exact, DRIFTS):
        found = list(moments(scenario, 9, every=5, seconds=15.0, times=np.array([0.0])))
        gaps = [np.hypot(*(tracks.position - places[:, 0]).T) for tracks, places in found]
        assert np.median(np.concatenate(gaps)) < 0.1
        seen.append(sum(map(len, gaps)))
    assert seen[1] > 0.7 * seen[0]


def test_a_mover_has_one_track_the_nearest() -> None:
    tracks = last_tracks(world_of([disc((4.0, -1.0), (0.0, 0.5)), disc((-3.0, 1.0), (0.0, -0.5))], noise=0.01), 2.0)
    centres, radii = np.array([[-3.0, 0.0], [4.0, 0.0], [50.0, 50.0]]), np.full(3, 0.3)
    chosen, movers = match(tracks, centres, radii)
    assert sorted(movers.tolist()) == [0, 1]
    assert np.hypot(*(tracks.position[chosen] - centres[movers]).T).max() < 0.2


def test_people_in_a_street_walk_straight_on() -> None:
    seen = 0
    for tracks, places in moments(law_world(STREET, 9), 9, every=20, seconds=5.0):
        way = places - tracks.position[:, None]
        # From 1.6 s on it is the same straight way, but for those who turn back at an end.
        first, last = way[:, 1] / HORIZONS[1], way[:, -1] / HORIZONS[-1]
        assert np.median(np.hypot(*(last - first).T)) < 0.2
        seen += len(way)
    assert seen > 10


def test_an_error_is_a_distance() -> None:
    truth = np.zeros((2, 3, 2))
    assert np.array_equal(displacement_errors(truth + [3.0, 4.0], truth), np.full((2, 3), 5.0))


def test_an_unknown_law_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown motion law 'fly'"):
        law_world("fly", 0)
