"""The links of the built site: each leads to a file that is there, and to an anchor in it; those to others are listed."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """What a page links to, and the anchors that it has."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: set[str] = set()
        """Values of href and src."""
        self.anchors: set[str] = set()
        """Values of id and of an anchor's name."""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note what a tag links to and is called."""
        for key, value in attrs:
            if key in ("href", "src") and value:
                self.links.add(value)
            elif value and (key == "id" or (key == "name" and tag == "a")):
                self.anchors.add(value)


def check(site: Path) -> tuple[list[str], list[str]]:
    """Links of a site that lead nowhere, each with its page, and all links to elsewhere.

    Args:
        site: the folder of built pages.
    """
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    broken, elsewhere = [], set()
    for path, page in pages.items():
        for link in sorted(page.links):
            parts = urlsplit(link)
            if parts.scheme in ("http", "https") or parts.netloc:
                elsewhere.add(link)
            elif not parts.scheme and not leads_somewhere(path, unquote(parts.path), unquote(parts.fragment), pages):
                broken.append(f"{path.relative_to(site)}: {link}")
    return broken, sorted(elsewhere)


def leads_somewhere(page: Path, link: str, anchor: str, pages: dict[Path, Page]) -> bool:
    """Whether a link's file is there, and its anchor in it."""
    target = (page.parent / link).resolve() if link else page.resolve()
    if target.is_dir():
        target = target / "index.html"
    if not target.is_file():
        return False
    found = pages.get(page if not link else target)
    return not anchor or found is None or anchor in found.anchors
