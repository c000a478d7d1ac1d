"""Long reproductions go on where they were stopped."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from bug_gym.reproductions import cylinder_claims, reproduction, still_things
from bug_gym.reproductions.kept import Kept
from bug_gym.reproductions.result import Settings
from bug_gym.reproductions.still_things import Drive


def kept(path: Path) -> Kept[Drive]:
    """The drives of a file."""
    return Kept(path, Drive, lambda one: (one.policy, one.seed))


ONE, OTHER = Drive("bug2", 1, "success", "", 40), Drive("bug2", 2, "gave_up", "stuck", 7)


def test_what_was_added_is_there_the_next_time(tmp_path: Path) -> None:
    path = tmp_path / "drives.jsonl"
    kept(path).add([ONE])
    kept(path).add([OTHER])
    assert list(kept(path).found.values()) == [ONE, OTHER]
    assert ("bug2", 2) in kept(path) and ("bug2", 3) not in kept(path)


def test_a_line_that_a_kill_has_torn_is_dropped_and_no_other(tmp_path: Path) -> None:
    path = tmp_path / "drives.jsonl"
    kept(path).add([ONE, OTHER])
    path.write_bytes(path.read_bytes()[:-9])
    kept(path).add([Drive("bug2", 3, "timeout", "", 600)])
    assert [one.seed for one in kept(path).found.values()] == [1, 3]


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('{"policy": "bug2", "seed": 1, "outcome": "success", "said": ""}', "line 2: steps: Field required"),
        (
            '{"policy": "bug2", "seed": "1", "outcome": "success", "said": "", "steps": 40}',
            "line 2: seed: Input should",
        ),
        ("nonsense", "line 2: Expecting value"),
        (json.dumps(ONE._replace(outcome="collision")._asdict()), "line 2: contradicts what an earlier line says"),
    ],
)
def test_a_line_that_is_wrong_is_told_and_nothing_is_lost(tmp_path: Path, line: str, told: str) -> None:
    path = tmp_path / "drives.jsonl"
    kept(path).add([ONE])
    text = path.read_text() + line + "\n"
    path.write_text(text)
    with pytest.raises(ValueError, match=told):
        kept(path)
    assert path.read_text() == text


def test_still_things_drives_only_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = reproduction("still-things")(Settings(seeds=6, policies=("bug2", "dist_bug")))
    path = tmp_path / "drives.jsonl"
    reproduction("still-things")(Settings(seeds=4, policies=("bug2",), data=path))
    driven: list[tuple[str, int]] = []
    drive = still_things.drive

    def counted(policy: str, seed: int) -> Drive:
        driven.append((policy, seed))
        return drive(policy, seed)

    monkeypatch.setattr(still_things, "drive", counted)
    again = reproduction("still-things")(Settings(seeds=6, policies=("bug2", "dist_bug"), data=path))
    assert sorted(driven) == [("bug2", 4), ("bug2", 5)] + [("dist_bug", seed) for seed in range(6)]
    assert again.data == whole.data


def test_cylinder_claims_drives_only_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "answers.jsonl"
    first = reproduction("cylinder-claims")(Settings(seeds=2, policies=("bug2",), data=path))

    def nothing(*_: Any) -> None:
        raise AssertionError("driven again")

    monkeypatch.setattr(cylinder_claims, "answers", nothing)
    assert reproduction("cylinder-claims")(Settings(seeds=2, policies=("bug2",), data=path)).data == first.data
