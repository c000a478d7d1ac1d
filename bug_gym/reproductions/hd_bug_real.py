"""The map planner on real data: BARN's worlds, and streets of recorded pedestrians to be crossed, by HD-BUG too.

Needs a folder (`--data`) with `barn_worlds.jsonl`, `pedestrians_eth.csv` and `pedestrians_hotel.csv`. Recorded pedestrians
don't make way and don't see the robot. A collision is the robot's fault where it could have been avoided and whom it hit
had been there to be seen, by the rules of `avoidable`; both counts are printed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bug_gym.reproductions import barn
from bug_gym.reproductions.avoidable import SUDDEN, appeared, is_avoidable
from bug_gym.reproductions.claims import as_percent, mean, numbers, of, paired, run, told
from bug_gym.reproductions.replayable import Replayable, replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table
from bug_gym.worlds.barn_files import load_barn

SCENES = ("pedestrians_eth.csv", "pedestrians_hotel.csv")
CROSSINGS = 100
"""Of each scene."""
SUCCESS_ASKED, SCORE_ASKED, FAULTLESS_ASKED = 0.98, 0.24, 0.98
"""Shares of the worlds, of BARN's score by the metric of 2022 (at most 0.25), and of the crossings."""
PAPER, PREDICTOR = "hd_bug", "kalman"
LINES = (PREDICTOR, PAPER)
"""The map planner with a predictor, of which something is claimed, and HD-BUG itself."""
NETWORKS = ("navigator", "hd_bug_map", "ppo_mixed")
"""Who drives the robot that networks were trained for: the switch between planner and network, and each alone."""
SCANNER = {"beams": 64, "range": 5.0, "noise": 0.01}
"""That robot's."""
CLEARANCE = 1.25 * 0.25 + 2.0 * 0.01
"""Centre to wall that both keep in the streets [m]: what the map planner keeps by itself, of radius and noise."""


def crossing(path: Path) -> dict[str, Any]:
    """The scenario of a recorded scene."""
    return {
        "robot": {"kinematics": "holonomic", "radius": 0.25, "max_speed": 1.5},
        "lidar": {"beams": 180, "range": 10.0, "noise": 0.01},
        "time": {"limit": 90.0},
        "world": {"family": "replay", "path": str(path)},
    }


def entry(line: str) -> dict[str, Any]:
    """HD-BUG, or the map planner with a predictor, at the same clearance, as a policy of a suite."""
    if line == PAPER:
        return {"name": PAPER, "label": PAPER, "parameters": {"clearance": CLEARANCE}}
    return {"name": "hd_bug_map", "label": line, "parameters": {"predictor": line}}


def reproduce(settings: Settings) -> Reproduction:
    """Drive in the benchmark's worlds and across the recorded streets.

    Raises:
        ValueError: no data given, or a folder without the files.
    """
    if settings.data is None or not settings.data.is_dir():
        raise ValueError(f"expected with --data a folder that holds barn_worlds.jsonl and {', '.join(SCENES)}")
    tables, data, holds = [], {}, True
    worlds = drive_barn(settings, settings.data / "barn_worlds.jsonl")
    tables.append(worlds[0])
    data["barn"] = worlds[1]
    episodes = worlds[2]
    holds = worlds[1]["success"] >= SUCCESS_ASKED and worlds[1]["score"] >= SCORE_ASKED
    lines = []
    asked = settings.policies or LINES
    entries = [entry(one) for one in asked]
    differences: dict[str, Any] = {}
    faults, crossings = dict.fromkeys(asked, 0), 0
    for scene in SCENES:
        scenario = crossing(settings.data / scene)
        streets = [{"scenario": scenario, "label": scene}]
        rows = run(entries, streets, settings.seeds or CROSSINGS, settings, name="hd-bug-real")
        episodes += replayable(rows, entries, streets)
        crossings += settings.seeds or CROSSINGS
        for line, described in zip(asked, entries, strict=True):
            mine = of(rows, policy=line)
            hits = of(mine, outcome="collision")
            avoidable = [row for row in hits if is_avoidable(described, scenario, row)]
            sudden = sum(appeared(described, scenario, row) for row in avoidable)
            faults[line] += len(avoidable) - sudden
            time = f"{mean([row.time for row in mine if row.success]):.2f}"
            gap = ["", "", ""]
            if line != PREDICTOR and PREDICTOR in asked:
                differences[f"{scene}, {line}"] = found = paired(mine, of(rows, policy=PREDICTOR))
                gap = told(found["success"], 100.0, 1)
            lines.append([scene, line, as_percent(mine), str(len(hits)), str(len(avoidable)), str(sudden), time, *gap])
            data[f"{scene}, {line}"] = {
                **numbers(mine),
                "avoidable_collisions": len(avoidable),
                "of_them_sudden": sudden,
            }
    planners = [number for line, number in faults.items() if line != PAPER]
    holds = holds and all(number <= (1.0 - FAULTLESS_ASKED) * crossings for number in planners)
    networks: dict[str, Any] = {}
    if not settings.policies:
        of_networks, networks, driven = drive_networks(settings)
        tables.append(of_networks)
        episodes += driven
    header = [
        "scene",
        "hd_bug, or hd_bug_map with",
        "reached [%]",
        "collisions",
        "of them avoidable",
        "of these sudden",
    ]
    header += ["time [s]", "minus kalman [%]", "95 %", "p (McNemar)"]
    tables.append(Table(f"Crossings of recorded pedestrians, {crossings} in all", header, lines))
    kept = {"results": data, "paired": differences, "networks_robot": networks}
    return Reproduction("hd-bug-real", tables, [barn.DWA, NOTE], kept, holds, episodes=episodes)


