"""The page that plays some episodes side by side: one text with its style, its script and the episodes in it.

It forbids itself to load anything (Content-Security-Policy); texts of episodes come into it as text nodes only.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from string import Template

PARTS = Path(__file__).parent
"""Where the template, the style and the script lie."""
HEIGHT = 640
"""Height of the player in a notebook [pixels]."""


def page_of(titles: Sequence[str], episodes: Sequence[str]) -> str:
    """The page of some episodes, packed, with the titles of each."""
    script = "\n".join([part("player.js"), part("alone.js")])
    return Template(part("player.html")).substitute(
        title=escape(" · ".join(dict.fromkeys(title or "episode" for title in titles))),
        style=part("player.css"),
        episodes=json.dumps(episodes),
        script=script,
        digest=digest(script),
    )


def framed(page: str) -> str:
    """A page in a frame of its own: neither its style nor its script reaches the notebook that it stands in."""
    style = f"width:100%;height:{HEIGHT}px;border:0"
    return f'<iframe srcdoc="{escape(page)}" sandbox="allow-scripts" style="{style}"></iframe>'


def part(name: str) -> str:
    """A file of the player: `player.js`, `player.css`."""
    return (PARTS / name).read_text(encoding="utf-8")


def digest(script: str) -> str:
    """The digest by which a page says that it may run a script, and no other."""
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
