"""What holds for the parameters of every policy of the table: each stands once, with a sentence and a unit."""

from __future__ import annotations

import importlib
import pickle
import sys
from dataclasses import MISSING, fields
from typing import Any

import pytest

from bug_gym.agents import AGENTS, Agent, make_policy, parameters_table, playable_names
from bug_gym.agents.parameters import parameter_names, parameters_of
from bug_gym.policy import ScriptedPolicy
from bug_gym.simulation import Simulation
from bug_gym.view import Sensors

ENTRY_POINTS = sorted({line.entry_point for line in AGENTS.values()} | {"learning.play:ZipPolicy"})
SCRIPTED = [name for name in playable_names() if AGENTS[name].family != "learned"]
WITHOUT_UNIT = ("share", "weight", "number", "count")


def policy_class(entry_point: str) -> Any:
    """The class of a "module:Class" in the folder of agents."""
    module, name = entry_point.split(":")
    return getattr(importlib.import_module(f"bug_gym.agents.{module}"), name)


@pytest.mark.parametrize("entry_point", ENTRY_POINTS)
def test_every_policy_keeps_its_parameters_in_one_frozen_dataclass(entry_point: str) -> None:
    own = policy_class(entry_point).Parameters
    assert own.__dataclass_params__.frozen
    assert parameter_names(policy_class(entry_point)) == [field.name for field in fields(own) if field.init]


@pytest.mark.parametrize("entry_point", ENTRY_POINTS)
def test_each_parameter_has_a_sentence_and_a_unit(entry_point: str) -> None:
    for parameter in parameters_of(policy_class(entry_point)):
        assert parameter.text.endswith("."), parameter
        is_plain_number = any(word in parameter.text.lower() for word in WITHOUT_UNIT)
        assert "float" not in parameter.type or "[" in parameter.text or is_plain_number, parameter


@pytest.mark.parametrize("entry_point", ENTRY_POINTS)
def test_defaults_construct_and_parameters_pickle(entry_point: str) -> None:
    own = policy_class(entry_point)
    needed = {one.name: "somewhere" for one in parameters_of(own) if one.default is MISSING}
    parameters = own.Parameters(**needed)
    assert pickle.loads(pickle.dumps(parameters)) == parameters


@pytest.mark.parametrize("name", SCRIPTED)
def test_a_policy_keeps_what_it_was_given_and_pickles(name: str) -> None:
    policy: Any = make_policy(name, Simulation("static"))
    assert isinstance(policy.parameters, type(policy).Parameters)
    assert pickle.loads(pickle.dumps(policy)).parameters == policy.parameters


@pytest.mark.parametrize("name", SCRIPTED)
def test_an_unknown_parameter_of_a_class_is_a_type_error(name: str) -> None:
    with pytest.raises(TypeError, match="colour"):
        policy_class(AGENTS[name].entry_point)(Sensors.of(Simulation("static").scenario), colour="red")


def test_the_table_tells_each_parameter_that_can_be_set() -> None:
    rows = {(name, parameter.name): parameter for name, parameter in parameters_table()}
    assert rows["point_bug", "turn"].default == "right" and rows["k_bug", "turn"].default == "left"
    assert rows["dist_bug", "r_max"].type == "float | None"
    assert rows["bug2", "turn"].type == "'left' | 'right'"
    assert ("bug1", "leave_rule") not in rows and ("ppo_dynamic", "model") not in rows


class OwnConstructor(ScriptedPolicy):
    """A user's policy that names its parameters in its constructor."""

    def __init__(self, sensors: Sensors, *, discrete: bool = False, gain: float = 1.0) -> None:
        super().__init__(sensors, discrete=discrete)
        self.gain = gain

    def start(self) -> Any:
        raise NotImplementedError

    def act(self, view: Any, memory: Any) -> Any:
        raise NotImplementedError


class Derived(policy_class("bugs.bug2:Bug2")):  # type: ignore[misc]
    """A user's policy that adds nothing to be set."""


def test_without_parameters_of_its_own_the_constructor_says_what_can_be_set() -> None:
    assert parameter_names(OwnConstructor) == ["gain"]
    (gain,) = parameters_of(OwnConstructor)
    assert (gain.name, gain.type, gain.default, gain.text) == ("gain", "float", 1.0, "")
    assert OwnConstructor(Sensors.of(Simulation("static").scenario), gain=2.0).gain == 2.0


class NotScripted:
    """A user's policy of another kind."""

    def __init__(self, sensors: Sensors, *, discrete: bool = False, gain: float = 1.0) -> None:
        self.gain = gain


@pytest.mark.parametrize("own", [OwnConstructor, NotScripted])
def test_a_policy_with_a_plain_constructor_is_made_by_name(monkeypatch: pytest.MonkeyPatch, own: Any) -> None:
    monkeypatch.setitem(sys.modules, "bug_gym.agents.mine", sys.modules[__name__])
    monkeypatch.setitem(AGENTS, "mine", Agent(f"mine:{own.__name__}", "bug", "-"))
    policy: Any = make_policy("mine", "static", gain=3.0)
    assert policy.gain == 3.0
    with pytest.raises(
        ValueError, match=r"policy 'mine' has no parameter 'gian', did you mean 'gain'\? \(it has: gain\)"
    ):
        make_policy("mine", "static", gian=3.0)


def test_a_derived_policy_takes_what_its_base_takes() -> None:
    assert parameter_names(Derived) == ["clearance", "turn", "leave_rule", "round_corners"]
