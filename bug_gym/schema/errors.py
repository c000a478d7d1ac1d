"""Faults of a scenario: how a validator tells one, and what is raised in the end."""

from __future__ import annotations

from pydantic_core import PydanticCustomError

from bug_gym.checks import shortened as shortened  # where all look for it


class ScenarioError(ValueError):
    """A scenario that can't be: the message names the file, the key, what came and what is allowed."""


def wrong(reason: str, key: str = "") -> PydanticCustomError:
    """An error about the value that is being validated, or about one `key` of it."""
    return PydanticCustomError("scenario", "{reason}", {"key": key, "reason": reason})
