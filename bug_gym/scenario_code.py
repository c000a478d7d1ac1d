"""What a scenario is made of beside its values: code of one's own, and files; by digests, which tell whether it is the same."""

from __future__ import annotations

import hashlib
from typing import Any

from bug_gym.config import Scenario
from bug_gym.references import code_digest, place_digest
from bug_gym.schema.own import OWN_PARTS, Trusted, required_function
from bug_gym.worlds.own import OwnFamily, required_trust


def own_parts(scenario: Scenario) -> dict[str, Any]:
    """A scenario's own functions and family, by key and name."""
    parts = {f"{key}.{name}": own for key in OWN_PARTS for name, own in getattr(scenario, key).items()}
    found = {told: required_function(own, told) for told, own in parts.items()}
    required_trust(scenario.world)
    if isinstance(scenario.world, OwnFamily):
        found["world.family"] = scenario.world.found
    return found


def names_code(scenario: Scenario) -> bool:
    """Whether a scenario has functions or a family of its own."""
    return any(getattr(scenario, key) for key in OWN_PARTS) or isinstance(scenario.world, OwnFamily)


def own_code(scenario: Scenario) -> dict[str, str]:
    """Digests of what a scenario's own functions and family are written in, by key and name.

    Raises:
        ValueError: a file was changed after it was imported.
    """
    named = {f"{key}.{name}": own.function for key in OWN_PARTS for name, own in getattr(scenario, key).items()}
    return {told: code_digest(code) or _place_of(named.get(told)) for told, code in own_parts(scenario).items()}


def _place_of(function: Any) -> str:
    """Digest of the file that names a function which is not written there as one; "" where none names it."""
    return place_digest(function.reference) if isinstance(function, Trusted) else ""


def data_digest(scenario: Scenario) -> str:
    """Digest of the files that a scenario's worlds are read from, "" where there are none."""
    files = scenario.world.data_files()
    parts = [file.name.encode() + hashlib.sha256(file.read_bytes()).digest() for file in files]
    return hashlib.sha256(b"".join(parts)).hexdigest()[:16] if parts else ""
