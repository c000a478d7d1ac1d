"""What the files of a results folder may say, as schemas: manifest.json and the lines of shortest_paths.jsonl.

A line of rows.jsonl is checked by `rows.EpisodeRow` itself.
"""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import AfterValidator

from bug_gym.evaluation.suites import Seeds
from bug_gym.schema.errors import shortened, wrong
from bug_gym.schema.values import Count, Part


class ManifestScenario(Part):
    """A scenario of a manifest."""

    scenario: dict[str, Any]
    """Its differences from the defaults."""
    seeds: Seeds
    """Of its worlds."""
    digest: str
    """Of the whole scenario, defaults too."""
    code: dict[str, str] = {}
    """Digests of the files of functions and families from outside, by key."""
    data: str = ""
    """Digest of the files that its worlds are read from."""


class ManifestPolicy(Part):
    """A policy of a manifest."""

    name: str
    """Name that `make_policy` takes, or the class of an object."""
    parameters: dict[str, Any]
    """The algorithm's own parameters."""
    code: str = ""
    """Digests of the file of a policy from outside, and of models named by their place."""


class Manifest(Part):
    """What was asked: see `plan.Plan.manifest`."""

    suite: str
    """Name and version of the suite, "" where there is none."""
    scenarios: dict[str, ManifestScenario]
    """Scenarios by label."""
    policies: dict[str, ManifestPolicy]
    """Policies by label."""
    versions: dict[str, str]
    """Of what the rows depend on, by name."""


def _length(text: str) -> str:
    if not re.fullmatch(r"inf|nan|\d+(\.\d+)?(e[+-]?\d+)?", text):
        raise wrong(f'got {shortened(text)}, expected a length as text, such as "3.5", "inf" or "nan"')
    return text


class LengthsRecord(Part):
    """The shortest paths of the robots of one world."""

    scenario: str
    """Label of the scenario."""
    seed: Count
    """Seed of the world."""
    lengths: tuple[Annotated[str, AfterValidator(_length)], ...]
    """Lengths [m] as text, because JSON has neither infinity nor NaN."""
