"""Lets a page's relative links lead to a commit on the web: `python docs/absolute_links.py PAGE REPOSITORY COMMIT`.

An index of packages shows README.md without the folders beside it. Where these lie on the web is known to the workflow that
publishes (release.yml), and nowhere in the sources. A button of Colab then opens the notebook there.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s#]+)(#[^)\s]*)?\)")
"""A picture or a link: whether it is one, its text, the file and the place in it."""
BUTTON = re.compile(r"\[(!\[[^\]]*\]\([^)\s]+\))\]\(([^)\s#]+)\)")
"""A picture that is a link: the picture, and the file."""
COLAB = "https://colab.research.google.com"
"""Opens notebooks of GitHub, by their addresses there."""
GITHUB = "https://github.com"


def absolute(text: str, folder: Path, repository: str, commit: str) -> str:
    """The text of a page with links to files of its folder as links to the web; others, and code, stay.

    Args:
        text: of the page, in Markdown.
        folder: in which it lies.
        repository: address on the web.
        commit: to show the files of.
    """

    def linked(found: re.Match[str]) -> str:
        mark, told, path, place = found.groups()
        if not (folder / path).exists():
            return found[0]
        return f"{mark}[{told}]({repository}/{'raw' if mark else 'blob'}/{commit}/{path}{place or ''})"

    def leading(found: re.Match[str]) -> str:
        button, path = found.groups()
        if not (folder / path).exists():
            return found[0]
        opens = COLAB in button and repository.startswith(GITHUB)
        start = repository.replace(GITHUB, f"{COLAB}/github") if opens else repository
        return f"[{button}]({start}/blob/{commit}/{path})"

    return BUTTON.sub(leading, LINK.sub(linked, text))


if __name__ == "__main__":
    page = Path(sys.argv[1])
    page.write_text(absolute(page.read_text(encoding="utf-8"), page.parent, *sys.argv[2:4]), encoding="utf-8")
