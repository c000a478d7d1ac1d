"""Reward terms and observation fields of one's own: the same on every face, clear where they are wrong, nothing elsewhere."""

from __future__ import annotations

import inspect
import linecache
import math
import pickle
import re
from pathlib import Path
from typing import Any

import gymnasium as gym
import numba
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

import bug_gym
from bug_gym import ObservationField, RewardTerm
from bug_gym.agents.sb3 import make_robots_vec_env
from bug_gym.config import ScenarioError, dump, load
from bug_gym.evaluation import evaluate, make_plan
from bug_gym.evaluation.collection import collect
from bug_gym.navigation_env import NavigationEnv
from bug_gym.own_parts import ARRAYS, EARLIER, KNOWN, LAST
from bug_gym.robots_env import parallel_env
from bug_gym.scenario_code import own_code
from bug_gym.simulation import Simulation
from bug_gym.vector_env import NavigationVectorEnv

F64 = NDArray[np.float64]


def near_wall(ranges: NDArray[np.float32]) -> F64:
    return np.where(ranges.min(axis=1) < 1.0, -1.0, 0.0)


def moved(pose: F64, last_pose: F64) -> F64:
    steps: F64 = np.hypot(*(pose - last_pose)[:, :2].T)
    return steps


def last_action(action: F64) -> F64:
    return action


@numba.njit
def hurry(goal_distance: F64, time: F64) -> F64:
    return goal_distance * time


TERMS: dict[str, Any] = {"near_wall": near_wall, "moved": {"function": moved, "weight": 2.0}, "hurry": hurry}
FIELDS: dict[str, Any] = {
    "last_action": ObservationField(function=last_action, shape=(2,), low=-1.0, high=1.0),
    "way": {"function": lambda path_length: path_length, "low": 0.0, "high": 0.75},
}
OWN: dict[str, Any] = {"reward_terms": TERMS, "observation_fields": FIELDS}
SHORT = {"time.limit": 2.0}


def actions(count: int, seed: int = 0) -> NDArray[np.float32]:
    """Actions (count, 2) that drive ahead, mostly."""
    return np.random.default_rng(seed).uniform([0.2, -1.0], 1.0, (count, 2)).astype(np.float32)


class Recorder:
    """A function that asks for arrays by name, keeps them, and gives the first number of the last one."""

    def __init__(self, *names: str) -> None:
        parameters = [inspect.Parameter(name, inspect.Parameter.POSITIONAL_OR_KEYWORD) for name in names]
        self.__signature__ = inspect.Signature(parameters)
        self.calls: list[tuple[NDArray[Any], ...]] = []

    def __call__(self, *arrays: NDArray[Any]) -> NDArray[Any]:
        self.calls.append(arrays)
        return arrays[-1].reshape(len(arrays[-1]), -1)[:, :1]

    @property
    def field(self) -> dict[str, Any]:
        return {"function": self, "low": -1e5, "high": 1e5}


def constant(*shape: int, value: float = 0.0) -> Any:
    """A function that gives the same for all robots."""
    return lambda pose: np.full((len(pose), *shape), value)


# ---------------------------------------------------------------------------------------------------- what they mean


def test_terms_are_what_their_functions_say_and_sum_up_to_the_reward() -> None:
    env = NavigationEnv("dynamic", **OWN)
    env.reset(seed=3)
    pose = env.simulation.world.pose[0, 0].copy()
    for action in actions(30):
        observation, reward, terminated, truncated, info = env.step(action)
        terms, now = info["reward_terms"], env.simulation.world.pose[0, 0].copy()
        assert terms["near_wall"] == (-1.0 if observation["ranges"].min() < 1.0 else 0.0)
        assert terms["moved"] == pytest.approx(2.0 * math.dist(pose[:2], now[:2]), abs=1e-12)
        assert terms["hurry"] == info["goal_distance"] * info["time"]
        assert reward == pytest.approx(sum(terms.values()), abs=1e-12)
        pose = now
        if terminated or truncated:
            break
    assert now[0] != pytest.approx(env.simulation.world.array("origin")[0, 0])  # it did drive


def test_the_compiled_step_is_as_it_is_without_them() -> None:
    plain, own = NavigationEnv("rush"), NavigationEnv("rush", **OWN)
    plain.reset(seed=5)
    own.reset(seed=5)
    for action in actions(40):
        (seen, _, *ends, info), (too, _, *same, told) = plain.step(action), own.step(action)
        assert all(np.array_equal(seen[name], too[name]) for name in seen) and ends == same
        assert {name: told["reward_terms"].pop(name) for name in TERMS} and info == told
        if any(ends):
            break


def test_fields_stand_behind_the_others_in_every_form() -> None:
    env, flat = NavigationEnv("dynamic", **OWN), NavigationEnv("dynamic", observation="flat", **OWN)
    plain = NavigationEnv("dynamic", observation="flat")
    space: Any = env.observation_space
    assert list(env.simulation.fields[-1].shape) == [1] and space["last_action"].shape == (2,)
    assert space["way"].high == np.float32(0.75)
    assert flat.spaces.fields[-1].end == plain.spaces.fields[-1].end + 3
    assert flat.observation_space.shape == (flat.spaces.fields[-1].end,)
    (seen, _), (vector, _) = env.reset(seed=1), flat.reset(seed=1)
    for action in [None, *actions(5)]:
        if action is not None:
            seen, vector = env.step(action)[0], flat.step(action)[0]
        assert np.array_equal(vector[-3:-1], seen["last_action"]) and vector[-1] == seen["way"][0]
    assert seen["last_action"] == pytest.approx(actions(5)[-1])


