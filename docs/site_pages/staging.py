"""The folder that Sphinx builds from: the pages that are written by hand, with their links led to where things lie there."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"

BY_HAND: dict[str, str] = {
    "docs/index.md": "index.md",
    "docs/architecture.md": "architecture.md",
    "docs/speed.md": "speed.md",
    "docs/planner_speed.md": "planner_speed.md",
    "docs/trials.md": "trials.md",
    "docs/worlds.md": "worlds.md",
    "docs/examples/README.md": "examples/README.md",
    "CHANGELOG.md": "CHANGELOG.md",
    "CONTRIBUTING.md": "CONTRIBUTING.md",
    "SECURITY.md": "SECURITY.md",
}
"""Pages beside those of the guide, the results and the notebooks -> their place on the site."""

INSTEAD = {
    "README.md": "index.md",
    "docs/README.md": "index.md",
    "docs/policies.md": "algorithms/index.md",
}
"""Pages that the site has in another form -> that."""

LINK = re.compile(r"(?<=\]\()([^)\s]+)(?=\))")


def places() -> dict[str, str]:
    """Where each page by hand, notebook and file beside them lies on the site, by its path in the repository."""
    found = dict(BY_HAND)
    for pattern in ("guide/*.md", "results/*.md", "results/*.png", "results/*.json", "worlds/*.png", "*.png", "*.gif"):
        for path in sorted(DOCS.glob(pattern)):
            found[path.relative_to(ROOT).as_posix()] = path.relative_to(DOCS).as_posix()
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        found[path.relative_to(ROOT).as_posix()] = f"tutorials/{path.name}"
    return found


def stage(folder: Path) -> None:
    """Write all of them into a folder."""
    known = places()
    for source, place in known.items():
        target = folder / place
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.endswith(".md"):
            text = (ROOT / source).read_text(encoding="utf-8")
            target.write_text(led(text, source, place, folder, known), encoding="utf-8")
        else:
            shutil.copyfile(ROOT / source, target)


def led(text: str, source: str, place: str, folder: Path, known: dict[str, str]) -> str:
    """A page with links to where things lie on the site; other files of the repository come along, to be downloaded.

    Raises:
        ValueError: a link to what is not there.
    """

    def target(found: re.Match[str]) -> str:
        link, hash_mark, anchor = found[1].partition("#")
        if "://" in link or not link or link.startswith("mailto:"):
            return found[1]
        path = Path(os.path.normpath(ROOT / Path(source).parent / link))
        if not path.exists():
            raise ValueError(f"{source}: {found[1]} leads nowhere")
        name = path.relative_to(ROOT).as_posix()
        if name in INSTEAD:
            return relative(INSTEAD[name], place)
        if name not in known:
            copy(path, folder / "files" / name)
            return relative(f"files/{name}", place)
        return relative(known[name], place) + hash_mark + anchor

    return LINK.sub(target, text)


def badges(repository: str) -> str:
    """The buttons of the front page: what the tests of the main branch said last, and the notebook in Colab.

    Args:
        repository: owner and name on GitHub.
    """
    actions = f"https://github.com/{repository}/actions/workflows/test.yml"
    notebook = f"https://colab.research.google.com/github/{repository}/blob/main/notebooks/colab.ipynb"
    colab = "https://colab.research.google.com/assets/colab-badge.svg"
    return f"[![tests]({actions}/badge.svg?branch=main)]({actions}) [![Open in Colab]({colab})]({notebook})"


def relative(place: str, page: str) -> str:
    """The way from a page to a place of the site."""
    return os.path.relpath(place, Path(page).parent).replace(os.sep, "/")


def copy(path: Path, target: Path) -> None:
    """Bring a file along."""
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(path, target)
