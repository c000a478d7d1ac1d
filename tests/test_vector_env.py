"""N worlds behind `gym.vector.VectorEnv`: a row is the single env, and all of it is what SyncVectorEnv would give."""

from __future__ import annotations

import contextlib
import copy
import math
import pickle
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.wrappers import vector as wrappers

import bug_gym
from bug_gym.navigation_env import NavigationEnv
from bug_gym.vector_env import NavigationVectorEnv

IDS = list(bug_gym.SCENARIOS_BY_ID)
MODES = [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP]
# Episodes of at most 2.5 s, so that a few hundred steps hold many ends of both kinds.
SHORT = {"time.limit": 2.5, "lidar.dropout": 0.05, "odometry.rotation_noise": 0.05, "reward.smoothness": -0.1}


def make(count: int, **settings: Any) -> NavigationVectorEnv:
    return NavigationVectorEnv(count, scenario="rush", overrides=SHORT, **settings)


def make_sync(count: int, mode: AutoresetMode, **settings: Any) -> SyncVectorEnv[Any, Any]:
    one = lambda: NavigationEnv("rush", SHORT, **settings)  # noqa: E731
    return SyncVectorEnv([one] * count, autoreset_mode=mode)


def random_actions(steps: int, count: int) -> np.ndarray[Any, np.dtype[np.float32]]:
    # Full speed ahead more often than not: some episodes end in a collision before they are cut off.
    return np.random.default_rng(1).uniform([-0.5, -1.0], 1.5, (steps, count, 2)).clip(-1.0, 1.0).astype(np.float32)


def in_row(values: Any, row: int) -> Any:
    """One row of observations or infos, as the single env gives it; infos that the row does not have are left out."""
    if not isinstance(values, dict):
        return values[row].item() if isinstance(values[row], np.generic) else values[row]
    has = {name: values[f"_{name}"][row] if f"_{name}" in values else True for name in values if name[0] != "_"}
    return {name: in_row(values[name], row) for name in has if has[name]}


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("count", [1, 2, 7])
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_row_is_the_single_env_bit_for_bit(mode: AutoresetMode, count: int, threads: int) -> None:
    vector = make(count, autoreset_mode=mode, threads=threads)
    singles = [NavigationEnv("rush", SHORT) for _ in range(count)]
    observation, infos = vector.reset(seed=30)
    for row, single in enumerate(singles):
        assert data_equivalence((in_row(observation, row), in_row(infos, row)), single.reset(seed=30 + row), exact=True)
    ended = [False] * count
    for actions in random_actions(120, count):
        observation, reward, terminated, truncated, infos = vector.step(actions)
        for row, single in enumerate(singles):
            came = tuple(in_row(values, row) for values in (observation, reward, terminated, truncated, infos))
            if mode == AutoresetMode.NEXT_STEP and ended[row]:
                first, info = single.reset()
                expected: Any = (first, 0.0, False, False, info)
            else:
                expected = single.step(actions[row])
            ended[row] = bool(expected[2] or expected[3])
            if mode == AutoresetMode.SAME_STEP and ended[row]:
                last, *flags, last_info = expected
                first, info = single.reset()
                expected = (first, *flags, info | {"final_obs": last, "final_info": last_info})
            assert data_equivalence(came, expected, exact=True)
        if mode == AutoresetMode.DISABLED and any(ended):
            mask = np.array(ended)
            observation, infos = vector.reset(options={"reset_mask": mask})
            for row in np.flatnonzero(mask).tolist():
                expected = singles[row].reset()
                assert data_equivalence((in_row(observation, row), in_row(infos, row)), expected, exact=True)
    vector.close()


@pytest.mark.parametrize("action", ["continuous", "discrete"])
@pytest.mark.parametrize("observation", ["dict", "flat"])
@pytest.mark.parametrize("mode", MODES)
def test_all_that_comes_back_is_what_sync_vector_env_gives(mode: AutoresetMode, observation: Any, action: Any) -> None:
    ours = make(5, autoreset_mode=mode, observation=observation, action=action)
    sync = make_sync(5, mode, observation=observation, action=action)
    assert data_equivalence(ours.reset(seed=9), sync.reset(seed=9), exact=True)
    ours.action_space.seed(2)
    ends = 0
    for _ in range(150):
        actions = ours.action_space.sample()
        came, expected = ours.step(actions), sync.step(actions)
        assert data_equivalence(came, expected, exact=True)
        ends += int((came[2] | came[3]).sum())
    assert ends > 20
    assert data_equivalence(ours.reset(), sync.reset(), exact=True)