def test_an_episode_begins_without_an_action_and_without_terms() -> None:
    env = NavigationEnv("dynamic", **OWN)
    for seed in (0, None):
        if seed is None:
            env.step(np.ones(2, dtype=np.float32))
        observation, info = env.reset(seed=seed)
        assert not observation["last_action"].any() and not observation["way"].any()
        assert set(info["reward_terms"].values()) == {0.0} and [*info["reward_terms"]][-3:] == [*TERMS]


def test_what_was_before_the_first_step_is_how_it_begins() -> None:
    recorders = {name: Recorder(LAST + name, name) for name in EARLIER}
    fields = {f"f_{name}": recorder.field for name, recorder in recorders.items()}
    env = NavigationEnv("dynamic", observation_fields=fields)
    env.reset(seed=0)
    env.step(np.array([1.0, 0.5], dtype=np.float32))
    for name, recorder in recorders.items():
        (before, now), (earlier, later) = recorder.calls
        assert np.array_equal(before, now), name
        assert np.array_equal(earlier, now), name
        assert name in ("goal", "clearance") or not np.array_equal(earlier, later), name


@pytest.mark.parametrize("robots", [1, 3])
def test_each_array_is_as_it_is_told(robots: int) -> None:
    recorders = {name: Recorder(name) for name in KNOWN}
    fields = {f"f_{name}": recorder.field for name, recorder in recorders.items()}
    scenario = load("crossing_robots", {"robots.count": robots}, observation_fields=fields)
    simulation = Simulation(scenario, 4)
    simulation.reset(seeds=range(4))
    simulation.step(np.full((4, robots, 2), 0.5))
    came = {name: recorder.calls[-1][0] for name, recorder in recorders.items()}
    assert set(KNOWN) == {*ARRAYS, *(LAST + name for name in EARLIER)}
    widths = {"B": scenario.lidar.beams, "D": simulation.fields[-len(KNOWN)].begin, "2": 2, "3": 3}
    for name, meaning in ARRAYS.items():
        told = meaning[1 : meaning.index(")")].split(",")
        expected = (4 * robots, *(widths[size.strip()] for size in told[1:] if size.strip()))
        assert came[name].shape == expected and came[name].flags.c_contiguous, name
        kind = "float32" if "float32" in meaning else "int64" if "int64" in meaning else "float64"
        assert came[name].dtype == kind, name
        assert not np.shares_memory(came[name], simulation.world.floats), name
        assert not np.shares_memory(came[name], simulation.world.observation), name
    assert came["robot"].tolist() == [*range(robots)] * 4
    assert np.array_equal(came["pose"], simulation.world.pose.reshape(-1, 3))
    assert np.array_equal(came["seed"], np.repeat(np.arange(4), robots))
    assert np.array_equal(came["goal"], simulation.world.goal.reshape(-1, 2)) and (came["action"] == 0.5).all()


# ------------------------------------------------------------------------------------------------- the same everywhere


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize("name", ["dynamic", "rush"])
def test_a_row_is_the_single_env_bit_for_bit(name: str, mode: AutoresetMode) -> None:
    count, steps = 3, 45
    env = NavigationVectorEnv(count, scenario=name, overrides=SHORT, autoreset_mode=mode, observation="flat", **OWN)
    singles = [NavigationEnv(name, SHORT, observation="flat", **OWN) for _ in range(count)]
    flat, infos = env.reset(seed=7)
    firsts = [single.reset(seed=7 + k) for k, single in enumerate(singles)]
    assert all(np.array_equal(flat[k], first) for k, (first, _) in enumerate(firsts))
    ended = [False] * count
    ends = 0
    for step in range(steps):
        chosen = actions(count, step)
        flat, rewards, terminated, truncated, infos = env.step(chosen)
        for k, single in enumerate(singles):
            if ended[k]:  # NEXT_STEP: this step was a reset
                seen, info = single.reset()
                ended[k] = False
                assert rewards[k] == 0.0
            else:
                seen, reward, *over, info = single.step(chosen[k])
                assert (rewards[k], terminated[k], truncated[k]) == (reward, *over)
                if any(over):
                    ends += 1
                    ended[k] = mode == AutoresetMode.NEXT_STEP
                if any(over) and mode == AutoresetMode.SAME_STEP:
                    assert np.array_equal(infos["final_obs"][k], seen)
                    final = infos["final_info"]["reward_terms"]
                    assert {term: final[term][k] for term in TERMS} == {
                        term: info["reward_terms"][term] for term in TERMS
                    }
                    seen, info = single.reset()
            assert np.array_equal(flat[k], seen), (step, k)
            assert {term: infos["reward_terms"][term][k] for term in TERMS} == {
                t: info["reward_terms"][t] for t in TERMS
            }
    assert ends >= 2 * count


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("own", ["reward_terms", "observation_fields"])
def test_where_all_rows_end_at_once_the_next_step_only_begins_anew(own: str, count: int) -> None:
    """Nobody is left who goes on; functions are not asked about nobody."""
    env = NavigationVectorEnv(count, scenario="static", overrides={"time.limit": 1.0}, **{own: OWN[own]})
    env.reset(seed=0)
    for step in range(1, 24):
        _, rewards, terminated, truncated, infos = env.step(np.zeros((count, 2), dtype=np.float32))
        assert not terminated.any() and truncated.all() == (step % 11 == 10)
        if step % 11 == 0:
            assert (rewards == 0.0).all() and (infos["time"] == 0.0).all()


