"""What a policy of the table is asked and made with: what is wrong is a ValueError of one line, whatever it is."""

from __future__ import annotations

import math
import re
from importlib import import_module
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bug_gym.agents import AGENTS, agent, make_policy, playable_names, team_names
from bug_gym.agents.parameters import AtMost, Length, Parameter, checked_parameters, parameters_of
from bug_gym.checks import shortened
from bug_gym.policy import Memory
from bug_gym.simulation import Simulation

SCRIPTED = [name for name in playable_names() if AGENTS[name].family != "learned"]
SIMULATION = Simulation("static", 2)
FLAT = SIMULATION.reset(seeds=[0, 1])[:, 0]

values = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.sampled_from(
        [1e300, -1e300, 1e-300, 5, "abc", "left", "lfet", "kalman", 2**64, -1, np.float32(0.5), np.int64(3)]
    ),
    st.text(max_size=8),
    st.binary(max_size=4),
    st.lists(st.integers(), max_size=2),
    st.dictionaries(st.text(max_size=2), st.integers(), max_size=1),
    st.complex_numbers(),
)


@pytest.mark.parametrize("name", SCRIPTED)
@given(data=st.data())
def test_any_value_of_a_parameter_makes_a_policy_that_decides_or_a_value_error(name: str, data: st.DataObject) -> None:
    own: Any = type(make_policy(name, SIMULATION))
    known = [field for field in own.Parameters.__dataclass_fields__.values() if field.init]
    chosen = data.draw(st.sets(st.sampled_from([field.name for field in known]), max_size=2)) if known else set()
    parameters = {one: data.draw(values) for one in sorted(chosen)}
    try:
        policy = make_policy(name, SIMULATION, **parameters)
    except ValueError as error:
        assert "\n" not in str(error)
        assert any(one in str(error) for one in parameters)
    else:
        actions, state = policy.predict(FLAT)
        assert np.isfinite(actions).all()
        policy.predict(FLAT, state)


@pytest.mark.parametrize(
    ("name", "parameters", "text"),
    [
        (
            "bug2",
            {"clearance": "abc"},
            r"policy 'bug2': clearance: got 'abc', expected float \| None, at most 1000 \(Dist",
        ),
        ("bug2", {"clearance": 1e300}, r"policy 'bug2': clearance: got 1e\+300, expected float \| None, at most 1000$"),
        ("bug2", {"clearance": True}, "clearance: got True, expected float"),
        ("bug2", {"turn": "lfet"}, r"turn must be one of \['left', 'right'\], got 'lfet', did you mean 'left'\?"),
        ("bug2", {"turn": ["left"]}, r"turn must be one of \['left', 'right'\]"),
        ("hd_bug", {"predictor": 5}, "predictor: got 5, expected str"),
        ("hd_bug", {"predictor": "kalmann"}, "did you mean 'kalman'"),
        ("hd_bug_map", {"patience": 2.5}, "patience: got 2.5, expected int, at most 1e"),
        ("hd_bug", {"lead": 1}, "lead: got 1, expected bool"),
        ("random", {"seed": 2**70}, "seed: got 1180591620717411303424, expected int, at most"),
        ("random", {"seed": -1}, "seed must not be negative, got -1"),
        ("dist_bug", {"name": 3}, "has no parameter 'name'"),
    ],
)
def test_an_error_of_a_parameter_says_what_came_and_what_was_expected(
    name: str, parameters: dict[str, Any], text: str
) -> None:
    with pytest.raises(ValueError, match=text):
        make_policy(name, SIMULATION, **parameters)


def test_numpys_numbers_are_parameters() -> None:
    policy: Any = make_policy("bug2", SIMULATION, clearance=np.float32(0.5))
    assert policy.parameters.clearance == 0.5 and type(policy.parameters.clearance) is float


def words(parameter: Parameter) -> set[str]:
    """The types that a parameter may have."""
    return set(re.findall(r"\w+", re.sub(r"'[^']*'", "", parameter.type)))


CUT = {"r_max", "vision_range"}
"""Ranges of view, which the scanner's range cuts: any number above their least is as good."""


@pytest.mark.parametrize("name", SCRIPTED)
def test_each_number_among_the_parameters_of_a_policy_has_a_limit(name: str) -> None:
    for parameter in parameters_of(type(make_policy(name, SIMULATION))):
        numbers = {"float": 1e300, "int": 10**300}.items()
        for value in [value for word, value in numbers if word in words(parameter) and parameter.name not in CUT]:
            with pytest.raises(ValueError, match=f"{parameter.name}.* at most"):
                make_policy(name, SIMULATION, **{parameter.name: value})


