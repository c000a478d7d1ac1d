"""N worlds behind stable-baselines3's `VecEnv`."""

from __future__ import annotations

import contextlib
import copy
import pickle
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

import bug_gym
from bug_gym.checks import install_command
from bug_gym.config import load
from bug_gym.navigation_env import NavigationEnv
from bug_gym.policy import MisfitError
from bug_gym.robots_env import parallel_env

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")

from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecMonitor, VecNormalize

from bug_gym.agents import make_policy, sb3
from bug_gym.agents.learning.vec_envs import join
from bug_gym.agents.sb3 import NavigationVecEnv, make_robots_vec_env, make_vec_env
from bug_gym.evaluation import evaluate, record_episode

BRIEF = {"time.limit": 0.5}
DRIVES = (lambda policy, scenario: evaluate([policy], scenario, episodes=1), record_episode)
"""What drives a policy besides an env's own loop."""

ROOT = Path(__file__).resolve().parents[2]
IDS = list(bug_gym.SCENARIOS_BY_ID)
# Episodes of at most 2.5 s, so that a few hundred steps hold many ends of both kinds.
SHORT = {"time.limit": 2.5, "lidar.dropout": 0.05, "odometry.rotation_noise": 0.05}


def make(count: int, **settings: Any) -> NavigationVecEnv:
    return make_vec_env("rush", count, overrides=SHORT, **settings)


def random_actions(steps: int, count: int) -> np.ndarray[Any, np.dtype[np.float32]]:
    # Full speed ahead more often than not: some episodes end in a collision before they are cut off.
    return np.random.default_rng(1).uniform([-0.5, -1.0], 1.5, (steps, count, 2)).clip(-1.0, 1.0).astype(np.float32)


