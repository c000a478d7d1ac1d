"""Table 1 of Oni and Wang: six bugs on the twelve routes of the map of their Fig. 1.

Side by side: the printed length, the ideal length with square and with rounded corners, and ours. A robot of radius
0.2 m with 360 beams follows walls at the paper's 1 m and turns left; Rev2 and Rev3 alternate, the first hit left.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bug_gym.config import parse_yaml
from bug_gym.evaluation import evaluate
from bug_gym.evaluation.rows import EpisodeRow
from bug_gym.reproductions.replayable import replayable
from bug_gym.reproductions.result import Reproduction, Settings, Table

SOURCE = Path(__file__).parent.parent / "configs" / "reproductions" / "oni_wang_table_1.yaml"
CLEARANCE = 1.0
STEP_LENGTH = 0.1
OVERRIDES = {"robot.radius": 0.2, "lidar.beams": 360, "lidar.range": 10.0, "time.step": 0.1, "time.limit": 1000.0}


def allowed_difference(ideal: float) -> float:
    """How far a robot's length may be from the ideal one [m]: 1.5 % or three steps."""
    return max(0.015 * ideal, 3.0 * STEP_LENGTH)


def asked(table: Mapping[str, Any]) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The policies and the suite of the table's cells."""
    scenarios = [
        {
            "scenario": "oni_wang",
            "label": route,
            "overrides": {**OVERRIDES, "world.start": route[0], "world.goal": route[1]},
        }
        for route in table["routes"]
    ]
    policies = [
        {"name": name, "parameters": {"clearance": CLEARANCE, "turn": "left", **parameters}}
        for name, parameters in table["policies"].items()
    ]
    return policies, {"name": "oni_wang_table_1", "version": 1, "scenarios": scenarios, "seeds": {"count": 1}}


def drive(table: Mapping[str, Any], settings: Settings) -> dict[str, list[EpisodeRow]]:
    """One row a policy and route, in the table's order."""
    rows = evaluate(*asked(table), workers=settings.workers, progress=settings.progress)
    by_cell = {(row.policy, row.scenario): row for row in rows}
    return {name: [by_cell[name, route] for route in table["routes"]] for name in table["policies"]}


def cell(row: EpisodeRow, ideal: float | None, printed: float | None) -> dict[str, Any]:
    """What one cell of the table holds, and whether it is as it should be."""
    length = row.path_length + row.goal_distance if row.success else None
    agrees = (length is None) == (printed is None) == (ideal is None)
    if length is not None and ideal is not None:
        agrees = agrees and abs(length - ideal) <= allowed_difference(ideal)
    return {"length": length, "verdict": row.verdict, "outcome": row.outcome, "agrees": agrees}


def text(length: float | None) -> str:
    """A length for the eye; F where the robot cycles for ever."""
    return "F" if length is None else f"{length:.2f}"


def reproduce(settings: Settings) -> Reproduction:
    """Run the table."""
    table = parse_yaml(SOURCE.read_text(encoding="utf-8"))
    driven = drive(table, settings)
    rows = [row for mine in driven.values() for row in mine]
    policies, suite = asked(table)
    lines, data = [], {}
    for name, mine in driven.items():
        kinds = {kind: table[kind][name] for kind in ("printed", "sharp", "rounded")}
        cells = [cell(*parts) for parts in zip(mine, kinds["rounded"], kinds["printed"], strict=True)]
        data[name] = {
            route: {**one, **{kind: values[index] for kind, values in kinds.items()}}
            for index, (route, one) in enumerate(zip(table["routes"], cells, strict=True))
        }
        marks = table["cells"].get(name, {})
        printed = [
            text(value) + (f" ({marks[route]})" if route in marks else "")
            for route, value in zip(table["routes"], kinds["printed"], strict=True)
        ]
        ours = [text(one["length"]) + ("" if one["agrees"] else " !") for one in cells]
        lines += [
            [name, "printed", *printed, total(kinds["printed"])],
            ["", "ideal, square", *map(text, kinds["sharp"]), total(kinds["sharp"])],
            ["", "ideal, rounded", *map(text, kinds["rounded"]), total(kinds["rounded"])],
            ["", "ours", *ours, total([one["length"] for one in cells])],
        ]
    holds = all(one["agrees"] for routes in data.values() for one in routes.values())
    notes = [f"({mark}) {note}" for mark, note in table["notes"].items()]
    notes.append(
        "F: cycles for ever. Bug1 goes back to its leave point the way it came, as printed (return_rule: same)."
    )
    notes.append("ours: within 1.5 % or three steps of the rounded ideal; ! marks a cell that is not.")
    header = ["policy", "", *table["routes"], "total"]
    return Reproduction(
        "oni-wang-table-1",
        [Table("Distance travelled [m] on the map of Fig. 1", header, lines)],
        notes,
        {"cells": data},
        holds,
        rows=rows,
        episodes=replayable(rows, policies, suite["scenarios"]),
    )


def total(lengths: list[float | None]) -> str:
    """The sum of a row, where no route fails."""
    known = [length for length in lengths if length is not None]
    return f"{math.fsum(known):.2f}" if len(known) == len(lengths) else "-"