@pytest.mark.parametrize("name", [*playable_names(), *team_names()])
@pytest.mark.parametrize("sensors", [SIMULATION, SIMULATION.scenario, "static", None])
def test_a_class_that_is_made_for_an_env_instead_of_sensors_says_what_came(name: str, sensors: Any) -> None:
    agents = {"agents": ("robot_0", "robot_1")} if name in team_names() else {}
    module, _, class_name = agent(name).entry_point.partition(":")
    policy_class = getattr(import_module(f"bug_gym.agents.{module}"), class_name)
    with pytest.raises(ValueError, match=r"^\w+ got .* as its sensors, expected [^\n]*Sensors[^\n]*$") as refused:
        policy_class(sensors, **agents)
    assert shortened(sensors) in str(refused.value) and policy_class.__name__ in str(refused.value)


@pytest.mark.parametrize("name", [None, 5, b"bug2", ["bug2"], ("bug2",)])
def test_a_name_that_is_no_text_is_refused(name: Any) -> None:
    with pytest.raises(ValueError, match="a policy is named by text such as 'bug2', got"):
        make_policy(name, SIMULATION)


@pytest.mark.parametrize("name", SCRIPTED)
def test_a_memory_of_another_policy_is_refused(name: str) -> None:
    policy = make_policy(name, SIMULATION)
    for state in ((Memory(), 3), (3, 4), ("a", "b"), "ab", 5, {"a": 1, "b": 2}):
        with pytest.raises(ValueError, match="memor"):
            policy.predict(FLAT, state)  # type: ignore[arg-type]


def test_a_memory_of_another_bug_is_refused_by_name() -> None:
    _, state = make_policy("bug1", SIMULATION).predict(FLAT)
    with pytest.raises(ValueError, match="got the memory of another policy: Bug1Memory, expected Bug2Memory"):
        make_policy("bug2", SIMULATION).predict(FLAT, state)


@pytest.mark.parametrize("name", SCRIPTED)
@pytest.mark.parametrize("starts", [[True], [True] * 3, [[True, False]], ["yes", "no"], [0.5, 1.0], None])
def test_episode_start_is_a_truth_value_a_row(name: str, starts: Any) -> None:
    policy = make_policy(name, SIMULATION)
    _, state = policy.predict(FLAT)
    if starts is None:
        policy.predict(FLAT, state, starts)
        return
    for memory in (None, state):
        with pytest.raises(ValueError, match="episode_start is 2 bools, got shape"):
            policy.predict(FLAT, memory, starts)


@pytest.mark.parametrize(
    "observation", [FLAT.astype(complex), FLAT.astype(str), None, "abc", [[]], {"ranges": 3.0}, {}]
)
def test_what_is_no_observation_is_refused(observation: Any) -> None:
    with pytest.raises(ValueError):
        make_policy("bug2", SIMULATION).predict(observation)


@given(st.floats())
def test_a_limit_leaves_what_is_not_finite_to_the_policy(value: float) -> None:
    own: Any = type(make_policy("bug2", SIMULATION))
    if 1000.0 < value < math.inf:
        with pytest.raises(ValueError, match="at most 1000"):
            checked_parameters(own, {"clearance": value}, "")
    else:
        (checked,) = checked_parameters(own, {"clearance": value}, "").values()
        assert checked == value or math.isnan(value)


def test_a_length_is_a_float_with_a_limit() -> None:
    assert get_args(Length) == (float, AtMost(1000.0))


def test_the_learned_policies_refuse_the_same() -> None:
    pytest.importorskip("onnxruntime", reason="onnxruntime comes with the extra `play`")
    for name in [one for one, line in AGENTS.items() if line.family == "learned" and one != "ppo_rush"]:
        simulation = Simulation("crossing_robots" if name == "ppo_crossing_robots" else "dynamic", 2)
        flat = simulation.reset(seeds=[0, 1])[:, 0]
        policy = make_policy(name, simulation)
        with pytest.raises(ValueError, match="episode_start is 2 bools"):
            policy.predict(flat, None, np.array([True]))
        _, state = policy.predict(flat)
        if state is not None:
            for foreign in ((), (1,), "ab", (Memory(), Memory())):
                with pytest.raises(ValueError, match="expected the memory that the last call returned"):
                    policy.predict(flat, foreign)  # type: ignore[arg-type]