def without_clock(infos: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Infos without the time that has passed."""
    return [
        info | {"episode": {name: info["episode"][name] for name in ("r", "l")}} if "episode" in info else info
        for info in infos
    ]


def plain(observation: Any) -> Any:
    """SB3's ordered dict as a dict."""
    return dict(observation) if isinstance(observation, dict) else observation


@pytest.mark.parametrize("name", IDS)
def test_stable_baselines3_finds_nothing_to_say_about_the_single_env(name: str) -> None:
    for observation in ("dict", "flat"):
        for action in ("continuous", "discrete"):
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                check_env(gym.make(name, observation=observation, action=action), skip_render_check=True)


@pytest.mark.parametrize("action", ["continuous", "discrete"])
@pytest.mark.parametrize("observation", ["dict", "flat"])
def test_all_but_the_infos_underway_is_what_dummy_vec_env_gives(observation: Any, action: Any) -> None:
    settings = {"observation": observation, "action": action}
    ours = make(4, seed=20, **settings)
    dummy = DummyVecEnv([lambda: Monitor(NavigationEnv("rush", SHORT, **settings))] * 4)
    dummy.seed(20)
    assert (ours.observation_space, ours.action_space) == (dummy.observation_space, dummy.action_space)
    assert data_equivalence(ours.reset(), plain(dummy.reset()), exact=True)
    assert ours.reset_infos == dummy.reset_infos
    ours.action_space.seed(0)
    ends = 0
    for _ in range(150):
        actions = np.array([ours.action_space.sample() for _ in range(4)])
        came, reward, done, infos = ours.step(actions)
        expected, expected_reward, expected_done, expected_infos = dummy.step(actions)
        assert data_equivalence(came, plain(expected), exact=True)
        np.testing.assert_array_equal(reward, expected_reward)
        np.testing.assert_array_equal(done, expected_done)
        assert ours.reset_infos == dummy.reset_infos
        for row in range(4):
            if not done[row]:
                assert infos[row] == {}
                continue
            ends += 1
            mine, theirs = infos[row], expected_infos[row]
            assert mine.keys() == theirs.keys()
            assert mine["episode"]["r"] == pytest.approx(theirs["episode"]["r"], abs=1e-6)
            assert mine["episode"]["l"] == theirs["episode"]["l"]
            same = mine.keys() - {"episode"}
            assert data_equivalence({k: mine[k] for k in same}, {k: theirs[k] for k in same}, exact=True)
    assert ends > 10


@pytest.mark.parametrize("form", ["", "Flat", "Discrete"])
def test_an_id_gives_the_spaces_that_it_binds(form: str) -> None:
    name = f"BugGym/Rush{form}-v0"
    ours, dummy = make_vec_env(name, 1), DummyVecEnv([lambda: gym.make(name)])
    assert (ours.observation_space, ours.action_space) == (dummy.observation_space, dummy.action_space)
    asked = make_vec_env(name, 1, observation="dict", action="continuous")
    assert (asked.observation_space, asked.action_space) == (make(1).observation_space, make(1).action_space)


def test_an_id_that_binds_no_scenario_is_refused() -> None:
    with pytest.raises(ValueError, match="BugGym/Prediction-v0 binds no scenario"):
        make_vec_env("BugGym/Prediction-v0")


def test_a_reset_tells_what_its_options_ask_for() -> None:
    drawn = {**SHORT, "robot.max_speed": {"uniform": [0.5, 1.0]}}
    ours, dummy = make_vec_env("rush", 2, overrides=drawn), DummyVecEnv([lambda: NavigationEnv("rush", drawn)] * 2)
    for env in (ours, dummy):
        env.seed(3)
        env.set_options([{"shortest_path": True}, {"drawn": True}])
        env.reset()
    assert ours.reset_infos == dummy.reset_infos
    assert "shortest_path_length" in ours.reset_infos[0] and "drawn.robot.max_speed" in ours.reset_infos[1]
    ours.reset()
    assert "shortest_path_length" not in ours.reset_infos[0]


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_change_nothing(threads: int) -> None:
    first, second = make(9, seed=0), make(9, seed=0, threads=threads)
    assert data_equivalence(first.reset(), second.reset(), exact=True)
    for actions in random_actions(60, 9):
        *came, infos = first.step(actions)
        *expected, expected_infos = second.step(actions)
        assert data_equivalence(tuple(came), tuple(expected), exact=True)
        assert data_equivalence(tuple(without_clock(infos)), tuple(without_clock(expected_infos)), exact=True)
    second.close()


@pytest.mark.parametrize("name", IDS)
def test_the_same_seed_gives_the_same_run(name: str) -> None:
    runs = []
    for _ in range(2):
        made = make_vec_env(name, 3, seed=1, overrides=SHORT)
        run: list[Any] = [made.reset()]
        for actions in random_actions(300, 3):
            *values, infos = made.step(actions)
            run += [*values, tuple(without_clock(infos))]
        runs.append(tuple(run))
    assert data_equivalence(runs[0], runs[1], exact=True)


def test_a_reset_without_a_seed_goes_on_with_the_next_episodes() -> None:
    made, single = make(2, seed=5, observation="flat"), NavigationEnv("rush", SHORT, observation="flat")
    first, second = made.reset(), made.reset()
    np.testing.assert_array_equal(first[1], single.reset(seed=6)[0])
    np.testing.assert_array_equal(second[1], single.reset()[0])


def test_a_saved_state_restored_mid_episode_goes_on_bit_for_bit() -> None:
    made = make(3, seed=0)
    made.reset()
    saved = made.simulation.save()
    first, second = [], []
    for actions in random_actions(30, 3):
        first.append(made.step(actions)[:3])
    made.simulation.restore(saved)
    for actions in random_actions(30, 3):
        second.append(made.step(actions)[:3])
    assert data_equivalence(tuple(first), tuple(second), exact=True)


def test_what_was_returned_stays_as_it_is() -> None:
    made = make(3, seed=0)
    kept: list[Any] = [made.reset(), *[made.step(actions)[:3] for actions in random_actions(40, 3)]]
    copies = copy.deepcopy(kept)
    for actions in random_actions(40, 3):
        made.step(actions)
    assert data_equivalence(tuple(kept), tuple(copies), exact=True)


def crowded(obstacles: int) -> dict[str, Any]:
    """Worlds of which many find no place for so many obstacles, in episodes of three steps."""
    field = {"family": "field", "bounds": [-6, -6, 6, 6], "sizes": [0.4, 0.9], "separation": 6.0, "solvable": 0.3}
    return {"name": "tight", "world": {**field, "obstacles": obstacles}, "time": {"limit": 0.3}}


def next_world(single: Any) -> tuple[Any, Any]:
    """What the reset of an env gives for the next episode that finds its place."""
    for _ in range(50):
        with contextlib.suppress(ValueError):
            came: tuple[Any, Any] = single.reset()
            return came
    raise AssertionError("no place in fifty tries")


def stepped(made: Any, actions: Any) -> tuple[Any, int]:
    """What a step gives, asked for again with other actions as long as it is refused; and how often it was."""
    for refused in range(50):
        try:
            return made.step(actions if refused == 0 else -actions), refused
        except ValueError as error:
            assert "found a free place" in str(error)
    raise AssertionError("no place in fifty tries")


@pytest.mark.parametrize(("obstacles", "tries"), [(28, 100), (29, 100), (29, 1)])
def test_a_next_world_that_finds_no_place_is_passed_over_and_nothing_of_the_step_is_lost(
    obstacles: int, tries: int, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(sb3, "TRIES", tries)
    monkeypatch.setattr("bug_gym.log.told", set())
    made = make_vec_env(crowded(obstacles), 2, observation="flat")
    singles = [NavigationEnv(crowded(obstacles), observation="flat") for _ in range(2)]
    first: Any = [seed for seed in range(20) if finds_its_place(singles[0], seed)][:2]
    made._seeds = first
    made.reset()
    returns, refused, passed = [0.0, 0.0], 0, 0
    for row, single in enumerate(singles):
        single.reset(seed=first[row])
    for actions in random_actions(30, 2):
        (seen, reward, done, infos), count = stepped(made, actions)
        refused += count
        for row, single in enumerate(singles):
            observation, given, terminated, truncated, info = single.step(actions[row])
            returns[row] += given
            assert (reward[row], done[row]) == (np.float32(given), terminated or truncated)
            if done[row]:
                np.testing.assert_array_equal(infos[row]["terminal_observation"], observation)
                assert infos[row]["episode"]["r"] == pytest.approx(returns[row]) and infos[row]["time"] == info["time"]
                before = int(single.simulation.world.episode[0])
                observation, begun = next_world(single)
                passed += int(single.simulation.world.episode[0]) - before - 1
                assert made.reset_infos[row] == begun
                returns[row] = 0.0
            np.testing.assert_array_equal(seen[row], observation)
    assert passed > 0 and (refused > 0) == (tries == 1)
    if obstacles == 28:
        assert first == [0, 1]
        (line,) = [record.getMessage() for record in caplog.records if "passed over" in record.getMessage()]
        assert line.startswith("tight, seed 0, episode 1: only 2") and "it is passed over" in line


def finds_its_place(single: NavigationEnv, seed: int) -> bool:
    try:
        single.reset(seed=seed)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("restart", ["world", "robot"])
def test_rows_of_robots_pass_over_next_worlds_that_find_no_place_too(
    restart: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    several = {**crowded(27), "robots": {"count": 2}}
    plain, asked_again = (make_robots_vec_env(several, n_envs=2, restart=restart) for _ in range(2))
    single = parallel_env(several, observation="flat")
    for seed in range(50):
        with contextlib.suppress(ValueError):
            plain.seed(seed), asked_again.seed(seed)
            first = plain.reset()
            break
    assert data_equivalence(asked_again.reset(), first, exact=True)
    single.reset(seed=seed)
    refused = passed = 0
    for actions in random_actions(60, 4):
        came: Any = plain.step(actions)
        with monkeypatch.context() as patched:
            patched.setattr(sb3, "TRIES", 1)
            again, count = stepped(asked_again, actions)
        refused += count
        assert data_equivalence(
            (*again[:3], *without_clock(again[3])), (*came[:3], *without_clock(came[3])), exact=True
        )
        assert plain.reset_infos == asked_again.reset_infos
        if restart == "world":
            playing = list(single.agents)
            seen, rewards, *_ = single.step({agent: actions[number] for number, agent in enumerate(playing)})
            if not single.agents:
                for row, agent in enumerate(playing):
                    np.testing.assert_array_equal(came[3][row]["terminal_observation"], seen[agent])
                before = int(single.simulation.world.episode[0])
                seen, _ = next_world(single)
                passed += int(single.simulation.world.episode[0]) - before - 1
            assert [came[1][row] for row in range(2)] == [np.float32(rewards[agent]) for agent in playing]
            np.testing.assert_array_equal(came[0][:2], [seen[agent] for agent in playing])
    assert refused > 0 and (passed > 0) == (restart == "world")


def test_a_reset_drops_the_step_that_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sb3, "TRIES", 1)
    made, fresh = (make_vec_env(crowded(28), 2, seed=0, observation="flat") for _ in range(2))
    made.reset()
    monkeypatch.setattr(made, "_refusal", lambda worlds: ValueError("no place"))
    for _ in range(2):
        made.step(np.zeros((2, 2)))
    with pytest.raises(ValueError, match="no place"):
        made.step(np.zeros((2, 2)))
    made.seed(0)
    np.testing.assert_array_equal(made.reset(), fresh.reset())
    assert data_equivalence(made.step(np.ones((2, 2)))[:3], fresh.step(np.ones((2, 2)))[:3], exact=True)


def test_an_error_of_a_function_of_ones_own_passes_over_nothing() -> None:
    calls: list[int] = []

    def failing(time: Any) -> Any:
        calls.append(len(time))
        if len(calls) > 3:
            raise ValueError("of one's own")
        return time

    fields: dict[str, Any] = {"mine": {"function": failing, "low": 0.0, "high": 1.0}}
    made = make_vec_env("empty", 1, overrides={"time.limit": 0.2}, observation_fields=fields)
    made.reset()
    with pytest.raises(ValueError, match="of one's own"):
        for _ in range(2):
            made.step(np.zeros((1, 2)))
    assert made.simulation.world.episode.tolist() == [1] and len(calls) == 4


def test_a_truncated_episode_is_told_from_a_finished_one() -> None:
    made = make_vec_env("empty", overrides={"time.limit": 0.2}, seed=0)
    made.reset()
    assert made.step(np.zeros((1, 2)))[3] == [{}]
    info = made.step(np.zeros((1, 2)))[3][0]
    assert (info["TimeLimit.truncated"], info["outcome"]) == (True, "timeout")
    made = make_vec_env("empty", seed=0, overrides={"world.goal": [0.35, 0]})
    made.reset()
    info = made.step(np.array([[1.0, 0.0]]))[3][0]
    assert (info["TimeLimit.truncated"], info["outcome"], info["episode"]["l"]) == (False, "success", 1)


class GoStraight:
    """A policy that drives ahead and counts what it is told of starts."""

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = False
    ) -> tuple[np.ndarray[Any, Any], Any]:
        return np.tile(np.array([1.0, 0.0], dtype=np.float32), (len(episode_start), 1)), state


def test_evaluate_policy_runs_any_policy_and_takes_our_returns_for_a_monitors() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = make_vec_env("empty", 3, seed=0)
        rewards, lengths = evaluate_policy(GoStraight(), env, n_eval_episodes=5, return_episode_rewards=True)
    assert isinstance(lengths, list)
    assert set(lengths) <= {77, 78}  # 7.7 m at 1 m/s
    np.testing.assert_allclose(rewards, 7.7 + 10.0 - 0.01 * np.array(lengths), atol=1e-6)


def test_ppo_learns_on_it_and_logs_successes() -> None:
    model = PPO("MultiInputPolicy", make(4, seed=0), n_steps=32, batch_size=64, n_epochs=1, device="cpu", seed=0)
    model.learn(256)
    assert len(model.ep_info_buffer or ()) > 0
    assert len(model.ep_success_buffer or ()) > 0


@pytest.mark.parametrize("wrapper", [VecMonitor, VecNormalize, lambda env: VecFrameStack(env, 2)])
def test_wrappers_of_stable_baselines3_run_on_it(wrapper: Any) -> None:
    made = wrapper(make(3, seed=0, observation="flat"))
    made.reset()
    ends = sum(int(made.step(actions)[2].sum()) for actions in random_actions(40, 3))
    assert ends > 0
    assert made.unwrapped.simulation.count == 3


@pytest.mark.parametrize("restart", ["world", "robot"])
def test_rows_of_robots_tell_of_each_run_once_and_a_monitor_on_them_warns(restart: Any) -> None:
    made = make_robots_vec_env("crossing_robots", 2, 3, seed=0, overrides={"time.limit": 4.0}, restart=restart)
    made.reset()
    drove, told = np.zeros(made.num_envs, dtype=int), []
    for actions in random_actions(200, made.num_envs):
        drove += made.simulation.world.active.ravel()
        for row, info in enumerate(made.step(actions)[3]):
            if "episode" in info:
                told.append((info["episode"]["l"], int(drove[row])))
                drove[row] = 0
    assert len(told) > 20 and all(length == steps for length, steps in told)
    with pytest.warns(UserWarning, match="already wrapped with a `Monitor`"):
        VecMonitor(made)


def test_rows_answer_for_the_env_that_holds_them() -> None:
    made = make(3)
    assert made.get_attr("render_mode") == [None] * 3
    assert made.get_attr("simulation", indices=[1]) == [made.simulation]
    assert made.get_attr("render_mode", indices=-1) == [None]
    for indices in (3, [0, 3], [-4]):
        with pytest.raises(IndexError, match="3 rows"):
            made.get_attr("render_mode", indices=indices)
        with pytest.raises(IndexError, match="3 rows"):
            made.env_is_wrapped(Monitor, indices=indices)
    made.set_attr("note", 4)
    assert made.get_attr("note") == [4] * 3
    assert not made.has_attr("no_such_thing")
    assert made.env_is_wrapped(Monitor) == [True] * 3
    assert made.env_is_wrapped(gym.wrappers.TimeLimit, indices=0) == [False]
    with pytest.raises(ValueError, match="share"):
        made.set_attr("note", 5, indices=[0])
    with pytest.raises(AttributeError, match="compute_reward"):
        made.env_method("compute_reward")


def test_a_picture_holds_all_rows() -> None:
    pytest.importorskip("pygame", reason="pygame-ce comes with the extra `render`")
    made = make(2, seed=0, render_mode="rgb_array")
    made.reset()
    frame, (first, second) = made.render(), made.get_images()
    assert frame is not None and first is not None and second is not None
    assert frame.shape == (2 * first.shape[0], first.shape[1], 3)  # SB3 tiles two as one above the other
    np.testing.assert_array_equal(frame, np.concatenate([first, second]))


def test_a_pickled_env_goes_on_like_the_original() -> None:
    made = make(2, seed=0)
    made.reset()
    twin = pickle.loads(pickle.dumps(made))
    actions = np.ones((2, 2))
    assert data_equivalence(made.step(actions)[:3], twin.step(actions)[:3], exact=True)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"source": "BugGym/Statik-v0"}, "Statik"),
        ({"source": "statik"}, "static"),
        ({"source": "crossing_robots"}, "parallel_env"),
        ({"source": "static", "n_envs": 0}, "at least 1"),
        ({"source": "static", "observation": "image"}, "'dict', 'flat'.*'image'"),
    ],
)
def test_an_argument_that_is_not_known_is_refused(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        make_vec_env(**settings)


@pytest.mark.parametrize("actions", [np.zeros((3, 2)), np.full((2, 2), np.nan)])
def test_actions_that_are_none_are_refused(actions: Any) -> None:
    made = make(2, seed=0)
    made.reset()
    with pytest.raises(ValueError, match="action"):
        made.step(actions)


def test_without_stable_baselines3_the_error_names_the_extra() -> None:
    script = "import sys; sys.modules['stable_baselines3'] = None; import bug_gym.agents.sb3"
    run = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 1
    assert install_command("train") in run.stderr.splitlines()[-1]


def test_rows_of_robots_tell_of_resets_what_was_asked() -> None:
    rows, robots = make_robots_vec_env("circle_swap", 2, 2, seed=3), parallel_env("circle_swap", robots=2)
    rows.set_options({"shortest_path": True})
    rows.reset()
    for world in range(2):
        _, infos = robots.reset(seed=3 + world, options={"shortest_path": True})
        for robot in range(2):
            told = rows.reset_infos[2 * world + robot]
            assert told["shortest_path_length"] == infos[f"robot_{robot}"]["shortest_path_length"]
    rows.set_options(None)
    rows.reset()
    assert "shortest_path_length" not in rows.reset_infos[0]


@pytest.mark.parametrize("options", [{"shortes_path": True}, [{}, {"drwan": True}], [{}], "drawn", 3, [{}, 3]])
def test_options_of_another_name_or_form_are_refused(options: Any) -> None:
    for rows in (
        make_vec_env("BugGym/Dynamic-v0", 2),
        make_robots_vec_env("circle_swap", 2, 1),
        join([load("dynamic"), load("static")], 2, "continuous"),
    ):
        with pytest.raises(ValueError, match="option") as error:
            rows.set_options(options)
        assert "\n" not in str(error.value)
        rows.reset()  # of nothing


def test_a_team_is_refused_rows_that_begin_anew_one_by_one() -> None:
    with pytest.raises(MisfitError, match="restart='world'"):
        make_policy("com1_rev3", make_robots_vec_env("circle_swap", 2, 1, restart="robot"))


def test_a_model_of_normalised_observations_is_refused_and_one_that_normalises_them_itself_is_not() -> None:
    envs = VecNormalize(make_vec_env("BugGym/Empty-v0", 2, observation="flat", seed=0))
    model = PPO("MlpPolicy", envs, n_steps=8, batch_size=16, n_epochs=1, seed=0, device="cpu")
    with pytest.raises(ValueError, match=r"normalises, .* expected an object whose predict normalises them first"):
        make_policy(model, load("empty"))

    class Normalising:
        def predict(self, observation: Any, *args: Any, **named: Any) -> Any:
            return model.predict(envs.normalize_obs(observation), *args, **named)

    make_policy(Normalising(), load("empty"))
    plain = VecNormalize(make_vec_env("BugGym/Empty-v0", 2, observation="flat", seed=0), norm_obs=False)
    make_policy(PPO("MlpPolicy", plain, n_steps=8, batch_size=16, seed=0, device="cpu"), load("empty"))
    for drive in DRIVES:
        with pytest.raises(ValueError, match="normalises"):
            drive(model, load("empty"))
        assert drive(Normalising(), load("empty", BRIEF)) is not None


def untrained(env: Any) -> PPO:
    """A model in the spaces of an env."""
    policy = "MultiInputPolicy" if isinstance(env.observation_space, gym.spaces.Dict) else "MlpPolicy"
    return PPO(policy, env, n_steps=8, batch_size=8, device="cpu", seed=0)


@pytest.mark.parametrize("other", [{"lidar.range": 9}, {"robot.max_speed": 2}, {"lidar.beams": 32}], ids=str)
def test_a_model_for_a_robot_that_sees_or_drives_otherwise_is_refused_as_its_zip_is(
    other: dict[str, Any], tmp_path: Path
) -> None:
    model = untrained(make_vec_env("dynamic", 1, observation="flat", overrides=other))
    model.save(tmp_path / "model.zip")
    with pytest.raises(MisfitError, match="was made for") as of_zip:
        make_policy(str(tmp_path / "model.zip"), load("dynamic"), trust=True)
    for made in (model, model.policy):
        for drive in (make_policy, *DRIVES):
            with pytest.raises(MisfitError, match="was made for") as error:
                drive(made, load("dynamic"))
            assert str(error.value).partition(" ")[2] == str(of_zip.value).partition(" ")[2]
    assert make_policy(model, load("dynamic", other)) is model


def test_a_model_drives_in_a_larger_world_and_in_the_wrapped_env_that_it_was_trained_in() -> None:
    larger = load("dynamic", {"world.bounds": [-30, -30, 30, 30], **BRIEF})
    for env in (make_vec_env("dynamic", 1), make_vec_env("dynamic", 1, observation="flat", action="discrete")):
        model = untrained(env)
        for drive in DRIVES:
            assert drive(model, larger) is not None
    wrapped = gym.wrappers.RescaleAction(gym.make("BugGym/DynamicFlat-v0"), np.float32(0.0), np.float32(1.0))
    model = untrained(wrapped)
    assert make_policy(model, wrapped) is model
    with pytest.raises(MisfitError, match="was made for actions"):
        make_policy(model, wrapped.unwrapped)


def test_a_model_trained_alone_drives_among_several_robots_as_its_zip_does(tmp_path: Path) -> None:
    model = untrained(make_vec_env("dynamic", 1, observation="flat"))
    model.save(tmp_path / "model.zip")
    several = load("dynamic", {"robots.count": 2, **BRIEF})
    env = parallel_env(several)
    observations, _ = env.reset(seed=0)
    from_zip: Any = make_policy(str(tmp_path / "model.zip"), env, trust=True).predict(observations)[0]
    for made in (model, model.policy):
        actions: Any = make_policy(made, env).predict(observations)[0]
        assert actions.keys() == from_zip.keys() == set(env.agents)
        for agent, action in actions.items():
            np.testing.assert_allclose(action, from_zip[agent], atol=1e-6)
        assert evaluate([made], several, episodes=1) is not None
