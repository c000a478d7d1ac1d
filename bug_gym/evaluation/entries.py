"""Who drives and where: a policy to evaluate, and a scenario with the seeds of its worlds."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import NoneType
from typing import Any

from bug_gym.agents import Spec, is_scripted, make_policy, outside_reference, reads_map
from bug_gym.agents.model_places import model_digest, policy_digest
from bug_gym.agents.outside import imported_class, is_object, required_policy
from bug_gym.checks import shortened
from bug_gym.config import Scenario, checked
from bug_gym.evaluation.suites import SuitePolicy
from bug_gym.policy import MisfitError, Policy, ScriptedPolicy
from bug_gym.references import code_digest, is_reference, kept_in_process, reference_of
from bug_gym.scenario_code import own_code, own_parts
from bug_gym.simulation import Simulation

EXPECTED = (
    "a name, a Spec, a path, a class, (label, name, parameters), a dict with those keys, or an object with predict"
)

_HELD: dict[tuple[str, str], type[Any]] = {}
"""Classes from outside as plans hold to them, by reference and digest: their files may say something else later."""

_PLANNED: set[tuple[tuple[str, str], ...]] = set()
"""What scenarios' own code was written in when this process planned, and imported, it."""


class PolicyNote(str):
    """A note on an exception: which policy has raised it, or has answered what it is about."""


@dataclass(frozen=True)
class PolicyEntry:
    """A policy to evaluate: a name or a class with parameters, or an object that has `predict`."""

    label: str
    """What tables call it."""
    name: str
    """Name that `make_policy` takes, or the class of the object."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """The algorithm's own parameters."""
    policy: Policy | None = None
    """The object, where there is one."""
    policy_class: type[Any] | None = None
    """The class, where it was given itself."""
    reference: str = ""
    """Where the class of a name from outside is found by a process that nothing was registered in."""
    written: str | None = None
    """Its `code` when it was planned, see `held`; None: whatever is found."""

    @classmethod
    def of(cls, source: Any) -> PolicyEntry:
        """An entry from whatever names a policy, with or without label and parameters.

        Args:
            source: text NAME[:PARAMETER=VALUE...], a Spec, a path, a class, (label, one of those, parameters), a dict
                with label, name and parameters, or an object with `predict`, or (label, object).

        Raises:
            ValueError: nothing of the kind.
        """
        if isinstance(source, cls):
            return source
        if isinstance(source, SuitePolicy):
            return cls._labelled(source.label or source.name, source.name, source.parameters)
        if isinstance(source, Mapping):
            return cls.of(checked(SuitePolicy, source, "policy"))
        if isinstance(source, tuple) and len(source) in (2, 3):
            if isinstance(source[1], str):
                return cls.of(dict(zip(("label", "name", "parameters"), source, strict=False)))
            label = checked(SuitePolicy, {"label": source[0], "name": ""}, "policy").label
            return cls._labelled(label or "", *source[1:])
        return cls._labelled(source if isinstance(source, str) else "", source)

    @classmethod
    def _labelled(cls, label: str, source: Any, parameters: Mapping[str, Any] | None = None) -> PolicyEntry:
        """An entry; without a label it gets its name, and the options that tell it from others."""
        spec = Spec.of(source)
        if not isinstance(parameters, (Mapping, NoneType)):
            raise ValueError(f"got {shortened(parameters)} as a policy's parameters, expected a dict of values by name")
        if twice := [key for key in parameters or {} if key in spec.options]:
            raise ValueError(f"got {twice[0]} of {shortened(source)} among its parameters, too, expected it once")
        name, options = spec.name, {**spec.options, **(parameters or {})}
        if is_object(name):
            if options:
                raise ValueError(f"a policy that is made already takes no parameters, got {', '.join(options)}")
            return cls(label or type(name).__name__, type(name).__qualname__, policy=name)
        if isinstance(name, type):
            policy_class = required_policy(name, reference_of(name))
            return cls(label or name.__name__, reference_of(name), options, policy_class=policy_class)
        if isinstance(name, Path):
            name = str(name) if os.sep in str(name) else f".{os.sep}{name}"
        if not isinstance(name, str):
            raise ValueError(f"got {shortened(name)} as a policy, expected {EXPECTED}")
        told = ":".join([name, *(f"{key}={value}" for key, value in options.items())])
        return cls(label or told, name, options, reference=outside_reference(name))

    @property
    def is_privileged(self) -> bool:
        """Whether the policy reads the world's map."""
        if self.policy is not None:
            return bool(getattr(self.policy, "privileged", False))
        return reads_map(self._made_of, self.parameters)

    @property
    def is_scripted(self) -> bool:
        """Whether the policy is a rule that decides for each robot by itself."""
        return isinstance(self.policy, ScriptedPolicy) if self.policy is not None else is_scripted(self._made_of)

    @property
    def code(self) -> str:
        """Digests of what a policy is made of beside this package: its code, or model, and models of its parameters.

        Models are those that are named by their place (a path, or `hf://user/name`); the others belong to the package.
        "" where there is none of all that; one of a parameter stands behind its name, as in "predictor=0123456789abcdef".
        """
        return policy_digest(self._own_digest, self.parameters)

    @property
    def _own_digest(self) -> str:
        """Digest of the code of a class from outside, or of a model named by its place; "" where there is neither."""
        if self._own_class is not None:
            return code_digest(self._own_class)
        return "" if self.policy is not None else model_digest(self.name)

    @property
    def _own_class(self) -> type[Any] | None:
        """The class from outside, None where there is none."""
        if not self.reference:
            return self.policy_class
        return _HELD.get((self.reference, self.written or "")) or imported_class(self.reference)

    def held(self) -> PolicyEntry:
        """The same, held to what it is written in or what model it is now: an edit after this changes no run of it."""
        with suppress(ValueError, OSError):  # whoever asks for the digest is told
            planned = replace(self, written=self.code)
            planned._keep(self._own_class)
            return planned
        return self

    def _keep(self, found: type[Any] | None) -> None:
        """Have this process make the policy of this class from now on, whatever its file says."""
        if found is not None:
            _HELD[self.reference or reference_of(found), self.written or ""] = found

    def _require_held(self) -> None:
        """Refuse what is not what was planned; a class is looked at once by each process.

        Raises:
            ValueError: code or model are others here than in the process that planned, or than then.
        """
        if self.written is None or (self.policy_class is not None and _came_itself(self.policy_class)):
            return
        found, is_same = self._own_class, False
        if found is not None and (self.reference or reference_of(found), self.written) in _HELD:
            return
        with suppress(ValueError):  # a file that was changed after it was imported
            is_same = self.code in (self.written, "")  # what is not there at all, whoever makes it tells
        if not is_same:
            error = ValueError("its code or model was changed after this began, where a process reads it only now")
            error.add_note(PolicyNote(f"policy {self.label}"))
            raise error
        self._keep(found)

    def require_as_imported(self) -> None:
        """Refuse a class from outside whose file has changed since: other processes would import another one.

        Raises:
            ValueError: it has.
        """
        if self._own_class is not None:
            code_digest(self._own_class)

    @property
    def is_nameless(self) -> bool:
        """Whether nobody can tell later whether a policy is the same: an object, or a class without a file."""
        return self.policy is not None or (self.policy_class is not None and not self._own_digest)

    @property
    def _made_of(self) -> Any:
        is_held = self.written is not None and bool(self.reference)
        return self._own_class if is_held else self.policy_class or self.reference or self.name

    def make(self, simulation: Simulation) -> Policy:
        """The policy for the robots of a simulation.

        Raises:
            ValueError: an object that reads the map of another env, or that was trained on other observations; or code, or a
                model, that is not what was planned.
            MisfitError: a model of stable-baselines3 that was made for another robot.
        """
        if self.policy is not None:
            if getattr(self.policy, "maps", None) is not None:
                expected = "give its name and parameters instead"
                raise ValueError(f"{self.label}: a planner reads the map of the env that it was made with: {expected}")
            return make_policy(self.policy, simulation)
        self._require_held()
        try:
            with kept_in_process():
                return make_policy(self._made_of, simulation, **self.parameters)
        except MisfitError:
            raise
        except Exception as error:  # of a caller's code: any
            # Of who is registered or installed errors name another place, and what is not ours names nobody.
            is_unnamed = not is_reference(self.name) or not isinstance(error, (ValueError, ImportError))
            if (self.reference or self.policy_class) and is_unnamed:
                error.add_note(PolicyNote(f"policy {self.label}"))
            raise


