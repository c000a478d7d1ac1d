"""`bug-gym reproduce offline` with trainings of seconds: what it counts, and that its claims are of its numbers."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("stable_baselines3", reason="stable-baselines3 comes with the extra `train`")
pytest.importorskip("minari", reason="minari comes with the extra `data`")

from bug_gym.agents import make_policy
from bug_gym.agents.learning import training
from bug_gym.agents.learning.training import train
from bug_gym.config import load
from bug_gym.held_out import play
from bug_gym.intervals import wilson_interval
from bug_gym.reproductions import offline, reproduction
from bug_gym.reproductions.result import Settings

SMALL = {"n_timesteps": 20, "eval_freq": 10, "eval_episodes": 2, "batch_size": 16, "policy_kwargs": {"net_arch": [8]}}
DATA = {"data": {"policies": ["bug2", "random"], "episodes": 2}}
ONLINE = {
    "n_timesteps": 64,
    "n_envs": 8,
    "n_steps": 4,
    "batch_size": 32,
    "eval_freq": 32,
    "eval_episodes": 2,
    "test_episodes": 2,
    "policy_kwargs": {"net_arch": [8]},
}
WORLDS = 4


def small(label: str) -> tuple[str, dict[str, Any]]:
    """A training of a second in place of one of the table."""
    name, changes = offline.TRAININGS[label]
    own = {"episodes_per_round": 2, "expert": "bug2"} if name == "dagger_hd_bug" else DATA
    return name, {**changes, **SMALL, **own}


def test_every_kind_is_trained_and_judged_in_the_same_worlds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(offline, "WORLDS", WORLDS)
    monkeypatch.setattr(offline, "COLLECTED", tmp_path)
    monkeypatch.setattr(offline, "ONLINE_CHANGES", ONLINE)
    monkeypatch.setattr(offline, "ENOUGH", 0.0)  # the first validation is enough
    monkeypatch.setattr(offline, "TRAININGS", {label: small(label) for label in offline.TRAININGS})
    begun: list[str | None] = []

    def watched(settings: Any, *arguments: Any, **others: Any) -> Any:
        begun.append(settings.start_from)
        return train(settings, *arguments, **others)

    monkeypatch.setattr(training, "train", watched)
    found = reproduction("offline")(Settings(seeds=1))
    assert found.data["worlds"] == WORLDS and found.data["seeds"] == 1
    assert list(found.data["trainings"]) == [*offline.TRAININGS]
    assert [len(runs) for runs in found.data["trainings"].values()] == [1] * len(offline.TRAININGS)
    assert all(run["steps"] == 20 and run["n"] == WORLDS for (run,) in found.data["trainings"].values())
    beside = found.data["beside"]
    assert (beside["random"]["score"], beside["hd_bug"]["score"]) == (0.0, 1.0)
    scenario = load("dynamic")
    played = play(make_policy("bug2", scenario), scenario, range(WORLDS))
    assert beside["bug2"]["success"] == played.ended("success").mean()
    assert found.holds is all(offline.claims_of(found.data).values())
    table, second = found.tables
    assert [row[0] for row in table.rows] == [*offline.TRAININGS, *offline.BESIDE]
    (start,) = found.data["starts"]
    for name in ("from_nothing", "from_clone"):
        assert [point[0] for point in start[f"{name}_curve"]] == [32, 64]
        assert start[name] == start[f"{name}_curve"][0][1]
    assert [None if path is None else Path(path).name for path in begun] == [None, "clone"]
    assert [row[:3] for row in second.rows] == [
        ["0", *(f"{start[name]:.2f}" for name in ("from_nothing", "from_clone"))]
    ]


def test_rows_of_an_earlier_record_are_kept_with_their_commit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(offline, "WORLDS", WORLDS)
    monkeypatch.setattr(offline, "TRAININGS", {label: small(label) for label in offline.TRAININGS})
    run = {"seed": 0, "n": WORLDS, "success": 0.5, "collision": 0.5, "timeout": 0.0, "return": 1.0, "minutes": 1.0}
    rows = {label: [{**run, "score": -9.0}] for label in offline.TRAININGS}
    earlier = {
        "name": "offline",
        "commit": "abc",
        "scenario": "dynamic",
        "worlds": WORLDS,
        "seeds": 1,
        "trainings": rows,
    }
    path = tmp_path / "earlier.json"
    path.write_text(json.dumps(earlier), encoding="utf-8")
    found = reproduction("offline")(Settings(seeds=1, policies=("dagger_hd_bug",), data=path)).data
    assert list(found["trainings"]) == list(rows) and found["trainings"]["dagger_hd_bug"][0]["steps"] == 20
    kept = found["trainings"]["iql_mixed"][0]
    floor, ceiling = (found["beside"][name]["return"] for name in ("random", "hd_bug"))
    assert kept == {**run, "score": round((1.0 - floor) / (ceiling - floor), 4)}
    assert "`iql_mixed`" in found["remark"] and "`abc`" in found["remark"] and "dagger" not in found["remark"]
    for text, said in (("{", "no record"), (json.dumps({**earlier, "seeds": 2}), "'seeds': 2")):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match=said):
            reproduction("offline")(Settings(seeds=1, policies=("dagger_hd_bug",), data=path))


def test_a_row_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match="bc_hd_bug.*got 'bc'"):
        reproduction("offline")(Settings(policies=("bc",)))


def test_runs_are_pooled_over_their_worlds() -> None:
    runs = [
        {"n": 100, "success": 0.9, "score": 0.8, "minutes": 1.0},
        {"n": 300, "success": 0.5, "score": 0.6, "minutes": 2.0},
    ]
    one, interval = offline.pooled(runs), wilson_interval(240, 400)
    assert one["success"] == 0.6 and (one["low"], one["high"]) == (interval.low, interval.high)
    assert one["score"] == pytest.approx(0.7) and one["minutes"] == 1.5


@pytest.mark.parametrize(("iql", "holds"), [(0.95, True), (0.8, False)])
def test_iql_is_compared_with_the_best_policy_of_its_dataset(iql: float, *, holds: bool) -> None:
    def runs(success: float) -> list[dict[str, Any]]:
        return [{"n": 100, "success": success, "score": success, "minutes": 1.0}]

    trainings = {label: runs(0.5) for label in offline.TRAININGS} | {"iql_mixed": runs(iql)}
    beside = {name: runs(0.9)[0] if name == "hd_bug" else runs(0.1)[0] for name in offline.BESIDE}
    beside["ppo_dynamic"] = runs(0.99)[0]  # is not in the dataset
    claims = offline.claims_of({"trainings": trainings, "beside": beside})
    assert claims["IQL does better than the best policy in its dataset"] is holds


@pytest.mark.parametrize(
    ("nothing", "clone", "own", "holds"),
    [(1.0, 0.5, 0.2, True), (1.0, 0.5, 0.6, False), (None, 0.5, 0.2, True), (1.0, None, 0.2, False)],
)
def test_a_clone_pays_where_it_and_what_follows_take_less_time(
    nothing: float | None, clone: float | None, own: float, *, holds: bool
) -> None:
    one = {"from_nothing": nothing, "from_clone": clone, "clone": {"minutes": own, "success": 0.5}}
    early = {"from_nothing": 9.0, "from_clone": 0.1, "clone": {"minutes": 0.1, "success": 0.5}}
    assert offline.is_sooner([early, one]) is holds
