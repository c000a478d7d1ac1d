"""KEY=VALUE as a command line takes it, and names with such options after them: `bug2:turn=right`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from bug_gym.checks import shortened


def assignments(pairs: Sequence[str]) -> dict[str, Any]:
    """Values by key from KEY=VALUE, the values read as YAML.

    Raises:
        ValueError: no `=`, a value that is no YAML, or a key that comes twice.
    """
    import yaml

    from bug_gym.schema.errors import shortened  # loads pydantic
    from bug_gym.schema.yaml_text import parse_yaml  # loads pydantic

    found = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not key or not equals:
            raise ValueError(f"got {shortened(pair)}, expected KEY=VALUE, such as lidar.beams=180")
        if key in found:
            raise ValueError(f"got {shortened(key)} twice, the second time as {shortened(pair)}, expected it once")
        try:
            found[key] = parse_yaml(value)
        except yaml.YAMLError:
            expected = "a value as YAML has it, such as 180, true or [0, 1]"
            raise ValueError(f"got {shortened(pair, 300)}, expected {expected}") from None
    return found


def name_and_options(text: str) -> tuple[str, dict[str, Any]]:
    """The name and the values by key of NAME[:KEY=VALUE...].

    Raises:
        ValueError: a value that is no YAML, or a key that stands there twice.
    """
    name, *pairs = re.split(r":(?=\w+=)", text)
    keys = [pair.partition("=")[0] for pair in pairs]
    if twice := [key for key in keys if keys.count(key) > 1]:
        raise ValueError(f"got {shortened(text)}, expected a single {twice[0]}")
    return name, assignments(pairs)