def test_a_masked_reset_is_what_sync_vector_env_gives() -> None:
    ours, sync = make(4, autoreset_mode=AutoresetMode.DISABLED), make_sync(4, AutoresetMode.DISABLED)
    assert data_equivalence(ours.reset(seed=3), sync.reset(seed=3), exact=True)
    resets = 0
    for actions in random_actions(100, 4):
        came, expected = ours.step(actions), sync.step(actions)
        assert data_equivalence(came, expected, exact=True)
        mask = came[2] | came[3]
        if mask.any():
            resets += 1
            seeds = [None, 50 + resets, None, 60 + resets]
            options = {"reset_mask": mask}
            expected_reset = sync.reset(seed=seeds, options=dict(options))
            assert data_equivalence(ours.reset(seed=seeds, options=options), expected_reset, exact=True)
            assert "reset_mask" in options
    assert resets > 2


@pytest.mark.parametrize("name", IDS)
def test_every_id_makes_rows_that_equal_its_single_env(name: str) -> None:
    vector, sync = gym.make_vec(name, num_envs=3), gym.make_vec(name, num_envs=3, vectorization_mode="sync")
    assert isinstance(vector, NavigationVectorEnv)
    assert isinstance(sync, SyncVectorEnv)
    for space in ("observation_space", "action_space", "single_observation_space", "single_action_space"):
        assert getattr(vector, space) == getattr(sync, space)
    assert vector.metadata == sync.metadata | {"render_modes": ["rgb_array"]}
    assert data_equivalence(vector.reset(seed=4), sync.reset(seed=4), exact=True)
    for actions in random_actions(30, 3):
        assert data_equivalence(vector.step(actions), sync.step(actions), exact=True)


@pytest.mark.parametrize("name", IDS)
def test_the_same_seed_gives_the_same_run(name: str) -> None:
    noises = {"lidar.noise": 0.05, "lidar.dropout": 0.1, "odometry.translation_noise": 0.1, "goal.sensing": "odometry"}
    runs = []
    for _ in range(2):
        vector = gym.make_vec(name, num_envs=3, overrides=SHORT | noises, autoreset_mode="SameStep")
        runs.append((vector.reset(seed=1), *[vector.step(actions) for actions in random_actions(300, 3)]))
    assert data_equivalence(runs[0], runs[1], exact=True)


def test_a_saved_state_restored_mid_episode_goes_on_bit_for_bit() -> None:
    vector = make(3, autoreset_mode=AutoresetMode.SAME_STEP)
    vector.reset(seed=0)
    actions = random_actions(60, 3)
    for one in actions[:10]:
        vector.step(one)
    saved = vector.simulation.save()
    first = tuple(vector.step(one) for one in actions[10:])
    vector.simulation.restore(saved)
    assert data_equivalence(first, tuple(vector.step(one) for one in actions[10:]), exact=True)


def test_a_pickled_env_goes_on_like_the_original_between_the_end_and_the_reset_of_a_row() -> None:
    vector = make(4, threads=2)
    vector.reset(seed=0)
    for actions in random_actions(60, 4):
        _, _, terminated, truncated, _ = vector.step(actions)
        if terminated.any() and not truncated.all():
            break
    twin = pickle.loads(pickle.dumps(vector))
    for actions in random_actions(30, 4):
        assert data_equivalence(vector.step(actions), twin.step(actions), exact=True)


def test_final_observations_stand_only_in_rows_that_ended() -> None:
    vector = make(6, autoreset_mode="SameStep", observation="flat")
    vector.reset(seed=0)
    seen = 0
    for actions in random_actions(60, 6):
        _, _, terminated, truncated, infos = vector.step(actions)
        ended = terminated | truncated
        assert ("final_obs" in infos) == ("final_info" in infos) == ended.any()
        if ended.any():
            seen += 1
            assert infos["final_obs"].dtype == object
            assert [one is not None for one in infos["final_obs"]] == ended.tolist()
            np.testing.assert_array_equal(infos["_final_obs"], ended)
            np.testing.assert_array_equal(infos["final_info"]["_time"], ended)
            assert (infos["final_info"]["time"][ended] > 0.0).all()
            assert (infos["time"][ended] == 0.0).all()
    assert seen > 2