@pytest.mark.parametrize("threads", [1, 2])
def test_the_vec_env_of_stable_baselines3_has_them(threads: int) -> None:
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")
    from bug_gym.agents.sb3 import make_vec_env

    count = 4
    env = make_vec_env("BugGym/Rush-v0", count, seed=7, overrides=SHORT, observation="flat", threads=threads, **OWN)
    singles = [NavigationEnv("rush", SHORT, observation="flat", **OWN) for _ in range(count)]
    flat: Any = env.reset()
    assert all(np.array_equal(flat[k], single.reset(seed=7 + k)[0]) for k, single in enumerate(singles))
    ends = 0
    for step in range(25):
        chosen = actions(count, step)
        step_taken: Any = env.step(chosen)
        flat, rewards, done, infos = step_taken
        for k, single in enumerate(singles):
            seen, reward, terminated, truncated, info = single.step(chosen[k])
            assert rewards[k] == np.float32(reward) and done[k] == (terminated or truncated)
            if done[k]:
                ends += 1
                assert np.array_equal(infos[k]["terminal_observation"], seen)
                assert infos[k]["reward_terms"] == info["reward_terms"]
                seen, info = single.reset()
                assert env.reset_infos[k]["reward_terms"] == info["reward_terms"]
            assert np.array_equal(flat[k], seen)
    assert ends >= count


def test_robots_of_one_world_have_them_each_and_lose_them_when_they_are_out() -> None:
    from_one = parallel_env("crossing_robots", robots=3, overrides=SHORT, **OWN)
    observations, infos = from_one.reset(seed=2)
    many = Simulation(load("crossing_robots", {"robots.count": 3, **SHORT}, **OWN), 2)
    many.reset(seeds=[9, 2])
    step = 0
    while from_one.agents:
        moving, chosen = from_one.agents, actions(3, step)
        observations, rewards, _, _, infos = from_one.step({agent: chosen[int(agent[-1])] for agent in moving})
        many.step(np.stack([chosen, chosen]))
        for agent in moving:
            robot, terms = int(agent[-1]), infos[agent]["reward_terms"]
            assert terms == many.robot_step(1, robot).info["reward_terms"]
            assert rewards[agent] == pytest.approx(sum(terms.values()), abs=1e-9) and terms["moved"] >= 0.0
            assert np.array_equal(observations[agent]["last_action"], chosen[robot])
        step += 1
    assert step > 5
    many.step(np.ones((2, 3, 2)))  # all are out: nothing is earned
    assert not many.status(np.array([1])).reward.any()
    assert not many.status(np.array([1])).terms.any()


def test_robots_that_start_again_begin_anew_while_others_go_on() -> None:
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")
    from bug_gym.agents.sb3 import make_robots_vec_env

    before = {"function": lambda last_action: last_action, "shape": [2], "low": -1.0, "high": 1.0}
    own = {**OWN, "observation_fields": {"before": before, **FIELDS}}
    env = make_robots_vec_env("crossing_robots", 2, 4, seed=0, restart="robot", **own)
    env.reset()
    begun, previous = 0, np.zeros((8, 2), dtype=np.float32)
    for step in range(250):
        chosen = actions(8, step)
        chosen[1::2, 0] = -0.5  # every other robot nearly stands
        step_taken: Any = env.step(chosen)
        flat, _, done, _ = step_taken
        going = env.simulation.world.active.ravel() & ~done
        assert np.array_equal(flat[going, -3:-1], chosen[going])
        assert np.array_equal(flat[going, -5:-3], previous[going])
        again = env.simulation.world.active.ravel() & done
        told = env.simulation.status(env.simulation.all_rows).terms.reshape(8, -1)
        assert not flat[again, -5:].any() and not told[again].any()
        previous = np.where(again[:, None], 0.0, chosen).astype(np.float32)
        begun += int((again & going[np.arange(8) ^ 1]).sum())
    assert begun > 0  # beside one that went on


def test_gymnasium_makes_and_checks_it() -> None:
    env = gym.make("BugGym/Static-v0", **OWN)
    check_env(env.unwrapped, skip_render_check=True)
    vector = gym.make_vec("BugGym/Static-v0", num_envs=2, **OWN)
    assert "hurry" in vector.reset(seed=0)[1]["reward_terms"]


def test_a_saved_state_goes_on_with_them() -> None:
    simulation = Simulation(load("dynamic", **OWN), 2)
    simulation.reset(seeds=[0, 1])
    chosen = actions(2)[:, None]
    simulation.step(chosen)
    state, told = simulation.save(), [simulation.robot_step(row) for row in range(2)]
    ahead = simulation.step(chosen)
    simulation.restore(state)
    assert [simulation.robot_step(row) for row in range(2)] == told
    for now, then in zip(simulation.step(chosen), ahead, strict=True):
        assert np.array_equal(np.asarray(now), np.asarray(then))


