"""What callers hand in to the faces and the core: seeds, counts, options, actions, states. What is wrong changes nothing."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import bug_gym
from bug_gym import checks, worlds
from bug_gym.agents import make_policy
from bug_gym.agents.learning.settings import load_settings
from bug_gym.agents.learning.sweep_settings import load_sweep
from bug_gym.assignments import assignments
from bug_gym.checks import (
    checked_count,
    checked_options,
    checked_seed,
    checked_time,
    install_command,
    needed_from,
    real_numbers,
)
from bug_gym.config import load
from bug_gym.evaluation import evaluate
from bug_gym.evaluation.entries import PolicyEntry
from bug_gym.evaluation.suites import load_suite
from bug_gym.navigation_env import NavigationEnv
from bug_gym.references import imported
from bug_gym.reproductions import reproduction
from bug_gym.simulation import Simulation
from bug_gym.vector_env import NavigationVectorEnv

NO_SEEDS = [-1, 2**63, 0.5, "3", True, float("nan"), np.float64(1.0), np.bool_(True), b"1", [1], {}, 1j]
FACES: dict[str, Callable[[], Any]] = {
    "env": lambda: gym.make("BugGym/Static-v0"),
    "vector": lambda: gym.make_vec("BugGym/Static-v0", num_envs=2),
    "parallel": lambda: bug_gym.parallel_env("static", robots=2),
    "aec": lambda: bug_gym.env("static", robots=2),
}
NAMES = ["static", "u_trap"]
"""A scenario whose worlds the kernels place, and one whose layouts are drawn in Python."""

anything = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.text(),
    st.binary(),
    st.complex_numbers(),
    st.lists(st.integers()),
)


# ---------------------------------------------------------------------------------------------- the checks themselves


@given(st.integers(0, 2**63 - 1))
def test_an_integer_of_python_or_numpy_is_a_seed(value: int) -> None:
    assert checked_seed(value) == checked_seed(np.int64(value)) == checked_seed(np.uint64(value)) == value
    assert type(checked_seed(np.int64(value))) is int


@given(anything)
def test_anything_is_a_seed_or_a_value_error(value: Any) -> None:
    is_seed = type(value) is int and 0 <= value < 2**63
    if is_seed:
        assert checked_seed(value) == value
    else:
        with pytest.raises(ValueError, match="a seed is an integer from 0 to"):
            checked_seed(value)


@given(anything)
def test_anything_is_a_count_or_a_value_error(value: Any) -> None:
    if type(value) is int and value >= 1:
        assert checked_count("rows", value) == checked_count("rows", value)
    else:
        with pytest.raises(ValueError, match="^rows must be"):
            checked_count("rows", value)


@given(anything)
@example(1e300)
@example(10**400)
@example(2**53 + 1)
def test_anything_is_a_time_or_a_value_error(value: Any) -> None:
    if type(value) in (int, float) and 0.0 < value <= sys.float_info.max:
        assert checked_time("minutes", value) == float(value)
    else:
        with pytest.raises(ValueError, match="^minutes must be a number above 0, got"):
            checked_time("minutes", value)


@given(anything)
def test_anything_is_options_or_a_value_error(value: Any) -> None:
    if value is None:
        assert checked_options(value, None) == checked_options(value, ()) == {}
    else:
        with pytest.raises(ValueError, match="options is a dict or None"):
            checked_options(value, None)


@pytest.mark.parametrize(
    ("make", "known"),
    [
        (lambda: gym.make("BugGym/Static-v0"), "shortest_path, drawn"),
        (lambda: gym.make_vec("BugGym/Static-v0", 2), "reset_mask, shortest_path, drawn"),
        (lambda: gym.make_vec("BugGym/Static-v0", 2, vectorization_mode="sync"), "shortest_path, drawn"),
        (lambda: gym.make("BugGym/Prediction-v0"), "none"),
    ],
)
def test_an_option_of_another_name_is_refused_with_those_that_are_known(make: Any, known: str) -> None:
    env = make()
    for options, hint in (({"sedd": 3}, "'sedd'"), ({"shortst_path": True}, "'shortst_path'"), ({3: 4}, "3")):
        with pytest.raises(ValueError, match=rf"^unknown option {hint}.* \(known: {known}\)$"):
            env.reset(seed=0, options=options)
    env.reset(seed=0, options={})
    if known != "none":
        with pytest.raises(ValueError, match=r"did you mean 'shortest_path'\?"):
            env.reset(seed=0, options={"shortst_path": True})
        env.reset(seed=0, options={"shortest_path": True, "drawn": True})


def test_an_env_of_several_robots_passes_other_options_over_with_a_word(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """PettingZoo's tests ask for {"options": 1} to see that options may be given."""
    monkeypatch.setattr("bug_gym.log.told", set())
    for make in (bug_gym.parallel_env, bug_gym.env):
        make("crossing_robots").reset(seed=0, options={"shortst_path": True})
    (line,) = [record.getMessage() for record in caplog.records]
    assert (
        line
        == "unknown option 'shortst_path', did you mean 'shortest_path'? (known: shortest_path, drawn) is passed over"
    )