def test_what_was_returned_stays_as_it_is() -> None:
    for mode in MODES:
        vector = make(3, autoreset_mode=mode)
        kept = [vector.reset(seed=0), *[vector.step(actions) for actions in random_actions(40, 3)]]
        copies = copy.deepcopy(kept)
        for actions in random_actions(40, 3):
            vector.step(actions)
        vector.reset()
        assert data_equivalence(tuple(kept), tuple(copies), exact=True)


# Of seed 0 episode 1 finds no place for its obstacles, of seed 1 episode 2. Episodes of three steps.
CROWDED: dict[str, Any] = {
    "world": {
        "family": "field",
        "bounds": [-6, -6, 6, 6],
        "obstacles": 28,
        "sizes": [0.4, 0.9],
        "separation": 6.0,
        "solvable": 0.3,
    },
    "time": {"limit": 0.3},
}


def state_of(vector: NavigationVectorEnv) -> list[bytes]:
    """What its worlds are."""
    return [array.tobytes() for array in vector.simulation.save()[0][1:4]]


def one_step_apart(mode: AutoresetMode) -> NavigationVectorEnv:
    """Two rows of which the second is a step behind."""
    vector = NavigationVectorEnv(2, scenario=CROWDED, autoreset_mode=mode)
    vector.reset(seed=[0, 1])
    vector.step(np.zeros((2, 2), np.float32))
    vector.reset(seed=[None, 1], options={"reset_mask": np.array([False, True])})
    return vector


def next_world(single: NavigationEnv) -> tuple[Any, dict[str, Any]]:
    """The next episode that finds its place."""
    for _ in range(5):
        with contextlib.suppress(ValueError):
            return single.reset()
    raise AssertionError("no place in five tries")


@pytest.mark.parametrize("mode", MODES)
def test_a_step_that_finds_no_place_for_a_next_world_is_called_again_and_loses_nothing(mode: AutoresetMode) -> None:
    vector, singles = one_step_apart(mode), [NavigationEnv(CROWDED) for _ in range(2)]
    for row, single in enumerate(singles):
        single.reset(seed=row)
    singles[0].step(np.zeros(2, np.float32))
    refused, ended = 0, [False, False]
    for actions in random_actions(20, 2):
        given: Any = actions
        for _ in range(5):
            before = state_of(vector)
            try:
                observation, reward, terminated, truncated, infos = vector.step(given)
                break
            except ValueError as error:
                assert "found a free place" in str(error)
                refused += 1
                if mode == AutoresetMode.NEXT_STEP:
                    assert state_of(vector) == before
                else:
                    given = -actions  # count for nothing: the step has been driven
        for row, single in enumerate(singles):
            came = tuple(in_row(values, row) for values in (observation, reward, terminated, truncated, infos))
            if ended[row]:
                first, info = next_world(single)
                expected: Any = (first, 0.0, False, False, info)
            else:
                expected = single.step(actions[row])
            is_over = bool(expected[2] or expected[3])
            ended[row] = is_over and mode == AutoresetMode.NEXT_STEP
            if is_over and mode == AutoresetMode.SAME_STEP:
                last, *flags, last_info = expected
                first, info = next_world(single)
                expected = (first, *flags, info | {"final_obs": last, "final_info": last_info})
            assert data_equivalence(came, expected, exact=True)
    assert refused >= 2


def with_a_step_that_waits() -> tuple[NavigationVectorEnv, NavigationVectorEnv]:
    """Two rows of which the first has ended and found no place for its next world; and the same a step before."""
    vector = one_step_apart(AutoresetMode.SAME_STEP)
    vector.step(np.ones((2, 2), np.float32))
    before = pickle.loads(pickle.dumps(vector))
    with pytest.raises(ValueError, match="seed 0, episode 1: only"):
        vector.step(np.ones((2, 2), np.float32))
    return vector, before


@pytest.mark.parametrize("row", [0, 1])
def test_a_row_may_be_reset_while_a_step_waits_to_be_handed_over(row: int) -> None:
    vector, before = with_a_step_that_waits()
    mask = np.arange(2) == row
    observation, _ = vector.reset(seed=[5, 5], options={"reset_mask": mask})
    twin = pickle.loads(pickle.dumps(vector))
    seen, reward, terminated, truncated, infos = vector.step(np.zeros((2, 2), np.float32))
    before.simulation.advance(np.ones((2, 1, 2)))
    last = before.simulation.transition(before.simulation.all_rows).of_robot(0)
    assert not terminated.any() and truncated.tolist() == infos["_final_obs"].tolist() == [True, False]
    assert data_equivalence(infos["final_obs"][0], before.spaces.present(last.observation[0]), exact=True)
    assert reward.tolist() == [last.reward[0], 0.0 if row == 1 else last.reward[1]]
    assert data_equivalence(in_row(seen, row), in_row(observation, row), exact=True)
    assert infos["time"].tolist() == [0.0, 0.0 if row == 1 else pytest.approx(0.2)]
    again = twin.step(np.zeros((2, 2), np.float32))
    assert data_equivalence(again, (seen, reward, terminated, truncated, infos), exact=True)
    assert vector.step(np.zeros((2, 2), np.float32))[4]["time"][row] == pytest.approx(0.1), "driven again"


