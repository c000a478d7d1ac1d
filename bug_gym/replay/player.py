"""Episodes side by side: in a notebook, or written into a page of their own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bug_gym.checks import shortened
from bug_gym.files import replaced_when_done, writable
from bug_gym.replay.page import framed, page_of
from bug_gym.replay.recording import Episode

HTML = ".html"
"""What the name of a page ends in."""


@dataclass(frozen=True)
class Player:
    """Some episodes side by side; a notebook shows it as it is."""

    episodes: tuple[Episode, ...]
    """What is played."""

    def page(self) -> str:
        """The whole page, as a text."""
        return page_of([one.title for one in self.episodes], [one.packed for one in self.episodes])

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        return framed(self.page())


def show(*episodes: Episode) -> Player:
    """Episodes in a player, side by side; the last line of a notebook's cell shows it.

    Args:
        episodes: what to play, such as those of several policies in one world.

    Raises:
        ValueError: none, or something else among them.
    """
    if not episodes:
        raise ValueError("got no episode to show, expected at least one")
    for one in episodes:
        if not isinstance(one, Episode):
            expected = "episodes, as bug_gym.evaluation.record_episode or a Recorder's `episode` gives one"
            raise ValueError(f"got {shortened(one)} to show, expected {expected}")
    return Player(episodes)


def write_player(path: str | Path, *episodes: Episode) -> None:
    """Write the player of some episodes as a page, which a browser opens from disk.

    Raises:
        ValueError: no episodes, something else among them, or a path that does not end in .html.
    """
    text = show(*episodes).page()
    with replaced_when_done(writable(path, [HTML])) as partial:
        partial.write_text(text, encoding="utf-8", newline="\n")
