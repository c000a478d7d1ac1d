"""Scenarios from YAML files and mappings, checked; and written as such again."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from bug_gym.config.own_worlds import TRUST
from bug_gym.config.scenario import Scenario
from bug_gym.limits import MOST_DEPTH, MOST_NODES, TEXT, told_bytes
from bug_gym.naming import nearest_hint
from bug_gym.references import is_reference
from bug_gym.schema.errors import ScenarioError, shortened
from bug_gym.schema.faults import explain
from bug_gym.schema.own import OWN_PARTS, Named, ObservationField, RewardTerm, trusted
from bug_gym.schema.values import Part
from bug_gym.schema.yaml_text import parse_yaml, told_fault
from bug_gym.worlds.own import OwnFamily

MAP_KEYS = {"image", "resolution"}
"""What tells a map of ROS's map_server from a scenario."""
INDEX = r"\d{1,9}"
"""What a key looks like that is a place in a list."""
SCENARIO_FOLDER = Path(__file__).parents[1] / "configs" / "scenarios"


def scenario_names() -> list[str]:
    """Names of the scenarios that come with the package, sorted."""
    return sorted(path.stem for path in SCENARIO_FOLDER.glob("*.yaml"))


def load(
    source: str | Path | Mapping[str, Any] | Scenario,
    overrides: Mapping[str, Any] | None = None,
    *,
    reward_terms: Mapping[str, Any] | None = None,
    observation_fields: Mapping[str, Any] | None = None,
    trust: bool = False,
) -> Scenario:
    """Makes a scenario.

    Args:
        source: a name from `scenario_names()`, the path of a YAML file, a mapping that says the same, or a scenario.
        overrides: values by dotted key, such as `{"lidar.beams": 360}`; each replaces all that stands there. Relative
            paths in a file start from its folder, those in mappings and overrides from the working directory.
        reward_terms: further terms of the reward, by name: a function, or what RewardTerm says.
        observation_fields: further fields of the observation, by name: what ObservationField says.
        trust: whether functions and families of worlds that are only named ("module:name") may be imported, which runs the
            code of their modules. Without it a scenario that names some can be read, but no world of it is made.

    Raises:
        ScenarioError: where something is unknown, missing or not allowed.
    """
    if not isinstance(overrides, Mapping | None):
        raise ScenarioError(f"overrides: got {shortened(overrides)}, expected a mapping of dotted keys to values")
    own = {"reward_terms": reward_terms, "observation_fields": observation_fields}
    given = {f"{key}.{name}": part for key, parts in own.items() for name, part in _checked_own(key, parts).items()}
    if isinstance(source, Scenario) and not (overrides or given or trust):
        return source
    scenario = _loaded(source, {**(overrides or {}), **given}, trust=trust)
    return _with_trust(scenario) if trust else scenario


def _checked_own(key: str, parts: object) -> Mapping[str, Any]:
    if not isinstance(parts, Mapping | None):
        raise ScenarioError(f"{key}: got {shortened(parts)}, expected a mapping of names to functions")
    if wrong := [name for name in parts or () if not isinstance(name, str) or "." in name]:
        expected = "letters, digits and underscores, a letter first"
        raise ScenarioError(f"{key}: got the name {shortened(wrong[0])}, expected {expected}")
    return parts or {}


def _with_trust(scenario: Scenario) -> Scenario:
    """The scenario with its functions imported, where they are only named."""
    parts = {
        key: Named({name: trusted(own, f"{key}.{name}") for name, own in getattr(scenario, key).items()})
        for key in OWN_PARTS
    }
    return scenario.model_copy(update={key: own for key, own in parts.items() if own})


def _loaded(
    source: str | Path | Mapping[str, Any] | Scenario, overrides: Mapping[str, Any], *, trust: bool
) -> Scenario:
    label, data = _read(source)
    for key, value in overrides.items():
        _override(data, key, _plain(value, f"{label}: override {shortened(key)}"), label)
    try:
        return Scenario.model_validate(data, context={TRUST: trust})
    except ValidationError as error:
        raise ScenarioError(explain(error, f"{label} with overrides" if overrides else label)) from None