def test_a_reset_of_all_rows_drops_the_step_that_waits() -> None:
    vector, _ = with_a_step_that_waits()
    fresh = NavigationVectorEnv(2, scenario=CROWDED, autoreset_mode=AutoresetMode.SAME_STEP)
    for env in (vector, fresh):
        env.reset(seed=[0, 1])
    for actions in random_actions(2, 2):
        assert data_equivalence(vector.step(actions), fresh.step(actions), exact=True)


def test_actions_that_are_refused_start_no_row_anew() -> None:
    vector = NavigationVectorEnv(2, scenario="empty", overrides={"time.limit": 0.2})
    vector.reset(seed=0)
    vector.step(np.zeros((2, 2)))
    vector.reset(options={"reset_mask": np.array([False, True])})
    assert vector.step(np.zeros((2, 2)))[3].tolist() == [True, False]
    before = state_of(vector)
    with pytest.raises(ValueError, match="finite"):
        vector.step(np.array([[0.0, 0.0], [np.nan, 0.0]]))
    assert state_of(vector) == before
    infos = vector.step(np.array([[np.nan, 0.0], [0.0, 0.0]]))[4]  # of a row that begins anew nobody reads it
    assert infos["time"].tolist() == [0.0, pytest.approx(0.2)]


def test_the_shortest_paths_come_as_an_array() -> None:
    infos = make(2).reset(seed=8, options={"shortest_path": True})[1]
    singles = [NavigationEnv("rush", SHORT).reset(seed=8 + row, options={"shortest_path": True})[1] for row in range(2)]
    assert infos["shortest_path_length"].tolist() == [info["shortest_path_length"] for info in singles]
    assert infos["_shortest_path_length"].tolist() == [True, True]


# ---------------------------------------------------------------------------------------------- Gymnasium's wrappers

WRAPPERS: dict[str, Callable[[VectorEnv[Any, Any, Any]], VectorEnv[Any, Any, Any]]] = {
    "statistics": wrappers.RecordEpisodeStatistics,
    "reward": wrappers.NormalizeReward,
    "action": lambda env: wrappers.RescaleAction(env, -2.0, 2.0),
}
OBSERVATION_WRAPPERS: dict[str, Callable[[VectorEnv[Any, Any, Any]], VectorEnv[Any, Any, Any]]] = {
    "normalize": wrappers.NormalizeObservation,
    "rescale": lambda env: wrappers.RescaleObservation(env, 0.0, 1.0),
    "dtype": lambda env: wrappers.DtypeObservation(env, np.float64),
}


def without_clock(step: tuple[Any, ...]) -> tuple[Any, ...]:
    """A step without the duration of the episode, which is measured by the clock."""
    *values, infos = step
    if "episode" in infos:
        infos = infos | {"episode": {name: infos["episode"][name] for name in infos["episode"].keys() - {"t", "_t"}}}
    return (*values, infos)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", WRAPPERS)
def test_wrappers_see_no_difference_to_sync_vector_env(name: str, mode: AutoresetMode) -> None:
    wrap = WRAPPERS[name]
    ours, sync = wrap(make(4, autoreset_mode=mode)), wrap(make_sync(4, mode))
    assert data_equivalence(ours.reset(seed=1), sync.reset(seed=1), exact=True)
    for actions in random_actions(100, 4):
        assert data_equivalence(without_clock(ours.step(actions)), without_clock(sync.step(actions)), exact=True)


@pytest.mark.parametrize("name", OBSERVATION_WRAPPERS)
def test_observation_wrappers_see_no_difference_to_sync_vector_env(name: str) -> None:
    wrap, mode = OBSERVATION_WRAPPERS[name], AutoresetMode.NEXT_STEP
    ours, sync = wrap(make(4, observation="flat")), wrap(make_sync(4, mode, observation="flat"))
    assert data_equivalence(ours.reset(seed=1), sync.reset(seed=1), exact=True)
    for actions in random_actions(60, 4):
        assert data_equivalence(ours.step(actions), sync.step(actions), exact=True)


