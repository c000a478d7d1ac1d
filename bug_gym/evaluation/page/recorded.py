"""Episodes that were recorded, in a page: the letters of each in an element of its own, and buttons that play them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from bug_gym.evaluation.page.markup import Markup, element, joined

Key = tuple[str, str, int]
"""Policy and scenario by label, and seed."""


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