@given(anything)
def test_anything_is_real_numbers_or_a_value_error(value: Any) -> None:
    try:
        array = real_numbers("actions", value)
    except ValueError as error:
        assert str(error).startswith("actions must be real numbers, got")
    else:
        assert array.dtype == np.float64
        assert not isinstance(value, (str, bytes, complex))


def test_a_missing_package_is_named_with_its_extra() -> None:
    with (
        pytest.raises(
            ImportError, match=re.escape(f"it needs no_such_package, of the extra `train`: {install_command('train')}")
        ),
        needed_from("train", "it"),
    ):
        import no_such_package.below  # type: ignore[import-not-found]  # noqa: F401


@pytest.mark.parametrize(
    ("origin", "command"),
    [
        (None, "pip install 'bug-gym[render]'"),  # from the index, which leaves no note
        ({"url": "file:///home/a%20b/gym", "dir_info": {"editable": True}}, "pip install -e '/home/a b/gym[render]'"),
        ({"url": "file:///C:/gym", "dir_info": {"editable": True}}, "pip install -e 'C:/gym[render]'"),
        ({"url": "file:///gym", "dir_info": {}}, "pip install 'bug-gym[render] @ file:///gym'"),
        ({"url": "file:///x.whl", "archive_info": {}}, "pip install 'bug-gym[render] @ file:///x.whl'"),
        (
            {"url": "https://example.org/gym", "vcs_info": {"vcs": "git", "commit_id": "1"}},
            "pip install 'bug-gym[render] @ git+https://example.org/gym'",
        ),
    ],
)
def test_an_extra_is_installed_from_where_the_package_came_from(
    origin: Any, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Installed:
        def read_text(self, name: str) -> str | None:
            told = {"WHEEL": "Wheel-Version: 1.0"} | ({} if origin is None else {"direct_url.json": json.dumps(origin)})
            return told.get(name)

    monkeypatch.setattr("importlib.metadata.distribution", lambda name: Installed())
    assert install_command("render") == command


def test_an_extra_of_a_package_that_is_not_installed_is_installed_from_its_folder(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def none(name: str) -> Any:
        raise PackageNotFoundError(name)

    monkeypatch.setattr("importlib.metadata.distribution", none)
    command = install_command("render")
    assert re.fullmatch(r"pip install -e '(.*)\[render\]'", command)
    assert command.partition("'")[2].startswith(str(Path(bug_gym.__file__).parents[1]))


def test_packages_of_an_extra_are_looked_for_before_the_work(monkeypatch: pytest.MonkeyPatch) -> None:
    required = [
        "numpy>=1",
        "numba; extra == 'train'",
        'no-such-package[x]>=2; extra == "train"',
        "nor_this; extra == 'b'",
    ]
    monkeypatch.setattr("importlib.metadata.requires", lambda name: required)
    assert checks.missing_of("train") == ["no-such-package"]
    assert checks.missing_of("b") == ["nor_this"]
    with (
        pytest.raises(ImportError, match=r"^it needs no-such-package, of the extra `train`: pip install"),
        needed_from("train", "it", whole=True),
    ):
        pytest.fail("the work began")
    with needed_from("train", "it"):
        pass


def test_a_missing_module_of_our_own_is_no_missing_extra() -> None:
    with pytest.raises(ModuleNotFoundError, match="bug_gym"), needed_from("train", "it"):
        import bug_gym.no_such_module  # type: ignore[import-not-found]  # noqa: F401


# ---------------------------------------------------------------------------------------------- seeds


@pytest.mark.parametrize("face", FACES)
def test_numpys_integers_are_seeds_in_each_face(face: str) -> None:
    first, second = FACES[face](), FACES[face]()
    first.reset(seed=5)
    second.reset(seed=np.int64(5))
    assert states_of(first) == states_of(second)


@pytest.mark.parametrize("face", FACES)
@pytest.mark.parametrize("seed", NO_SEEDS, ids=repr)
def test_what_is_no_seed_is_refused_in_each_face_and_changes_nothing(face: str, seed: Any) -> None:
    env = FACES[face]()
    env.reset(seed=3)
    before = states_of(env)
    with pytest.raises(ValueError, match="seed"):
        env.reset(seed=seed)
    assert states_of(env) == before
    env.reset()
    other = FACES[face]()
    other.reset(seed=3)
    other.reset()
    assert states_of(env) == states_of(other), "the next episode is the same one, too"


def states_of(env: Any) -> list[bytes]:
    """All that the future of a face's worlds depends on."""
    snapshot, seeded = env.unwrapped.simulation.save()
    return [snapshot.floats.tobytes(), snapshot.ints.tobytes(), snapshot.observation.tobytes(), seeded.tobytes()]


@pytest.mark.parametrize("name", NAMES)
@given(data=st.data())
def test_a_vector_reset_with_one_bad_seed_changes_nothing(name: str, data: st.DataObject) -> None:
    env = NavigationVectorEnv(3, scenario=name)
    env.reset(seed=data.draw(st.integers(0, 100)))
    before = states_of(env)
    good = st.one_of(st.none(), st.integers(0, 2**63 - 1))
    seeds: list[Any] = data.draw(st.lists(good, min_size=3, max_size=3))
    seeds[data.draw(st.integers(0, 2))] = data.draw(st.sampled_from(NO_SEEDS))
    with pytest.raises(ValueError, match="a seed is an integer"):
        env.reset(seed=seeds)
    assert states_of(env) == before


def test_a_reset_that_finds_no_place_for_one_world_changes_none() -> None:
    world = {"family": "field", "obstacles": 32, "sizes": [0.5, 0.5], "bounds": [-6, -6, 6, 6], "solvable": 0.3}
    simulation = Simulation({"world": world}, count=4)
    good = next(seed for seed in range(1000) if fits(world, seed))
    bad = next(seed for seed in range(1000) if not fits(world, seed))
    simulation.reset(seeds=[good] * 4)
    before = [array.tobytes() for array in simulation.save()[0][1:4]]
    with pytest.raises(ValueError, match=f"seed {bad}, episode 0"):
        simulation.reset(np.array([1, 3]), seeds=[good, bad])
    assert [array.tobytes() for array in simulation.save()[0][1:4]] == before


def fits(world: dict[str, Any], seed: int) -> bool:
    """Whether the world of a seed finds its places."""
    try:
        Simulation({"world": world}).reset(seeds=[seed])
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("seed", [2**63 - 2, 1.5, "abc", [1, 2], np.array([0.5, 1.0, 2.0]), np.array(5)], ids=repr)
def test_a_vector_env_refuses_what_does_not_give_each_row_a_seed(seed: Any) -> None:
    env = NavigationVectorEnv(3)
    with pytest.raises(ValueError, match="seed"):
        env.reset(seed=seed)


def test_an_array_of_seeds_gives_each_row_its_own() -> None:
    first, second = NavigationVectorEnv(2), NavigationVectorEnv(2)
    first.reset(seed=np.array([7, 9], dtype=np.uint32))  # type: ignore[arg-type]
    second.reset(seed=[7, 9])
    assert states_of(first) == states_of(second)


# ---------------------------------------------------------------------------------------------- counts and options


@pytest.mark.parametrize("count", [1.5, "2", None, np.float64(2.0), True], ids=repr)
def test_a_number_of_worlds_is_an_integer(count: Any) -> None:
    for make in (
        lambda: NavigationVectorEnv(count),
        lambda: Simulation("static", count),
        lambda: Simulation("static", 2, threads=count),
        lambda: gym.make_vec("BugGym/Static-v0", num_envs=count),
    ):
        with pytest.raises(ValueError, match="must be an integer, got"):
            make()


def test_numpys_integers_are_numbers_of_worlds() -> None:
    assert NavigationVectorEnv(np.int64(3)).action_space.shape == (3, 2)  # type: ignore[arg-type]


@pytest.mark.parametrize("face", FACES)
@pytest.mark.parametrize("options", ["abc", 1, ["shortest_path"]], ids=repr)
def test_options_are_a_dict(face: str, options: Any) -> None:
    env = FACES[face]()
    with pytest.raises(ValueError, match="options is a dict or None, got"):
        env.unwrapped.reset(seed=1, options=options)


@pytest.mark.parametrize("most", [0, -3, 1.5, "9"])
def test_a_number_of_steps_is_an_integer_from_1(most: Any) -> None:
    with pytest.raises(ValueError, match="the number of steps must be"):
        NavigationVectorEnv(1, max_episode_steps=most)


@pytest.mark.parametrize("settings", [{"seed": 1.5}, {"seed": "1"}, {"episodes": 2.5}, {"workers": 1.5}], ids=repr)
def test_numbers_of_an_evaluation_are_integers(settings: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="seed|workers"):
        evaluate("bug0", "empty", **settings)


# ---------------------------------------------------------------------------------------------- actions and states


@pytest.mark.parametrize("action", [[1j, 0.0], ["1", "0"], np.array([1, 0], dtype="m8[s]"), [None, {}], "ab"], ids=repr)
def test_what_is_no_real_number_is_no_action(action: Any) -> None:
    env = NavigationEnv("static")
    env.reset(seed=0)
    before = states_of(env)
    with pytest.raises(ValueError, match="an action is numbers of shape"):
        env.step(action)
    with pytest.raises(ValueError, match="actions must be real numbers"):
        env.simulation.advance([[action]])
    assert states_of(env) == before


@pytest.mark.parametrize(
    "change", [{"lidar.range": 4.0}, {"robot.max_speed": 0.5}, {"name": "other"}, {"world.obstacles": 9}]
)
def test_a_state_of_another_scenario_is_refused_and_changes_nothing(change: dict[str, Any]) -> None:
    simulation, other = Simulation("static"), Simulation("static", overrides=change)
    for one in (simulation, other):
        one.reset(seeds=[1])
    before = [array.tobytes() for array in other.save()[0][1:4]]
    with pytest.raises(ValueError, match="the snapshot is of another scenario than"):
        other.restore(simulation.save())
    assert [array.tobytes() for array in other.save()[0][1:4]] == before


def test_a_state_of_the_same_scenario_made_anew_is_taken() -> None:
    simulation, other = Simulation("static"), Simulation("static")
    simulation.reset(seeds=[1])
    other.restore(simulation.save())
    assert (other.observations() == simulation.observations()).all()


@pytest.mark.parametrize("state", [None, 5, "ab", (), (1, 2), [None]], ids=repr)
def test_what_is_no_snapshot_is_refused(state: Any) -> None:
    simulation = Simulation("static")
    with pytest.raises(ValueError, match="expected what `snapshot` returned, got"):
        simulation.restore(state)


def test_what_is_no_mapping_is_refused_by_name() -> None:
    env = bug_gym.parallel_env("static", robots=2)
    env.reset(seed=0)
    for actions in (None, [[0, 0], [0, 0]], "ab"):
        with pytest.raises(ValueError, match="actions are a mapping of robots to actions, got"):
            env.step(actions)  # type: ignore[arg-type]
    for overrides in ("abc", 5, [("lidar.beams", 9)]):
        with pytest.raises(ValueError, match="overrides: got .*, expected a mapping of dotted keys to values"):
            NavigationEnv("static", overrides=overrides)  # type: ignore[arg-type]


def test_what_an_error_says_of_an_array_is_short() -> None:
    for values in (np.zeros((70, 80), dtype=complex), [1j] * 5000, "x" * 5000):
        with pytest.raises(ValueError, match="must be real numbers") as told:
            real_numbers("they", values)
        assert len(str(told.value)) < 200 and "\n" not in str(told.value)


LONG = "9" * 5000
NAMED: dict[str, Callable[[], object]] = {
    "a scenario": lambda: load(LONG),
    "a suite": lambda: load_suite(LONG),
    "a training": lambda: load_settings(LONG),
    "a sweep": lambda: load_sweep(LONG),
    "a policy": lambda: make_policy(LONG, NavigationEnv("static")),
    "a policy's parameter": lambda: make_policy("bug2", NavigationEnv("static"), **{LONG: 1}),
    "a policy of a suite": lambda: PolicyEntry.of(LONG).make(Simulation("static")),
    "a reproduction": lambda: reproduction(LONG),
    "a key": lambda: load("static", {LONG: 1}),
    "a render mode": lambda: NavigationEnv("static", render_mode=LONG),
    "a family": lambda: worlds.register(LONG, LONG),
    "code": lambda: imported(f"{LONG}:{LONG}", "policy"),
    "an assignment": lambda: assignments([LONG]),
}


@pytest.mark.parametrize("what", NAMED)
def test_what_an_error_says_of_a_name_is_short(what: str) -> None:
    with pytest.raises((ValueError, TypeError, KeyError)) as told:
        NAMED[what]()
    assert all(len(line) < 1500 for line in str(told.value).split("\n"))
