"""Policies from outside the package: classes that callers name as "module:Class" or "file.py:Class".

Such a name runs what it names. So it comes from a caller or from an installed package, never from data: suites and other
files name policies of the table.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from bug_gym.assignments import name_and_options
from bug_gym.checks import shortened
from bug_gym.policy import Memory, ScriptedPolicy
from bug_gym.references import imported

TAKEN = {"start": (), "act": ("view", "memory")}
"""What the package hands to a policy's methods."""

GROUP = "bug_gym.policies"
"""Group of entry points by which an installed package offers policies: name = "module:Class"."""


@dataclass(frozen=True)
class Spec:
    """A policy and its options, as `--policies` takes them in text."""

    name: Any
    """What `make_policy` takes: a name, a path, "module:Class", a class, or an object with `predict`."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """The algorithm's own parameters."""
    trust: bool = False
    """Whether a zip of stable-baselines3 may be read: it is a pickle and can run any code."""

    @classmethod
    def of(cls, source: Any) -> Spec:
        """A Spec from one, from text NAME[:PARAMETER=VALUE...], or from whatever else names a policy.

        Raises:
            ValueError: a value that is no YAML.
        """
        if isinstance(source, cls):
            return source
        return cls(*name_and_options(source)) if isinstance(source, str) else cls(source)

    @property
    def options(self) -> dict[str, Any]:
        """The parameters, trust among them."""
        return {**self.parameters, **({"trust": True} if self.trust else {})}


known_by: list[Callable[[str], str]] = []
"""Who knows where the class of a name from outside is found: the table of policies, which enters itself."""


def reference_by_name(name: str) -> str:
    """Where the class of a policy from outside is found, see `agents.outside_reference`, for those that the table names."""
    return next(filter(None, (find(name) for find in known_by)), "")


def is_object(source: Any) -> bool:
    """Whether something is a policy that is made already."""
    return not isinstance(source, type) and callable(getattr(source, "predict", None))


def imported_class(reference: str) -> type[Any]:
    """The policy class behind "module:Class" or "file.py:Class"; a module may lie in the working directory.

    Raises:
        ValueError: no such module, file or class, no Python in it, or a class that is no policy.
        ImportError: the module imports another one that is missing.
    """
    return required_policy(imported(reference, "class"), reference)


def offered_class(name: str, package: str, reference: str) -> type[Any]:
    """The policy class that an installed package offers, see `imported_class`.

    Args:
        name: of the policy.
        package: what an error calls the package.
        reference: "module:Class" of its entry point.

    Raises:
        ValueError: no such module or class, or a class that is no policy.
        ImportError: its module cannot be imported, for whatever reason. Either names the policy and the package.
    """
    try:
        return imported_class(reference)
    except Exception as error:  # whatever the code of a package raises
        kind, told = (ValueError if isinstance(error, ValueError) else ImportError), str(error)
        if not isinstance(error, (ValueError, ImportError)):
            told = f"{type(error).__name__}: {error}"
        raised = kind(f"policy {name!r} of {package}: {told}")
        raise raised.with_traceback(error.__traceback__) from None


def required_policy(found: Any, told: str) -> type[Any]:
    """What was found, where it is a class of policies.

    Args:
        found: anything.
        told: what an error calls it.

    Raises:
        ValueError: it is none.
    """
    if not isinstance(found, type) or not callable(getattr(found, "predict", None)):
        came = f"class {found.__name__}" if isinstance(found, type) else f"an object of type {type(found).__name__}"
        expected = "a class with `predict`, such as one derived from bug_gym.policy.ScriptedPolicy"
        raise ValueError(f"{told} is no policy: got {came}, expected {expected}")
    if missing := sorted(getattr(found, "__abstractmethods__", ())):
        raise ValueError(f"{told} is no whole policy: it lacks {', '.join(missing)}")
    if not issubclass(found, ScriptedPolicy):
        _require_predict(found, told)
        return found
    for name, takes in TAKEN.items():
        try:
            inspect.signature(getattr(found, name)).bind(*["self", *takes])
        except TypeError as error:
            raise ValueError(f"{told}: {name} takes ({', '.join(['self', *takes])}): {error}") from None
    return found


def _require_predict(found: type[Any], told: str) -> None:
    """Refuse a class whose `predict` takes other arguments than an evaluation hands in."""
    begins = () if getattr(found, "one_by_one", False) else ("episode_start",)
    try:
        inspect.signature(found.predict).bind("self", "observation", "state", *begins, deterministic=True)
    except TypeError as error:
        expected = "predict takes (self, observation, state, episode_start, deterministic)"
        raise ValueError(f"{told}: {expected}: {error}") from None
    except ValueError:  # written in C, without a signature: it will be seen when it is asked
        return


def require_memory(policy: Any, told: str) -> None:
    """Refuse a policy that is not whole, or whose episodes do not begin with a Memory of their own.

    Raises:
        ValueError: its `__init__` leaves out that of ScriptedPolicy, or `start` answers with anything else, or with one
            memory for all.
    """
    if not isinstance(policy, ScriptedPolicy):
        return
    if not all(hasattr(policy, name) for name in ("sensors", "parameters")):
        expected = "super().__init__(sensors, discrete=discrete, **parameters)"
        raise ValueError(f"{told}: its __init__ does not call that of ScriptedPolicy, expected {expected}")
    first, second = policy.start(), policy.start()
    for memory in (first, second):
        if not isinstance(memory, Memory):
            raise ValueError(f"{told}: start answered {shortened(memory)}, expected a bug_gym.policy.Memory")
    if first is second:
        raise ValueError(f"{told}: start answered the same memory twice, expected a new one for each episode")


def require_constructor(policy_class: type[Any], told: str, keywords: Iterable[str], *, whole: bool = True) -> None:
    """Refuse a class that is not made as policies are: with sensors, and with these keywords.

    Args:
        policy_class: the class.
        told: what an error calls it.
        keywords: names of what it is given.
        whole: whether they are all; else it may need others besides, such as parameters without a default.

    Raises:
        ValueError: it takes other arguments.
    """
    try:
        signature = inspect.signature(policy_class)
        (signature.bind if whole else signature.bind_partial)(None, **dict.fromkeys(keywords))
    except TypeError as error:
        expected = f"{policy_class.__name__}(sensors, *, discrete, **parameters)"
        raise ValueError(f"{told} cannot be made: {error}; expected {expected}") from None