def test_worlds_that_grow_keep_them() -> None:
    simulation = Simulation(load("maze", **OWN), 2)
    simulation.reset(seeds=[0, 1])
    simulation.step(actions(2)[:, None])
    told = simulation.robot_step(1)
    grown = simulation.world.capacity._replace(discs=simulation.world.capacity.discs + 5, walls=900)
    simulation.world.grow(grown)
    assert simulation.robot_step(1) == told


# --------------------------------------------------------------------------------------------- named, and trusted

MODULE = """
import numpy as np

def near(ranges):
    return -1.0 * (ranges.min(axis=1) < 1.0)

def twice(action):
    return 2.0 * action

number = 3
"""
NAMED = """
world: {family: field}
reward_terms:
  near: rewards.py:near
  near_again: {function: rewards.py:near, weight: 3.0}
observation_fields:
  twice: {function: "rewards.py:twice", shape: [2], low: [-2, -1], high: 2}
"""


@pytest.fixture
def named(tmp_path: Path) -> Path:
    """A scenario that names functions of a file beside it, which tells when it is run."""
    marker = (tmp_path / "ran").as_posix()
    (tmp_path / "rewards.py").write_text(f"open({marker!r}, 'w').close()\n{MODULE}", encoding="utf-8")
    path = tmp_path / "mine.yaml"
    path.write_text(NAMED, encoding="utf-8")
    return path


def test_an_evaluation_with_functions_of_ones_own_goes_on_until_their_file_changes(named: Path) -> None:
    out = named.parent / "rows"
    for _ in range(2):
        assert len(evaluate("go_to_goal", named, episodes=1, out=out, trust=True)) == 1
    module = named.parent / "rewards.py"
    module.write_text(module.read_text() + "# another one\n")
    with pytest.raises(ValueError, match=r"holds another run: .*code\."):
        evaluate("go_to_goal", named, episodes=1, out=out, trust=True)


def of_a_notebook(cell: str, *, has_lines: bool = True) -> Any:
    """The function `hurry` of a cell, whose lines a notebook knows and no file holds."""
    place = f"<cell {hash(cell)}>"
    if has_lines:
        linecache.cache[place] = (len(cell), None, cell.splitlines(keepends=True), place)
    typed: dict[str, Any] = {}
    exec(compile(cell, place, "exec"), typed)
    return typed["hurry"]


def test_an_evaluation_with_a_function_of_a_notebook_goes_on_until_its_lines_change(tmp_path: Path) -> None:
    def run(function: Any) -> int:
        scenario = load("static", {"time.limit": 1.0}, reward_terms={"hurry": function})
        return len(evaluate("go_to_goal", scenario, episodes=1, out=tmp_path / "rows"))

    cell = "def hurry(steps):\n    return -{} * steps\n"
    assert run(of_a_notebook(cell.format(0.1))) == run(of_a_notebook(cell.format(0.1))) == 1
    with pytest.raises(ValueError, match=r"holds another run: .*code\."):
        run(of_a_notebook(cell.format(0.2)))


def scaled(scale: Any) -> Any:
    """A term that holds what it was made with."""
    return lambda steps: scale * steps


def by_default(scale: Any) -> Any:
    return lambda steps, by=scale: by * steps


@pytest.mark.parametrize("made", [scaled, by_default])
@pytest.mark.parametrize("values", [(0.1, 0.2), (np.array([0.1]), np.array([0.2]))])
def test_functions_that_hold_other_values_are_others(made: Any, values: tuple[Any, Any], tmp_path: Path) -> None:
    def run(function: Any) -> int:
        scenario = load("static", {"time.limit": 1.0}, reward_terms={"hurry": function})
        return len(evaluate("go_to_goal", scenario, episodes=1, out=tmp_path / "rows"))

    one, other = values
    assert run(made(one)) == run(made(one)) == 1
    with pytest.raises(ValueError, match=r"holds another run: .*code\."):
        run(made(other))


class Paced:
    """A term that is a method of an object."""

    def __init__(self, scale: float) -> None:
        self.scale = scale

    def hurry(self, steps: Any) -> Any:
        return self.scale * steps


def test_nobody_can_go_on_with_a_method_of_an_object(tmp_path: Path) -> None:
    def run(scale: float) -> int:
        scenario = load("static", {"time.limit": 1.0}, reward_terms={"hurry": Paced(scale).hurry})
        return len(evaluate("go_to_goal", scenario, episodes=1, out=tmp_path / "rows"))

    assert run(0.1) == 1
    with pytest.raises(ValueError, match=r"reward_terms\.hurry is written in no file"):
        run(0.2)


MADE = """
import functools

def twice(steps, by):
    return by * steps

class Near:
    def __init__(self, by):
        self.by = by
    def __call__(self, ranges):
        return self.by * ranges.min(axis=1)

near = """