def test_dict_observations_pass_through_the_flattening_wrapper() -> None:
    ours, sync = make(3), make_sync(3, AutoresetMode.NEXT_STEP)
    wrapped, expected = wrappers.FlattenObservation(ours), wrappers.FlattenObservation(sync)
    np.testing.assert_array_equal(wrapped.reset(seed=1)[0], expected.reset(seed=1)[0])


# ---------------------------------------------------------------------------------------------- making one


def test_make_vec_raises_no_warning_and_names_the_mode() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        default = gym.make_vec("BugGym/Static-v0", num_envs=2)
        disabled = gym.make_vec("BugGym/Static-v0", num_envs=2, autoreset_mode="Disabled")
    assert default.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert disabled.metadata["autoreset_mode"] is AutoresetMode.DISABLED
    assert NavigationVectorEnv.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP


def test_most_steps_of_an_episode_cut_it_off_as_the_time_limit_wrapper_does() -> None:
    settings: dict[str, Any] = {"num_envs": 2, "max_episode_steps": 7}
    ours = gym.make_vec("BugGym/Static-v0", **settings)
    sync = gym.make_vec("BugGym/Static-v0", vectorization_mode="sync", **settings)
    ours.reset(seed=0), sync.reset(seed=0)
    for actions in np.zeros((20, 2, 2), dtype=np.float32):
        came, expected = ours.step(actions), sync.step(actions)
        assert data_equivalence(came[1:4], expected[1:4], exact=True)


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_an_episode_that_ends_by_itself_in_the_last_step_is_cut_off_too_as_the_wrapper_has_it(
    mode: AutoresetMode,
) -> None:
    wall = [[1, -1], [2, -1], [2, 1], [1, 1]]
    world = {"family": "explicit", "bounds": [-2, -2, 8, 2], "start": [0, 0, 0], "goal": [7, 0], "polygons": [wall]}
    settings: dict[str, Any] = {"num_envs": 2, "scenario": {"world": world}}
    settings |= {"max_episode_steps": 9}
    ours = gym.make_vec("BugGym/Navigation-v0", autoreset_mode=mode, **settings)
    sync = gym.make_vec(
        "BugGym/Navigation-v0", vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **settings
    )
    ours.reset(seed=0), sync.reset(seed=0)
    actions = np.array([[1.0, 0.0], [0.0, 0.0]], dtype=np.float32)  # into the wall, and nowhere
    for _ in range(9):
        came, expected = ours.step(actions), sync.step(actions)
        assert data_equivalence(came[1:4], expected[1:4], exact=True)
    assert came[2].tolist() == [True, False] and came[3].tolist() == [True, True]


def test_the_shortest_path_to_a_goal_beside_which_the_body_does_not_fit_is_no_number() -> None:
    near = {"world": {"family": "explicit", "bounds": [0, 0, 10, 10], "start": [2, 5, 0], "goal": [9.85, 5]}}
    rows = NavigationVectorEnv(2, scenario=near)
    _, infos = rows.reset(seed=7, options={"shortest_path": True})
    assert np.isnan(infos["shortest_path_length"]).tolist() == [True, True]
    _, info = gym.make("BugGym/Navigation-v0", scenario=near).reset(seed=7, options={"shortest_path": True})
    assert math.isnan(info["shortest_path_length"])


@pytest.mark.parametrize("most", [-1, np.int64(-1), None])
def test_gymnasiums_sign_for_no_limit_is_none(most: Any) -> None:
    vector: Any = gym.make_vec("BugGym/Static-v0", num_envs=2, max_episode_steps=most, overrides={"time.limit": 0.4})
    vector.reset(seed=0)
    assert [bool(vector.step(np.zeros((2, 2)))[3].any()) for _ in range(4)] == [False, False, False, True]


def test_most_steps_never_prolong_an_episode() -> None:
    assert NavigationVectorEnv(scenario="empty", max_episode_steps=10**9).simulation.scenario.time.limit == 120.0


def test_a_row_without_a_seed_goes_on_with_its_next_episode() -> None:
    first, second = make(3, observation="flat"), make(3, observation="flat")
    first.reset(seed=5), second.reset(seed=5)
    worlds, mixed = first.reset()[0], second.reset(seed=[None, 6, 90])[0]
    np.testing.assert_array_equal(worlds[0], mixed[0])
    assert (worlds[1] != mixed[1]).any()
    np.testing.assert_array_equal(mixed[1], NavigationEnv("rush", SHORT, observation="flat").reset(seed=6)[0])


