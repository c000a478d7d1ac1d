"""The README's examples run as they stand there."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

README = Path(__file__).parent.parent / "README.md"
EXAMPLES = re.findall(r"### ([^\n]+)\n(?:(?!###).)*?```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize(("title", "code"), EXAMPLES, ids=[title for title, _ in EXAMPLES])
def test_the_example_runs(title: str, code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "stable_baselines3" in code:
        pytest.importorskip("stable_baselines3")
    monkeypatch.chdir(tmp_path)
    exec(compile(code, f"README, {title}", "exec"), {"__name__": "readme"})


def test_there_is_an_example_of_each_face() -> None:
    text = "".join(code for _, code in EXAMPLES)
    for name in ("gym.make(", "gym.make_vec(", "parallel_env(", "make_vec_env(", "make_policy(", "evaluate("):
        assert name in text


def test_each_picture_is_there() -> None:
    for path in re.findall(r"!\[[^]]*\]\(([^)]+)\)", README.read_text(encoding="utf-8")):
        assert (README.parent / path).is_file(), path
