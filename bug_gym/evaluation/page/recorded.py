"""Episodes that were recorded, in a page: the letters of each in an element of its own, and buttons that play them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

from bug_gym.evaluation.page.markup import Markup, element, joined

Key = tuple[str, str, int]
"""Policy and scenario by label, and seed."""


class Ended(Protocol):
    """An episode and how it ended, as far as it matters for what is replayed: a row of an evaluation, or what looks so."""

    @property
    def policy(self) -> str:
        """Label of the policy."""

    @property
    def scenario(self) -> str:
        """Label of the scenario."""

    @property
    def seed(self) -> int:
        """Seed of the world."""

    @property
    def success(self) -> bool:
        """Whether it ended as it should."""

    @property
    def outcome(self) -> str:
        """How it ended."""

    @property
    def verdict(self) -> str:
        """What is said of that, "" where nothing."""


def has_failed(row: Ended) -> bool:
    """Whether an episode is a failure: a robot whose mission another one accomplished is none."""
    return not row.success and row.outcome != "ended"


class Recorded:
    """The episodes of a page, by number."""

    def __init__(self, replays: Mapping[Key, str]) -> None:
        self.letters = list(replays.values())
        self.numbers = {key: number for number, key in enumerate(replays)}


def episodes_of(recorded: Recorded) -> Markup:
    """An element with the letters of each episode, which nothing reads before it is asked for."""
    return joined(
        element("script", letters, id=f"replay-{number}", type="text/plain")
        for number, letters in enumerate(recorded.letters)
    )


def buttons(keys: Iterable[Key], numbers: Mapping[Key, int]) -> Markup:
    """A button for each episode that was recorded, with its seed."""
    found = {numbers[key]: key[2] for key in keys if key in numbers}
    return joined(
        element("button", str(seed), type="button", class_="replayed", data_replay=str(number))
        for number, seed in found.items()
    )
