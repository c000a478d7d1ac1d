"""Faults of a scenario: how a validator tells one, and what is raised in the end."""

from __future__ import annotations

from pydantic_core import PydanticCustomError


class ScenarioError(ValueError):
    """A scenario that can't be: the message names the file, the key, what came and what is allowed."""


def wrong(reason: str, key: str = "") -> PydanticCustomError:
    """An error about the value that is being validated, or about one `key` of it."""
    return PydanticCustomError("scenario", "{reason}", {"key": key, "reason": reason})


def shortened(value: object, most: int = 80) -> str:
    """A value as an error shows it: at most so many characters of its `repr`, in one line."""
    try:
        text = " ".join(map(str.strip, repr(value).split("\n")))
    except ValueError:  # a whole number of more digits than Python writes out
        text = "a number of thousands of digits"
    except RecursionError:
        text = "what is nested too deep to show"
    return text if len(text) <= most else f"{text[: most - 3]}..."
