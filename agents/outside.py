"""Policies from outside the package: classes that callers name as "module:Class" or "file.py:Class".

Such a name runs what it names. So it comes from a caller or from an installed package, never from data: suites and other
files name policies of the table.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import inspect
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

from bug_gym.assignments import name_and_options
from bug_gym.naming import nearest_hint

GROUP = "bug_gym.policies"
"""Group of entry points by which an installed package offers policies: name = "module:Class"."""

MODULE = r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*"


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


def is_object(source: Any) -> bool:
    """Whether something is a policy that is made already."""
    return not isinstance(source, type) and callable(getattr(source, "predict", None))


def is_reference(name: str) -> bool:
    """Whether a name says where code is: "module:Class" or "file.py:Class"."""
    return re.fullmatch(rf"({MODULE}|.+\.py):[A-Za-z_]\w*", name) is not None


def from_anywhere(reference: str) -> str:
    """A reference that means the same in a process that runs in another folder."""
    place, _, name = reference.rpartition(":")
    return f"{Path(place).expanduser().absolute()}:{name}" if place.endswith(".py") else reference


def imported_class(reference: str) -> type[Any]:
    """The policy class behind "module:Class" or "file.py:Class"; a module may lie in the working directory.

    Raises:
        ValueError: no such module, file or class, no Python in it, or a class that is no policy.
        ImportError: the module imports another one that is missing.
    """
    place, _, name = reference.rpartition(":")
    try:
        module = _module_of_file(place) if place.endswith(".py") else _module(place)
    except SyntaxError as error:
        raise ValueError(f"{error.filename}, line {error.lineno}: {error.msg}") from None
    if not hasattr(module, name):
        own = [key for key, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__]
        raise ValueError(f"{place} has no class {name!r}{nearest_hint(name, own)}")
    return required_policy(getattr(module, name), reference)


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
    return found


def require_constructor(policy_class: type[Any], told: str, keywords: Iterable[str]) -> None:
    """Refuse a class that is not made as policies are: with sensors, and with these keywords.

    Raises:
        ValueError: it takes other arguments.
    """
    try:
        inspect.signature(policy_class).bind(None, **dict.fromkeys(keywords))
    except TypeError as error:
        expected = f"{policy_class.__name__}(sensors, *, discrete, **parameters)"
        raise ValueError(f"{told} cannot be made: {error}; expected {expected}") from None


def reference_of(policy_class: type[Any]) -> str:
    """Module and name of a class as "module:Class", for manifests; a class of a script says `__main__`."""
    return f"{policy_class.__module__}:{policy_class.__qualname__}"


def code_digest(policy_class: type[Any]) -> str:
    """Digest of the file that a class is written in, which tells whether it is still the same; "" where there is none."""
    try:
        written = Path(inspect.getsourcefile(policy_class) or "").read_bytes()
    except (TypeError, OSError):  # typed in by hand, or run without its source
        return ""
    return hashlib.sha256(written).hexdigest()[:16]


def _module(name: str) -> ModuleType:
    """A module on Python's path, or in the working directory, where a command does not look by itself."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        _require_missing(name, error)
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)  # workers take this path over
        importlib.invalidate_caches()
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        _require_missing(name, error)
    raise ValueError(f"no module {name!r}, looked for on Python's path and in {here}")


def _require_missing(name: str, error: ModuleNotFoundError) -> None:
    """Raise an error on, where another module is missing than the one of this name."""
    if not f"{name}.".startswith(f"{error.name}."):
        raise error


def _module_of_file(place: str) -> ModuleType:
    """The module that a file holds, run once for each text of it; what lies beside it can be imported."""
    path = Path(place).expanduser().absolute()
    if not path.is_file():
        raise ValueError(f"no file {place}")
    digest = hashlib.sha256(f"{path}\0".encode() + path.read_bytes()).hexdigest()[:16]
    name = f"{path.stem}_{digest}"  # a worker that goes on reads a changed file again
    if name in sys.modules:
        return sys.modules[name]
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    specification = importlib.util.spec_from_file_location(name, path)
    assert specification is not None and specification.loader is not None  # the name ends in .py
    module = importlib.util.module_from_spec(specification)
    sys.modules[name] = module  # dataclasses look their module up
    try:
        specification.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module
