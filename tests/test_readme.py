"""The examples of the README and of the guide run as they stand there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
PAGES = [README, ROOT / "docs" / "index.md", *sorted((ROOT / "docs" / "guide").glob("*.md"))]


def examples_of(page: Path) -> list[tuple[str, str]]:
    """Each block of Python in a page, under its page's and its heading's name."""
    found, heading = [], ""
    for block in re.finditer(r"^#+ ([^\n]+)$|^```(\w*)\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.M):
        heading = block[1] or heading
        if block[2] == "python":
            found.append((f"{page.stem}, {heading}", block[3]))
    return found


EXAMPLES = {page: examples_of(page) for page in PAGES}
CASES = [example for page in PAGES for example in EXAMPLES[page]]


@pytest.mark.parametrize(("title", "code"), CASES, ids=[title for title, _ in CASES])
def test_the_example_runs(title: str, code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "stable_baselines3" in code:
        pytest.importorskip("stable_baselines3")
    if "torchrl" in code:
        pytest.importorskip("torchrl")
    if "minari" in code:
        pytest.importorskip("minari")
        monkeypatch.setenv("MINARI_DATASETS_PATH", "datasets")
    monkeypatch.chdir(tmp_path)
    exec(compile(code, title, "exec", dont_inherit=True), {"__name__": "readme"})


def test_there_is_an_example_of_each_face() -> None:
    text = "".join(code for _, code in EXAMPLES[README])
    for name in ("gym.make(", "gym.make_vec(", "parallel_env(", "make_vec_env(", "make_policy(", "evaluate("):
        assert name in text


def test_each_block_of_python_is_an_example() -> None:
    for page in PAGES:
        assert len(EXAMPLES[page]) == page.read_text(encoding="utf-8").count("```python"), page


BADGES = ("https://img.shields.io/badge/", "https://colab.research.google.com/assets/")
"""Where the small pictures at the top come from, which say what they show in words, too."""


def test_each_picture_is_there() -> None:
    for path in re.findall(r"!\[[^]]*\]\(([^)]+)\)", README.read_text(encoding="utf-8")):
        assert (README.parent / path).is_file() or path.startswith(BADGES), path


def test_each_notebook_is_named() -> None:
    text = README.read_text(encoding="utf-8")
    assert all(f"](notebooks/{path.name})" in text for path in (README.parent / "notebooks").glob("*.ipynb"))
