"""Who drives and where: a policy to evaluate, and a scenario with the seeds of its worlds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from bug_gym.agents import make_policy, reads_map
from bug_gym.config import Scenario, checked
from bug_gym.evaluation.suites import SuitePolicy
from bug_gym.policy import Policy
from bug_gym.simulation import Simulation


@dataclass(frozen=True)
class PolicyEntry:
    """A policy to evaluate: a name of the table with parameters, or an object that has `predict`."""

    label: str
    """What tables call it."""
    name: str
    """Name that `make_policy` takes, or the class of the object."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """The algorithm's own parameters."""
    policy: Policy | None = None
    """The object, where there is one."""

    @classmethod
    def of(cls, source: Any) -> PolicyEntry:
        """An entry from a name, (label, name, parameters), a dict with those keys, or an object with or without label.

        Raises:
            ValueError: nothing of the kind.
        """
        if isinstance(source, cls):
            return source
        if isinstance(source, SuitePolicy):
            return cls(source.label or source.name, source.name, source.parameters)
        if isinstance(source, (str, Mapping)):
            return cls.of(checked(SuitePolicy, source, "policy"))
        if isinstance(source, tuple) and len(source) in (2, 3) and isinstance(source[1], str):
            return cls.of(dict(zip(("label", "name", "parameters"), source, strict=False)))
        label, policy = source if isinstance(source, tuple) and len(source) == 2 else (type(source).__name__, source)
        if not callable(getattr(policy, "predict", None)):
            expected = "a name, (label, name, parameters), a dict with those keys, or an object with predict"
            raise ValueError(f"got {source!r} as a policy, expected {expected}")
        return cls(label, type(policy).__qualname__, policy=policy)

    @property
    def is_privileged(self) -> bool:
        """Whether the policy reads the world's map."""
        if self.policy is not None:
            return bool(getattr(self.policy, "privileged", False))
        return reads_map(self.name, self.parameters)

    def make(self, simulation: Simulation) -> Policy:
        """The policy for the robots of a simulation.

        Raises:
            ValueError: an object that reads the map of another env.
        """
        if self.policy is not None:
            if getattr(self.policy, "maps", None) is not None:
                expected = "give its name and parameters instead"
                raise ValueError(f"{self.label}: a planner reads the map of the env that it was made with: {expected}")
            return self.policy
        return make_policy(self.name, simulation, **self.parameters)


@dataclass(frozen=True)
class ScenarioEntry:
    """A scenario to evaluate in, and the seeds of its worlds."""

    label: str
    """What tables call it."""
    scenario: Scenario
    seeds: range

    @property
    def has_moving_target(self) -> bool:
        """Whether the goal moves, so that no path is the shortest one."""
        world = self.scenario.world
        return getattr(world, "target", None) is not None or getattr(world, "target_motion", None) is not None