@pytest.mark.parametrize("seed", [4, [9, 2, 7]])
def test_each_row_tells_its_seed_as_in_sync_vector_env(seed: Any) -> None:
    ours, sync = make(3), make_sync(3, AutoresetMode.NEXT_STEP)
    assert ours.np_random_seed == (-1, -1, -1)
    for env in (ours, sync):
        env.reset(seed=seed)
        env.reset()
    assert ours.np_random_seed == sync.np_random_seed
    assert ours.get_attr("np_random_seed") == sync.get_attr("np_random_seed")
    wrapped: Any = wrappers.RecordEpisodeStatistics(ours)
    assert wrapped.np_random_seed == sync.np_random_seed


def test_rows_that_began_without_seeds_tell_which_ones_they_took() -> None:
    ours = make(3, observation="flat")
    drawn, _ = ours.reset()
    seeds = list(ours.np_random_seed)
    np.testing.assert_array_equal(make(3, observation="flat").reset(seed=seeds)[0], drawn)


def test_rows_without_seeds_differ() -> None:
    worlds = make(4, observation="flat").reset()[0]
    assert len(np.unique(worlds, axis=0)) == 4


def test_each_row_has_its_picture() -> None:
    pytest.importorskip("pygame", reason="pygame-ce comes with the extra `render`")
    vector = make(2, render_mode="rgb_array")
    vector.reset(seed=3)
    single = NavigationEnv("rush", SHORT, render_mode="rgb_array")
    for row, frame in enumerate(vector.render() or ()):
        single.reset(seed=3 + row)
        np.testing.assert_array_equal(frame, single.render())
    assert len(vector.render() or ()) == 2


# ---------------------------------------------------------------------------------------------- bad input


@pytest.mark.parametrize("mask", [[True, False], np.array([1, 0]), np.array([True]), np.array([False, False])])
def test_a_mask_that_is_none_is_refused(mask: Any) -> None:
    vector = make(2)
    vector.reset(seed=0)
    with pytest.raises(ValueError, match="reset_mask"):
        vector.reset(options={"reset_mask": mask})


def test_as_many_seeds_as_rows_are_asked_for() -> None:
    with pytest.raises(ValueError, match="2 seeds for 3 rows"):
        make(3).reset(seed=[1, 2])


def test_a_row_that_ended_is_not_stepped_where_the_caller_resets() -> None:
    vector = NavigationVectorEnv(2, scenario="empty", overrides={"time.limit": 0.1}, autoreset_mode="Disabled")
    vector.reset(seed=0)
    assert vector.step(np.zeros((2, 2)))[3].all()
    vector.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(ResetNeeded, match="row 1"):
        vector.step(np.zeros((2, 2)))


def test_a_step_before_the_first_reset_is_refused() -> None:
    with pytest.raises(ResetNeeded):
        make(2).step(np.zeros((2, 2)))


def test_a_picture_of_rows_that_were_never_reset_is_refused() -> None:
    pytest.importorskip("pygame", reason="pygame-ce comes with the extra `render`")
    vector = NavigationVectorEnv(2, scenario="empty", render_mode="rgb_array")
    vector.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(ResetNeeded, match="row 1"):
        vector.render()


@pytest.mark.parametrize("actions", [np.zeros((3, 2)), np.zeros(2), np.full((2, 2), np.nan)])
def test_actions_that_are_none_are_refused(actions: Any) -> None:
    vector = make(2)
    vector.reset(seed=0)
    with pytest.raises(ValueError, match="action"):
        vector.step(actions)


@pytest.mark.parametrize("actions", [np.array([0, 128]), np.array([-1, 0]), np.array([0.0, 1.0]), np.array([0])])
def test_discrete_actions_that_are_none_are_refused(actions: Any) -> None:
    vector = make(2, action="discrete")
    vector.reset(seed=0)
    with pytest.raises(ValueError, match="action"):
        vector.step(actions)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"num_envs": 0}, "at least 1"),
        ({"threads": 0}, "at least 1"),
        ({"autoreset_mode": "Tomorrow"}, "Tomorrow"),
        ({"render_mode": "human"}, "'rgb_array'.*'human'"),
        ({"scenario": "crossing_robots"}, "parallel_env"),
    ],
)
def test_an_argument_that_is_not_known_is_refused(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        NavigationVectorEnv(**settings)