@pytest.mark.parametrize("made", ["functools.partial(twice, by={})", "Near({})"])
def test_what_a_file_makes_and_names_belongs_to_the_file(made: str, named: Path, tmp_path: Path) -> None:
    def keep(value: float) -> dict[str, str]:
        (named.parent / "rewards.py").write_text(MODULE + MADE + made.format(value) + "\n", encoding="utf-8")
        return own_code(load(named, trust=True))

    first, again, other = keep(0.5), keep(0.5), keep(0.8)
    assert first == again and first["reward_terms.near"] != other["reward_terms.near"]
    scenario = load(named, trust=True)
    keep(0.9)
    with pytest.raises(ValueError, match=r"rewards\.py was changed after it was imported"):
        own_code(scenario)


def test_what_a_module_makes_and_names_belongs_to_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "terms_that_are_made.py"
    file.write_text(MODULE + MADE + "functools.partial(twice, by=0.5)\n", encoding="utf-8")
    terms = {"near": "terms_that_are_made:near"}
    first, again = (own_code(load("static", reward_terms=terms, trust=True)) for _ in range(2))
    assert first == again and first["reward_terms.near"]
    file.write_text(MODULE + MADE + "functools.partial(twice, by=0.8)\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"terms_that_are_made\.py was changed after it was imported"):
        own_code(load("static", reward_terms=terms, trust=True))


def test_nobody_can_go_on_with_a_function_whose_lines_nobody_knows(tmp_path: Path) -> None:
    function = of_a_notebook("def hurry(steps):\n    return -0.3 * steps\n", has_lines=False)
    scenario = load("static", {"time.limit": 1.0}, reward_terms={"hurry": function})
    assert len(evaluate("go_to_goal", scenario, episodes=1, out=tmp_path / "rows")) == 1
    with pytest.raises(ValueError, match=r"reward_terms\.hurry is written in no file"):
        evaluate("go_to_goal", scenario, episodes=1, out=tmp_path / "rows")


def test_a_scenario_file_names_functions(named: Path) -> None:
    env = NavigationEnv(named, trust=True)
    env.reset(seed=0)
    observation, _, _, _, info = env.step(np.array([0.9, -0.8], dtype=np.float32))
    assert observation["twice"] == pytest.approx([1.8, -1.0])
    assert info["reward_terms"]["near_again"] == 3.0 * info["reward_terms"]["near"]


def test_code_that_a_scenario_names_runs_only_where_it_is_trusted(named: Path) -> None:
    scenario = load(named)
    assert dump(scenario)["reward_terms"]["near"]["function"].endswith("rewards.py:near")
    expected = r"reward_terms\.near is the code .*rewards\.py:near; .*trust=True"
    for make in (NavigationEnv, Simulation, lambda source: NavigationVectorEnv(2, scenario=source), parallel_env):
        for source in (str(named), dump(scenario)):
            with pytest.raises(ScenarioError, match=expected):
                make(source)
    assert not (named.parent / "ran").exists()
    load(named, trust=True)
    assert (named.parent / "ran").exists()


def test_a_module_on_the_path_is_found_and_goes_to_other_processes(
    named: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (named.parent / "rewards_on_path.py").write_text(MODULE, encoding="utf-8")
    monkeypatch.syspath_prepend(named.parent)
    for place in ("rewards_on_path", f"{named.parent}/rewards.py"):
        scenario = load("dynamic", reward_terms={"near": f"{place}:near"}, trust=True)
        again = pickle.loads(pickle.dumps(scenario))
        told = [Simulation(one).reset(seeds=[0]).tolist() for one in (scenario, again)]
        assert told[0] == told[1] and again.digest == scenario.digest
        assert again == scenario and hash(again) == hash(scenario)


@pytest.mark.parametrize(
    ("reference", "expected"),
    [
        ("rewards.py:nere", "has no function 'nere', did you mean 'near'"),
        ("rewards.py:number", "is no function: got 3"),
        ("missing.py:near", "no file"),
        ("no_such_module_here:near", "no module 'no_such_module_here'"),
        ("near", "expected module:function"),
    ],
)
def test_a_name_of_nothing_is_told(named: Path, reference: str, expected: str) -> None:
    source = f"{named.parent}/{reference}" if ".py" in reference else reference
    with pytest.raises(ScenarioError, match=expected) as error:
        load("dynamic", reward_terms={"t": source}, trust=True)
    assert "reward_terms.t" in str(error.value) and "\n" not in str(error.value)


def test_overrides_change_their_weights(named: Path) -> None:
    env = NavigationEnv(load(named, {"reward_terms.near_again.weight": 5.0}, trust=True))
    assert env.simulation.scenario.reward_terms["near_again"].weight == 5.0


def test_a_scenario_keeps_its_functions_through_overrides() -> None:
    scenario = load(load("dynamic", **OWN), {"lidar.beams": 16})
    assert scenario.reward_terms["near_wall"].function is near_wall
    assert NavigationEnv(scenario).reset(seed=0)[1]["reward_terms"]["hurry"] == 0.0


def test_an_evaluation_takes_a_scenario_that_holds_functions_without_trust(named: Path) -> None:
    def hurry(steps: Any) -> Any:
        return -0.1 * np.ones(len(steps))

    brief = {"time.limit": 1.0}
    handed_in = load("static", brief, reward_terms={"hurry": hurry, "typed": lambda steps: 0.0 * steps})
    for scenario in (handed_in, load(named, brief, trust=True)):
        for asked in (scenario, [scenario], {"scenarios": [scenario]}, {"scenarios": [{"scenario": scenario}]}):
            assert len(evaluate("go_to_goal", asked, episodes=1)) == 1
        assert len(evaluate("go_to_goal", scenario, episodes=1, overrides={"lidar.beams": 16})) == 1
    kept = make_plan("go_to_goal", handed_in, episodes=1).scenarios[0].scenario
    assert kept is handed_in
    with pytest.raises(ScenarioError, match="trust=True"):  # an object that nobody has trusted
        evaluate("go_to_goal", load(named, brief), episodes=1)


def test_datasets_are_of_functions_that_their_env_finds_by_name(named: Path, tmp_path: Path) -> None:
    pytest.importorskip("minari", reason="Minari comes with the extra `data`")
    out, brief = tmp_path / "datasets", {"time.limit": 1.0}
    asked: dict[str, Any] = {"episodes": 1, "forms": ["flat"], "expert": "go_to_goal"}
    typed = load("static", brief, reward_terms={"typed": lambda steps: 0.0 * steps})
    with pytest.raises(ScenarioError, match=r"static: expected functions .* of a module or file, .*typed"):
        collect(typed, ["go_to_goal"], out, **asked)
    assert not out.exists()
    for scenario in (load("static", brief, reward_terms={"near_wall": near_wall}), load(named, brief, trust=True)):
        assert len(collect(scenario, ["go_to_goal"], out, **asked)) == 1


def test_the_digest_tells_them_and_is_as_ever_without() -> None:
    plain, own = load("dynamic"), load("dynamic", **OWN)
    assert plain.digest != own.digest != load("dynamic", reward_terms=TERMS).digest
    assert "reward_terms" not in dump(plain)
    assert own.digest == load("dynamic", **OWN).digest


# ------------------------------------------------------------------------------------------------------ what is wrong


@pytest.mark.parametrize(
    ("own", "expected"),
    [
        ({"reward_terms": {"goal": near_wall}}, r"reward_terms\.goal: this name is taken"),
        ({"reward_terms": {"t": 3}}, r"reward_terms\.t\.function: got 3, expected a function"),
        ({"reward_terms": {"a b": near_wall}}, "expected a name of letters"),
        ({"reward_terms": {"_goal": near_wall}}, r"got '_goal', expected a name of .*, a letter first"),
        ({"reward_terms": {"_": near_wall}}, "a letter first"),
        (
            {"reward_terms": {"a.b": near_wall}},
            r"reward_terms: got the name 'a\.b', expected letters, .*, a letter first",
        ),
        ({"observation_fields": {"_way": FIELDS["way"]}}, r"got '_way', expected a name of .*, a letter first"),
        ({"reward_terms": {"t": {"function": near_wall, "wieght": 2}}}, "unknown key.*did you mean 'weight'"),
        ({"reward_terms": [near_wall]}, "reward_terms: got .*expected a mapping"),
        ({"reward_terms": {"t": lambda rangs: rangs}}, r"reward_terms\.t .*asks for 'rangs', did you mean 'ranges'"),
        (
            {"reward_terms": {"t": lambda *, time: time}},
            r"asks for 'time' by keyword alone, expected arguments before the \*",
        ),
        ({"reward_terms": {"t": lambda pose, k=2.0, *, time: time}}, "asks for 'time' by keyword alone"),
        ({"reward_terms": {"t": lambda: 0}}, "asks for no array"),
        ({"reward_terms": {"t": lambda scale=2.0: 0}}, "asks for no array"),
        ({"observation_fields": {"goal": FIELDS["way"]}}, r"observation_fields\.goal: this name is taken"),
        ({"observation_fields": {"peers": FIELDS["way"]}}, r"observation_fields\.peers: this name is taken"),
        ({"observation_fields": {"f": last_action}}, r"observation_fields\.f: got .*expected a mapping"),
        ({"observation_fields": {"f": {"function": last_action, "low": 0}}}, r"observation_fields\.f\.high: missing"),
        ({"observation_fields": {"f": {"function": last_action, "low": 2, "high": 1}}}, "above high"),
        ({"observation_fields": {"f": {"function": last_action, "low": 0, "high": math.inf}}}, "finite number"),
        ({"observation_fields": {"f": {"function": last_action, "low": 0, "high": 1e39}}}, "finite number of float32"),
        ({"observation_fields": {"f": {"function": last_action, "low": [0, 0], "high": 1}}}, r"bounds of shape \(2,\)"),
        ({"observation_fields": {"f": {"function": last_action, "low": 0, "high": 1, "shape": [0]}}}, "at least 1"),
        ({"observation_fields": {"f": {"function": last_action, "low": 0, "high": 1, "shape": [9**6]}}}, "at most"),
    ],
)
def test_what_cannot_be_is_told_before_anything_is_driven(own: Any, expected: str) -> None:
    with pytest.raises(ScenarioError, match=expected) as error:
        NavigationEnv("dynamic", **own)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("function", "expected"),
    [
        (lambda pose: 0.0, "gave float, expected an array"),
        (lambda pose: None, "gave NoneType"),
        (lambda pose: pose, r"shape \(1, 3\), expected \(1,\)"),
        (lambda pose: pose[:, :1], r"shape \(1, 1\), expected \(1,\)"),
        (constant(value=math.nan), "gave nan for row 0, expected finite"),
        (constant(value=math.inf), "gave inf for row 0"),
        (lambda pose: np.zeros(len(pose), dtype=complex), "an array of complex128"),
        (lambda pose: np.full(len(pose), "a"), "an array of <U1"),
        (lambda pose: np.full(len(pose), None), "an array of object"),
        (lambda pose: np.ma.masked_invalid(np.full(len(pose), np.nan)), "gave MaskedArray, expected an array"),
        (RewardTerm(function=constant(value=1e300), weight=1e9), r"gave 1e\+300 for row 0, times its weight of 1e\+09"),
    ],
)
def test_a_value_that_is_no_term_is_told(function: Any, expected: str) -> None:
    env = NavigationEnv("dynamic", reward_terms={"t": function})
    env.reset(seed=0)
    with pytest.raises(ValueError, match=rf"reward_terms\.t .*{expected}") as error:
        env.step(np.zeros(2, dtype=np.float32))
    assert "\n" not in str(error.value)


def test_a_field_of_another_shape_is_told_when_an_episode_begins() -> None:
    field = {"function": last_action, "shape": [3], "low": 0.0, "high": 1.0}
    with pytest.raises(ValueError, match=r"observation_fields\.f .*shape \(1, 2\), expected \(1, 3\)"):
        NavigationEnv("dynamic", observation_fields={"f": field}).reset(seed=0)


def test_the_row_of_a_number_that_is_not_finite_is_told() -> None:
    env = NavigationVectorEnv(4, scenario="dynamic", reward_terms={"t": lambda seed: np.where(seed == 2, np.nan, 0.0)})
    env.reset(seed=0)
    with pytest.raises(ValueError, match="for row 2"):
        env.step(np.zeros((4, 2), dtype=np.float32))


def test_a_function_that_raises_is_named_beside_its_own_error() -> None:
    def broken(ranges: Any, pose: Any) -> Any:
        raise ZeroDivisionError("of mine")

    env = NavigationEnv("dynamic", reward_terms={"t": broken})
    env.reset(seed=0)
    with pytest.raises(ZeroDivisionError, match="of mine") as error:
        env.step(np.zeros(2, dtype=np.float32))
    (note,) = error.value.__notes__
    assert note.startswith("in reward_terms.t (") and note.endswith("called with ranges, pose of 1 robots")


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_an_end_in_a_step_whose_term_raised_is_not_reported_a_step_late(mode: AutoresetMode) -> None:
    errors = [ZeroDivisionError("of mine")]

    def raises_once(steps: Any) -> Any:
        if steps.max() == 3 and errors:
            raise errors.pop()
        return np.zeros(len(steps))

    own = {"t": raises_once}
    env = NavigationVectorEnv(
        2, scenario="static", overrides={"time.limit": 0.3}, autoreset_mode=mode, reward_terms=own
    )
    still = np.zeros((2, 2), dtype=np.float32)
    env.reset(seed=0)
    env.step(still)
    env.reset(seed=[None, 1], options={"reset_mask": np.array([False, True])})
    env.step(still)
    with pytest.raises(ZeroDivisionError):
        env.step(still)
    if mode == AutoresetMode.DISABLED:
        with pytest.raises(ResetNeeded, match="row 0"):
            env.step(still)
        env.reset(options={"reset_mask": np.array([True, False])})
    _, _, terminated, truncated, infos = env.step(still)
    assert not terminated.any() and truncated.tolist() == [False, True]
    ends = infos["final_info"] if mode == AutoresetMode.SAME_STEP else infos
    assert ends["time"][1] == pytest.approx(0.3) and ends["outcome"][1] == "timeout"
    assert env.simulation.world.episode[0] == 1
    assert env.simulation.world.steps[0] == int(mode == AutoresetMode.DISABLED)


def test_a_function_that_ends_the_process_is_named_and_does_not() -> None:
    def leaves(ranges: Any) -> Any:
        raise SystemExit(0)

    env = NavigationEnv("dynamic", reward_terms={"t": leaves})
    env.reset(seed=0)
    with pytest.raises(RuntimeError, match=r"its code ends the process \(exit code 0\)") as error:
        env.step(np.zeros(2, dtype=np.float32))
    assert error.value.__notes__[0].startswith("in reward_terms.t (")


def test_what_a_function_writes_into_its_arrays_is_seen_by_no_other() -> None:
    def overwrites(pose: F64, last_pose: F64, ranges: NDArray[np.float32]) -> F64:
        for array in (pose, last_pose, ranges):
            array[:] = 7.0
        return np.zeros(len(pose))

    def nearest(ranges: NDArray[np.float32]) -> NDArray[np.float32]:
        least: NDArray[np.float32] = ranges.min(axis=1)
        return least

    sound: dict[str, Any] = {"moved": moved, "near_wall": near_wall}
    fields: dict[str, Any] = {"nearest": ObservationField(function=nearest, low=0.0, high=9.0)}
    alone = NavigationEnv("dynamic", reward_terms=sound, observation_fields=fields)
    beside = NavigationEnv("dynamic", reward_terms={"overwrites": overwrites, **sound}, observation_fields=fields)
    for env in (alone, beside):
        env.reset(seed=3)
    for _ in range(5):
        one, other = (env.step(np.array([0.8, 0.3], dtype=np.float32)) for env in (alone, beside))
        assert {**one[4]["reward_terms"], "overwrites": 0.0} == other[4]["reward_terms"]
        assert one[0]["nearest"] == other[0]["nearest"]


def test_arguments_with_values_of_their_own_keep_them() -> None:
    def scaled(clearance: F64, scale: float = 2.0, *, more: float = 1.0) -> F64:
        return scale * more * clearance

    env = NavigationEnv("dynamic", reward_terms={"t": scaled})
    env.reset(seed=0)
    info = env.step(np.zeros(2, dtype=np.float32))[4]
    assert info["reward_terms"]["t"] == 2.0 * env.simulation.world.array("clearance")[0, 0]


def test_so_they_do_where_they_are_called_as_an_array_is() -> None:
    def slow(velocity: F64, time: float = 0.25) -> F64:
        return np.full(len(velocity), time)

    env = NavigationEnv("dynamic", reward_terms={"t": slow})
    env.reset(seed=0)
    for _ in range(2):
        info = env.step(np.zeros(2, dtype=np.float32))[4]
    assert info["reward_terms"]["t"] == 0.25


def test_functions_cannot_change_the_world() -> None:
    def greedy(pose: F64, observation: Any) -> F64:
        pose[:] = 0.0
        observation[:] = 0.0
        return pose[:, 0]

    plain, own = (
        NavigationEnv("dynamic", observation="flat"),
        NavigationEnv("dynamic", observation="flat", reward_terms={"t": greedy}),
    )
    assert np.array_equal(plain.reset(seed=0)[0], own.reset(seed=0)[0])
    for action in actions(5):
        assert np.array_equal(plain.step(action)[0], own.step(action)[0])


def test_weights_are_bounded_and_a_term_is_made_in_python_too() -> None:
    assert RewardTerm(function=near_wall, weight=0.5).weight == 0.5
    with pytest.raises(ScenarioError, match=r"reward_terms\.t\.weight"):
        load("dynamic", reward_terms={"t": {"function": near_wall, "weight": 1e10}})
    assert bug_gym.RewardTerm is RewardTerm


def test_the_guide_names_every_array() -> None:
    page = Path(__file__).resolve().parents[1] / "docs" / "guide" / "own_rewards.md"
    text = page.read_text(encoding="utf-8")
    rows = "\n".join(line.split("|")[1] for line in text.splitlines() if line.startswith("| `"))
    assert set(re.findall(r"`(\w+)`", rows)) == set(ARRAYS)
    sentence = text[text.index("`last_` before") :].split(" is the same\n")[0]
    assert set(re.findall(r"`(\w+)`", sentence)) == {LAST, *EARLIER}


@pytest.mark.parametrize("moving", [False, True])
def test_the_clearance_of_a_step_is_that_of_the_step_however_near_it_was_before(moving: bool) -> None:
    # Straight away from a post behind, with nothing else within 20 m: the least distance of a step is that of its beginning.
    motion = {"law": "waypoints", "speed": 0.5, "points": [[-29.0, 0.0]]}
    post = {"shape": {"circle": 0.2}, "at": [-1.0, 0.0], "motion": motion}
    world = {
        "family": "explicit",
        "bounds": [-30, -30, 30, 30],
        "circles": [] if moving else [[-1.0, 0.0, 0.2]],
        "movers": [post] if moving else [],
        "start": [0, 0, 0],
        "goal": [20, 0],
    }
    told: list[float] = []

    def note(clearance: F64, last_clearance: F64) -> F64:
        told.append(float(clearance[0]))
        return last_clearance

    env = NavigationEnv({"world": world}, reward_terms={"t": note})
    radius = env.simulation.scenario.robot.radius
    env.reset(seed=0)
    expected = 0.8 - radius
    for number in range(60):
        was = env.simulation.world.pose[0, 0, 0]
        info = env.step(np.array([1.0, 0.0], dtype=np.float32))[4]
        away = env.simulation.world.pose[0, 0, 0] - was + (0.05 if moving else 0.0)
        assert told[-1] == pytest.approx(expected, abs=1e-9)
        assert info["reward_terms"]["t"] == pytest.approx(told[-2] if number else expected, abs=1e-9)
        expected += away


def test_robots_that_begin_anew_one_by_one_outlive_the_time_limit() -> None:
    def shaped(velocity: F64) -> F64:
        assert len(velocity)  # nobody is asked about nobody
        return np.where(velocity[:, 0] < 0.1, -0.01, 0.0)

    field = bug_gym.ObservationField(function=lambda goal_distance: goal_distance, shape=(1,), low=0.0, high=50.0)
    envs = make_robots_vec_env(
        "crossing_robots",
        2,
        2,
        seed=0,
        restart="robot",
        overrides={"time.limit": 1.0},
        reward_terms={"still": shaped},
        observation_fields={"far": field},
    )
    envs.reset()
    ends = 0
    for _ in range(25):
        ends += int(envs.step(np.full((4, 2), [-0.5, 0.0], dtype=np.float32))[2].sum())
    assert ends == 8