def drive_networks(settings: Settings) -> tuple[Table, dict[str, Any], list[Replayable]]:
    """The same streets for the robot that the networks were trained for: a table, its numbers, and the episodes."""
    assert settings.data is not None
    lines, data, episodes = [], {}, []
    for scene in SCENES:
        scenario = crossing(settings.data / scene) | {"robot": {"kinematics": "differential"}, "lidar": SCANNER}
        streets = [{"scenario": scenario, "label": scene}]
        rows = run(NETWORKS, streets, settings.seeds or CROSSINGS, settings, name="hd-bug-real-networks")
        episodes += replayable(rows, NETWORKS, streets, "networks, {}")
        for policy in NETWORKS:
            mine = of(rows, policy=policy)
            hits = of(mine, outcome="collision")
            faults = [
                row for row in hits if is_avoidable(policy, scenario, row) and not appeared(policy, scenario, row)
            ]
            gap = paired(of(rows, policy=NETWORKS[0]), mine)["success"] if policy != NETWORKS[0] else None
            differs = ["", "", ""] if gap is None else told(gap, 100.0, 1)
            time = f"{mean([row.time for row in mine if row.success]):.2f}"
            lines.append([scene, policy, as_percent(mine), str(len(hits)), str(len(faults)), time, *differs])
            data[f"{scene}, {policy}"] = {**numbers(mine), "faults": len(faults), "navigator_minus": gap}
    header = ["scene", "policy", "reached [%]", "collisions", "by its fault", "time [s]"]
    header += ["navigator minus this [%]", "95 %", "p (McNemar)"]
    return Table("The same streets, the robot of the networks", header, lines), data, episodes


NOTE = f"sudden: with somebody who came into the recording less than {SUDDEN:g} s before; not the robot's fault."


def drive_barn(settings: Settings, path: Path) -> tuple[Table, dict[str, Any], list[Replayable]]:
    """The benchmark's worlds with its differential robot: a table, its numbers, and the episodes."""
    maps = load_barn(str(path))
    numbered = sorted(maps)[: settings.seeds]
    scenarios = [barn.scenario("jackal", str(path), number) for number in numbered]
    rows = run(["hd_bug_map"], scenarios, 1, settings, name="hd-bug-barn", first=0)
    scores = {
        metric: mean(
            [barn.score(row, maps[number].reference_length, metric) for row, number in zip(rows, numbered, strict=True)]
        )
        for metric in barn.LEAST_TIMES
    }
    hits = sum(row.outcome == "collision" for row in rows)
    header = ["policy", "reached [%]", "collisions", "score", "score of 2022", "time [s]"]
    time = f"{mean([row.time for row in rows if row.success]):.2f}"
    table = Table(f"{len(rows)} worlds of the BARN benchmark, the differential robot", header,
                  [["hd_bug_map", as_percent(rows), str(hits), *(f"{one:.4f}" for one in scores.values()), time]])  # fmt: skip
    # The claim about `score` was made by the metric of 2022, and is kept.
    told = {**numbers(rows), "score": scores["score_2022"], "score_2024": scores["score_2024"]}
    return table, told, replayable(rows, ["hd_bug_map"], scenarios, "BARN, {}")