def dump(scenario: Scenario) -> dict[str, Any]:
    """The scenario's differences from the defaults, as a dict that JSON can hold; `load` gives the scenario back."""
    data: dict[str, Any] = scenario.model_dump(mode="json", exclude_defaults=True)
    return data


def _with_functions(data: dict[str, Any], scenario: Scenario) -> dict[str, Any]:
    """A dump of the scenario in which its functions, and its family from outside, stand themselves, not where they are."""
    for key in OWN_PARTS:
        for name, own in getattr(scenario, key).items():
            data[key][name]["function"] = own.function
    if isinstance(scenario.world, OwnFamily):
        data["world"]["family"] = scenario.world.source
    return data


def to_yaml(scenario: Scenario) -> str:
    """The scenario's differences from the defaults, as the text of a YAML file."""
    return yaml.safe_dump(dump(scenario), sort_keys=False, default_flow_style=None, allow_unicode=True, width=120)


def _read(source: str | Path | Mapping[str, Any] | Scenario) -> tuple[str, dict[str, Any]]:
    """A name for errors, and the scenario as plain data."""
    if isinstance(source, Scenario):
        # Without what follows from other values (`unsaid`): it may be another once these are overridden.
        data = source.model_dump(mode="json", exclude_defaults=True, exclude_unset=True)
        return source.name, _with_functions(data, source)
    if isinstance(source, Mapping):
        return "scenario", _plain(source, "scenario")
    if not isinstance(source, (str, Path)):
        raise ScenarioError(f"scenario: got {shortened(source)}, expected a name, a path, a mapping or a Scenario")
    if isinstance(source, str) and not names_file(source):
        if source not in scenario_names():
            known = ", ".join(scenario_names())
            raise ScenarioError(
                f"no scenario {shortened(source, 300)}{nearest_hint(source, scenario_names())} (known: {known})"
            )
        return f"{source}.yaml", read_yaml(SCENARIO_FOLDER / f"{source}.yaml")
    return str(source), read_yaml(expanded(source), scenario_names())


def expanded(source: str | Path) -> Path:
    """The path that a text names, with `~` for a home.

    Raises:
        ScenarioError: nobody's home, or a text that is no path.
    """
    try:
        path = Path(source).expanduser()
    except RuntimeError as error:
        raise ScenarioError(f"{source}: {error}") from None
    if "\0" in str(path):
        raise ScenarioError(f"got {shortened(str(path))}, expected a path without a zero byte")
    return path


def read_yaml(path: Path, names: Sequence[str] = ()) -> dict[str, Any]:
    """The mapping in a YAML file, paths and code in it starting from its folder and `name` its stem where it gives none.

    The YAML of a map as ROS's map_server has it means a world with that map. Of some known `names` the one that is given
    with the ending of a file is offered where there is no such file.

    Raises:
        ScenarioError: no such file, or no mapping in it.
    """
    text = ""
    try:
        with path.open("rb") as file:
            raw = file.read(TEXT + 1)
        if len(raw) > TEXT:
            raise ScenarioError(f"{path}: got more than {told_bytes(TEXT)}, expected the text of a scenario")
        text = raw.decode("utf-8")
        data = parse_yaml(text)
    except yaml.YAMLError as error:
        raise ScenarioError(f"{path}: {told_fault(error, text)}") from None
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{path}: not a YAML file: {error}") from None
    except OSError as error:
        known = [*(file.name for file in path.parent.glob("*.y*ml")), *({path.stem} & set(names))]
        raise ScenarioError(f"{path}: {error.strerror}{nearest_hint(path.name, known)}") from None
    if not isinstance(data, dict):
        raise ScenarioError(f"{path}: got {shortened(data)}, expected a mapping such as `world: {{family: empty}}`")
    if data.keys() >= MAP_KEYS:
        data = {"world": {"family": "ros_map", "path": path.name}}
    data = _plain(data, str(path))  # what two aliases share comes apart, so that each can change alone
    return {"name": path.stem, **_resolved(data, path.parent)}


def names_file(source: object) -> bool:
    """Whether a text says where a YAML file is, not what comes with the package is called."""
    return isinstance(source, str) and re.search(r"[/\\]|\.ya?ml$", source) is not None