def _came_itself(found: Any) -> bool:
    """Whether another process has sent a class or function as it is, as that of a notebook, and not by its name."""
    named = getattr(found, "py_func", found)  # a compiled one stands for it
    return getattr(sys.modules.get(named.__module__), getattr(named, "__name__", ""), None) is not found


@dataclass(frozen=True)
class ScenarioEntry:
    """A scenario to evaluate in, and the seeds of its worlds."""

    label: str
    """What tables call it."""
    scenario: Scenario
    seeds: range
    words: str = ""
    """As a shell hands it to a command, with its overrides; "" where it has no name, see `by_name.scenario_words`."""
    written: tuple[tuple[str, str], ...] = ()
    """Digests of its own functions and family when it was planned, by key and name, see `held`."""

    def held(self) -> ScenarioEntry:
        """The same, held to what its own functions and family are written in now."""
        with suppress(ValueError, OSError):  # whoever asks for the digest is told
            planned = replace(self, written=tuple(own_code(self.scenario).items()))
            _PLANNED.add(planned.written)
            return planned
        return self

    def require_held(self) -> None:
        """Refuse code that a worker has imported after it was changed.

        Raises:
            ValueError: it is not what was planned.
        """
        if not self.written or self.written in _PLANNED:
            return
        parts, planned = own_parts(self.scenario), dict(self.written)
        for told in [key for key, code in parts.items() if not _came_itself(code)]:
            if code_digest(parts[told]) != planned[told]:
                raise ValueError(f"scenario {self.label}: the code of {told} was changed after this began")

    @property
    def has_moving_target(self) -> bool:
        """Whether the goal moves, so that no path is the shortest one."""
        world = self.scenario.world
        return getattr(world, "target", None) is not None or getattr(world, "target_motion", None) is not None
