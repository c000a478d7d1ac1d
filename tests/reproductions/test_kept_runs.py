"""Long reproductions go on where they were stopped."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from bug_gym.agents.bugs.bug2 import Bug2
from bug_gym.cli import main
from bug_gym.files import one_writer
from bug_gym.reproductions import cylinder_claims, reproduction, still_things
from bug_gym.reproductions.kept import Kept, code_of
from bug_gym.reproductions.result import Settings
from bug_gym.reproductions.still_things import Drive


def kept(path: Path) -> Kept[Drive]:
    """The drives of a file."""
    return Kept(path, Drive, lambda one: (one.policy, one.seed))


class Mine(Bug2):
    """A policy from outside."""


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
        ('{"policy": "bug2", "seed": 1, "outcome": "success", "said": ""}', "line 3: steps: Field required"),
        (
            '{"policy": "bug2", "seed": "1", "outcome": "success", "said": "", "steps": 40}',
            "line 3: seed: Input should",
        ),
        ("nonsense", "line 3: Expecting value"),
        (json.dumps(ONE._replace(outcome="collision")._asdict()), "line 3: contradicts what an earlier line says"),
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


def first_line(path: Path, **changes: str) -> bytes:
    """The first line of a file, its versions changed."""
    said = json.loads(path.read_bytes().split(b"\n")[0])
    return json.dumps({**said, "versions": {**said["versions"], **changes}}).encode()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"bug_gym_source": "0123"}, "holds what another source of bug_gym has made.*; name another file, or remove"),
        ({"numba": "0.1"}, "holds another run: versions.numba was .*; name another file, or remove this one"),
    ],
)
def test_runs_that_other_code_has_found_are_refused(tmp_path: Path, changes: dict[str, str], told: str) -> None:
    path = tmp_path / "drives.jsonl"
    kept(path).add([ONE])
    text = path.read_bytes()
    path.write_bytes(text.replace(text.split(b"\n")[0], first_line(path, **changes)))
    text = path.read_bytes()
    with pytest.raises(ValueError, match=told):
        reproduction("still-things")(Settings(seeds=1, policies=("bug2",), data=path))
    assert path.read_bytes() == text


def test_a_file_that_does_not_say_which_code_has_found_its_runs_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "drives.jsonl"
    path.write_text(json.dumps(ONE._asdict()) + "\n")
    with pytest.raises(ValueError, match="line 1 does not say which code .*; name another file, or remove this one"):
        kept(path)


def test_runs_of_a_policy_from_outside_are_refused_once_its_code_has_changed(tmp_path: Path) -> None:
    path, mine, other = tmp_path / "drives.jsonl", {"mine.py:Mine": "0123"}, {"other.py:Other": "4567"}
    for code in (mine, other, {}, mine, mine | other):
        Kept(path, Drive, lambda one: (one.policy, one.seed), code)
    with pytest.raises(ValueError, match="another run: policies.mine.py:Mine was"):
        Kept(path, Drive, lambda one: (one.policy, one.seed), {"mine.py:Mine": "89ab"})
    assert list(code_of(["bug2", f"{__file__}:Mine"])) == [f"{__file__}:Mine"]


def test_a_second_process_does_not_add_to_a_file(tmp_path: Path) -> None:
    path = tmp_path / "drives.jsonl"
    settings = Settings(seeds=1, policies=("bug2",), data=path)
    with one_writer(path), pytest.raises(ValueError, match="drives.jsonl is in use: process"):
        reproduction("still-things")(settings)
    reproduction("still-things")(settings)
    other = Settings(seeds=1, policies=("bug2",), data=tmp_path / "answers.jsonl")
    with one_writer(path):
        reproduction("cylinder-claims")(other)


def test_who_interrupts_is_told_how_many_runs_the_file_keeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drive = still_things.drive

    def interrupted(policy: str, seed: int) -> Drive:
        if seed == still_things.BLOCK:
            raise KeyboardInterrupt
        return drive(policy, seed)

    monkeypatch.setattr(still_things, "drive", interrupted)
    path = tmp_path / "drives.jsonl"
    seeds = str(still_things.BLOCK + 1)
    assert main(["reproduce", "still-things", "--policies", "bug2", "--seeds", seeds, "--data", str(path)]) == 130
    told = f"{path} keeps {still_things.BLOCK} runs, the same command goes on"
    assert capsys.readouterr().err.endswith(f"bug-gym: interrupted; {told}\n")


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