def from_folder(source: Any, folder: Path) -> Any:
    """What a file in a folder names, a scenario or a training: a path starts from there, a name is a name."""
    return str(folder / expanded(source)) if names_file(source) else source


def _resolved(value: Any, folder: Path, keys: tuple[str, ...] = ()) -> Any:
    """What a file says, with the data and the code that it names starting from the file's folder, at any depth.

    Args:
        value: all of it, or what stands at some key.
        folder: the file's.
        keys: that lead to the value; keys with dots, as overrides have them, come apart. What is in a list, as the values
            to choose from of a sweep, has those of the list.
    """
    if isinstance(value, dict):
        return {key: _resolved(item, folder, (*keys, *str(key).split("."))) for key, item in value.items()}
    if isinstance(value, list):
        return [_resolved(item, folder, keys) for item in value]
    if isinstance(value, str) and (_is_code_of_file(value) if _name_code(keys) else keys[-1:] == ("path",)):
        return str(folder / expanded(value))
    return value


def _is_code_of_file(text: str) -> bool:
    return is_reference(text) and text.rpartition(":")[0].endswith(".py")


def _name_code(keys: tuple[str, ...]) -> bool:
    """Whether a function of a scenario, or its family of worlds, stands at some keys."""
    places = [keys, keys[:-1]] if keys[-1:] == ("function",) else [keys]  # a term may be called "function", too
    return any(place[-2:] == ("world", "family") or not OWN_PARTS.keys().isdisjoint(place[-2:-1]) for place in places)


def _plain(value: Any, label: str) -> Any:
    """A copy in which there are only dicts, lists, numbers and text, as JSON has them.

    Raises:
        ScenarioError: nested too deep, which what holds itself is too, or too many values.
    """
    count = 0

    def copy(value: Any, depth: int) -> Any:
        nonlocal count
        count += 1
        if depth > MOST_DEPTH:
            raise ScenarioError(f"{label}: nested deeper than {MOST_DEPTH} levels")
        if count > MOST_NODES:
            raise ScenarioError(f"{label}: more than {MOST_NODES:,} values")
        if isinstance(value, (RewardTerm, ObservationField)):
            return {**value.model_dump(mode="json"), "function": value.function}
        if isinstance(value, Part):
            return value.model_dump(mode="json")
        if isinstance(value, Mapping):
            return {key: copy(item, depth + 1) for key, item in value.items()}
        if isinstance(value, (list, tuple)):
            return [copy(item, depth + 1) for item in value]
        if hasattr(value, "tolist"):  # NumPy's numbers and arrays
            return value.tolist()
        return str(value) if isinstance(value, Path) else value

    return copy(value, 0)


def _override(data: dict[str, Any], key: str, value: Any, label: str) -> None:
    """Puts `value` at a dotted key of nested mappings and lists, in place."""
    if isinstance(data.get("robots"), list):
        data["robots"] = {"places": data["robots"]}
    keys = str(key).split(".")
    *parents, last = keys
    if len(parents) >= MOST_DEPTH:
        raise ScenarioError(f"{label}: override {shortened(key)}: nested deeper than {MOST_DEPTH} levels")
    place: Any = data
    for depth, parent in enumerate(parents, start=1):
        if not isinstance(place, dict):
            place = _item(place, parent, key, label)
            continue
        if parent not in place and re.fullmatch(INDEX, keys[depth]):  # no key is a number: a list is meant
            said = shortened(".".join(keys[:depth]))
            reason = f"{said} is at its default, expected all of it, as an override of {said}"
            raise ScenarioError(f"{label}: override {shortened(key)}: {reason}")
        place = place.setdefault(parent, {})
    if isinstance(place, dict):
        place[last] = value
    else:
        _item(place, last, key, label)
        place[int(last)] = value


def _item(items: Any, index: str, key: str, label: str) -> Any:
    if not isinstance(items, list) or not re.fullmatch(INDEX, index) or int(index) >= len(items):
        expected = f"an index below {len(items)}" if isinstance(items, list) else f"no key below {shortened(items)}"
        raise ScenarioError(f"{label}: override {shortened(key)}: got {shortened(index)}, expected {expected}")
    return items[int(index)]
